//! The planner: what its trajectories keep and where they arrive.

mod allocation;
mod any_input;
mod checker;
mod counts;
mod families;
mod jerk_limited;
mod many;
mod oracle;
mod planning_anew;
mod random;
mod small_integers;
mod tracking;
mod trapezoid;
