//! What the configuration of an axis says of its drive beside the description of its make.

/// A number that differs from drive to drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Setting {
    /// The position at the end of its range: rad.
    PositionFullScale,
    /// The velocity at the end of its range: rad/s.
    VelocityFullScale,
    /// The torque at the end of its range: N·m.
    TorqueFullScale,
    /// The current at the end of its range: A.
    CurrentFullScale,
    /// N·m/A at the shaft whose position the drive reports.
    TorqueConstant,
    /// Pole pairs of the motor.
    PolePairs,
    /// The gain of the drive's position loop, in the unit of its field.
    PositionGain,
    /// The damping of the drive's position loop, in the unit of its field.
    PositionDamping,
    /// A factor for the proportional gain of the drive's velocity loop.
    VelocityLoopKp,
    /// A factor for the integral gain of the drive's velocity loop.
    VelocityLoopKi,
    /// A factor for the proportional gain of the drive's current loop.
    CurrentLoopKp,
    /// A factor for the integral gain of the drive's current loop.
    CurrentLoopKi,
}

impl Setting {
    /// How many there are.
    const COUNT: usize = 12;

    /// All of them, with their keys in configurations and descriptions.
    pub const ALL: [(&'static str, Self); Self::COUNT] = [
        ("position_full_scale", Self::PositionFullScale),
        ("velocity_full_scale", Self::VelocityFullScale),
        ("torque_full_scale", Self::TorqueFullScale),
        ("current_full_scale", Self::CurrentFullScale),
        ("torque_constant", Self::TorqueConstant),
        ("pole_pairs", Self::PolePairs),
        ("kp", Self::PositionGain),
        ("kd", Self::PositionDamping),
        ("velocity_loop_kp", Self::VelocityLoopKp),
        ("velocity_loop_ki", Self::VelocityLoopKi),
        ("current_loop_kp", Self::CurrentLoopKp),
        ("current_loop_ki", Self::CurrentLoopKi),
    ];

    /// Its key.
    pub const fn key(self) -> &'static str {
        Self::ALL[self as usize].0
    }

    /// What the key says, for a configuration that lacks it.
    pub const fn says(self) -> &'static str {
        match self {
            Self::PositionFullScale => {
                "the position at the end of the range of its field, by the data sheet: position_full_scale = \"1 turn\""
            }
            Self::VelocityFullScale => {
                "the velocity at the end of the range of its field, by the data sheet: velocity_full_scale = \"58.6 rad/s\""
            }
            Self::TorqueFullScale => {
                "the torque at the end of the range of its field, by the data sheet: torque_full_scale = \"10 Nm\""
            }
            Self::CurrentFullScale => {
                "the current at the end of the range of its field, in A, by the data sheet: current_full_scale = 10"
            }
            Self::TorqueConstant => "the torque constant in N·m/A, by the data sheet: torque_constant = 0.23",
            Self::PolePairs => "the pole pairs of the motor, by the data sheet: pole_pairs = 21",
            Self::PositionGain => "the gain of the drive's position loop: kp = 200",
            Self::PositionDamping => "the damping of the drive's position loop: kd = 20",
            Self::VelocityLoopKp | Self::VelocityLoopKi | Self::CurrentLoopKp | Self::CurrentLoopKi => {
                "a factor for a gain of the drive's loops"
            }
        }
    }
}

/// What the configuration says of one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// The identifier by which it replies.
    pub master_id: Option<u16>,
    /// True if its CAN FD frames switch the bit rate.
    pub has_bit_rate_switch: bool,
    numbers: [Option<f64>; Setting::COUNT],
}

impl Settings {
    /// A number, if it is given.
    pub fn get(&self, setting: Setting) -> Option<f64> {
        self.numbers.get(setting as usize).copied().flatten()
    }

    /// Gives a number.
    pub fn set(&mut self, setting: Setting, number: f64) {
        if let Some(place) = self.numbers.get_mut(setting as usize) {
            *place = Some(number);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_has_its_own_place_and_key() {
        for (place, (key, setting)) in Setting::ALL.into_iter().enumerate() {
            assert_eq!((setting as usize, setting.key()), (place, key));
        }
    }
}
