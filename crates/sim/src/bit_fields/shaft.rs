//! Commands and replies in SI units at the shaft of the drive.

use std::f64::consts::TAU;

use takt_rt::{CommandValue, Frame, FrameFormat, Id, ReplyValue};
use takt_wire::bit_fields::{
    DescribedScale, FieldDescription, FieldDevice, FieldUnit, FrameDescription, Setting,
};

use super::bits;

/// A command as the drive takes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// rad
    pub position: f64,
    /// rad/s
    pub velocity: f64,
    /// N·m
    pub torque: f64,
    /// N·m/rad, or a code.
    pub stiffness: f64,
    /// N·m·s/rad, or a code.
    pub damping: f64,
    /// The code of a mode.
    pub mode: u8,
    /// True if the drive is to have torque.
    pub run: bool,
    /// True if the present position becomes zero.
    pub zero: bool,
}

/// What the drive replies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// rad
    pub position: f64,
    /// rad/s
    pub velocity: f64,
    /// N·m
    pub torque: f64,
    /// °C
    pub temperature: f64,
    /// The code of the mode.
    pub mode: u8,
    /// True if it has torque.
    pub run: bool,
    /// Its error.
    pub error: u16,
    /// The code of its state.
    pub state: u16,
    /// Its motor ID.
    pub motor_id: u8,
}

/// One unit of a field in SI units at the shaft.
fn in_si(unit: FieldUnit, device: &FieldDevice) -> f64 {
    match unit {
        FieldUnit::Turns | FieldUnit::TurnsPerSecond => TAU,
        FieldUnit::ElectricalHertz => TAU / device.settings.get(Setting::PolePairs).unwrap_or(1.0),
        FieldUnit::Amperes => device.settings.get(Setting::TorqueConstant).unwrap_or(1.0),
        FieldUnit::Radians
        | FieldUnit::RadiansPerSecond
        | FieldUnit::NewtonMetres
        | FieldUnit::NewtonMetresPerRadian
        | FieldUnit::NewtonMetreSecondsPerRadian
        | FieldUnit::DegreesCelsius
        | FieldUnit::Codes => 1.0,
    }
}

fn value_of(code: f64, scale: DescribedScale, device: &FieldDevice) -> f64 {
    (code - scale.zero) / scale.codes * device.amount(scale.are) * in_si(scale.unit, device)
}

fn code_of(value: f64, scale: DescribedScale, device: &FieldDevice) -> f64 {
    value / in_si(scale.unit, device) / device.amount(scale.are) * scale.codes + scale.zero
}

impl Command {
    /// Reads a payload.
    pub fn read(device: &FieldDevice, payload: &[u8]) -> Self {
        let frame = &device.description.command;
        let mut command = Self::default();
        for field in &frame.fields {
            let value = value_of(bits::read(field, frame.order, payload), field.scale, device);
            match field.value {
                CommandValue::Position => command.position = value,
                CommandValue::Velocity => command.velocity = value,
                CommandValue::Torque => command.torque = value,
                CommandValue::Stiffness => command.stiffness = value,
                CommandValue::Damping => command.damping = value,
                CommandValue::Mode => command.mode = value as u8,
                CommandValue::Run => command.run = value == 1.0,
                CommandValue::Zero => command.zero = value == 1.0,
                CommandValue::Nothing => {}
            }
        }
        command
    }
}

impl Reply {
    fn get(&self, value: ReplyValue) -> f64 {
        match value {
            ReplyValue::Position => self.position,
            ReplyValue::Velocity => self.velocity,
            ReplyValue::Torque => self.torque,
            ReplyValue::Temperature => self.temperature,
            ReplyValue::Mode => self.mode.into(),
            ReplyValue::Run => f64::from(u8::from(self.run)),
            ReplyValue::Error => self.error.into(),
            ReplyValue::Sender => self.motor_id.into(),
            ReplyValue::State => self.state.into(),
            ReplyValue::Ignored => 0.0,
        }
    }

    /// The frame.
    pub fn frame(&self, device: &FieldDevice, id: Id) -> Option<Frame> {
        let FrameDescription { format, bytes, order, fields, .. } = &device.description.reply;
        let mut payload = [0; 16];
        let payload = payload.get_mut(..*bytes)?;
        for field in fields {
            let code = match field.value {
                // A narrow field has the lowest bits of the motor ID.
                ReplyValue::Sender => f64::from(self.motor_id) % f64::from(field.width()).exp2(),
                value => code_of(self.get(value), field.scale, device),
            };
            let wrapped = wrapped(code, field, device.description.wraps);
            bits::write(field, *order, wrapped, payload);
        }
        framed(id, device.format(*format), payload)
    }
}

/// A frame of this kind.
pub(super) fn framed(id: Id, format: FrameFormat, payload: &[u8]) -> Option<Frame> {
    match format {
        FrameFormat::Classic => Frame::data(id, payload).ok(),
        FrameFormat::Fd => Frame::fd(id, payload, false).ok(),
        FrameFormat::FdBitRateSwitch => Frame::fd(id, payload, true).ok(),
    }
}

/// A position that wraps around goes on from the other end of its range.
fn wrapped(code: f64, field: &FieldDescription<ReplyValue>, wraps: bool) -> f64 {
    if !wraps || field.value != ReplyValue::Position {
        return code;
    }
    let (lowest, highest) = field.code_range();
    (code.round() - lowest).rem_euclid(highest - lowest + 1.0) + lowest
}
