//! A group: axes that start, move, stop and fault together, with what only they have to do with.

use core::ops::Range;

use arrayvec::ArrayVec;

use super::shared::Shared;
use super::state::GroupState;
use super::unsent_steps::UnsentSteps;
use crate::axis::Axis;
use crate::bus_set::BusSet;
use crate::group_trajectory::{GroupTrajectory, Profiles};
use crate::motion_reports::MotionState;
use crate::record::{Event, EventKind, MAX_GROUPS};
use crate::source::StreamSample;
use crate::stop::StopReason;

/// What belongs to one group.
#[derive(Clone, Debug)]
pub(super) struct Group<const AXES: usize, const BUSES: usize> {
    /// Its number.
    pub(super) number: u8,
    /// The groups that stop this one, too, when they stop, by their numbers.
    pub(super) stops_with: ArrayVec<u8, MAX_GROUPS>,
    /// Where its axes stand among those of the engine, which has them beside each other.
    pub(super) places: Range<usize>,
    /// The buses that concern it.
    pub(super) buses: BusSet,
    /// Whether the mode of any of its axes may be changed.
    pub(super) has_other_modes: bool,
    pub(super) state: GroupState<AXES>,
    /// What its stream wants in this slot, while it streams.
    pub(super) stream: StreamSample<AXES>,
    /// Cycles since the state was entered.
    pub(super) state_cycles: u32,
    /// What is planned, while the group moves or stops.
    pub(super) motion: GroupTrajectory,
    /// Why the group stops or has stopped. It stays until a request ends it: a fault must be reset.
    pub(super) stop: Option<StopReason>,
    /// Cycles of a fault reset that are still to come.
    pub(super) fault_reset_cycles: u32,
    pub(super) commands: Commands,
    pub(super) unsent: UnsentSteps<BUSES>,
    /// The stop that has begun, or has become harder, and of which the groups that stop with this one do not know yet.
    pub(super) untold: Option<StopReason>,
}

/// What becomes of the commands of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Commands {
    /// There are none: the group is passive, or every one of its buses is behind.
    None,
    /// They are to leave with this cycle.
    Made,
}

impl<const AXES: usize, const BUSES: usize> Group<AXES, BUSES> {
    /// A passive group.
    pub(super) fn new(number: u8, places: Range<usize>, buses: BusSet) -> Self {
        Self {
            number,
            stops_with: ArrayVec::new(),
            places,
            buses,
            has_other_modes: false,
            state: GroupState::Passive,
            stream: StreamSample::default(),
            state_cycles: 0,
            motion: GroupTrajectory::default(),
            stop: None,
            fault_reset_cycles: 0,
            commands: Commands::None,
            unsent: UnsentSteps::default(),
            untold: None,
        }
    }

    /// Planned time left of the present move or stop, in seconds.
    pub(super) fn remaining_s(&self) -> f64 {
        match self.state {
            GroupState::Moving { .. } | GroupState::Stopping => self.motion.remaining_s(),
            GroupState::Executing(execution) => execution.wanted.map_or(0.0, |wanted| wanted.remaining_s),
            _ => 0.0,
        }
    }

    /// Ends the cycle, whose commands have left, or were ready too late.
    pub(super) fn end_cycle(&mut self, is_late: bool) {
        if self.commands == Commands::Made && !is_late {
            self.fault_reset_cycles = self.fault_reset_cycles.saturating_sub(1);
        }
    }
}

/// A group in a cycle: with its axes, and with what it shares with the other groups.
pub(super) struct GroupContext<'a, const AXES: usize, const BUSES: usize> {
    pub(super) group: &'a mut Group<AXES, BUSES>,
    /// Its axes.
    pub(super) axes: &'a mut [Axis],
    /// Their planned motions, in the same order.
    pub(super) profiles: Profiles<'a, AXES>,
    pub(super) shared: &'a mut Shared<AXES, BUSES>,
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Enters a state. One that goes on as it was, is not entered: what it may last counts from its first beginning.
    pub(super) fn enter(&mut self, state: GroupState<AXES>) {
        let (from, to) = (self.group.state.phase(), state.phase());
        self.group.state = state;
        if from != to {
            self.emit(EventKind::PhaseChanged { from, to });
            self.group.state_cycles = 0;
        }
    }

    /// Emits an event that concerns the group.
    pub(super) fn emit(&mut self, kind: EventKind) {
        self.shared.emit(Some(self.group.number), kind);
    }

    /// The motions of the group have reached their targets.
    pub(super) fn finish_motions(&mut self) {
        let (number, shared) = (self.group.number, &mut *self.shared);
        let (slot, at_ns, group) = (shared.present_slot(), shared.now_ns, Some(number));
        let events = &mut shared.events;
        shared.snapshot.motions.end_all(number, MotionState::Finished, |request| {
            events.push(Event { slot, at_ns, group, kind: EventKind::MotionFinished { request } });
        });
    }
}
