//! The thread in which the cycle runs: started, elevated, paced, and asked afterwards how it was.

use std::sync::mpsc;
use std::thread::{Builder, JoinHandle};

use takt_rt::linux::{PacedClock, PageFaults, RealtimeThread, ThreadConfig, ThreadReport};
use takt_rt::{BusPort, Clock, Cycle, Engine, Flow, Grid, HostInterface, SlotPlan};

use super::quiet;
use crate::config::Realtime;

/// Stack that the thread touches before it begins; the cycle uses a small part of it.
const STACK_BYTES: usize = 256 * 1024;
/// Wake-ups measured before the first slot to choose the spin guard.
const MEASURED_WAKE_UPS: u32 = 200;
const MEASURED_SLEEP_NS: u64 = 250_000;
/// From the end of the set-up to the first slot.
const LEAD_IN_NS: u64 = 2_000_000;

/// What is asked of the operating system, from the configuration. Without a named CPU the last one that this
/// process may use is taken: the first one serves most interrupts.
pub fn thread_config(realtime: &Realtime) -> ThreadConfig {
    let last = || core_affinity::get_core_ids().and_then(|cores| cores.last().map(|core| core.id));
    ThreadConfig {
        priority: realtime.priority,
        // Without FIFO, pinning would only bind the thread to a CPU that others keep busy.
        cpu: realtime.cpu.or_else(|| realtime.priority.and_then(|_| last())),
        lock_memory: realtime.lock_memory,
        hold_dma_latency: realtime.hold_dma_latency,
        stack_bytes: STACK_BYTES,
    }
}

/// The beginning: what came of the set-up.
#[derive(Clone, Copy, Debug)]
pub struct Begun {
    /// What was asked, what was granted, what is in force.
    pub report: ThreadReport,
}

/// The end: how it was.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    /// Page faults that the loop took between its first and its last cycle.
    pub page_faults: PageFaults,
    /// How long before a slot the thread stopped sleeping and spun, at the end.
    pub spin_guard_ns: u64,
}

/// What the thread works with. All of it is made, and its memory touched, before the thread is elevated.
pub struct Work<P, D> {
    /// The cycle as computation.
    pub engine: Box<Engine>,
    /// When things happen in a slot.
    pub plan: SlotPlan,
    /// The buses.
    pub ports: Vec<P>,
    /// The door to the rest.
    pub host: D,
    /// A fixed spin guard; `None` measures, a tenth of the period at most.
    pub spin_guard_ns: Option<u64>,
    /// Whether a refused step ends the thread before its first cycle.
    pub is_realtime_required: bool,
}

/// The running thread.
pub struct Running {
    thread: JoinHandle<Option<Ended>>,
    begun: Begun,
}

/// Why the thread does not run.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The system has no thread for us.
    #[error("the real-time thread could not be started: {0}")]
    Spawn(std::io::Error),
    /// It ended before it had begun, which only a defect of takt can bring about.
    #[error("the real-time thread ended before its first cycle")]
    Died,
    /// Real-time set-up was required, and at least one step was refused.
    #[error("real-time set-up was required and refused")]
    Refused(Box<ThreadReport>),
}

/// Starts the thread and waits until it is set up.
///
/// # Errors
/// See [`StartError`].
pub fn start<P, D>(config: ThreadConfig, work: Work<P, D>) -> Result<Running, StartError>
where
    P: BusPort + Send + 'static,
    D: HostInterface + Send + 'static,
{
    let (say, hear) = mpsc::sync_channel(1);
    let body = move || loop_body(&config, work, &say);
    let thread = Builder::new().name("takt-rt".into()).spawn(body).map_err(StartError::Spawn)?;
    let begun = hear.recv().map_err(|_| StartError::Died)?.map_err(StartError::Refused)?;
    Ok(Running { thread, begun })
}

impl Running {
    /// What came of the set-up.
    pub fn begun(&self) -> Begun {
        self.begun
    }

    /// Whether the thread has ended.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the thread's end. `None` if it did not end by itself.
    pub fn join(self) -> Option<Ended> {
        self.thread.join().ok().flatten()
    }
}

fn loop_body<P: BusPort, D: HostInterface>(
    config: &ThreadConfig,
    mut work: Work<P, D>,
    say: &mpsc::SyncSender<Result<Begun, Box<ThreadReport>>>,
) -> Option<Ended> {
    let realtime = RealtimeThread::enter(config);
    let report = *realtime.report();
    if work.is_realtime_required && report.refused().next().is_some() {
        // Whoever started the thread waits for exactly one message.
        let _ = say.send(Err(Box::new(report)));
        return None;
    }
    let period_ns = work.engine.period_ns();
    let mut clock = match work.spin_guard_ns {
        Some(fixed_ns) => PacedClock::fixed(fixed_ns.min(period_ns / 2)),
        None => measured_clock(period_ns / 10),
    };
    let _ = say.send(Ok(Begun { report }));
    let epoch_ns = quiet::first_slot_after(clock.now_ns() + LEAD_IN_NS, period_ns);
    let mut cycle = Cycle::new(Grid::new(epoch_ns, period_ns)?, work.plan);
    let before = realtime.page_faults();
    while cycle.run(&mut work.engine, &mut clock, &mut work.ports, &mut work.host) == Flow::Continue {}
    let page_faults = realtime.page_faults().since(before);
    Some(Ended { page_faults, spin_guard_ns: clock.guard_ns() })
}

/// A clock that has slept some times, so that its guard is of use in the first slot.
fn measured_clock(cap_ns: u64) -> PacedClock {
    let mut clock = PacedClock::measured(cap_ns);
    for _ in 0..MEASURED_WAKE_UPS {
        let deadline_ns = clock.now_ns() + MEASURED_SLEEP_NS;
        clock.wait_to_send(deadline_ns);
    }
    clock
}
