//! How good this machine is at keeping time: the pacing of the cycle alone, with nothing to control.
//!
//! A thread set up as the one of `takt run` waits for every slot of a grid, as the cycle does (absolute sleep, then
//! spin; a slot that has passed is skipped and counted), and releases SYNC at its start when there is an interface.
//! Two runs are compared: sleeping alone, and sleeping until a guard time before the slot and spinning from there.

mod pacing;

use std::thread::Builder;

use takt_rt::frame::Frame;
use takt_rt::linux::{MonotonicClock, PageFaults, RealtimeThread, SpinGuard, ThreadConfig, ThreadReport};
use takt_rt::port::{BusHealth, BusPort, Clock};

use crate::telemetry::Latency;
use pacing::{Samples, pace};

/// Wake-ups from which the guard time of the second run is chosen.
const MEASURED_WAKE_UPS: u32 = 500;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JitterOptions {
    /// The period of the grid; more than zero.
    pub period_ns: u64,
    /// Slots in each run.
    pub cycles: usize,
    /// The guard time of the second run; `None` chooses it as `takt run` does, from measured wake-ups.
    pub spin_guard_ns: Option<u64>,
    /// How the thread is set up.
    pub thread: ThreadConfig,
}

/// Both runs.
#[derive(Clone, Debug)]
pub struct JitterReport {
    /// How the thread was set up.
    pub thread: ThreadReport,
    /// Sleeping until the start of the slot.
    pub sleep_only: JitterRun,
    /// Sleeping until the guard time before it, then spinning.
    pub sleep_then_spin: JitterRun,
    /// The interface afterwards, where there was one.
    pub bus: Option<BusHealth>,
}

/// One run.
#[derive(Clone, Debug)]
pub struct JitterRun {
    /// How long before the start of a slot the sleep ended.
    pub guard_ns: u64,
    /// How late the system's timer was against the instant it was set to.
    pub wake: Latency,
    /// How late SYNC was handed to the interface (without one: how late it could have been), against the slot.
    pub release: Latency,
    /// Slots that had passed before they could be used.
    pub missed_slots: u64,
    /// Page faults of the thread during the run.
    pub page_faults: PageFaults,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum JitterError {
    /// There is no grid with a period of zero.
    #[error("the period must be longer than zero")]
    NoPeriod,
    /// The system has no thread for this.
    #[error("the thread could not be started: {0}")]
    Spawn(#[from] std::io::Error),
    /// The thread ended before its time.
    #[error("the measuring thread ended before its time")]
    Died,
}

/// Measures both runs, one after the other, in a thread of its own. With a port, `sync` is sent on it at the start of
/// every slot, and what arrives is thrown away.
///
/// # Errors
/// See [`JitterError`].
pub fn measure<P: BusPort + Send>(
    options: &JitterOptions,
    sync: Frame,
    mut port: Option<P>,
) -> Result<JitterReport, JitterError> {
    if options.period_ns == 0 {
        return Err(JitterError::NoPeriod);
    }
    // Taken before the thread is elevated, and written to once, so that the loop finds all of it in memory.
    let mut samples = Samples::new(options.cycles);
    std::thread::scope(|scope| {
        let body = || {
            let thread = RealtimeThread::enter(&options.thread);
            let mut run = |guard_ns: u64, port: &mut Option<P>| {
                let before = thread.page_faults();
                pace(options, guard_ns, sync, port.as_mut(), &mut samples);
                samples.summarise(guard_ns, thread.page_faults().since(before))
            };
            let sleep_only = run(0, &mut port);
            let guard_ns = options.spin_guard_ns.unwrap_or_else(|| measured_guard_ns(options.period_ns));
            let sleep_then_spin = run(guard_ns.min(options.period_ns / 2), &mut port);
            let bus = port.as_mut().map(BusPort::health);
            JitterReport { thread: *thread.report(), sleep_only, sleep_then_spin, bus }
        };
        let handle = Builder::new().name("takt-jitter".into()).spawn_scoped(scope, body)?;
        handle.join().map_err(|_| JitterError::Died)
    })
}

/// The guard that would have absorbed nearly all of some wake-ups, a tenth of the period at most.
fn measured_guard_ns(period_ns: u64) -> u64 {
    let mut guard = SpinGuard::new(period_ns / 10);
    let mut clock = MonotonicClock::new(0);
    for _ in 0..MEASURED_WAKE_UPS {
        let deadline_ns = clock.now_ns() + period_ns / 4;
        guard.record(clock.wait_until(deadline_ns).timer_latency_ns);
    }
    guard.guard_ns()
}

#[cfg(test)]
mod tests {
    use takt_rt::frame::Id;
    use takt_rt::port::{BusState, ReceiveBatch, Received};
    use takt_rt::time::Nanoseconds;

    use super::*;

    const THREAD: ThreadConfig = ThreadConfig {
        priority: None,
        cpu: None,
        lock_memory: false,
        hold_dma_latency: false,
        stack_bytes: 64 * 1024,
    };

    fn options(cycles: usize) -> JitterOptions {
        JitterOptions { period_ns: 500_000, cycles, spin_guard_ns: Some(100_000), thread: THREAD }
    }

    fn sync() -> Frame {
        Frame::of(Id::canopen(0x080, 0), [])
    }

    /// A port that notes when it was handed what.
    #[derive(Default)]
    struct Listener {
        sent: Vec<(Nanoseconds, Frame)>,
        waiting: usize,
    }

    impl BusPort for Listener {
        fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
            self.sent.extend(frames.iter().map(|frame| (now_ns, *frame)));
            self.waiting += frames.len();
            frames.len()
        }

        fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
            while self.waiting > 0 && !batch.is_full() {
                self.waiting -= 1;
                batch.push(Received { frame: sync(), at_ns: now_ns });
            }
        }

        fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
            self.waiting
        }

        fn health(&mut self) -> BusHealth {
            BusHealth {
                state: BusState::ErrorActive,
                tx_frames: self.sent.len() as u64,
                ..BusHealth::default()
            }
        }
    }

    #[test]
    fn every_slot_is_used_or_counted_as_missed() {
        let report = measure::<Listener>(&options(200), sync(), None).unwrap();
        for run in [&report.sleep_only, &report.sleep_then_spin] {
            assert_eq!(run.release.count() + run.missed_slots, 200);
            assert!(run.wake.count() <= run.release.count());
        }
        assert_eq!((report.sleep_only.guard_ns, report.sleep_then_spin.guard_ns), (0, 100_000));
        assert!(report.bus.is_none());
    }

    #[test]
    fn sync_is_sent_once_in_every_slot_that_is_used_and_what_arrives_is_read() {
        let report = measure(&options(50), sync(), Some(Listener::default())).unwrap();
        let used = report.sleep_only.release.count() + report.sleep_then_spin.release.count();
        assert_eq!(report.bus.unwrap().tx_frames, used);
    }

    #[test]
    fn a_measured_guard_is_a_tenth_of_the_period_at_most() {
        let options = JitterOptions { spin_guard_ns: None, ..options(10) };
        let report = measure::<Listener>(&options, sync(), None).unwrap();
        assert!(report.sleep_then_spin.guard_ns <= 50_000);
    }

    #[test]
    fn there_is_no_grid_without_a_period() {
        let options = JitterOptions { period_ns: 0, ..options(10) };
        assert!(matches!(measure::<Listener>(&options, sync(), None), Err(JitterError::NoPeriod)));
    }
}
