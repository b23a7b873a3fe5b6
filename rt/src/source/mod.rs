//! Where the set-points of a group come from, besides what the planner makes of a move.

mod trajectory;

pub use trajectory::{PathTime, Polynomial, TimeLawPhase, TrajectorySample, TrajectoryView};
