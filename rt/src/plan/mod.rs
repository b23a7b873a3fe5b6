//! Trajectories: from any state to any state in minimum time within limits, for any number of axes at once.
//!
//! A [`Problem`] says where an axis is, where it shall be and what it must keep; its answer is a [`Profile`],
//! an exact trajectory made of phases of constant jerk. [`synchronised`] plans all axes so that they arrive
//! together, [`stop`] brings them to rest together. Planning anew in every cycle from the commanded state,
//! `profile.sample(t)`, gives the same motion again.
//!
//! ```
//! use takt_rt::plan::{Limits, Problem, Profile, State, PlanOptions, synchronised};
//! let limits = Limits::symmetric(2.0, 8.0, f64::INFINITY);
//! let problems = [1.0, -0.25].map(|target| Problem { start: State::rest(0.0), target: State::rest(target), limits });
//! let mut profiles = [Profile::hold(0.0); 2];
//! let duration_s = synchronised(&problems, &mut profiles, PlanOptions::default()).unwrap();
//! assert_eq!(duration_s, 0.75);
//! assert_eq!(profiles[1].sample(duration_s), State::rest(-0.25));
//! ```
//!
//! The planner allocates nothing, panics on nothing and always ends, for its work has a fixed bound. Planning an axis searches at
//! most 32 roots, each with at most 96 evaluations of a polynomial with two square roots (five are usual); where position limits
//! are left, motions within them are planned in at most three rounds, which makes at most 320 searches. A stop
//! has none, but halves a range 48 times where it must turn around at a position limit. All of this once for every axis,
//! and once more for a straight line.

#[cfg(test)]
mod bound;
mod choice;
mod error;
mod group;
mod jerk_limited;
mod problem;
mod profile;
mod ramp;
mod straight;
mod synchronisation;
mod tracking;
mod trapezoid;
mod travel;

pub use error::{Limit, PlanError, Quantity};
pub use group::{GroupState, Refusal, Trajectory};
pub use problem::{Limits, Problem, State};
pub use profile::{Blocked, Extrema, PHASES_MAX, Phase, Profile, Range};
pub use synchronisation::{
    PlanOptions, Return, Synchronisation, position, stop, synchronised, synchronised_velocity, velocity,
};
