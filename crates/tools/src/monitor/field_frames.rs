//! Drives that are spoken to by frames of bit fields, in words. Descriptions say which fields there are.

use takt_rt::{CommandValue, FieldDriveParameters, Frame, FrameKind, OwnFrame, ReplyValue, ReplyValues};
use takt_wire::bit_fields::{DescribedLifeCycle, FieldDevice};
use takt_wire::printable::printable;

use super::decoded::{DecodedValue, Service};
use takt::config::{Axis, Quantity, Travel};
use takt::family;

/// A drive of bit fields.
pub struct FieldMember {
    parameters: FieldDriveParameters,
    travel: Travel,
    /// Frames that are always the same, with their names.
    fixed: Vec<(&'static str, OwnFrame)>,
    errors: Vec<(u16, String)>,
    is_relative: bool,
}

/// What a frame of such a drive means.
pub struct FieldMeaning {
    /// Command or reply.
    pub service: Service,
    /// In words.
    pub words: String,
    /// The values.
    pub values: Vec<DecodedValue>,
    /// True if the drive has torque.
    pub shows_torque: Option<bool>,
}

impl FieldMember {
    /// The drive of an axis; `None` for one that is spoken to in another way.
    pub fn of(axis: &Axis) -> Option<Self> {
        let parameters = family::of(&axis.drive).field_drive(axis)?;
        let device: &FieldDevice = axis.drive.description()?;
        let mut fixed: Vec<(&'static str, OwnFrame)> = vec![];
        if let DescribedLifeCycle::ByFrames(frames) = &device.description.life_cycle {
            fixed
                .extend(frames.all().map(|(name, frame)| (life_words(name), device.fixed(frame, axis.node))));
        }
        fixed.extend(device.setup(axis.node).into_iter().map(|frame| ("set-up", frame)));
        Some(Self {
            is_relative: parameters.position_reference == takt_rt::PositionReference::Present,
            parameters,
            travel: axis.travel,
            fixed,
            errors: device.description.errors.clone(),
        })
    }

    /// What a frame means; `None` if it is not between this drive and its master.
    pub fn decode(&self, frame: &Frame) -> Option<FieldMeaning> {
        if frame.kind() == FrameKind::Remote {
            return None;
        }
        let is_fixed = |own: &OwnFrame| own.id == frame.id() && own.payload == frame.payload();
        if let Some((name, _)) = self.fixed.iter().find(|(_, own)| is_fixed(own)) {
            return Some(FieldMeaning {
                service: Service::Command,
                words: (*name).to_owned(),
                values: vec![],
                shows_torque: None,
            });
        }
        self.command(frame).or_else(|| self.reply(frame))
    }

    fn command(&self, frame: &Frame) -> Option<FieldMeaning> {
        let command = &self.parameters.command;
        let values = Some(command).filter(|command| command.id() == frame.id())?.values(frame).ok()?;
        let carried = COMMANDS.into_iter().filter(|(value, ..)| command.carries(*value));
        let values: Vec<DecodedValue> = carried
            .map(|(value, name, unit)| {
                let name = if value == CommandValue::Position && self.is_relative {
                    "position, relative"
                } else {
                    name
                };
                self.value(name, unit, values.get(value))
            })
            .collect();
        Some(FieldMeaning { service: Service::Command, words: words(&values), values, shows_torque: None })
    }

    fn reply(&self, frame: &Frame) -> Option<FieldMeaning> {
        let reply = Some(&self.parameters.reply).filter(|reply| reply.id() == frame.id())?;
        if reply.sender().is_some_and(|sender| !sender.has_sent(frame.payload())) {
            return None;
        }
        let mut received = ReplyValues::default();
        if let Err(error) = reply.receive(frame, &mut received) {
            let words = error.to_string();
            return Some(FieldMeaning { service: Service::Reply, words, values: vec![], shows_torque: None });
        }
        let carried = REPLIES.into_iter().filter(|(value, ..)| reply.carries(*value));
        let values: Vec<DecodedValue> = carried
            .map(|(value, name, unit)| {
                let mut decoded = self.value(name, unit, received.get(value));
                if value == ReplyValue::Error {
                    decoded.text = self.error(received.get(value));
                }
                decoded
            })
            .collect();
        let shows_torque = reply.carries(ReplyValue::Run).then(|| received.get(ReplyValue::Run) != 0.0);
        Some(FieldMeaning { service: Service::Reply, words: words(&values), values, shows_torque })
    }

    fn error(&self, code: f64) -> String {
        let known = self.errors.iter().find(|(known, _)| f64::from(*known) == code);
        match known {
            _ if code == 0.0 => "none".to_owned(),
            Some((_, words)) => format!("{code} ({})", printable(words)),
            None => code.to_string(),
        }
    }

    fn value(&self, name: &str, unit: FieldQuantity, value: f64) -> DecodedValue {
        let quantity = match (unit, self.travel) {
            (FieldQuantity::Position, Travel::Rotary) => Some(Quantity::ANGLE),
            (FieldQuantity::Position, Travel::Linear { .. }) => Some(Quantity::LENGTH),
            (FieldQuantity::Velocity, Travel::Rotary) => Some(Quantity::ANGULAR_VELOCITY),
            (FieldQuantity::Velocity, Travel::Linear { .. }) => Some(Quantity::VELOCITY),
            (FieldQuantity::Effort, Travel::Rotary) => Some(Quantity::TORQUE),
            (FieldQuantity::Effort, Travel::Linear { .. }) => Some(Quantity::FORCE),
            (FieldQuantity::Temperature | FieldQuantity::Number | FieldQuantity::Code, _) => None,
        };
        let text = match (quantity, unit) {
            (Some(quantity), _) => quantity.show(value),
            (None, FieldQuantity::Temperature) => format!("{value:.1} °C"),
            (None, _) => format!("{}", (value * 1e6).round() / 1e6),
        };
        let is_code = unit == FieldQuantity::Code;
        DecodedValue {
            name: name.to_owned(),
            object: None,
            raw: is_code.then_some(value as i64),
            value: (!is_code).then_some(value),
            text,
        }
    }
}

fn words(values: &[DecodedValue]) -> String {
    super::process_data::words(values)
}

/// A frame of a life cycle in words.
fn life_words(name: &str) -> &'static str {
    match name {
        "start" => "start",
        "stop" => "stop",
        "zero" => "the present position becomes zero",
        "clear" => "clear faults",
        "torque" => "torque mode",
        "velocity" => "velocity mode",
        _ => "position mode",
    }
}

/// What kind of number a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FieldQuantity {
    Position,
    Velocity,
    Effort,
    Temperature,
    Number,
    Code,
}

const COMMANDS: [(CommandValue, &str, FieldQuantity); 8] = [
    (CommandValue::Position, "position", FieldQuantity::Position),
    (CommandValue::Velocity, "velocity", FieldQuantity::Velocity),
    (CommandValue::Torque, "torque", FieldQuantity::Effort),
    (CommandValue::Stiffness, "stiffness", FieldQuantity::Number),
    (CommandValue::Damping, "damping", FieldQuantity::Number),
    (CommandValue::Mode, "mode", FieldQuantity::Code),
    (CommandValue::Run, "run", FieldQuantity::Code),
    (CommandValue::Zero, "set zero", FieldQuantity::Code),
];

const REPLIES: [(ReplyValue, &str, FieldQuantity); 7] = [
    (ReplyValue::Position, "position", FieldQuantity::Position),
    (ReplyValue::Velocity, "velocity", FieldQuantity::Velocity),
    (ReplyValue::Torque, "torque", FieldQuantity::Effort),
    (ReplyValue::Temperature, "temperature", FieldQuantity::Temperature),
    (ReplyValue::Mode, "mode", FieldQuantity::Code),
    (ReplyValue::Run, "run", FieldQuantity::Code),
    (ReplyValue::Error, "error", FieldQuantity::Code),
];
