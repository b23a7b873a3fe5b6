//! What passes while a caller waits: real time, in which it sleeps, or virtual time, which it advances itself.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use takt_rt::{Clock, CycleRecord, Nanoseconds};

use super::life::Life;
use crate::channels::LogSide;
use crate::controller::outcome::{Interrupt, Outcome};
use crate::controller::port::Port;
use crate::controller::virtual_time::VirtualRun;
use crate::monotonic_clock::MonotonicClock;
use crate::telemetry::{EachCycle, Logger};

/// The time of a controller, as its handles see it.
pub(super) enum Pace {
    /// That of the computer. The real-time thread runs the cycles.
    Real,
    /// Its own. Whoever waits runs the cycles.
    Virtual(Box<VirtualPace>),
}

impl Pace {
    /// The present time.
    pub(super) fn now_ns(&self) -> Nanoseconds {
        match self {
            Self::Real => MonotonicClock::default().now_ns(),
            Self::Virtual(pace) => pace.now_ns.load(Ordering::Acquire),
        }
    }
}

/// A controller in virtual time, for any number of threads: each cycle is run by the one that waits for it.
pub(super) struct VirtualPace {
    parts: Mutex<Parts>,
    /// The time after the last cycle.
    now_ns: AtomicU64,
}

struct Parts {
    run: VirtualRun<Port>,
    log: VirtualLog,
}

/// Who takes the records of a run in virtual time.
pub(super) enum VirtualLog {
    /// The caller. Observers have their own way to the events.
    EachCycle(LogSide, Option<EachCycle>),
    /// A logger, as in real time, but in the thread that runs the cycles.
    Logger(Box<Logger>),
}

impl VirtualPace {
    pub(super) fn new(run: VirtualRun<Port>, log: VirtualLog) -> Self {
        Self { parts: Mutex::new(Parts { run, log }), now_ns: AtomicU64::new(0) }
    }

    /// Runs this many cycles, or fewer up to the end of the run. Returns how many.
    pub(super) fn step(&self, cycles: u64, life: &Life) -> u64 {
        let mut parts = self.lock();
        let mut stepped = 0;
        while stepped < cycles && !life.is_over() {
            let goes_on = parts.step();
            self.now_ns.store(parts.run.now_ns(), Ordering::Release);
            stepped += 1;
            if !goes_on {
                life.end();
            }
        }
        stepped
    }

    /// Asks the run to end in control.
    pub(super) fn interrupt(&self) {
        self.lock().run.interrupt(Interrupt::Controlled);
    }

    /// Hands the ports out.
    pub(super) fn with_ports<T>(&self, with: impl FnOnce(&mut [Port]) -> T) -> T {
        with(self.lock().run.ports())
    }

    /// How the run has ended; `None` while it goes on.
    pub(super) fn outcome(&self) -> Option<Outcome> {
        self.lock().run.supervisor().outcome().cloned()
    }

    /// The axes whose drives did not confirm in the end that they have no torque.
    pub(super) fn unreached(&self) -> Vec<usize> {
        self.lock().run.supervisor().unreached().to_vec()
    }

    /// After a panic in a cycle the run goes on with the next one, as far as it can.
    fn lock(&self) -> MutexGuard<'_, Parts> {
        self.parts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Parts {
    /// One cycle. Returns `false` once the run has ended.
    fn step(&mut self) -> bool {
        let goes_on = self.run.step();
        match &mut self.log {
            VirtualLog::EachCycle(log, each_cycle) => {
                let mut take = |record: &CycleRecord| {
                    if let Some(each_cycle) = each_cycle {
                        each_cycle(record);
                    }
                };
                while log.next_record(&mut take).is_some() {}
                while log.take_event().is_some() {}
            }
            VirtualLog::Logger(logger) => {
                logger.drain();
            }
        }
        goes_on
    }
}
