//! Third order: jerk-limited motions after L. Berscheid and T. Kröger, "Jerk-limited Real-time Trajectory Generation
//! with Arbitrary Target States", RSS 2021.
//!
//! - [`brake`] brings the start inside the limits.
//! - [`step1`] finds the fastest motion and the blocked intervals (the paper's step 1).
//! - [`step2`] finds a motion of given duration (the paper's step 2).
//! - `position` puts these together; `velocity` plans to a velocity alone; `reversing_stop` stops at a position limit.
//!
//! The paper lists profile types and tries each. This code follows families of motions with one parameter between points that
//! are known in closed form. Each family covers several of the paper's types:
//!
//! ```text
//!                    UDDU (`uddu`)            UDU (`udu`)               UDUD (`step2`)            two-step (`drift`)
//!                    velocity peak            no velocity peak          cruise between            no choice left
//!
//! acceleration        __                       __                        __       __               __
//!                    /  \                     /  \    / target           /  \     /  \             /  \
//!              start/    \                   /    \__/                  /    \   /    \           /    \
//!           0 -----'------\----.-----      -'-----least---         ---'------\_/------`---     -'------`---
//!                          \__/                                        cruise at zero
//!                              ` target                                 acceleration
//!
//! jerk               + 0 - 0 - 0 +            + 0 - +                   + 0 - 0 + 0 -             + 0 -
//!
//! paper's names      ACC0_ACC1_VEL, ACC0_VEL, ACC0 or NONE, with        the UDUD variants of      ACC0 or NONE, with
//!                    ACC1_VEL, VEL,           t4 = t5 = t6 = 0          ACC0_ACC1_VEL,            t4 to t7 = 0
//!                    ACC0_ACC1, ACC0, ACC1,                             ACC0_VEL, ACC1_VEL, VEL
//!                    NONE
//!
//! parameter          velocity of the peak     least acceleration        velocity of the cruise    none
//! ```
//!
//! Each figure shows the upward direction. The mirror image exchanges positive and negative direction (DUUD, DUD, DUDU).
//! The *root* of a phase of jerk is the velocity at which its acceleration is zero, or would be zero if it were longer.
//! Motions of the *same sign* (`SameSign` in `step1`) are UDU motions whose acceleration never reaches zero, because start and
//! target acceleration have one sign.
//!
//! The bound on the work of one axis: step 1 searches at most three roots in each of two UDDU families and five in each of two UDU
//! families, and step 2 at most three. A search evaluates its function at most [`roots::EVALUATIONS_MAX`] times. Everything
//! else is in closed form.

mod brake;
mod drift;
mod motion;
mod position;
mod reversing_stop;
pub(super) mod roots;
mod step1;
mod step2;
mod uddu;
mod udu;
mod velocity;

pub(super) use position::{Inside, fastest_position, position_lasting};
pub(super) use reversing_stop::reversing_stop;
pub(super) use velocity::{fastest_velocity, velocity_lasting};

/// A difference up to this, relative to the sizes of a problem, is rounding.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// The most searches for a root when one axis is planned. Step 1 runs for the fastest motion. It runs once more where the common
/// duration is close to a blocked interval.
#[cfg(test)]
pub(super) const SEARCHES_MAX: u32 = 2 * (2 * 3 + 2 * 5);
