//! How a joint follows the reference of its group beside the cycle: by velocities, each of them that of the reference and a correction of
//! the position.

use takt_rt::Nanoseconds;

use crate::family::OffCycleTarget;

/// The set-points of a controller that is alive are never so old.
pub const STALE_NS: Nanoseconds = 100_000_000;
/// A drive that has not answered for so long is stopped as soon as it answers again.
pub const LOST_NS: Nanoseconds = 200_000_000;
/// The ramps of the drive are steeper than those of the axis, so that it follows them.
pub const STEEPER: f64 = 1.5;

/// Where a joint was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// rad (m)
    pub position: f64,
    /// rad/s (m/s)
    pub velocity: f64,
    /// When the position was.
    pub at_ns: Nanoseconds,
}

/// The velocity that leads a joint to the reference: rad/s (m/s). The gain is the velocity for one unit of position error: 1/s.
pub fn velocity(now_ns: Nanoseconds, target: &OffCycleTarget, seen: Seen, gain: f64, limit: f64) -> f64 {
    // What is older stops the joint, so that nothing is foretold for longer.
    let since = |at_ns: Nanoseconds| now_ns.saturating_sub(at_ns).min(LOST_NS) as f64 * 1e-9;
    let wanted = target.position + target.velocity * since(target.at_ns);
    let here = seen.position + seen.velocity * since(seen.at_ns);
    let velocity = target.velocity + gain * (wanted - here);
    // No number: then the joint stands.
    if velocity.is_finite() { velocity.clamp(-limit, limit) } else { 0.0 }
}
