//! Converts the problems to the input of `rsruckig`.

use rsruckig::prelude::{ControlInterface, DataArrayOrVec, InputParameter};
use takt_rt::plan::Problem;

/// The same problem for `rsruckig`; with `velocity`, for its velocity interface.
pub fn input<const AXES: usize>(problems: &[Problem], velocity: bool) -> InputParameter<AXES> {
    let all = |of: fn(&Problem) -> f64| {
        let mut values = DataArrayOrVec::<f64, AXES>::new(None, 0.0);
        for (axis, problem) in problems.iter().enumerate() {
            values[axis] = of(problem);
        }
        values
    };
    let mut input = InputParameter::new(None);
    if velocity {
        input.control_interface = ControlInterface::Velocity;
    }
    input.current_position = all(|problem| problem.start.position);
    input.current_velocity = all(|problem| problem.start.velocity);
    input.current_acceleration = all(|problem| problem.start.acceleration);
    input.target_position = all(|problem| problem.target.position);
    input.target_velocity = all(|problem| problem.target.velocity);
    input.target_acceleration = all(|problem| problem.target.acceleration);
    input.max_velocity = all(|problem| problem.limits.velocity_max);
    input.max_acceleration = all(|problem| problem.limits.acceleration_max);
    input.max_jerk = all(|problem| problem.limits.jerk_max);
    input
}
