//! Policy, priority and CPU of the calling thread.
//!
//! The scheduling calls are made directly, because they concern one thread. The wrappers of musl answer ENOSYS, because POSIX
//! defines these calls for a whole process.

use super::step::Outcome;

/// A scheduling policy (sched(7)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// The ordinary time-sharing policy (`SCHED_OTHER`).
    Other,
    /// Time-sharing for batch work.
    Batch,
    /// Time-sharing when nothing else wants to run.
    Idle,
    /// First in, first out: the thread runs until it blocks or a thread of higher priority wants to run (`SCHED_FIFO`).
    Fifo,
    /// FIFO with a time slice among equals.
    RoundRobin,
    /// Earliest deadline first.
    Deadline,
    /// A policy that this program does not know.
    Unknown {
        /// The number of the policy in the kernel.
        number: u32,
    },
}

impl Policy {
    fn of_number(number: u32) -> Self {
        match i32::try_from(number) {
            Ok(libc::SCHED_OTHER) => Self::Other,
            Ok(libc::SCHED_BATCH) => Self::Batch,
            Ok(libc::SCHED_IDLE) => Self::Idle,
            Ok(libc::SCHED_FIFO) => Self::Fifo,
            Ok(libc::SCHED_RR) => Self::RoundRobin,
            Ok(libc::SCHED_DEADLINE) => Self::Deadline,
            _ => Self::Unknown { number },
        }
    }
}

/// How a thread is scheduled, as read back from the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scheduling {
    /// The policy.
    pub policy: Policy,
    /// The real-time priority, 1 to 99; 0 under a time-sharing policy.
    pub priority: u8,
    /// True if threads and processes that this thread starts fall back to the time-sharing policy.
    pub reset_on_fork: bool,
}

impl Scheduling {
    /// The scheduling of the calling thread.
    pub fn of_this_thread() -> Self {
        let mut attributes = empty_attributes();
        // SAFETY: `attributes` is valid for writing and has the stated size; the kernel writes no more than that. The call
        // fails only for a thread that does not exist, and then the time-sharing policy stays in place.
        unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut attributes, attributes.size, 0) };
        Self {
            policy: Policy::of_number(attributes.sched_policy),
            priority: u8::try_from(attributes.sched_priority).unwrap_or(u8::MAX),
            reset_on_fork: attributes.sched_flags & RESET_ON_FORK != 0,
        }
    }
}

const RESET_ON_FORK: u64 = libc::SCHED_FLAG_RESET_ON_FORK as u64;

fn empty_attributes() -> libc::sched_attr {
    // SAFETY: all-zero bytes are a valid `sched_attr`, which holds numbers only.
    let mut attributes: libc::sched_attr = unsafe { core::mem::zeroed() };
    attributes.size = size_of::<libc::sched_attr>() as u32;
    attributes
}

/// Gives the calling thread `SCHED_FIFO` at `priority` (1 to 99). Threads that it starts later do not inherit it.
///
/// Without the right to it (`RLIMIT_RTPRIO`), the old policy stays and the outcome is [`Outcome::Refused`].
pub fn set_fifo(priority: u8) -> Outcome {
    let mut attributes = empty_attributes();
    attributes.sched_policy = libc::SCHED_FIFO as u32;
    attributes.sched_priority = priority.into();
    attributes.sched_flags = RESET_ON_FORK;
    // SAFETY: `attributes` is valid for reading and contains its own size. Thread 0 is the caller.
    Outcome::of(unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) })
}

/// Takes a thread of this process, by its ID (gettid(2)), back to the time-sharing policy.
pub fn set_ordinary(thread: i32) -> Outcome {
    let mut attributes = empty_attributes();
    attributes.sched_policy = libc::SCHED_OTHER as u32;
    // SAFETY: `attributes` is valid for reading and contains its own size.
    Outcome::of(unsafe { libc::syscall(libc::SYS_sched_setattr, thread, &raw const attributes, 0) })
}

/// Sets the nice value of the calling thread, from -20 (most CPU time) to 19, for a time-sharing policy.
///
/// Threads and processes that it starts inherit the value. Without the right to it (`RLIMIT_NICE`), the old value stays and the
/// outcome is [`Outcome::Refused`].
pub fn set_nice(nice: i8) -> Outcome {
    // SAFETY: the call takes numbers only. Thread 0 is the caller.
    Outcome::of(unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, nice.into()) })
}

/// The CPU that the calling thread is bound to; `None` if it may run on several.
pub(super) fn pinned_cpu() -> Option<usize> {
    // SAFETY: all-zero bytes are the empty set.
    let mut set: libc::cpu_set_t = unsafe { core::mem::zeroed() };
    // SAFETY: `set` is valid for writing and has the stated size. Thread 0 is the caller.
    if unsafe { libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &mut set) } < 0 {
        return None;
    }
    // SAFETY: every number asked for lies within the set.
    let mut allowed = (0..libc::CPU_SETSIZE as usize).filter(|cpu| unsafe { libc::CPU_ISSET(*cpu, &set) });
    match (allowed.next(), allowed.next()) {
        (Some(cpu), None) => Some(cpu),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn one_thread_gives_way_and_the_others_do_not() {
        // SAFETY: takes numbers only.
        let nice = || unsafe { libc::getpriority(libc::PRIO_PROCESS, 0) };
        let before = nice();
        std::thread::spawn(move || {
            assert!(matches!(set_nice(19), Outcome::Granted));
            assert_eq!(nice(), 19);
        })
        .join()
        .unwrap();
        assert_eq!(nice(), before);
    }
}
