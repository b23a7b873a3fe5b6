//! What the objects of the module mean, where it is not as in every CANopen device.

use takt_rt::Nanoseconds;
use takt_wire::canopen::object::ObjectAddress;

use super::ErobJoint;
use crate::canopen_node::{CanopenDevice, CanopenNode, TakesField, ValueSource};
use crate::drive::DriveFault;
use crate::erob::objects::at;
use crate::errors::DeviceError;
use crate::feedback_defects::ShownObjects;
use crate::sdo_reply::AbortCode;

/// Counts of the motor encoder for one of the output encoder.
const MOTOR_ENCODER_RATIO: f64 = 100.0;

/// Checks the range of an entry. The module has one abort code for every wrong value.
fn is_in_range(place: usize, number: i64) -> bool {
    match place {
        at::ERROR_BEHAVIOUR => number <= 2,
        at::OPERATION_MODE => (0..=10).contains(&number),
        at::TORQUE_OFFSET => (-3000..=3000).contains(&number),
        _ => true,
    }
}

impl CanopenDevice for ErobJoint {
    /// It takes SYNC of any length.
    const CHECKS_SYNC_LENGTH: bool = false;

    fn canopen(&mut self) -> &mut CanopenNode {
        &mut self.canopen
    }

    /// An enabled drive keeps its mode.
    fn begin_rpdo(&mut self) -> TakesField {
        self.target_before = self.canopen.dictionary.number(at::TARGET_POSITION);
        if self.device.state().has_torque() {
            |place, number| place != at::OPERATION_MODE && is_in_range(place, number)
        } else {
            is_in_range
        }
    }

    fn take_values(&mut self, now_ns: Nanoseconds, source: ValueSource) {
        self.follow_mode();
        self.evaluate(now_ns);
        let target = self.canopen.dictionary.number(at::TARGET_POSITION);
        if source == ValueSource::Sync || target != self.target_before {
            self.motion.latch(&self.canopen.dictionary);
        }
    }

    fn is_faulted(&self) -> bool {
        self.device.state().is_faulted()
    }

    fn measure(&mut self) {
        let actual = self.actual;
        let per_mille = 1000.0 * self.torque / self.parameters.rated_torque;
        let motor = (self.joint.position() * self.parameters.encoder.counts_per_unit * MOTOR_ENCODER_RATIO)
            .round_ties_even();
        let difference = self.motion.position() - actual.position;
        let statusword = self.statusword();
        let dictionary = &mut self.canopen.dictionary;
        dictionary.set(at::POSITION, actual.position as i64);
        dictionary.set_real(at::VELOCITY, actual.velocity);
        dictionary.set_real(at::TORQUE, per_mille);
        dictionary.set_real(at::CURRENT, per_mille);
        dictionary.set_real(at::TORQUE_ESTIMATE, 1000.0 * self.torque);
        dictionary.set(at::MOTOR_ENCODER, motor as i64);
        dictionary.set_real(at::POSITION_DEMAND, self.motion.position());
        dictionary.set_real(at::VELOCITY_DEMAND, self.motion.velocity());
        dictionary.set_real(at::TORQUE_DEMAND, per_mille);
        dictionary.set_real(at::FOLLOWING_ERROR, difference);
        dictionary.set(at::STATUSWORD, statusword.into());
    }

    /// The motor encoder takes the place of the position.
    fn shown(&self) -> ShownObjects {
        ShownObjects {
            statusword: Some(at::STATUSWORD),
            mode_display: Some(at::OPERATION_MODE_DISPLAY),
            position: Some(at::POSITION),
            instead_of_position: Some(at::MOTOR_ENCODER),
        }
    }

    fn started(&mut self, _: Nanoseconds) {
        self.device.started();
        if self.has_battery_fault {
            self.fail(DeviceError::Fault(DriveFault::MultiTurnBattery));
        }
    }

    fn restart(&mut self, now_ns: Nanoseconds) {
        self.canopen.restart(now_ns);
        if !self.parameters.has_battery {
            self.lose_turns();
        }
        self.device = self.device.restarted();
        self.servo.reset();
        self.torque = 0.0;
        self.coming_mode = None;
    }

    fn lose_master(&mut self) {
        self.fail(DeviceError::MasterLost);
    }

    fn check_write(&self, place: usize) -> Result<(), AbortCode> {
        let is_kept = place == at::OPERATION_MODE && self.device.state().has_torque();
        if is_kept { Err(AbortCode::DeviceState) } else { Ok(()) }
    }

    fn check_value(&self, address: ObjectAddress, place: usize, value: i64) -> Result<(), AbortCode> {
        // It has no PDOs on remote request only.
        let is_remote = matches!(address.index, 0x1800..=0x1803) && address.subindex == 2;
        let is_wrong = is_remote && matches!(value, 252 | 253) || !is_in_range(place, value);
        if is_wrong { Err(AbortCode::Value) } else { Ok(()) }
    }

    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds) {
        match address.index {
            0x2242 if self.canopen.dictionary.number(at::BATTERY_RESET) == 1 => {
                self.has_battery_fault = false;
                self.lose_turns();
            }
            0x6040 => self.evaluate(now_ns),
            0x6060 => self.follow_mode(),
            0x607A => self.motion.latch(&self.canopen.dictionary),
            _ => {}
        }
    }
}
