//! What this process may do: what the attempt proved, and the limits behind it.

use nix::errno::Errno;
use takt_rt::linux::{Outcome, Policy, Step, ThreadReport};

use super::finding::{Check, Finding, Group};
use super::source::Source;
use super::subject::Subject;
use takt::telemetry::RealtimeReport;

const FIFO: Check = Check {
    key: "sched_fifo",
    group: Group::Rights,
    title: "SCHED_FIFO",
    source: "an attempt in a thread of its own",
    why: "in the normal class every other program takes its turn before the loop gets its own",
};

const LOCKED: Check = Check {
    key: "mlockall",
    group: Group::Rights,
    title: "locked memory",
    source: "an attempt in a thread of its own",
    why: "a page that has to be fetched when the loop touches it costs microseconds from memory and milliseconds from a disk",
};

const PINNED: Check = Check {
    key: "cpu_affinity",
    group: Group::Rights,
    title: "staying on a CPU",
    source: "an attempt in a thread of its own",
    why: "a thread that is moved to another CPU finds its caches cold, and leaves the one that was set aside for it",
};

const PRIORITY_LIMIT: Check = Check {
    key: "rlimit_rtprio",
    group: Group::Rights,
    title: "RLIMIT_RTPRIO",
    source: "/proc/self/limits, /proc/self/status",
    why: "it is the highest real-time priority for a process without CAP_SYS_NICE",
};

const LOCK_LIMIT: Check = Check {
    key: "rlimit_memlock",
    group: Group::Rights,
    title: "RLIMIT_MEMLOCK",
    source: "/proc/self/limits, /proc/self/status",
    why: "it is how much memory a process without CAP_IPC_LOCK may lock; the loop locks all that it has",
};

/// Bits of capabilities(7).
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

/// What takt has mapped with all its stacks, generously.
const NEEDED_BYTES: u64 = 256 << 20;

/// The commands that grant what the attempt was refused.
pub fn grant_with(attempt: &ThreadReport) -> Vec<String> {
    RealtimeReport::new(attempt, 0, 0).grant_with
}

pub fn findings(source: &Source, subject: &Subject, attempt: &ThreadReport) -> Vec<Finding> {
    let limits = source.text("/proc/self/limits").unwrap_or_default();
    let status = source.text("/proc/self/status").unwrap_or_default();
    let has = |bit| has_capability(&status, bit);
    let mut commands: Vec<String> =
        grant_with(attempt).into_iter().filter(|command| command.contains("setcap")).collect();
    if source.is_container() {
        commands = vec![
            "docker run --cap-add=SYS_NICE --cap-add=IPC_LOCK --ulimit rtprio=99 --ulimit memlock=-1 IMAGE"
                .to_owned(),
        ];
    }
    let priority = subject.realtime.priority;
    vec![
        fifo(attempt, priority, &commands),
        locked(attempt, &commands),
        pinned(attempt, subject.cpu),
        priority_limit(limit(&limits, "Max realtime priority"), has(CAP_SYS_NICE), priority.unwrap_or(80)),
        lock_limit(limit(&limits, "Max locked memory"), has(CAP_IPC_LOCK)),
    ]
}

fn refusal(errno: i32) -> String {
    format!("refused: {}", Errno::from_raw(errno).desc())
}

fn with(finding: Finding, commands: &[String]) -> Finding {
    commands.iter().fold(finding, |finding, command| finding.mend(command.clone()))
}

fn fifo(attempt: &ThreadReport, priority: Option<u8>, commands: &[String]) -> Finding {
    let scheduling = attempt.scheduling;
    let is_applied = scheduling.policy == Policy::Fifo && Some(scheduling.priority) == priority;
    match attempt.outcome(Step::Fifo) {
        Outcome::Granted if is_applied => FIFO.good(format!("granted at priority {}", scheduling.priority)),
        Outcome::Granted => FIFO.forbids(format!(
            "granted, and not in force: the thread had {:?} {}",
            scheduling.policy, scheduling.priority
        )),
        Outcome::Refused { errno } => with(FIFO.forbids(refusal(errno)), commands),
        Outcome::NotAsked => FIFO
            .forbids("the configuration does not ask for it")
            .mend("sed -i 's/^priority = \"off\"/priority = 80/' CONFIG   # [realtime] in the configuration"),
    }
    .permitted(attempt.outcome(Step::Fifo) == Outcome::Granted)
    .applied(is_applied)
}

fn locked(attempt: &ThreadReport, commands: &[String]) -> Finding {
    match attempt.outcome(Step::LockMemory) {
        Outcome::Granted => LOCKED.good("granted"),
        // What ENOMEM means here (mlockall(2)).
        Outcome::Refused { errno } if Errno::from_raw(errno) == Errno::ENOMEM => {
            with(LOCKED.forbids("refused: it is more than RLIMIT_MEMLOCK allows"), commands)
        }
        Outcome::Refused { errno } => with(LOCKED.forbids(refusal(errno)), commands),
        Outcome::NotAsked => LOCKED.forbids("the configuration does not ask for it").mend(
            "sed -i 's/^lock_memory = false/lock_memory = true/' CONFIG   # [realtime] in the configuration",
        ),
    }
    .permitted(attempt.outcome(Step::LockMemory) == Outcome::Granted)
    .applied(attempt.memory_locked)
}

fn pinned(attempt: &ThreadReport, cpu: usize) -> Finding {
    match attempt.outcome(Step::CpuAffinity) {
        Outcome::Refused { errno } => PINNED
            .could_be_better(format!("CPU {cpu} {}", refusal(errno)))
            .mend("taskset --cpu-list --pid $$   # shows which CPUs this user may use; name one of them as [realtime] cpu")
            .permitted(false),
        _ => PINNED.good(format!("granted on CPU {cpu}")).permitted(true),
    }
    .applied(attempt.cpu == Some(cpu))
}

/// A limit of the process: its soft and its hard value. `None` for either means unlimited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Limit {
    soft: Option<u64>,
    hard: Option<u64>,
}

/// A line of `/proc/self/limits`: a name with spaces in it, the soft limit, the hard limit, perhaps a unit.
fn limit(limits: &str, name: &str) -> Option<Limit> {
    let line = limits.lines().find_map(|line| line.strip_prefix(name))?;
    let mut words = line.split_whitespace();
    let mut value = || match words.next()? {
        "unlimited" => Some(None),
        number => number.parse().ok().map(Some),
    };
    Some(Limit { soft: value()?, hard: value()? })
}

/// Returns `true` if a capability is in force, from `/proc/self/status`.
fn has_capability(status: &str, bit: u32) -> bool {
    let set = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    set.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()).is_some_and(|set| set >> bit & 1 == 1)
}

fn limits_file(setting: &str) -> String {
    format!("echo \"$USER - {setting}\" | sudo tee -a /etc/security/limits.d/takt.conf   # then log in again")
}

fn priority_limit(limit: Option<Limit>, is_capable: bool, priority: u8) -> Finding {
    if is_capable {
        return PRIORITY_LIMIT.good("of no matter: this process has CAP_SYS_NICE").permitted(true);
    }
    let Some(limit) = limit else { return PRIORITY_LIMIT.not_known("cannot be read") };
    let suffices = |value: Option<u64>| value.is_none_or(|value| value >= priority.into());
    let words = |value: Option<u64>| value.map_or("unlimited".to_owned(), |value| value.to_string());
    let read = format!("{} (may be raised to {})", words(limit.soft), words(limit.hard));
    let is_permitted = suffices(limit.soft);
    if is_permitted {
        PRIORITY_LIMIT.good(read)
    } else if suffices(limit.hard) {
        PRIORITY_LIMIT.could_be_better(read).mend(format!("ulimit -r {priority}"))
    } else {
        PRIORITY_LIMIT.could_be_better(read).mend(limits_file("rtprio 95"))
    }
    .permitted(is_permitted)
}

fn lock_limit(limit: Option<Limit>, is_capable: bool) -> Finding {
    if is_capable {
        return LOCK_LIMIT.good("of no matter: this process has CAP_IPC_LOCK").permitted(true);
    }
    let Some(limit) = limit else { return LOCK_LIMIT.not_known("cannot be read") };
    let suffices = |value: Option<u64>| value.is_none_or(|bytes| bytes >= NEEDED_BYTES);
    let words =
        |value: Option<u64>| value.map_or("unlimited".to_owned(), |bytes| format!("{} kB", bytes / 1024));
    let read = format!("{} (may be raised to {})", words(limit.soft), words(limit.hard));
    let is_permitted = suffices(limit.soft);
    if is_permitted {
        LOCK_LIMIT.good(read)
    } else if suffices(limit.hard) {
        LOCK_LIMIT.could_be_better(read).mend("ulimit -l unlimited")
    } else {
        LOCK_LIMIT.could_be_better(read).mend(limits_file("memlock unlimited"))
    }
    .permitted(is_permitted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    const LIMITS: &str = "Limit                     Soft Limit           Hard Limit           Units     \n\
        Max locked memory         8388608              unlimited            bytes     \n\
        Max realtime priority     0                    95                   \n\
        Max realtime timeout      unlimited            unlimited            us        \n";

    #[test]
    fn limits_are_read_with_and_without_a_unit() {
        assert_eq!(limit(LIMITS, "Max locked memory"), Some(Limit { soft: Some(8_388_608), hard: None }));
        assert_eq!(limit(LIMITS, "Max realtime priority"), Some(Limit { soft: Some(0), hard: Some(95) }));
        assert_eq!(limit(LIMITS, "Max realtime timeout"), Some(Limit { soft: None, hard: None }));
        assert_eq!(limit("Max locked memory  nonsense", "Max locked memory"), None);
        assert_eq!(limit("", "Max locked memory"), None);
    }

    #[test]
    fn a_capability_counts_when_it_is_in_force() {
        let of = |set: &str| format!("Name:\ttakt\nCapPrm:\tffffffffffffffff\nCapEff:\t{set}\n");
        assert!(has_capability(&of("0000000000800000"), CAP_SYS_NICE));
        assert!(!has_capability(&of("0000000000800000"), CAP_IPC_LOCK));
        assert!(has_capability(&of("000001ffffffffff"), CAP_IPC_LOCK));
        assert!(!has_capability("CapPrm:\tffffffffffffffff\n", CAP_SYS_NICE));
    }

    #[test]
    fn a_limit_that_may_be_raised_is_raised_in_the_shell_and_another_by_the_administrator() {
        let limit = |soft, hard| Some(Limit { soft: Some(soft), hard: Some(hard) });
        assert_eq!(priority_limit(limit(0, 95), false, 80).mend, ["ulimit -r 80"]);
        assert!(priority_limit(limit(0, 0), false, 80).mend[0].contains("limits.d"));
        let enough = priority_limit(limit(80, 80), false, 80);
        assert_eq!((enough.verdict, enough.permitted), (Verdict::Good, Some(true)));
        assert_eq!(priority_limit(limit(0, 0), true, 80).verdict, Verdict::Good);
        assert_eq!(lock_limit(limit(65_536, 65_536), false).verdict, Verdict::CouldBeBetter);
        assert_eq!(lock_limit(Some(Limit { soft: None, hard: None }), false).verdict, Verdict::Good);
        assert_eq!(lock_limit(None, false).verdict, Verdict::NotKnown);
    }
}
