//! The processor: who shares the loop's core, how fast it runs, and how deep it sleeps.

use takt_rt::linux::Outcome;

use super::cpu_list;
use super::finding::{Check, Finding, Group};
use super::source::Source;

const SIBLING: Check = Check {
    key: "smt_sibling",
    group: Group::Processor,
    title: "SMT sibling",
    source: "/sys/devices/system/cpu/cpu*/topology/thread_siblings_list",
    why: "the other hardware thread of the core takes execution units and cache from the loop whenever it likes, whatever the priorities",
};

const GOVERNOR: Check = Check {
    key: "governor",
    group: Group::Processor,
    title: "frequency governor",
    source: "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
    why: "a governor that follows the load finds a loop that sleeps most of the time idle, and runs it slowly or changes the frequency under it",
};

const IDLE_STATES: Check = Check {
    key: "idle_states",
    group: Group::Processor,
    title: "idle states",
    source: "/sys/devices/system/cpu/cpu*/cpuidle/state*",
    why: "the time that the processor takes to leave an idle state comes on top of every wake-up",
};

const DMA_LATENCY: Check = Check {
    key: "cpu_dma_latency",
    group: Group::Processor,
    title: "cpu_dma_latency",
    source: "/dev/cpu_dma_latency, opened and written",
    why: "while the loop holds this file open, no CPU enters an idle state that takes time to leave",
};

/// An idle state that is left within this time is not noticed beside the latency of the kernel.
const SHORT_EXIT_US: u64 = 10;

pub fn findings(source: &Source, cpu: usize, dma_latency: Outcome, grant_with: &[String]) -> Vec<Finding> {
    let folder = format!("/sys/devices/system/cpu/cpu{cpu}");
    let text = |name: &str| source.text(&format!("{folder}/{name}"));
    let isolated = source.text("/sys/devices/system/cpu/isolated").unwrap_or_default();
    let states = source.names(&format!("{folder}/cpuidle")).into_iter().map(|state| IdleState {
        name: text(&format!("cpuidle/{state}/name")).unwrap_or(state.clone()),
        exit_us: text(&format!("cpuidle/{state}/latency")).and_then(|us| us.parse().ok()).unwrap_or(0),
        is_enabled: text(&format!("cpuidle/{state}/disable")).is_none_or(|disable| disable == "0"),
    });
    vec![
        sibling(text("topology/thread_siblings_list").as_deref(), &isolated, cpu),
        governor(
            text("cpufreq/scaling_governor").as_deref(),
            &text("cpufreq/scaling_available_governors").unwrap_or_default(),
        ),
        idle_states(&states.collect::<Vec<_>>(), dma_latency == Outcome::Granted, cpu),
        held_latency(dma_latency, source.exists("/dev/cpu_dma_latency"), grant_with),
    ]
}

fn sibling(siblings: Option<&str>, isolated: &str, cpu: usize) -> Finding {
    let Some(siblings) = siblings else { return SIBLING.not_known("the kernel does not show the cores") };
    let others: Vec<usize> =
        cpu_list::parse(siblings, cpu).into_iter().filter(|other| *other != cpu).collect();
    let isolated = cpu_list::parse(isolated, cpu);
    let names = cpu_list::write(&others);
    if others.is_empty() {
        SIBLING.good(format!("CPU {cpu} has its core to itself"))
    } else if others.iter().all(|other| isolated.contains(other)) {
        SIBLING.good(format!("CPU {cpu} shares its core with CPU {names}, which is set aside too"))
    } else {
        let off = |other: &usize| format!("echo 0 | sudo tee /sys/devices/system/cpu/cpu{other}/online");
        SIBLING
            .could_be_better(format!("CPU {cpu} shares its core with CPU {names}"))
            .mend(others.iter().map(off).collect::<Vec<_>>().join(" && "))
    }
}

fn governor(governor: Option<&str>, available: &str) -> Finding {
    let Some(governor) = governor else {
        return GOVERNOR.not_known("no frequency scaling here: the firmware or the host decides");
    };
    let is_permitted = available.split_whitespace().any(|name| name == "performance");
    if governor == "performance" {
        return GOVERNOR.good(governor).permitted(true).applied(true);
    }
    let finding = GOVERNOR
        .could_be_better(format!("{governor} (available: {available})"))
        .permitted(is_permitted)
        .applied(false);
    if is_permitted {
        finding.mend("echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")
    } else {
        finding.mend("sudo modprobe cpufreq_performance")
    }
}

/// An idle state of the processor.
struct IdleState {
    name: String,
    exit_us: u64,
    is_enabled: bool,
}

fn idle_states(states: &[IdleState], is_held_off: bool, cpu: usize) -> Finding {
    let enabled: Vec<&IdleState> = states.iter().filter(|state| state.is_enabled).collect();
    let Some(deepest) = enabled.iter().max_by_key(|state| state.exit_us) else {
        return IDLE_STATES.not_known("the kernel manages none: the firmware or the host decides");
    };
    let read = format!("{}, left within {} µs", deepest.name, deepest.exit_us);
    if deepest.exit_us <= SHORT_EXIT_US {
        IDLE_STATES.good(format!("the deepest in use is {read}"))
    } else if is_held_off {
        IDLE_STATES
            .good(format!("the deepest is {read}; held off while the loop runs"))
            .permitted(true)
            .applied(false)
    } else {
        IDLE_STATES
            .could_be_better(format!("the deepest in use is {read}"))
            .permitted(false)
            .mend(format!("sudo cpupower --cpu {cpu} idle-set --disable-by-latency {SHORT_EXIT_US}"))
    }
}

fn held_latency(outcome: Outcome, exists: bool, grant_with: &[String]) -> Finding {
    match outcome {
        Outcome::Granted => DMA_LATENCY.good("can be written").permitted(true),
        Outcome::NotAsked => {
            DMA_LATENCY.could_be_better("the configuration does not ask for it").applied(false)
        }
        Outcome::Refused { .. } if !exists => {
            DMA_LATENCY.not_known("not there: the kernel manages no idle states, or this is a container")
        }
        Outcome::Refused { .. } => {
            let finding = DMA_LATENCY.could_be_better("cannot be written by this user").permitted(false);
            grant_with
                .iter()
                .filter(|command| command.contains("cpu_dma_latency"))
                .fold(finding, |finding, command| finding.mend(command.clone()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn a_sibling_that_may_do_as_it_likes_is_named_with_the_command_that_stops_it() {
        let finding = sibling(Some("3,7"), "", 3);
        assert_eq!(finding.verdict, Verdict::CouldBeBetter);
        assert_eq!(finding.read, "CPU 3 shares its core with CPU 7");
        assert_eq!(finding.mend, ["echo 0 | sudo tee /sys/devices/system/cpu/cpu7/online"]);
        assert_eq!(sibling(Some("0-1"), "", 1).verdict, Verdict::CouldBeBetter);
        assert_eq!(sibling(Some("3,7"), "3,7", 3).verdict, Verdict::Good);
        assert_eq!(sibling(Some("3"), "", 3).verdict, Verdict::Good);
        assert_eq!(sibling(None, "", 3).verdict, Verdict::NotKnown);
    }

    #[test]
    fn a_governor_that_is_available_is_told_from_one_that_is_in_force() {
        let saving = governor(Some("powersave"), "performance powersave");
        assert_eq!(
            (saving.verdict, saving.permitted, saving.applied),
            (Verdict::CouldBeBetter, Some(true), Some(false))
        );
        assert!(saving.mend[0].contains("scaling_governor"));
        let without = governor(Some("schedutil"), "schedutil ondemand");
        assert_eq!(
            (without.permitted, without.mend.as_slice()),
            (Some(false), &["sudo modprobe cpufreq_performance".to_owned()][..])
        );
        assert_eq!(governor(Some("performance"), "performance powersave").verdict, Verdict::Good);
        assert_eq!(governor(None, "").verdict, Verdict::NotKnown);
    }

    #[test]
    fn the_deepest_idle_state_that_is_enabled_counts_unless_the_loop_holds_it_off() {
        let state =
            |name: &str, exit_us, is_enabled| IdleState { name: name.to_owned(), exit_us, is_enabled };
        let intel = [state("POLL", 0, true), state("C1E", 10, true), state("C6", 133, true)];
        assert_eq!(idle_states(&intel, false, 1).verdict, Verdict::CouldBeBetter);
        assert_eq!(
            idle_states(&intel, true, 1).read,
            "the deepest is C6, left within 133 µs; held off while the loop runs"
        );
        let shallow = [state("POLL", 0, true), state("C1E", 10, true), state("C6", 133, false)];
        assert_eq!(idle_states(&shallow, false, 1).verdict, Verdict::Good);
        assert_eq!(idle_states(&[], false, 1).verdict, Verdict::NotKnown);
    }

    #[test]
    fn a_file_that_is_not_there_is_no_fault_and_one_that_is_closed_is() {
        let refused = Outcome::Refused { errno: 13 };
        let grant = ["sudo setcap x=ep takt".to_owned(), "sudo chmod o+rw /dev/cpu_dma_latency".to_owned()];
        assert_eq!(held_latency(refused, false, &grant).verdict, Verdict::NotKnown);
        assert_eq!(held_latency(refused, true, &grant).mend, [grant[1].clone()]);
        assert_eq!(held_latency(Outcome::Granted, true, &[]).permitted, Some(true));
    }
}
