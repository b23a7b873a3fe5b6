//! A drive as its data sheet (EDS or DCF) describes it, with the quirks that are known of it.

use std::f64::consts::TAU;
use std::path::Path;

use takt_rt::{
    Cia402Codec, Id, MAX_NODE_AXES, MAX_OBJECTS, MappedObject, Nanoseconds, OperationMode, PositionCounter,
    StoppedHeartbeat,
};
use takt_wire::canopen::eds::{AccessType, DictionaryEntry, ObjectDictionary, ValueKind};
use takt_wire::canopen::object::{DataType, Object, ObjectAddress};
use takt_wire::canopen::objects::{
    CONSUMER_HEARTBEAT_TIME, CONTROLWORD, GUARD_TIME, LIFE_TIME_FACTOR, MAX_MOTOR_SPEED, MODES_OF_OPERATION,
    POSITION_ACTUAL_VALUE, PRODUCER_HEARTBEAT_TIME, PROFILE_ACCELERATION, PROFILE_VELOCITY, PdoDirection,
    PdoParameters, STATUSWORD,
};
use takt_wire::quirks::{MotionUnit, NamedObject, Quirks};

use crate::config::{Control, DriveFacts, ErrorControl, Identity, ModeSet, Plausible, VelocityUnit};
use crate::family::DataSheet;
use crate::family::bring_up::first_pdo;
use crate::family::commission::profile::objects::HOMING_METHOD;

/// A data sheet, the quirks of the drive, and which of its axes is meant.
#[derive(Clone, Debug)]
pub struct Device {
    /// The axis, 1 for the first or only one. Its objects stand 0x800 higher for each axis before it, and its PDOs 64 further (CiA
    /// 402-2, multi-axis devices). Every object is named here as that of the first axis.
    pub node_axis: u8,
    /// The object dictionary of the data sheet.
    pub dictionary: ObjectDictionary,
    /// In what the drive deviates from it.
    pub quirks: Quirks,
}

const DEVICE_TYPE: ObjectAddress = ObjectAddress::new(0x1000, 0);
const VENDOR: ObjectAddress = ObjectAddress::new(0x1018, 1);
const PRODUCT: ObjectAddress = ObjectAddress::new(0x1018, 2);
const SUPPORTED_MODES: ObjectAddress = ObjectAddress::new(0x6502, 0);
const ENCODER_INCREMENTS: ObjectAddress = ObjectAddress::new(0x608F, 1);
const ENCODER_REVOLUTIONS: ObjectAddress = ObjectAddress::new(0x608F, 2);
const POSITION_RANGE_LOWEST: ObjectAddress = ObjectAddress::new(0x607B, 1);
const POSITION_RANGE_HIGHEST: ObjectAddress = ObjectAddress::new(0x607B, 2);
const FEED: ObjectAddress = ObjectAddress::new(0x6092, 1);
const FEED_REVOLUTIONS: ObjectAddress = ObjectAddress::new(0x6092, 2);
const VELOCITY_NUMERATOR: ObjectAddress = ObjectAddress::new(0x6096, 1);
const VELOCITY_DIVISOR: ObjectAddress = ObjectAddress::new(0x6096, 2);
const INTERPOLATION_DATA: ObjectAddress = ObjectAddress::new(0x60C1, 1);
const VELOCITY_UNIT: ObjectAddress = ObjectAddress::new(0x60A9, 0);

/// The modes that takt commands, each with the object of its target.
const TARGETS: [(OperationMode, u16); 7] = [
    (OperationMode::CyclicSynchronousPosition, 0x607A),
    (OperationMode::CyclicSynchronousVelocity, 0x60FF),
    (OperationMode::CyclicSynchronousTorque, 0x6071),
    (OperationMode::InterpolatedPosition, 0x60C1),
    (OperationMode::ProfilePosition, 0x607A),
    (OperationMode::ProfileVelocity, 0x60FF),
    (OperationMode::ProfileTorque, 0x6071),
];

/// Modes with an object that no other mode has. The cyclic synchronous ones have none, so they are never assumed.
const MARKS: [(OperationMode, u16); 4] = [
    (OperationMode::InterpolatedPosition, 0x60C1),
    (OperationMode::ProfilePosition, 0x6081),
    (OperationMode::ProfileVelocity, 0x60FF),
    (OperationMode::ProfileTorque, 0x6087),
];

impl Device {
    /// Reads the data sheet, and the quirks if there is a file of them.
    ///
    /// # Errors
    /// In words for the reader of a configuration: the file, the line, what is wrong.
    pub fn load(eds: &Path, quirks: Option<&Path>) -> Result<Self, String> {
        let loaded = takt_wire::canopen::eds::load(eds).map_err(|findings| findings.to_string())?;
        let quirks = match quirks {
            Some(path) => crate::config::quirks::load(path).map_err(|error| error.to_string())?,
            None => Quirks::default(),
        };
        Self { node_axis: 1, dictionary: loaded.dictionary, quirks }.of_axis(1)
    }

    /// Reads the texts of a data sheet and of a file of quirks.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(eds: &str, quirks: &str) -> Result<Self, String> {
        let loaded = takt_wire::canopen::eds::parse("data sheet", eds.as_bytes())
            .map_err(|findings| findings.to_string())?;
        let quirks = crate::config::quirks::parse("quirks", quirks).map_err(|error| error.to_string())?;
        Self { node_axis: 1, dictionary: loaded.dictionary, quirks }.of_axis(1)
    }

    /// The same drive, another of its axes.
    ///
    /// # Errors
    /// In words for the reader of a configuration: what the data sheet lacks of this axis.
    pub fn of_axis(self, node_axis: u8) -> Result<Self, String> {
        let device = Self { node_axis, ..self };
        let needed = [CONTROLWORD, STATUSWORD, MODES_OF_OPERATION, POSITION_ACTUAL_VALUE];
        match needed.into_iter().find(|object| !device.has(object)) {
            Some(object) if node_axis == 1 => {
                Err(format!("the data sheet has no {object}, which every CiA 402 drive needs"))
            }
            Some(object) => Err(format!(
                "the data sheet has no axis {node_axis}: it lacks {}, the {} of that axis",
                of_axis(object.address, node_axis),
                object.name
            )),
            None if device.modes().0 == 0 => {
                Err("the data sheet has no target (607A, 60FF, 6071) of a mode that takt commands".to_owned())
            }
            None => Ok(device),
        }
    }

    /// What the data sheet says of an object; `None` if the drive lacks it.
    pub fn entry(&self, address: ObjectAddress) -> Option<&DictionaryEntry> {
        let address = of_axis(address, self.node_axis);
        self.dictionary.entry(address).filter(|_| !self.quirks.is_missing(address))
    }

    /// Returns the number of axes that the data sheet describes.
    pub fn axes(&self) -> u8 {
        let has = |node_axis: &u8| {
            let controlword = of_axis(CONTROLWORD.address, *node_axis);
            self.dictionary.entry(controlword).is_some()
        };
        (1..=MAX_NODE_AXES).take_while(has).last().unwrap_or(0)
    }

    /// The number of the first PDO of the axis, counted from 1.
    pub const fn first_pdo(&self) -> u16 {
        first_pdo(self.node_axis)
    }

    /// Returns `true` if the drive has an object.
    pub fn has(&self, object: &Object) -> bool {
        self.entry(object.address).is_some()
    }

    /// Returns `true` if the drive lets an object be written.
    pub fn is_writable(&self, address: ObjectAddress) -> bool {
        let writable = |entry: &DictionaryEntry| {
            matches!(
                entry.access,
                AccessType::ReadWrite
                    | AccessType::WriteOnly
                    | AccessType::ReadWriteRead
                    | AccessType::ReadWriteWrite
            )
        };
        self.entry(address).is_some_and(writable)
            && !self.quirks.is_constant(of_axis(address, self.node_axis))
    }

    /// Returns `true` if a PDO can carry an object.
    pub fn is_mappable(&self, address: ObjectAddress) -> bool {
        self.entry(address).is_some_and(|entry| entry.is_mappable)
    }

    /// Returns the number of PDOs of a direction, of the first four of the axis.
    pub(crate) fn pdo_slots(&self, direction: PdoDirection) -> u8 {
        let has_slot = |number: &u8| {
            let parameters = PdoParameters::at(direction, self.first_pdo() + u16::from(*number) - 1);
            let has = |object: Object| self.dictionary.object(object.address.index).is_some();
            has(parameters.cob_id()) && has(parameters.mapped_count())
        };
        (1..=4).take_while(has_slot).last().unwrap_or(0)
    }

    /// Returns the number of objects that one of the first RPDOs can map, by the sub-indices that its mapping has.
    pub fn mappable_objects(&self, number: u8) -> usize {
        if number > self.pdo_slots(PdoDirection::Receive) {
            return 0;
        }
        let parameters = PdoParameters::of(PdoDirection::Receive, number);
        let has = |position: &u8| self.entry(parameters.mapped_object(*position).address).is_some();
        (1..=MAX_OBJECTS as u8).take_while(has).count()
    }

    /// The first object that the first PDO of a direction carries by the data sheet.
    pub fn first_mapped(&self, direction: PdoDirection) -> Option<ObjectAddress> {
        let first = self.number(PdoParameters::at(direction, self.first_pdo()).mapped_object(1).address)?;
        Some(ObjectAddress::new((first >> 16) as u16, (first >> 8) as u8))
    }

    /// The identifier of a PDO by the data sheet, for a drive with this node ID; `None` if it gives none.
    pub fn pdo_id(&self, direction: PdoDirection, number: u16, node: u8) -> Option<Id> {
        let cob_id = PdoParameters::at(direction, number).cob_id().address;
        let value = self.entry(cob_id)?.value()?.number(Some(node))?;
        Id::base((value & 0x7FF) as u32).ok().filter(|id| id.value() != 0)
    }

    /// The value that an object has by the data sheet, or by the configuration of a DCF.
    pub fn number(&self, address: ObjectAddress) -> Option<i64> {
        let value = self.entry(address)?.value()?.number(self.dictionary.commissioned_node())?;
        i64::try_from(value).ok()
    }

    /// The counts that the drive reports as its position, where the data sheet bounds them (607B, position range limit).
    fn position_counter(&self) -> Option<PositionCounter> {
        let limit = |address| i32::try_from(self.number(address)?).ok();
        PositionCounter::new(limit(POSITION_RANGE_LOWEST)?, limit(POSITION_RANGE_HIGHEST)?)
    }

    fn ratio(&self, numerator: ObjectAddress, divisor: ObjectAddress) -> Option<f64> {
        let (numerator, divisor) = (self.number(numerator)?, self.number(divisor).unwrap_or(1));
        (numerator > 0 && divisor > 0).then(|| numerator as f64 / divisor as f64)
    }

    /// Counts of one turn of the reported position: by the quirks, by the feed constant (6092), or else by the resolution of the
    /// encoder (608F).
    pub fn counts_per_turn(&self) -> Option<f64> {
        let told = self.quirks.counts_per_turn;
        told.or_else(|| self.counts_by_objects())
    }

    fn counts_by_objects(&self) -> Option<f64> {
        self.ratio(FEED, FEED_REVOLUTIONS).or_else(|| self.ratio(ENCODER_INCREMENTS, ENCODER_REVOLUTIONS))
    }

    /// The modes: those of the quirks, or of object 6502, or, where neither tells, those that have an object of their own. Only those
    /// count that takt commands, and whose target the drive has; interpolated position only if a PDO can carry its target.
    pub fn modes(&self) -> ModeSet {
        let stated = self.number(SUPPORTED_MODES).and_then(|bits| u32::try_from(bits).ok());
        let has = |index: u16| {
            let address = of_axis(ObjectAddress::new(index, 0), self.node_axis);
            self.dictionary.object(address.index).is_some() && !self.quirks.is_missing(address)
        };
        let having = |objects: &[(OperationMode, u16)]| {
            let modes = objects.iter().filter(|(_, index)| has(*index));
            ModeSet::of(&modes.map(|(mode, _)| *mode).collect::<Vec<_>>())
        };
        let told = match (&self.quirks.modes, stated.filter(|bits| *bits != 0)) {
            (Some(modes), _) => ModeSet::of(modes),
            (None, Some(bits)) => ModeSet(bits),
            (None, None) => having(&MARKS),
        };
        let told = told.0 | ModeSet::of(&self.quirks.undeclared_modes).0;
        let interpolated = ModeSet::of(&[OperationMode::InterpolatedPosition]).0;
        let targets = having(&TARGETS).0;
        let targets = match self.quirks.interpolation_target {
            Some(target) if self.is_mappable(target) => targets | interpolated,
            None if self.entry(INTERPOLATION_DATA).is_none_or(|data| data.is_mappable) => targets,
            _ => targets & !interpolated,
        };
        ModeSet(told & targets)
    }

    /// The unit of a velocity or an acceleration object by the quirks, if they tell.
    fn unit_by_quirks(&self, index: u16) -> Option<VelocityUnit> {
        Some(match self.quirks.unit(index)? {
            MotionUnit::PositionUnits(factor) => VelocityUnit::Counts(factor),
            MotionUnit::RevolutionsPerMinute(factor) => VelocityUnit::RevolutionsPerMinute(factor),
        })
    }

    /// The unit of velocities: by the quirks, by the SI unit (60A9), or by the velocity factor (6096), or else counts per second.
    fn velocity_unit(&self) -> VelocityUnit {
        let by_quirks = self.unit_by_quirks(0x60FF).or(self.unit_by_quirks(0x606C));
        let by_si = || si_velocity_unit(u32::try_from(self.number(VELOCITY_UNIT)?).ok()?);
        let by_factor =
            || Some(VelocityUnit::Counts(1.0 / self.ratio(VELOCITY_NUMERATOR, VELOCITY_DIVISOR)?));
        by_quirks.or_else(by_si).or_else(by_factor).unwrap_or(VelocityUnit::Counts(1.0))
    }

    /// Returns `true` if the controller can map the PDOs: the mapping of the first RPDO of the axis and that of its first TPDO are
    /// writable.
    fn is_mapped_freely(&self) -> bool {
        [PdoDirection::Receive, PdoDirection::Transmit].into_iter().all(|direction| {
            let parameters = PdoParameters::at(direction, self.first_pdo());
            self.is_writable(parameters.mapped_count().address)
        })
    }

    /// What the drive has for error control: the heartbeat before node guarding, since it asks less of the bus.
    pub(super) fn error_control(&self) -> ErrorControl {
        // What cannot be written and is not known is as good as absent.
        let fixed = |address| match self.is_writable(address) {
            true => None,
            false => Some(self.number(address).unwrap_or(0)),
        };
        let is_usable = |address| self.entry(address).is_some() && fixed(address) != Some(0);
        let (heartbeat, guard_time, life_time) =
            (PRODUCER_HEARTBEAT_TIME.address, GUARD_TIME.address, LIFE_TIME_FACTOR.address);
        if is_usable(heartbeat) {
            let fixed_ms = fixed(heartbeat).and_then(|ms| u16::try_from(ms).ok());
            ErrorControl::Heartbeat { fixed_ms }
        } else if is_usable(guard_time) && is_usable(life_time) {
            ErrorControl::Guarding {
                fixed_guard_time_ms: fixed(guard_time).and_then(|ms| u16::try_from(ms).ok()),
                fixed_life_time_factor: fixed(life_time).and_then(|factor| u8::try_from(factor).ok()),
            }
        } else {
            ErrorControl::None
        }
    }

    /// Returns `true` if the drive can be made to watch the heartbeat of the controller.
    pub(super) fn consumes_heartbeat(&self) -> bool {
        self.is_writable(CONSUMER_HEARTBEAT_TIME.address)
    }

    /// What is known of the drive.
    pub fn facts(&self, standard: DriveFacts) -> DriveFacts {
        let modes = self.modes();
        let device = &self.dictionary.device;
        let number = |address| {
            self.number(address).and_then(|value| u32::try_from(value).ok()).filter(|value| *value != 0)
        };
        let usual = [
            Control::Position,
            Control::Interpolated,
            Control::ProfilePosition,
            Control::ProfileVelocity,
            Control::ProfileTorque,
        ];
        let Quirks { plausible, keeps_empty_limits, bit_rates, .. } = self.quirks;
        let stopped_heartbeat = match self.quirks.shows_alarm_in_heartbeat {
            true => StoppedHeartbeat::Alarm,
            false => standard.codec.stopped_heartbeat,
        };
        DriveFacts {
            identity: Identity {
                device_type: number(DEVICE_TYPE),
                vendor: device.vendor_number.filter(|number| *number != 0).or(number(VENDOR)),
                product: device.product_number.filter(|number| *number != 0).or(number(PRODUCT)),
                revision: None,
            },
            counts_per_turn: self.counts_per_turn(),
            counter: self.position_counter().unwrap_or(standard.counter),
            velocity_unit: self.velocity_unit(),
            profile_velocity_unit: self.unit_by_quirks(PROFILE_VELOCITY.address.index),
            acceleration_unit: self.unit_by_quirks(PROFILE_ACCELERATION.address.index),
            motor_speed_unit: self
                .unit_by_quirks(MAX_MOTOR_SPEED.address.index)
                .unwrap_or(standard.motor_speed_unit),
            modes,
            usual_mode: usual
                .into_iter()
                .find(|control| modes.contains(control.operation_mode()))
                .unwrap_or(Control::Position),
            interpolation_target: self
                .quirks
                .interpolation_target
                .or(self.is_mappable(INTERPOLATION_DATA).then_some(INTERPOLATION_DATA))
                .map_or(standard.interpolation_target, |target| {
                    MappedObject::new(target.index, target.subindex, 32)
                }),
            has_fixed_process_data: !self.is_mapped_freely(),
            reports_mode: self.is_mappable(ObjectAddress::new(0x6061, 0)),
            node_axis: self.node_axis,
            error_control: self.error_control(),
            consumes_heartbeat: self.consumes_heartbeat(),
            sends_emergencies: self.entry(ObjectAddress::new(0x1014, 0)).is_some(),
            empty_software_limits_are_off: !keeps_empty_limits,
            bit_rates: if bit_rates.is_empty() { standard.bit_rates } else { bit_rates },
            codec: Cia402Codec { stopped_heartbeat, ..standard.codec },
            plausible: Plausible {
                fastest_turns_per_s: plausible.fastest_per_s.unwrap_or(f64::INFINITY),
                usual_velocity: plausible.usual_per_s.map_or(f64::INFINITY, |turns| turns * TAU),
                inner_gear_from: plausible.inner_gear_from,
            },
            ..standard
        }
    }
}

impl DataSheet for Device {
    fn has(&self, address: ObjectAddress) -> bool {
        self.entry(address).is_some()
    }

    fn name(&self, address: ObjectAddress) -> Option<&str> {
        self.entry(address).map(|entry| entry.name.as_str())
    }

    fn is_writable(&self, address: ObjectAddress) -> bool {
        Self::is_writable(self, address)
    }

    fn data_type(&self, address: ObjectAddress) -> Option<DataType> {
        let data_type = self.entry(address)?.data_type?;
        let of_kind = match data_type.kind() {
            ValueKind::Unsigned(_) => DataType::U8,
            ValueKind::Signed(_) => DataType::I8,
            ValueKind::Real(_) | ValueKind::Text | ValueKind::Bytes | ValueKind::Other => return None,
        };
        // A BOOLEAN is sent as a byte.
        of_kind.of_length(usize::from(data_type.bits()?).div_ceil(8))
    }

    fn adds_mode(&self, mode: OperationMode) -> bool {
        let tells = self.number(SUPPORTED_MODES).is_some_and(|bits| bits != 0);
        match (&self.quirks.modes, mode) {
            _ if self.quirks.undeclared_modes.contains(&mode) => true,
            (Some(modes), _) => modes.contains(&mode),
            (None, OperationMode::Homing) => !tells && self.has(&HOMING_METHOD),
            (None, mode) => !tells && self.modes().contains(mode),
        }
    }

    fn own_errors(&self) -> &[(u16, String)] {
        &self.quirks.errors
    }

    fn own_cure(&self, code: u16) -> Option<&'static str> {
        self.quirks.cures.iter().find(|(known, _)| *known == code).map(|(_, cure)| *cure)
    }

    fn named(&self) -> &[NamedObject] {
        &self.quirks.named
    }

    fn temperature(&self) -> Option<Object> {
        let address = self.quirks.temperature?;
        Some(Object { address, data_type: self.data_type(address)?, name: "temperature" })
    }

    fn lacks_switches(&self) -> bool {
        self.quirks.lacks_switches
    }

    fn is_silent_if_absent(&self) -> bool {
        self.quirks.is_silent_if_absent
    }

    fn storing_ns(&self) -> Option<Nanoseconds> {
        self.quirks.delays.save_ns
    }

    fn sdo_reply_ns(&self) -> Option<Nanoseconds> {
        self.quirks.delays.sdo_reply_ns
    }
}

/// The object of an axis that corresponds to this one of the first axis.
fn of_axis(address: ObjectAddress, node_axis: u8) -> ObjectAddress {
    let object = MappedObject::new(address.index, address.subindex, 0).of_node_axis(node_axis);
    ObjectAddress::new(object.index, object.subindex)
}

/// A velocity by its SI unit (CiA 303-2): the power of ten in the highest byte, the numerator and the divisor in the next ones.
/// 0xB4 is a revolution, 0xB5 an increment, 0x03 a second, 0x47 a minute.
fn si_velocity_unit(unit: u32) -> Option<VelocityUnit> {
    let [exponent, numerator, divisor, _] = unit.to_be_bytes();
    let factor = 10_f64.powi(i32::from(exponent as i8));
    match (numerator, divisor) {
        (0xB4, 0x47) => Some(VelocityUnit::RevolutionsPerMinute(factor)),
        (0xB4, 0x03) => Some(VelocityUnit::RevolutionsPerMinute(60.0 * factor)),
        (0xB5, 0x03) => Some(VelocityUnit::Counts(factor)),
        _ => None,
    }
}
