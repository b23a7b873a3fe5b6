//! The cycle of one group as pure computation: frames and time in, frames out.
//!
//! [`Engine`] holds the axes of a group and what the group is doing. It knows neither clocks nor buses: [`crate::cycle`]
//! drives it. Each cycle reads
//!
//! ```text
//! sync → receive … → compute { sense → handle_requests → check_faults → step } → encode → finish
//! ```
//!
//! - `sense` counts slots and takes what the drives have reported;
//! - `requests` handles what was asked for; `targets` checks the targets; `process_data` exchanges mappings;
//! - `faults` looks for the first thing that is wrong, and begins stops;
//! - `step` makes the next set-points of the phase that the group is in (`state` has the table of phases);
//! - `encode` makes frames of them, and decides what may leave; `sdo_fallback` stops drives that PDOs do not reach.
//!
//! Events wait in an outbox until [`Engine::finish`] hands them to the host.

mod backlog;
mod encode;
mod faults;
mod heartbeat;
mod outbox;
mod parameters;
mod process_data;
mod requests;
mod sdo_fallback;
mod sense;
mod slots;
mod state;
mod step;
mod targets;
mod unsent_steps;

use arrayvec::ArrayVec;

use crate::axis::Axis;
use crate::bus_set::BusSet;
use crate::dispatch::Dispatch;
use crate::frame::{Frame, Id};
use crate::group_trajectory::GroupTrajectory;
use crate::host::{HostInterface, Snapshot};
use crate::phase::Phase;
use crate::port::BusHealth;
use crate::record::{CycleRecord, CycleTiming, Event, EventKind, MAX_AXES, MAX_BUSES};
use crate::stop::{StopCategories, StopReason};
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::time_of_day::TimeProducer;
use backlog::Backlog;
use heartbeat::HeartbeatProducer;
use outbox::Outbox;
use parameters::{axes_of, dispatch_of};
use slots::SlotWatch;
use state::GroupState;
use unsent_steps::UnsentSteps;

pub use parameters::{BusParameters, CycleCount, EngineParameters, Heartbeat, SetUpError};
pub use sense::Receiver;

/// The most frames that the engine hands to one bus in one cycle.
pub const SEND_BATCH: usize = 64;

/// Frames for one bus.
pub type SendBatch = ArrayVec<Frame, SEND_BATCH>;

/// What a cycle begins with.
#[derive(Clone, Copy, Debug)]
pub struct CycleInput<'a> {
    /// The slot.
    pub slot: u64,
    /// The time.
    pub now_ns: Nanoseconds,
    /// The state of each bus.
    pub buses: &'a [BusHealth],
    /// The buses on which own frames of an earlier cycle still wait for the wire.
    pub behind: BusSet,
}

/// Whether the set-points of a cycle were ready in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadline {
    /// They were.
    Met,
    /// They would run into the next SYNC. Nothing leaves but what stops the drives, and the slot counts as missed.
    Missed,
}

/// A group of axes that move together.
///
/// `AXES` and `BUSES` are the most axes and buses that there is room for. An engine needs about 5 kB for each axis, 4 kB for each
/// bus, and 7 kB beside: 21 kB for two axes on one bus, 229 kB for 32 axes on 16 buses.
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
///         self.requests.pop().map(|request| RequestEnvelope { id: RequestId(0), request })
///     }
///     fn publish(&mut self, snapshot: &Snapshot<1, 1>) {
///         self.phase = snapshot.phase;
///     }
/// }
///
/// let object = MappedObject::new;
/// let pdo = |function, mapping| Pdo { id: Id::canopen(function, 1), mapping };
/// let commands = Mapping::commands(&[object(0x6040, 0, 16), object(0x607A, 0, 32)]).unwrap();
/// let feedback = Mapping::feedback(&[object(0x6041, 0, 16), object(0x6064, 0, 32)]).unwrap();
/// let axis = AxisParameters {
///     bus: 0,
///     node: 1,
///     commands: [CommandPdo::every_cycle(pdo(0x200, commands))].into_iter().collect(),
///     feedback: [pdo(0x180, feedback)].into_iter().collect(),
///     feedback_since: FeedbackSince::Sync,
///     unused: Default::default(),
///     dialect: Dialect::Cia402,
///     controlword_spacing_cycles: 0,
///     law: ControlLaw::Position,
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
///     limits: AxisLimits {
///         position_min: -3.0,
///         position_max: 3.0,
///         velocity: 2.0,
///         acceleration: 10.0,
///         deceleration: 10.0,
///         jerk: 200.0,
///         torque: 40.0,
///     },
///     start_tolerance: 0.02,
///     on_violation: OnViolation::Reject,
///     heartbeat_timeout_cycles: None,
///     following_error_limit: 0.1,
///     following_error_cycles: 50,
///     missed_feedback_cycles: 5,
/// };
/// let bus = BusParameters {
///     sync_id: Id::canopen(0x080, 0),
///     divider: 1,
///     service_frames_active: 1,
///     service_frames_passive: 6,
/// };
/// let mut engine: Engine<1, 1> = Engine::new(EngineParameters {
///     period_ns: 1_000_000,
///     axes: [axis].into_iter().collect(),
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
///     engine.compute(&CycleInput { slot, now_ns, buses: &buses, behind: BusSet::default() }, &mut host);
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
pub struct Engine<const AXES: usize = MAX_AXES, const BUSES: usize = MAX_BUSES> {
    period_ns: Nanoseconds,
    period_s: f64,
    enable_timeout_cycles: u32,
    not_transmitted_cycles: u32,
    acknowledge_timeout_cycles: u32,
    categories: StopCategories,
    buses: ArrayVec<BusParameters, BUSES>,
    dispatch: [Dispatch; BUSES],

    axes: ArrayVec<Axis, AXES>,
    state: GroupState<AXES>,
    /// Cycles since the state was entered.
    state_cycles: u32,
    /// What is planned, while the group moves or stops.
    motion: GroupTrajectory<AXES>,
    /// Why the group stops or has stopped. It stays until a request ends it: a fault must be reset.
    stop: Option<StopReason>,
    /// Cycles of a fault reset that are still to come.
    fault_reset_cycles: u32,
    commands: Commands,
    unsent: UnsentSteps<BUSES>,
    /// Whether the commands of this cycle were ready in time, as far as is known.
    deadline: Deadline,
    requested: Requested,

    /// The time of the present cycle.
    now_ns: Nanoseconds,
    slots: SlotWatch,
    backlog: Backlog<BUSES>,
    /// The buses whose next SYNC is skipped, see [`Engine::probe_late_drives`].
    skip_sync: BusSet,
    /// The buses whose drives have been asked for feedback by SYNC in this slot.
    asked_by_sync: BusSet,
    /// The bus and the identifier of a frame that only this controller may send.
    foreign_frame: Option<(u8, Id)>,
    heartbeat: Option<HeartbeatProducer<BUSES>>,
    time: Option<TimeProducer>,

    events: Outbox,
    /// Events, records and frames that found no room.
    dropped: u64,
    record: CycleRecord<AXES>,
    /// What observers see; the answers to requests are kept in it.
    snapshot: Snapshot<AXES, BUSES>,
}

/// What becomes of the commands of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Commands {
    /// There are none: the group is passive, or every bus is behind.
    None,
    /// They are to leave with this cycle.
    Made,
}

/// What was asked for that no later request takes back.
#[derive(Clone, Copy, Debug, Default)]
struct Requested {
    /// Whether SYNC is sent.
    sync: bool,
    /// How the run is to end.
    ending: Ending,
}

/// How far a run is on its way to the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Ending {
    /// It goes on.
    #[default]
    NotBegun,
    /// Nothing is enabled any more.
    EnableInhibited,
    /// The loop ends after this cycle.
    Shutdown,
}

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// An engine in [`Phase::Passive`].
    ///
    /// # Errors
    /// A parameter that is not possible. Everything that the engine relies on is checked here.
    pub fn new(parameters: EngineParameters<AXES, BUSES>) -> Result<Self, SetUpError> {
        parameters.validate()?;
        let dispatch = dispatch_of(&parameters)?;
        let axes = axes_of(&parameters);
        let axis_count = parameters.axes.len() as u8;
        let buses = parameters.buses.len();
        let slowest_divider = parameters.buses.iter().map(|bus| bus.divider).max().unwrap_or(1);
        let heartbeat = parameters.heartbeat.map(|own| HeartbeatProducer::new(own, buses, slowest_divider));
        let bus_count = buses as u8;
        Ok(Self {
            period_ns: parameters.period_ns,
            period_s: parameters.period_ns as f64 / NANOSECONDS_PER_SECOND as f64,
            enable_timeout_cycles: parameters.enable_timeout_cycles,
            not_transmitted_cycles: parameters.not_transmitted_cycles,
            acknowledge_timeout_cycles: parameters.acknowledge_timeout_cycles,
            categories: parameters.categories,
            buses: parameters.buses,
            dispatch,
            axes,
            state: GroupState::Passive,
            state_cycles: 0,
            motion: GroupTrajectory::default(),
            stop: None,
            fault_reset_cycles: 0,
            commands: Commands::None,
            unsent: UnsentSteps::new(buses),
            deadline: Deadline::Met,
            requested: Requested::default(),
            now_ns: 0,
            slots: SlotWatch::new(parameters.timing),
            backlog: Backlog::new(buses),
            skip_sync: BusSet::default(),
            asked_by_sync: BusSet::default(),
            foreign_frame: None,
            heartbeat,
            time: parameters.time_cycles.map(TimeProducer::new),
            events: Outbox::default(),
            dropped: 0,
            record: CycleRecord { axis_count, ..CycleRecord::default() },
            snapshot: Snapshot { axis_count, bus_count, ..Snapshot::default() },
        })
    }

    /// How many buses there are.
    pub fn bus_count(&self) -> usize {
        self.buses.len()
    }

    /// The period of the cycle.
    pub fn period_ns(&self) -> Nanoseconds {
        self.period_ns
    }

    /// What the group is doing.
    pub fn phase(&self) -> Phase {
        self.state.phase()
    }

    /// The axes.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Whether the loop is to end after this cycle.
    pub fn is_shutting_down(&self) -> bool {
        self.requested.ending == Ending::Shutdown
    }

    /// What one cycle decides. [`Engine::encode`] makes frames of it.
    pub fn compute(&mut self, input: &CycleInput<'_>, host: &mut impl HostInterface<AXES, BUSES>) {
        self.sense(input);
        self.handle_requests(host);
        self.check_faults(input.buses);
        self.step();
        self.update_sdo_fallback();
        self.state_cycles = self.state_cycles.saturating_add(1);
    }

    fn emit(&mut self, kind: EventKind) {
        self.events.push(Event { slot: self.present_slot(), at_ns: self.now_ns, kind });
    }

    fn present_slot(&self) -> u64 {
        self.slots.present.unwrap_or(0)
    }

    /// Enters a state. One that goes on as it was, is not entered: what it may last counts from its first beginning.
    fn enter(&mut self, state: GroupState<AXES>) {
        let (from, to) = (self.state.phase(), state.phase());
        self.state = state;
        if from != to {
            self.emit(EventKind::PhaseChanged { from, to });
            self.state_cycles = 0;
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
        let is_late = self.deadline == Deadline::Missed;
        let is_commanded = self.commands == Commands::Made && !is_late;
        self.slots.end(is_late);
        if is_late {
            self.emit(EventKind::MissedSlots { count: 1 });
        }
        if is_commanded {
            self.fault_reset_cycles = self.fault_reset_cycles.saturating_sub(1);
        }
        self.dropped += self.events.drain(|event| host.event(event));
        self.record.timing = CycleTiming { missed_slots: self.slots.missed_now, ..timing };
        self.record.phase = self.state.phase();
        self.record.is_commanded = is_commanded;
        for (axis, record) in self.axes.iter().zip(&mut self.record.axes) {
            axis.record(self.period_s, record);
        }
        self.dropped += u64::from(!host.record(&self.record));
        self.show(timing.slot, now_ns, buses);
        host.publish(&self.snapshot);
    }

    fn show(&mut self, slot: u64, now_ns: Nanoseconds, buses: &[BusHealth]) {
        let snapshot = &mut self.snapshot;
        snapshot.slot = slot;
        snapshot.at_ns = now_ns;
        snapshot.phase = self.state.phase();
        snapshot.missed_slots = self.slots.missed;
        snapshot.timing = self.slots.level();
        snapshot.dropped = self.dropped;
        snapshot.remaining_s = match self.state {
            GroupState::Moving { .. } | GroupState::Stopping => self.motion.remaining_s(),
            _ => 0.0,
        };
        snapshot.stop = self.stop;
        for (axis, shown) in self.axes.iter().zip(&mut snapshot.axes) {
            axis.show(shown);
        }
        for (shown, health) in snapshot.buses.iter_mut().zip(buses) {
            *shown = *health;
        }
    }
}

/// Whether a bus has SYNC, feedback and set-points in this slot.
const fn has_cycle(bus: &BusParameters, slot: u64) -> bool {
    slot.is_multiple_of(bus.divider as u64)
}

/// As [`has_cycle`], for the bus of an axis.
fn has_cycle_of(buses: &[BusParameters], axis: &Axis, slot: u64) -> bool {
    buses.get(usize::from(axis.parameters().bus)).is_some_and(|bus| has_cycle(bus, slot))
}
