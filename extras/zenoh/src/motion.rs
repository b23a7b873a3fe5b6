//! A joint trajectory as points of takt.

use std::time::Duration;

use takt::{Snapshot, TrajectoryPoint};
use thiserror::Error;

use crate::messages::{JointPoint, JointTrajectory};

/// The beginning of a trajectory may be this long ago, for the way that it has come.
const LATE_NS: i64 = 500_000_000;
/// The beginning of a trajectory may be this far ahead: who waits longer has probably another clock.
const EARLY_NS: i64 = 30_000_000_000;

/// Why a trajectory is not carried out.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Unfit {
    /// The message is no trajectory.
    #[error("the message is no trajectory_msgs/msg/JointTrajectory in CDR")]
    NotCdr,
    /// It names a joint that is no axis.
    #[error("there is no axis {name:?}; the axes are: {}", known.join(", "))]
    UnknownJoint {
        /// The joint.
        name: String,
        /// The axes.
        known: Vec<String>,
    },
    /// It names a joint twice.
    #[error("it names the joint {name:?} twice")]
    Twice {
        /// The joint.
        name: String,
    },
    /// It names joints of several groups.
    #[error(
        "its joints are of the groups {first:?} and {other:?}, which move independently: send each a trajectory"
    )]
    SeveralGroups {
        /// The group of the first joint.
        first: String,
        /// Another one.
        other: String,
    },
    /// A list of a point has another length.
    #[error("point {point} has {given} {what} for {joints} joints")]
    Length {
        /// The point, counted from 0.
        point: usize,
        /// `positions`, `velocities` or `accelerations`.
        what: &'static str,
        /// How many there are.
        given: usize,
        /// How many joints there are.
        joints: usize,
    },
    /// A point has efforts, which a trajectory of positions has no use for.
    #[error("point {point} has efforts: takt computes the torques of a trajectory")]
    Efforts {
        /// The point, counted from 0.
        point: usize,
    },
    /// It should have begun long ago.
    #[error(
        "its stamp, {stamp_s:.3} s on the sender's clock, is {:.3} s behind {now_s:.3} s on this computer's clock (allowed: {:.1} s). \
         Synchronize both clocks, or stamp it with 0 to begin at once",
        now_s - stamp_s, seconds(LATE_NS)
    )]
    Late {
        /// When it is to begin, by the clock of its sender: seconds since 1970.
        stamp_s: f64,
        /// The time by the clock of this computer.
        now_s: f64,
    },
    /// It is to begin too far ahead.
    #[error(
        "its stamp, {stamp_s:.3} s on the sender's clock, is {:.3} s ahead of {now_s:.3} s on this computer's clock (allowed: {:.1} s). \
         Synchronize both clocks, or stamp it with 0 to begin at once",
        stamp_s - now_s, seconds(EARLY_NS)
    )]
    Early {
        /// When it is to begin, by the clock of its sender: seconds since 1970.
        stamp_s: f64,
        /// The time by the clock of this computer.
        now_s: f64,
    },
}

/// An axis: its name and its group.
pub struct AxisPlace {
    /// Its name.
    pub name: String,
    /// The number of its group.
    pub group: usize,
}

/// What is to be carried out.
#[derive(Clone, Debug, PartialEq)]
pub enum Wanted {
    /// The trajectory without points: come to rest, and hold.
    Stop,
    /// This one, of a group.
    Execute {
        /// The number of the group.
        group: usize,
        /// Wait before it starts. The wait is not part of the trajectory.
        delay: Duration,
        /// Its points, for the axes of the group in their order.
        points: Vec<TrajectoryPoint>,
    },
}

/// What a trajectory wants of axes that are in a state. Axes that it does not name stay at their set-points. `now_ns` is the time of day in
/// ns since 1970.
pub fn wanted(
    trajectory: &JointTrajectory,
    axes: &[AxisPlace],
    groups: &[String],
    state: &Snapshot,
    now_ns: i64,
) -> Result<Wanted, Unfit> {
    if trajectory.points.is_empty() {
        return Ok(Wanted::Stop);
    }
    let named = named(trajectory, axes)?;
    let group = named.first().and_then(|axis| axes.get(*axis)).map_or(0, |axis| axis.group);
    if let Some(other) = named.iter().filter_map(|axis| axes.get(*axis)).find(|axis| axis.group != group) {
        let name = |group: usize| groups.get(group).cloned().unwrap_or_default();
        return Err(Unfit::SeveralGroups { first: name(group), other: name(other.group) });
    }
    let delay = delay(trajectory.at_ns, now_ns)?;
    let of_group: Vec<usize> = (0..axes.len()).filter(|axis| axes[*axis].group == group).collect();
    let set_points: Vec<f64> = of_group
        .iter()
        .map(|axis| state.axes().get(*axis).map_or(f64::NAN, |axis| axis.position_set))
        .collect();
    let have = |of: fn(&JointPoint) -> &Vec<f64>| trajectory.points.iter().any(|point| !of(point).is_empty());
    let still = |are_given: bool| if are_given { vec![0.0; of_group.len()] } else { vec![] };
    let (velocities, accelerations) =
        (still(have(|point| &point.velocities)), still(have(|point| &point.accelerations)));
    let mut points = Vec::with_capacity(trajectory.points.len());
    for (number, point) in trajectory.points.iter().enumerate() {
        check_lengths(number, point, named.len())?;
        let spread = |values: &[f64], others: &[f64]| -> Vec<f64> {
            if values.is_empty() {
                return vec![];
            }
            let own = |axis: &usize| named.iter().position(|named| named == axis);
            let both = of_group.iter().zip(others);
            both.map(|(axis, other)| own(axis).and_then(|own| values.get(own)).copied().unwrap_or(*other))
                .collect()
        };
        points.push(TrajectoryPoint {
            time_s: point.time_s,
            positions: spread(&point.positions, &set_points),
            velocities: spread(&point.velocities, &velocities),
            accelerations: spread(&point.accelerations, &accelerations),
        });
    }
    Ok(Wanted::Execute { group, delay, points })
}

/// Returns the wait of a trajectory with a stamp.
fn delay(at_ns: i64, now_ns: i64) -> Result<Duration, Unfit> {
    let ahead_ns = if at_ns == 0 { 0 } else { at_ns.saturating_sub(now_ns) };
    let (stamp_s, now_s) = (seconds(at_ns), seconds(now_ns));
    if ahead_ns < -LATE_NS {
        return Err(Unfit::Late { stamp_s, now_s });
    }
    if ahead_ns > EARLY_NS {
        return Err(Unfit::Early { stamp_s, now_s });
    }
    Ok(Duration::from_nanos(ahead_ns.max(0).unsigned_abs()))
}

fn seconds(ns: i64) -> f64 {
    ns as f64 / 1e9
}

/// The axes that it names, in its order.
fn named(trajectory: &JointTrajectory, axes: &[AxisPlace]) -> Result<Vec<usize>, Unfit> {
    let mut named = Vec::with_capacity(trajectory.names.len());
    for name in &trajectory.names {
        let Some(axis) = axes.iter().position(|axis| axis.name == *name) else {
            let known = axes.iter().map(|axis| axis.name.clone()).collect();
            return Err(Unfit::UnknownJoint { name: name.clone(), known });
        };
        if named.contains(&axis) {
            return Err(Unfit::Twice { name: name.clone() });
        }
        named.push(axis);
    }
    Ok(named)
}

fn check_lengths(number: usize, point: &JointPoint, joints: usize) -> Result<(), Unfit> {
    let refused =
        |what, values: &[f64]| Err(Unfit::Length { point: number, what, given: values.len(), joints });
    if point.positions.len() != joints {
        return refused("positions", &point.positions);
    }
    for (what, values) in [("velocities", &point.velocities), ("accelerations", &point.accelerations)] {
        if !values.is_empty() && values.len() != joints {
            return refused(what, values);
        }
    }
    if point.efforts.is_empty() { Ok(()) } else { Err(Unfit::Efforts { point: number }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Vec<AxisPlace> {
        [("a", 0), ("b", 0), ("c", 1)].map(|(name, group)| AxisPlace { name: name.to_owned(), group }).into()
    }

    fn state() -> Snapshot {
        let mut state = Snapshot { axis_count: 3, ..Snapshot::default() };
        for (axis, position) in state.axes.iter_mut().zip([0.1, 0.2, 0.3]) {
            axis.position_set = position;
        }
        state
    }

    fn trajectory(names: &[&str], points: Vec<JointPoint>) -> JointTrajectory {
        JointTrajectory { at_ns: 0, names: names.iter().map(|name| (*name).to_owned()).collect(), points }
    }

    fn point(positions: &[f64], time_s: f64) -> JointPoint {
        JointPoint { positions: positions.to_vec(), time_s, ..JointPoint::default() }
    }

    fn groups() -> [String; 2] {
        ["arm".to_owned(), "hand".to_owned()]
    }

    fn of(trajectory: &JointTrajectory) -> Result<Wanted, Unfit> {
        wanted(trajectory, &axes(), &groups(), &state(), 5_000_000_000)
    }

    #[test]
    fn joints_come_in_any_order_and_those_that_are_not_named_stay() {
        let both = of(&trajectory(&["b", "a"], vec![point(&[2.0, 1.0], 1.0)])).unwrap();
        let Wanted::Execute { group: 0, points, .. } = both else { panic!("{both:?}") };
        assert_eq!((points[0].positions.as_slice(), points[0].time_s), (&[1.0, 2.0][..], 1.0));
        let moving = JointPoint { velocities: vec![0.5], ..point(&[2.0], 1.0) };
        let one = of(&trajectory(&["b"], vec![moving])).unwrap();
        let Wanted::Execute { points, .. } = one else { panic!("{one:?}") };
        assert_eq!((&points[0].positions, &points[0].velocities), (&vec![0.1, 2.0], &vec![0.0, 0.5]));
        let hand = of(&trajectory(&["c"], vec![point(&[1.0], 1.0)])).unwrap();
        assert!(matches!(hand, Wanted::Execute { group: 1, points, .. } if points[0].positions == [1.0]));
    }

    #[test]
    fn the_wait_before_a_trajectory_is_no_part_of_it() {
        for at_ns in [0, 7_000_000_000, 4_900_000_000, 35_000_000_000] {
            let stamped = JointTrajectory { at_ns, ..trajectory(&["c"], vec![point(&[1.0], 1.5)]) };
            let Ok(Wanted::Execute { delay, points, .. }) = of(&stamped) else {
                panic!("{:?}", of(&stamped))
            };
            let times: Vec<_> = points.iter().map(|point| (point.time_s, point.positions[0])).collect();
            assert_eq!(times, [(1.5, 1.0)]);
            let expected_ns = if at_ns == 0 { 0 } else { (at_ns - 5_000_000_000).max(0) };
            assert_eq!(delay, Duration::from_nanos(expected_ns.unsigned_abs()));
        }
    }

    #[test]
    fn a_stamp_of_another_clock_is_refused_with_both_times() {
        let stamped = |at_ns| of(&JointTrajectory { at_ns, ..trajectory(&["c"], vec![point(&[1.0], 1.5)]) });
        let late = stamped(4_000_000_000).unwrap_err();
        assert_eq!(
            late.to_string(),
            "its stamp, 4.000 s on the sender's clock, is 1.000 s behind 5.000 s on this computer's clock (allowed: 0.5 s). \
             Synchronize both clocks, or stamp it with 0 to begin at once"
        );
        let early = stamped(36_000_000_000).unwrap_err();
        assert_eq!(
            early.to_string(),
            "its stamp, 36.000 s on the sender's clock, is 31.000 s ahead of 5.000 s on this computer's clock (allowed: 30.0 s). \
             Synchronize both clocks, or stamp it with 0 to begin at once"
        );
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_place() {
        assert_eq!(of(&trajectory(&[], vec![])), Ok(Wanted::Stop));
        let refused =
            |names: &[&str], of_point: JointPoint| of(&trajectory(names, vec![of_point])).unwrap_err();
        assert!(
            matches!(refused(&["x"], point(&[1.0], 1.0)), Unfit::UnknownJoint { name, .. } if name == "x")
        );
        assert_eq!(refused(&["a", "a"], point(&[1.0, 1.0], 1.0)), Unfit::Twice { name: "a".to_owned() });
        let [first, other] = groups();
        assert_eq!(refused(&["a", "c"], point(&[1.0, 1.0], 1.0)), Unfit::SeveralGroups { first, other });
        let short = Unfit::Length { point: 0, what: "positions", given: 1, joints: 2 };
        assert_eq!(refused(&["a", "b"], point(&[1.0], 1.0)), short);
        let long = JointPoint { accelerations: vec![0.0; 2], ..point(&[1.0], 1.0) };
        let long_accelerations = Unfit::Length { point: 0, what: "accelerations", given: 2, joints: 1 };
        assert_eq!(refused(&["a"], long), long_accelerations);
        let pushing = JointPoint { efforts: vec![1.0], ..point(&[1.0], 1.0) };
        assert_eq!(refused(&["a"], pushing), Unfit::Efforts { point: 0 });
    }
}
