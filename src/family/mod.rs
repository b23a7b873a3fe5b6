//! One folder a family of drives: everything that takt knows of it outside the cycle.
//!
//! A family is a [`Family`]: its facts, its process data, its bring-up and its shutdown, the identifiers that it uses, the words for
//! its errors, and the drive that simulates it. Nothing outside its folder and `sim/` says its name. [`register`] adds a family
//! of your own, so that configurations may name it.

mod adapter_warning;
pub(crate) mod bit_fields;
pub mod bring_up;
pub mod cia402;
pub mod commission;
mod data_sheet;
#[doc(hidden)]
pub mod erob;
#[doc(hidden)]
pub mod erob_can;
#[doc(hidden)]
pub mod erob_modbus;
mod error_words;
#[allow(unnameable_types, reason = "its sessions have no public name")]
pub(crate) mod hollow;
mod off_cycle;
mod registry;
pub mod scan;
mod simulated_bus;
mod simulated_joint;
mod warning;
mod watchdog;
#[doc(hidden)]
pub mod yz_aim;

use std::pin::Pin;

use takt_rt::{FieldDriveParameters, Frame, Id, MappedObject};

pub use crate::procedure::{
    AxisReading, CanopenClient, CanopenSession, Client, Procedure, ProcedureEvent, ProcedureSession,
    SdoQuirks,
};
pub use data_sheet::DataSheet;
pub(crate) use error_words::{coded, drive_error_cure, drive_error_words, own_error_words, own_errors};
pub use error_words::{error_cure, error_words, standard_error};
pub use off_cycle::{LineCounts, OffCycleBudget, OffCycleDrive, OffCycleLine, OffCycleTarget, OffCycleWish};
pub use registry::{NameTaken, all, register};
#[doc(hidden)]
pub use registry::{named, of};
pub use simulated_bus::simulated_bus;
#[doc(hidden)]
pub use simulated_bus::simulated_drives;
pub(crate) use warning::is_rounded;
pub use warning::{Warning, WarningKind, WarningSubject};
pub(crate) use watchdog::least_shut_down_ns;
pub use watchdog::{SignOfLife, Unwatched, Watchdog, stops_by_itself_after, unreached_words};

use takt_wire::canopen::object::Object;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::sdo::SdoTiming;

use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, PdoMapping};
use crate::family::bring_up::{AxisSession, ProcessData, StepResult};
pub use crate::family::commission::NamedEntry;
use crate::family::commission::dictionary::ObjectEntry;
use crate::family::commission::{DriveTask, Failure, PulseWidth, Report, TargetDrive, Task};
use crate::family::scan::{FoundDevice, NodeIdentity, OwnProtocol, Recognised, StartingKeys};
use crate::procedure::ModbusSession;
use crate::words::Words;
use takt_sim::{DevicesOnLine, Drive};

/// ZeroErr eRob with CANopen firmware.
pub const EROB_CANOPEN: DriveFamily = DriveFamily::built_in(cia402::erob_canopen);
/// YZ-AIM integrated servo, CANopen edition.
pub const YZ_AIM: DriveFamily = DriveFamily::built_in(yz_aim::drive);

/// Describes frames in words.
pub type FrameWords = Box<dyn FnMut(&Frame) -> String + Send>;

/// A look at a slave on a Modbus line: what it is, if it is a drive of the family.
pub type LookingAtSlave<'a> = Pin<Box<dyn Future<Output = Option<FoundDevice>> + 'a>>;

/// A part of bring-up or shutdown that is under way.
pub type SettingUp<'a> = Pin<Box<dyn Future<Output = StepResult> + Send + 'a>>;

/// What takt needs to know of a family of drives, beside the facts that a configuration reads.
pub trait Family: ConfiguredFamily {
    /// A drive without a configuration; `None` where the family knows nothing of a drive without one.
    fn unconfigured(&self) -> Option<DriveFamily>;

    /// Returns true if the drives have a statusword (object 6041).
    fn has_statusword(&self) -> bool {
        true
    }

    /// The node ID of a drive that is alone on its line, where none is given.
    fn usual_node(&self) -> Option<u8> {
        None
    }

    /// Who makes the drives of the family, where one vendor does.
    fn maker(&self) -> Option<&'static str> {
        None
    }

    /// Whether a CANopen node with this identity is a drive of the family, and how surely.
    fn recognises(&self, identity: &NodeIdentity) -> Option<Recognised> {
        identity.is_of(&self.unconfigured()?.identity).then_some(Recognised::ByIdentity)
    }

    /// The protocols of their own by which drives of the family are found on a CAN bus.
    fn own_protocols(&self) -> &'static [&'static dyn OwnProtocol] {
        &[]
    }

    /// Looks whether a slave on a Modbus line of this bit rate, which has answered a read, is a drive of the family. It is read, and
    /// nothing else. `None` where the drives of the family are on no such line.
    fn recognises_on_line<'a>(
        &'a self,
        _session: &'a ModbusSession,
        _bit_rate: u32,
    ) -> Option<LookingAtSlave<'a>> {
        None
    }

    /// The keys of an axis with a drive that a scan has found; `None` where a scan cannot tell enough for an axis.
    fn starting_keys(&self, _found: &FoundDevice) -> Option<StartingKeys> {
        None
    }

    /// What a pulse at the PWM input of a model is, by the table of its data sheet; `None` where the drives of the family have no such input.
    fn pulse_width(&self, _model: &str, _asked: &PulseWidth) -> Option<Result<Report, Failure>> {
        None
    }

    /// Returns `true` if a drive without a configuration is known by the keys that an axis has in one.
    fn is_named_by_keys(&self) -> bool {
        false
    }

    /// The process data of an axis. A drive whose own mapping is used tells it at bring-up; until then this has as many PDOs as a
    /// written mapping, each of full length.
    fn process_data(&self, axis: &Axis) -> ProcessData {
        let written = ProcessData::mapped_freely(axis);
        if axis.mapping == PdoMapping::AsStored { written.padded() } else { written }
    }

    /// How the drive of an axis is spoken to in each cycle where it has no PDOs, but frames of bit fields. Its values are in SI units at the
    /// joint.
    fn field_drive(&self, _axis: &Axis) -> Option<FieldDriveParameters> {
        None
    }

    /// Who speaks to the drive of an axis where it answers too slowly for the cycle; `None` where it is spoken to in the cycle.
    fn off_cycle(&self, _axis: &Axis, _config: &Config) -> Option<Box<dyn OffCycleDrive>> {
        None
    }

    /// The frame that takes the torque of a drive to which [`off_cycle`](Self::off_cycle) speaks, whatever it is doing. The real-time thread
    /// sends it while a bus is behind, where frames of procedures do not leave.
    fn off_cycle_stop_frame(&self, _axis: &Axis) -> Option<Frame> {
        None
    }

    /// Who speaks to the drives of the axes of a serial line, all of which are of this family; `None` where the drives of the family are
    /// on a CAN bus.
    fn off_cycle_line(&self, _config: &Config, _bus: usize) -> Option<Box<dyn OffCycleLine>> {
        None
    }

    /// What [`off_cycle`](Self::off_cycle) or [`off_cycle_line`](Self::off_cycle_line) asks of the bus of an axis.
    fn off_cycle_budget(&self, _axis: &Axis, _config: &Config) -> Option<OffCycleBudget> {
        None
    }

    /// The identifier that a PDO (counted from 1) of the drive of an axis has by its data sheet, where that gives one. It is asked for the
    /// PDOs of further axes of a node, for which the pre-defined connection set has none.
    fn pdo_id(&self, _axis: &Axis, _direction: PdoDirection, _number: u16) -> Option<Id> {
        None
    }

    /// How many objects an RPDO (counted from 1) of the drive of an axis can map, beside or in place of its own, where several axes are to
    /// share a command; 0 where they cannot.
    fn mappable_objects(&self, _axis: &Axis, _number: u8) -> usize {
        0
    }

    /// Returns `true` if the drive of an axis can pass over a part of a frame by this dummy object.
    fn can_pass_over(&self, _axis: &Axis, _dummy: MappedObject) -> bool {
        false
    }

    /// How the PDOs that a drive reports are matched with those that its axis needs.
    fn mapping_match(&self) -> MappingMatch {
        MappingMatch::ByContent
    }

    /// From any state to NMT pre-operational, configured, without torque.
    fn configure<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a>;

    /// From configured to operational.
    fn start<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a>;

    /// From operational to pre-operational, without torque, and without the watchdog on the controller's heartbeat.
    fn shut_down<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a>;

    /// The watchdog by which the drive of an axis stops when its controller is gone. The engine, `takt check`, the end of a run and its
    /// report read it here alone.
    ///
    /// # Errors
    /// The drive does not stop by itself. At the end of a run it is told to stop for longer.
    fn stops_by_itself_after(&self, axis: &Axis, config: &Config) -> Result<Watchdog, Unwatched> {
        Watchdog::of_canopen(axis, config)
    }

    /// What an axis has to do without, because its drive lacks something: sentences for people.
    fn remarks(&self, _axis: &Axis) -> Vec<&'static str> {
        vec![]
    }

    /// The protocol that a drive with this node ID may speak instead, if it can be probed for.
    fn other_protocol(&self, _drive: &DriveFamily, _node: u8) -> Option<OtherProtocol> {
        None
    }

    /// What the data sheet of a drive says, where the drives of the family differ.
    fn data_sheet<'d>(&self, _drive: &'d DriveFamily) -> Option<&'d dyn DataSheet> {
        None
    }

    /// An error code of a drive in words: its name in English and in Chinese ([`Words::bilingual`]). A drive whose data sheet has words of its own has those instead.
    fn error_words(&self, code: u16) -> Words {
        standard_error(code)
    }

    /// What clears a fault with this code, where the family knows more than the standard.
    fn error_cure(&self, _code: u16) -> Option<&'static str> {
        None
    }

    /// How its node ID and bit rate are set, where its drives have no LSS (CiA 305): a sentence for people.
    fn instead_of_lss(&self) -> Option<&'static str> {
        None
    }

    /// Timing and quirks of the SDO server.
    fn sdo_quirks(&self) -> SdoQuirks {
        SdoQuirks::standard()
    }

    /// The objects that commissioning knows by name.
    fn objects(&self) -> &'static [ObjectEntry] {
        &[]
    }

    /// What commissioning knows by name in a drive.
    fn entries(&self, drive: &DriveFamily) -> Vec<NamedEntry> {
        commission::dictionary::entries(drive)
    }

    /// The meaning of an object's value in words, if it has one beyond its number.
    fn meaning(&self, _drive: &DriveFamily, _object: &Object, _value: i64) -> Option<String> {
        None
    }

    /// The contents of a PDO in words, if they are known.
    fn process_data_words(&self, _target: &TargetDrive, _frame: &Frame) -> Option<String> {
        None
    }

    /// What describes the frames between a drive and its master in words. The frames come in their order.
    fn frame_words(&self, target: TargetDrive) -> FrameWords {
        Box::new(move |frame| commission::meaning::of(&target, frame))
    }

    /// A task of commissioning with a drive, in the protocol that the drive speaks. For drives with an object dictionary,
    /// [`over_sdo`](commission::over_sdo) makes it.
    ///
    /// # Errors
    /// The task cannot be done with such a drive, or a name or a value in it is wrong. Nothing has been sent then.
    fn commission(&self, target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure>;

    /// A task with a drive on a serial line of this bit rate; `None` where the drives of the family are on a CAN bus.
    fn commission_on_line(
        &self,
        _target: TargetDrive,
        _task: Task,
        _bit_rate: u32,
    ) -> Option<Result<DriveTask<Vec<u8>>, Failure>> {
        None
    }

    /// The drives that stand in for the axes of a simulated serial line; `None` where the drives of the family are on a CAN bus.
    fn simulated_axes_on_line(&self, _config: &Config, _bus: usize) -> Option<Box<dyn DevicesOnLine>> {
        None
    }

    /// Drives with these addresses on a simulated serial line; `None` where the drives of the family are on a CAN bus.
    ///
    /// # Errors
    /// An address is none, or not one of its own: a sentence for people.
    fn simulated_line(&self, _addresses: &[u8]) -> Option<Result<Box<dyn DevicesOnLine>, String>> {
        None
    }

    /// The drive that stands in for an axis on a simulated bus, and for the other axes of its node, where the drive has several.
    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive>;
}

/// How the PDOs that a drive reports are matched with those that its axis needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MappingMatch {
    /// Any PDO may carry an object.
    ByContent,
    /// Each PDO has its purpose by its number.
    ByNumber,
}

/// Returns `true` if the drive of an axis has PDOs.
pub(crate) fn has_pdos(axis: &Axis, config: &Config) -> bool {
    let family = of(&axis.drive);
    family.field_drive(axis).is_none() && !is_off_cycle(axis, config)
}

/// Returns `true` if the drive of an axis is spoken to outside of the cycle.
pub(crate) fn is_off_cycle(axis: &Axis, config: &Config) -> bool {
    axis.drive.protocol.is_of_serial_line() || of(&axis.drive).off_cycle(axis, config).is_some()
}

/// Cycles of its bus within which a report of a drive is expected that is spoken to outside of the cycle. On a CAN bus that is one; on a
/// serial line it is what a round takes.
pub(crate) fn report_cycles(axis: &Axis, config: &Config) -> u16 {
    let report_ns = line_report_ns(config, axis.bus).unwrap_or(0);
    let cycles = report_ns.div_ceil(config.bus_cycle(axis.bus).period_ns.max(1));
    u16::try_from(cycles).unwrap_or(u16::MAX).max(1)
}

/// The family of the drives of a serial line; `None` if the bus is none, or has no axes.
pub(crate) fn of_line(config: &Config, bus: usize) -> Option<&'static dyn Family> {
    let first = config.axes_of_bus(bus).next().filter(|_| config.is_serial_line(bus))?;
    Some(of(&first.drive))
}

/// From one report of each drive of a serial line to the next, at the longest.
pub fn line_report_ns(config: &Config, bus: usize) -> Option<u64> {
    let budgets = config.axes_of_bus(bus).filter_map(|axis| of(&axis.drive).off_cycle_budget(axis, config));
    budgets.map(|budget| budget.report_ns).max().filter(|_| config.is_serial_line(bus))
}

/// A protocol of the vendor that a drive may speak instead of CANopen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherProtocol {
    /// Its name.
    pub name: &'static str,
    /// A request that changes nothing in the drive.
    pub request: Frame,
    /// The identifier of the reply.
    pub answer: Id,
    /// What to do with a drive that answers it.
    pub cure: &'static str,
}

/// The quirks of the SDO server of a drive, with this timing; the drive gets at least the time to answer that its data sheet
/// says.
pub(crate) fn sdo_quirks(drive: &DriveFamily, mut timing: SdoTiming) -> SdoQuirks {
    let family = of(drive);
    if let Some(reply_ns) = family.data_sheet(drive).and_then(DataSheet::sdo_reply_ns) {
        timing.reply_timeout_ns = timing.reply_timeout_ns.max(2 * reply_ns);
    }
    let own = family.sdo_quirks();
    let is_silent = family.data_sheet(drive).is_some_and(DataSheet::is_silent_if_absent);
    SdoQuirks { timing, is_silent_if_absent: own.is_silent_if_absent || is_silent, ..own }
}

/// Every identifier between a drive and its master: those of its frames, and those of another protocol that it may speak.
pub(crate) fn identifiers(family: &DriveFamily, node: u8) -> Vec<Id> {
    let own = family.frame_identifiers(node).into_iter().map(|(id, _)| id);
    let other = of(family).other_protocol(family, node);
    own.chain(other.into_iter().flat_map(|other| [other.request.id(), other.answer])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_family_uses_the_identifiers_of_its_own_protocol_beside_those_of_canopen() {
        let erob = identifiers(&EROB_CANOPEN, 2);
        for id in [0x082, 0x182, 0x202, 0x582, 0x602, 0x642, 0x5C2, 0x702] {
            assert!(erob.contains(&Id::base(id).unwrap()), "{id:03X}");
        }
        let yz_aim = identifiers(&YZ_AIM, 2);
        assert!(yz_aim.contains(&Id::base(0x582).unwrap()) && !yz_aim.contains(&Id::base(0x642).unwrap()));
        assert_eq!(identifiers(&EROB_CANOPEN, 64).len(), 14, "there they are those of other nodes");
    }
}
