//! What goes wrong with a module on purpose.

use super::{BATTERY_FAULT, CommandedModule, Power};
use crate::defect::{Defect, Unsupported};
use crate::drive::DriveFault;

impl CommandedModule {
    /// Makes it detect a fault.
    pub fn inject_fault(&mut self, fault: DriveFault) {
        self.has_battery_alarm |= fault == DriveFault::MultiTurnBattery;
        self.fail(match fault {
            DriveFault::OverCurrent => 0x2310,
            DriveFault::OverVoltage => 0x3210,
            DriveFault::UnderVoltage => 0x3220,
            DriveFault::OverTemperature => 0x4310,
            DriveFault::Encoder => 0x7305,
            DriveFault::MultiTurnBattery => BATTERY_FAULT,
            DriveFault::BlockedRotor => 0x7121,
            DriveFault::Stall => 0x8400,
        });
    }

    /// Makes something wrong with it, or mends that.
    ///
    /// # Errors
    /// It has no process data and no emergency messages that could be wrong.
    pub fn inject_defect(&mut self, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        match defect {
            Defect::BlockedJoint => self.defects.is_blocked = is_present,
            Defect::StuckBrake => self.defects.is_brake_stuck = is_present,
            Defect::SilentSdoServer => self.defects.is_silent = is_present,
            Defect::Alarm { code } => self.fail(code),
            Defect::TorqueOff => self.power = Power::Off,
            Defect::EncoderJump { distance } => {
                let counts = (distance * self.parameters.encoder.counts_per_unit).round() as i32;
                self.counts_offset = self.counts_offset.wrapping_add(counts);
            }
            Defect::OtherObjectMapped
            | Defect::ShortFeedback
            | Defect::Statusword { .. }
            | Defect::Disobedience(_)
            | Defect::OperationModeDisplay { .. }
            | Defect::Emergency { .. } => {
                let reason = "an eRob that commands move has no process data and no emergency messages";
                return Err(Unsupported { defect, reason });
            }
        }
        Ok(())
    }
}
