//! What the groups of a controller share: the grid, the buses, the heartbeat, and what observers see.

use arrayvec::ArrayVec;

use super::backlog::Backlog;
use super::cycle_input::Deadline;
use super::foreign_frames::ForeignFrames;
use super::guarding::NodeGuards;
use super::heartbeat::HeartbeatProducer;
use super::outbox::Outbox;
use super::parameters::{BusParameters, EngineParameters};
use super::slots::SlotWatch;
use crate::axis::{Axis, Exchange};
use crate::bit_set::BitSet;
use crate::host::Snapshot;
use crate::record::{CycleRecord, Event, EventKind};
use crate::source::AxisTarget;
use crate::stop::StopCategories;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::time_of_day::TimeProducer;

/// What the groups share.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Shared<const AXES: usize, const BUSES: usize> {
    pub(super) period_ns: Nanoseconds,
    pub(super) period_s: f64,
    pub(super) enable_timeout_cycles: u32,
    pub(super) not_transmitted_cycles: u32,
    pub(super) acknowledge_timeout_cycles: u32,
    pub(super) categories: StopCategories,
    pub(super) buses: ArrayVec<BusParameters, BUSES>,
    /// The buses that are CANopen networks.
    pub(super) canopen_buses: BitSet,
    /// The buses with a cycle in each slot.
    buses_of_every_slot: BitSet,
    /// The axes on each bus.
    places_on: [BitSet; BUSES],
    /// True if there are drives that are spoken to outside of the cycle.
    pub(super) has_off_cycle: bool,
    pub(super) requested: Requested,
    /// True if the commands of this cycle were ready in time, as far as is known.
    pub(super) deadline: Deadline,

    /// The time of the present cycle.
    pub(super) now_ns: Nanoseconds,
    pub(super) slots: SlotWatch,
    pub(super) backlog: Backlog<BUSES>,
    /// The buses whose next SYNC is skipped, because a drive on them has to show that its answers are not late.
    pub(super) skip_sync: BitSet,
    /// The buses whose drives have been asked for feedback by SYNC in this slot.
    pub(super) asked_by_sync: BitSet,
    /// The buses with drives that are stopped by SDO in this slot.
    pub(super) stopped_by_sdo: BitSet,
    /// Frames that only this controller may send.
    pub(super) foreign_frames: ForeignFrames<BUSES>,
    pub(super) heartbeat: Option<HeartbeatProducer<BUSES>>,
    /// The nodes that are asked for their state.
    pub(super) guards: NodeGuards<AXES>,
    pub(super) time: Option<TimeProducer>,

    /// What the callbacks want of the axes, by their numbers. It counts in the cycle in which a callback was called.
    pub(super) callback_targets: [Option<AxisTarget>; AXES],
    pub(super) events: Outbox,
    /// Events, records and frames that found no room.
    pub(super) dropped: u64,
    pub(super) record: CycleRecord<AXES>,
    /// What observers see; the answers to requests are kept in it.
    pub(super) snapshot: Snapshot<AXES, BUSES>,
}

/// What was asked for that no later request takes back.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Requested {
    /// True if SYNC is sent.
    pub(super) sync: bool,
    /// How the run is to end.
    pub(super) ending: Ending,
}

/// How far a run is on its way to the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Ending {
    /// It goes on.
    #[default]
    NotBegun,
    /// Nothing is enabled any more.
    EnableInhibited,
    /// The loop ends after this cycle.
    Shutdown,
}

impl<const AXES: usize, const BUSES: usize> Shared<AXES, BUSES> {
    pub(super) fn new(parameters: EngineParameters<AXES, BUSES>) -> Self {
        let (axis_count, bus_count) = (parameters.axes.len() as u8, parameters.buses.len() as u8);
        let group_count = parameters.groups.len().max(1) as u8;
        let buses = parameters.buses.len();
        let heartbeat = |heartbeat| HeartbeatProducer::new(heartbeat, &parameters.buses);
        let mut places_on = [BitSet::default(); BUSES];
        for (place, number) in parameters.axes_of_groups().flatten().enumerate() {
            let axis = parameters.axes.get(usize::from(number));
            if let Some(places) = axis.and_then(|axis| places_on.get_mut(usize::from(axis.bus))) {
                places.insert(place);
            }
        }
        let numbers_of = |is_one: fn(&BusParameters) -> bool| {
            let numbers = parameters.buses.iter().enumerate().filter(move |(_, bus)| is_one(bus));
            numbers.map(|(number, _)| number).collect::<BitSet>()
        };
        let canopen_buses = numbers_of(|bus| bus.canopen.is_some());
        let buses_of_every_slot = numbers_of(|bus| bus.divider == 1);
        let guards = NodeGuards::new(&parameters);
        let has_off_cycle =
            parameters.axes.iter().any(|axis| matches!(axis.exchange, Exchange::OffCycle { .. }));
        Self {
            period_ns: parameters.period_ns,
            period_s: parameters.period_ns as f64 / NANOSECONDS_PER_SECOND as f64,
            enable_timeout_cycles: parameters.enable_timeout_cycles,
            not_transmitted_cycles: parameters.not_transmitted_cycles,
            acknowledge_timeout_cycles: parameters.acknowledge_timeout_cycles,
            categories: parameters.categories,
            requested: Requested::default(),
            deadline: Deadline::Met,
            now_ns: 0,
            slots: SlotWatch::new(parameters.timing),
            backlog: Backlog::new(buses, parameters.not_transmitted_cycles),
            skip_sync: BitSet::default(),
            asked_by_sync: BitSet::default(),
            stopped_by_sdo: BitSet::default(),
            foreign_frames: ForeignFrames::default(),
            heartbeat: parameters.heartbeat.map(heartbeat),
            guards,
            time: parameters.time_cycles.map(TimeProducer::new),
            callback_targets: [None; AXES],
            events: Outbox::default(),
            dropped: 0,
            record: CycleRecord { axis_count, group_count, ..CycleRecord::default() },
            snapshot: Snapshot { axis_count, bus_count, group_count, ..Snapshot::default() },
            buses: parameters.buses,
            has_off_cycle,
            canopen_buses,
            buses_of_every_slot,
            places_on,
        }
    }

    /// Emits an event that concerns a group; `None`: the controller as a whole.
    pub(super) fn emit(&mut self, group: Option<u8>, kind: EventKind) {
        self.events.push(Event { slot: self.present_slot(), at_ns: self.now_ns, group, kind });
    }

    pub(super) fn present_slot(&self) -> u64 {
        self.slots.present.unwrap_or(0)
    }

    /// The axes on a bus, by their places among those of the engine.
    pub(super) fn places_on(&self, bus: usize) -> BitSet {
        self.places_on.get(bus).copied().unwrap_or_default()
    }

    /// Returns `true` if a bus is a CANopen network.
    pub(super) fn is_canopen(&self, bus: usize) -> bool {
        self.buses.get(bus).is_some_and(|bus| bus.canopen.is_some())
    }

    /// Slots in one cycle of the bus of an axis.
    pub(super) fn divider_of(&self, axis: &Axis) -> u32 {
        self.buses.get(usize::from(axis.parameters().bus)).map_or(1, |bus| bus.divider)
    }

    /// The buses that have a cycle in this slot.
    pub(super) fn buses_in_cycle(&self, slot: u64) -> BitSet {
        let others = BitSet::first(self.buses.len()).without(self.buses_of_every_slot);
        let is_in_cycle = |number: &usize| self.buses.get(*number).is_some_and(|bus| has_cycle(bus, slot));
        others.iter().filter(is_in_cycle).collect::<BitSet>().union(self.buses_of_every_slot)
    }
}

/// Returns `true` if a bus has SYNC, feedback and set-points in this slot. Most have them in each, which takes no division to see.
pub(super) const fn has_cycle(bus: &BusParameters, slot: u64) -> bool {
    bus.divider == 1 || slot.is_multiple_of(bus.divider as u64)
}
