//! What a procedure expects of a number that it reads from a drive.

use takt_rt::{DriveState, OperationMode};
use takt_wire::canopen::object::Object;

use super::axis_units::SiUnit;

/// The condition that a number must meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Check {
    /// Any number.
    Any,
    /// This number.
    Equals(i64),
    /// This number in these bits.
    Masked {
        /// The number.
        value: i64,
        /// The bits.
        mask: u32,
    },
    /// A device type (object 1000) with this profile number in its low 16 bits.
    Profile(u16),
    /// Supported modes (object 6502) with the bit of this mode.
    Supports(OperationMode),
    /// A statusword of a state without torque.
    NoTorque,
    /// A velocity of at most this many drive units in either direction.
    Standstill(i64),
    /// At most this.
    AtMost(i64),
    /// At least this.
    AtLeast(i64),
    /// A bound of at least this, or 0 for none.
    BoundAbove(i64),
    /// More than zero.
    Positive,
}

impl Check {
    /// Returns `true` if `value` meets the condition.
    pub fn passes(self, value: i64) -> bool {
        match self {
            Self::Any => true,
            Self::Equals(wanted) => value == wanted,
            Self::Masked { value: wanted, mask } => (value ^ wanted) & i64::from(mask) == 0,
            Self::Profile(profile) => value & 0xFFFF == i64::from(profile),
            Self::Supports(mode) => value & i64::from(mode.supported_bit()) != 0,
            Self::NoTorque => !DriveState::decode(value as u16).has_torque(),
            Self::Standstill(limit) => value.abs() <= limit,
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
            Self::BoundAbove(limit) => value == 0 || value >= limit,
            Self::Positive => value > 0,
        }
    }

    /// A value that meets the condition, for a dry run without a drive.
    pub(super) const fn example(self) -> i64 {
        match self {
            Self::Any | Self::NoTorque | Self::Standstill(_) | Self::BoundAbove(_) => 0,
            Self::Equals(value) | Self::Masked { value, .. } | Self::AtMost(value) | Self::AtLeast(value) => {
                value
            }
            Self::Profile(profile) => profile as i64,
            Self::Supports(mode) => mode.supported_bit() as i64,
            Self::Positive => 1,
        }
    }

    /// The condition in words, for a value of `object`, also in SI units where its unit is known.
    pub fn words(self, object: &Object, unit: Option<SiUnit>) -> String {
        let show = |value: i64| unit.map_or_else(|| value.to_string(), |unit| unit.show(value));
        match self {
            Self::Any => "any value".into(),
            Self::Equals(value) => object.show(value),
            Self::Masked { value, mask } => format!("{} in the bits 0x{mask:08X}", object.show(value)),
            Self::Profile(profile) => format!("a device of profile CiA {profile}"),
            Self::Supports(mode) => {
                format!("bit {} ({})", mode.supported_bit().trailing_zeros(), mode.name())
            }
            Self::NoTorque => "a state without torque".into(),
            Self::Standstill(limit) => format!("standstill (at most {limit})"),
            Self::AtMost(limit) => format!("at most {}", show(limit)),
            Self::AtLeast(limit) => format!("at least {}", show(limit)),
            Self::BoundAbove(limit) => format!("at least {}, or 0 for no bound", show(limit)),
            Self::Positive => "more than zero".into(),
        }
    }

    /// The meaning of a value that does not pass, beyond its number.
    pub fn meaning(self, value: i64) -> Option<String> {
        match self {
            Self::NoTorque => Some(format!("{:?}", DriveState::decode(value as u16))),
            Self::Supports(_) => {
                let supported =
                    OperationMode::ALL.into_iter().filter(|mode| Self::Supports(*mode).passes(value));
                let names: Vec<&str> = supported.map(OperationMode::name).collect();
                Some(if names.is_empty() { "no mode at all".into() } else { names.join(", ") })
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_every_condition_meets_it() {
        for check in [
            Check::Any,
            Check::Equals(-5),
            Check::Masked { value: 0x8000_0202, mask: 0x8000_07FF },
            Check::Profile(402),
            Check::Supports(OperationMode::CyclicSynchronousPosition),
            Check::NoTorque,
            Check::Standstill(0),
            Check::AtMost(-3),
            Check::AtLeast(3),
            Check::BoundAbove(3),
            Check::Positive,
        ] {
            assert!(check.passes(check.example()), "{check:?}");
        }
    }
}
