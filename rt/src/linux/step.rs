//! The steps that make a thread a real-time thread, and the outcome of each.

use super::errno;

/// How many steps there are.
pub const STEP_COUNT: usize = 6;

/// One step of making a thread real-time, in the order in which they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Timers of this thread fire alone, not grouped with others (`PR_SET_TIMERSLACK`). This needs no right. It matters where
    /// FIFO scheduling is refused: the kernel ignores the slack of a FIFO thread.
    TimerSlack,
    /// The thread stays on one CPU (`sched_setaffinity`). This is refused if the CPU does not exist or the container may not use
    /// it.
    CpuAffinity,
    /// All present and future pages of the process stay in memory (`mlockall`). This needs `CAP_IPC_LOCK` or a sufficient
    /// `RLIMIT_MEMLOCK`.
    LockMemory,
    /// The stack of the loop has been touched, so it takes no page fault later. This needs no right.
    PrefaultStack,
    /// `/dev/cpu_dma_latency` is held open with the value zero: no CPU enters an idle state that takes long to leave. This needs
    /// write access to that file.
    DmaLatency,
    /// `SCHED_FIFO` at the configured priority. This needs `CAP_SYS_NICE` or a sufficient `RLIMIT_RTPRIO`.
    Fifo,
}

/// The outcome of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The step was carried out, and its effect is in force.
    Granted,
    /// The system refused the step.
    Refused {
        /// The error number of the system (errno(3)).
        errno: i32,
    },
    /// The configuration did not ask for the step.
    NotAsked,
}

impl Outcome {
    /// The outcome of a system call that returns a negative number when it fails.
    pub(super) fn of(answer: impl Into<i64>) -> Self {
        if answer.into() < 0 { Self::Refused { errno: errno() } } else { Self::Granted }
    }
}

/// A step with its outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepResult {
    /// Which step.
    pub step: Step,
    /// Its outcome.
    pub outcome: Outcome,
}
