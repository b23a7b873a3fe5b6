//! The motions of a module: absolute, relative, reciprocating, continuous, by velocity and by torque (eRunner manual 7.4 and chapter 4;
//! eRob Modbus-RTU manual, chapter 5).

use std::num::NonZeroU32;

use takt_rt::Nanoseconds;

/// The profile of position and velocity control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Profile {
    /// counts/s, not negative
    pub velocity: i32,
    /// counts/s²; at most three times the velocity is advised
    pub acceleration: i32,
    /// counts/s²; at most three times the velocity is advised
    pub deceleration: i32,
}

/// A motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// None: the joint is held where it is.
    Hold,
    /// To a position: counts.
    To(i32, Profile),
    /// By a distance: counts.
    By(i32, Profile),
    /// To a position and back, so many times, one absolute move after the other.
    BackAndForth {
        /// counts
        to: i32,
        /// How often.
        times: u32,
        /// The time at each end.
        dwell_ns: Nanoseconds,
        /// The profile of each move.
        profile: Profile,
    },
    /// To a position and back by the module itself, again and again.
    ReciprocatingTo {
        /// counts
        to: i32,
        /// The time at each end.
        dwell_ns: Nanoseconds,
        /// The profile.
        profile: Profile,
    },
    /// At the velocity of the profile, in a direction.
    Continuous(Direction, Profile),
    /// At a velocity by velocity control: counts/s. That of the profile is not used.
    Velocity(i32, Profile),
    /// With a current.
    Torque {
        /// mA
        current: i32,
        /// counts/s that the joint never exceeds. In an example of the Modbus-RTU manual this is 0, and the joint moves: so 0 may be no
        /// limit, and is not taken.
        velocity_limit: NonZeroU32,
    },
}

/// The direction of a continuous motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Towards higher counts.
    Forward,
    /// Towards lower counts.
    Backward,
}

/// Kind of motion that is stopped, which determines how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// A motion of position control, with the profile deceleration.
    Move,
    /// A motion to and fro.
    Reciprocation,
    /// Velocity control: its set-point.
    Velocity,
    /// Torque control: its set-point. Friction stops the joint.
    Torque,
}

/// What the set-point of a module means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum OperatingMode {
    /// A current: mA.
    Torque = 1,
    /// A velocity: counts/s.
    Velocity = 2,
    /// None: moves, and motion without end.
    Position = 3,
}

impl Motion {
    /// The profile, where it has one.
    pub const fn profile(self) -> Option<Profile> {
        match self {
            Self::To(_, profile)
            | Self::By(_, profile)
            | Self::BackAndForth { profile, .. }
            | Self::ReciprocatingTo { profile, .. }
            | Self::Continuous(_, profile)
            | Self::Velocity(_, profile) => Some(profile),
            Self::Hold | Self::Torque { .. } => None,
        }
    }

    /// The operating mode that carries it out.
    pub const fn mode(self) -> OperatingMode {
        match self {
            Self::Torque { .. } => OperatingMode::Torque,
            Self::Velocity(..) => OperatingMode::Velocity,
            _ => OperatingMode::Position,
        }
    }

    /// The motion mode of position control that carries it out.
    pub const fn motion_mode(self) -> Option<i64> {
        match self {
            Self::Continuous(..) => Some(0),
            Self::To(..) | Self::By(..) | Self::BackAndForth { .. } => Some(1),
            Self::ReciprocatingTo { .. } => Some(2),
            Self::Hold | Self::Velocity(..) | Self::Torque { .. } => None,
        }
    }

    /// The profile velocity of position control, with the sign of a continuous motion: counts/s.
    pub fn profile_velocity(self) -> Option<i64> {
        let velocity = self.profile().filter(|_| self.mode() == OperatingMode::Position)?.velocity;
        let is_backward = matches!(self, Self::Continuous(Direction::Backward, _));
        Some(if is_backward { -i64::from(velocity) } else { velocity.into() })
    }

    /// The way that it has before it from here, if it ends by itself: counts.
    pub fn way(self, here: i32) -> Option<i64> {
        match self {
            Self::To(target, _) => Some(i64::from(target) - i64::from(here)),
            Self::By(distance, _) => Some(distance.into()),
            _ => None,
        }
    }

    /// Returns `true` if it has a target, which was compared with the limits of the axis beforehand.
    pub const fn has_target(self) -> bool {
        !matches!(self, Self::Continuous(..) | Self::Velocity(..) | Self::Torque { .. })
    }

    /// What stops it; `None` for a joint that is held.
    pub const fn stop(self) -> Option<Stop> {
        match self {
            Self::Hold => None,
            Self::Velocity(..) => Some(Stop::Velocity),
            Self::Torque { .. } => Some(Stop::Torque),
            Self::ReciprocatingTo { .. } => Some(Stop::Reciprocation),
            _ => Some(Stop::Move),
        }
    }
}
