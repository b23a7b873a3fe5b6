//! From a description to the frames of the cycle: values in SI units at the joint become the codes of the drive's fields.

use std::f64::consts::TAU;

use takt_rt::{
    BesideTarget, BitField, ByteOrder, CommandValue, FieldDriveParameters, FieldFrame, FieldGains,
    FieldValue, LayoutError, LifeCycle, LinearScale, MAX_SETUP_FRAMES, Number, OwnFrames, PositionReference,
    ReplyValue, SenderByte, SetUpAgain,
};
use takt_wire::bit_fields::{
    BesideTargetKind, DescribedLifeCycle, DescribedScale, FieldDescription, FieldDevice, FieldUnit,
    FrameDescription, Setting,
};

use crate::config::{Axis, Control};

/// How much faster than its velocity limit a drive may go that follows positions: it has to catch up with them.
const CATCHING_UP: f64 = 1.5;

/// What stands between the joint and the shaft whose position the drive reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// 1, or -1 where the drive counts the other way.
    pub direction: f64,
    /// Travel of the joint for one radian of the shaft: rad (m).
    pub lever: f64,
    /// The reported turns at which the joint is at zero.
    pub zero_turns: f64,
}

impl Transmission {
    /// The joint is the shaft.
    const DIRECT: Self = Self { direction: 1.0, lever: 1.0, zero_turns: 0.0 };

    /// Of an axis.
    pub fn of(axis: &Axis) -> Self {
        Self {
            direction: if axis.reversed { -1.0 } else { 1.0 },
            lever: axis.travel.per_turn() / (TAU * axis.gear_ratio),
            zero_turns: f64::from(axis.zero_counts) / axis.counts_per_turn,
        }
    }

    /// The same with the joint at zero where the shaft is.
    const fn without_zero(self) -> Self {
        Self { zero_turns: 0.0, ..self }
    }
}

/// A limit that becomes a whole code of its field which is not beyond it: the nearest one could be by half a code.
fn largest_within(limit: f64, code: f64) -> f64 {
    // A little less than half: a limit that is a whole number of codes is reached, whatever the last digits say.
    (limit - 0.499_999 * code).max(0.0)
}

/// What one SI unit at the joint is in the unit of a field.
fn per_joint_unit(device: &FieldDevice, unit: FieldUnit, by: Transmission) -> f64 {
    let Transmission { direction, lever, .. } = by;
    let setting = |setting| device.settings.get(setting).unwrap_or(1.0);
    match unit {
        FieldUnit::Radians | FieldUnit::RadiansPerSecond => direction / lever,
        FieldUnit::Turns | FieldUnit::TurnsPerSecond => direction / lever / TAU,
        FieldUnit::ElectricalHertz => direction / lever / TAU * setting(Setting::PolePairs),
        FieldUnit::NewtonMetres => direction * lever,
        FieldUnit::Amperes => direction * lever / setting(Setting::TorqueConstant),
        FieldUnit::NewtonMetresPerRadian | FieldUnit::NewtonMetreSecondsPerRadian => lever * lever,
        FieldUnit::DegreesCelsius | FieldUnit::Codes => 1.0,
    }
}

fn linear_scale(device: &FieldDevice, scale: DescribedScale, by: Transmission) -> LinearScale {
    let codes_per_unit = scale.codes / device.amount(scale.are);
    let zero = match scale.unit {
        FieldUnit::Turns => by.zero_turns,
        FieldUnit::Radians => by.zero_turns * TAU,
        _ => 0.0,
    };
    LinearScale {
        codes_per_unit: codes_per_unit * per_joint_unit(device, scale.unit, by),
        zero_code: scale.zero + codes_per_unit * zero,
    }
}

fn compiled<V: FieldValue>(
    device: &FieldDevice,
    frame: &FrameDescription<V>,
    motor: u8,
    by: Transmission,
) -> Result<FieldFrame<V>, LayoutError> {
    let fields: Vec<BitField<V>> = frame
        .fields
        .iter()
        .map(|field| {
            let FieldDescription { value, bits, number, scale, codes } = *field;
            BitField { value, bits, number, scale: linear_scale(device, scale, by), codes }
        })
        .collect();
    FieldFrame::compile(
        device.id(&frame.id, motor),
        device.format(frame.format),
        frame.bytes,
        frame.order,
        &fields,
    )
}

/// Whether the fields of the command fit its frame.
///
/// # Errors
/// What is wrong with a field.
pub fn check_command(device: &FieldDevice) -> Result<(), LayoutError> {
    compiled(device, &device.description.command, 1, Transmission::DIRECT).map(|_| ())
}

/// Whether the fields of the reply fit its frame.
///
/// # Errors
/// What is wrong with a field.
pub fn check_reply(device: &FieldDevice) -> Result<(), LayoutError> {
    compiled(device, &device.description.reply, 1, Transmission::DIRECT).map(|_| ())
}

/// What the cycle needs to speak to the drive of an axis.
///
/// # Errors
/// What is wrong with a field. A description that was read has none of that.
pub fn compile(device: &FieldDevice, axis: &Axis) -> Result<FieldDriveParameters, LayoutError> {
    let (description, by) = (&device.description, Transmission::of(axis));
    let to_drive = match description.position_reference {
        PositionReference::Zero => by,
        // A distance has no zero.
        PositionReference::Present => by.without_zero(),
    };
    let reply = compiled(device, &description.reply, axis.node, by)?;
    let reply = match description.states {
        Some(states) => reply.with_states(states),
        None => reply,
    };
    let command = compiled(device, &description.command, axis.node, to_drive)?;
    let torque_code = command.unit_of(CommandValue::Torque).abs();
    Ok(FieldDriveParameters {
        command,
        reply: match sender_byte(device, axis.node) {
            Some(sender) => reply.sent_by(sender),
            None => reply,
        },
        life_cycle: life_cycle(device, axis.node),
        position_reference: description.position_reference,
        beside_target: match description.beside_target {
            BesideTargetKind::FeedForward => BesideTarget::FeedForward,
            // A limit has no direction.
            BesideTargetKind::Limits => BesideTarget::Limits {
                velocity: by.direction * CATCHING_UP * axis.limits.velocity,
                torque: by.direction * largest_within(axis.limits.torque, torque_code),
            },
        },
        gains: gains(device, &axis.control),
        position_span: position_span(device, by),
        set_up_again: description.bytes_before_setup.map(|reply_bytes| SetUpAgain {
            reply_bytes,
            frames: device.setup(axis.node).into_iter().take(MAX_SETUP_FRAMES).collect(),
        }),
    })
}

/// The gains of the drive's own loop: a spring and a damper are those of each cycle where the axis is led by torques.
fn gains(device: &FieldDevice, control: &Control) -> FieldGains {
    let setting = |setting| device.settings.get(setting).unwrap_or(0.0);
    let (stiffness, damping) = (setting(Setting::PositionGain), setting(Setting::PositionDamping));
    match control {
        Control::Torque { .. } if device.has_impedance() => FieldGains::Commanded,
        // A velocity is followed by the damping alone.
        Control::Velocity { .. } if device.has_impedance() => FieldGains::Fixed { stiffness: 0.0, damping },
        _ => FieldGains::Fixed { stiffness, damping },
    }
}

/// The byte of a reply that has the motor ID, or its lowest bits, if one has.
fn sender_byte(device: &FieldDevice, motor: u8) -> Option<SenderByte> {
    let reply = &device.description.reply;
    let bits = reply.field(ReplyValue::Sender)?.bits;
    let (first, width) = (bits.high.at % 8, u16::from(bits.high.width));
    // A field that reaches into another byte is not looked at.
    let beyond = 8u16.checked_sub(first + width).filter(|_| bits.low.is_none())?;
    let shift = match reply.order {
        ByteOrder::BigEndian => beyond,
        ByteOrder::LittleEndian => first,
    };
    let mask = (u8::MAX >> (8 - width)) << shift;
    let at = u8::try_from(bits.high.at / 8).ok()?;
    Some(SenderByte { at, mask, value: motor << shift & mask })
}

/// The range of the joint in which the reported position wraps around.
fn position_span(device: &FieldDevice, by: Transmission) -> Option<f64> {
    let field = device.description.reply.field(ReplyValue::Position).filter(|_| device.description.wraps)?;
    let codes = f64::from(field.width()).exp2();
    Some(codes / linear_scale(device, field.scale, by).codes_per_unit.abs())
}

/// The positions of the joint that command and reply can carry; `None` where they carry every one.
pub fn position_range(device: &FieldDevice, axis: &Axis) -> Option<(f64, f64)> {
    let by = Transmission::of(axis);
    let ends = |scale: DescribedScale, codes: (f64, f64)| {
        let LinearScale { codes_per_unit, zero_code } = linear_scale(device, scale, by);
        let ends = [codes.0, codes.1].map(|code| (code - zero_code) / codes_per_unit);
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    };
    let command = device.description.command.field(CommandValue::Position);
    let reply = device.description.reply.field(ReplyValue::Position);
    let command = command.filter(|_| {
        device.description.position_reference == PositionReference::Zero && !device.description.wraps
    });
    let command = command.map(|field| ends(field.scale, field.code_range()));
    let reply =
        reply.filter(|_| !device.description.wraps).map(|field| ends(field.scale, field.code_range()));
    command.into_iter().chain(reply).reduce(|one, other| (one.0.max(other.0), one.1.min(other.1)))
}

/// The highest value at the joint that the field of a command can carry, if there is such a field.
pub fn most(device: &FieldDevice, value: CommandValue, axis: &Axis) -> Option<f64> {
    let field = device.description.command.field(value)?;
    let LinearScale { codes_per_unit, zero_code } = linear_scale(device, field.scale, Transmission::of(axis));
    let (_, highest) = field.code_range();
    Some((highest - zero_code) / codes_per_unit.abs())
}

/// What one code of a reported value is at the joint, if the reply has such a field of whole codes.
pub fn step(device: &FieldDevice, value: ReplyValue, axis: &Axis) -> Option<f64> {
    let field = device.description.reply.field(value).filter(|field| field.number != Number::Float)?;
    Some(1.0 / linear_scale(device, field.scale, Transmission::of(axis)).codes_per_unit.abs())
}

fn life_cycle(device: &FieldDevice, motor: u8) -> LifeCycle {
    match &device.description.life_cycle {
        DescribedLifeCycle::ByFields(modes) => LifeCycle::ByFields { modes: *modes },
        DescribedLifeCycle::ByFrames(frames) => {
            let optional = |frame: &Option<_>| frame.as_ref().map(|frame| device.fixed(frame, motor));
            LifeCycle::ByFrames(OwnFrames {
                start: device.fixed(&frames.start, motor),
                stop: device.fixed(&frames.stop, motor),
                zero: optional(&frames.zero),
                clear: optional(&frames.clear),
                torque: optional(&frames.torque),
                velocity: optional(&frames.velocity),
                position: optional(&frames.position),
            })
        }
    }
}
