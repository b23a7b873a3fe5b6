//! The cycle as pure computation: frames and time in, frames out.
//!
//! [`Engine`] holds the axes and the phase that the group is in. Each slot it gives SYNC, takes what the drives
//! report, decides in [`Engine::compute`] (requests, supervision, motion, guard, commands), and gives the set-points.
//! It knows neither clocks nor buses; [`crate::cycle`] drives it.

mod behaviour;
mod last_word;
mod obstacle;
mod parameters;
mod process_data;
mod requests;
mod stops;
mod wire;

use arrayvec::ArrayVec;

use crate::axis::{Axis, FeedbackSince};
use crate::cia402::Goal;
use crate::dispatch::Dispatch;
use crate::door::{AxisSnapshot, Door, Snapshot, StreamCommand};
use crate::frame::Frame;
use crate::motion::Motion;
use crate::port::BusHealth;
use crate::record::{CycleRecord, Event, EventKind, MAX_AXES, MAX_BUSES, Timing};
use crate::stop::{Phase, StopCategories, StopReason};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::time_of_day::TimeProducer;
use crate::watch::{LeakyBucket, TimingLadder, TimingLevel};
use parameters::{axes_of, dispatch_of};

pub use parameters::{BusParameters, EngineParameters, Heartbeat, SetUpError};

/// The most frames the engine hands to one bus in one cycle.
pub const SEND_BATCH: usize = 64;

/// Frames for one bus.
pub type SendBatch = ArrayVec<Frame, SEND_BATCH>;

/// Requests looked at in one cycle; the rest waits, so that a flood costs a bounded time.
const REQUESTS_PER_CYCLE: usize = 4;
/// How long controlword bit 7 is held low before, and high in, a fault reset, and how long the drives have to answer it.
const FAULT_RESET_CYCLES: u32 = 10;
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

    /// Takes a bus away. Returns whether it was among them.
    pub fn take(&mut self, bus: usize) -> bool {
        let was_there = self.contains(bus);
        self.0 &= !(1 << (bus & 31));
        was_there
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
    is_retired: bool,
    is_leaving: bool,
    goal: Goal,
    motion: Motion,
    /// The move under way: its number and whether it ends in motion.
    move_id: u32,
    finished_move: u32,
    stream: Option<StreamCommand>,
    /// Whether a command of the present stream has been taken.
    is_stream_begun: bool,
    /// Whether a command has come that no set-point has been made of.
    is_stream_renewed: bool,
    clamped: u64,
    missed: LeakyBucket,
    timing_level: TimingLevel,
    /// The bus and the identifier of what was sent by somebody who may not.
    foreign_id: Option<(u8, u32)>,
    /// Whose interfaces have refused frames since the last cycle.
    not_taken: BusSet,
    held_back: BusSet,
    /// Whose next SYNC is left out.
    left_out: BusSet,
    stop: Option<StopReason>,
    /// Cycles of a fault reset that are still to come.
    fault_reset: u32,
    heartbeat_due: u32,
    /// Heartbeats that are still to leave before any drive is led up.
    heartbeats_awaited: u32,
    /// For how long own frames have waited for the wire or found no room, a bus each.
    blocked_cycles: [u32; MAX_BUSES],
    /// For how long own frames have waited for the wire, a bus each.
    held_back_cycles: [u32; MAX_BUSES],
    last_slot: Option<u64>,
    missed_slots: u64,
    dropped: u64,
    drive_states: [crate::cia402::State; MAX_AXES],
    record: CycleRecord,
    /// Also the place where the answers to requests are kept.
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
        let dispatch = dispatch_of(&parameters)?;
        let axes = axes_of(&parameters);
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
            is_retired: false,
            is_leaving: false,
            goal: Goal::Disabled,
            motion: Motion::default(),
            move_id: 0,
            finished_move: 0,
            stream: None,
            is_stream_begun: false,
            is_stream_renewed: false,
            clamped: 0,
            missed: LeakyBucket::default(),
            timing_level: TimingLevel::Normal,
            foreign_id: None,
            not_taken: BusSet::default(),
            held_back: BusSet::default(),
            left_out: BusSet::default(),
            stop: None,
            fault_reset: 0,
            heartbeat_due: 0,
            heartbeats_awaited: 0,
            blocked_cycles: [0; MAX_BUSES],
            held_back_cycles: [0; MAX_BUSES],
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

    fn happened(&mut self, at_ns: Nanoseconds, kind: EventKind, door: &mut impl Door) {
        let slot = self.last_slot.unwrap_or(0);
        if !door.event(&Event { slot, at_ns, kind }) {
            self.dropped += 1;
        }
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
                axis.begin_cycle(elapsed_s);
                if axis.parameters().feedback_since != FeedbackSince::Sync {
                    axis.expect_feedback(now_ns);
                }
            } else {
                axis.wait(elapsed_s)
            }
            axis.watch();
        }
        self.notice_drive_states(now_ns, door);
        for _ in 0..REQUESTS_PER_CYCLE {
            match door.request() {
                Some(asked) => self.take(&asked, now_ns, door),
                None => break,
            }
        }
        if let Some(command) = door.stream() {
            self.stream = Some(command);
            self.is_stream_renewed = true;
        }
        self.supervise(buses, transmission, now_ns, door);
        // A group that stops and whose set-points do not get out does not wait for them any longer, whatever it stops for.
        let is_given_up = self.stop.is_some() && self.longest_blocked().1 > self.not_transmitted_cycles;
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
        self.command_by_service();
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

    /// Begins a phase. One that is under way goes on, and what it may last counts from its first beginning.
    fn enter(&mut self, phase: Phase, now_ns: Nanoseconds, door: &mut impl Door) {
        if phase == self.phase {
            return;
        }
        let kind = EventKind::PhaseChanged { from: self.phase, to: phase };
        self.happened(now_ns, kind, door);
        self.phase = phase;
        self.phase_cycles = 0;
    }

    /// Ends the cycle: leaves its record and shows the new state.
    pub fn finish(&mut self, timing: Timing, now_ns: Nanoseconds, buses: &[BusHealth], door: &mut impl Door) {
        if let Some(heartbeat) = self.heartbeat {
            match self.heartbeat_due {
                0 => self.has_beaten(heartbeat),
                _ => self.heartbeat_due -= 1,
            }
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
                unanswered: axis.unanswered(),
            };
        }
        for (shown, health) in snapshot.buses.iter_mut().zip(buses) {
            *shown = *health;
        }
    }
}

const fn has_cycle(bus: &BusParameters, slot: u64) -> bool {
    slot.is_multiple_of(bus.divider as u64)
}

fn has_cycle_of(buses: &[BusParameters], axis: &Axis, slot: u64) -> bool {
    buses.get(usize::from(axis.parameters().bus)).is_some_and(|bus| has_cycle(bus, slot))
}
