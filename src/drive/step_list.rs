//! Writing down a list of steps, and the numbers that every family of drives is given.

use std::f64::consts::TAU;

use takt_rt::Nanoseconds;

use super::bring_up::BringUpTiming;
use super::step::{Action, Check, Fact, ReadBack, Source, Step, When};
use crate::canopen::nmt::{NmtCommand, NmtState};
use crate::canopen::object::Object;
use crate::canopen::objects::{self, PDO_IDENTITY, PdoParameters};
use crate::config::{Axis, Config, Travel};

const PROFILE_CIA402: u16 = 402;

/// Turns of the drive's position for a distance (rad, m), or per second for one per second.
pub(super) fn turns(axis: &Axis, distance: f64) -> f64 {
    let travel_per_turn = match axis.travel {
        Travel::Rotary => TAU,
        Travel::Linear { lead_m } => lead_m,
    };
    (distance / travel_per_turn * axis.gear_ratio).abs()
}

/// A distance (rad, m), or one per second (per second), in counts; at least 1, at most what 32 bits hold.
pub(super) fn counts(axis: &Axis, distance: f64) -> i64 {
    (turns(axis, distance) * axis.counts_per_turn).round().clamp(1.0, u32::MAX.into()) as i64
}

pub(super) fn rounded_up(ns: Nanoseconds, unit_ns: Nanoseconds) -> i64 {
    i64::try_from(ns.div_ceil(unit_ns)).unwrap_or(i64::MAX)
}

/// Object 1016:1 of a drive that is to notice the master's silence; 0 where the master has no heartbeat.
pub(super) fn watched_heartbeat(config: &Config) -> i64 {
    config.master.heartbeat_ns.map_or(0, |_| {
        let timeout_ms = rounded_up(config.master.heartbeat_timeout_ns, 1_000_000).min(u16::MAX.into());
        i64::from(config.master.node) << 16 | timeout_ms
    })
}

/// Steps under construction: each belongs to the subject that was named last.
pub(super) struct List {
    pub steps: Vec<Step>,
    name: &'static str,
    advice: &'static str,
    pub when: When,
}

impl List {
    pub fn new(name: &'static str, advice: &'static str) -> Self {
        Self { steps: vec![], name, advice, when: When::Always }
    }

    pub fn about(&mut self, name: &'static str, advice: &'static str) {
        (self.name, self.advice) = (name, advice);
    }

    pub fn push(&mut self, action: Action) {
        self.steps.push(Step { name: self.name, advice: self.advice, when: self.when, action });
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

    /// See [`Action::Reach`].
    pub fn reach(&mut self, command: NmtCommand) {
        self.push(Action::Reach { command });
    }

    /// Commands a state that the drive's heartbeat, if it has one, must report.
    pub fn nmt_reported(
        &mut self,
        command: NmtCommand,
        state: NmtState,
        axis: &Axis,
        timing: &BringUpTiming,
    ) {
        let period_ns = axis.heartbeat_ns.unwrap_or(0);
        let awaited = axis.heartbeat_ns.map(|_| state);
        let within_ns = timing.confirm_timeout_ns.saturating_add(period_ns.saturating_mul(3));
        self.nmt(command, awaited, within_ns, within_ns / 3);
    }

    pub fn read(&mut self, object: Object, check: Check, keep: Fact) {
        self.push(Action::Read { object, check, keep: Some(keep), is_optional: false });
    }

    pub fn read_optional(&mut self, object: Object, keep: Fact) {
        self.push(Action::Read { object, check: Check::Any, keep: Some(keep), is_optional: true });
    }

    /// What the configuration file of the axis has written: before all that the controller itself needs to be set, so
    /// that this has the last word.
    pub fn configuration_file(&mut self, axis: &Axis) {
        self.about(
            "configuration file",
            "the file named by `dcf` does not suit this drive: correct it there, or leave the object out",
        );
        for download in axis.dcf.iter().flat_map(|configuration| &configuration.downloads) {
            self.push(Action::WriteBytes(download.clone()));
        }
    }

    /// Compares what the drive says of itself with what is configured.
    pub fn identity(&mut self, axis: &Axis) {
        self.about(
            "identity",
            "another drive than configured answers under this node number: check the wiring and the node numbers, or \
             correct `identity` in the configuration",
        );
        let expected = |value: Option<u32>| value.map_or(Check::Any, |value| Check::Equals(value.into()));
        let device_type = axis.identity.device_type;
        let profile = device_type.map_or(Check::Profile(PROFILE_CIA402), |value| Check::Equals(value.into()));
        self.read(objects::DEVICE_TYPE, profile, Fact::DeviceType);
        self.read(objects::VENDOR_ID, expected(axis.identity.vendor), Fact::VendorId);
        self.read(objects::PRODUCT_CODE, expected(axis.identity.product), Fact::ProductCode);
        self.read(objects::REVISION_NUMBER, expected(axis.identity.revision), Fact::RevisionNumber);
    }

    /// Reads how the drive's PDOs are configured, and works with that.
    pub fn reported_process_data(&mut self) {
        self.about("PDO mapping", "the drive's own mapping does not suit this axis");
        self.push(Action::ReadProcessData);
    }

    pub fn write_with(&mut self, object: Object, value: i64, read_back: ReadBack, is_optional: bool) {
        self.push(Action::Write { object, value: Source::Value(value), read_back, is_optional });
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

    pub fn write_cob_id(&mut self, parameters: PdoParameters, value: u32) {
        self.write_with(parameters.cob_id(), value.into(), ReadBack::Masked(PDO_IDENTITY), false);
    }
}
