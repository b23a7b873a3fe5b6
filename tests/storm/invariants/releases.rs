//! No drive loses its torque, or applies its brake, before its joint stands, in a stop that waits for that.

use takt::config::Axis;
use takt::sim::Observation;
use takt_rt::{Rule, StopCategory};

use super::Seen;
use crate::heartbeat::MissedHeartbeat;

/// A joint slower than this fraction of its velocity limit may lose its torque.
const SLOW: f64 = 0.02;

pub struct Releases {
    axes: Vec<Option<Observation>>,
    /// When they were looked at last.
    seen_ns: u64,
    /// True if the power of each axis has been cut at once since its group was last enabled.
    is_cut: Vec<bool>,
}

impl Releases {
    pub fn new(axes: usize) -> Self {
        Self { axes: vec![None; axes], seen_ns: 0, is_cut: vec![false; axes] }
    }

    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        for (axis, is_cut) in self.is_cut.iter_mut().enumerate() {
            *is_cut = match seen.group_of(axis).stop {
                Some(stop) => *is_cut || stop.category == StopCategory::Zero,
                None => false,
            };
        }
        let now_ns = seen.snapshot.at_ns;
        let elapsed_s = (now_ns - std::mem::replace(&mut self.seen_ns, now_ns)) as f64 * 1e-9;
        let axes = seen.config.axes.iter().zip(seen.truth).zip(seen.concerns);
        for (number, (last, ((axis, now), concern))) in self.axes.iter_mut().zip(axes).enumerate() {
            let Some(before) = last.replace(*now) else { continue };
            let is_released = before.state.has_torque() && !now.state.has_torque();
            let is_braked = !before.is_braked && now.is_braked;
            let speed = before.velocity.abs();
            // It has gone on slowing down since the last look.
            let slow =
                SLOW * axis.limits.velocity + axis.limits.deceleration * elapsed_s + unseen_speed(seen, axis);
            // A drive that has missed the heartbeat stops by its own fault reaction, and is not enabled again after it.
            let is_own_reaction = match concern.missed_heartbeat {
                MissedHeartbeat::Shown => true,
                // Its alarm has ended before anybody looked, and was reported.
                MissedHeartbeat::Possibly => has_reported_fault(seen, number),
                MissedHeartbeat::No => false,
            };
            // `takt run` refuses a bus whose feedback comes too late. The speed of such a joint is not known.
            let is_unheard = seen.overloaded_buses[axis.bus]
                && seen.snapshot.axes[number].feedback_age > axis.missed_feedback_cycles;
            let is_taken =
                (is_released || is_braked) && !self.is_cut[number] && !is_own_reaction && !is_unheard;
            if is_taken && !concern.is_present && speed > slow {
                return Err(format!(
                    "{}: power taken at {speed} of {}: {now:?}, {:?}",
                    axis.name,
                    axis.limits.velocity,
                    seen.group_of(number).stop
                ));
            }
        }
        Ok(())
    }
}

/// Returns `true` if a fault of the drive has stopped its group.
fn has_reported_fault(seen: &Seen<'_>, axis: usize) -> bool {
    let stop = seen.group_of(axis).stop;
    stop.is_some_and(|stop| stop.rule() == Rule::DriveFault && stop.axis().map(usize::from) == Some(axis))
}

/// How fast a joint may be that turns round within one and a half counts of its drive's position, while it is watched: it is four times as
/// fast then as from end to end.
fn unseen_speed(seen: &Seen<'_>, axis: &Axis) -> f64 {
    const WATCHED_CYCLES: f64 = 20.0;
    let cycle_s = seen.config.bus_cycle(axis.bus).period_ns as f64 * 1e-9;
    let count = axis.scale().map_or(0.0, |scale| 1.0 / scale.resolution());
    4.0 * 1.5 * count / (WATCHED_CYCLES * cycle_s)
}
