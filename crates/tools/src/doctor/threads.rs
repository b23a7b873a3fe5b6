//! The threads of the machine: who else would run when the loop wants to.

use super::cpu_list;
use super::finding::{Check, Finding, Group};
use super::source::Source;

const COMPETITORS: Check = Check {
    key: "competing_threads",
    group: Group::Isolation,
    title: "threads above",
    source: "/proc/*/task/*/stat",
    why: "a thread of the same or a higher real-time priority on the loop's CPU runs for as long as it wants before the loop does",
};

/// The bit of `/proc/*/stat` that marks threads of the kernel (`PF_KTHREAD`).
const KERNEL_THREAD: u64 = 0x0020_0000;

/// Scheduling policies of `/proc/*/stat`, by number (sched(7)).
const FIFO: u32 = 1;
const ROUND_ROBIN: u32 = 2;
const DEADLINE: u32 = 6;

/// A thread of the machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Thread {
    /// Its process.
    pub process: u32,
    /// Its own number.
    pub id: u32,
    /// Its name, at most 15 characters.
    pub name: String,
    /// True if it belongs to the kernel.
    pub is_kernel: bool,
    /// Its policy, by number.
    pub policy: u32,
    /// Its real-time priority; 0 in the normal class.
    pub priority: u32,
    /// The CPUs that it may run on; read for real-time threads only.
    pub cpus: String,
}

impl Thread {
    pub fn is_realtime(&self) -> bool {
        matches!(self.policy, FIFO | ROUND_ROBIN | DEADLINE)
    }
}

/// All threads that can be seen.
pub fn threads(source: &Source) -> Vec<Thread> {
    let numbers = |path: &str| source.names(path).into_iter().filter_map(|name| name.parse::<u32>().ok());
    let mut threads = vec![];
    for process in numbers("/proc") {
        for id in numbers(&format!("/proc/{process}/task")) {
            let folder = format!("/proc/{process}/task/{id}");
            let Some(mut thread) = source.text(&format!("{folder}/stat")).and_then(|text| stat(&text)) else {
                continue;
            };
            thread.process = process;
            if thread.is_realtime() {
                thread.cpus = allowed(&source.text(&format!("{folder}/status")).unwrap_or_default());
            }
            threads.push(thread);
        }
    }
    threads
}

/// A line of `/proc/*/stat` (proc_pid_stat(5)). The name may hold spaces and parentheses: it ends at the last one.
fn stat(text: &str) -> Option<Thread> {
    let (id, rest) = text.split_once(" (")?;
    let (name, rest) = rest.rsplit_once(") ")?;
    // The first field after the name is number 3.
    let fields: Vec<&str> = rest.split_whitespace().collect();
    let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
    Some(Thread {
        process: 0,
        id: id.parse().ok()?,
        name: name.to_owned(),
        is_kernel: field(9)? & KERNEL_THREAD != 0,
        priority: u32::try_from(field(40)?).ok()?,
        policy: u32::try_from(field(41)?).ok()?,
        cpus: String::new(),
    })
}

fn allowed(status: &str) -> String {
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
    list.unwrap_or_default().trim().to_owned()
}

/// Those that the kernel cannot do without, and that run only when it needs them; and those of interrupts, which are above
/// the loop where somebody has put them there, as that of a CAN interface should be.
fn is_the_kernels_own(thread: &Thread) -> bool {
    let is_named = |start| thread.name.starts_with(start);
    thread.is_kernel && ["migration/", "stopper/", "irq/"].into_iter().any(is_named)
}

pub fn findings(threads: &[Thread], cpu: usize, priority: u8, own_process: u32) -> Vec<Finding> {
    let competes = |thread: &&Thread| {
        thread.is_realtime()
            && (thread.policy == DEADLINE || thread.priority >= priority.into())
            && thread.process != own_process
            && !is_the_kernels_own(thread)
            && (thread.cpus.is_empty() || cpu_list::parse(&thread.cpus, cpu).contains(&cpu))
    };
    let above: Vec<&Thread> = threads.iter().filter(competes).collect();
    if above.is_empty() {
        return vec![COMPETITORS.good(format!("none at {priority} or above on CPU {cpu}"))];
    }
    let words = above.iter().take(MOST_SHOWN).map(|thread| match thread.policy {
        DEADLINE => format!("{} (deadline)", thread.name),
        _ => format!("{} ({})", thread.name, thread.priority),
    });
    let mut words = words.collect::<Vec<_>>().join(", ");
    if above.len() > MOST_SHOWN {
        words.push_str(" …");
    }
    let finding = COMPETITORS.could_be_better(format!("{} on CPU {cpu}: {words}", above.len()));
    let below = priority.saturating_sub(1).max(1);
    let lower = |thread: &&Thread| format!("sudo chrt --fifo --pid {below} {}", thread.id);
    vec![above.iter().take(MOST_SHOWN).map(lower).fold(finding, Finding::mend)]
}

const MOST_SHOWN: usize = 5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    const MIGRATION: &str = "21 (migration/1) S 2 0 0 0 -1 69238848 0 0 0 0 0 3 0 0 -100 0 1 0 3 0 0 18446744073709551615 0 0 0 0 0 0 0 2147483647 0 0 0 0 17 1 99 1 0 0 0 0 0 0 0 0 0 0 0";
    const ODD: &str = "7047 (a (b) c) R 7029 7029 26070 0 -1 4194304 98 0 0 0 0 0 0 0 20 0 1 0 535298 3133440 407 18446744073709551615 1 1 1 0 0 0 0 0 0 0 0 0 17 0 85 2 0 0 0 0 0 0 0 0 0 0 0";

    #[test]
    fn names_may_hold_spaces_and_parentheses() {
        let thread = stat(ODD).unwrap();
        assert_eq!((thread.id, thread.name.as_str(), thread.is_kernel), (7047, "a (b) c", false));
        assert_eq!((thread.policy, thread.priority), (ROUND_ROBIN, 85));
        let thread = stat(MIGRATION).unwrap();
        assert_eq!((thread.name.as_str(), thread.is_kernel, thread.priority), ("migration/1", true, 99));
        for broken in ["", "7047", "7047 (x", "7047 (x) R 1 2", "x (y) S 1"] {
            assert_eq!(stat(broken), None, "{broken:?}");
        }
    }

    #[test]
    fn the_cpus_of_a_thread_are_found_in_its_status() {
        assert_eq!(allowed("Name:\tx\nCpus_allowed:\tff\nCpus_allowed_list:\t0-7\n"), "0-7");
        assert_eq!(allowed(""), "");
    }

    #[test]
    fn only_threads_that_would_run_before_the_loop_on_its_cpu_count() {
        let thread = |name: &str, policy, priority, cpus: &str| Thread {
            process: 50,
            id: 51,
            name: name.to_owned(),
            policy,
            priority,
            cpus: cpus.to_owned(),
            ..Thread::default()
        };
        let harmless = [
            Thread { is_kernel: true, ..thread("migration/3", FIFO, 99, "3") },
            Thread { is_kernel: true, ..thread("irq/16-can0", FIFO, 85, "3") },
            thread("irq/8-rtc0", FIFO, 50, "0-3"),
            thread("elsewhere", FIFO, 99, "0-2"),
            thread("ordinary", 0, 0, ""),
            Thread { process: 1, ..thread("takt", FIFO, 80, "3") },
        ];
        assert_eq!(findings(&harmless, 3, 80, 1)[0].verdict, Verdict::Good);
        let others = [
            thread("ktimers/3", FIFO, 80, "3"),
            thread("pulse", ROUND_ROBIN, 95, "0-3"),
            thread("edf", DEADLINE, 0, ""),
        ];
        let finding = &findings(&others, 3, 80, 1)[0];
        assert_eq!(finding.verdict, Verdict::CouldBeBetter);
        assert_eq!(finding.read, "3 on CPU 3: ktimers/3 (80), pulse (95), edf (deadline)");
        assert_eq!(finding.mend[0], "sudo chrt --fifo --pid 79 51");
    }
}
