//! One case from power-up to the end.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use takt::channels::LogSide;
use takt::config::{Axis, Config};
use takt::controller::{AfterBringUp, Supervisor};
use takt::faults::{FaultInjector, Scenario, ScenarioFault};
use takt::journal::Journal;
use takt::link::trace::{Trace, TracedPort, traced};
use takt::sim::Observation;
use takt::{Outcome, VirtualRun};
use takt_rt::{
    Answer, BusPort, CycleRecord, DriveState, Event, EventKind, Frame, Phase, ReceiveBatch, Request,
    RequestId, RequestTarget, Rule, Snapshot, StreamState,
};

use crate::case::Case;
use crate::client::{Client, RecentRequests, are_open};
use crate::client_callback::CallbackClient;
use crate::client_mode::ModeClient;
use crate::client_stream::StreamVariety;
use crate::client_trajectory::TrajectoryClient;
use crate::concern::Concerns;
use crate::fingerprint::Fingerprint;
use crate::heartbeat::Heartbeats;
use crate::invariants::{Invariants, REST, Seen};
use crate::off_cycle::OffCycle;
use crate::recorder::Recorder;
use crate::tap::Tap;
use crate::wire::Wire;

/// What passes a port in one cycle, and more. What nobody takes is dropped.
const TRACED_PIECES: usize = 1 << 12;
/// Bring-up, shutdown and all time-outs of the life cycle together.
const END_AT_MOST_S: f64 = 45.0;
/// A YZ-AIM whose communication has been reset watches the controller for its factory setting of 2 s; then it stops.
const WATCHDOG_MS: u64 = 3000;
/// A reset of faults that has been granted takes so many cycles of the slowest bus to show.
const RESET_CYCLES: u64 = 60;

/// A controller in virtual time of which everything is seen.
pub struct World {
    pub run: VirtualRun<TracedPort<Tap>>,
    /// Writes the journal of the run, if it is to be replayed.
    recorder: Option<Recorder>,
    traces: Vec<Trace>,
    pub log: LogSide,
    pub fault_injector: Arc<FaultInjector>,
    pub snapshot: Snapshot,
    /// Of the present cycle.
    pub sent: Vec<Vec<Frame>>,
    pub truth: Vec<Observation>,
    pub events: Vec<Event>,
}

impl World {
    /// A run of the program.
    pub fn new(config: &Config, scenario: &Scenario) -> Self {
        Self::with(config, scenario, false)
    }

    fn with(config: &Config, scenario: &Scenario, is_serving: bool) -> Self {
        let fault_injector = Arc::new(FaultInjector::new(scenario.clone()));
        let traces = RefCell::new(vec![]);
        let tapped = |port| {
            let (port, trace) = traced(Tap::new(port), "bus", TRACED_PIECES);
            traces.borrow_mut().push(trace);
            port
        };
        let supervisor = match is_serving {
            true => Supervisor::serving(config, AfterBringUp::Enable),
            false => Supervisor::new(config, None),
        };
        let (run, log) = VirtualRun::faulty(config, &fault_injector, supervisor, tapped).unwrap();
        let traces = traces.into_inner();
        let snapshot = run.snapshot();
        let sent = vec![vec![]; config.buses.len()];
        Self {
            run,
            recorder: None,
            traces,
            log,
            fault_injector,
            snapshot,
            sent,
            truth: vec![],
            events: vec![],
        }
    }

    /// One cycle. Returns whether the run goes on.
    pub fn step(&mut self, config: &Config) -> bool {
        let goes_on = self.run.step();
        self.snapshot = self.run.snapshot();
        self.fault_injector.observe(&self.snapshot);
        let ports = self.run.ports();
        for (sent, port) in self.sent.iter_mut().zip(ports.iter_mut()) {
            sent.clear();
            std::mem::swap(sent, &mut port.inner_mut().sent);
        }
        self.truth.clear();
        for axis in &config.axes {
            let truth = self.observe(axis, self.snapshot.at_ns);
            self.truth.push(truth);
        }
        self.events.clear();
        while let Some(event) = self.log.take_event() {
            self.events.push(event);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.drain(&mut self.traces);
        }
        goes_on
    }

    /// The truth about the drive of an axis at this time.
    fn observe(&mut self, axis: &Axis, at_ns: u64) -> Observation {
        match self.run.line(axis.bus) {
            Some(line) => line.lock().observe(axis.node).unwrap(),
            None => self.run.ports()[axis.bus].inner_mut().observe(at_ns, axis.node),
        }
    }

    /// Lets the drives go on to this time, though nobody speaks to them.
    fn leave_alone_until(&mut self, now_ns: u64) {
        let mut batch = ReceiveBatch::new();
        for port in self.run.ports() {
            batch.clear();
            port.receive(now_ns, &mut batch);
        }
        for line in (0..self.sent.len()).filter_map(|bus| self.run.line(bus)) {
            line.lock().receive(now_ns);
        }
    }
}

/// What became of a fault.
#[derive(Clone, Copy, Debug)]
pub struct FaultOutcome {
    /// Its number in the scenario.
    pub fault: usize,
    /// What the first group that it concerns was doing when it began.
    pub phase: Phase,
    /// True if the axes had been enabled before.
    pub is_brought_up: bool,
    /// The first stop that a group made by itself from then on, unless another fault came between.
    pub stop: Option<Rule>,
    /// Another fault came before anything stopped.
    is_overtaken: bool,
}

/// What is left of a case.
#[derive(Debug)]
pub struct Done {
    pub cycles: u64,
    /// Of all records, events and frames.
    pub fingerprint: u64,
    /// Every fault that has begun.
    pub outcomes: Vec<FaultOutcome>,
    /// The rules of all stops.
    pub stops: BTreeSet<&'static str>,
    /// Cycles in which an axis moved in another mode of operation than its first.
    pub changed_cycles: u64,
    /// How often a callback, and a checked trajectory, has begun to lead a group.
    pub callbacks: u64,
    pub trajectories: u64,
    /// True if the drives could not be brought up.
    pub is_bring_up_failed: bool,
}

/// Plays a case.
///
/// # Errors
/// The invariant that does not hold, and when.
pub fn play(case: &Case) -> Result<Done, String> {
    play_in(&mut World::with(&case.config, &case.scenario, case.is_serving), case)
}

/// Plays a case, and returns its journal and its records.
///
/// # Errors
/// As [`play`].
pub fn record(case: &Case) -> Result<(Journal, Vec<CycleRecord>), String> {
    let mut world = World::with(&case.config, &case.scenario, case.is_serving);
    world.recorder = Some(Recorder::new(world.run.journal()));
    play_in(&mut world, case)?;
    let recorder = world.recorder.ok_or("the recorder is there from the beginning")?;
    match recorder.lost {
        0 => Ok((recorder.journal, recorder.records)),
        lost => Err(format!("{lost} entries of the journal were lost")),
    }
}

fn play_in(world: &mut World, case: &Case) -> Result<Done, String> {
    let config = &case.config;
    let fault_injector = Arc::clone(&world.fault_injector);
    let mut invariants = Invariants::new(config);
    let off_cycle = OffCycle::new(config);
    // Whether each drive has been without torque since its group was last enabled.
    let mut was_stopped = vec![true; config.axes.len()];
    let mut concerns = Concerns::new(config, &fault_injector);
    let mut wire = Wire::new(config);
    let mut heartbeats = Heartbeats::new(config);
    let mut clients = Clients::new(case);
    let groups: Vec<usize> = (0..config.axes.len()).map(|axis| config.group_of_axis(axis)).collect();
    let mut fingerprint = Fingerprint::default();
    let mut outcomes: Vec<FaultOutcome> = vec![];
    let mut stops = BTreeSet::new();
    let mut changed_cycles = 0;
    let at_most = case.length + (END_AT_MOST_S * 1e9 / config.cycle.period_ns as f64) as u64;
    let (mut enabled, mut cycles, mut callbacks) = (None, 0, 0);
    let mut goes_on = true;
    let mut overload_dice = case.dice.split(u64::MAX - 2);
    world.run.poll_life_cycle_every(case.hardship.neglect.max(1));
    concerns.neglect(config, case.hardship.neglect);
    while goes_on {
        let before = world.snapshot;
        goes_on = world.step(config);
        cycles += 1;
        let wrong =
            |snapshot: &Snapshot, what: String| format!("cycle {cycles}, {:?}: {what}", phases_of(snapshot));
        wire.read(&world.sent);
        off_cycle.check(&world.sent).map_err(|what| wrong(&world.snapshot, what))?;
        for (axis, was_stopped) in was_stopped.iter_mut().enumerate() {
            let is_led = is_led(world.snapshot.groups()[groups[axis]].phase);
            *was_stopped = !is_led && (*was_stopped || !world.truth[axis].state.has_torque());
        }
        heartbeats.observe(&world.sent, world.snapshot.at_ns, &world.truth);
        concerns.note_missed_heartbeats(&heartbeats);
        concerns.observe(&fault_injector, |fault| {
            let phase = before.groups()[concerned_group(config, &case.scenario.faults[fault])].phase;
            outcomes
                .iter_mut()
                .filter(|outcomes| outcomes.stop.is_none())
                .for_each(|outcomes| outcomes.is_overtaken = true);
            outcomes.push(FaultOutcome {
                fault,
                phase,
                is_brought_up: enabled.is_some(),
                stop: None,
                is_overtaken: false,
            });
        });
        let has_missed = |event: &Event| matches!(event.kind, EventKind::MissedSlots { .. });
        concerns.note_missed_slots(world.events.iter().any(has_missed));
        note_stop(&world.events, &mut outcomes);
        let is_callback = |event: &&Event| event.kind == EventKind::Stream { state: StreamState::Callback };
        callbacks += world.events.iter().filter(is_callback).count() as u64;
        stops.extend(world.events.iter().filter_map(|event| match event.kind {
            EventKind::Stop(reason) => Some(reason.rule().key()),
            _ => None,
        }));
        clients.note_answers(&world.snapshot);
        changed_cycles += u64::from(moves_in_other_mode(config, &world.snapshot));
        fingerprint.take_cycle(world);
        let World { log, snapshot, truth, events, recorder, .. } = &mut *world;
        let mut look = |record: &_| {
            fingerprint.take_record(record);
            if let Some(recorder) = recorder {
                recorder.records.push(*record);
            }
            invariants.check(&Seen {
                config,
                groups: &groups,
                snapshot,
                record,
                sent: &wire.values,
                truth,
                events,
                concerns: &concerns.by_axis,
                troubled_buses: &concerns.by_bus,
                overloaded_buses: &concerns.is_overloaded,
                asked: &clients.asked,
                are_torques_commanded: case.are_torques_commanded(),
                has_faults: !case.scenario.faults.is_empty(),
            })
        };
        while let Some(checked) = log.next_record(&mut look) {
            checked.map_err(|what| wrong(snapshot, what))?;
        }
        if cycles > at_most {
            return Err(wrong(snapshot, "the run does not end".to_owned()));
        }
        if enabled.is_none() && snapshot.groups().iter().all(|group| group.phase == Phase::Holding) {
            enabled = Some(cycles);
        }
        if case.broken_off == Some(cycles) || enabled.is_some_and(|enabled| cycles == enabled + case.length) {
            world.run.interrupt(case.interrupt);
        }
        let is_raging = enabled.is_some_and(|enabled| cycles < enabled + case.length);
        let is_open = is_raging || enabled.is_some() && case.hardship.are_clients_stubborn;
        clients.act(case, world, is_open);
        case.overload.act(cycles, &mut overload_dice, &mut world.run, &mut concerns);
        for (_, late_ns) in case.hardship.stalls.iter().filter(|(cycle, _)| *cycle == cycles) {
            concerns.pause();
            world.run.clock().stall(*late_ns);
        }
    }
    at_rest(case, &mut concerns, world, &was_stopped)?;
    let is_bring_up_failed = matches!(world.run.supervisor().outcome(), Some(Outcome::BringUpFailed(_)));
    let trajectories = clients.trajectories.map_or(0, |client| client.begun);
    let fingerprint = fingerprint.value();
    Ok(Done {
        cycles,
        fingerprint,
        outcomes,
        stops,
        changed_cycles,
        callbacks,
        trajectories,
        is_bring_up_failed,
    })
}

/// Returns `true` if the drives of a group in this phase have torque.
fn is_led(phase: Phase) -> bool {
    !matches!(phase, Phase::Passive | Phase::Disabled | Phase::Disabling)
}

fn moves_in_other_mode(config: &Config, snapshot: &Snapshot) -> bool {
    (0..).zip(snapshot.groups()).any(|(group, shown)| {
        let mut axes = config.axes_of_group(group).into_iter();
        let is_other =
            |axis: usize| snapshot.axes[axis].mode_set != config.axes[axis].control.operation_mode() as i8;
        matches!(shown.phase, Phase::Moving | Phase::Streaming) && axes.any(is_other)
    })
}

fn phases_of(snapshot: &Snapshot) -> Vec<Phase> {
    snapshot.groups().iter().map(|group| group.phase).collect()
}

/// The first group that a fault concerns: that of its axis, or of the first axis on its bus.
fn concerned_group(config: &Config, fault: &ScenarioFault) -> usize {
    let is_named = |axis: &Axis| fault.location == format!("axis {}", axis.name);
    let named = config.axes.iter().position(is_named);
    let axis = named.or_else(|| config.axes.iter().position(|axis| axis.bus == fault.bus));
    config.group_of_axis(axis.unwrap_or(0))
}

fn note_stop(events: &[Event], outcomes: &mut [FaultOutcome]) {
    for event in events {
        if let EventKind::Stop(reason) = event.kind
            && reason.rule() != Rule::Requested
        {
            outcomes.iter_mut().filter(|outcomes| !outcomes.is_overtaken).for_each(|outcomes| {
                outcomes.stop.get_or_insert(reason.rule());
            });
        }
    }
}

/// Those who ask for things, all through one queue.
struct Clients {
    all: Vec<Client>,
    callbacks: Option<CallbackClient>,
    modes: Option<ModeClient>,
    trajectories: Option<TrajectoryClient>,
    /// Of each group.
    asked: Vec<RecentRequests>,
    /// Resets of faults that wait in the queue. Each counts when it is granted: a fault may come up before that, and is reset too.
    awaited_resets: Vec<(RequestId, RequestTarget)>,
    /// Cycles since the last one was granted to each group.
    since_reset: Vec<u64>,
}

impl Clients {
    fn new(case: &Case) -> Self {
        let variety = StreamVariety {
            is_wild: case.hardship.are_streams_wild,
            has_every_kind: case.has_every_kind_of_point,
        };
        let all =
            (0..case.clients as u64).map(|number| Client::new(case.dice.split(number), variety)).collect();
        let callbacks = case.has_callbacks.then(|| CallbackClient::new(case.dice.split(u64::MAX - 3)));
        let modes = case.has_mode_changes.then(|| ModeClient::new(case.dice.split(u64::MAX - 5)));
        let trajectories =
            case.has_trajectories.then(|| TrajectoryClient::new(case.dice.split(u64::MAX - 4)));
        let groups = case.config.groups.len().max(1);
        Self {
            all,
            callbacks,
            modes,
            trajectories,
            asked: vec![RecentRequests::default(); groups],
            awaited_resets: vec![],
            since_reset: vec![u64::MAX; groups],
        }
    }

    /// Looks which resets have been granted in the last cycle.
    fn note_answers(&mut self, snapshot: &Snapshot) {
        let answers = &snapshot.answers;
        for (group, (asked, since_reset)) in (0..).zip(self.asked.iter_mut().zip(&mut self.since_reset)) {
            asked.has_reset = self.awaited_resets.iter().any(|(id, target)| {
                let is_for_it =
                    matches!(target, RequestTarget::All) || *target == RequestTarget::Group(group);
                is_for_it && answers.of(*id) == Answer::Granted
            });
            *since_reset = if asked.has_reset { 0 } else { since_reset.saturating_add(1) };
            asked.has_reset_lately = *since_reset < RESET_CYCLES;
        }
        self.awaited_resets.retain(|(id, _)| answers.of(*id) == Answer::None && !answers.have_forgotten(*id));
    }

    fn act(&mut self, case: &Case, world: &mut World, is_raging: bool) {
        let snapshot = &world.snapshot;
        let is_passive = snapshot.groups().iter().all(|group| group.phase == Phase::Passive);
        let is_waited_for = is_passive || !case.is_serving && !are_open(snapshot);
        if !is_raging || is_waited_for {
            return;
        }
        if let Some(callbacks) = &mut self.callbacks {
            callbacks.act(&case.config, snapshot, &mut world.run);
        }
        if let Some(modes) = &mut self.modes {
            modes.act(&case.config, snapshot, &mut world.run);
        }
        if let Some(trajectories) = &mut self.trajectories {
            trajectories.act(&case.config, snapshot, &mut world.run);
        }
        for client in &mut self.all {
            let wishes = client.wishes(&case.config, snapshot);
            for (target, request) in &wishes.requests {
                let id = world.run.host().request_of(*target, *request).ok();
                let reset = id.filter(|_| *request == Request::ResetFaults);
                self.awaited_resets.extend(reset.map(|id| (id, *target)));
            }
            let streamer = world.run.host().streamer();
            for (group, point) in &wishes.points {
                // Nobody takes the points of a stream that was not granted.
                let _ = streamer.push_to(*group, std::slice::from_ref(point));
            }
            world.run.clock().stall(wishes.late_ns);
        }
    }
}

/// Some time after the controller has gone, whatever it could not stop has been stopped by its own watchdog.
fn at_rest(
    case: &Case,
    concerns: &mut Concerns,
    world: &mut World,
    was_stopped: &[bool],
) -> Result<(), String> {
    let end_ns = world.snapshot.at_ns;
    // Its very last frame has told a drive to start again that had been stopped, and nobody is there any more to see it.
    let is_restarted: Vec<bool> = (0..case.config.axes.len())
        .map(|axis| was_stopped[axis] && concerns.is_misled_now(&world.fault_injector, axis))
        .collect();
    // Of such a drive it is said that it was not reached.
    let is_cut_off: Vec<bool> = (0..case.config.axes.len())
        .map(|axis| {
            world.run.supervisor().unreached().contains(&axis)
                && concerns.is_cut_off_now(&world.fault_injector, axis)
        })
        .collect();
    let rest_ns = end_ns + WATCHDOG_MS * 1_000_000;
    for passed_ms in 1..=WATCHDOG_MS {
        world.leave_alone_until(end_ns + passed_ms * 1_000_000);
    }
    // A fault may have begun in that time.
    concerns.observe(&world.fault_injector, |_| ());
    let axes = case.config.axes.iter().zip(&concerns.by_axis);
    for (((axis, concern), is_restarted), is_cut_off) in axes.zip(is_restarted).zip(is_cut_off) {
        let truth = world.observe(axis, rest_ns);
        // Set-points of another master enable a drive again whose node somebody has started.
        let is_driven = truth.state == DriveState::OperationEnabled && !concern.is_driven_by_others;
        // Nothing stops a drive that has no watchdog any more and that no frame ever reaches again as it was sent.
        let is_beyond_reach = concern.is_unwatched && (concern.is_beyond_reach || is_restarted || is_cut_off);
        if (truth.velocity.abs() > REST || is_driven) && !concern.is_loaded && !is_beyond_reach {
            return Err(format!("{} is not at rest in the end: {truth:?}", axis.name));
        }
    }
    Ok(())
}
