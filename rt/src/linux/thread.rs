//! Makes the calling thread a real-time thread, and reports how far the system allowed it.

use core::marker::PhantomData;

use super::kernel::is_preempt_rt;
use super::latency::{DmaLatencyHold, remove_timer_slack, timer_slack_ns};
use super::memory::{PageFaults, lock_all, prefault_stack};
use super::scheduling::{Scheduling, pinned_cpu, set_fifo};
use super::step::{Outcome, STEP_COUNT, Step, StepResult};

/// The settings that a real-time thread asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThreadConfig {
    /// The FIFO priority, 1 to 99; `None` leaves the scheduling policy as it is. The threaded interrupt handlers of the kernel run
    /// at 50: above that the loop preempts the CAN driver, below it the driver preempts the loop.
    pub priority: Option<u8>,
    /// The outcome of binding the thread to a CPU, which its owner has done before.
    pub affinity: Outcome,
    /// True to lock all memory of the process.
    pub lock_memory: bool,
    /// True to keep the CPUs out of idle states that take long to leave.
    pub hold_dma_latency: bool,
    /// How much stack to touch in advance, in bytes; 0 for none, and at most
    /// [`PREFAULT_LIMIT_BYTES`](super::PREFAULT_LIMIT_BYTES).
    pub stack_bytes: usize,
}

/// The outcome of each step, and the settings that are in force, as read back from the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThreadReport {
    /// Each step with its outcome, in the order in which they were carried out.
    pub steps: [StepResult; STEP_COUNT],
    /// Policy and priority as read back from the kernel.
    pub scheduling: Scheduling,
    /// The CPU that the thread is bound to; `None` if it may run on several.
    pub cpu: Option<usize>,
    /// True if all memory of the process is locked.
    pub memory_locked: bool,
    /// How much stack was touched in advance, in bytes.
    pub stack_bytes: usize,
    /// The timer slack as read back from the kernel, in ns. A FIFO thread has none, whatever this says.
    pub timer_slack_ns: u64,
    /// True if the CPUs are kept out of idle states that take long to leave.
    pub dma_latency_held: bool,
    /// True if the kernel is fully preemptible (PREEMPT_RT).
    pub preempt_rt: bool,
}

impl ThreadReport {
    /// The calling thread as it is. No step was asked for.
    pub fn of_ordinary_thread() -> Self {
        let steps = [
            Step::TimerSlack,
            Step::CpuAffinity,
            Step::LockMemory,
            Step::PrefaultStack,
            Step::DmaLatency,
            Step::Fifo,
        ];
        Self {
            steps: steps.map(|step| StepResult { step, outcome: Outcome::NotAsked }),
            scheduling: Scheduling::of_this_thread(),
            cpu: pinned_cpu(),
            memory_locked: false,
            stack_bytes: 0,
            timer_slack_ns: timer_slack_ns(),
            dma_latency_held: false,
            preempt_rt: is_preempt_rt(),
        }
    }

    /// The outcome of a step.
    pub fn outcome(&self, step: Step) -> Outcome {
        self.steps
            .iter()
            .find(|result| result.step == step)
            .map_or(Outcome::NotAsked, |result| result.outcome)
    }

    /// The steps that were asked for and that the system refused.
    pub fn refused(&self) -> impl Iterator<Item = StepResult> + '_ {
        self.steps.iter().copied().filter(|result| matches!(result.outcome, Outcome::Refused { .. }))
    }
}

/// The calling thread, made a real-time thread as far as the system allows.
///
/// It cannot leave the thread that made it. When it is dropped, the CPUs may enter deep idle states again. Everything else lasts
/// as long as the thread.
#[derive(Debug)]
pub struct RealtimeThread {
    report: ThreadReport,
    faults_at_start: PageFaults,
    _dma_latency: Option<DmaLatencyHold>,
    stays_in_thread: PhantomData<*const ()>,
}

impl RealtimeThread {
    /// Carries out every step that `config` asks for, also after a step that was refused; see [`RealtimeThread::report`].
    ///
    /// FIFO scheduling is the last step. Locking and touching memory can take long, and must not hold up the rest of the system.
    pub fn enter(config: &ThreadConfig) -> Self {
        let timer_slack = remove_timer_slack();
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
            StepResult { step: Step::CpuAffinity, outcome: config.affinity },
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

    /// The outcome of each step, and the settings that are in force.
    pub const fn report(&self) -> &ThreadReport {
        &self.report
    }

    /// The page faults of this thread since [`RealtimeThread::enter`]. A running loop takes none.
    pub fn page_faults(&self) -> PageFaults {
        PageFaults::of_this_thread().since(self.faults_at_start)
    }
}
