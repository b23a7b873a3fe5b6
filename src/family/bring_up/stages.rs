//! Brings drives up and shuts them down, all nodes of all buses in parallel, the axes of a node one after the other.
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

use std::cell::Cell;
use std::sync::Arc;
use std::task::{Context, Waker};

use takt_rt::{Frame, Nanoseconds};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::printable::printable_path;
use tracing::{debug, error, info};

use super::axis_session::{AxisSession, DryRun, OnFailure, RefusedValue, StepFailure};
use super::facts::AxisFacts;
use super::failure::{AxisFailure, BringUpError, FailureCause};
use super::network_state::RESTART_STEP;
use super::timing::BringUpTiming;
use crate::config::{Axis, Config, ProblemKind};
use crate::family::{self, SettingUp};
use crate::procedure::{CanopenClient, CanopenSession, Parallel, Procedure};

/// The target of what is told of bring-up and shutdown.
const BRING_UP: &str = "takt::bring_up";

/// Number of restarts of a drive after which its configuration gives up.
const MAX_RESTARTS: u8 = 3;

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
    config: Arc<Config>,
    timing: BringUpTiming,
    group: Group,
    stage: Stage,
}

/// [`BringUp::start`] was called before [`Stage::Configure`] had succeeded, or a second time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the drives are not configured yet, or have already been started")]
pub struct NotConfigured;

/// The objects to which bring-up writes another value than the configuration file of an axis (`dcf`) has for them.
pub fn overwritten(config: &Config, axis: &Axis) -> Vec<ObjectAddress> {
    let Some(file) = &axis.dcf else { return vec![] };
    // The last write of each object counts: a PDO is made invalid before it is made valid.
    let mut last: Vec<(ObjectAddress, i64)> = vec![];
    for (object, value) in dry_run(Part::Configure, config, axis).0.writes {
        last.retain(|(address, _)| *address != object);
        last.push((object, value));
    }
    let is_other = |(address, value): &(ObjectAddress, i64)| {
        let in_file = file.downloads.iter().rev().find(|download| download.object == *address);
        in_file.is_some_and(|download| !value.to_le_bytes().starts_with(&download.data))
    };
    last.into_iter().filter(is_other).map(|(address, _)| address).collect()
}

/// The values of configuration files (`dcf`) with which bring-up refuses the drive of an axis.
pub fn refused_values(config: &Config, axis: &Axis) -> Vec<ProblemKind> {
    // Without a file no value is known.
    if config.axes.iter().all(|axis| axis.dcf.is_none()) {
        return vec![];
    }
    let refused = dry_run(Part::Configure, config, axis).0.refused;
    refused.into_iter().filter_map(|value| problem(axis, value)).collect()
}

fn problem(axis: &Axis, RefusedValue { file, cause, advice }: RefusedValue) -> Option<ProblemKind> {
    let FailureCause::Value { object, expected, received, unit, .. } = cause else { return None };
    Some(ProblemKind::RefusedValue {
        file: printable_path(&file),
        object: object.to_string(),
        value: unit.map_or_else(|| object.show(received), |unit| unit.show(received)),
        needed: expected.words(&object, unit),
        axis: axis.name.clone(),
        advice,
    })
}

impl BringUp {
    /// Begins with [`Stage::Configure`] for every axis. Nothing is sent before [`BringUp::poll`].
    pub fn new(config: &Config) -> Self {
        Self::with_timing(config, BringUpTiming::default())
    }

    /// As [`BringUp::new`], with other timeouts.
    pub fn with_timing(config: &Config, timing: BringUpTiming) -> Self {
        Self::begun(Arc::new(config.clone()), timing, Group::new(config, timing, |_| true))
    }

    /// As [`BringUp::new`], for these axes alone: all of each node.
    pub fn of(config: &Config, axes: &[usize]) -> Self {
        let timing = BringUpTiming::default();
        Self::begun(Arc::new(config.clone()), timing, Group::new(config, timing, |axis| axes.contains(&axis)))
    }

    /// Begins anew with [`Stage::Configure`], for these axes alone: all of each node. The facts of the others are unknown in its outcome.
    pub fn again(&self, axes: &[usize]) -> Self {
        let group = Group::new(&self.config, self.timing, |axis| axes.contains(&axis));
        Self::begun(Arc::clone(&self.config), self.timing, Group { is_again: true, ..group })
    }

    fn begun(config: Arc<Config>, timing: BringUpTiming, mut group: Group) -> Self {
        group.begin(Part::Configure, &config, timing, &[]);
        Self { config, timing, group, stage: Stage::Configure }
    }

    /// Begins [`Stage::Start`]. The outcome is `None` again until this stage is done. Operational nodes wait for SYNC.
    pub fn start(&mut self) -> Result<(), NotConfigured> {
        match (self.stage, self.outcome()) {
            (Stage::Configure, Some(Ok(facts))) => {
                self.stage = Stage::Start;
                self.group.begin(Part::Start, &self.config, self.timing, &facts);
                Ok(())
            }
            _ => Err(NotConfigured),
        }
    }

    /// The configuration whose drives it brings up.
    pub const fn config(&self) -> &Arc<Config> {
        &self.config
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
        let mut group = Group::new(config, timing, |_| true);
        group.begin(Part::ShutDown, &Arc::new(config.clone()), timing, &[]);
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

    /// The axes that have not been shut down, as indices into the configuration: not yet, or not at all.
    pub fn not_done(&self) -> Vec<usize> {
        self.group.not_done()
    }
}

/// The nodes of a configuration, and their running procedures.
#[derive(Debug)]
struct Group {
    axes: Vec<AxisName>,
    members: Vec<Member>,
    /// True if the drives have been brought up before, in the same run.
    is_again: bool,
    procedures: Parallel<CanopenClient, Vec<AxisFacts>, NodeFailure>,
}

/// What a failure says of its axis.
#[derive(Debug)]
struct AxisName {
    name: String,
    bus_name: String,
    node: u8,
}

/// A node with one SDO server, and its axes, which are brought up one after the other.
#[derive(Debug)]
struct Member {
    bus: usize,
    /// Indices into the configuration, in its order.
    axes: Vec<usize>,
    session: CanopenSession,
    /// The number of accesses without restarts and repetitions, for the progress.
    accesses: usize,
    told: Cell<Told>,
}

/// What `tracing` knows of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    /// The part that is under way, and its last step; empty before the first one.
    Step(Part, &'static str),
    /// That the part is over.
    End,
}

/// The failure of one axis of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
struct NodeFailure {
    /// Its place among those of the node.
    place: usize,
    failure: StepFailure,
}

impl Group {
    fn new(config: &Config, timing: BringUpTiming, is_its: impl Fn(usize) -> bool) -> Self {
        let axes = config.axes.iter().map(|axis| AxisName {
            name: axis.name.clone(),
            bus_name: config.buses.get(axis.bus).map(|bus| bus.name.clone()).unwrap_or_default(),
            node: axis.node,
        });
        let mut members: Vec<Member> = vec![];
        for (index, axis) in config.axes.iter().enumerate().filter(|(index, _)| is_its(*index)) {
            let is_of_node =
                |member: &&mut Member| (member.bus, member.session.node()) == (axis.bus, axis.node);
            match members.iter_mut().find(is_of_node) {
                Some(member) => member.axes.push(index),
                None => members.push(Member {
                    bus: axis.bus,
                    axes: vec![index],
                    session: session(axis, timing),
                    accesses: 0,
                    told: Cell::new(Told::End),
                }),
            }
        }
        Self { axes: axes.collect(), members, is_again: false, procedures: Parallel::new([]) }
    }

    /// Begins a part of every axis. `facts` is what is known of each drive; without it, nothing is known.
    fn begin(&mut self, part: Part, config: &Arc<Config>, timing: BringUpTiming, facts: &[AxisFacts]) {
        let is_again = self.is_again;
        let begun = self.members.iter_mut().map(|member| {
            let axes = member.axes.iter().filter_map(|index| Some((*index, config.axes.get(*index)?)));
            let facts: Vec<AxisFacts> = axes
                .clone()
                .map(|(index, axis)| {
                    let unknown = || AxisFacts { codec: axis.drive.codec, ..AxisFacts::default() };
                    facts.get(index).cloned().unwrap_or_else(unknown)
                })
                .collect();
            member.accesses = axes.map(|(_, axis)| dry_run(part, config, axis).1).sum();
            member.session.begin_again();
            member.told.set(Told::Step(part, ""));
            // The progress shows it before the first poll.
            member.session.resume_step(RESTART_STEP);
            let (session, config, axes) = (member.session.clone(), Arc::clone(config), member.axes.clone());
            let work = async move {
                let axes = axes.iter().filter_map(|index| config.axes.get(*index));
                let of_axis = |(axis, facts)| {
                    AxisSession::new(session.clone(), &config, axis, timing, part.on_failure(), facts)
                        .again(is_again)
                };
                let sessions: Vec<AxisSession<'_>> = axes.zip(facts).map(of_axis).collect();
                let failed = carry_out(part, &sessions).await;
                end(sessions, failed)
            };
            (member.bus, Procedure::movable(member.session.clone(), work))
        });
        self.procedures = Parallel::new(begun);
    }

    fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, Frame)) {
        self.procedures.poll(now_ns, send);
        self.tell();
    }

    /// Tells `tracing` of new steps, and how the part of each node has ended.
    fn tell(&self) {
        for (member, procedure) in self.members.iter().zip(self.procedures.procedures()) {
            let Told::Step(part, last) = member.told.get() else { continue };
            let (node, stage) = (member.session.node(), part.name());
            let names = member.axes.iter().filter_map(|axis| self.axes.get(*axis));
            match procedure.outcome() {
                None => {
                    let step = member.session.step_name();
                    if step != last {
                        let bus = names.clone().next().map(|axis| axis.bus_name.as_str());
                        let axis = names.map(|axis| axis.name.as_str()).collect::<Vec<_>>().join(", ");
                        let axis = axis.as_str();
                        debug!(target: BRING_UP, axis, bus, node, stage, step, "{axis}: {stage}: {step}");
                        member.told.set(Told::Step(part, step));
                    }
                }
                Some(Ok(_)) => {
                    for AxisName { name: axis, bus_name: bus, .. } in names {
                        info!(target: BRING_UP, axis, bus, node, stage, "{axis}: {stage}: done");
                    }
                    member.told.set(Told::End);
                }
                Some(Err(error)) => {
                    for failure in self.failures(member, error.step, error.failure) {
                        let (step, reason, cure) =
                            (failure.step, failure.cause.to_string(), failure.advice());
                        let (axis, bus) = (failure.name.as_str(), failure.bus.as_str());
                        error!(
                            target: BRING_UP, axis, bus, node, stage, step, reason, cure,
                            "{axis}: {stage}: {step}: {reason}"
                        );
                    }
                    member.told.set(Told::End);
                }
            }
        }
    }

    fn receive(&mut self, bus: usize, frame: &Frame) {
        self.procedures.receive(bus, frame);
    }

    fn progress(&self) -> BringUpProgress {
        let of_nodes = self.members.iter().zip(self.procedures.procedures()).enumerate();
        let open = of_nodes.filter(|(_, (_, procedure))| procedure.outcome().is_none());
        let slowest = open.min_by_key(|(_, (member, _))| member.session.done());
        let sum: f64 = self.members.iter().map(Member::fraction).sum();
        BringUpProgress {
            fraction: if slowest.is_none() { 1.0 } else { sum / self.members.len() as f64 },
            step: slowest.map_or("", |(_, (member, _))| member.session.step_name()),
            axis: slowest.map_or(0, |(_, (member, _))| member.axes.first().copied().unwrap_or(0)),
        }
    }

    fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>> {
        let (mut facts, mut failures) = (vec![AxisFacts::default(); self.axes.len()], vec![]);
        for (member, procedure) in self.members.iter().zip(self.procedures.procedures()) {
            match procedure.outcome()? {
                Ok(of_axes) => {
                    for (index, of_axis) in member.axes.iter().zip(of_axes) {
                        if let Some(facts) = facts.get_mut(*index) {
                            facts.clone_from(of_axis);
                        }
                    }
                }
                Err(error) => failures.extend(self.failures(member, error.step, error.failure)),
            }
        }
        failures.sort_by_key(|failure| failure.axis);
        Some(if failures.is_empty() { Ok(facts) } else { Err(BringUpError { failures }) })
    }

    fn not_done(&self) -> Vec<usize> {
        let mut axes = vec![];
        for (member, procedure) in self.members.iter().zip(self.procedures.procedures()) {
            let done = match procedure.outcome() {
                Some(Ok(_)) => member.axes.len(),
                Some(Err(error)) => error.failure.place,
                None => 0,
            };
            axes.extend(member.axes.iter().skip(done));
        }
        axes
    }

    /// The failure of a node: that of the axis at which it failed, and, where the node is silent, of those that were to follow.
    fn failures(
        &self,
        member: &Member,
        step: &'static str,
        NodeFailure { place, failure }: NodeFailure,
    ) -> impl Iterator<Item = AxisFailure> {
        let count = if failure.cause.is_silence() { member.axes.len() } else { 1 };
        let axes = member.axes.iter().skip(place).take(count);
        axes.filter_map(move |axis| self.failure(member, *axis, step, failure))
    }

    fn failure(
        &self,
        member: &Member,
        axis: usize,
        step: &'static str,
        failure: StepFailure,
    ) -> Option<AxisFailure> {
        let AxisName { name, bus_name, node } = self.axes.get(axis)?;
        Some(AxisFailure {
            axis,
            name: name.clone(),
            bus: bus_name.clone(),
            node: *node,
            step,
            cause: failure.cause,
            emergency: member.session.emergency(),
            step_advice: failure.advice,
        })
    }
}

impl Member {
    /// The finished part, 0 to 1.
    fn fraction(&self) -> f64 {
        if self.accesses == 0 { 1.0 } else { (self.session.done() as f64 / self.accesses as f64).min(1.0) }
    }
}

/// A part of a drive's life that has a procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Configure,
    Start,
    ShutDown,
}

impl Part {
    /// The procedure of the drive's family.
    fn of_family<'a>(self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        let family = family::of(&c.axis.drive);
        match self {
            Self::Configure => family.configure(c),
            Self::Start => family.start(c),
            Self::ShutDown => family.shut_down(c),
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Configure => "configure",
            Self::Start => "start",
            Self::ShutDown => "shut down",
        }
    }

    const fn on_failure(self) -> OnFailure {
        match self {
            Self::Configure | Self::Start => OnFailure::End,
            Self::ShutDown => OnFailure::GoOn,
        }
    }
}

fn session(axis: &Axis, timing: BringUpTiming) -> CanopenSession {
    CanopenSession::new(CanopenClient::new(axis.node, family::sdo_quirks(&axis.drive, timing.sdo)))
}

/// The place of an axis among those of its node, and why it failed.
type FailedAxis = (usize, FailureCause);

/// Carries out a part for the axes of a node, one after the other, and watches for restarts of the node: its configuration is then
/// done again, and another part fails.
async fn carry_out<'a>(part: Part, axes: &'a [AxisSession<'a>]) -> Option<FailedAxis> {
    let bus = &axes.first()?.bus;
    loop {
        if let Some(failed) = bus.unless_over(|| bus.has_restarted(), each(part, axes)).await {
            return failed;
        }
        bus.accept_restart();
        let mut times = 0;
        for c in axes {
            c.keep(|facts| facts.restarts = facts.restarts.saturating_add(1));
            times = c.facts().restarts;
        }
        if part != Part::Configure || times > MAX_RESTARTS {
            return Some((0, FailureCause::Restarted { times }));
        }
        bus.reset_transfer();
        bus.begin_again();
    }
}

/// Carries out a part for one axis after the other. Gives the first that failed.
async fn each<'a>(part: Part, axes: &'a [AxisSession<'a>]) -> Option<FailedAxis> {
    for (place, c) in axes.iter().enumerate() {
        if let Err(cause) = part.of_family(c).await {
            return Some((place, cause));
        }
    }
    None
}

/// The facts of the axes of a node, or the first failure.
fn end(axes: Vec<AxisSession<'_>>, failed: Option<FailedAxis>) -> Result<Vec<AxisFacts>, NodeFailure> {
    let result_of = |place: usize| match failed {
        Some((at, cause)) if at == place => Err(cause),
        _ => Ok(()),
    };
    let ended = axes
        .into_iter()
        .enumerate()
        .map(|(place, c)| c.end(result_of(place)).map_err(|failure| NodeFailure { place, failure }));
    ended.collect()
}

/// What a part does when the drive answers as expected, and the number of accesses.
fn dry_run(part: Part, config: &Config, axis: &Axis) -> (DryRun, usize) {
    let timing = BringUpTiming::default();
    let session = session(axis, timing);
    let facts = AxisFacts { codec: axis.drive.codec, ..AxisFacts::default() };
    let c = AxisSession::new(session.clone(), config, axis, timing, part.on_failure(), facts).dry_run();
    // Nothing is waited for without a drive, so one poll is enough.
    let _ = part.of_family(&c).as_mut().poll(&mut Context::from_waker(Waker::noop()));
    (c.end_dry_run(), session.done())
}
