//! Whether an axis takes what a point of a stream says of it, before the point is handed over.

use takt_rt::{AxisPoint, OperationMode};

use crate::config::{Axis, Control};
use crate::words;
use crate::words::Words;

/// Why an axis does not take a point. rad and N·m, or m and N.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode, thiserror::Error)]
#[error("{}", self.words())]
#[non_exhaustive]
pub enum PointRefusal {
    /// A number is infinite or none.
    NotFinite {
        /// What is given.
        value: AxisPoint,
    },
    /// A number is too large to be computed with. Positions and velocities beyond the limits of the axis are led to within them, up to it.
    TooLarge {
        /// What is given.
        number: f64,
        /// The largest one.
        largest: f64,
    },
    /// A torque or an impedance needs a loop that is closed here.
    NoTorqueInMode {
        /// Its mode.
        mode: OperationMode,
    },
    /// The drive closes the loops, and takes no torque beside its target.
    NoFeedForward,
    /// A torque is beyond the limit of the axis.
    Torque {
        /// What is given.
        torque: f64,
        /// The limit of the axis.
        limit: f64,
    },
    /// A stiffness is negative, or more than the axis allows.
    Stiffness {
        /// What is given.
        stiffness: f64,
        /// What the axis allows.
        limit: f64,
    },
    /// A damping is negative, or more than the axis allows.
    Damping {
        /// What is given.
        damping: f64,
        /// What the axis allows.
        limit: f64,
    },
}

impl PointRefusal {
    /// The sentence, for a page in another language.
    pub fn words(&self) -> Words {
        match *self {
            Self::NotFinite { value } => {
                let first = numbers(&value).find(|(_, number)| !number.is_finite());
                let (name, number) = first.unwrap_or(("point", f64::NAN));
                words!("the {name} is {number}, and must be a finite number", name = Words::from(name), number)
            }
            Self::TooLarge { number, largest } => {
                words!("a number is too large: {number}, beyond {largest}", number, largest)
            }
            Self::NoTorqueInMode { mode } => words!(
                "a torque or an impedance needs mode \"cst\", and the axis is in {mode}",
                mode = format!("{mode:?}")
            ),
            Self::NoFeedForward => {
                "a torque is fed forward, and the drive takes none: that needs feed_forward = \"torque\", or mode \"cst\""
                    .into()
            }
            Self::Torque { torque, limit } => {
                words!("a torque of {torque} is beyond the limit of {limit}", torque, limit)
            }
            Self::Stiffness { stiffness, limit } => words!(
                "a stiffness of {stiffness} is not within 0 to {limit} (stiffness_max)",
                stiffness,
                limit
            ),
            Self::Damping { damping, limit } => {
                words!("a damping of {damping} is not within 0 to {limit} (damping_max)", damping, limit)
            }
        }
    }
}

/// The largest number of a point. What is computed from numbers up to it stays finite.
const LARGEST: f64 = 1e9;

/// The numbers of a point, and what they are.
fn numbers(point: &AxisPoint) -> impl Iterator<Item = (&'static str, f64)> {
    let (motion, others) = match *point {
        AxisPoint::Position { motion, torque } => (Some(motion), [("torque", torque), ("", 0.0), ("", 0.0)]),
        AxisPoint::Impedance { motion, stiffness, damping, torque } => {
            (Some(motion), [("torque", torque), ("stiffness", stiffness), ("damping", damping)])
        }
        AxisPoint::Velocity(velocity) => (None, [("velocity", velocity), ("", 0.0), ("", 0.0)]),
        AxisPoint::Torque(torque) => (None, [("torque", torque), ("", 0.0), ("", 0.0)]),
    };
    let of_motion = motion.into_iter().flat_map(|motion| {
        let velocity = motion.velocity.map(|velocity| ("velocity", velocity));
        let acceleration = motion.acceleration.map(|acceleration| ("acceleration", acceleration));
        [Some(("position", motion.position)), velocity, acceleration].into_iter().flatten()
    });
    of_motion.chain(others)
}

/// Checks that an axis takes a point while it is commanded so: in the mode that it starts in, or in one that it has been changed to.
/// Positions and velocities are led to within the limits, whatever they are.
///
/// # Errors
/// What it does not take.
pub fn check_point(axis: &Axis, control: &Control, point: &AxisPoint) -> Result<(), PointRefusal> {
    if !point.is_finite() {
        return Err(PointRefusal::NotFinite { value: *point });
    }
    if let Some((_, number)) = numbers(point).find(|(_, number)| number.abs() > LARGEST) {
        return Err(PointRefusal::TooLarge { number, largest: LARGEST });
    }
    let has_torque_loop = matches!(control, Control::Torque { .. });
    let within = |torque: f64| {
        let limit = axis.limits.torque;
        if torque.abs() <= limit { Ok(()) } else { Err(PointRefusal::Torque { torque, limit }) }
    };
    let torque_loop = || {
        let mode = control.operation_mode();
        if has_torque_loop { Ok(()) } else { Err(PointRefusal::NoTorqueInMode { mode }) }
    };
    match *point {
        AxisPoint::Position { torque, .. } if torque != 0.0 => {
            let takes_torque = has_torque_loop || axis.feed_forward.has_torque();
            if takes_torque { within(torque) } else { Err(PointRefusal::NoFeedForward) }
        }
        AxisPoint::Position { .. } | AxisPoint::Velocity(_) => Ok(()),
        AxisPoint::Torque(torque) => torque_loop().and_then(|()| within(torque)),
        AxisPoint::Impedance { stiffness, damping, torque, .. } => {
            torque_loop()?;
            let (highest, strongest) = (axis.compliance.stiffness_max, axis.compliance.damping_max);
            if !(0.0..=highest).contains(&stiffness) {
                return Err(PointRefusal::Stiffness { stiffness, limit: highest });
            }
            if !(0.0..=strongest).contains(&damping) {
                return Err(PointRefusal::Damping { damping, limit: strongest });
            }
            within(torque)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{FeedForward, Limits};
    use crate::family;

    fn axis(control: Control) -> Axis {
        let limits = Limits {
            position_min: -1.0,
            position_max: 1.0,
            velocity: 1.0,
            acceleration: 5.0,
            deceleration: 5.0,
            jerk: 50.0,
            torque: 20.0,
        };
        Axis::new("joint", 0, 1, family::EROB_CANOPEN, limits).with_control(control)
    }

    const CST: Control = Control::Torque {
        stiffness: 1600.0,
        damping: 80.0,
        inertia: 1.0,
        viscous_friction: 1.0,
        coulomb_friction: 0.5,
    };

    #[test]
    fn each_mode_takes_its_own_kinds_of_points() {
        let (csp, cst) = (axis(Control::Position), axis(CST));
        let soft = AxisPoint::position(0.1).with_impedance(100.0, 10.0);
        for point in [AxisPoint::position(0.1), AxisPoint::Velocity(9.0)] {
            assert_eq!(
                (check_point(&csp, &csp.control, &point), check_point(&cst, &cst.control, &point)),
                (Ok(()), Ok(()))
            );
        }
        for point in [AxisPoint::Torque(5.0), soft] {
            let mode = OperationMode::CyclicSynchronousPosition;
            assert_eq!(check_point(&csp, &csp.control, &point), Err(PointRefusal::NoTorqueInMode { mode }));
            assert_eq!(check_point(&cst, &cst.control, &point), Ok(()));
        }
        let fed_forward = AxisPoint::position(0.1).with_torque(3.0);
        assert_eq!(check_point(&csp, &csp.control, &fed_forward), Err(PointRefusal::NoFeedForward));
        assert_eq!(check_point(&cst, &cst.control, &fed_forward), Ok(()));
        let csp = Axis { feed_forward: FeedForward::Torque, ..csp };
        assert_eq!(check_point(&csp, &csp.control, &fed_forward), Ok(()));
    }

    #[test]
    fn what_is_beyond_a_limit_is_refused_with_the_limit() {
        let cst = axis(CST);
        let refusal = |point: AxisPoint| check_point(&cst, &cst.control, &point).unwrap_err();
        let torque = PointRefusal::Torque { torque: -20.1, limit: 20.0 };
        assert_eq!(refusal(AxisPoint::Torque(-20.1)), torque);
        assert_eq!(refusal(AxisPoint::position(0.0).with_torque(-20.1)), torque);
        let soft = AxisPoint::position(0.0);
        let stiffness = PointRefusal::Stiffness { stiffness: 1601.0, limit: 1600.0 };
        assert_eq!(refusal(soft.with_impedance(1601.0, 1.0)), stiffness);
        let damping = PointRefusal::Damping { damping: -1.0, limit: 80.0 };
        assert_eq!(refusal(soft.with_impedance(1.0, -1.0)), damping);
        assert_eq!(refusal(f64::NAN.into()).to_string(), "the position is NaN, and must be a finite number");
        assert_eq!(
            refusal(AxisPoint::moving(0.0, f64::INFINITY)).to_string(),
            "the velocity is inf, and must be a finite number"
        );
        for huge in [
            f64::MAX.into(),
            AxisPoint::moving(0.0, -1e300),
            AxisPoint::Velocity(-1e10),
            AxisPoint::Torque(1e10),
            soft.with_impedance(1e10, 1.0),
        ] {
            assert!(matches!(refusal(huge), PointRefusal::TooLarge { .. }), "{huge:?}");
        }
        assert_eq!(check_point(&cst, &cst.control, &1e9.into()), Ok(()));
    }
}
