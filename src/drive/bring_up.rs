//! Brings drives up and shuts them down, all axes of all buses in parallel.
//!
//! [`BringUp`] has two stages. [`Stage::Configure`] leaves every drive in NMT pre-operational, without torque, with its
//! PDO mapping and mode set, and its target at the actual position. Then [`BringUp::start`] begins [`Stage::Start`],
//! which makes the nodes operational; after that SYNC may begin. [`Shutdown`] follows the last motion.
//!
//! There is no input and output here: [`BringUp::poll`] returns frames, [`BringUp::receive`] takes them. Both may be
//! called at any rate. Each drive has at most one SDO transfer under way.
//!
//! If the configuration gives the master a heartbeat, the drives monitor it from the end of [`Stage::Configure`] on.
//! The caller sends it from before the bring-up until [`Shutdown`] is done, also after a failed bring-up.

use takt_rt::{Frame, Nanoseconds};

use super::axis_run::{AxisRun, Policy};
use super::facts::AxisFacts;
use super::failure::{AxisFailure, BringUpError};
use super::step::{Action, ProcedureStep, ValueSource};
use crate::canopen::object::ObjectAddress;
use crate::canopen::sdo;
use crate::config::{Axis, Config};
use crate::family;

/// The timeouts of bring-up and shutdown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BringUpTiming {
    /// Timeout of a node's boot-up after a reset. It includes the boot time after power-up (eRob: 8 s).
    pub boot_up_timeout_ns: Nanoseconds,
    /// Interval between two resets of a node that does not boot.
    pub reset_repeat_ns: Nanoseconds,
    /// Timeout of a mode change, a state change or standstill.
    pub confirm_timeout_ns: Nanoseconds,
    /// SDO reply timeout and retries.
    pub sdo: sdo::SdoTiming,
}

impl Default for BringUpTiming {
    fn default() -> Self {
        Self {
            boot_up_timeout_ns: 12_000_000_000,
            // Not a divisor of 8 s: a drive with that boot time would be reset again just after it has booted.
            reset_repeat_ns: 700_000_000,
            confirm_timeout_ns: 2_000_000_000,
            sdo: sdo::SdoTiming::default(),
        }
    }
}

/// The stage of a [`BringUp`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// From any state to pre-operational, configured, without torque.
    Configure,
    /// From there to operational.
    Start,
}

/// The progress of a bring-up or shutdown, for a progress bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BringUpProgress {
    /// 0 to 1.
    pub fraction: f64,
    /// The step of the slowest axis; empty when all axes are done.
    pub step: &'static str,
    /// The slowest axis, an index into the configuration.
    pub axis: usize,
}

/// Brings up every axis of a configuration.
#[derive(Debug)]
pub struct BringUp {
    group: Group,
    start_steps: Vec<Vec<ProcedureStep>>,
    stage: Stage,
}

/// [`BringUp::start`] was called before [`Stage::Configure`] had succeeded, or a second time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the drives are not configured yet, or have already been started")]
pub struct NotConfigured;

/// The steps from any state to configured, without torque.
fn configure(config: &Config, axis: &Axis, timing: &BringUpTiming) -> Vec<ProcedureStep> {
    family::of(&axis.drive).configure(config, axis, timing)
}

/// The objects to which bring-up writes another value than the configuration file of an axis (`dcf`) has for them.
pub fn overwritten(config: &Config, axis: &Axis) -> Vec<ObjectAddress> {
    let Some(file) = &axis.dcf else { return vec![] };
    let steps = configure(config, axis, &BringUpTiming::default());
    let after_file = steps.iter().skip_while(|step| !matches!(step.action, Action::WriteBytes(_)));
    // The last write of each object counts: a PDO is made invalid before it is made valid.
    let mut last: Vec<(ObjectAddress, ValueSource)> = vec![];
    for step in after_file {
        if let Action::Write { object, value, .. } = step.action {
            last.retain(|(address, _)| *address != object.address);
            last.push((object.address, value));
        }
    }
    let is_other = |(address, value): &(ObjectAddress, ValueSource)| {
        let in_file = file.downloads.iter().rev().find(|download| download.object == *address);
        in_file.is_some_and(|download| match value {
            ValueSource::Value(value) => !value.to_le_bytes().starts_with(&download.data),
            ValueSource::ActualPosition => true,
        })
    };
    last.into_iter().filter(is_other).map(|(address, _)| address).collect()
}

impl BringUp {
    /// Begins with [`Stage::Configure`] for every axis. Nothing is sent before [`BringUp::poll`].
    pub fn new(config: &Config) -> Self {
        Self::with_timing(config, BringUpTiming::default())
    }

    /// As [`BringUp::new`], with other timeouts.
    pub fn with_timing(config: &Config, timing: BringUpTiming) -> Self {
        let group = Group::new(config, |axis| {
            let steps = configure(config, axis, &timing);
            let other_protocol = family::of(&axis.drive).other_protocol(axis.node);
            // The first step is the reset; a drive that has restarted does not need it again.
            AxisRun::new(axis, timing.sdo, steps, Policy::RestartFrom(1), other_protocol)
        });
        let start_steps = config.axes.iter().map(|axis| family::of(&axis.drive).start(axis, &timing));
        Self { group, start_steps: start_steps.collect(), stage: Stage::Configure }
    }

    /// Begins [`Stage::Start`]. The outcome is `None` again until this stage is done. Operational nodes wait for SYNC.
    pub fn start(&mut self) -> Result<(), NotConfigured> {
        if self.stage != Stage::Configure || !matches!(self.outcome(), Some(Ok(_))) {
            return Err(NotConfigured);
        }
        self.stage = Stage::Start;
        for (member, steps) in self.group.members.iter_mut().zip(std::mem::take(&mut self.start_steps)) {
            member.run.continue_with(steps, Policy::Strict);
        }
        Ok(())
    }

    /// The current or last stage.
    pub const fn stage(&self) -> Stage {
        self.stage
    }

    /// Advances to `now_ns`, and sends each frame that is due with the index of its bus.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, Frame)) {
        self.group.poll(now_ns, send);
    }

    /// Takes a frame received on the bus with this index. Frames of other nodes are ignored.
    pub fn receive(&mut self, bus: usize, frame: &Frame) {
        self.group.receive(bus, frame);
    }

    /// The progress of the current stage.
    pub fn progress(&self) -> BringUpProgress {
        self.group.progress()
    }

    /// The facts of all drives in the order of the configuration, or all failures; `None` while the current stage runs.
    /// A drive fault does not fail the bring-up: see [`AxisFacts::fault`].
    pub fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>> {
        self.group.outcome()
    }
}

/// Shuts every axis of a configuration down: NMT pre-operational, without torque, heartbeat watchdog off. The cycle
/// should have disabled the axes before; an axis that still has torque is stopped and disabled.
///
/// The master's heartbeat must continue until this is done.
#[derive(Debug)]
pub struct Shutdown {
    group: Group,
}

impl Shutdown {
    /// Prepares the shutdown of every axis. Nothing is sent before [`Shutdown::poll`].
    pub fn new(config: &Config) -> Self {
        Self::with_timing(config, BringUpTiming::default())
    }

    /// As [`Shutdown::new`], with other timeouts.
    pub fn with_timing(config: &Config, timing: BringUpTiming) -> Self {
        let group = Group::new(config, |axis| {
            let steps = family::of(&axis.drive).shut_down(axis, &timing);
            AxisRun::new(axis, timing.sdo, steps, Policy::BestEffort, None)
        });
        Self { group }
    }

    /// Advances to `now_ns`, and sends each frame that is due with the index of its bus.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, Frame)) {
        self.group.poll(now_ns, send);
    }

    /// Takes a frame received on the bus with this index. Frames of other nodes are ignored.
    pub fn receive(&mut self, bus: usize, frame: &Frame) {
        self.group.receive(bus, frame);
    }

    /// The progress.
    pub fn progress(&self) -> BringUpProgress {
        self.group.progress()
    }

    /// The facts of all drives in the order of the configuration, or all failures; `None` while it runs.
    pub fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>> {
        self.group.outcome()
    }
}

/// The axes of a configuration, each with its steps.
#[derive(Debug)]
struct Group {
    members: Vec<Member>,
}

#[derive(Debug)]
struct Member {
    name: String,
    bus: usize,
    bus_name: String,
    node: u8,
    run: AxisRun,
}

impl Group {
    fn new(config: &Config, run_of: impl Fn(&Axis) -> AxisRun) -> Self {
        let members = config.axes.iter().map(|axis| Member {
            name: axis.name.clone(),
            bus: axis.bus,
            bus_name: config.buses.get(axis.bus).map(|bus| bus.name.clone()).unwrap_or_default(),
            node: axis.node,
            run: run_of(axis),
        });
        Self { members: members.collect() }
    }

    fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, Frame)) {
        for Member { bus, run, .. } in &mut self.members {
            run.poll(now_ns, &mut |frame| send(*bus, frame));
        }
    }

    fn receive(&mut self, bus: usize, frame: &Frame) {
        for member in self.members.iter_mut().filter(|member| member.bus == bus) {
            member.run.receive(frame);
        }
    }

    fn progress(&self) -> BringUpProgress {
        let fraction_of = |(done, all): (usize, usize)| if all == 0 { 1.0 } else { done as f64 / all as f64 };
        let open = self.members.iter().enumerate().filter(|(_, member)| !member.run.is_over());
        let slowest = open.min_by_key(|(_, member)| member.run.progress().0);
        let sum: f64 = self.members.iter().map(|member| fraction_of(member.run.progress())).sum();
        BringUpProgress {
            fraction: if slowest.is_none() { 1.0 } else { sum / self.members.len() as f64 },
            step: slowest.and_then(|(_, member)| member.run.step_name()).unwrap_or(""),
            axis: slowest.map_or(0, |(index, _)| index),
        }
    }

    fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>> {
        if self.members.iter().any(|member| !member.run.is_over()) {
            return None;
        }
        let failures: Vec<AxisFailure> =
            self.members.iter().enumerate().filter_map(|(axis, member)| member.failure(axis)).collect();
        Some(if failures.is_empty() {
            Ok(self.members.iter().map(|member| member.run.facts().clone()).collect())
        } else {
            Err(BringUpError { failures })
        })
    }
}

impl Member {
    fn failure(&self, axis: usize) -> Option<AxisFailure> {
        let (step, cause) = self.run.failure()?;
        Some(AxisFailure {
            axis,
            name: self.name.clone(),
            bus: self.bus_name.clone(),
            node: self.node,
            step: step.name,
            cause,
            emergency: self.run.facts().emergency,
            step_advice: step.advice,
        })
    }
}
