//! Drives that are spoken to by frames of fixed bit fields, without an object dictionary: what a description file says of a make of
//! drive ([`Description`]), and what the configuration of an axis says of one drive ([`Settings`]).
//!
//! A description is data alone. The cycle gets it compiled; the simulated drive reads the same data by itself.

mod expression;
mod registers;
mod scan;
mod settings;

use std::ops::RangeInclusive;

use takt_rt::{
    ByteOrder, CodeRange, CommandValue, FieldBits, FieldMode, FrameFormat, Id, ModeCodes, Nanoseconds,
    Number, OwnFrame, PositionReference, ReplyValue, StateCodes,
};

use crate::described_drive::DescribedDrive;

pub use expression::{IdExpression, PayloadByte};
pub use registers::{
    Interval, Register, RegisterExchange, RegisterFile, RegisterRequest, RegisterRole, StoreExchange,
};
pub use scan::{DescribedScan, HeartbeatScan, RegisterByte, RegisterFrame, RegisterProtocol, RegisterScan};
pub use settings::{Setting, Settings};

/// One drive: its description, and what the configuration says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldDevice {
    /// The description of its make.
    pub description: Description,
    /// What differs from drive to drive.
    pub settings: Settings,
}

/// What a description file says of a make of drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The drive that it is about.
    pub drive: DescribedDrive,
    /// The motor IDs that such a drive may have.
    pub motor_ids: RangeInclusive<u8>,
    /// The command of a cycle.
    pub command: FrameDescription<CommandValue>,
    /// The reply to it.
    pub reply: FrameDescription<ReplyValue>,
    /// The codes of the state in a reply, where it has one.
    pub states: Option<StateCodes>,
    /// When the reply comes.
    pub reply_moment: ReplyMoment,
    /// What it sends by itself beside its replies. The cycle does not read it.
    pub heartbeat: Option<DescribedHeartbeat>,
    /// How it is found on a bus, where that can be without a command to it.
    pub scan: Option<DescribedScan>,
    /// The identifiers by which it answers every frame, whatever it carries, and takes the frames of its life cycle. Empty: it answers
    /// nothing but what is described.
    pub hears: Vec<IdExpression>,
    /// True if it takes no frame while a reply is under way.
    pub is_deaf_until_reply: bool,
    /// What zeroing does to a running drive.
    pub zeroing: Zeroing,
    /// True if clearing faults takes the torque of a running drive away.
    pub clear_stops: bool,
    /// True if it forgets its last command when its torque is taken away.
    pub forgets_command: bool,
    /// True if it has the messages of ODrive's protocol CAN Simple. The cycle uses those that are described alone.
    pub speaks_can_simple: bool,
    /// Its registers, and what goes with them.
    pub registers: Option<RegisterFile>,
    /// The modes that it may be set to by the register of the mode, beside the one that this description is about.
    pub other_modes: Vec<ModeDescription>,
    /// How the drive is started and stopped.
    pub life_cycle: DescribedLifeCycle,
    /// The frames that set it up before it is used, in their order.
    pub setup: Vec<SetupFrame>,
    /// The length of its replies before it has been set up, where that differs.
    pub bytes_before_setup: Option<usize>,
    /// The modes that it has.
    pub modes: Vec<FieldMode>,
    /// What the position of a command is counted from.
    pub position_reference: PositionReference,
    /// True if the reported position wraps around at the ends of its field. Otherwise it stays at the end.
    pub wraps: bool,
    /// What velocity and torque are beside a target that is not theirs.
    pub beside_target: BesideTargetKind,
    /// True if the drive stops by itself when no more commands come.
    pub has_watchdog: bool,
    /// Its error codes in words.
    pub errors: Vec<(u16, String)>,
}

/// What differs from mode to mode in drives whose mode is a register.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeDescription {
    /// What the register of the mode has.
    pub mode_is: u32,
    /// The command of a cycle.
    pub command: FrameDescription<CommandValue>,
    /// What the drive follows.
    pub modes: Vec<FieldMode>,
    /// What velocity and torque are beside a target that is not theirs.
    pub beside_target: BesideTargetKind,
}

/// What zeroing does to a running drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zeroing {
    /// It is ignored.
    WhenStopped,
    /// The position becomes zero, and the target keeps its number.
    Always,
    /// Position and target become zero, and the zero is stored.
    WithTarget,
}

/// A frame of bit fields.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameDescription<V> {
    /// Its identifier.
    pub id: IdExpression,
    /// Its kind. A drive of CAN FD may be set to a bit-rate switch: see [`FieldDevice::format`].
    pub format: FrameFormat,
    /// Its length.
    pub bytes: usize,
    /// The order of its bytes.
    pub order: ByteOrder,
    /// Its fields.
    pub fields: Vec<FieldDescription<V>>,
}

impl<V: Copy + PartialEq> FrameDescription<V> {
    /// The field with a value.
    pub fn field(&self, value: V) -> Option<&FieldDescription<V>> {
        self.fields.iter().find(|field| field.value == value)
    }
}

/// A field of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldDescription<V> {
    /// What it carries.
    pub value: V,
    /// Where it lies.
    pub bits: FieldBits,
    /// What kind of number it is.
    pub number: Number,
    /// How a value becomes that number.
    pub scale: DescribedScale,
    /// The codes that may be sent, where not all of them may.
    pub codes: Option<CodeRange>,
}

impl<V> FieldDescription<V> {
    /// Its width in bits.
    pub fn width(&self) -> u32 {
        u32::from(self.bits.high.width) + self.bits.low.map_or(0, |low| u32::from(low.width))
    }

    /// The lowest and the highest code that it may have.
    pub fn code_range(&self) -> (f64, f64) {
        if let Some(CodeRange { lowest, highest }) = self.codes {
            return (lowest as f64, highest as f64);
        }
        let codes = f64::from(self.width()).exp2();
        match self.number {
            Number::Unsigned => (0.0, codes - 1.0),
            Number::Signed => (-codes / 2.0, codes / 2.0 - 1.0),
            Number::Float => (f32::MIN.into(), f32::MAX.into()),
        }
    }
}

/// So many codes beyond the code of zero are so much of a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescribedScale {
    /// The codes.
    pub codes: f64,
    /// What they are.
    pub are: Amount,
    /// Of which unit.
    pub unit: FieldUnit,
    /// The code of zero.
    pub zero: f64,
}

/// A number of the description, or one that the configuration has to give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// It is the same for every drive of the make.
    Number(f64),
    /// It differs from drive to drive.
    Setting(Setting),
}

/// The unit of a field, at the shaft whose position the drive reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldUnit {
    /// Turns.
    Turns,
    /// rad
    Radians,
    /// rad/s
    RadiansPerSecond,
    /// Turns per second.
    TurnsPerSecond,
    /// Electrical turns per second: those of the shaft times the pole pairs.
    ElectricalHertz,
    /// N·m
    NewtonMetres,
    /// A, which the torque constant turns into a torque.
    Amperes,
    /// N·m/rad
    NewtonMetresPerRadian,
    /// N·m·s/rad
    NewtonMetreSecondsPerRadian,
    /// °C
    DegreesCelsius,
    /// None: the number itself.
    Codes,
}

impl FieldUnit {
    /// The word for it in a description.
    pub const WORDS: [(&'static str, Self); 11] = [
        ("turn", Self::Turns),
        ("rad", Self::Radians),
        ("rad/s", Self::RadiansPerSecond),
        ("turn/s", Self::TurnsPerSecond),
        ("electrical Hz", Self::ElectricalHertz),
        ("Nm", Self::NewtonMetres),
        ("A", Self::Amperes),
        ("Nm/rad", Self::NewtonMetresPerRadian),
        ("Nm s/rad", Self::NewtonMetreSecondsPerRadian),
        ("°C", Self::DegreesCelsius),
        ("code", Self::Codes),
    ];

    /// The setting without which it means nothing.
    pub const fn needs(self) -> Option<Setting> {
        match self {
            Self::ElectricalHertz => Some(Setting::PolePairs),
            Self::Amperes => Some(Setting::TorqueConstant),
            _ => None,
        }
    }
}

/// When a drive replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyMoment {
    /// So long after each command, at the latest.
    AfterCommand {
        /// From the end of the command until the reply is ready to be sent.
        delay_ns: Nanoseconds,
    },
    /// By itself.
    Cyclic {
        /// From one to the next.
        period_ns: Nanoseconds,
    },
}

/// A classic frame that a drive sends by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescribedHeartbeat {
    /// Its identifier.
    pub id: IdExpression,
    /// Its length.
    pub bytes: usize,
    /// From one to the next.
    pub period_ns: Nanoseconds,
}

/// How a drive is told to start, to stop, and so on.
#[derive(Clone, Debug, PartialEq)]
pub enum DescribedLifeCycle {
    /// By fields of its command.
    ByFields(ModeCodes),
    /// By frames of their own.
    ByFrames(Box<DescribedFrames>),
}

/// The frames of a life cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescribedFrames {
    /// The identifier by which old firmware takes them, where that differs.
    pub old_id: Option<IdExpression>,
    /// The drive gets torque.
    pub start: FixedFrame,
    /// It has none.
    pub stop: FixedFrame,
    /// The present position becomes zero.
    pub zero: Option<FixedFrame>,
    /// Faults are cleared.
    pub clear: Option<FixedFrame>,
    /// Torque mode.
    pub torque: Option<FixedFrame>,
    /// Velocity mode.
    pub velocity: Option<FixedFrame>,
    /// Position mode.
    pub position: Option<FixedFrame>,
}

/// A frame of eight bytes that is always the same for one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedFrame {
    /// Its identifier.
    pub id: IdExpression,
    /// Its bytes.
    pub payload: [PayloadByte; 8],
}

/// A frame that sets a drive up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetupFrame {
    /// The frame.
    pub frame: FixedFrame,
    /// The number that it carries, if it carries one. It is sent only where the configuration gives that number.
    pub number: Option<SetupNumber>,
}

/// The number in a frame of the set-up: an IEEE 754 number of 32 bits, its most significant byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetupNumber {
    /// The place of its first byte in the payload, from 0 to 4.
    pub at: usize,
    /// What it is.
    pub setting: Setting,
}

/// What the fields for velocity and torque are, where the drive follows a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BesideTargetKind {
    /// What is fed forward.
    FeedForward,
    /// The most that the drive may use.
    Limits,
}

/// Counts of a turn, for a drive whose replies have no whole counts.
const COUNTS_PER_TURN: f64 = 1_048_576.0;

impl FieldDevice {
    /// The settings without which the frames mean nothing, each once.
    pub fn needed(description: &Description) -> Vec<Setting> {
        let of_command = description.command.fields.iter().map(|field| field.scale);
        let of_reply = description.reply.fields.iter().map(|field| field.scale);
        let mut needed = vec![];
        for DescribedScale { are, unit, .. } in of_command.chain(of_reply) {
            let full_scale = match are {
                Amount::Setting(setting) => Some(setting),
                Amount::Number(_) => None,
            };
            for setting in full_scale.into_iter().chain(unit.needs()) {
                if !needed.contains(&setting) {
                    needed.push(setting);
                }
            }
        }
        needed
    }

    /// Returns `true` if any frame needs the master ID.
    pub fn needs_master_id(description: &Description) -> bool {
        let own = match &description.life_cycle {
            DescribedLifeCycle::ByFields(_) => vec![],
            DescribedLifeCycle::ByFrames(frames) => frames.all().map(|(_, frame)| frame).collect(),
        };
        let setup = description.setup.iter().map(|setup| &setup.frame);
        let fixed = own.into_iter().chain(setup);
        description.command.id.has_master()
            || description.reply.id.has_master()
            || description.heartbeat.is_some_and(|heartbeat| heartbeat.id.has_master())
            || fixed
                .into_iter()
                .any(|frame| frame.id.has_master() || frame.payload.contains(&PayloadByte::Master))
    }

    /// The value of an amount. A drive that was read has every amount.
    pub fn amount(&self, amount: Amount) -> f64 {
        match amount {
            Amount::Number(number) => number,
            Amount::Setting(setting) => self.settings.get(setting).unwrap_or(1.0),
        }
    }

    /// The kind of frame that the drive is set to.
    pub fn format(&self, described: FrameFormat) -> FrameFormat {
        match described {
            FrameFormat::Fd if self.settings.has_bit_rate_switch => FrameFormat::FdBitRateSwitch,
            other => other,
        }
    }

    /// An identifier of the drive with this motor ID. Every one has been checked when it was read: there is one for every motor ID.
    pub fn id(&self, expression: &IdExpression, motor: u8) -> Id {
        let id = expression.id(motor, self.settings.master_id.unwrap_or(0));
        id.unwrap_or(Id::canopen(0, motor & 0x7F))
    }

    /// The identifiers to which the drive with this motor ID listens in the cycle, each once.
    pub fn request_ids(&self, motor: u8) -> Vec<Id> {
        let mut ids = vec![self.id(&self.description.command.id, motor)];
        if let DescribedLifeCycle::ByFrames(frames) = &self.description.life_cycle {
            for (_, frame) in frames.all() {
                let id = self.id(&frame.id, motor);
                if !ids.contains(&id) {
                    ids.push(id);
                }
            }
        }
        ids
    }

    /// The identifiers of the frames that set the drive with this motor ID up.
    pub fn setup_ids(&self, motor: u8) -> Vec<Id> {
        self.description.setup.iter().map(|setup| self.id(&setup.frame.id, motor)).collect()
    }

    /// The identifier of the heartbeat of the drive with this motor ID, if it has one.
    pub fn heartbeat_id(&self, motor: u8) -> Option<Id> {
        self.description.heartbeat.map(|heartbeat| self.id(&heartbeat.id, motor))
    }

    /// The identifier by which the drive with this motor ID replies.
    pub fn reply_id(&self, motor: u8) -> Id {
        self.id(&self.description.reply.id, motor)
    }

    /// A frame that is always the same, for the drive with this motor ID.
    pub fn fixed(&self, frame: &FixedFrame, motor: u8) -> OwnFrame {
        let master = self.settings.master_id.unwrap_or(0);
        let payload = frame.payload.map(|byte| match byte {
            PayloadByte::Byte(byte) => byte,
            PayloadByte::Motor => motor,
            PayloadByte::Master => master.to_le_bytes()[0],
        });
        OwnFrame { id: self.id(&frame.id, motor), payload }
    }

    /// The frames that set the drive with this motor ID up, in their order.
    pub fn setup(&self, motor: u8) -> Vec<OwnFrame> {
        let frames = self.description.setup.iter().filter_map(|setup| {
            let number = setup.number.map_or(Some(0.0), |number| self.settings.get(number.setting))?;
            Some(self.filled(setup, motor, number))
        });
        frames.collect()
    }

    /// The frame that gives the drive with this motor ID a number of its set-up, if it has such a frame.
    pub fn setup_of(&self, motor: u8, setting: Setting, number: f64) -> Option<OwnFrame> {
        let has_it = |setup: &&SetupFrame| setup.number.is_some_and(|number| number.setting == setting);
        let setup = self.description.setup.iter().find(has_it)?;
        Some(self.filled(setup, motor, number))
    }

    /// The frames of the set-up that carry no number.
    pub fn setup_without_numbers(&self, motor: u8) -> Vec<OwnFrame> {
        let plain = self.description.setup.iter().filter(|setup| setup.number.is_none());
        plain.map(|setup| self.fixed(&setup.frame, motor)).collect()
    }

    /// A frame of the set-up with this number in the place of its own.
    fn filled(&self, setup: &SetupFrame, motor: u8, number: f64) -> OwnFrame {
        let mut own = self.fixed(&setup.frame, motor);
        if let Some(SetupNumber { at, .. }) = setup.number {
            let bytes = (number as f32).to_be_bytes();
            for (to, from) in own.payload.iter_mut().skip(at).zip(bytes) {
                *to = from;
            }
        }
        own
    }

    /// Codes of one turn of the shaft in the reported position.
    pub fn counts_per_turn(&self) -> f64 {
        let position = self.description.reply.field(ReplyValue::Position);
        match position.filter(|field| field.number != Number::Float) {
            None => COUNTS_PER_TURN,
            Some(field) => {
                let turns = match field.scale.unit {
                    FieldUnit::Radians => self.amount(field.scale.are) / std::f64::consts::TAU,
                    _ => self.amount(field.scale.are),
                };
                field.scale.codes / turns
            }
        }
    }

    /// Returns `true` if the drive tells more turns than 32 bits of its counts hold.
    pub fn outruns_counts(&self) -> bool {
        let position = self.description.reply.field(ReplyValue::Position);
        let highest = position.map_or(0.0, |field| field.code_range().1);
        self.description.wraps || highest > f64::from(i32::MAX)
    }

    /// Returns `true` if a turn may count so much here: as in the frames, or less, so that 32 bits hold more turns.
    pub fn may_count(&self, counts_per_turn: f64) -> bool {
        let share = counts_per_turn / self.counts_per_turn();
        (share - 1.0).abs() <= 1e-9 || share < 1.0 && self.outruns_counts()
    }

    /// Returns `true` if stiffness and damping of a command are those of a spring and a damper at the shaft, and no mere gains of a loop.
    pub fn has_impedance(&self) -> bool {
        let stiffness = self.description.command.field(CommandValue::Stiffness);
        stiffness.is_some_and(|field| field.scale.unit == FieldUnit::NewtonMetresPerRadian)
    }
}

impl DescribedFrames {
    /// The same for old firmware.
    #[must_use]
    pub fn of_old_firmware(self) -> Self {
        let Some(id) = self.old_id else { return self };
        let to_old = |frame: FixedFrame| FixedFrame { id, ..frame };
        Self {
            old_id: None,
            start: to_old(self.start),
            stop: to_old(self.stop),
            zero: self.zero.map(to_old),
            clear: self.clear.map(to_old),
            torque: self.torque.map(to_old),
            velocity: self.velocity.map(to_old),
            position: self.position.map(to_old),
        }
    }

    /// All of them, with their names.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, &FixedFrame)> {
        let optional = [
            ("zero", self.zero.as_ref()),
            ("clear", self.clear.as_ref()),
            ("torque", self.torque.as_ref()),
            ("velocity", self.velocity.as_ref()),
            ("position", self.position.as_ref()),
        ];
        let optional = optional.into_iter().filter_map(|(name, frame)| Some((name, frame?)));
        [("start", &self.start), ("stop", &self.stop)].into_iter().chain(optional)
    }
}
