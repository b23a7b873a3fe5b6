//! The cycle as pure computation: frames and time in, frames out.
//!
//! [`Engine`] holds the axes and the phase that the group is in. Each slot it gives SYNC, takes what the drives
//! report, decides in [`Engine::compute`] (requests, supervision, motion, guard, commands), and gives the set-points.
//! It knows neither clocks nor buses; [`crate::cycle`] drives it.

mod behaviour;
mod parameters;
mod process_data;
mod requests;
mod stops;

use arrayvec::ArrayVec;

use crate::axis::{Axis, AxisParameters};
use crate::cia402::{Goal, controlword};
use crate::dispatch::{Destination, Dispatch, IdTaken};
use crate::door::{AxisSnapshot, Door, Snapshot, StreamCommand};
use crate::frame::{Frame, Id};
use crate::motion::Motion;
use crate::port::{BusHealth, Received};
use crate::record::{CycleRecord, Event, EventKind, MAX_AXES, MAX_BUSES, Timing};
use crate::stop::{Phase, StopCategories, StopReason};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::time_of_day::TimeProducer;
use crate::watch::{LeakyBucket, TimingLadder, TimingLevel};

pub use parameters::{BusParameters, EngineParameters, Heartbeat, SetUpError};

/// The most frames the engine hands to one bus in one cycle.
pub const SEND_BATCH: usize = 64;

/// Frames for one bus.
pub type SendBatch = ArrayVec<Frame, SEND_BATCH>;

/// Steps that a third difference reaches back: for so long a bridged command shows in the jerk.
const MARKED_BY_BRIDGE: u8 = 4;
/// Requests looked at in one cycle; the rest waits, so that a flood costs a bounded time.
const REQUESTS_PER_CYCLE: usize = 4;
/// How long controlword bit 7 is held low before, and high in, a fault reset.
const FAULT_RESET_CYCLES: u32 = 10;
/// Cycles of the slowest bus for which the heartbeat waits after the controller was away for more than its period.
/// A drive that has stopped for want of it may go on with its old target once it is back: until then what the drives
/// report must have been heard, and their targets and controlwords be new ones.
const HEARTBEAT_HELD_BUS_CYCLES: u32 = 4;

/// Whether the set-points of a cycle can leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transmission {
    /// They can.
    Free,
    /// It is too late in the slot: they would run into the next SYNC. Counts as a missed slot.
    TooLate,
    /// Set-points of an earlier cycle are still waiting for the wire on every bus; more behind them would be stale
    /// when they get there.
    Blocked,
}

/// Some of the buses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusSet(u32);

impl BusSet {
    /// Adds a bus.
    pub fn insert(&mut self, bus: usize) {
        self.0 |= 1 << (bus & 31);
    }

    /// Whether a bus is among them.
    pub const fn contains(self, bus: usize) -> bool {
        self.0 >> (bus & 31) & 1 == 1
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether all of so many buses, at least one, are among them.
    pub const fn is_every_of(self, buses: usize) -> bool {
        buses > 0 && self.0.count_ones() as usize >= buses
    }
}

/// The group of axes that move together.
#[derive(Debug)]
pub struct Engine {
    period_ns: Nanoseconds,
    period_s: f64,
    axes: ArrayVec<Axis, MAX_AXES>,
    buses: ArrayVec<BusParameters, MAX_BUSES>,
    dispatch: [Dispatch; MAX_BUSES],
    heartbeat: Option<Heartbeat>,
    time: Option<TimeProducer>,
    enable_timeout_cycles: u32,
    not_transmitted_cycles: u32,
    acknowledge_timeout_cycles: u32,
    categories: StopCategories,
    ladder: TimingLadder,

    phase: Phase,
    phase_cycles: u32,
    is_sync_on: bool,
    is_leaving: bool,
    goal: Goal,
    motion: Motion,
    /// The move under way: its number and whether it ends in motion.
    move_id: u32,
    finished_move: u32,
    refused: u64,
    stream: Option<StreamCommand>,
    /// Whether a command of the present stream has been taken.
    is_stream_begun: bool,
    /// Cycles in which the set-points still bear the mark of a command that did not come and was bridged.
    bridged_cycles: u8,
    clamped: u64,
    missed: LeakyBucket,
    timing_level: TimingLevel,
    /// What was sent by somebody who may not.
    foreign_id: Option<u32>,
    /// Whether an interface has refused frames since the last cycle.
    is_not_taken: bool,
    held_back: BusSet,
    stop: Option<StopReason>,
    fault_reset: u32,
    heartbeat_due: u32,
    blocked_cycles: u32,
    last_slot: Option<u64>,
    missed_slots: u64,
    dropped: u64,
    drive_states: [crate::cia402::State; MAX_AXES],
    record: CycleRecord,
    snapshot: Snapshot,
}

impl Engine {
    /// Checks the parameters. The engine begins in [`Phase::Passive`].
    pub fn new(parameters: EngineParameters) -> Result<Self, SetUpError> {
        if parameters.period_ns == 0 {
            return Err(SetUpError::NoPeriod);
        }
        if parameters.axes.is_empty() {
            return Err(SetUpError::NoAxis);
        }
        if let Some(bus) = parameters.buses.iter().position(|bus| bus.divider == 0) {
            return Err(SetUpError::NoDivider { bus });
        }
        let mut dispatch: [Dispatch; MAX_BUSES] = core::array::from_fn(|_| Dispatch::default());
        for (axis, own) in parameters.axes.iter().enumerate() {
            let is_bus_known = usize::from(own.bus) < parameters.buses.len();
            let table = dispatch.get_mut(usize::from(own.bus)).filter(|_| is_bus_known);
            enter(table.ok_or(SetUpError::UnknownBus { axis })?, axis, own)?;
        }
        for (bus, table) in parameters.buses.iter().zip(&mut dispatch) {
            table.foreign(NMT);
            table.foreign(bus.sync_id);
            if let Some(heartbeat) = parameters.heartbeat {
                table.foreign(Id::canopen(0x700, heartbeat.node));
            }
        }
        let axes = on_one_time(parameters.axes.iter().cloned().map(Axis::new).collect(), &parameters.buses);
        let record = CycleRecord { axis_count: parameters.axes.len() as u8, ..CycleRecord::default() };
        let snapshot = Snapshot {
            axis_count: parameters.axes.len() as u8,
            bus_count: parameters.buses.len() as u8,
            ..Snapshot::default()
        };
        Ok(Self {
            period_ns: parameters.period_ns,
            period_s: parameters.period_ns as f64 / NANOSECONDS_PER_SECOND as f64,
            axes,
            buses: parameters.buses,
            dispatch,
            heartbeat: parameters.heartbeat,
            time: parameters.time_cycles.map(TimeProducer::new),
            enable_timeout_cycles: parameters.enable_timeout_cycles,
            not_transmitted_cycles: parameters.not_transmitted_cycles,
            acknowledge_timeout_cycles: parameters.acknowledge_timeout_cycles,
            categories: parameters.categories,
            ladder: parameters.timing,
            phase: Phase::Passive,
            phase_cycles: 0,
            is_sync_on: false,
            is_leaving: false,
            goal: Goal::Disabled,
            motion: Motion::default(),
            move_id: 0,
            finished_move: 0,
            refused: 0,
            stream: None,
            is_stream_begun: false,
            bridged_cycles: 0,
            clamped: 0,
            missed: LeakyBucket::default(),
            timing_level: TimingLevel::Normal,
            foreign_id: None,
            is_not_taken: false,
            held_back: BusSet::default(),
            stop: None,
            fault_reset: 0,
            heartbeat_due: 0,
            blocked_cycles: 0,
            last_slot: None,
            missed_slots: 0,
            dropped: 0,
            drive_states: Default::default(),
            record,
            snapshot,
        })
    }

    /// How many buses there are.
    pub fn bus_count(&self) -> usize {
        self.buses.len()
    }

    /// The period of the cycle.
    pub fn period_ns(&self) -> Nanoseconds {
        self.period_ns
    }

    /// What the group is doing.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The axes.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Whether the loop is to end after this cycle.
    pub fn is_leaving(&self) -> bool {
        self.is_leaving
    }

    /// The SYNC of a bus, if one is to be sent in this slot.
    pub fn sync(&self, bus: usize, slot: u64) -> Option<Frame> {
        let parameters = self.buses.get(bus)?;
        (self.is_sync_on && has_cycle(parameters, slot)).then(|| Frame::of(parameters.sync_id, []))
    }

    /// Takes a frame that arrived on a bus.
    pub fn receive(&mut self, bus: usize, received: &Received, door: &mut impl Door) {
        let Some(table) = self.dispatch.get(bus) else { return };
        match table.destination(&received.frame) {
            Destination::Feedback { axis, pdo } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    // One that is too short counts as not received, which the feedback's age then shows.
                    let _ = axis.receive(pdo.into(), &received.frame);
                }
            }
            Destination::Emergency { axis } => {
                let [low, high, register, manufacturer @ ..] = received.frame.first_word().to_le_bytes();
                let code = u16::from_le_bytes([low, high]);
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.receive_emergency(code);
                }
                self.happened(
                    received.at_ns,
                    EventKind::Emergency { axis, code, register, manufacturer },
                    door,
                );
                self.hand_over(bus, received, door);
            }
            Destination::ErrorControl { axis } => {
                let state = received.frame.payload().first().copied();
                if let (Some(axis), Some(state)) = (self.axes.get_mut(usize::from(axis)), state) {
                    axis.receive_error_control(state);
                }
                self.hand_over(bus, received, door);
            }
            Destination::Foreign => {
                self.foreign_id.get_or_insert(received.frame.id().value());
                self.hand_over(bus, received, door);
            }
            Destination::Unused => {}
            Destination::Service => self.hand_over(bus, received, door),
        }
    }

    fn hand_over(&mut self, bus: usize, received: &Received, door: &mut impl Door) {
        if !door.received(bus, received) {
            self.dropped += 1;
        }
    }

    fn happened(&mut self, at_ns: Nanoseconds, kind: EventKind, door: &mut impl Door) {
        let slot = self.last_slot.unwrap_or(0);
        if !door.event(&Event { slot, at_ns, kind }) {
            self.dropped += 1;
        }
    }

    /// Names the buses on which own frames still wait for the wire, before [`Engine::compute`]: they get no set-points.
    /// The axes on the others go on.
    pub fn hold_back(&mut self, buses: BusSet) {
        self.held_back = buses;
    }

    /// The thinking of one cycle. Nothing moves on unless set-points can leave.
    ///
    /// Returns whether there are set-points to send.
    pub fn compute(
        &mut self,
        slot: u64,
        now_ns: Nanoseconds,
        buses: &[BusHealth],
        transmission: Transmission,
        door: &mut impl Door,
    ) -> bool {
        let elapsed = self.last_slot.map_or(1, |last| slot.saturating_sub(last));
        self.count_slot(slot, elapsed, transmission, now_ns, door);
        if let Some(time) = &mut self.time {
            time.pass(elapsed, now_ns);
        }
        let elapsed_s = self.period_s * elapsed as f64;
        for axis in &mut self.axes {
            let has_cycle = has_cycle_of(&self.buses, axis, slot);
            if has_cycle {
                axis.begin_cycle(elapsed_s)
            } else {
                axis.wait(elapsed_s)
            }
            axis.watch();
        }
        self.notice_drive_states(now_ns, door);
        for _ in 0..REQUESTS_PER_CYCLE {
            match door.request() {
                Some(request) => self.take(request, now_ns, door),
                None => break,
            }
        }
        if let Some(command) = door.stream() {
            self.stream = Some(command);
            self.bridged_cycles = self.bridged_cycles.saturating_sub(1);
        } else if self.phase == Phase::Streaming {
            self.bridged_cycles = MARKED_BY_BRIDGE;
        }
        self.supervise(buses, transmission, now_ns, door);
        // A group that stops and whose set-points do not get out does not wait for them any longer, whatever it stops for.
        let is_given_up = self.stop.is_some() && self.blocked_cycles > self.not_transmitted_cycles;
        let can_leave = match transmission {
            Transmission::Free => true,
            Transmission::TooLate => false,
            Transmission::Blocked => is_given_up,
        };
        let has_commands = can_leave && self.phase != Phase::Passive;
        if has_commands {
            self.act(now_ns, door);
            self.write_commands(slot);
        }
        self.phase_cycles = self.phase_cycles.saturating_add(1);
        self.record.is_commanded = has_commands;
        has_commands
    }

    fn count_slot(
        &mut self,
        slot: u64,
        elapsed: u64,
        transmission: Transmission,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) {
        let missed = elapsed.saturating_sub(1) + u64::from(transmission == Transmission::TooLate);
        self.last_slot = Some(slot);
        self.hold_heartbeat_back(elapsed, transmission);
        self.record.timing.missed_slots = missed;
        if missed > 0 {
            self.missed_slots += missed;
            self.happened(now_ns, EventKind::MissedSlots { count: missed }, door);
        }
        let level = self.ladder.level(self.missed.take(missed, self.ladder.leak_cycles));
        if level != self.timing_level {
            self.timing_level = level;
            self.happened(now_ns, EventKind::Timing { level }, door);
        }
    }

    /// After an absence that a drive may have noticed, the heartbeat waits.
    fn hold_heartbeat_back(&mut self, elapsed: u64, transmission: Transmission) {
        let was_away = self.heartbeat.is_some_and(|heartbeat| elapsed > heartbeat.cycles.into());
        let held = if was_away {
            self.heartbeat_held_cycles()
        } else {
            // Only the next slot shows how long the absence was.
            u32::from(transmission == Transmission::TooLate)
        };
        self.heartbeat_due = self.heartbeat_due.max(held);
    }

    /// A drive watches the controller from the first heartbeat on that it hears after it has been set up: that comes before
    /// anything moves, and not only after a whole period.
    fn hasten_heartbeat(&mut self) {
        self.heartbeat_due = self.heartbeat_due.min(self.heartbeat_held_cycles());
    }

    fn heartbeat_held_cycles(&self) -> u32 {
        let slowest = self.buses.iter().map(|bus| bus.divider).max().unwrap_or(1);
        HEARTBEAT_HELD_BUS_CYCLES.saturating_mul(slowest)
    }

    fn notice_drive_states(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        for index in 0..self.axes.len() {
            let (Some(axis), Some(known)) = (self.axes.get(index), self.drive_states.get_mut(index)) else {
                continue;
            };
            let (state, statusword) = (axis.drive_state(), axis.statusword());
            if *known != state {
                *known = state;
                self.happened(now_ns, EventKind::DriveState { axis: index as u8, state, statusword }, door);
            }
        }
    }

    fn write_commands(&mut self, slot: u64) {
        let resetting = self.fault_reset;
        self.fault_reset = resetting.saturating_sub(1);
        // Low first, so that what follows is an edge whatever was sent before.
        let reset_word = match resetting {
            0 => None,
            1..=FAULT_RESET_CYCLES => Some(controlword::FAULT_RESET),
            _ => Some(controlword::DISABLE_VOLTAGE),
        };
        for axis in &mut self.axes {
            let is_held_back = self.held_back.contains(axis.parameters().bus.into());
            if has_cycle_of(&self.buses, axis, slot) && !is_held_back {
                // A drive that falls out of operation enabled is not led back by what the others are still to do.
                let is_led_up = self.phase == Phase::Enabling || axis.is_enabled();
                let goal = match self.goal {
                    Goal::Enabled if self.phase == Phase::Stopping && axis.stops_by_itself() => {
                        Goal::QuickStop
                    }
                    Goal::Enabled if !is_led_up => Goal::Disabled,
                    goal => goal,
                };
                axis.command(goal, reset_word.filter(|_| axis.drive_state().is_faulted()));
            }
        }
    }

    fn enter(&mut self, phase: Phase, now_ns: Nanoseconds, door: &mut impl Door) {
        if phase != self.phase {
            let kind = EventKind::PhaseChanged { from: self.phase, to: phase };
            self.happened(now_ns, kind, door);
            self.phase = phase;
        }
        self.phase_cycles = 0;
    }

    /// The set-points of a bus, if it has a cycle in this slot.
    pub fn set_points(&self, bus: usize, slot: u64, batch: &mut SendBatch) {
        let has_cycle = self.buses.get(bus).is_some_and(|parameters| has_cycle(parameters, slot));
        if !has_cycle || self.held_back.contains(bus) {
            return;
        }
        for axis in self.axes.iter().filter(|axis| usize::from(axis.parameters().bus) == bus) {
            for frame in axis.frames() {
                let _ = batch.try_push(frame);
            }
        }
    }

    /// The heartbeat and TIME when they are due, and service frames as far as the budget goes: what follows the set-points.
    pub fn services(&self, bus: usize, door: &mut impl Door, batch: &mut SendBatch) {
        if let Some(heartbeat) = self.heartbeat.filter(|_| self.heartbeat_due == 0) {
            let _ = batch.try_push(Frame::of(Id::canopen(0x700, heartbeat.node), [NMT_OPERATIONAL]));
        }
        // A bus that is behind is spared: the next one tells the time as well.
        let time = self.time.filter(|_| !self.held_back.contains(bus)).and_then(|time| time.message());
        batch.extend(time);
        let Some(parameters) = self.buses.get(bus) else { return };
        let budget = match self.phase {
            Phase::Passive => parameters.service_frames_passive,
            _ => parameters.service_frames_active,
        };
        for _ in 0..budget.min(batch.remaining_capacity()) {
            match door.service_frame(bus) {
                Some(frame) => batch.push(frame),
                None => break,
            }
        }
    }

    /// An interface had no room for all that it was handed: set-points may be missing.
    pub fn not_taken(&mut self) {
        self.is_not_taken = true;
    }

    /// Ends the cycle: leaves its record and shows the new state.
    pub fn finish(&mut self, timing: Timing, now_ns: Nanoseconds, buses: &[BusHealth], door: &mut impl Door) {
        if let Some(heartbeat) = self.heartbeat {
            self.heartbeat_due = match self.heartbeat_due {
                0 => heartbeat.cycles.saturating_sub(1),
                cycles => cycles - 1,
            };
        }
        let missed_slots = self.record.timing.missed_slots;
        self.record.timing = Timing { missed_slots, ..timing };
        self.record.phase = self.phase;
        for (axis, record) in self.axes.iter().zip(&mut self.record.axes) {
            axis.record(self.period_s, record);
        }
        if !door.record(&self.record) {
            self.dropped += 1;
        }
        self.show(timing.slot, now_ns, buses);
        door.publish(&self.snapshot);
    }

    fn show(&mut self, slot: u64, now_ns: Nanoseconds, buses: &[BusHealth]) {
        let snapshot = &mut self.snapshot;
        snapshot.slot = slot;
        snapshot.at_ns = now_ns;
        snapshot.phase = self.phase;
        snapshot.missed_slots = self.missed_slots;
        snapshot.timing = self.timing_level;
        snapshot.clamped = self.clamped;
        snapshot.dropped = self.dropped;
        snapshot.refused = self.refused;
        snapshot.finished_move = self.finished_move;
        let is_on_way = matches!(self.phase, Phase::Moving | Phase::Stopping);
        snapshot.remaining_s = if is_on_way { self.motion.remaining_s() } else { 0.0 };
        snapshot.stop = self.stop;
        for (axis, shown) in self.axes.iter().zip(&mut snapshot.axes) {
            *shown = AxisSnapshot {
                position_set: axis.set_point().position,
                position: axis.position(),
                velocity: axis.velocity(),
                statusword: axis.statusword(),
                drive_state: axis.drive_state(),
                error_code: axis.error_code(),
                is_heard: axis.is_heard(),
            };
        }
        for (shown, health) in snapshot.buses.iter_mut().zip(buses) {
            *shown = *health;
        }
    }
}

const NMT: Id = Id::canopen(0x000, 0);
const NMT_OPERATIONAL: u8 = 5;

const fn has_cycle(bus: &BusParameters, slot: u64) -> bool {
    slot.is_multiple_of(bus.divider as u64)
}

fn has_cycle_of(buses: &[BusParameters], axis: &Axis, slot: u64) -> bool {
    buses.get(usize::from(axis.parameters().bus)).is_some_and(|bus| has_cycle(bus, slot))
}

/// Has the set-points of axes on faster buses wait for those on the slowest: a joint is where the trajectory was two
/// cycles of its bus ago.
fn on_one_time(mut axes: ArrayVec<Axis, MAX_AXES>, buses: &[BusParameters]) -> ArrayVec<Axis, MAX_AXES> {
    let divider = |axis: &Axis| buses.get(usize::from(axis.parameters().bus)).map_or(1, |bus| bus.divider);
    // A drive in a profile mode gets no set-points that anybody would have to wait for.
    let slowest = axes.iter().filter(|axis| !axis.is_profile()).map(divider).max().unwrap_or(1);
    for axis in &mut axes {
        axis.delay_set_points(slowest.saturating_sub(divider(axis)).saturating_mul(2));
    }
    axes
}

fn enter(table: &mut Dispatch, axis: usize, own: &AxisParameters) -> Result<(), SetUpError> {
    if own.commands.is_empty() || own.feedback.is_empty() {
        return Err(SetUpError::NoPdo { axis });
    }
    if !own.limits.are_possible() {
        return Err(SetUpError::ImpossibleLimits { axis });
    }
    let taken = |taken: IdTaken| SetUpError::IdTaken { axis, id: taken.id };
    table.emergency(Id::canopen(0x080, own.node), axis as u8).map_err(taken)?;
    for (number, pdo) in own.feedback.iter().enumerate() {
        table.feedback(pdo.id, axis as u8, number as u8).map_err(taken)?;
    }
    table.error_control(Id::canopen(0x700, own.node), axis as u8).map_err(taken)?;
    for command in &own.commands {
        table.foreign(command.pdo.id);
    }
    for id in &own.unused {
        table.unused(*id, axis as u8).map_err(taken)?;
    }
    Ok(())
}
