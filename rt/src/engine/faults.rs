//! What is wrong with the group, and how it stops.

use super::group::{Group, GroupContext};
use super::shared::Shared;
use super::state::{AtRest, GroupState, PowerRemoval};
use super::{CycleInput, Engine};
use crate::axis::Axis;
use crate::control::ControlLaw;
use crate::fault::Fault;
use crate::motion_reports::MotionState;
use crate::plan::{PlanError, State};
use crate::port::{BusHealth, BusState};
use crate::record::EventKind;
use crate::stop::{CauseRank, MergedStop, Origin, StopCause, StopReason};
use crate::stop_category::StopCategory;
use crate::time::Nanoseconds;
use crate::watch::{NodeFault, TimingLevel};

/// Cycles in a row whose set-points may be too late.
const LATE_CYCLES_AT_MOST: u32 = 50;

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Lets every group look for what is wrong.
    pub(super) fn check_faults(&mut self, input: &CycleInput<'_>) {
        self.for_each_group(|group| group.check_faults(input));
        // While no drive has power they stay, until a group is enabled.
        if !self.shared.foreign_frames.is_empty() && self.groups.iter().any(|group| group.state.has_power()) {
            self.shared.foreign_frames.forget();
        }
    }

    /// Stops the groups that stop with one that does, for the same reason. A stop that begins in the step of a cycle stops the others
    /// in the next one, before its requests.
    #[inline]
    pub(super) fn couple_stops(&mut self) {
        if self.groups.iter().any(|group| group.untold.is_some()) {
            self.couple_untold_stops();
        }
    }

    #[cold]
    fn couple_untold_stops(&mut self) {
        // A group that must stop harder than the one with which it stops makes others harder: there are three categories.
        while self.groups.iter().any(|group| group.untold.is_some()) {
            for number in 0..self.groups.len() as u8 {
                let untold = self.groups.get_mut(usize::from(number)).and_then(|group| group.untold.take());
                if let Some(stop) = untold {
                    self.stop_coupled(number, &stop);
                }
            }
        }
    }

    fn stop_coupled(&mut self, with: u8, stop: &StopReason) {
        self.for_each_group(|group| {
            if group.group.stops_with.contains(&with) && group.group.state.has_power() {
                group.begin_coupled_stop(stop);
            }
        });
    }
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Begins a stop for everything that is wrong while drives may have torque.
    #[inline]
    pub(super) fn check_faults(&mut self, input: &CycleInput<'_>) {
        if !self.group.state.has_power() {
            return self.watch_disabled();
        }
        self.check_buses(input.buses);
        self.check_timing(input.suspended_ns);
        self.check_transmission();
        self.check_axes();
        self.check_enable_timeout();
        self.take_power_if_cut_off();
    }

    /// Returns `true` if slots are missed too often. A thread that is late in every cycle cannot go on, however many slots may be missed.
    fn check_timing(&mut self, suspended_ns: Nanoseconds) {
        if suspended_ns > 0 {
            self.fail(Origin::Group, Fault::Suspended { suspended_ns });
        } else if self.shared.slots.level() == TimingLevel::Unfit {
            let (missed, limit) = self.shared.slots.unforgiven();
            self.fail(Origin::Group, Fault::TimingUnfit { missed, limit });
        } else if self.shared.slots.late_cycles > LATE_CYCLES_AT_MOST {
            let missed = self.shared.slots.late_cycles;
            self.fail(Origin::Group, Fault::TimingUnfit { missed, limit: LATE_CYCLES_AT_MOST });
        }
    }

    #[inline]
    fn check_enable_timeout(&mut self) {
        let (cycles, limit) = (self.group.state_cycles, self.shared.enable_timeout_cycles);
        if matches!(self.group.state, GroupState::Enabling) && cycles > limit {
            self.fail_to_enable(cycles, limit);
        }
    }

    #[cold]
    fn fail_to_enable(&mut self, cycles: u32, limit: u32) {
        // One that is enabled already and has not been allowed to be is late, too.
        let late = self.axes.iter().find(|axis| !(axis.is_enabled() && axis.is_power_granted()));
        let origin = late.map_or(Origin::Group, |axis| Origin::Axis(axis.number()));
        let moving = late.filter(|axis| !axis.is_power_granted() && !axis.has_torque());
        let fault =
            moving.and_then(Axis::motion_before_power).unwrap_or(Fault::EnableTimeout { cycles, limit });
        self.fail(origin, fault);
    }

    #[inline]
    fn check_buses(&mut self, buses: &[BusHealth]) {
        let own = self.group.buses;
        for (bus, health) in buses.iter().enumerate().filter(|(bus, _)| own.contains(*bus)) {
            let fault = match health.state {
                BusState::BusOff => Fault::BusOff,
                BusState::Down => Fault::BusDown,
                BusState::ErrorPassive => Fault::BusErrorPassive,
                BusState::ErrorActive => continue,
            };
            self.fail(Origin::Bus(bus as u8), fault);
        }
        if !self.shared.foreign_frames.is_empty() {
            for (bus, id) in self.shared.foreign_frames.on(own) {
                self.fail(Origin::Bus(bus), Fault::ForeignMaster { id });
            }
        }
    }

    /// Returns `true` if own frames get onto the wire.
    fn check_transmission(&mut self) {
        let limit = self.shared.not_transmitted_cycles;
        let (bus, cycles) = self.shared.backlog.longest_blocked(self.group.buses);
        if cycles <= limit {
            return;
        }
        // The drives of such a bus are where the last set-point left them, and get no other before they are disabled. Those on
        // a bus that is behind for a cycle or two, while another one is lost, stop with the rest.
        for axis in self.axes.iter_mut() {
            if self.shared.backlog.behind_cycles(axis.parameters().bus.into()) > limit {
                axis.latch_off();
            }
        }
        self.fail(Origin::Bus(bus as u8), Fault::NotTransmitted { cycles, limit });
    }

    /// Checks every axis. A fault that comes up changes what is expected of those behind it.
    #[inline]
    fn check_axes(&mut self) {
        let mut expected = Expectation::of(self.group);
        for index in 0..self.axes.len() {
            let Some(axis) = self.axes.get_mut(index) else { break };
            let shown = expected.state_of(axis);
            // Whatever else is wrong with the drive: it is not enabled again.
            if shown.is_disabled || shown.is_faulted {
                axis.latch_off();
            }
            if let Some(fault) = expected.fault_of(axis, shown, self.shared) {
                let number = axis.number();
                self.fail(Origin::Axis(number), fault);
                expected = Expectation::of(self.group);
            }
        }
    }

    /// A stop whose commands have not left for too long, because the thread is always late, does not wait for a punctual
    /// set-point: it takes the power, by SDO.
    fn take_power_if_cut_off(&mut self) {
        let is_cut_off = self.shared.slots.late_cycles > self.shared.not_transmitted_cycles;
        if let Some(stop) =
            self.group.stop.filter(|_| is_cut_off && matches!(self.group.state, GroupState::Stopping))
        {
            self.begin_stop(stop.cause, stop.origin, StopCategory::Zero);
        }
    }

    /// Watches the power of drives that are to have none. While a drive has not confirmed that, a latched fault says so.
    fn watch_disabled(&mut self) {
        if matches!(self.group.state, GroupState::Passive) {
            return;
        }
        let is_overdue = self.group.state_cycles > self.shared.enable_timeout_cycles;
        self.settle_power(is_overdue);
    }

    /// Takes what the drives have shown of their power, and fails for the first one that is not known to have none, if it is not
    /// waited for any longer.
    pub(super) fn settle_power(&mut self, is_overdue: bool) {
        self.axes.iter_mut().for_each(|axis| axis.settle_power(is_overdue));
        self.report_unreleased();
    }

    /// Fails for the first drive that has not given up its power, unless a fault of this kind is latched already.
    fn report_unreleased(&mut self) {
        let latched = self.group.stop.map_or(CauseRank::Requested, |stop| stop.cause.rank());
        if latched == CauseRank::Unreleased {
            return;
        }
        let has_fault = latched == CauseRank::Fault;
        let unreleased =
            self.axes.iter().find_map(|axis| Some((axis.number(), axis.unreleased_fault(has_fault)?)));
        if let Some((number, fault)) = unreleased {
            self.fail(Origin::Axis(number), fault);
        }
    }

    /// Begins the stop that the configuration has for a fault.
    pub(super) fn fail(&mut self, origin: Origin, fault: Fault) {
        self.begin_stop(StopCause::Fault(fault), origin, self.shared.categories.of(fault.rule()));
    }

    /// Begins a stop. The first fault stays the reason, and a later one can only make the stop harder. That somebody asked
    /// for the stop is no fault: the first one that comes up before that stop is over takes its place, and must be reset. A drive that
    /// does not give up its power takes the place of the fault that the group has stopped for.
    ///
    /// The groups that stop with this one are told of each stop, whatever this one has stopped for: they may have been enabled since.
    pub(super) fn begin_stop(&mut self, cause: StopCause, origin: Origin, category: StopCategory) {
        let begun = self.begun(cause, origin, self.possible(category));
        let category = self.take_stop(begun);
        self.group.note_untold(StopReason { category, ..begun });
    }

    /// Begins the stop of another group, with which this one stops. The groups that stop with this one know of it, unless it is harder
    /// here.
    fn begin_coupled_stop(&mut self, stop: &StopReason) {
        let begun = self.begun(stop.cause, stop.origin, self.possible(stop.category));
        let category = self.take_stop(begun);
        if category < stop.category {
            self.group.note_untold(StopReason { category, ..begun });
        }
    }

    fn begun(&self, cause: StopCause, origin: Origin, category: StopCategory) -> StopReason {
        let (slot, phase) = (self.shared.present_slot(), self.group.state.phase());
        StopReason { category, cause, origin, slot, phase }
    }

    /// Takes a stop beside the present one. Returns the category of both.
    fn take_stop(&mut self, begun: StopReason) -> StopCategory {
        let is_under_way = matches!(self.group.state, GroupState::Stopping | GroupState::Disabling(_));
        // What was asked for counts no more when it is done.
        let present = self.group.stop.filter(|present| is_under_way || !present.is_requested());
        let MergedStop { reason, is_new_reason, is_harder } = StopReason::merged(present, begun);
        self.group.stop = Some(reason);
        if is_new_reason {
            if !begun.is_requested() {
                // A reset that is under way is not for this fault.
                self.group.fault_reset_cycles = 0;
            }
            self.emit(EventKind::Stop(reason));
            self.shared.snapshot.motions.end_all(self.group.number, MotionState::Stopped(reason), |_| {});
        }
        if is_harder {
            self.carry_out(begun.category);
        }
        reason.category
    }

    /// A joint in profile torque cannot be held where it is: its drive closes no position loop. It stops by the drive's
    /// quick stop, which ends without torque, and the brake holds it.
    fn possible(&self, category: StopCategory) -> StopCategory {
        let is_unheld = self.axes.iter().any(|axis| axis.parameters().law == ControlLaw::ProfileTorque);
        match category {
            StopCategory::Two if is_unheld && self.is_under_way() => StopCategory::One,
            category => category,
        }
    }

    /// Returns `true` if joints have yet to come to rest before their power is taken: all of them when the group moves, and in one that
    /// holds those that are still behind their set-points.
    pub(super) fn must_come_to_rest(&self) -> bool {
        self.is_under_way()
            || matches!(self.group.state, GroupState::Holding) && self.axes.iter().any(Axis::is_catching_up)
    }

    /// Returns `true` if a stop has something to bring to rest. A joint in profile torque may begin to move by itself.
    pub(super) fn is_under_way(&self) -> bool {
        match self.group.state {
            GroupState::Moving { .. }
            | GroupState::Executing(_)
            | GroupState::Streaming(_)
            | GroupState::InLoop(_) => true,
            GroupState::Holding => self.axes.iter().any(Axis::is_coasting),
            _ => false,
        }
    }

    fn carry_out(&mut self, category: StopCategory) {
        // Nothing moves: only what takes the power ends a change of the mode.
        if matches!(self.group.state, GroupState::ChangingMode(AtRest::Holding))
            && category < StopCategory::Two
        {
            self.cancel_mode_change(AtRest::Holding);
        }
        match (&self.group.state, category) {
            (GroupState::Passive | GroupState::Disabled | GroupState::ChangingMode(_), _) => {}
            // While the power goes, the set-points go on to rest at the limits: a drive that is slow to obey
            // gets no step. Without a trajectory to rest they stay where they are.
            (_, StopCategory::Zero) => self.remove_power_now(),
            _ if self.is_under_way() || category == StopCategory::One && self.must_come_to_rest() => {
                if self.plan_stop().is_ok() {
                    self.enter(GroupState::Stopping);
                } else {
                    // No trajectory to rest can be computed: the drives' own brakes are what is left.
                    self.remove_power_now();
                }
            }
            (GroupState::Enabling, _) | (GroupState::Holding, StopCategory::One) => {
                self.enter(GroupState::Disabling(PowerRemoval::Shutdown));
            }
            _ => {}
        }
    }

    fn remove_power_now(&mut self) {
        if self.plan_stop().is_err() {
            self.group.motion.cancel();
        }
        self.enter(GroupState::Disabling(PowerRemoval::DisableVoltage));
    }

    /// Every axis stays on its set-point.
    pub(super) fn plan_standstill(&mut self) -> Result<(), PlanError> {
        self.group.motion.stop(
            self.profiles,
            self.axes.iter().map(|axis| {
                let standing = State { position: axis.set_point().position, ..State::default() };
                (standing, &axis.parameters().limits)
            }),
        )
    }

    pub(super) fn plan_stop(&mut self) -> Result<(), PlanError> {
        self.axes.iter_mut().for_each(Axis::begin_stop);
        if matches!(self.group.state, GroupState::Streaming(_) | GroupState::InLoop(_)) {
            for axis in self.axes.iter_mut() {
                axis.derive_from_steps(self.shared.period_s);
                axis.end_stream(self.shared.period_s);
            }
        }
        self.group.motion.stop(
            self.profiles,
            self.axes.iter().map(|axis| {
                let here = axis.set_point();
                let standing = State { position: here.position, ..State::default() };
                (if axis.is_profile() { standing } else { here }, &axis.parameters().limits)
            }),
        )
    }
}

/// The unexpected state of a drive. Taking its power changes neither: a drive with a fault is not enabled.
#[derive(Clone, Copy)]
struct Unexpected {
    /// True if it is out of operation enabled.
    is_disabled: bool,
    /// True if it has a fault.
    is_faulted: bool,
}

/// What is expected of the axes in the present state of their group.
struct Expectation {
    /// True if the drives may be out of operation enabled.
    may_be_disabled: bool,
    /// The same of those that stop by their own quick stop, which ends without torque.
    may_have_quick_stopped: bool,
    /// True if faults are being reset.
    is_resetting: bool,
    /// True if the modes of operation may be any.
    is_mode_free: bool,
    /// True if the axes are held or moved.
    is_in_operation: bool,
}

impl Expectation {
    fn of<const AXES: usize, const BUSES: usize>(group: &Group<AXES, BUSES>) -> Self {
        let is_disabling = matches!(group.state, GroupState::Disabling(_));
        let may_be_disabled = is_disabling || matches!(group.state, GroupState::Enabling);
        Self {
            may_be_disabled,
            may_have_quick_stopped: matches!(group.state, GroupState::Stopping),
            is_resetting: group.fault_reset_cycles > 0,
            is_mode_free: is_disabling,
            is_in_operation: !may_be_disabled,
        }
    }

    #[inline]
    fn state_of(&self, axis: &Axis) -> Unexpected {
        let may_be_disabled = self.may_be_disabled || self.may_have_quick_stopped && axis.stops_by_itself();
        Unexpected {
            is_disabled: !axis.is_enabled() && !may_be_disabled,
            is_faulted: axis.drive_state().is_faulted() && !(self.is_resetting && axis.is_being_reset()),
        }
    }

    /// The first thing that is wrong with an axis whose drive shows this.
    #[inline]
    fn fault_of<const AXES: usize, const BUSES: usize>(
        &self,
        axis: &Axis,
        shown: Unexpected,
        shared: &Shared<AXES, BUSES>,
    ) -> Option<Fault> {
        match self.communication_fault(axis, shown) {
            None if self.is_in_operation => Self::operation_fault(axis, shown, shared),
            fault => fault,
        }
    }

    /// What must be right whenever a drive may have torque.
    #[inline]
    fn communication_fault(&self, axis: &Axis, shown: Unexpected) -> Option<Fault> {
        let limit = axis.parameters().missed_feedback_cycles;
        if axis.feedback_age() > limit {
            return Some(Fault::MissedFeedback { cycles: axis.feedback_age(), limit });
        }
        if axis.late_cycles() > 0 {
            return Some(Fault::LateFeedback { cycles: axis.late_cycles() });
        }
        if shown.is_faulted {
            return Some(Fault::DriveFault { error_code: axis.error_code() });
        }
        if let Some(fault) = axis.node_fault() {
            let limit = axis.parameters().supervision.timeout_cycles().unwrap_or(0);
            return Some(match fault {
                NodeFault::BootUp => Fault::UnexpectedBootUp,
                NodeFault::NotOperational { state } => Fault::NodeNotOperational { state },
                NodeFault::Silent { cycles } => Fault::NodeLost { cycles, limit },
            });
        }
        if axis.is_duplicate() {
            return Some(Fault::DuplicateNode { node: axis.parameters().node });
        }
        let foreign_mode = axis.foreign_mode().filter(|_| !self.is_mode_free);
        foreign_mode
            .map(|shown| Fault::ModeChanged { shown, expected: axis.parameters().law.operation_mode() })
    }

    /// What must be right while an axis is held or moved.
    #[inline]
    fn operation_fault<const AXES: usize, const BUSES: usize>(
        axis: &Axis,
        shown: Unexpected,
        shared: &Shared<AXES, BUSES>,
    ) -> Option<Fault> {
        if let Some(code) = axis.unexplained_emergency() {
            return Some(Fault::EmergencyMessage { code });
        }
        if shown.is_disabled {
            return Some(Fault::DriveDisabled { statusword: axis.statusword() });
        }
        if axis.is_torque_undefined() {
            return Some(Fault::NotFinite { position: f64::NAN });
        }
        if axis.is_local() {
            return Some(Fault::DriveLocal { statusword: axis.statusword() });
        }
        if let Some(jump) = axis.jump() {
            return Some(Fault::ImplausibleFeedback { distance: jump.distance, reachable: jump.reach });
        }
        let cycles = axis.unacknowledged_cycles();
        if cycles > 0 {
            // An axis counts in cycles of its bus.
            let limit = shared.acknowledge_timeout_cycles.div_ceil(shared.divider_of(axis));
            if cycles > limit {
                return Some(Fault::NotAcknowledged { cycles, limit });
            }
        }
        let checked =
            axis.check_following().and_then(|()| axis.check_profile()).and_then(|()| axis.check_measured());
        checked.err()
    }
}
