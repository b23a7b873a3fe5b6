//! The change of modes of operation at run time: whether it is possible, and its way from the first command of another mode to
//! the drives showing it. What keeps the joints where they are meanwhile is in `axis::mode`.

use super::group::GroupContext;
use super::requests::Handled;
use super::shared::Ending;
use super::state::{AtRest, GroupState};
use super::step::Failure;
use super::targets::Rejection;
use crate::axis::{Axis, ModeCondition};
use crate::cia402::OperationMode;
use crate::control::ControlLaw;
use crate::fault::Fault;
use crate::pdo::{CommandSlot, FeedbackSlot, MappedObject};
use crate::phase::Phase;
use crate::record::EventKind;
use crate::rejection::RejectReason;
use crate::request::{ModeChange, RequestId};
use crate::stop::{Origin, StopCause};
use crate::stop_category::StopCategory;

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Returns `true` if every axis that is to change its mode can.
    pub(super) fn check_mode_change(&self, change: &ModeChange<AXES>) -> Handled {
        if self.shared.requested.ending >= Ending::EnableInhibited {
            return Err(RejectReason::EnableInhibited.into());
        }
        self.require_phase(&[Phase::Disabled, Phase::Holding])?;
        self.require_bring_up()?;
        self.require_no_fault()?;
        let is_enabled = matches!(self.group.state, GroupState::Holding);
        for axis in self.axes.iter() {
            if let Some(mode) = other_mode(axis, change) {
                check_axis(axis, mode, is_enabled.then_some(self.shared.period_s))
                    .map_err(|reason| -> Rejection { reason.of_axis(axis.number()) })?;
            }
        }
        Ok(())
    }

    /// Begins a change that has been checked.
    pub(super) fn begin_mode_change(&mut self, id: RequestId, change: &ModeChange<AXES>) {
        let at = match self.group.state {
            GroupState::Holding => AtRest::Holding,
            _ => AtRest::Disabled,
        };
        for axis in self.axes.iter_mut() {
            let law = other_mode(axis, change).and_then(|mode| axis.law_for(mode)).copied();
            if let Some(law) = law {
                axis.begin_mode_change(law);
            }
        }
        self.group.stop = None;
        self.shared.snapshot.motions.begin(id, self.group.number, None, |axis| axis.is_none());
        self.enter(GroupState::ChangingMode(at));
        // The phase that is shown is the same, so that it has not begun anew.
        self.group.state_cycles = 0;
    }

    /// One cycle of waiting for the drives to show their new modes. The set-points stay.
    pub(super) fn step_mode_change(&mut self, at: AtRest) -> Result<(), Failure> {
        if at == AtRest::Disabled && self.shared.requested.ending >= Ending::EnableInhibited {
            // The run is ending: soon the drives exchange no process data any more.
            self.cancel_mode_change(at);
            self.begin_stop(StopCause::Requested, Origin::Group, StopCategory::Two);
        } else if self.axes.iter().all(|axis| !axis.is_changing_mode() || axis.shows_commanded_mode()) {
            for axis in self.axes.iter_mut().filter(|axis| axis.is_changing_mode()) {
                axis.end_mode_change();
                let (number, mode) = (axis.number(), axis.parameters().law.operation_mode());
                self.shared.emit(Some(self.group.number), EventKind::Mode { axis: number, mode });
            }
            self.leave_mode_change(at);
            self.finish_motions();
        } else if let Some(failure) = self.late_mode() {
            self.cancel_mode_change(at);
            return Err(failure);
        }
        self.hold();
        Ok(())
    }

    /// A drive that has not shown its new mode in time.
    fn late_mode(&self) -> Option<Failure> {
        let cycles = self.group.state_cycles;
        let mut late = self.axes.iter().filter(|axis| {
            axis.is_changing_mode()
                && !axis.shows_commanded_mode()
                && cycles > axis.parameters().mode_changes.timeout_cycles
        });
        let axis = late.next()?;
        let expected = OperationMode::from_number(axis.mode_set())?;
        let fault = Fault::ModeNotShown { shown: axis.mode().unwrap_or(0), expected };
        Some((Origin::Axis(axis.number()), fault))
    }

    /// Tells every drive its former mode again.
    pub(super) fn cancel_mode_change(&mut self, at: AtRest) {
        let changing = self.axes.iter_mut().filter(|axis| axis.is_changing_mode());
        changing.for_each(Axis::cancel_mode_change);
        self.leave_mode_change(at);
    }

    fn leave_mode_change(&mut self, at: AtRest) {
        self.group.state = match at {
            AtRest::Disabled => GroupState::Disabled,
            AtRest::Holding => GroupState::Holding,
        };
    }
}

/// The mode that an axis is to change to, if it is not in it.
fn other_mode<const AXES: usize>(axis: &Axis, change: &ModeChange<AXES>) -> Option<OperationMode> {
    axis.own(&change.modes).filter(|mode| *mode != axis.parameters().law.operation_mode())
}

/// Checks that an axis can change to a mode; where it is enabled, with the period of the cycle.
fn check_axis(axis: &Axis, mode: OperationMode, enabled_period_s: Option<f64>) -> Result<(), RejectReason> {
    let law = axis.law_for(mode).ok_or(RejectReason::UnknownMode { mode })?;
    if enabled_period_s.is_some() && axis.parameters().mode_changes.condition == ModeCondition::Disabled {
        return Err(RejectReason::NotDisabled);
    }
    check_mapping(axis, law, enabled_period_s.is_some())?;
    enabled_period_s.map_or(Ok(()), |period_s| check_rest(axis, period_s))
}

/// Checks that the process data carry what the change needs. A drive that is enabled must tell the torque that holds its joint,
/// so that a loop that is closed here can go on from it.
fn check_mapping(axis: &Axis, law: &ControlLaw, is_enabled: bool) -> Result<(), RejectReason> {
    for slot in [CommandSlot::OperationMode, law.target_slot()] {
        if !axis.sends(slot) {
            return Err(RejectReason::ObjectNotMapped { object: slot.object() });
        }
    }
    let needs_torque = is_enabled && law.target_slot() == CommandSlot::TargetTorque;
    let needed = [
        (true, FeedbackSlot::OperationModeDisplay, MappedObject::new(0x6061, 0, 8)),
        (needs_torque, FeedbackSlot::Torque, MappedObject::new(0x6077, 0, 16)),
    ];
    match needed.into_iter().find(|(is_needed, slot, _)| *is_needed && !axis.reports(*slot)) {
        Some((_, _, object)) => Err(RejectReason::ObjectNotMapped { object }),
        None => Ok(()),
    }
}

/// Checks that the mode of an enabled drive can change without a bump.
fn check_rest(axis: &Axis, period_s: f64) -> Result<(), RejectReason> {
    if !axis.is_at_rest() {
        return Err(RejectReason::NotAtRest { velocity: axis.velocity() });
    }
    if !axis.is_on_joint(period_s) {
        let distance = (axis.position() - axis.set_point().position).abs();
        return Err(RejectReason::OffSetPoint {
            distance,
            limit: axis.parameters().limits.velocity * period_s,
        });
    }
    Ok(())
}
