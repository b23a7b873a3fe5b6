//! Making the calling thread a real-time thread, and the truth about how far that went.

use core::marker::PhantomData;

use super::kernel::is_preempt_rt;
use super::latency::{DmaLatencyHold, remove_timer_slack, timer_slack_ns};
use super::memory::{PageFaults, lock_all, prefault_stack};
use super::scheduling::{Scheduling, pin_to, pinned_cpu, set_fifo};
use super::step::{Outcome, STEP_COUNT, Step, StepResult};

/// What a thread is to become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThreadConfig {
    /// The FIFO priority, 1 to 99; `None` leaves the scheduling policy as it is. The kernel's threaded interrupt
    /// handlers run at 50: above that the loop preempts the CAN driver, below it the driver preempts the loop.
    pub priority: Option<u8>,
    /// The CPU to stay on; `None` leaves the choice to the kernel.
    pub cpu: Option<usize>,
    /// Whether to lock all memory of the process.
    pub lock_memory: bool,
    /// Whether to keep the CPUs out of idle states that take long to leave.
    pub hold_dma_latency: bool,
    /// How much stack to touch in advance, in bytes, at most [`PREFAULT_LIMIT_BYTES`](super::PREFAULT_LIMIT_BYTES);
    /// 0 for none.
    pub stack_bytes: usize,
}

/// What was asked for, what came of it, and what is in force. Plain data, to be put in words elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThreadReport {
    /// Each step with its outcome, in the order in which they were taken.
    pub steps: [StepResult; STEP_COUNT],
    /// Policy and priority as read back from the kernel.
    pub scheduling: Scheduling,
    /// The CPU that the thread is bound to; `None` when it may run on several.
    pub cpu: Option<usize>,
    /// Whether all memory of the process is locked.
    pub memory_locked: bool,
    /// How much stack was touched in advance, in bytes.
    pub stack_bytes: usize,
    /// The timer slack as read back from the kernel, in nanoseconds; a FIFO thread has none, whatever it says.
    pub timer_slack_ns: u64,
    /// Whether the CPUs are kept out of idle states that take long to leave.
    pub dma_latency_held: bool,
    /// Whether the kernel is fully preemptible.
    pub preempt_rt: bool,
}

impl ThreadReport {
    /// What came of a step.
    pub fn outcome(&self, step: Step) -> Outcome {
        self.steps
            .iter()
            .find(|result| result.step == step)
            .map_or(Outcome::NotAsked, |result| result.outcome)
    }

    /// The steps that were asked for and refused.
    pub fn refused(&self) -> impl Iterator<Item = StepResult> + '_ {
        self.steps.iter().copied().filter(|result| matches!(result.outcome, Outcome::Refused { .. }))
    }
}

/// The calling thread, made real-time as far as the system allows. Stays in the thread that made it; when it is
/// dropped the CPUs may idle deeply again, everything else lasts as long as the thread.
#[derive(Debug)]
pub struct RealtimeThread {
    report: ThreadReport,
    faults_at_start: PageFaults,
    _dma_latency: Option<DmaLatencyHold>,
    stays_in_thread: PhantomData<*const ()>,
}

impl RealtimeThread {
    /// Takes every step that is asked for, whatever became of the ones before it. FIFO is the last one, so that
    /// locking and touching memory, which may take long, does not hold up the rest of the system.
    pub fn enter(config: &ThreadConfig) -> Self {
        let timer_slack = remove_timer_slack();
        let affinity = config.cpu.map_or(Outcome::NotAsked, pin_to);
        let lock = if config.lock_memory { lock_all() } else { Outcome::NotAsked };
        let stack_bytes = prefault_stack(config.stack_bytes);
        let prefault = if stack_bytes == 0 { Outcome::NotAsked } else { Outcome::Granted };
        let (dma_latency, hold) = match config.hold_dma_latency.then(DmaLatencyHold::acquire) {
            None => (Outcome::NotAsked, None),
            Some(Ok(hold)) => (Outcome::Granted, Some(hold)),
            Some(Err(refused)) => (refused, None),
        };
        let fifo = config.priority.map_or(Outcome::NotAsked, set_fifo);
        let steps = [
            StepResult { step: Step::TimerSlack, outcome: timer_slack },
            StepResult { step: Step::CpuAffinity, outcome: affinity },
            StepResult { step: Step::LockMemory, outcome: lock },
            StepResult { step: Step::PrefaultStack, outcome: prefault },
            StepResult { step: Step::DmaLatency, outcome: dma_latency },
            StepResult { step: Step::Fifo, outcome: fifo },
        ];
        let report = ThreadReport {
            steps,
            scheduling: Scheduling::of_this_thread(),
            cpu: pinned_cpu(),
            memory_locked: lock == Outcome::Granted,
            stack_bytes,
            timer_slack_ns: timer_slack_ns(),
            dma_latency_held: hold.is_some(),
            preempt_rt: is_preempt_rt(),
        };
        Self {
            report,
            faults_at_start: PageFaults::of_this_thread(),
            _dma_latency: hold,
            stays_in_thread: PhantomData,
        }
    }

    /// What was asked for, what came of it, and what is in force.
    pub const fn report(&self) -> &ThreadReport {
        &self.report
    }

    /// The page faults this thread has taken since its set-up. A loop at work takes none.
    pub fn page_faults(&self) -> PageFaults {
        PageFaults::of_this_thread().since(self.faults_at_start)
    }
}
