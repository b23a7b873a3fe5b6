//! Where set-points come from when neither holding nor a move makes them: streams, trajectories and callbacks.
//!
//! ```text
//! points, stamped ──▶ LookAhead ── interpolation, some delay behind ──▶ StreamSample ──▶ follow ──▶ set-point
//!                     (on the host's side of the interface)              (once a slot)    (the engine)
//! ```
//!
//! - `target`: what is wanted of an axis, in a point and in a slot;
//! - `look_ahead`: [`LookAhead`] keeps the points in the order of their stamps, and says what they want in a slot;
//! - `delay`: how far behind the stamps it has to run so that the points do not run out, learnt from their arrival;
//! - `axis_piece`: what an axis is to do between two points, and `interpolation`: the motion between positions;
//! - `follower`: the next set-point of an axis on its way to what is wanted, within every limit;
//! - `velocity`: the same on its way to a velocity;
//! - `trajectory`: set-points that were checked as a whole before they begin;
//! - `callback`: the owner's function in the real-time thread.

mod axis_piece;
mod callback;
mod delay;
mod follower;
mod interpolation;
mod look_ahead;
mod target;
mod trajectory;
mod velocity;

pub use callback::{
    CallbackCycle, CallbackId, CallbackOutcome, CallbackReturn, CallbackRun, PositionSequence,
};
pub use delay::StreamDelay;
pub use follower::follow;
pub use look_ahead::{LookAhead, LookAheadParameters, POINTS_AT_MOST, PointError};
pub use target::{
    AxisPoint, AxisTarget, Follow, PointRole, PositionPoint, StreamCounts, StreamPoint, StreamReport,
    StreamSample, StreamState, StreamWish,
};
pub use trajectory::{PathTime, Polynomial, TimeLawPhase, TrajectorySample, TrajectoryView};
pub use velocity::follow_velocity;
