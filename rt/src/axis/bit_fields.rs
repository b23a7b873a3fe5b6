//! An axis whose drive is spoken to by bit fields.
//!
//! Such a drive is led as every other one, in the states of CiA 402: the controlword becomes what is wanted of the life of the drive,
//! and that life becomes a statusword ([`FieldDrive::drive_state`](crate::FieldDrive::drive_state)).
//!
//! | controlword | what is wanted |
//! | --- | --- |
//! | switch on, enable operation | it runs, in the mode that is commanded |
//! | fault reset | faults are cleared |
//! | any other | it stops: it has no torque |
//!
//! Its numbers are those of the joint in SI units; the layouts of its frames have all scales in them.

use super::exchange::Exchange;
use super::late_reply::SetPointSkip;
use super::mode::Mode;
use super::{Axis, ControlLaw};
use crate::bit_fields::{
    CommandValue, FieldDriveParameters, FieldGains, FieldMode, FieldTargets, LifeWish, ReplyError,
    ReplyValue, RunningMode,
};
use crate::cia402::{Command, OperationMode, controlword};
use crate::control::{LoopInput, TorqueDemand};
use crate::frame::Frame;
use crate::guard::AxisLimits;
use crate::pdo::FeedbackSlot;
use crate::units::inward;

impl Axis {
    /// Takes a reply of the drive. One of another kind has none.
    #[inline(never)]
    pub(super) fn receive_fields(&mut self, frame: &Frame) -> Result<(), ReplyError> {
        let Exchange::BitFields(by) = &self.parameters.exchange else { return Ok(()) };
        self.field_drive.receive(by, frame)?;
        let (drive, scale) = (&self.field_drive, &self.parameters.scale);
        let reported = |value| drive.reported(by, value).unwrap_or(0.0);
        let mode = match drive.mode(by) {
            RunningMode::Known(mode) => operation_mode(mode) as i32,
            RunningMode::Unknown => 0,
            RunningMode::None => self.mode_set().into(),
        };
        self.feedback.take(FeedbackSlot::Statusword, drive.drive_state(by).statusword_bits().into());
        self.feedback.take(FeedbackSlot::OperationModeDisplay, mode);
        self.feedback
            .take(FeedbackSlot::Position, scale.position_to_counts(drive.position(by).unwrap_or(0.0)));
        self.feedback.take(FeedbackSlot::Velocity, scale.velocity_to_drive(reported(ReplyValue::Velocity)));
        self.feedback.take(FeedbackSlot::Torque, scale.torque_to_per_mille(reported(ReplyValue::Torque)));
        self.feedback.take(FeedbackSlot::ErrorCode, reported(ReplyValue::Error) as i32);
        Ok(())
    }

    /// The frame of this cycle to a drive without PDOs.
    pub fn field_frame(&self) -> Option<&Frame> {
        self.field_frame.as_ref()
    }

    /// Makes that frame, which leads the drive where the controlword says.
    #[inline(never)]
    pub(super) fn command_fields(&mut self, word: u16, input: &LoopInput, torque: f64) {
        let Exchange::BitFields(by) = &self.parameters.exchange else { return };
        if self.set_point_skip == SetPointSkip::Now {
            self.field_frame = None;
            return;
        }
        let targets = self.field_targets(input, torque, by);
        let wish = wish(word, self.mode_set());
        self.field_frame = Some(self.field_drive.step(by, wish, &targets));
    }

    /// What the drive is to follow while it runs.
    fn field_targets(&self, input: &LoopInput, torque: f64, by: &FieldDriveParameters) -> FieldTargets {
        let limits = &self.parameters.limits;
        // A drive that takes another mode stands, and is to go on standing.
        let (law, velocity, torque) = match self.mode {
            Mode::Settled => (self.parameters.law, self.parameters.law.velocity(input, limits), torque),
            Mode::Changing { to: to @ ControlLaw::Torque { .. }, holding } => {
                let held = to.torque(input, &TorqueDemand::Law { torque: holding });
                (to, 0.0, held.clamp(-limits.torque, limits.torque))
            }
            Mode::Changing { to, .. } => (to, 0.0, 0.0),
        };
        let position = input.set.position;
        let (stiffness, damping) = match by.gains {
            FieldGains::Fixed { .. } => (0.0, 0.0),
            FieldGains::Commanded => law.gains(self.torque_loop.demand()),
        };
        // What the loop in the drive makes is not commanded a second time.
        let of_drive = stiffness * input.error.position + damping * input.error.velocity;
        let unit = |value| by.command.unit_of(value);
        let AxisLimits { position_min, position_max, velocity: fastest, torque: strongest, .. } = *limits;
        FieldTargets {
            position: inward(position, position_min, position_max, unit(CommandValue::Position)),
            velocity: inward(velocity, -fastest, fastest, unit(CommandValue::Velocity)),
            torque: inward(torque - of_drive, -strongest, strongest, unit(CommandValue::Torque)),
            stiffness,
            damping,
        }
    }

    /// The temperature (°C) that the drive reports, if it does.
    #[inline]
    pub fn temperature(&self) -> Option<f32> {
        if self.has_pdos() { None } else { self.temperature_beside_pdos() }
    }

    fn temperature_beside_pdos(&self) -> Option<f32> {
        match &self.parameters.exchange {
            Exchange::BitFields(by) => {
                let temperature = self.field_drive.reported(by, ReplyValue::Temperature);
                temperature.map(|temperature| temperature as f32)
            }
            Exchange::OffCycle { .. } => self.off_cycle_temperature,
            Exchange::Pdos(_) => None,
        }
    }
}

/// What a controlword asks of the life of a drive.
const fn wish(word: u16, mode: i8) -> LifeWish {
    if word & controlword::FAULT_RESET != 0 {
        return LifeWish::Clear;
    }
    match Command::decode(word) {
        Command::SwitchOn | Command::EnableOperation => LifeWish::Run(field_mode(mode)),
        Command::Shutdown | Command::DisableVoltage | Command::QuickStop => LifeWish::Stop,
    }
}

/// The mode of a drive without object 6060 for a mode of operation.
const fn field_mode(mode: i8) -> FieldMode {
    const VELOCITY: i8 = OperationMode::CyclicSynchronousVelocity as i8;
    const TORQUE: i8 = OperationMode::CyclicSynchronousTorque as i8;
    match mode {
        VELOCITY => FieldMode::Velocity,
        TORQUE => FieldMode::Torque,
        _ => FieldMode::Position,
    }
}

const fn operation_mode(mode: FieldMode) -> OperationMode {
    match mode {
        FieldMode::Position => OperationMode::CyclicSynchronousPosition,
        FieldMode::Velocity => OperationMode::CyclicSynchronousVelocity,
        FieldMode::Torque => OperationMode::CyclicSynchronousTorque,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bit_fields::{BitField, ByteOrder, CommandValues, FieldBits, FieldFrame, LinearScale, Number};
    use crate::frame::{FrameFormat, Id};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_set_point_within_a_limit_is_so_in_its_field(
            max in 0.5f64..12.0, near in 0.0f64..3.0, bits in 12u8..33, is_low: bool, is_reversed: bool,
        ) {
            let mut scale = LinearScale::centred(bits, 12.5);
            scale.codes_per_unit *= if is_reversed { -1.0 } else { 1.0 };
            let (value, number) = (CommandValue::Position, Number::Unsigned);
            let field = BitField { value, bits: FieldBits::of(0, bits), number, scale, codes: None };
            let format = FrameFormat::Classic;
            let command = FieldFrame::compile(Id::canopen(0, 1), format, 8, ByteOrder::BigEndian, &[field]).unwrap();
            let unit = command.unit_of(value).abs();
            let position = if is_low { near * unit - max } else { max - near * unit };
            let mut told = CommandValues::default();
            told.set(value, inward(position, -max, max, unit));
            let heard = command.values(&command.frame(&told)).unwrap().get(value);
            prop_assert!(heard.abs() <= max + 2e-6 * unit, "{} beyond {}", heard, max);
            prop_assert!((heard - position).abs() <= 1.000_01 * unit, "{} for {}", heard, position);
        }
    }
}
