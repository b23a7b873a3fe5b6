//! Drives that are spoken to by frames of fixed bit fields, without an object dictionary: `drive = "bit-fields"`,
//! `description = "damiao-dm-mit"`, or the path of a description file.
//!
//! A description says everything of a make of drive; nothing here knows one. It comes with takt (`drives/bit-fields/`), or from a file of
//! your own. Families of one vendor are the same with their own words.

mod commission;
mod device;
mod scan;

use std::f64::consts::TAU;

use takt_rt::{
    CommandValue, FieldDriveParameters, FieldMode, Frame, FrameFormat, Id, ModeCondition, Nanoseconds,
    OperationMode,
};
use takt_wire::bit_fields::{
    BesideTargetKind, DescribedLifeCycle, Description, FieldDevice, ReplyMoment, Setting, Settings,
};

use super::bring_up::{AxisSession, ProcessData};
use super::commission::{DriveTask, Failure, PulseWidth, Report, TargetDrive, Task};
use super::scan::{FoundDevice, OwnProtocol, StartingKeys};
use super::{DataSheet, Family, LookingAtSlave, SettingUp, SignOfLife, Unwatched, Watchdog};
use crate::config::bit_fields::DESCRIPTIONS;
pub use crate::config::bit_fields::shipped;
use crate::config::{
    Axis, Config, ConfiguredFamily, Control, DriveFacts, DriveFamily, ErrorControl, FamilyKeys,
    ModeChangeRule, ModeSet, Protocol, Quantity, bit_fields,
};
use crate::procedure::ModbusSession;
use crate::words;
use crate::words::Words;
use takt_sim::Drive;
use takt_sim::bit_fields::FieldSimulation;

/// Makes a task with a drive on a serial line of a bit rate.
pub type BeginOnLine = fn(TargetDrive, Task, u32) -> Result<DriveTask<Vec<u8>>, Failure>;
/// Calculates a pulse at the PWM input of a model.
pub type CalculatePulse = fn(&str, &PulseWidth) -> Result<Report, Failure>;

/// A family whose drives are described by a file.
#[derive(Clone, Copy, Debug)]
pub struct BitFieldFamily {
    /// Its word in a configuration.
    pub word: &'static str,
    /// What people call such a drive.
    pub name: &'static str,
    /// The bit rates that the drives know; empty: any.
    pub bit_rates: &'static [u32],
    /// Finds the description. What is wrong with the keys is reported to them, and the answer is `None`.
    pub describe: fn(&mut FamilyKeys<'_, '_>) -> Option<Description>,
    /// A task with a drive on a serial line of this bit rate, where the drives may be there.
    pub on_line: Option<BeginOnLine>,
    /// What a pulse at the PWM input of a model is, where the drives have one.
    pub pulse_width: Option<CalculatePulse>,
    /// How the drives are found on a bus or a line, where that is known.
    pub found_by: Option<FoundBy>,
}

/// Looks at a slave on a line of a bit rate.
pub type LookOnLine = for<'a> fn(&'a ModbusSession, u32) -> LookingAtSlave<'a>;

/// How the drives of a family are found.
#[derive(Clone, Copy, Debug)]
pub struct FoundBy {
    /// Their protocols on a CAN bus.
    pub protocols: fn() -> &'static [&'static dyn OwnProtocol],
    /// A look at a slave on a Modbus line, where the drives may be on one.
    pub on_line: Option<LookOnLine>,
    /// The keys of an axis with such a drive.
    pub starting_keys: fn(&FoundDevice) -> Option<StartingKeys>,
}

/// Drives whose description the configuration names.
pub static FROM_FILE: BitFieldFamily = BitFieldFamily {
    word: "bit-fields",
    name: "drive",
    bit_rates: &[],
    describe: described,
    on_line: None,
    pulse_width: None,
    found_by: Some(FoundBy { protocols: scan::protocols, on_line: None, starting_keys: scan::starting_keys }),
};

/// The description that the key `description` names: one that comes with takt, or a file.
fn described(keys: &mut FamilyKeys<'_, '_>) -> Option<Description> {
    let names = DESCRIPTIONS.map(|(name, _)| format!("\"{name}\"")).join(", ");
    keys.require(
        "description",
        "the description of the drive: description = \"damiao-dm-mit\", or the path of a file",
    );
    let name = keys.text("description")?;
    let with_modes = |description: Description| {
        let other_modes = bit_fields::other_modes(&description);
        Description { other_modes, ..description }
    };
    if let Some((name, text)) = DESCRIPTIONS.iter().find(|(shipped, _)| *shipped == name) {
        return Some(with_modes(shipped(name, text)));
    }
    let path = keys.path("description")?;
    match bit_fields::load(&path) {
        Ok(description) => Some(with_modes(description)),
        Err(reason) => {
            let allowed = format!("one of {names}, or the path of a description:\n{reason:?}");
            keys.refuse("description", format!("{name:?}"), allowed);
            None
        }
    }
}

/// The device of an axis of such a family.
///
/// # Panics
/// The drive of the axis is of another family.
pub fn device(axis: &Axis) -> &FieldDevice {
    axis.drive.description().expect("a drive of this family is made from its description")
}

/// A task with a drive, to which a frame may go in each period.
///
/// # Errors
/// Such a drive cannot do it, or a value is wrong.
pub fn task(target: TargetDrive, task: Task, period_ns: Nanoseconds) -> Result<DriveTask<Frame>, Failure> {
    commission::begin(target, task, period_ns)
}

/// The identifier by which a drive replies.
///
/// # Errors
/// Nothing is known of the drive.
pub fn reply_id(target: &TargetDrive) -> Result<Id, Failure> {
    let device: Option<&FieldDevice> = target.drive.description();
    let unknown = || Failure::Unsuitable("nothing is known of the identifiers of the motor".to_owned());
    device.map(|device| device.reply_id(target.node)).ok_or_else(unknown)
}

/// The numbers that a configuration may give are beyond all use outside of these.
const NUMBERS: std::ops::RangeInclusive<f64> = 1e-6..=1e6;
const POLE_PAIRS: std::ops::Range<i64> = 1..201;
const MASTER_IDS: std::ops::Range<i64> = 0..0x800;

/// What the configuration says of the drive. `None` where something is missing or wrong: all of it is reported.
fn settings(keys: &mut FamilyKeys<'_, '_>, description: &Description) -> Option<Settings> {
    let mut settings = Settings::default();
    let mut is_complete = true;
    if FieldDevice::needs_master_id(description) {
        keys.require("master_id", "the identifier by which the motor replies: master_id = 0x65");
        settings.master_id = keys.integer("master_id", MASTER_IDS).and_then(|id| u16::try_from(id).ok());
        is_complete &= settings.master_id.is_some();
    }
    if description.command.format == FrameFormat::Fd {
        let switches = keys.boolean("bit_rate_switch");
        settings.has_bit_rate_switch = switches.unwrap_or(false);
        is_complete &= switches.is_some();
    }
    let needed = FieldDevice::needed(description);
    for setting in &needed {
        keys.require(setting.key(), setting.says());
    }
    let of_setup = description.setup.iter().filter_map(|setup| Some(setup.number?.setting));
    let gains =
        [(Setting::PositionGain, CommandValue::Stiffness), (Setting::PositionDamping, CommandValue::Damping)];
    let gains = gains.into_iter().filter(|(_, value)| description.command.field(*value).is_some());
    let gains = gains.map(|(setting, _)| setting);
    for setting in needed.iter().copied().chain(of_setup).chain(gains) {
        if let Some(number) = number(keys, setting) {
            settings.set(setting, number);
        }
    }
    let is_given = |setting: &Setting| settings.get(*setting).is_some();
    (is_complete && needed.iter().all(is_given)).then_some(settings)
}

fn number(keys: &mut FamilyKeys<'_, '_>, setting: Setting) -> Option<f64> {
    let key = setting.key();
    match setting {
        Setting::PositionFullScale => keys.quantity(key, Quantity::ANGLE, 1e-3..=1e6 * TAU),
        Setting::VelocityFullScale => keys.quantity(key, Quantity::ANGULAR_VELOCITY, NUMBERS),
        Setting::TorqueFullScale => keys.quantity(key, Quantity::TORQUE, NUMBERS),
        Setting::PolePairs => keys.integer(key, POLE_PAIRS).map(|pairs| pairs as f64),
        Setting::PositionGain | Setting::PositionDamping => keys.number(key, 0.0..=1e6),
        Setting::CurrentFullScale
        | Setting::TorqueConstant
        | Setting::VelocityLoopKp
        | Setting::VelocityLoopKi
        | Setting::CurrentLoopKp
        | Setting::CurrentLoopKi => keys.number(key, NUMBERS),
    }
}

impl BitFieldFamily {
    fn facts(&self, device: &FieldDevice) -> DriveFacts {
        let description = &device.description;
        let modes: Vec<OperationMode> = description.modes.iter().map(|mode| operation_mode(*mode)).collect();
        let follows_positions = description.modes.contains(&FieldMode::Position);
        let usual_gain = crate::config::defaults::position_gain(1e-3);
        DriveFacts {
            counts_per_turn: Some(device.counts_per_turn()),
            modes: ModeSet::of(&modes),
            usual_mode: match follows_positions {
                true => Control::Position,
                false => Control::Velocity { position_gain: usual_gain },
            },
            mode_changes: match (description.modes.len(), device.has_impedance()) {
                (1, _) => ModeChangeRule::Never { because: "it has one mode" },
                (_, true) => {
                    ModeChangeRule::Never { because: "the gains in its commands are those of one mode" }
                }
                _ => ModeChangeRule::When(ModeCondition::AtRest),
            },
            bit_rates: self.bit_rates,
            has_fixed_process_data: description.beside_target == BesideTargetKind::Limits,
            protocol: Protocol::BitFields,
            error_control: ErrorControl::None,
            consumes_heartbeat: false,
            sends_emergencies: false,
            ..DriveFacts::standard(self.word, self.name)
        }
    }
}

const fn operation_mode(mode: FieldMode) -> OperationMode {
    match mode {
        FieldMode::Torque => OperationMode::CyclicSynchronousTorque,
        FieldMode::Velocity => OperationMode::CyclicSynchronousVelocity,
        FieldMode::Position => OperationMode::CyclicSynchronousPosition,
    }
}

impl ConfiguredFamily for BitFieldFamily {
    fn word(&self) -> &'static str {
        self.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        let Some(description) = (self.describe)(keys) else {
            // Which of these the drive has is not known.
            Setting::ALL.into_iter().for_each(|(key, _)| keys.pass_over(key));
            ["master_id", "bit_rate_switch", "old_firmware"].into_iter().for_each(|key| keys.pass_over(key));
            return None;
        };
        let mut description = description;
        let settings = settings(keys, &description)?;
        if let DescribedLifeCycle::ByFrames(frames) = &mut description.life_cycle
            && frames.old_id.is_some()
            && keys.boolean("old_firmware")?
        {
            **frames = frames.of_old_firmware();
        }
        let device = FieldDevice { description, settings };
        Some(DriveFamily::of_drive(self.facts(&device), device))
    }
}

/// The pause before a frame that sets a drive up, beside the time that its reply takes.
const SETUP_PAUSE_NS: Nanoseconds = 2_000_000;

impl Family for BitFieldFamily {
    /// Nothing is known of a drive without its scales: the keys of an axis.
    fn unconfigured(&self) -> Option<DriveFamily> {
        None
    }

    fn has_statusword(&self) -> bool {
        false
    }

    fn own_protocols(&self) -> &'static [&'static dyn OwnProtocol] {
        self.found_by.map_or(&[], |found_by| (found_by.protocols)())
    }

    fn recognises_on_line<'a>(
        &'a self,
        session: &'a ModbusSession,
        bit_rate: u32,
    ) -> Option<LookingAtSlave<'a>> {
        self.found_by?.on_line.map(|look| look(session, bit_rate))
    }

    fn starting_keys(&self, found: &FoundDevice) -> Option<StartingKeys> {
        (self.found_by?.starting_keys)(found)
    }

    /// There are no PDOs.
    fn process_data(&self, _: &Axis) -> ProcessData {
        ProcessData { commands: vec![], feedback: vec![], unused: vec![] }
    }

    fn field_drive(&self, axis: &Axis) -> Option<FieldDriveParameters> {
        bit_fields::compile(device(axis), axis).ok()
    }

    fn stops_by_itself_after(&self, axis: &Axis, _: &Config) -> Result<Watchdog, Unwatched> {
        match device(axis).description.has_watchdog {
            true => Ok(Watchdog::new(SignOfLife::Command, None)),
            false => Err(Unwatched::NoWatchdog),
        }
    }

    /// Sends the frames that set the drive up. Whether it is there, the cycle sees, which stops it first.
    fn configure<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async move {
            let device = device(c.axis);
            let reply_ns = match device.description.reply_moment {
                ReplyMoment::AfterCommand { delay_ns } => delay_ns,
                ReplyMoment::Cyclic { .. } => 0,
            };
            let setup = device.setup(c.axis.node);
            if setup.is_empty() {
                return Ok(());
            }
            c.step("set the motor up", "check the supply of the motor and the wiring");
            // It may have been switched on just now, and nothing shows when it listens.
            c.pause(c.axis.power_up_ns).await;
            for frame in setup {
                c.pause(SETUP_PAUSE_NS.saturating_add(reply_ns)).await;
                c.send(Frame::of(frame.id, frame.payload));
            }
            Ok(())
        })
    }

    /// The drive has no network states.
    fn start<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    /// The cycle has taken its torque away.
    fn shut_down<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    fn data_sheet<'d>(&self, drive: &'d DriveFamily) -> Option<&'d dyn DataSheet> {
        let device: &FieldDevice = drive.description()?;
        Some(device)
    }

    fn error_words(&self, code: u16) -> Words {
        words!("error {code} of the drive", code)
    }

    fn error_cure(&self, _: u16) -> Option<&'static str> {
        Some("remove its cause, then reset the fault; if it stays, power-cycle the drive")
    }

    fn instead_of_lss(&self) -> Option<&'static str> {
        Some("the IDs of such a drive are set with its vendor's tool")
    }

    fn is_named_by_keys(&self) -> bool {
        true
    }

    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
        commission::begin(target, task, commission::CAN_PERIOD_NS)
    }

    fn commission_on_line(
        &self,
        target: TargetDrive,
        task: Task,
        bit_rate: u32,
    ) -> Option<Result<DriveTask<Vec<u8>>, Failure>> {
        self.on_line.map(|begin| begin(target, task, bit_rate))
    }

    fn pulse_width(&self, model: &str, asked: &PulseWidth) -> Option<Result<Report, Failure>> {
        self.pulse_width.map(|pulse_width| pulse_width(model, asked))
    }

    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        let bus = config.buses.get(axis.bus);
        Box::new(FieldSimulation::new(device::parameters(axis, device(axis), bus)))
    }
}
