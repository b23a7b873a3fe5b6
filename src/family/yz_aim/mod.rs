//! YZ-AIM integrated servos, CANopen edition (manual v1.62, and field experience).
//!
//! The PDO mapping is fixed. The drive has no mode display (6061) and no emergency messages, and it does not answer SDO
//! requests for unknown objects.

mod alarm;
mod facts;
mod process_data;

pub use alarm::{Alarm, Clearing};
pub use facts::{CODEC, FACTS, HIGHEST_SPEED_RPM, INTERPOLATION_PERIOD_NS};
pub(crate) use process_data::answers_sync;

use takt_rt::Frame;

use super::{CarryingOut, Family, MappingMatch};
use crate::canopen::object::Object;
use crate::commission::dictionary::ObjectEntry;
use crate::commission::{SdoQuirks, SdoSession, TargetDrive, Task, yz_aim as commissioning};
use crate::config::{Axis, Config, ConfiguredFamily, DriveFamily, FamilyKeys};
use crate::drive::{BringUpTiming, ProcedureStep, ProcessData, yz_aim};
use crate::sim::Drive;
use crate::sim::yz_aim::{YzAimJoint, YzAimParameters};

/// The family.
#[derive(Clone, Copy, Debug)]
pub struct YzAim;

impl ConfiguredFamily for YzAim {
    fn word(&self) -> &'static str {
        FACTS.word
    }

    fn read(&self, _: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        Some(super::YZ_AIM)
    }
}

impl Family for YzAim {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(super::YZ_AIM)
    }

    fn process_data(&self, axis: &Axis) -> ProcessData {
        process_data::fixed(axis)
    }

    fn mapping_match(&self) -> MappingMatch {
        MappingMatch::ByNumber
    }

    fn configure(&self, config: &Config, axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
        yz_aim::configure(config, axis, timing)
    }

    fn start(&self, axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
        yz_aim::start(axis, timing)
    }

    fn shut_down(&self, axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
        yz_aim::shut_down(axis, timing)
    }

    fn error_words(&self, code: u16) -> String {
        format!("alarm {}", Alarm::of(code))
    }

    fn error_cure(&self, code: u16) -> Option<&'static str> {
        Some(Alarm::of(code).advice().unwrap_or(super::error_words::UNKNOWN))
    }

    /// A YZ-AIM drops requests that overlap or follow too soon, and shortens its replies.
    fn sdo_quirks(&self) -> SdoQuirks {
        SdoQuirks { gap_ns: 2_000_000, has_short_replies: true, ..SdoQuirks::standard() }
    }

    fn objects(&self) -> &'static [ObjectEntry] {
        commissioning::OBJECTS
    }

    fn meaning(&self, object: &Object, value: i64) -> Option<String> {
        commissioning::meaning(object, value)
    }

    fn process_data_words(&self, target: &TargetDrive, frame: &Frame) -> Option<String> {
        commissioning::process_data_words(target, frame)
    }

    fn carry_out<'a>(
        &'a self,
        session: &'a SdoSession,
        target: &'a TargetDrive,
        task: Task,
    ) -> CarryingOut<'a> {
        Box::pin(commissioning::carry_out(session, target, task))
    }

    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        let bit_rate = config.buses.get(axis.bus).map_or(1_000_000, |bus| bus.bit_rate);
        Box::new(YzAimJoint::new(YzAimParameters::of(axis, bit_rate, &config.simulation)))
    }
}
