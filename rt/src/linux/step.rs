//! The steps of a thread's set-up, and what came of each.

use super::errno;

/// How many steps there are.
pub const STEP_COUNT: usize = 6;

/// One step of making a thread real-time, in the order in which they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Timers of this thread fire without being grouped with others (`PR_SET_TIMERSLACK`). Needs no right. It
    /// matters when FIFO scheduling is refused: the kernel ignores the slack of a FIFO thread.
    TimerSlack,
    /// The thread stays on one CPU (`sched_setaffinity`). Refused when the CPU does not exist or the
    /// container does not own it.
    CpuAffinity,
    /// Every page of the process stays in memory, present and future (`mlockall`). Needs `CAP_IPC_LOCK` or a
    /// sufficient `RLIMIT_MEMLOCK`.
    LockMemory,
    /// The stack that the loop will use has been touched, so that it takes no page fault later. Needs no right.
    PrefaultStack,
    /// `/dev/cpu_dma_latency` is held open with zero: CPUs do not enter idle states that take long to leave.
    /// Needs write access to that file.
    DmaLatency,
    /// `SCHED_FIFO` at the configured priority. Needs `CAP_SYS_NICE` or a sufficient `RLIMIT_RTPRIO`.
    Fifo,
}

/// What came of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It is in force.
    Granted,
    /// The system said no.
    Refused {
        /// The system's error number (errno(3)).
        errno: i32,
    },
    /// The configuration does not ask for it.
    NotAsked,
}

impl Outcome {
    /// The outcome of a system call that answers below zero when it fails.
    pub(super) fn of(answer: impl Into<i64>) -> Self {
        if answer.into() < 0 { Self::Refused { errno: errno() } } else { Self::Granted }
    }
}

/// A step with its outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepResult {
    /// Which step.
    pub step: Step,
    /// What came of it.
    pub outcome: Outcome,
}
