//! What an axis does when the controller is gone, by `kill -9` or by a broken cable, until its drive acts.

use serde::Serialize;
use takt::config::{Axis, Config, Control, PositionUnit};
use takt::family::{self, Watchdog};

/// What an axis does without the controller.
#[derive(Clone, PartialEq, Serialize)]
#[serde(tag = "does", rename_all = "snake_case")]
pub enum Unattended {
    /// It stops at its last set-point. What is left is the distance from it.
    HoldsLastSetPoint {
        /// rad (m)
        travel: f64,
    },
    /// It ends its move by itself, and nothing stops it before.
    EndsItsMove,
    /// It goes on, along its move at most, until the drive misses the heartbeat or the requests of node guarding, and then brakes.
    GoesOn {
        /// The time until the drive misses them.
        timeout_ns: u64,
        /// The time until the joint is at rest.
        time_ns: u64,
        /// The travel until the joint is at rest, from full speed: rad (m).
        travel: f64,
    },
    /// It goes on until a watchdog of its own acts, whose time takt does not know.
    UntilItsWatchdog,
    /// It goes on, and nothing stops it.
    GoesOnForEver {
        /// Why.
        because: &'static str,
    },
}

impl Unattended {
    /// The worst case: in the worst of its modes, at full speed (with a torque: in full acceleration), with the last heartbeat just
    /// sent, and a drive that brakes with the deceleration limit.
    pub fn of(axis: &Axis, config: &Config) -> Self {
        let worst = axis.other_modes.iter().map(|control| Self::in_mode(control, axis, config));
        worst.fold(Self::in_mode(&axis.control, axis, config), |worst, other| {
            if other.travel() > worst.travel() { other } else { worst }
        })
    }

    /// How far it goes.
    const fn travel(&self) -> f64 {
        match self {
            Self::EndsItsMove => 0.0,
            Self::HoldsLastSetPoint { travel } | Self::GoesOn { travel, .. } => *travel,
            Self::UntilItsWatchdog => f64::MAX,
            Self::GoesOnForEver { .. } => f64::INFINITY,
        }
    }

    fn in_mode(control: &Control, axis: &Axis, config: &Config) -> Self {
        let limits = &axis.limits;
        // A drive that is spoken to beside the cycle is told velocities, whatever the mode of its axis.
        let off_cycle = family::of(&axis.drive).off_cycle_budget(axis, config);
        match *control {
            Control::Position | Control::Interpolated if off_cycle.is_none() => {
                let cycle_s = config.bus_cycle(axis.bus).period_ns as f64 / 1e9;
                Self::HoldsLastSetPoint { travel: axis.following_error.limit + limits.velocity * cycle_s }
            }
            control => {
                // A drive that plans its moves itself needs no watchdog to come to rest.
                let ends_its_move = control == Control::ProfilePosition && off_cycle.is_none();
                let timeout_ns = match family::stops_by_itself_after(axis, config) {
                    Ok(Watchdog { timeout_ns: Some(timeout_ns), .. }) => timeout_ns,
                    _ if ends_its_move => return Self::EndsItsMove,
                    Ok(_) => return Self::UntilItsWatchdog,
                    Err(unwatched) => return Self::GoesOnForEver { because: unwatched.words() },
                };
                let timeout_s = timeout_ns as f64 / 1e9;
                // A torque goes on to accelerate the joint; a speed is kept.
                let acceleration = match control {
                    Control::Torque { .. } | Control::ProfileTorque => limits.acceleration,
                    _ => 0.0,
                };
                let speed = limits.velocity + acceleration * timeout_s;
                let braking_s = speed / limits.deceleration;
                let until_braking = 0.5 * (limits.velocity + speed) * timeout_s;
                Self::GoesOn {
                    timeout_ns,
                    time_ns: ((timeout_s + braking_s) * 1e9).round() as u64,
                    travel: until_braking + 0.5 * speed * braking_s,
                }
            }
        }
    }

    /// It in words.
    pub fn words(&self, unit: PositionUnit) -> String {
        let distance = |travel: f64| match unit {
            PositionUnit::Radian => format!("{travel:.4} rad ({:.1} deg)", travel.to_degrees()),
            PositionUnit::Metre => format!("{travel:.4} m"),
            _ => format!("{:.1} {}", unit.from_si(travel), unit.symbol()),
        };
        let milliseconds = |ns: u64| ns.div_ceil(1_000_000);
        match self {
            Self::HoldsLastSetPoint { travel } => {
                format!(
                    "holds its last set-point, {} away at most (following error and one cycle)",
                    distance(*travel)
                )
            }
            Self::EndsItsMove => "ends its move by itself, at its target".to_owned(),
            Self::GoesOn { timeout_ns, time_ns, travel } => format!(
                "goes on for {} ms, then brakes: at rest after {} ms and {} at most",
                milliseconds(*timeout_ns),
                milliseconds(*time_ns),
                distance(*travel)
            ),
            Self::UntilItsWatchdog => {
                "goes on until its own watchdog acts, after a time that is set in it".to_owned()
            }
            Self::GoesOnForEver { because } => format!("goes on FOR EVER: {because}"),
        }
    }
}
