//! Whether the loop has its CPU to itself: the boot parameters, and what is in force.

use super::boot::{parameter, set_aside};
use super::cpu_list;
use super::distribution::Distribution;
use super::finding::{Check, Finding, Group};
use super::source::Source;
use super::threads::Thread;

const ISOLATED: Check = Check {
    key: "isolcpus",
    group: Group::Isolation,
    title: "isolcpus",
    source: "/sys/devices/system/cpu/isolated, /proc/cmdline",
    why: "on a CPU that is not set aside, the scheduler puts other work beside the loop: caches go cold, and kernel work that holds the CPU is waited for",
};

const TICK: Check = Check {
    key: "nohz_full",
    group: Group::Isolation,
    title: "nohz_full",
    source: "/sys/devices/system/cpu/nohz_full, /proc/cmdline",
    why: "the scheduler's tick interrupts the loop up to a thousand times a second, some microseconds each",
};

const RCU: Check = Check {
    key: "rcu_nocbs",
    group: Group::Isolation,
    title: "rcu_nocbs",
    source: "/proc/cmdline, threads rcuop/*",
    why: "the kernel frees memory by callbacks on the CPU that asked for it, in batches that the loop then waits for",
};

const INTERRUPTS: Check = Check {
    key: "irqaffinity",
    group: Group::Isolation,
    title: "interrupts",
    source: "/proc/irq/*/effective_affinity_list",
    why: "interrupts of disks and networks come before every thread, the loop included",
};

const IRQBALANCE: Check = Check {
    key: "irqbalance",
    group: Group::Isolation,
    title: "irqbalance",
    source: "/proc/*/comm, /etc/default/irqbalance",
    why: "irqbalance moves interrupts between the CPUs every ten seconds, back onto the loop's too",
};

const WHY_NOT_IN_FORCE: &str =
    "sudo dmesg | grep -iE 'isolcpus|nohz|nocb|housekeeping'   # the kernel says why it did not take it";

/// The values that are read from a machine.
struct Facts<'a> {
    cpu: usize,
    last: usize,
    others: String,
    command_line: String,
    distribution: Distribution,
    threads: &'a [Thread],
}

pub fn findings(source: &Source, cpu: usize, threads: &[Thread]) -> Vec<Finding> {
    let online = source.text("/sys/devices/system/cpu/online").unwrap_or_default();
    let online = cpu_list::parse(&online, cpu);
    let others: Vec<usize> = online.iter().copied().filter(|other| *other != cpu).collect();
    if others.is_empty() {
        return [ISOLATED, TICK, RCU, INTERRUPTS, IRQBALANCE]
            .map(|check| check.not_known("there is one CPU, which cannot be set aside"))
            .to_vec();
    }
    let facts = Facts {
        cpu,
        last: online.last().copied().unwrap_or(cpu),
        others: cpu_list::write(&others),
        command_line: source.text("/proc/cmdline").unwrap_or_default(),
        distribution: Distribution::of(source),
        threads,
    };
    let isolated = source.text("/sys/devices/system/cpu/isolated");
    let is_isolated = isolated.as_deref().is_some_and(|list| facts.names_cpu(list));
    vec![
        facts.asked_and_applied(&ISOLATED, "isolcpus", isolated.as_deref()),
        facts.asked_and_applied(
            &TICK,
            "nohz_full",
            source.text("/sys/devices/system/cpu/nohz_full").as_deref(),
        ),
        facts.rcu(),
        facts.interrupts(&interrupts_on(source, cpu)),
        facts.irqbalance(is_isolated, &source.text("/etc/default/irqbalance").unwrap_or_default()),
    ]
}

impl Facts<'_> {
    fn names_cpu(&self, list: &str) -> bool {
        cpu_list::parse(list, self.last).contains(&self.cpu)
    }

    fn is_asked(&self, name: &str) -> bool {
        parameter(&self.command_line, name).is_some_and(|list| self.names_cpu(list))
    }

    fn set_aside(&self) -> String {
        set_aside(self.distribution, self.cpu, &self.others)
    }

    /// A parameter that the kernel shows when it is in force.
    fn asked_and_applied(&self, check: &Check, name: &str, in_force: Option<&str>) -> Finding {
        let cpu = self.cpu;
        let is_asked = self.is_asked(name);
        let Some(in_force) = in_force else {
            return match is_asked {
                true => check
                    .could_be_better(format!("asked for at boot; this kernel does not know {name}"))
                    .mend(self.distribution.realtime_kernel()),
                false => check.not_known(format!("this kernel does not know {name}")),
            }
            .permitted(false)
            .applied(false);
        };
        let is_applied = self.names_cpu(in_force);
        let finding = match (is_applied, is_asked) {
            (true, _) => check.good(format!("CPU {cpu} is set aside")),
            (false, true) => check
                .could_be_better(format!("asked for CPU {cpu} at boot, and not in force"))
                .mend(WHY_NOT_IN_FORCE),
            (false, false) => {
                check.could_be_better(format!("CPU {cpu} is not set aside")).mend(self.set_aside())
            }
        };
        finding.permitted(is_asked).applied(is_applied)
    }

    /// RCU offloading can be seen only from the threads that run the callbacks.
    fn rcu(&self) -> Finding {
        let cpu = self.cpu;
        let is_asked = self.is_asked("rcu_nocbs") || self.is_asked("nohz_full");
        let names = ["rcuop", "rcuos", "rcuob"].map(|name| format!("{name}/{cpu}"));
        let is_applied = self.threads.iter().any(|thread| names.contains(&thread.name));
        let sees_kernel = self.threads.iter().any(|thread| thread.is_kernel);
        let finding = match (is_applied, is_asked) {
            (true, _) => RCU.good(format!("callbacks of CPU {cpu} are done by other CPUs")),
            (false, true) if !sees_kernel => RCU.good(format!("asked for CPU {cpu} at boot")),
            (false, true) => RCU
                .could_be_better(format!("asked for CPU {cpu} at boot, and not in force"))
                .mend(WHY_NOT_IN_FORCE),
            (false, false) => {
                RCU.could_be_better(format!("callbacks of CPU {cpu} are done there")).mend(self.set_aside())
            }
        };
        let finding = finding.permitted(is_asked);
        if sees_kernel { finding.applied(is_applied) } else { finding }
    }

    fn interrupts(&self, here: &Option<Vec<String>>) -> Finding {
        let cpu = self.cpu;
        let Some(here) = here else { return INTERRUPTS.not_known("the kernel does not show where they go") };
        let is_asked = parameter(&self.command_line, "irqaffinity")
            .is_some_and(|list| !self.names_cpu(list) && !cpu_list::parse(list, self.last).is_empty());
        let finding = match here.as_slice() {
            [] => INTERRUPTS.good(format!("none of a device goes to CPU {cpu}")),
            numbers => INTERRUPTS
                .could_be_better(format!(
                    "{} of devices go to CPU {cpu}: {}",
                    numbers.len(),
                    shortened(numbers, 6)
                ))
                .mend(format!("echo {} | sudo tee /proc/irq/*/smp_affinity_list", self.others))
                .mend(self.set_aside()),
        };
        finding.permitted(is_asked).applied(here.is_empty())
    }

    fn irqbalance(&self, is_isolated: bool, settings: &str) -> Finding {
        let cpu = self.cpu;
        let is_running =
            self.threads.iter().any(|thread| thread.name == "irqbalance" && thread.id == thread.process);
        let banned = settings.lines().rev().find_map(|line| line.strip_prefix("IRQBALANCE_BANNED_CPULIST="));
        let is_banned = banned.is_some_and(|list| self.names_cpu(list.trim_matches(['"', '\''])));
        if !is_running {
            IRQBALANCE.good("does not run")
        } else if is_banned {
            IRQBALANCE.good(format!("runs, and is kept away from CPU {cpu}")).applied(true)
        } else if is_isolated {
            IRQBALANCE.good(format!("runs, and leaves CPU {cpu} alone since that is set aside"))
        } else {
            IRQBALANCE
                .could_be_better("runs")
                .mend(format!(
                    "echo IRQBALANCE_BANNED_CPULIST={cpu} | sudo tee -a /etc/default/irqbalance && sudo systemctl \
                     restart irqbalance"
                ))
                .applied(false)
        }
    }
}

/// The interrupts that go to a CPU, by number and name; `None` where the kernel does not show any.
fn interrupts_on(source: &Source, cpu: usize) -> Option<Vec<String>> {
    let numbers = source.names("/proc/irq").into_iter().filter(|name| name.parse::<u32>().is_ok());
    let table = source.text("/proc/interrupts").unwrap_or_default();
    let affinity = |number: &str| {
        let file = |name: &str| source.text(&format!("/proc/irq/{number}/{name}"));
        file("effective_affinity_list").filter(|list| !list.is_empty()).or_else(|| file("smp_affinity_list"))
    };
    let mut is_shown = false;
    let mut here = vec![];
    for number in numbers {
        // Numbers without a handler are only reserved.
        let Some(name) = handler(&table, &number) else { continue };
        let Some(list) = affinity(&number) else { continue };
        is_shown = true;
        if cpu_list::parse(&list, cpu).contains(&cpu) {
            here.push(format!("{number} ({name})"));
        }
    }
    is_shown.then_some(here)
}

/// Who handles an interrupt, from `/proc/interrupts`: the last word of its line.
fn handler(table: &str, number: &str) -> Option<String> {
    let line = table.lines().find_map(|line| line.trim_start().strip_prefix(number)?.strip_prefix(':'))?;
    let last = line.split_whitespace().last()?;
    last.chars().any(char::is_alphabetic).then(|| last.to_owned())
}

fn shortened(names: &[String], most: usize) -> String {
    let shown = names.iter().take(most).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > most { format!("{shown} …") } else { shown }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    fn facts<'a>(command_line: &str, threads: &'a [Thread]) -> Facts<'a> {
        Facts {
            cpu: 3,
            last: 3,
            others: "0-2".to_owned(),
            command_line: command_line.to_owned(),
            distribution: Distribution::Debian,
            threads,
        }
    }

    fn thread(name: &str, is_kernel: bool) -> Thread {
        Thread { name: name.to_owned(), is_kernel, process: 9, id: 9, ..Thread::default() }
    }

    #[test]
    fn what_was_asked_for_at_boot_is_told_from_what_is_in_force() {
        for (line, in_force, verdict, asked, applied) in [
            ("quiet isolcpus=managed_irq,domain,3", Some("3"), Verdict::Good, true, true),
            ("quiet", Some(""), Verdict::CouldBeBetter, false, false),
            ("quiet isolcpus=3", Some(""), Verdict::CouldBeBetter, true, false),
            ("quiet isolcpus=2", Some("2"), Verdict::CouldBeBetter, false, false),
            // By a partition of control groups, without a word at boot.
            ("quiet", Some("2-3"), Verdict::Good, false, true),
            ("quiet", None, Verdict::NotKnown, false, false),
            ("isolcpus=3", None, Verdict::CouldBeBetter, false, false),
        ] {
            let finding = facts(line, &[]).asked_and_applied(&ISOLATED, "isolcpus", in_force);
            assert_eq!(
                (finding.verdict, finding.permitted, finding.applied),
                (verdict, Some(asked), Some(applied)),
                "{line} / {in_force:?}"
            );
        }
        let null = facts("", &[]).asked_and_applied(&TICK, "nohz_full", Some("(null)"));
        assert_eq!(null.verdict, Verdict::CouldBeBetter);
        assert!(
            null.mend[0].contains("isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2")
        );
    }

    #[test]
    fn offloaded_callbacks_are_known_by_their_threads_where_those_can_be_seen() {
        let offloaded = [thread("rcuop/3", true), thread("kthreadd", true)];
        assert_eq!(facts("rcu_nocbs=3", &offloaded).rcu().applied, Some(true));
        let not_offloaded = [thread("rcuop/2", true), thread("kthreadd", true)];
        assert_eq!(facts("rcu_nocbs=3", &not_offloaded).rcu().verdict, Verdict::CouldBeBetter);
        let in_container = [thread("bash", false)];
        let finding = facts("nohz_full=1-3", &in_container).rcu();
        assert_eq!((finding.verdict, finding.applied), (Verdict::Good, None));
        assert_eq!(facts("", &not_offloaded).rcu().verdict, Verdict::CouldBeBetter);
    }

    #[test]
    fn irqbalance_is_good_when_it_cannot_touch_the_cpu() {
        let running = [thread("irqbalance", false)];
        assert_eq!(facts("", &[]).irqbalance(false, "").verdict, Verdict::Good);
        assert_eq!(facts("", &running).irqbalance(false, "").verdict, Verdict::CouldBeBetter);
        assert_eq!(facts("", &running).irqbalance(true, "").verdict, Verdict::Good);
        let settings = "#IRQBALANCE_BANNED_CPULIST=3\nIRQBALANCE_ARGS=\nIRQBALANCE_BANNED_CPULIST=\"2-3\"\n";
        assert_eq!(facts("", &running).irqbalance(false, settings).verdict, Verdict::Good);
        assert_eq!(
            facts("", &running).irqbalance(false, "#IRQBALANCE_BANNED_CPULIST=3").verdict,
            Verdict::CouldBeBetter
        );
    }

    #[test]
    fn an_interrupt_is_named_after_its_handler() {
        let table = "            CPU0       CPU1\n   8:          0          1  IR-IO-APIC    8-edge      rtc0\n \
                     125:    4411990          0  IR-PCI-MSIX-0000:00:14.0    0-edge      xhci_hcd\n   9:  0  0\nNMI: 0 0 Non-maskable interrupts\n";
        assert_eq!(handler(table, "125").as_deref(), Some("xhci_hcd"));
        assert_eq!(handler(table, "8").as_deref(), Some("rtc0"));
        assert_eq!(handler(table, "25"), None);
        assert_eq!(handler(table, "9"), None);
    }
}
