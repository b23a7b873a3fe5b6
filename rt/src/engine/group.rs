//! A group: axes that start, move, stop and fault together, with what only they have to do with.

use arrayvec::ArrayVec;

use super::shared::Shared;
use super::state::GroupState;
use super::unsent_steps::UnsentSteps;
use crate::axis::Axis;
use crate::bit_set::BitSet;
use crate::capacity::MAX_GROUPS;
use crate::group_trajectory::{GroupTrajectory, ProfileStore};
use crate::host::GroupSnapshot;
use crate::motion_reports::MotionState;
use crate::places::Places;
use crate::record::{Event, EventKind, GroupRecord, RecordedStop};
use crate::source::StreamSample;
use crate::stop::StopReason;
use crate::time::Nanoseconds;

/// What belongs to one group.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Group<const AXES: usize, const BUSES: usize> {
    /// Its number.
    pub(super) number: u8,
    /// The groups that stop this one, too, when they stop, directly or by way of others, by their numbers.
    pub(super) stops_with: ArrayVec<u8, MAX_GROUPS>,
    /// Where its axes stand among those of the engine, which has them beside each other.
    pub(super) places: Places,
    /// The buses that concern it.
    pub(super) buses: BitSet,
    /// Those of them on which set-points are sent in the cycle.
    pub(super) set_point_buses: BitSet,
    /// True if the mode of any of its axes may be changed.
    pub(super) has_other_modes: bool,
    pub(super) state: GroupState<AXES>,
    /// What its stream wants in this slot, while it streams.
    pub(super) stream: StreamSample<AXES>,
    /// How long the call of its callback took in this cycle; `None` if none was called.
    pub(super) callback_ns: Option<Nanoseconds>,
    /// Cycles since the state was entered.
    pub(super) state_cycles: u32,
    /// What is planned, while the group moves or stops.
    pub(super) motion: GroupTrajectory,
    /// Why the group stops or has stopped. It stays until a request ends it: a fault must be reset.
    pub(super) stop: Option<StopReason>,
    /// True if enabling is refused until the host has confirmed another bring-up.
    pub(super) needs_bring_up: bool,
    /// Cycles of a fault reset that are still to come.
    pub(super) fault_reset_cycles: u32,
    /// Cycles of each of its three parts.
    pub(super) fault_reset_part: u32,
    pub(super) commands: Commands,
    pub(super) unsent: UnsentSteps<BUSES>,
    /// Cycles in which its set-points went on.
    pub(super) steps: u64,
    /// What the groups that stop with this one do not know yet.
    pub(super) untold: Option<StopReason>,
}

/// What becomes of the commands of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Commands {
    /// There are none: the group is passive, or every one of its buses is behind.
    None,
    /// They are to leave with this cycle.
    Made,
}

impl<const AXES: usize, const BUSES: usize> Group<AXES, BUSES> {
    /// A passive group.
    pub(super) fn new(number: u8, places: Places, buses: BitSet) -> Self {
        Self {
            number,
            stops_with: ArrayVec::new(),
            motion: GroupTrajectory::new(places),
            places,
            buses,
            set_point_buses: buses,
            has_other_modes: false,
            state: GroupState::Passive,
            stream: StreamSample::default(),
            callback_ns: None,
            state_cycles: 0,
            stop: None,
            needs_bring_up: false,
            fault_reset_cycles: 0,
            fault_reset_part: 1,
            commands: Commands::None,
            unsent: UnsentSteps::default(),
            steps: 0,
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

    /// Shows what the group did in the cycle.
    #[inline]
    pub(super) fn show(&self, record: &mut GroupRecord, snapshot: &mut GroupSnapshot) {
        let phase = self.state.phase();
        let stop = self.stop.as_ref().map(RecordedStop::of);
        *record = GroupRecord { phase, stop, callback_ns: self.callback_ns };
        *snapshot = GroupSnapshot {
            remaining_s: self.remaining_s(),
            stream: self.stream_report(),
            phase,
            stop: self.stop,
            needs_bring_up: self.needs_bring_up,
            steps: self.steps,
        };
    }

    /// Keeps a stop for the groups that stop with this one.
    pub(super) fn note_untold(&mut self, stop: StopReason) {
        self.untold = Some(StopReason::merged(self.untold, stop).reason);
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
    /// The planned motions of the axes of all groups.
    pub(super) profiles: &'a mut ProfileStore<AXES>,
    pub(super) shared: &'a mut Shared<AXES, BUSES>,
}

impl<const AXES: usize, const BUSES: usize> GroupContext<'_, AXES, BUSES> {
    /// Enters a state. One that goes on as it was, is not entered: what it may last counts from its first beginning.
    pub(super) fn enter(&mut self, state: GroupState<AXES>) {
        let (from, to) = (self.group.state.phase(), state.phase());
        self.group.state = state;
        if matches!(state, GroupState::Disabling(_)) {
            self.axes.iter_mut().for_each(Axis::release_power);
        }
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
