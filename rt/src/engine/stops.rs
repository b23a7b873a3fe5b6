//! What is wrong with the group, and how it stops.

use super::{Engine, Transmission};
use crate::axis::Axis;
use crate::cia402::Goal;
use crate::control::ControlLaw;
use crate::door::Door;
use crate::plan::{PlanError, State};
use crate::port::{BusHealth, BusState};
use crate::record::EventKind;
use crate::stop::{Origin, Phase, Rule, StopCategory, StopReason};
use crate::time::Nanoseconds;
use crate::watch::{NodeComplaint, TimingLevel, node_state};

impl Engine {
    pub(super) fn supervise(
        &mut self,
        buses: &[BusHealth],
        transmission: Transmission,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) {
        let not_taken = core::mem::take(&mut self.not_taken);
        let count = |cycles: u32, goes_on: bool| if goes_on { cycles.saturating_add(1) } else { 0 };
        let counters = self.held_back_cycles.iter_mut().zip(&mut self.blocked_cycles);
        for (bus, (held_back, blocked)) in counters.enumerate().take(self.buses.len()) {
            let is_held_back = self.held_back.contains(bus);
            *held_back = count(*held_back, is_held_back);
            let is_behind = is_held_back || transmission == Transmission::Blocked;
            *blocked = count(*blocked, is_behind || not_taken.contains(bus));
        }
        if !has_power(self.phase) {
            return;
        }
        for (bus, health) in buses.iter().enumerate().take(self.buses.len()) {
            let rule = match health.state {
                BusState::BusOff | BusState::Down => Rule::BusLost,
                BusState::ErrorPassive => Rule::BusErrorPassive,
                BusState::ErrorActive => continue,
            };
            self.begin_stop(rule, None, Origin::Bus(bus as u8), 0.0, 0.0, now_ns, door);
        }
        if let Some((bus, id)) = self.foreign_id.take() {
            self.begin_stop(Rule::ForeignMaster, None, Origin::Bus(bus), id.into(), 0.0, now_ns, door);
        }
        if self.timing_level == TimingLevel::Unfit {
            let (slots, limit) = (self.missed.filled().into(), self.ladder.unfit.into());
            self.begin_stop(Rule::TimingUnfit, None, Origin::Group, slots, limit, now_ns, door);
        }
        let (bus, cycles) = self.longest_blocked();
        if cycles > self.not_transmitted_cycles {
            let (cycles, limit) = (cycles.into(), self.not_transmitted_cycles.into());
            // Their drives are where the last set-point left them, and get no other before they are disabled. Those on a bus
            // that is behind for a cycle or two, while another one is lost, stop with the rest.
            for axis in &mut self.axes {
                let bus = self.held_back_cycles.get(usize::from(axis.parameters().bus));
                if bus.is_some_and(|cycles| *cycles > self.not_transmitted_cycles) {
                    axis.give_up();
                }
            }
            self.begin_stop(Rule::NotTransmitted, None, Origin::Bus(bus as u8), cycles, limit, now_ns, door);
        }
        for index in 0..self.axes.len() {
            let Some(axis) = self.axes.get_mut(index) else { continue };
            let bus = self.buses.get(usize::from(axis.parameters().bus));
            // An axis counts in cycles of its bus.
            let acknowledge_limit =
                self.acknowledge_timeout_cycles.div_ceil(bus.map_or(1, |bus| bus.divider.max(1)));
            let is_resetting = self.fault_reset > 0 && axis.is_being_reset();
            let complaint = complaint(axis, self.phase, is_resetting, acknowledge_limit);
            let Some((rule, value, limit)) = complaint else {
                continue;
            };
            self.begin_stop(rule, None, Origin::Axis(index as u8), value, limit, now_ns, door);
        }
    }

    /// The bus that has not carried all of its frames for longest, and for how many cycles.
    pub(super) fn longest_blocked(&self) -> (usize, u32) {
        let blocked = self.blocked_cycles.iter().copied().enumerate().rev();
        blocked.max_by_key(|(_, cycles)| *cycles).unwrap_or_default()
    }

    /// Begins a stop. The first fault stays the reason, and a later one can only make the stop harder. That somebody asked
    /// for the stop is no fault: the first one that comes up on its way takes its place, and must be reset like any other.
    #[expect(clippy::too_many_arguments, reason = "they are the fields of the reason")]
    pub(super) fn begin_stop(
        &mut self,
        rule: Rule,
        category: Option<StopCategory>,
        origin: Origin,
        value: f64,
        limit: f64,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) {
        let wanted = self.possible(category.unwrap_or(self.categories.of(rule)));
        let slot = self.last_slot.unwrap_or(0);
        let reason = StopReason { category: wanted, rule, origin, value, limit, slot, phase: self.phase };
        let is_under_way = matches!(self.phase, Phase::Stopping | Phase::Disabling);
        let present = self.stop.filter(|present| is_under_way || present.rule != Rule::Requested);
        let hardest = present.map_or(wanted, |present| present.category.min(wanted));
        let kept = present.filter(|present| present.rule != Rule::Requested || rule == Rule::Requested);
        self.stop = Some(StopReason { category: hardest, ..kept.unwrap_or(reason) });
        if kept.is_none() {
            if rule != Rule::Requested {
                // Nobody has asked for a reset of this one.
                self.fault_reset = 0;
            }
            self.happened(now_ns, EventKind::Stop(StopReason { category: hardest, ..reason }), door);
        }
        if present.is_none_or(|present| wanted < present.category) {
            self.carry_out(wanted, now_ns, door);
        }
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

    /// Whether joints have yet to come to rest before their power is taken: all of them when the group moves, and in one that
    /// holds those that are still behind their set-points.
    pub(super) fn must_come_to_rest(&self) -> bool {
        self.is_under_way() || self.phase == Phase::Holding && self.axes.iter().any(Axis::is_catching_up)
    }

    /// Whether a stop has something to bring to rest. A joint in profile torque may begin to move by itself.
    pub(super) fn is_under_way(&self) -> bool {
        match self.phase {
            Phase::Moving | Phase::Streaming => true,
            Phase::Holding => self.axes.iter().any(Axis::is_adrift),
            _ => false,
        }
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
            _ if self.is_under_way() || category == StopCategory::One && self.must_come_to_rest() => {
                if self.plan_stop().is_ok() {
                    self.enter(Phase::Stopping, now_ns, door);
                } else {
                    // No trajectory to rest can be computed: the drives' own brakes are what is left.
                    self.motion.cancel();
                    self.goal = Goal::NoVoltage;
                    self.enter(Phase::Disabling, now_ns, door);
                }
            }
            (Phase::Enabling, _) | (Phase::Holding, StopCategory::One) => {
                self.goal = Goal::Disabled;
                self.enter(Phase::Disabling, now_ns, door);
            }
            _ => {}
        }
    }

    /// Every axis stays on its set-point.
    pub(super) fn plan_standstill(&mut self) -> Result<(), PlanError> {
        self.motion.stop(self.axes.iter().map(|axis| {
            let standing = State { position: axis.set_point().position, ..State::default() };
            (standing, &axis.parameters().limits)
        }))
    }

    fn plan_stop(&mut self) -> Result<(), PlanError> {
        self.axes.iter_mut().for_each(Axis::begin_stop);
        if self.phase == Phase::Streaming {
            self.axes.iter_mut().for_each(|axis| axis.take_steps(self.period_s));
        }
        self.motion.stop(self.axes.iter().map(|axis| {
            let here = axis.set_point();
            let standing = State { position: here.position, ..State::default() };
            (if axis.is_profile() { standing } else { here }, &axis.parameters().limits)
        }))
    }
}

const fn has_power(phase: Phase) -> bool {
    !matches!(phase, Phase::Passive | Phase::Disabled)
}

/// What is wrong with an axis, if anything: rule, value, limit. A fault that is being reset is none yet.
fn complaint(
    axis: &mut Axis,
    phase: Phase,
    is_resetting: bool,
    acknowledge_limit: u32,
) -> Option<(Rule, f64, f64)> {
    let is_stopping_itself = phase == Phase::Stopping && axis.stops_by_itself();
    let must_be_enabled = !matches!(phase, Phase::Enabling | Phase::Disabling) && !is_stopping_itself;
    let is_disabled = must_be_enabled && !axis.is_enabled();
    let is_faulted = axis.drive_state().is_faulted() && !is_resetting;
    // Whatever else is wrong with it, and comes first.
    if is_disabled || is_faulted {
        axis.give_up();
    }
    let missed_limit = axis.parameters().missed_feedback_cycles;
    if axis.feedback_age() > missed_limit {
        return Some((Rule::MissedFeedback, axis.feedback_age().into(), missed_limit.into()));
    }
    if axis.late_cycles() > 0 {
        return Some((Rule::MissedFeedback, axis.late_cycles().into(), 0.0));
    }
    if is_faulted {
        return Some((Rule::DriveFault, axis.error_code().into(), 0.0));
    }
    if let Some(complaint) = axis.node_complaint() {
        let timeout = axis.parameters().heartbeat_timeout_cycles.unwrap_or(0);
        return Some(match complaint {
            NodeComplaint::BootUp => (Rule::UnexpectedBootUp, 0.0, 0.0),
            NodeComplaint::NotOperational { state } => {
                (Rule::NodeNotOperational, state.into(), node_state::OPERATIONAL.into())
            }
            NodeComplaint::Silent { cycles } => (Rule::NodeLost, cycles.into(), timeout.into()),
        });
    }
    if axis.is_duplicate() {
        return Some((Rule::DuplicateNode, axis.parameters().node.into(), 0.0));
    }
    if let Some(mode) = axis.foreign_mode().filter(|_| phase != Phase::Disabling) {
        let ours = axis.parameters().law.operation_mode() as i8;
        return Some((Rule::ModeChanged, mode.into(), ours.into()));
    }
    if matches!(phase, Phase::Enabling | Phase::Disabling) {
        return None;
    }
    if let Some(code) = axis.unexplained_emergency() {
        return Some((Rule::EmergencyMessage, code.into(), 0.0));
    }
    if is_disabled {
        return Some((Rule::DriveDisabled, axis.statusword().into(), 0.0));
    }
    if let Some(jump) = axis.jump() {
        return Some((Rule::ImplausibleFeedback, jump.distance, jump.reach));
    }
    if axis.unacknowledged_cycles() > acknowledge_limit {
        let (cycles, limit) = (axis.unacknowledged_cycles().into(), acknowledge_limit.into());
        return Some((Rule::NotAcknowledged, cycles, limit));
    }
    let checked = axis.check_following().and_then(|()| axis.check_profile());
    checked.err().map(|violation| (violation.rule, violation.value, violation.limit))
}
