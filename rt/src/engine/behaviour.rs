//! What the group does in each phase: where every axis is to be next.

use arrayvec::ArrayVec;

use super::Engine;
use crate::axis::Axis;
use crate::cia402::Goal;
use crate::door::Door;
use crate::guard::{OnViolation, Violation};
use crate::plan::State;
use crate::record::{EventKind, MAX_AXES};
use crate::stop::{Origin, Phase, Rule, StopCategory};
use crate::time::Nanoseconds;

impl Engine {
    pub(super) fn act(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        match self.phase {
            Phase::Passive => {}
            Phase::Disabled => self.hold(),
            Phase::Enabling => self.wait_for_drives(now_ns, door),
            Phase::Holding => self.hold(),
            Phase::Moving | Phase::Stopping => self.follow_motion(now_ns, door),
            Phase::Streaming => self.follow_stream(now_ns, door),
            Phase::Disabling => {
                self.come_to_rest();
                let is_on_way = !self.motion.is_finished();
                // A drive that does not show that it has obeyed is not waited for without end.
                let is_patient = is_on_way || self.phase_cycles <= self.enable_timeout_cycles;
                // One that says nothing has either heard what it was told, or has missed the heartbeats for so long that it has
                // stopped by itself. To one that hears SDO alone it is told by SDO.
                let has_stopped_by_itself = |axis: &Axis| {
                    let bus = self.buses.get(usize::from(axis.parameters().bus));
                    let silent_cycles = u32::from(axis.feedback_age()) * bus.map_or(1, |bus| bus.divider);
                    let is_over = self.heartbeat.is_some_and(|beat| silent_cycles > beat.timeout_cycles);
                    is_over && !is_on_way && !axis.is_deaf()
                };
                // What is told to one that is believed to follow goes on to rest, though it may have said otherwise by SDO; and
                // one that shows no torque yet may be about to have it.
                let is_waited_for = |axis: &Axis| {
                    let may_have_torque =
                        axis.has_torque() || axis.is_led_up() || is_on_way && axis.drive_state().has_torque();
                    may_have_torque && !has_stopped_by_itself(axis)
                };
                if !(is_patient && self.axes.iter().any(is_waited_for)) {
                    self.motion.cancel();
                    self.goal = Goal::Disabled;
                    self.axes.iter_mut().for_each(Axis::let_go);
                    self.enter(Phase::Disabled, now_ns, door);
                }
            }
        }
    }

    fn wait_for_drives(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        self.hold();
        self.look_for_late_drives();
        self.axes.iter_mut().for_each(|axis| axis.prepare_to_enable(self.period_s));
        if self.axes.iter().all(|axis| axis.is_ready() && axis.is_enabled()) {
            self.enter(Phase::Holding, now_ns, door);
        } else if self.phase_cycles > self.enable_timeout_cycles {
            let late = self.axes.iter().position(|axis| !axis.is_enabled());
            let origin = late.map_or(Origin::Group, |axis| Origin::Axis(axis as u8));
            let (value, limit) = (self.phase_cycles.into(), self.enable_timeout_cycles.into());
            self.begin_stop(Rule::EnableTimeout, None, origin, value, limit, now_ns, door);
        }
    }

    /// Enabled axes stay on their set-point; the set-point of the others follows them.
    fn hold(&mut self) {
        for axis in &mut self.axes {
            if axis.is_enabled() { axis.stay() } else { axis.follow_actual(self.period_s) }
        }
    }

    /// What is still on its way to rest goes on as far as the guard agrees, and everything else stays where it is. Nothing
    /// follows a joint: a drive whose statusword is false still obeys.
    fn come_to_rest(&mut self) {
        let (period_s, is_on_way) = (self.period_s, !self.motion.is_finished());
        self.motion.advance(period_s);
        let next: ArrayVec<State, MAX_AXES> = self.motion.states().take(self.axes.len()).collect();
        if !is_on_way || self.violation(&next, |axis, state| axis.check(state, period_s)).is_some() {
            self.motion.cancel();
            return self.axes.iter_mut().for_each(Axis::stay);
        }
        self.take_set_points(&next);
    }

    fn take_set_points(&mut self, next: &[State]) {
        for (axis, state) in self.axes.iter_mut().zip(next) {
            if axis.is_enabled() { axis.advance(*state) } else { axis.stay() }
        }
    }

    fn follow_motion(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        let expired = self.axes.iter().position(|axis| axis.expired_ns(now_ns) > 0);
        if let Some(index) = expired.filter(|_| self.phase == Phase::Moving) {
            let age_ns = self.axes.get(index).map_or(0, |axis| axis.expired_ns(now_ns));
            let age_cycles = age_ns.div_ceil(self.period_ns) as f64;
            self.begin_stop(
                Rule::StaleCommand,
                None,
                Origin::Axis(index as u8),
                age_cycles,
                0.0,
                now_ns,
                door,
            );
        }
        self.motion.advance(self.period_s);
        let next: ArrayVec<State, MAX_AXES> = self.motion.states().take(self.axes.len()).collect();
        if !self.advance_guarded(&next, now_ns, door) || !self.motion.is_finished() {
            return;
        }
        match self.phase {
            Phase::Moving => {
                let is_planned_to_rest = next.iter().all(|state| state.velocity == 0.0);
                self.finish_move(is_planned_to_rest, now_ns, door);
            }
            Phase::Stopping => self.finish_stop(now_ns, door),
            // It has just become one that takes the power at once.
            _ => {}
        }
    }

    /// The planned part of a move is over; drives in profile modes may still be on their way.
    fn finish_move(&mut self, is_planned_to_rest: bool, now_ns: Nanoseconds, door: &mut impl Door) {
        if !is_planned_to_rest {
            self.begin_stop(Rule::Requested, Some(StopCategory::Two), Origin::Group, 0.0, 0.0, now_ns, door);
            return;
        }
        if !self.axes.iter().all(Axis::is_target_reached) {
            return;
        }
        if self.finished_move != self.move_id {
            self.finished_move = self.move_id;
            self.happened(now_ns, EventKind::MoveFinished { id: self.move_id }, door);
        }
        if !self.axes.iter().any(Axis::is_driven) {
            self.enter(Phase::Holding, now_ns, door);
        }
    }

    /// The planned part of a stop is over. A joint in a profile mode gets the time that its limits allow for, and one that
    /// follows set-points some to catch up before its power is taken.
    fn finish_stop(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        let category = self.stop.map(|stop| stop.category);
        let stopping_for_s = f64::from(self.phase_cycles) * self.period_s;
        let standing_for_s = self.motion.overrun_s();
        let is_waited_for = |axis: &Axis| {
            let is_in_time = match axis.is_profile() {
                true => stopping_for_s < stopping_s(axis),
                false => category != Some(StopCategory::Two) && standing_for_s < CATCHING_UP_S,
            };
            is_in_time && !axis.has_stopped()
        };
        if self.axes.iter().any(is_waited_for) {
            return;
        }
        match category {
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
            self.axes.iter_mut().for_each(Axis::await_stream);
            if self.phase_cycles > self.enable_timeout_cycles {
                let (value, limit) = (self.phase_cycles.into(), self.enable_timeout_cycles.into());
                self.begin_stop(Rule::StaleCommand, None, Origin::Group, value, limit, now_ns, door);
            }
            return;
        };
        if now_ns > command.valid_until_ns {
            let age_cycles = (now_ns - command.valid_until_ns).div_ceil(self.period_ns);
            self.begin_stop(Rule::StaleCommand, None, Origin::Group, age_cycles as f64, 0.0, now_ns, door);
            return self.follow_stop(now_ns, door);
        }
        if !self.is_stream_begun {
            self.is_stream_begun = true;
            if let Some((axis, violation)) = self.violation(&command.set_points, Axis::check_start) {
                self.refuse(axis, violation, now_ns, door);
                return self.follow_stop(now_ns, door);
            }
        }
        let is_renewed = core::mem::take(&mut self.is_stream_renewed);
        match self.streamed(&command.set_points, is_renewed) {
            Ok(next) => {
                self.advance_guarded(&next, now_ns, door);
            }
            Err((axis, violation)) => {
                self.refuse(axis, violation, now_ns, door);
                self.follow_stop(now_ns, door);
            }
        }
    }

    /// The next set-points of a stream, or the first axis that it would lead beyond a limit.
    fn streamed(
        &mut self,
        commands: &[State],
        is_renewed: bool,
    ) -> Result<ArrayVec<State, MAX_AXES>, (u8, Violation)> {
        let period_s = self.period_s;
        let mut next: ArrayVec<State, MAX_AXES> = ArrayVec::new();
        for (index, (axis, command)) in self.axes.iter_mut().zip(commands).enumerate() {
            if !axis.is_enabled() || axis.is_profile() {
                next.push(*command);
                continue;
            }
            let streamed = axis.streamed(is_renewed.then_some(command), period_s);
            next.push(match (streamed, axis.parameters().on_violation) {
                (Ok(set_point), _) => set_point,
                (Err(_), OnViolation::Clamp) => {
                    self.clamped += 1;
                    axis.clamped(command, period_s)
                }
                (Err(violation), OnViolation::Reject) => return Err((index as u8, violation)),
            });
        }
        Ok(next)
    }

    /// The first axis that follows set-points and whose next one does not pass a check.
    fn violation(
        &self,
        next: &[State],
        check: impl Fn(&Axis, &State) -> Result<(), Violation>,
    ) -> Option<(u8, Violation)> {
        self.axes.iter().zip(next).enumerate().find_map(|(index, (axis, state))| {
            let is_guarded = axis.is_enabled() && !axis.is_profile();
            let violation = is_guarded.then(|| check(axis, state).err()).flatten();
            violation.map(|violation| (index as u8, violation))
        })
    }

    fn refuse(&mut self, axis: u8, violation: Violation, now_ns: Nanoseconds, door: &mut impl Door) {
        let category = (self.phase == Phase::Stopping).then_some(StopCategory::Zero);
        let (rule, value, limit) = (violation.rule, violation.value, violation.limit);
        self.begin_stop(rule, category, Origin::Axis(axis), value, limit, now_ns, door);
    }

    /// Takes the next set-points of all axes if the guard agrees to each. If not, the group stops from where it
    /// was, in this same cycle. Returns whether they were taken.
    fn advance_guarded(&mut self, next: &[State], now_ns: Nanoseconds, door: &mut impl Door) -> bool {
        let period_s = self.period_s;
        if let Some((axis, violation)) = self.violation(next, |axis, state| axis.check(state, period_s)) {
            let was_stopping = self.phase == Phase::Stopping;
            self.refuse(axis, violation, now_ns, door);
            if was_stopping {
                self.come_to_rest();
            } else {
                self.follow_stop(now_ns, door);
            }
            return false;
        }
        self.take_set_points(next);
        true
    }

    /// The first cycle of a stop that was begun instead of taking a set-point.
    fn follow_stop(&mut self, now_ns: Nanoseconds, door: &mut impl Door) {
        if self.phase == Phase::Stopping {
            self.follow_motion(now_ns, door);
        } else {
            self.come_to_rest();
        }
    }
}

/// How long a joint may take to its set-point that follows and is behind it, at most.
const CATCHING_UP_S: f64 = 0.5;

/// From full speed to rest at the limits, with some patience for the drive's own profile.
fn stopping_s(axis: &Axis) -> f64 {
    let limits = &axis.parameters().limits;
    1.5 * limits.velocity / limits.deceleration + 0.5
}
