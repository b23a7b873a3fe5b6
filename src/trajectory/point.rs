//! The points of a trajectory, as they are given.

use super::error::{PointQuantity, TrajectoryError};

/// A point of a trajectory, as in ROS a `JointTrajectoryPoint`: one value for each axis.
#[derive(Clone, Debug, Default, PartialEq, bitcode::Encode, bitcode::Decode)]
pub struct TrajectoryPoint {
    /// Seconds after the beginning of the trajectory.
    pub time_s: f64,
    /// rad (m)
    pub positions: Vec<f64>,
    /// rad/s (m/s); empty in all points if they are not given.
    pub velocities: Vec<f64>,
    /// rad/s² (m/s²); empty in all points if they are not given, and given only with velocities.
    pub accelerations: Vec<f64>,
}

/// The points of one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisPoints {
    /// rad (m), one for each point.
    pub positions: Vec<f64>,
    /// rad/s (m/s), one for each point if they are given.
    pub velocities: Option<Vec<f64>>,
    /// rad/s² (m/s²), one for each point if they are given, and only with velocities.
    pub accelerations: Option<Vec<f64>>,
}

impl AxisPoints {
    /// An axis that stays where it is.
    pub fn standing(position: f64, points: usize) -> Self {
        Self { positions: vec![position; points], velocities: None, accelerations: None }
    }
}

/// The points, an axis each. Every point has the same kinds of values for every axis then.
pub(super) fn columns(points: &[TrajectoryPoint], axes: usize) -> Result<Vec<AxisPoints>, TrajectoryError> {
    let given = |of: fn(&TrajectoryPoint) -> &Vec<f64>| points.iter().any(|point| !of(point).is_empty());
    let has_accelerations = given(|point| &point.accelerations);
    let has_velocities = has_accelerations || given(|point| &point.velocities);
    for (index, point) in points.iter().enumerate() {
        check_counts(index, point, axes, has_velocities, has_accelerations)?;
    }
    let of_axis = |axis: usize, of: fn(&TrajectoryPoint) -> &Vec<f64>| -> Vec<f64> {
        points.iter().filter_map(|point| of(point).get(axis).copied()).collect()
    };
    let columns = (0..axes).map(|axis| AxisPoints {
        positions: of_axis(axis, |point| &point.positions),
        velocities: has_velocities.then(|| of_axis(axis, |point| &point.velocities)),
        accelerations: has_accelerations.then(|| of_axis(axis, |point| &point.accelerations)),
    });
    Ok(columns.collect())
}

fn check_counts(
    index: usize,
    point: &TrajectoryPoint,
    axes: usize,
    has_velocities: bool,
    has_accelerations: bool,
) -> Result<(), TrajectoryError> {
    for (quantity, values, is_needed) in [
        (PointQuantity::Position, &point.positions, true),
        (PointQuantity::Velocity, &point.velocities, has_velocities),
        (PointQuantity::Acceleration, &point.accelerations, has_accelerations),
    ] {
        if is_needed && values.is_empty() && axes > 0 {
            return Err(TrajectoryError::Missing { point: index, axis: 0, quantity });
        }
        if !values.is_empty() && values.len() != axes {
            return Err(TrajectoryError::Count { point: index, quantity, given: values.len(), axes });
        }
    }
    Ok(())
}
