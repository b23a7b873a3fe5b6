//! The planner: what its trajectories keep and where they arrive.

mod any_input;
mod checker;
mod counts;
mod jerk_limited;
mod many;
mod oracle;
mod planning_anew;
mod small_integers;
mod tracking;
mod trapezoid;
