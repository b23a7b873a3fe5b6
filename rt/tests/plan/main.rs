//! The planner: what its trajectories keep and where they arrive.

mod checker;
mod oracle;
mod trapezoid;
