//! The cycle as pure computation: frames and time in, frames out.
//!
//! [`Engine`] holds the axes and the phase that the group is in. Each slot it gives SYNC, takes what the drives
//! report, decides in [`Engine::compute`] (requests, supervision, motion, guard, commands), and gives the set-points.
//! It knows neither clocks nor buses; [`crate::cycle`] drives it.

use arrayvec::ArrayVec;

use crate::axis::{Axis, AxisParameters};
use crate::cia402::{Goal, controlword};
use crate::dispatch::{Destination, Dispatch};
use crate::door::{AxisSnapshot, Door, Move, Request, Snapshot, StreamCommand};
use crate::frame::{Frame, Id};
use crate::motion::{Leg, Motion};
use crate::plan::{PlanError, State};
use crate::port::{BusHealth, BusState, Received};
use crate::record::{CycleRecord, Event, EventKind, MAX_AXES, MAX_BUSES, Timing};
use crate::stop::{Phase, Rule, StopCategory, StopReason};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// The most frames the engine hands to one bus in one cycle.
pub const SEND_BATCH: usize = 64;

/// Frames for one bus.
pub type SendBatch = ArrayVec<Frame, SEND_BATCH>;

/// Requests looked at in one cycle; the rest waits, so that a flood costs a bounded time.
const REQUESTS_PER_CYCLE: usize = 4;
/// How long controlword bit 7 is held low before, and high in, a fault reset.
const FAULT_RESET_CYCLES: u32 = 10;

/// A bus as the engine knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusParameters {
    /// Identifier of SYNC.
    pub sync_id: Id,
    /// The most service frames in a cycle while set-points are sent.
    pub service_frames_active: usize,
    /// The most service frames in a cycle before that.
    pub service_frames_passive: usize,
}

/// The heartbeat of this controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Its node number.
    pub node: u8,
    /// Cycles from one to the next.
    pub cycles: u32,
}

/// Everything about the group that does not change while it runs.
#[derive(Clone, Debug)]
pub struct EngineParameters {
    /// The period of the cycle.
    pub period_ns: Nanoseconds,
    /// The axes.
    pub axes: ArrayVec<AxisParameters, MAX_AXES>,
    /// The buses.
    pub buses: ArrayVec<BusParameters, MAX_BUSES>,
    /// The heartbeat, if one is sent.
    pub heartbeat: Option<Heartbeat>,
    /// Cycles within which every drive must reach operation enabled.
    pub enable_timeout_cycles: u32,
    /// Cycles in a row in which set-points may fail to get onto the wire.
    pub not_transmitted_cycles: u32,
}

/// Whether the set-points of a cycle can leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transmission {
    /// They can.
    Free,
    /// It is too late in the slot: they would run into the next SYNC. Counts as a missed slot.
    TooLate,
    /// Set-points of an earlier cycle are still waiting for the wire somewhere; more behind them would be stale
    /// when they get there.
    Blocked,
}

/// Why an engine cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetUpError {
    /// The period is zero.
    NoPeriod,
    /// There is no axis.
    NoAxis,
    /// An axis names a bus that is not there.
    UnknownBus {
        /// The axis.
        axis: usize,
    },
    /// An axis has no PDO in one of the directions.
    NoPdo {
        /// The axis.
        axis: usize,
    },
    /// A limit of an axis is not a number that can be kept.
    ImpossibleLimits {
        /// The axis.
        axis: usize,
    },
    /// Two axes of a bus expect the same identifier.
    IdTaken {
        /// The axis that came second.
        axis: usize,
        /// The identifier.
        id: Id,
    },
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
    enable_timeout_cycles: u32,
    not_transmitted_cycles: u32,

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
        let mut dispatch: [Dispatch; MAX_BUSES] = core::array::from_fn(|_| Dispatch::default());
        for (axis, own) in parameters.axes.iter().enumerate() {
            let is_bus_known = usize::from(own.bus) < parameters.buses.len();
            let table = dispatch.get_mut(usize::from(own.bus)).filter(|_| is_bus_known);
            enter(table.ok_or(SetUpError::UnknownBus { axis })?, axis, own)?;
        }
        let record = CycleRecord { axis_count: parameters.axes.len() as u8, ..CycleRecord::default() };
        let snapshot = Snapshot {
            axis_count: parameters.axes.len() as u8,
            bus_count: parameters.buses.len() as u8,
            ..Snapshot::default()
        };
        Ok(Self {
            period_ns: parameters.period_ns,
            period_s: parameters.period_ns as f64 / NANOSECONDS_PER_SECOND as f64,
            axes: parameters.axes.into_iter().map(Axis::new).collect(),
            buses: parameters.buses,
            dispatch,
            heartbeat: parameters.heartbeat,
            enable_timeout_cycles: parameters.enable_timeout_cycles,
            not_transmitted_cycles: parameters.not_transmitted_cycles,
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

    /// The SYNC of a bus, if it is to be sent.
    pub fn sync(&self, bus: usize) -> Option<Frame> {
        if !self.is_sync_on {
            return None;
        }
        self.buses.get(bus).map(|parameters| Frame::of(parameters.sync_id, []))
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

    /// The thinking of one cycle. Nothing moves on unless the set-points can leave.
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
        for axis in &mut self.axes {
            axis.begin_cycle(self.period_s * elapsed as f64);
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
        }
        self.supervise(buses, transmission, now_ns, door);
        let has_commands = transmission == Transmission::Free && self.phase != Phase::Passive;
        if has_commands {
            self.act(now_ns, door);
            self.write_commands();
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
        self.record.timing.missed_slots = missed;
        if missed > 0 {
            self.missed_slots += missed;
            self.happened(now_ns, EventKind::MissedSlots { count: missed }, door);
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
                self.happened(now_ns, EventKind::DriveState { axis: index as u8, statusword }, door);
            }
        }
    }

    // ---- requests ----------------------------------------------------------------------------------------

    fn take(&mut self, request: Request, now_ns: Nanoseconds, door: &mut impl Door) {
        let is_latched = self.stop.is_some_and(|stop| stop.rule != Rule::Requested);
        let is_done = match request {
            Request::Sync(on) => {
                self.is_sync_on = on;
                true
            }
            Request::RatedTorque { axis, torque } => {
                self.axes.get_mut(usize::from(axis)).is_some_and(|axis| axis.set_rated_torque(torque))
            }
            Request::Activate => self.activate(now_ns, door),
            Request::Enable if self.phase == Phase::Disabled && !is_latched => {
                self.stop = None;
                self.goal = Goal::Enabled;
                self.enter(Phase::Enabling, now_ns, door);
                true
            }
            Request::Move(parameters) if !is_latched => self.begin_move(&parameters, now_ns, door),
            Request::Stream if self.phase == Phase::Holding && !is_latched => {
                self.stop = None;
                self.stream = None;
                self.enter(Phase::Streaming, now_ns, door);
                true
            }
            Request::Stop(category) => {
                self.begin_stop(Rule::Requested, Some(category), None, 0.0, 0.0, now_ns, door);
                true
            }
            Request::Disable => self.begin_disable(now_ns, door),
            Request::ResetFaults => self.reset_faults(),
            Request::Leave => {
                self.is_leaving = true;
                true
            }
            Request::Enable | Request::Move(_) | Request::Stream => false,
        };
        if !is_done {
            self.refused += 1;
            self.happened(now_ns, EventKind::Refused { phase: self.phase }, door);
        }
    }

    fn activate(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        if self.phase != Phase::Passive {
            return false;
        }
        self.goal = Goal::Disabled;
        self.enter(Phase::Disabled, now_ns, door);
        true
    }

    fn begin_move(&mut self, parameters: &Move, now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        let scale = |value: f64| value > 0.0 && value <= 1.0;
        let is_possible = matches!(self.phase, Phase::Holding | Phase::Moving)
            && scale(parameters.velocity_scale)
            && scale(parameters.acceleration_scale)
            && parameters.minimum_duration_s.is_finite()
            && self.axes.iter().zip(parameters.target).all(|(axis, to)| axis.parameters().limits.contain(to));
        if !is_possible {
            return false;
        }
        let targets = parameters.target.into_iter().zip(parameters.target_velocity);
        let legs = self.axes.iter().zip(targets).map(|(axis, (position, velocity))| Leg {
            start: axis.set_point(),
            target: State { position, velocity, acceleration: 0.0 },
            limits: &axis.parameters().limits,
        });
        let planned = self.motion.move_to(
            legs,
            parameters.velocity_scale,
            parameters.acceleration_scale,
            parameters.minimum_duration_s,
        );
        if planned.is_err() {
            return false;
        }
        self.stop = None;
        self.move_id = parameters.id;
        self.enter(Phase::Moving, now_ns, door);
        true
    }

    fn begin_disable(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        match self.phase {
            Phase::Passive => return false,
            Phase::Disabled | Phase::Disabling => {}
            Phase::Enabling | Phase::Holding => {
                self.goal = Goal::Disabled;
                self.enter(Phase::Disabling, now_ns, door);
            }
            Phase::Moving | Phase::Streaming | Phase::Stopping => {
                self.begin_stop(Rule::Requested, Some(StopCategory::One), None, 0.0, 0.0, now_ns, door);
            }
        }
        true
    }

    fn reset_faults(&mut self) -> bool {
        match self.phase {
            Phase::Disabled => {
                self.fault_reset = 2 * FAULT_RESET_CYCLES;
                for axis in &mut self.axes {
                    axis.receive_emergency(0);
                }
            }
            Phase::Holding => {}
            _ => return false,
        }
        self.stop = None;
        true
    }

    // ---- supervision -------------------------------------------------------------------------------------

    fn supervise(
        &mut self,
        buses: &[BusHealth],
        transmission: Transmission,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) {
        let is_blocked = transmission == Transmission::Blocked;
        self.blocked_cycles = if is_blocked { self.blocked_cycles.saturating_add(1) } else { 0 };
        if !has_power(self.phase) {
            return;
        }
        for (bus, health) in buses.iter().enumerate().take(self.buses.len()) {
            if matches!(health.state, BusState::BusOff | BusState::Down) {
                self.begin_stop(Rule::BusLost, None, None, bus as f64, 0.0, now_ns, door);
            }
        }
        if self.blocked_cycles > self.not_transmitted_cycles {
            let (cycles, limit) = (self.blocked_cycles.into(), self.not_transmitted_cycles.into());
            self.begin_stop(Rule::NotTransmitted, None, None, cycles, limit, now_ns, door);
        }
        for index in 0..self.axes.len() {
            let Some((rule, value, limit)) =
                self.axes.get_mut(index).and_then(|axis| complaint(axis, self.phase))
            else {
                continue;
            };
            self.begin_stop(rule, None, Some(index as u8), value, limit, now_ns, door);
        }
    }

    // ---- stops -------------------------------------------------------------------------------------------

    /// Begins a stop. The first reason stays the reason; a later one can only make the stop harder.
    #[expect(clippy::too_many_arguments, reason = "they are the fields of the reason")]
    fn begin_stop(
        &mut self,
        rule: Rule,
        category: Option<StopCategory>,
        axis: Option<u8>,
        value: f64,
        limit: f64,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) {
        let wanted = category.unwrap_or(rule.default_category());
        let slot = self.last_slot.unwrap_or(0);
        let reason = StopReason { category: wanted, rule, axis, value, limit, slot, phase: self.phase };
        let is_under_way = matches!(self.phase, Phase::Stopping | Phase::Disabling);
        match self.stop {
            Some(present) if is_under_way || present.rule != Rule::Requested => {
                if wanted >= present.category {
                    return;
                }
                self.stop = Some(StopReason { category: wanted, ..present });
            }
            _ => {
                self.stop = Some(reason);
                self.happened(now_ns, EventKind::Stop(reason), door);
            }
        }
        self.carry_out(wanted, now_ns, door);
    }

    fn carry_out(&mut self, category: StopCategory, now_ns: Nanoseconds, door: &mut impl Door) {
        match (self.phase, category) {
            (Phase::Passive | Phase::Disabled, _) => {}
            (_, StopCategory::Zero) => {
                // While the power goes, the set-points go on to rest at the limits: a drive that is slow to obey
                // gets no step. Without a trajectory to rest they stay where they are.
                if self.plan_stop().is_err() {
                    self.motion.cancel();
                }
                self.goal = Goal::NoVoltage;
                self.enter(Phase::Disabling, now_ns, door);
            }
            (Phase::Enabling, _) | (Phase::Holding, StopCategory::One) => {
                self.goal = Goal::Disabled;
                self.enter(Phase::Disabling, now_ns, door);
            }
            (Phase::Moving | Phase::Streaming, _) => {
                if self.plan_stop().is_ok() {
                    self.enter(Phase::Stopping, now_ns, door);
                } else {
                    // No trajectory to rest can be computed: the drives' own brakes are what is left.
                    self.motion.cancel();
                    self.goal = Goal::NoVoltage;
                    self.enter(Phase::Disabling, now_ns, door);
                }
            }
            (Phase::Stopping | Phase::Disabling | Phase::Holding, _) => {}
        }
    }

    fn plan_stop(&mut self) -> Result<(), PlanError> {
        self.motion.stop(self.axes.iter().map(|axis| (axis.set_point(), &axis.parameters().limits)))
    }

    // ---- motion ------------------------------------------------------------------------------------------

    fn act(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        match self.phase {
            Phase::Passive => {}
            Phase::Disabled => self.hold(),
            Phase::Enabling => self.wait_for_drives(now_ns, door),
            Phase::Holding => self.hold(),
            Phase::Moving | Phase::Stopping => self.follow_motion(now_ns, door),
            Phase::Streaming => self.follow_stream(now_ns, door),
            Phase::Disabling => {
                self.come_to_rest();
                // A drive that has fallen silent never shows that it has obeyed; it is not waited for without end.
                let is_patient =
                    !self.motion.is_finished() || self.phase_cycles <= self.enable_timeout_cycles;
                if !(is_patient && self.axes.iter().any(|axis| axis.drive_state().has_torque())) {
                    self.motion.cancel();
                    self.goal = Goal::Disabled;
                    self.enter(Phase::Disabled, now_ns, door);
                }
            }
        }
    }

    fn wait_for_drives(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        self.hold();
        if self.axes.iter().all(Axis::is_enabled) {
            self.enter(Phase::Holding, now_ns, door);
        } else if self.phase_cycles > self.enable_timeout_cycles {
            let axis = self.axes.iter().position(|axis| !axis.is_enabled()).map(|axis| axis as u8);
            let (value, limit) = (self.phase_cycles.into(), self.enable_timeout_cycles.into());
            self.begin_stop(Rule::EnableTimeout, None, axis, value, limit, now_ns, door);
        }
    }

    /// Enabled axes stay on their set-point; the set-point of the others follows them.
    fn hold(&mut self) {
        for axis in &mut self.axes {
            if axis.is_enabled() {
                axis.advance(State { position: axis.set_point().position, ..State::default() });
            } else {
                axis.follow_actual();
            }
        }
    }

    /// As [`Engine::hold`], but what is still on its way to rest goes on.
    fn come_to_rest(&mut self) {
        if self.motion.is_finished() {
            return self.hold();
        }
        self.motion.advance(self.period_s);
        for (axis, next) in self.axes.iter_mut().zip(self.motion.states()) {
            if axis.is_enabled() { axis.advance(next) } else { axis.follow_actual() }
        }
    }

    fn follow_motion(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        self.motion.advance(self.period_s);
        let next: ArrayVec<State, MAX_AXES> = self.motion.states().take(self.axes.len()).collect();
        if !self.advance_guarded(&next, now_ns, door) || !self.motion.is_finished() {
            return;
        }
        if self.phase == Phase::Moving {
            let is_at_rest = next.iter().all(|state| state.velocity == 0.0);
            if is_at_rest {
                self.finished_move = self.move_id;
                self.happened(now_ns, EventKind::MoveFinished { id: self.move_id }, door);
                self.enter(Phase::Holding, now_ns, door);
            } else {
                self.begin_stop(Rule::Requested, Some(StopCategory::Two), None, 0.0, 0.0, now_ns, door);
            }
            return;
        }
        match self.stop.map(|stop| stop.category) {
            Some(StopCategory::Two) => self.enter(Phase::Holding, now_ns, door),
            _ => {
                self.goal = Goal::Disabled;
                self.enter(Phase::Disabling, now_ns, door);
            }
        }
    }

    fn follow_stream(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        let Some(command) = self.stream else {
            // Nothing has come yet: the owner has one enable time-out to begin.
            self.hold();
            if self.phase_cycles > self.enable_timeout_cycles {
                let (value, limit) = (self.phase_cycles.into(), self.enable_timeout_cycles.into());
                self.begin_stop(Rule::StaleCommand, None, None, value, limit, now_ns, door);
            }
            return;
        };
        if now_ns > command.valid_until_ns {
            let age_cycles = (now_ns - command.valid_until_ns).div_ceil(self.period_ns);
            self.begin_stop(Rule::StaleCommand, None, None, age_cycles as f64, 0.0, now_ns, door);
            return self.follow_motion_if_stopping(now_ns, door);
        }
        let next: ArrayVec<State, MAX_AXES> =
            command.set_points.iter().take(self.axes.len()).copied().collect();
        if self.advance_guarded(&next, now_ns, door) {
            // Until the next command comes the present one is carried on at its velocity, up to its expiry.
            let period_s = self.period_s;
            if let Some(held) = &mut self.stream {
                held.set_points.iter_mut().for_each(|point| point.position += point.velocity * period_s);
            }
        }
    }

    /// Takes the next set-points of all axes if the guard agrees to each. If not, the group stops from where it
    /// was, in this same cycle. Returns whether they were taken.
    fn advance_guarded(&mut self, next: &[State], now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        let refusal = self.axes.iter().zip(next).enumerate().find_map(|(index, (axis, state))| {
            let violation = axis.is_enabled().then(|| axis.check(state, self.period_s).err()).flatten();
            violation.map(|violation| (index as u8, violation))
        });
        if let Some((axis, violation)) = refusal {
            let was_stopping = self.phase == Phase::Stopping;
            let category = was_stopping.then_some(StopCategory::Zero);
            let (rule, value, limit) = (violation.rule, violation.value, violation.limit);
            self.begin_stop(rule, category, Some(axis), value, limit, now_ns, door);
            if was_stopping {
                self.hold();
            } else {
                self.follow_motion_if_stopping(now_ns, door);
            }
            return false;
        }
        for (axis, state) in self.axes.iter_mut().zip(next) {
            if axis.is_enabled() { axis.advance(*state) } else { axis.follow_actual() }
        }
        true
    }

    fn follow_motion_if_stopping(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        if self.phase == Phase::Stopping {
            self.follow_motion(now_ns, door);
        } else {
            self.hold();
        }
    }

    // ---- commands ----------------------------------------------------------------------------------------

    fn write_commands(&mut self) {
        let resetting = self.fault_reset;
        self.fault_reset = resetting.saturating_sub(1);
        for axis in &mut self.axes {
            let word = if resetting > 0 && axis.drive_state().is_faulted() {
                // Low first, so that what follows is an edge whatever was sent before.
                if resetting > FAULT_RESET_CYCLES {
                    controlword::DISABLE_VOLTAGE
                } else {
                    controlword::FAULT_RESET
                }
            } else {
                axis.controlword_towards(self.goal)
            };
            axis.command(word, axis.is_enabled());
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

    /// The set-points of a bus.
    pub fn set_points(&self, bus: usize, batch: &mut SendBatch) {
        for axis in self.axes.iter().filter(|axis| usize::from(axis.parameters().bus) == bus) {
            for frame in axis.frames() {
                let _ = batch.try_push(frame);
            }
        }
    }

    /// The heartbeat when it is due, and service frames as far as the budget goes: what follows the set-points.
    pub fn services(&self, bus: usize, door: &mut impl Door, batch: &mut SendBatch) {
        if let Some(heartbeat) = self.heartbeat.filter(|_| self.heartbeat_due == 0) {
            let _ = batch.try_push(Frame::of(Id::canopen(0x700, heartbeat.node), [NMT_OPERATIONAL]));
        }
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
                error_code: axis.error_code(),
                is_heard: axis.is_heard(),
            };
        }
        for (shown, health) in snapshot.buses.iter_mut().zip(buses) {
            *shown = *health;
        }
    }
}

const NMT_OPERATIONAL: u8 = 5;

fn enter(table: &mut Dispatch, axis: usize, own: &AxisParameters) -> Result<(), SetUpError> {
    if own.commands.is_empty() || own.feedback.is_empty() {
        return Err(SetUpError::NoPdo { axis });
    }
    if !own.limits.are_possible() {
        return Err(SetUpError::ImpossibleLimits { axis });
    }
    let taken = |taken: crate::dispatch::IdTaken| SetUpError::IdTaken { axis, id: taken.id };
    table.emergency(Id::canopen(0x080, own.node), axis as u8).map_err(taken)?;
    for (number, pdo) in own.feedback.iter().enumerate() {
        table.feedback(pdo.id, axis as u8, number as u8).map_err(taken)?;
    }
    Ok(())
}

const fn has_power(phase: Phase) -> bool {
    !matches!(phase, Phase::Passive | Phase::Disabled)
}

/// What is wrong with an axis, if anything: rule, value, limit.
fn complaint(axis: &mut Axis, phase: Phase) -> Option<(Rule, f64, f64)> {
    let missed_limit = axis.parameters().missed_feedback_cycles;
    if axis.feedback_age() > missed_limit {
        return Some((Rule::MissedFeedback, axis.feedback_age().into(), missed_limit.into()));
    }
    if axis.drive_state().is_faulted() {
        return Some((Rule::DriveFault, axis.error_code().into(), 0.0));
    }
    if let Some(mode) = axis.foreign_mode().filter(|_| phase != Phase::Disabling) {
        let ours = axis.parameters().law.operation_mode() as i8;
        return Some((Rule::ModeChanged, mode.into(), ours.into()));
    }
    if matches!(phase, Phase::Enabling | Phase::Disabling) {
        return None;
    }
    if !axis.is_enabled() {
        return Some((Rule::DriveDisabled, axis.statusword().into(), 0.0));
    }
    axis.check_following().err().map(|violation| (violation.rule, violation.value, violation.limit))
}
