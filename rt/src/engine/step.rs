//! One step of the group: what each phase makes of the next set-points.
//!
//! A phase proposes the next set-points, the guard checks them, the axes take them. Where that fails, the group stops from
//! where it was, in this same cycle.

use arrayvec::ArrayVec;

use super::group::{Commands, Group, GroupContext};
use super::state::{GroupState, PowerRemoval};
use super::{CycleInput, Engine};
use crate::axis::{Axis, FeedbackSince};
use crate::bit_set::BitSet;
use crate::fault::Fault;
use crate::host::HostInterface;
use crate::plan::State;
use crate::stop::{Origin, StopCause};
use crate::stop_category::StopCategory;

/// Cycles from one probe for late drives to the next: their silence must have been received.
const PROBE_AGAIN_CYCLES: u32 = 64;
/// For so long a stop waits at most for a joint that follows set-points and is behind them.
const CATCHING_UP_S: f64 = 0.5;
/// A phase, the stop that it fails into, and that stop at once where its first step fails too. Taking the power never fails.
const ATTEMPTS: usize = 3;

/// The first thing that keeps a step from being made.
pub(super) type Failure = (Origin, Fault);

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Skips what requests feedback from drives that have not answered every time in their own cycle, a SYNC of their bus or a
    /// set-point, where a group is being enabled: before its drives are enabled, that disturbs nothing. A SYNC that moves the
    /// drives of another group is not skipped.
    pub(super) fn probe_late_drives(&mut self) {
        let is_due = |group: &Group<AXES, BUSES>| {
            matches!(group.state, GroupState::Enabling)
                && group.state_cycles.is_multiple_of(PROBE_AGAIN_CYCLES)
        };
        if !self.groups.iter().any(is_due) {
            return;
        }
        let (mut probed, mut in_motion) = (BitSet::default(), BitSet::default());
        for group in &self.groups {
            if is_due(group) {
                probed = probed.union(group.buses);
            } else if group.state.has_power()
                && !matches!(group.state, GroupState::Enabling | GroupState::Holding)
            {
                in_motion = in_motion.union(group.buses);
            }
        }
        for group in &self.groups {
            let axes = self.axes.get_mut(group.places.range()).unwrap_or_default();
            for axis in axes.iter_mut().filter(|axis| axis.is_reply_unverified()) {
                let bus = usize::from(axis.parameters().bus);
                match axis.parameters().feedback_since {
                    FeedbackSince::SetPoint if is_due(group) => axis.skip_next_set_point(),
                    FeedbackSince::SetPoint => {}
                    _ if probed.without(in_motion).contains(bus) => self.shared.skip_sync.insert(bus),
                    _ => {}
                }
            }
        }
    }
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Makes the next set-points, unless those of the last cycles have still to leave, or every bus of the group was behind when its
    /// cycle began.
    #[inline]
    pub(super) fn step(&mut self, input: &CycleInput<'_>, host: &mut impl HostInterface<AXES, BUSES>) {
        self.group.callback_ns = None;
        let (own, behind) = (self.group.buses, self.shared.backlog.behind_at_cycle());
        // A group that stops does not wait for the wire any longer, whatever it stops for.
        let is_over_waiting = self.group.stop.is_some()
            && self.shared.backlog.longest_blocked(own).1 > self.shared.not_transmitted_cycles;
        let must_wait = own.is_within(behind) && !is_over_waiting;
        self.group.commands = match self.group.state {
            GroupState::Passive => Commands::None,
            _ if must_wait => Commands::None,
            _ => Commands::Made,
        };
        let on_time = self.group.set_point_buses.without(behind);
        if must_wait || self.group.unsent.are_enough(&self.shared.buses, on_time) {
            // Drives may have obeyed what was said by SDO.
            return self.end_disabling();
        }
        if self.group.commands == Commands::Made {
            self.group.unsent.count(on_time);
            self.group.steps += 1;
        }
        self.call_in_loop(input, host);
        for _ in 0..ATTEMPTS {
            match self.step_phase() {
                Ok(()) => return,
                Err((origin, fault)) if matches!(self.group.state, GroupState::Stopping) => {
                    self.begin_stop(StopCause::Fault(fault), origin, StopCategory::Zero);
                }
                Err((origin, fault)) => self.fail(origin, fault),
            }
        }
    }

    fn step_phase(&mut self) -> Result<(), Failure> {
        match self.group.state {
            GroupState::Passive => {}
            GroupState::Disabled | GroupState::Holding => self.hold(),
            GroupState::ChangingMode(at) => self.step_mode_change(at)?,
            GroupState::Enabling => self.step_enabling(),
            GroupState::Moving { is_reported } => self.step_move(is_reported)?,
            GroupState::Executing(execution) => self.step_execution(&execution)?,
            GroupState::Streaming(stream) => self.step_stream(stream)?,
            GroupState::InLoop(in_loop) => self.step_in_loop(in_loop)?,
            GroupState::Stopping => self.step_stop()?,
            GroupState::Disabling(_) => {
                self.come_to_rest();
                self.end_disabling();
            }
        }
        Ok(())
    }

    /// Enabled axes stay on their set-point; the set-point of the others follows them.
    pub(super) fn hold(&mut self) {
        for axis in self.axes.iter_mut() {
            if axis.is_enabled() { axis.stay() } else { axis.follow_actual(self.shared.period_s) }
        }
    }

    fn step_enabling(&mut self) {
        self.hold();
        self.axes.iter_mut().for_each(|axis| axis.prepare_to_enable(self.shared.period_s));
        if self.axes.iter().all(|axis| axis.is_power_granted() && axis.is_enabled()) {
            self.enter(GroupState::Holding);
        }
    }

    #[inline(always)]
    pub(super) fn step_move(&mut self, is_reported: bool) -> Result<(), Failure> {
        for axis in self.axes.iter() {
            let expired_ns = axis.expired_ns(self.shared.now_ns);
            if expired_ns > 0 {
                let age_cycles = expired_ns.div_ceil(self.shared.period_ns);
                return Err((Origin::Axis(axis.number()), Fault::StaleCommand { age_cycles }));
            }
        }
        self.follow_motion()?;
        if self.group.motion.is_finished() {
            self.end_move(is_reported);
        }
        Ok(())
    }

    /// The planned part of a move is over; drives in profile modes may still be on their way.
    fn end_move(&mut self, is_reported: bool) {
        let is_passing = self.group.motion.states(self.profiles).any(|state| state.velocity != 0.0);
        if !is_passing && !self.axes.iter().all(Axis::is_target_reached) {
            return;
        }
        if !is_reported {
            self.group.state = GroupState::Moving { is_reported: true };
            self.finish_motions();
        }
        if is_passing {
            self.begin_stop(StopCause::Requested, Origin::Group, StopCategory::Two);
        } else if !self.axes.iter().any(Axis::is_moving_on_command) {
            self.enter(GroupState::Holding);
        }
    }

    fn step_stop(&mut self) -> Result<(), Failure> {
        self.follow_motion()?;
        if self.group.motion.is_finished() {
            self.end_stop();
        }
        Ok(())
    }

    /// The planned part of a stop is over. A joint in a profile mode gets the time that its limits allow for, and one that
    /// follows set-points some to catch up before its power is taken.
    fn end_stop(&mut self) {
        let category = self.group.stop.map(|stop| stop.category);
        let stopping_for_s = f64::from(self.group.state_cycles) * self.shared.period_s;
        let standing_for_s = self.group.motion.overrun_s();
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
        self.enter(match category {
            Some(StopCategory::Two) => GroupState::Holding,
            _ => GroupState::Disabling(PowerRemoval::Shutdown),
        });
    }

    /// Goes on by one period on the planned motion.
    #[inline(always)]
    fn follow_motion(&mut self) -> Result<(), Failure> {
        self.group.motion.advance(self.shared.period_s);
        let mut next: ArrayVec<State, AXES> = ArrayVec::new();
        for state in self.group.motion.states(self.profiles) {
            next.push(state);
        }
        self.check(&next)?;
        self.take_set_points(&next);
        Ok(())
    }

    pub(super) fn check(&self, next: &[State]) -> Result<(), Failure> {
        self.first_fault(next, |axis, state| axis.check(state, self.shared.period_s))
    }

    /// The first axis that follows set-points and whose next one does not pass a check.
    #[inline]
    pub(super) fn first_fault(
        &self,
        next: &[State],
        check: impl Fn(&Axis, &State) -> Result<(), Fault>,
    ) -> Result<(), Failure> {
        for (axis, state) in self.axes.iter().zip(next) {
            if axis.is_enabled() && !axis.is_profile() {
                check(axis, state).map_err(|fault| (Origin::Axis(axis.number()), fault))?;
            }
        }
        Ok(())
    }

    pub(super) fn take_set_points(&mut self, next: &[State]) {
        for (axis, state) in self.axes.iter_mut().zip(next) {
            if axis.is_enabled() { axis.advance(*state) } else { axis.stay() }
        }
    }

    /// What is still on its way to rest goes on as far as the guard agrees. Everything else stays where it is, or slows down at
    /// its limits until it stands. No set-point follows a joint: a drive whose statusword is false still obeys.
    fn come_to_rest(&mut self) {
        if !self.group.motion.is_finished() && self.follow_motion().is_ok() {
            return;
        }
        self.group.motion.cancel();
        self.axes.iter_mut().for_each(|axis| axis.slow_down(self.shared.period_s));
    }

    /// Ends the disabling when no drive is waited for any more. A drive that does not show that it has obeyed is not waited
    /// for without end; nor are set-points that cannot leave because the thread is always late.
    fn end_disabling(&mut self) {
        if !matches!(self.group.state, GroupState::Disabling(_)) {
            return;
        }
        let is_always_late = self.shared.slots.late_cycles > self.shared.not_transmitted_cycles;
        let is_on_way = !self.group.motion.is_finished() && !is_always_late;
        let is_patient = is_on_way || self.group.state_cycles <= self.shared.enable_timeout_cycles;
        // A drive that says nothing has either received what it was told, or has missed the controller for so long that it has
        // stopped by itself. One that PDOs do not reach is told by SDO.
        let has_stopped_by_itself = |axis: &Axis| {
            let silent_cycles = u32::from(axis.feedback_age()).saturating_mul(self.shared.divider_of(axis));
            let is_over =
                axis.parameters().stops_by_itself_cycles.is_some_and(|cycles| silent_cycles > cycles);
            is_over && !is_on_way && !axis.is_pdo_unreachable()
        };
        // The set-points of a drive that seems to follow go on to rest, though it may have said otherwise by SDO; and one that shows
        // no torque yet may be about to have it. One with a fault that ends by itself goes on where its last controlword leads.
        let is_waited_for = |axis: &Axis| {
            let may_have_torque = axis.has_torque()
                || axis.may_be_switching_on()
                || !axis.is_told_to_switch_off()
                || is_on_way && axis.drive_state().has_torque();
            may_have_torque && !has_stopped_by_itself(axis)
        };
        if is_patient && self.axes.iter().any(is_waited_for) {
            return;
        }
        self.settle_power(true);
        self.group.motion.cancel();
        self.enter(GroupState::Disabled);
    }
}

/// From full speed to rest at the limits, with some patience for the drive's own profile.
fn stopping_s(axis: &Axis) -> f64 {
    let limits = &axis.parameters().limits;
    1.5 * limits.velocity / limits.deceleration + 0.5
}
