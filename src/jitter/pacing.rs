//! The measuring loop, and what it writes down.

use takt_rt::frame::Frame;
use takt_rt::linux::{MonotonicClock, PageFaults};
use takt_rt::port::{BusPort, Clock, ReceiveBatch};
use takt_rt::time::Grid;

use super::{JitterOptions, JitterRun};
use crate::telemetry::Latency;

/// From the beginning of a run to its first slot.
const LEAD_IN_NS: u64 = 2_000_000;

/// One number a slot, written by the loop and read afterwards.
pub(super) struct Samples {
    slots: Vec<Option<Sample>>,
}

#[derive(Clone, Copy)]
struct Sample {
    /// 0 when there was no sleep.
    wake_ns: u64,
    release_ns: u64,
}

impl Samples {
    /// Room for so many slots, written to, so that its pages are there.
    pub(super) fn new(cycles: usize) -> Self {
        Self { slots: vec![Some(Sample { wake_ns: 1, release_ns: 1 }); cycles] }
    }

    /// What the run has left behind.
    pub(super) fn summarise(&self, guard_ns: u64, page_faults: PageFaults) -> JitterRun {
        let (mut wake, mut release, mut missed_slots) = (Latency::default(), Latency::default(), 0);
        for slot in &self.slots {
            match slot {
                None => missed_slots += 1,
                Some(sample) => {
                    release.add(sample.release_ns);
                    if sample.wake_ns > 0 {
                        wake.add(sample.wake_ns);
                    }
                }
            }
        }
        JitterRun { guard_ns, wake, release, missed_slots, page_faults }
    }
}

/// Runs through every slot once. A slot that has ended before the thread got to it is missed; one that has only begun
/// is late, and its release says how much.
pub(super) fn pace<P: BusPort>(
    options: &JitterOptions,
    guard_ns: u64,
    sync: Frame,
    mut port: Option<&mut P>,
    samples: &mut Samples,
) {
    let mut clock = MonotonicClock::new(guard_ns);
    let Some(grid) = Grid::new(clock.now_ns() + LEAD_IN_NS, options.period_ns) else { return };
    let mut arrived = ReceiveBatch::new();
    for (slot, sample) in (0u64..).zip(&mut samples.slots) {
        if clock.now_ns() >= grid.slot_start_ns(slot + 1) {
            *sample = None;
            continue;
        }
        let slot_start_ns = grid.slot_start_ns(slot);
        let wake = clock.wait_until(slot_start_ns);
        let released_ns = clock.now_ns();
        if let Some(port) = &mut port {
            port.send(released_ns, &[sync]);
        }
        let release_ns = released_ns.saturating_sub(slot_start_ns);
        *sample = Some(Sample { wake_ns: wake.timer_latency_ns, release_ns });
        if let Some(port) = &mut port {
            // In the middle of the slot, as the cycle reads its feedback.
            let middle_ns = slot_start_ns + options.period_ns / 2;
            clock.wait_until(middle_ns);
            arrived.clear();
            port.receive(middle_ns, &mut arrived);
        }
    }
}
