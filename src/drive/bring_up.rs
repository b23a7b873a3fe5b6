//! Bringing drives up and leaving them, all axes of all buses side by side.
//!
//! [`BringUp`] has two stages. [`Stage::Configure`] leaves every drive pre-operational, without torque, mapped, in its
//! mode, with its target at its actual position. Then [`BringUp::start`] begins [`Stage::Start`], which makes the nodes
//! operational, and SYNC may begin. [`Leave`] is the polite farewell after motion.
//!
//! There is no input and output here: [`BringUp::poll`] hands out frames, [`BringUp::receive`] takes them. Both may be
//! called as often as is convenient; a drive has at most one SDO outstanding.
//!
//! Where the configuration gives the master a heartbeat, the drives watch it from the end of [`Stage::Configure`] on:
//! it must be sent from before the bring-up until [`Leave`] is done, or until a failed bring-up has been left.

use takt_rt::{Frame, Nanoseconds};

use super::axis_run::{AxisRun, Policy};
use super::erob_canopen;
use super::facts::AxisFacts;
use super::failure::{AxisFailure, BringUpError};
use super::step::Step;
use super::yz_aim;
use crate::canopen::sdo;
use crate::config::{Axis, Config, DriveFamily};

/// How long to wait for what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BringUpTiming {
    /// For a node's boot-up after its reset. A drive that has just been powered needs its power-up time (eRob: 8 s).
    pub boot_up_timeout_ns: Nanoseconds,
    /// Between two resets of a node that does not boot.
    pub reset_repeat_ns: Nanoseconds,
    /// For a mode, a state or standstill to be reached.
    pub confirm_timeout_ns: Nanoseconds,
    /// For an SDO reply, and how often to ask again.
    pub sdo: sdo::Timing,
}

impl Default for BringUpTiming {
    fn default() -> Self {
        Self {
            boot_up_timeout_ns: 12_000_000_000,
            // No divisor of whole seconds: a drive that needs eight of them is not reset just when it has booted.
            reset_repeat_ns: 700_000_000,
            confirm_timeout_ns: 2_000_000_000,
            sdo: sdo::Timing::default(),
        }
    }
}

/// How far a [`BringUp`] has been asked to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// From any state to pre-operational, configured, without torque.
    Configure,
    /// From there to operational.
    Start,
}

/// How far a procedure has come, for a progress bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// 0 to 1.
    pub fraction: f64,
    /// What the slowest axis is doing; empty when all is done.
    pub step: &'static str,
    /// The slowest axis, an index into the configuration.
    pub axis: usize,
}

/// Brings every axis of a configuration up.
#[derive(Debug)]
pub struct BringUp {
    group: Group,
    start_steps: Vec<Vec<Step>>,
    stage: Stage,
}

/// [`Stage::Start`] was begun before [`Stage::Configure`] had succeeded, or twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the drives are not configured, or have been started before")]
pub struct NotConfigured;

impl BringUp {
    /// Begins with [`Stage::Configure`] for every axis. Nothing is sent before [`BringUp::poll`].
    pub fn new(config: &Config) -> Self {
        Self::with_timing(config, BringUpTiming::default())
    }

    /// As [`BringUp::new`], with other time-outs.
    pub fn with_timing(config: &Config, timing: BringUpTiming) -> Self {
        let group = Group::new(config, |axis| {
            let (steps, other_protocol) = match axis.drive {
                DriveFamily::ErobCanopen => {
                    (erob_canopen::configure(config, axis, &timing), erob_canopen::other_protocol(axis.node))
                }
                DriveFamily::YzAim => (yz_aim::configure(config, axis, &timing), None),
            };
            // A drive that has restarted has already obeyed the first step, the reset.
            AxisRun::new(axis, timing.sdo, steps, Policy::RestartFrom(1), other_protocol)
        });
        let start_steps = config.axes.iter().map(|axis| match axis.drive {
            DriveFamily::ErobCanopen => erob_canopen::start(axis, &timing),
            DriveFamily::YzAim => yz_aim::start(axis, &timing),
        });
        Self { group, start_steps: start_steps.collect(), stage: Stage::Configure }
    }

    /// Begins [`Stage::Start`]. The outcome is open again until the stage is done. Nodes that have become operational wait
    /// for SYNC.
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

    /// The stage that runs or has run.
    pub const fn stage(&self) -> Stage {
        self.stage
    }

    /// Sends what is due, with the index of its bus, and lets time pass.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, Frame)) {
        self.group.poll(now_ns, send);
    }

    /// Takes a frame that was received on the bus with this index. Frames of others are passed over.
    pub fn receive(&mut self, bus: usize, frame: &Frame) {
        self.group.receive(bus, frame);
    }

    /// How far the present stage has come.
    pub fn progress(&self) -> Progress {
        self.group.progress()
    }

    /// What is known of the drives in the order of the configuration, or every drive that failed; `None` while the
    /// present stage runs. A drive in a fault does not fail the bring-up: see [`AxisFacts::fault`].
    pub fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>> {
        self.group.outcome()
    }
}

/// Leaves every axis of a configuration politely: pre-operational, without torque, and without watching for the
/// heartbeat of a master that will fall silent. The axes should have been disabled by the cycle before; one that still
/// has torque is brought to rest and switched off.
///
/// The master's heartbeat must go on until this is done.
#[derive(Debug)]
pub struct Leave {
    group: Group,
}

impl Leave {
    /// Prepares to leave every axis. Nothing is sent before [`Leave::poll`].
    pub fn new(config: &Config) -> Self {
        Self::with_timing(config, BringUpTiming::default())
    }

    /// As [`Leave::new`], with other time-outs.
    pub fn with_timing(config: &Config, timing: BringUpTiming) -> Self {
        let group = Group::new(config, |axis| {
            let steps = match axis.drive {
                DriveFamily::ErobCanopen => erob_canopen::leave(axis, &timing),
                DriveFamily::YzAim => yz_aim::leave(axis, &timing),
            };
            AxisRun::new(axis, timing.sdo, steps, Policy::BestEffort, None)
        });
        Self { group }
    }

    /// Sends what is due, with the index of its bus, and lets time pass.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, Frame)) {
        self.group.poll(now_ns, send);
    }

    /// Takes a frame that was received on the bus with this index. Frames of others are passed over.
    pub fn receive(&mut self, bus: usize, frame: &Frame) {
        self.group.receive(bus, frame);
    }

    /// How far it has come.
    pub fn progress(&self) -> Progress {
        self.group.progress()
    }

    /// What is known of the drives in the order of the configuration, or what could not be done; `None` while it runs.
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

    fn progress(&self) -> Progress {
        let fraction_of = |(done, all): (usize, usize)| if all == 0 { 1.0 } else { done as f64 / all as f64 };
        let open = self.members.iter().enumerate().filter(|(_, member)| !member.run.is_over());
        let slowest = open.min_by_key(|(_, member)| member.run.progress().0);
        let sum: f64 = self.members.iter().map(|member| fraction_of(member.run.progress())).sum();
        Progress {
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
