//! What is asked of the group, and what of it is possible now.

use super::{Engine, FAULT_RESET_CYCLES};
use crate::axis::Axis;
use crate::cia402::Goal;
use crate::control::ControlLaw;
use crate::door::{Asked, Door, Move, ProfileMove, Request};
use crate::guard;
use crate::motion::Leg;
use crate::plan::State;
use crate::profile::ProfileTarget;
use crate::record::EventKind;
use crate::stop::{Phase, Rule, StopCategory};
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

impl Engine {
    pub(super) fn take(&mut self, asked: &Asked, now_ns: Nanoseconds, door: &mut impl Door) {
        let is_latched = self.stop.is_some_and(|stop| stop.rule != Rule::Requested);
        let is_done = match asked.request {
            Request::Sync(on) => {
                if on && !self.is_sync_on {
                    self.axes.iter_mut().for_each(Axis::begin_sync);
                }
                self.is_sync_on = on;
                true
            }
            Request::TimeOfDay { at_zero_ns } => {
                self.time.as_mut().map(|time| time.set(at_zero_ns)).is_some()
            }
            Request::RatedTorque { axis, torque } => {
                self.axes.get_mut(usize::from(axis)).is_some_and(|axis| axis.set_rated_torque(torque))
            }
            Request::ProcessData(data) => self.set_process_data(&data).is_some(),
            Request::Position { axis, counts } => {
                self.axes.get_mut(usize::from(axis)).map(|axis| axis.set_reported_position(counts)).is_some()
            }
            Request::Activate => self.activate(now_ns, door),
            Request::Enable if self.phase == Phase::Disabled && !is_latched && !self.is_retired => {
                self.stop = None;
                self.begin_watch();
                self.goal = Goal::Enabled;
                self.hasten_heartbeats();
                self.enter(Phase::Enabling, now_ns, door);
                true
            }
            Request::Move(parameters) if !is_latched => self.begin_move(&parameters, now_ns, door),
            Request::SetProfileTarget(target) if !is_latched => {
                self.set_profile_target(&target, now_ns, door)
            }
            Request::Stream if self.phase == Phase::Holding && !is_latched && self.is_punctual() => {
                self.stop = None;
                self.stream = None;
                self.is_stream_begun = false;
                self.enter(Phase::Streaming, now_ns, door);
                true
            }
            Request::Stop(category) => {
                self.begin_stop(Rule::Requested, Some(category), None, 0.0, 0.0, now_ns, door);
                true
            }
            Request::Disable => self.begin_disable(now_ns, door),
            Request::ResetFaults => self.reset_faults(),
            Request::Retire => {
                self.is_retired = true;
                true
            }
            Request::Leave => {
                self.is_leaving = true;
                true
            }
            Request::Enable | Request::Move(_) | Request::SetProfileTarget(_) | Request::Stream => false,
        };
        self.refusals.note(asked.id, !is_done);
        if !is_done {
            self.refused += 1;
            self.happened(now_ns, EventKind::Refused { phase: self.phase }, door);
        }
    }

    /// Whether whoever streams set-points can count on the slots.
    fn is_punctual(&self) -> bool {
        self.timing_level < TimingLevel::Degraded
    }

    /// Forgets what was seen while nothing could move.
    fn begin_watch(&mut self) {
        self.axes.iter_mut().for_each(Axis::begin_watch);
        self.foreign_id = None;
        self.missed.empty();
    }

    fn activate(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        if self.phase != Phase::Passive {
            return false;
        }
        self.goal = Goal::Disabled;
        self.axes.iter_mut().for_each(Axis::start_from_actual);
        self.enter(Phase::Disabled, now_ns, door);
        true
    }

    fn begin_move(&mut self, parameters: &Move, now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        let scale = |value: f64| value > 0.0 && value <= 1.0;
        let is_possible = matches!(self.phase, Phase::Holding | Phase::Moving)
            && scale(parameters.velocity_scale)
            && scale(parameters.acceleration_scale)
            && parameters.minimum_duration_s.is_finite()
            && self
                .axes
                .iter()
                .zip(parameters.target.into_iter().zip(parameters.target_velocity))
                .all(|(axis, (position, velocity))| is_target(axis, position, velocity, self.period_s));
        if !is_possible {
            return false;
        }
        let targets = parameters.target.into_iter().zip(parameters.target_velocity);
        let legs = self.axes.iter().zip(targets).map(|(axis, (position, velocity))| {
            let start = axis.set_point();
            let target = State { position, velocity, acceleration: 0.0 };
            let limits = &axis.parameters().limits;
            // A drive in a profile mode makes its own way: nothing is planned for it.
            if axis.is_profile() {
                Leg::standing(start.position, limits)
            } else {
                Leg { start, target, limits }
            }
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
        for (axis, position) in self.axes.iter_mut().zip(parameters.target) {
            if axis.accepts(ProfileTarget::Position(position)) {
                axis.set_profile_target(ProfileTarget::Position(position), Nanoseconds::MAX);
            }
        }
        self.stop = None;
        self.move_id = parameters.id;
        self.enter(Phase::Moving, now_ns, door);
        true
    }

    fn set_profile_target(
        &mut self,
        wanted: &ProfileMove,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) -> bool {
        let index = usize::from(wanted.axis);
        let is_possible = matches!(self.phase, Phase::Holding | Phase::Moving);
        if !(is_possible && self.axes.get(index).is_some_and(|axis| axis.accepts(wanted.target))) {
            return false;
        }
        // The other axes stay where they are, not where the last trajectory ended.
        if self.phase == Phase::Holding && self.plan_standstill().is_err() {
            return false;
        }
        if let Some(axis) = self.axes.get_mut(index) {
            axis.set_profile_target(wanted.target, wanted.valid_until_ns);
        }
        self.stop = None;
        self.move_id = wanted.id;
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
                self.fault_reset = 3 * FAULT_RESET_CYCLES;
                self.axes.iter_mut().for_each(Axis::begin_fault_reset);
            }
            Phase::Holding => {}
            _ => return false,
        }
        self.stop = None;
        true
    }
}

/// Whether an axis can be sent to a position, and be stopped behind it where it passes it at speed: up to a cycle later.
/// One that is driven by velocity or torque has none to go to, and is left as it is.
fn is_target(axis: &Axis, position: f64, velocity: f64, period_s: f64) -> bool {
    let limits = &axis.parameters().limits;
    let way = |velocity: f64| velocity.max(0.0) * period_s + guard::braking_distance(limits, velocity, 0.0);
    match axis.parameters().law {
        ControlLaw::ProfileVelocity | ControlLaw::ProfileTorque => true,
        ControlLaw::ProfilePosition => limits.contain(position),
        _ if velocity == 0.0 => limits.contain(position),
        _ => limits.contain(position + way(velocity)) && limits.contain(position - way(-velocity)),
    }
}
