//! Builds lists of steps, and computes numbers that every family needs.

use std::f64::consts::TAU;

use takt_rt::Nanoseconds;

use super::bring_up::BringUpTiming;
use super::step::{Action, Check, Condition, Fact, ProcedureStep, ReadBack, ValueSource};
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::Object;
use crate::canopen::objects::{self, PDO_IDENTITY, PdoParameters};
use crate::config::{Axis, Config, Travel};

const PROFILE_CIA402: u16 = 402;

/// Turns of the drive's encoder for a distance (rad, m), or turns per second for a velocity.
pub(super) fn turns(axis: &Axis, distance: f64) -> f64 {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    (distance / travel_per_turn * axis.gear_ratio).abs()
}

/// Counts for a distance (rad, m), a velocity or an acceleration: at least 1, at most the range of 32 bits.
pub(super) fn counts(axis: &Axis, distance: f64) -> i64 {
    (turns(axis, distance) * axis.counts_per_turn).round().clamp(1.0, u32::MAX.into()) as i64
}

pub(super) fn rounded_up(ns: Nanoseconds, unit_ns: Nanoseconds) -> i64 {
    i64::try_from(ns.div_ceil(unit_ns)).unwrap_or(i64::MAX)
}

/// A state is not waited for when the drive reports it less often than this: Ctrl-C would take as long.
const LONGEST_AWAITED_HEARTBEAT_NS: Nanoseconds = 1_000_000_000;

/// The value of object 1016:1: the master's node ID and heartbeat timeout; 0 without a master heartbeat.
pub(super) fn watched_heartbeat(config: &Config) -> i64 {
    config.master.heartbeat_ns.map_or(0, |_| {
        let timeout_ms = rounded_up(config.master.heartbeat_timeout_ns, 1_000_000).min(u16::MAX.into());
        i64::from(config.master.node) << 16 | timeout_ms
    })
}

/// A list of steps under construction. New steps get the name and the remedy that were set last.
pub(super) struct StepList {
    pub steps: Vec<ProcedureStep>,
    name: &'static str,
    advice: &'static str,
    pub condition: Condition,
}

impl StepList {
    pub fn new(name: &'static str, advice: &'static str) -> Self {
        Self { steps: vec![], name, advice, condition: Condition::Always }
    }

    pub fn begin(&mut self, name: &'static str, advice: &'static str) {
        (self.name, self.advice) = (name, advice);
    }

    pub fn push(&mut self, action: Action) {
        self.steps.push(ProcedureStep {
            name: self.name,
            advice: self.advice,
            condition: self.condition,
            action,
        });
    }

    pub fn nmt(
        &mut self,
        command: NmtCommand,
        awaited: Option<NmtState>,
        within_ns: Nanoseconds,
        repeat_ns: Nanoseconds,
    ) {
        self.push(Action::Nmt { command, awaited, within_ns, repeat_ns });
    }

    /// See [`Action::WakeUp`].
    pub fn wake_up(&mut self, command: NmtCommand) {
        self.push(Action::WakeUp { command });
    }

    /// Commands a state that the drive's heartbeat must report, if it has one that comes soon.
    pub fn nmt_reported(
        &mut self,
        command: NmtCommand,
        state: NmtState,
        axis: &Axis,
        timing: &BringUpTiming,
    ) {
        let soon_ns = axis.heartbeat_ns.filter(|period_ns| *period_ns <= LONGEST_AWAITED_HEARTBEAT_NS);
        let (period_ns, awaited) = (soon_ns.unwrap_or(0), soon_ns.map(|_| state));
        let within_ns = timing.confirm_timeout_ns.saturating_add(period_ns.saturating_mul(3));
        self.nmt(command, awaited, within_ns, within_ns / 3);
    }

    pub fn read(&mut self, object: Object, check: Check, keep: Fact) {
        self.push(Action::Read { object, check, keep: Some(keep), is_optional: false });
    }

    pub fn read_optional(&mut self, object: Object, keep: Fact) {
        self.push(Action::Read { object, check: Check::Any, keep: Some(keep), is_optional: true });
    }

    /// Writes the axis' configuration file (`dcf`). It comes first, so that what the controller needs overrides it.
    pub fn configuration_file(&mut self, axis: &Axis) {
        self.begin(
            "configuration file",
            "the file named by `dcf` does not suit this drive: correct it there, or leave the object out",
        );
        for download in axis.dcf.iter().flat_map(|configuration| &configuration.downloads) {
            self.push(Action::WriteBytes(download.clone()));
        }
    }

    /// Checks the drive's identity against the configuration.
    pub fn identity(&mut self, axis: &Axis) {
        self.begin(
            "identity",
            "another drive than configured answers under this node ID: check the wiring and the node IDs, or correct \
             `identity` in the configuration",
        );
        let expected = |value: Option<u32>| value.map_or(Check::Any, |value| Check::Equals(value.into()));
        let device_type = axis.identity.device_type;
        let profile = device_type.map_or(Check::Profile(PROFILE_CIA402), |value| Check::Equals(value.into()));
        self.read(objects::DEVICE_TYPE, profile, Fact::DeviceType);
        self.read(objects::VENDOR_ID, expected(axis.identity.vendor), Fact::VendorId);
        self.read(objects::PRODUCT_CODE, expected(axis.identity.product), Fact::ProductCode);
        self.read(objects::REVISION_NUMBER, expected(axis.identity.revision), Fact::RevisionNumber);
    }

    /// Reads the drive's PDO configuration, and takes the process data from it.
    pub fn reported_process_data(&mut self) {
        self.begin("PDO mapping", "the drive's own mapping does not suit this axis");
        self.push(Action::ReadProcessData);
    }

    pub fn write_with(&mut self, object: Object, value: i64, read_back: ReadBack, is_optional: bool) {
        self.push(Action::Write { object, value: ValueSource::Value(value), read_back, is_optional });
    }

    pub fn write(&mut self, object: Object, value: i64) {
        self.write_with(object, value, ReadBack::No, false);
    }

    pub fn write_and_read_back(&mut self, object: Object, value: i64) {
        self.write_with(object, value, ReadBack::EXACT, false);
    }

    pub fn write_optional(&mut self, object: Object, value: i64) {
        self.write_with(object, value, ReadBack::No, true);
    }

    /// Writes a setting of the drive that the configuration file of the axis may have otherwise: the file wins.
    pub fn write_unless_in_file(&mut self, axis: &Axis, object: Object, value: i64) {
        let mut downloads = axis.dcf.iter().flat_map(|file| &file.downloads);
        if !downloads.any(|download| download.object == object.address) {
            self.write_optional(object, value);
        }
    }

    pub fn write_cob_id(&mut self, parameters: PdoParameters, value: u32) {
        self.write_with(parameters.cob_id(), value.into(), ReadBack::Masked(PDO_IDENTITY), false);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn commanded(heartbeat_ns: Option<u64>) -> Action {
        let mut config = Config::load(Path::new("configs/single-erob.toml")).unwrap();
        config.axes[0].heartbeat_ns = heartbeat_ns;
        let mut list = StepList::new("start", "");
        let timing = BringUpTiming::default();
        list.nmt_reported(NmtCommand::Start, NmtState::Operational, &config.axes[0], &timing);
        list.steps.remove(0).action
    }

    #[test]
    fn a_state_is_waited_for_unless_its_drive_reports_it_once_in_a_minute() {
        let awaited = |action| match action {
            Action::Nmt { awaited, within_ns, .. } => (awaited, within_ns),
            other => panic!("{other:?}"),
        };
        let (state, within_ns) = awaited(commanded(Some(100_000_000)));
        assert_eq!(state, Some(NmtState::Operational));
        assert!(within_ns > 300_000_000, "{within_ns}");
        for heartbeat_ns in [None, Some(60_000_000_000)] {
            let (state, within_ns) = awaited(commanded(heartbeat_ns));
            assert_eq!(state, None);
            assert_eq!(within_ns, BringUpTiming::default().confirm_timeout_ns);
        }
    }
}
