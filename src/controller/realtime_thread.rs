//! The real-time thread, in which the cycle runs.

use std::sync::{Arc, mpsc};
use std::thread::{Builder, JoinHandle};

use core_affinity::CoreId;
use nix::errno::Errno;
use takt_rt::linux::{Outcome, PacedClock, PageFaults, RealtimeThread, ThreadConfig, ThreadReport};
use takt_rt::{BusPort, Clock, Cycle, Engine, Flow, Grid, HostInterface, SlotPlan};

use super::watchdog::LoopWatch;
use crate::channels::Producer;
use crate::config::Realtime;
use crate::journal::{ClockAnswer, JournaledClock};
use crate::sleep_alignment;

/// Stack that the thread touches before its first cycle. The cycle uses a small part of it.
const STACK_BYTES: usize = 256 * 1024;
/// Wake-ups measured before the first slot to choose the spin guard.
const MEASURED_WAKE_UPS: u32 = 200;
const MEASURED_SLEEP_NS: u64 = 250_000;
/// From the end of the set-up to the first slot.
const LEAD_IN_NS: u64 = 2_000_000;

/// The real-time set-up of a thread.
#[derive(Clone, Copy, Debug)]
pub struct ThreadSetup {
    /// The CPU to stay on, counted from 0; `None` leaves the choice to the kernel.
    pub cpu: Option<usize>,
    /// The rest of it.
    pub realtime: Realtime,
}

impl ThreadSetup {
    /// Returns the set-up that a configuration asks for. Without a configured CPU, it is the last one that this process may use, since
    /// the first one serves most interrupts.
    pub fn of(realtime: &Realtime) -> Self {
        let last = || Some(core_affinity::get_core_ids()?.last()?.id);
        // Without SCHED_FIFO, a pinned thread would have to share a busy CPU.
        let cpu = realtime.cpu.or_else(|| realtime.priority.and_then(|_| last()));
        Self { cpu, realtime: *realtime }
    }

    /// Sets the calling thread up, as far as the system allows.
    pub fn enter(&self) -> RealtimeThread {
        let Realtime { priority, lock_memory, hold_dma_latency, .. } = self.realtime;
        RealtimeThread::enter(&ThreadConfig {
            priority,
            affinity: self.cpu.map_or(Outcome::NotAsked, bind_to),
            lock_memory,
            hold_dma_latency,
            stack_bytes: STACK_BYTES,
        })
    }
}

/// Binds the calling thread to a CPU, whether or not it is one of those that the process was given: an isolated one is not.
fn bind_to(cpu: usize) -> Outcome {
    if cpu >= libc::CPU_SETSIZE as usize {
        return Outcome::Refused { errno: libc::EINVAL };
    }
    match core_affinity::set_for_current(CoreId { id: cpu }) {
        true => Outcome::Granted,
        false => Outcome::Refused { errno: Errno::last_raw() },
    }
}

/// The result of the real-time set-up.
#[derive(Clone, Copy, Debug)]
pub struct Begun {
    /// Each step with its result, and the settings in force.
    pub report: ThreadReport,
}

/// Measurements of a loop that has ended.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    /// Page faults between the first and the last cycle.
    pub page_faults: PageFaults,
    /// The final spin guard: the time before a slot during which the thread spins instead of sleeping.
    pub spin_guard_ns: u64,
}

/// The parts of the loop. All of them are made, and their memory touched, before the thread becomes real-time.
pub struct LoopParts<P, H> {
    /// The cycle as computation.
    pub engine: Box<Engine>,
    /// The times within a slot.
    pub plan: SlotPlan,
    /// The buses.
    pub ports: Vec<P>,
    /// The channels to the rest of the program.
    pub host: H,
    /// A fixed spin guard; `None` measures it, up to a tenth of the period.
    pub spin_guard_ns: Option<u64>,
    /// True if a refused step ends the thread before its first cycle.
    pub is_realtime_required: bool,
    /// Where the answers of the clock are noted, for a replay.
    pub clock_journal: Option<Producer<ClockAnswer>>,
    /// By which the thread is watched.
    pub watch: Arc<LoopWatch>,
}

/// The running thread.
pub struct Running {
    thread: JoinHandle<Option<Ended>>,
    begun: Begun,
}

/// Why the thread could not be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// The operating system gives no thread.
    #[error("the real-time thread could not be started: {0}")]
    Spawn(std::io::Error),
    /// It ended before its first cycle. That is a defect of takt.
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
pub fn start<P, H>(setup: ThreadSetup, parts: LoopParts<P, H>) -> Result<Running, StartError>
where
    P: BusPort + Send + 'static,
    H: HostInterface + Send + 'static,
{
    let (begun_in, begun_out) = mpsc::sync_channel(1);
    let body = move || loop_body(&setup, parts, &begun_in);
    let thread = Builder::new().name("takt-rt".into()).spawn(body).map_err(StartError::Spawn)?;
    let begun = begun_out.recv().map_err(|_| StartError::Died)?.map_err(StartError::Refused)?;
    Ok(Running { thread, begun })
}

impl Running {
    /// The result of the real-time set-up.
    pub fn begun(&self) -> Begun {
        self.begun
    }

    /// Returns `true` if the thread has ended.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the end of the thread. `None` if it panicked.
    pub fn join(self) -> Option<Ended> {
        self.thread.join().ok().flatten()
    }
}

fn loop_body<P: BusPort, H: HostInterface>(
    setup: &ThreadSetup,
    mut parts: LoopParts<P, H>,
    begun: &mpsc::SyncSender<Result<Begun, Box<ThreadReport>>>,
) -> Option<Ended> {
    let realtime = setup.enter();
    let report = *realtime.report();
    if parts.is_realtime_required && report.refused().next().is_some() {
        // The starting thread waits for exactly one message.
        let _ = begun.send(Err(Box::new(report)));
        return None;
    }
    let period_ns = parts.engine.period_ns();
    let mut clock = match parts.spin_guard_ns {
        Some(fixed_ns) => PacedClock::fixed(fixed_ns.min(period_ns / 2)),
        None => measured_clock(period_ns / 10),
    };
    let _ = begun.send(Ok(Begun { report }));
    let epoch_ns = sleep_alignment::first_slot_after(clock.now_ns() + LEAD_IN_NS, period_ns);
    let mut clock = JournaledClock::noted_in(clock, parts.clock_journal);
    clock.note_epoch(epoch_ns);
    let mut cycle = Cycle::new(Grid::new(epoch_ns, period_ns)?, parts.plan);
    let before = realtime.page_faults();
    parts.watch.begin();
    while cycle.run(&mut parts.engine, &mut clock, &mut parts.ports, &mut parts.host) == Flow::Continue
        && parts.watch.note_cycle()
    {
        clock.end_cycle();
    }
    clock.end_cycle();
    let page_faults = realtime.page_faults().since(before);
    Some(Ended { page_faults, spin_guard_ns: clock.clock.guard_ns() })
}

/// A clock that has measured some wake-ups, so that its guard fits from the first slot on.
fn measured_clock(cap_ns: u64) -> PacedClock {
    let mut clock = PacedClock::measured(cap_ns);
    for _ in 0..MEASURED_WAKE_UPS {
        let deadline_ns = clock.now_ns() + MEASURED_SLEEP_NS;
        clock.wait_to_send(deadline_ns);
    }
    clock
}

#[cfg(test)]
mod tests {
    use takt_rt::linux::Step;

    use super::*;

    #[test]
    fn a_thread_is_bound_to_its_cpu_and_one_that_does_not_exist_is_refused() {
        let of_cpu = |cpu| {
            let set_up = move || {
                let realtime = Realtime {
                    priority: None,
                    cpu: Some(cpu),
                    lock_memory: false,
                    hold_dma_latency: false,
                    spin_guard_ns: None,
                };
                *ThreadSetup::of(&realtime).enter().report()
            };
            std::thread::spawn(set_up).join().unwrap()
        };
        let last = core_affinity::get_core_ids().unwrap().last().unwrap().id;
        let report = of_cpu(last);
        assert_eq!((report.outcome(Step::CpuAffinity), report.cpu), (Outcome::Granted, Some(last)));
        for cpu in [1_023, 5_000, usize::MAX] {
            let refused = Outcome::Refused { errno: libc::EINVAL };
            assert_eq!(of_cpu(cpu).outcome(Step::CpuAffinity), refused, "CPU {cpu}");
        }
    }
}
