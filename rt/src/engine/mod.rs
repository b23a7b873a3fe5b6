//! The cycle as pure computation: frames and time in, frames out.
//!
//! [`Engine`] holds the axes and what each of their groups is doing. It knows neither clocks nor buses: [`crate::cycle`]
//! drives it. What belongs to one group is in `group`, what the groups share in `shared`. Each cycle reads
//!
//! ```text
//! sync → receive … → compute { sense → handle_requests → check_faults → step } → encode → finish
//! ```
//!
//! - `sense` counts slots and takes what the drives have reported;
//! - `requests` handles what was asked for, `group_requests` what was asked of a group; `targets` checks the targets;
//!   `process_data` exchanges mappings;
//! - `faults` looks for the first thing that is wrong, and begins stops;
//! - `step` makes the next set-points of the phase that the group is in (`state` has the table of phases), `streaming` those
//!   of a stream, `executing` those of a trajectory, `calling` those of a callback; `changing_mode` changes modes of operation;
//! - `encode` makes frames of them, and decides what may leave; `sdo_fallback` stops drives that PDOs do not reach.
//!
//! Events wait in an outbox until [`Engine::finish`] hands them to the host.

mod backlog;
mod calling;
mod changing_mode;
#[cfg(feature = "checkpoint")]
mod checkpoint;
mod cycle_input;
mod encode;
mod executing;
mod execution;
mod faults;
mod foreign_frames;
mod group;
mod group_requests;
mod guarding;
mod heartbeat;
mod in_loop;
mod outbox;
mod parameters;
mod process_data;
mod requests;
mod sdo_fallback;
mod send_batch;
mod sense;
mod shared;
mod shared_frames;
mod slots;
mod state;
mod step;
mod streaming;
mod targets;
mod unsent_steps;

use arrayvec::ArrayVec;

use crate::axis::Axis;
use crate::bit_set::BitSet;
use crate::capacity::{MAX_AXES, MAX_BUSES, MAX_GROUPS};
use crate::dispatch::Dispatch;
use crate::group_trajectory::ProfileStore;
use crate::host::HostInterface;
use crate::phase::Phase;
use crate::places::Places;
use crate::port::BusHealth;
use crate::record::{CycleTiming, EventKind};
use crate::time::Nanoseconds;
use group::{Commands, Group, GroupContext};
use parameters::{axes_of, dispatch_of};
use shared::{Ending, Shared};

pub use cycle_input::{CycleInput, Deadline};
pub use parameters::{
    BusParameters, CanopenNetwork, CycleCount, EngineParameters, GroupParameters, Heartbeat, SetUpError,
};
pub use send_batch::{SEND_BATCH, SendBatch};
pub use sense::Receiver;

/// The axes of a controller, in groups that each move together.
///
/// `AXES` and `BUSES` are the most axes and buses that there is room for. An engine needs about 7 kB for each axis, 5 kB for each
/// bus, and 15 kB beside: 34 kB for two axes on one bus, 329 kB for 32 axes on 16 buses.
///
/// # The order of calls
/// In each slot, once each: [`Engine::sync`] for every bus, and its frame is sent; [`Engine::receive`] for every frame that has
/// arrived; [`Engine::compute`]; [`Engine::encode`] for every bus, and its batch is sent; [`Engine::finish`].
/// [`crate::Cycle`] does that with a clock and ports.
///
/// ```
/// use takt_rt::*;
///
/// /// Asks for one thing after the other.
/// struct Host { requests: Vec<Request<1>>, phase: Phase }
///
/// impl HostInterface<1, 1> for Host {
///     fn request(&mut self) -> Option<RequestEnvelope<1>> {
///         self.requests.pop().map(|request| RequestEnvelope {
///             id: RequestId(0),
///             target: RequestTarget::All,
///             request,
///         })
///     }
///     fn publish(&mut self, snapshot: &Snapshot<1, 1>) {
///         self.phase = snapshot.groups()[0].phase;
///     }
/// }
///
/// let object = MappedObject::new;
/// let pdo = |function, mapping| Pdo::classic(Id::canopen(function, 1), mapping);
/// let commands = Mapping::commands(&[object(0x6040, 0, 16), object(0x607A, 0, 32)]).unwrap();
/// let feedback = Mapping::feedback(&[object(0x6041, 0, 16), object(0x6064, 0, 32)]).unwrap();
/// let axis = AxisParameters {
///     bus: 0,
///     node: 1,
///     node_axis: 1,
///     exchange: Exchange::Pdos(Pdos {
///         commands: [CommandPdo::every_cycle(pdo(0x200, commands))].into_iter().collect(),
///         feedback: [pdo(0x180, feedback)].into_iter().collect(),
///         unused: Default::default(),
///     }),
///     feedback_since: FeedbackSince::Sync,
///     codec: Cia402Codec::default(),
///     controlword_spacing_cycles: 0,
///     law: ControlLaw::Position,
///     mode_changes: ModeChanges::default(),
///     scale: Scale::new(ScaleParameters {
///         counts_per_turn: 524_288.0,
///         velocity_units_per_turn: 524_288.0,
///         gear_ratio: 1.0,
///         travel_per_turn: std::f64::consts::TAU,
///         reversed: false,
///         zero_counts: 0.0,
///         rated_torque: 31.0,
///     })
///     .unwrap(),
///     counter: PositionCounter::default(),
///     limits: AxisLimits {
///         position_min: -3.0,
///         position_max: 3.0,
///         velocity: 2.0,
///         acceleration: 10.0,
///         deceleration: 10.0,
///         jerk: 200.0,
///         torque: 40.0,
///     },
///     torque_limits: TorqueLimits::NONE,
///     feed_forward: FeedForward::None,
///     start_tolerance: 0.02,
///     follow: Follow::Smooth,
///     supervision: Supervision::Feedback,
///     stops_by_itself_cycles: None,
///     following_error_limit: 0.1,
///     following_error_cycles: 50,
///     missed_feedback_cycles: 5,
/// };
/// let bus = BusParameters {
///     canopen: Some(CanopenNetwork { sync_id: Id::canopen(0x080, 0) }),
///     divider: 1,
///     service_frames_active: 1,
///     service_frames_passive: 6,
/// };
/// let mut engine: Engine<1, 1> = Engine::new(EngineParameters {
///     period_ns: 1_000_000,
///     axes: [axis].into_iter().collect(),
///     groups: Default::default(),
///     buses: [bus].into_iter().collect(),
///     heartbeat: None,
///     time_cycles: None,
///     enable_timeout_cycles: 100,
///     not_transmitted_cycles: 5,
///     acknowledge_timeout_cycles: 500,
///     categories: StopCategories::default(),
///     timing: TimingLadder { warning: 10, degraded: 50, unfit: 250, leak_slots: 20 },
/// })
/// .unwrap();
///
/// let requests = vec![Request::Enable, Request::Activate, Request::Sync(true)];
/// let mut host = Host { requests, phase: Phase::Passive };
/// let mut statusword = 0x0231_u16; // ready to switch on
/// for slot in 0..50 {
///     let now_ns = slot * 1_000_000;
///     let sync = engine.sync(0, slot, now_ns);
///     // A real drive answers SYNC by its position. This one is always at count 1.
///     if sync.is_some() {
///         let [low, high] = statusword.to_le_bytes();
///         let frame = Frame::of(Id::canopen(0x180, 1), [low, high, 1, 0, 0, 0]);
///         engine.receive(0, &Received { frame, at_ns: now_ns });
///     }
///     let buses = [BusHealth::default()];
///     let input = CycleInput {
///         slot,
///         slot_start_ns: now_ns,
///         set_points_due_ns: now_ns + 800_000,
///         now_ns,
///         suspended_ns: 0,
///         buses: &buses,
///         behind: BitSet::default(),
///     };
///     engine.compute(&input, &mut host);
///     let mut batch = SendBatch::new();
///     engine.encode(0, Deadline::Met, &mut host, &mut batch);
///     // It obeys the controlword, the first two bytes of its command.
///     statusword = match batch.first().map(Frame::payload) {
///         Some([0x07, ..]) => 0x0233, // switched on
///         Some([0x0F, ..]) => 0x0237, // operation enabled
///         _ => statusword,
///     };
///     let timing = CycleTiming { slot, ..CycleTiming::default() };
///     engine.finish(timing, now_ns, &buses, &mut host);
/// }
/// assert_eq!(host.phase, Phase::Holding);
/// ```
#[derive(Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Engine<const AXES: usize = MAX_AXES, const BUSES: usize = MAX_BUSES> {
    dispatch: [Dispatch; BUSES],
    axes: ArrayVec<Axis, AXES>,
    profiles: ProfileStore<AXES>,
    groups: ArrayVec<Group<AXES, BUSES>, MAX_GROUPS>,
    shared: Shared<AXES, BUSES>,
}

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// An engine in [`Phase::Passive`].
    ///
    /// # Errors
    /// A parameter that is not possible. Everything that the engine relies on is checked here.
    pub fn new(parameters: EngineParameters<AXES, BUSES>) -> Result<Self, SetUpError> {
        parameters.validate()?;
        let mut groups: ArrayVec<Group<AXES, BUSES>, MAX_GROUPS> = ArrayVec::new();
        let mut first = 0;
        for (number, axes) in (0..).zip(parameters.axes_of_groups()) {
            let places = Places { first, end: first + axes.len() };
            first = places.end;
            let mut group = Group::new(number, places, parameters.buses_of(&axes));
            let mut own = axes.iter().filter_map(|axis| parameters.axes.get(usize::from(*axis)));
            group.has_other_modes = own.any(|axis| !axis.mode_changes.laws.is_empty());
            group.set_point_buses = parameters.set_point_buses_of(&axes);
            groups.push(group);
        }
        for (number, group) in (0..).zip(&mut groups) {
            group.stops_with = parameters.stops_with(number);
        }
        Ok(Self {
            dispatch: dispatch_of(&parameters)?,
            axes: axes_of(&parameters),
            profiles: ProfileStore::default(),
            groups,
            shared: Shared::new(parameters),
        })
    }

    /// How many buses there are.
    pub fn bus_count(&self) -> usize {
        self.shared.buses.len()
    }

    /// The period of the cycle.
    pub fn period_ns(&self) -> Nanoseconds {
        self.shared.period_ns
    }

    /// What a group is doing; `None` if there is no such group.
    pub fn phase(&self, group: u8) -> Option<Phase> {
        self.groups.get(usize::from(group)).map(|group| group.state.phase())
    }

    /// The axes, group by group: see [`Axis::number`].
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Returns `true` if the loop is to end after this cycle.
    pub fn is_shutting_down(&self) -> bool {
        self.shared.requested.ending == Ending::Shutdown
    }

    /// What one cycle decides. [`Engine::encode`] makes frames of it.
    pub fn compute(&mut self, input: &CycleInput<'_>, host: &mut impl HostInterface<AXES, BUSES>) {
        if self.shared.has_off_cycle {
            self.take_off_cycle_reports(host);
        }
        self.sense(input);
        self.handle_requests(host);
        self.sample_streams(input.slot_start_ns, host);
        self.check_faults(input);
        self.couple_stops();
        self.probe_late_drives();
        self.sample_trajectories(host);
        self.shared.stopped_by_sdo = BitSet::default();
        self.for_each_group(|group| {
            group.step(input, host);
            host.keep_callback(group.group.number, group.group.state.callback());
            group.update_sdo_fallback();
            group.group.state_cycles = group.group.state_cycles.saturating_add(1);
        });
    }

    /// A group with its axes and what it shares with the others.
    fn group(&mut self, number: u8) -> Option<GroupContext<'_, AXES, BUSES>> {
        let group = self.groups.get_mut(usize::from(number))?;
        Some(GroupContext {
            axes: self.axes.get_mut(group.places.range())?,
            profiles: &mut self.profiles,
            group,
            shared: &mut self.shared,
        })
    }

    /// Lets every group act, one after the other.
    fn for_each_group(&mut self, mut act: impl FnMut(&mut GroupContext<'_, AXES, BUSES>)) {
        for group in &mut self.groups {
            let Some(axes) = self.axes.get_mut(group.places.range()) else { continue };
            act(&mut GroupContext { group, axes, profiles: &mut self.profiles, shared: &mut self.shared });
        }
    }

    /// Ends the cycle: hands the events, the record and the new state to the host.
    pub fn finish(
        &mut self,
        timing: CycleTiming,
        now_ns: Nanoseconds,
        buses: &[BusHealth],
        host: &mut impl HostInterface<AXES, BUSES>,
    ) {
        let is_late = self.shared.deadline == Deadline::Missed;
        let shared = &mut self.shared;
        let mut is_commanded = false;
        let shown = shared.record.groups.iter_mut().zip(&mut shared.snapshot.groups);
        for (group, (record, snapshot)) in self.groups.iter_mut().zip(shown) {
            is_commanded |= !is_late && group.commands == Commands::Made;
            group.end_cycle(is_late);
            group.discard_points(host);
            group.show(record, snapshot);
        }
        shared.slots.end(is_late);
        if is_late {
            shared.emit(None, EventKind::MissedSlots { count: 1 });
        }
        shared.dropped += shared.events.drain(|event| host.event(event));
        shared.record.timing = CycleTiming { missed_slots: shared.slots.missed_now, ..timing };
        shared.record.is_commanded = is_commanded;
        for axis in &self.axes {
            let number = usize::from(axis.number());
            let (records, shown) = (&mut shared.record.axes, &mut shared.snapshot.axes);
            if let (Some(record), Some(shown)) = (records.get_mut(number), shown.get_mut(number)) {
                axis.show(shown);
                axis.record(shared.period_s, shown, record);
            }
        }
        shared.dropped += u64::from(!host.record(&shared.record));
        self.show(timing.slot, now_ns, buses);
        host.publish(&self.shared.snapshot);
    }

    fn show(&mut self, slot: u64, now_ns: Nanoseconds, buses: &[BusHealth]) {
        let shared = &mut self.shared;
        let snapshot = &mut shared.snapshot;
        snapshot.slot = slot;
        snapshot.at_ns = now_ns;
        snapshot.missed_slots = shared.slots.missed;
        snapshot.timing = shared.slots.level();
        snapshot.dropped = shared.dropped;
        for (shown, health) in snapshot.buses.iter_mut().zip(buses) {
            *shown = *health;
        }
    }
}
