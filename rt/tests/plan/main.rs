//! The planner: what its trajectories keep and where they arrive.

mod any_input;
mod checker;
mod jerk_limited;
mod oracle;
mod tracking;
mod trapezoid;
