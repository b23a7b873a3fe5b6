//! Trajectories: from any state to any state in minimum time within limits, for any number of axes at once.
//!
//! A [`Problem`] has the start state of an axis, its target state and its limits. The answer is a [`Profile`], an exact
//! trajectory made of phases of constant jerk. [`synchronised`] plans all axes so that they arrive together, and [`stop`]
//! brings them to rest together. Planning again in every cycle from the commanded state, `profile.sample(t)`, gives the
//! same motion again.
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
//! The planner does not allocate, does not panic, and always ends: its work has a fixed bound. Planning one axis searches at
//! most 32 roots. Each search evaluates a polynomial with two square roots at most 96 times (five times is usual). Where
//! position limits are left, motions within them are planned in at most three rounds, with at most 320 searches in all. A stop
//! searches no roots, but it halves a range 48 times where it must reverse at a position limit. All of this is done once for each
//! axis, and once more for a straight line.
//!
//! A reader may start with `synchronisation`, which plans all axes. `jerk_limited` and `trapezoid` plan one axis, and
//! `second_order` is the closed form that both use. `travel` keeps position limits, `straight` keeps axes on a line, and
//! `tracking` follows a moving target.

#[cfg(test)]
mod bound;
mod choice;
mod error;
mod group;
mod jerk_limited;
mod options;
mod problem;
mod profile;
mod second_order;
mod straight;
mod synchronisation;
mod tracking;
mod trapezoid;
mod travel;

pub use error::{Limit, PlanError, Quantity};
pub use group::{GroupState, PlanFailure, Trajectory};
pub use options::{PlanOptions, Return, Synchronisation};
pub use problem::{Limits, Problem, State};
pub use profile::{Blocked, Extrema, PHASES_MAX, Phase, Profile, Range};
pub use synchronisation::{position, stop, synchronised, synchronised_velocity, velocity};
