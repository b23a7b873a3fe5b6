//! Makes the engine and the slot plan from a configuration.

use std::fmt;
use std::panic::resume_unwind;
use std::thread::{self, ScopedJoinHandle};

use arrayvec::ArrayVec;
use takt_rt::{
    AxisLimits, AxisParameters, BusParameters, CanopenNetwork, CommandPdo, Engine, EngineParameters,
    Exchange, FeedbackSince, Follow, GroupParameters, Heartbeat, Id, LookAheadParameters, MAX_AXES,
    MAX_GROUPS, MappedObject, Mapping, MappingError, ModeChanges, NANOSECONDS_PER_SECOND, Pdo, Pdos,
    ScaleError, SetUpError, SlotPlan, Supervision, TimingLadder, TorqueLimits,
};
use takt_wire::bit_fields::{FieldDevice, ReplyMoment};

use crate::channels::{ChannelSizes, GroupAxes, GroupStream};
use crate::config::{self, Axis, Compliance, Config, ConfigError, Interface};
use crate::family;
use crate::family::bring_up::{PdoPlan, ProcessData, Reply};
use crate::journal::RerunParts;
use crate::schedule;

/// How long the drives may take from the first controlword to operation enabled, where they have been on for long enough.
const ENABLE_TIMEOUT_NS: u64 = 5_000_000_000;
/// How long a drive may take to acknowledge a target in profile position.
const ACKNOWLEDGE_TIMEOUT_NS: u64 = 500_000_000;
/// How long a drive may take to show another mode of operation. No manual says; a real one is faster by far.
const MODE_TIMEOUT_NS: u64 = 500_000_000;
/// If set-points are not transmitted for longer than this, the group stops.
const NOT_TRANSMITTED_NS: u64 = 4_000_000;
/// The most service frames on a bus in one cycle before set-points are sent.
const SERVICE_FRAMES_PASSIVE: usize = 6;

/// Why the real-time thread cannot execute a configuration.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum AssembleError {
    /// A value that cannot be: see [`Config::validate`].
    #[error(transparent)]
    Configuration(#[from] ConfigError),
    /// An impossible mapping.
    #[error("axis {axis}: its process data cannot be mapped ({error:?})")]
    Mapping {
        /// The axis.
        axis: usize,
        /// Why.
        error: MappingError,
    },
    /// An impossible scale.
    #[error("axis {axis}: its units cannot be converted ({error:?})")]
    Scale {
        /// The axis.
        axis: usize,
        /// Why.
        error: ScaleError,
    },
    /// The engine rejects its parameters.
    #[error("the cycle cannot be set up ({0:?})")]
    Engine(SetUpError),
}

impl fmt::Debug for AssembleError {
    /// For `main`: the sentence, or the problems of a configuration.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Configuration(error) => fmt::Debug::fmt(error, formatter),
            other => fmt::Display::fmt(other, formatter),
        }
    }
}

/// The plan of a slot.
pub fn slot_plan(config: &Config) -> SlotPlan {
    let usual = SlotPlan::usual(config.cycle.period_ns, config.cycle.command_phase_ns);
    SlotPlan { send_phase_ns: schedule::send_phase_ns(config), ..usual }
}

/// What the engine of a configuration is run again with, from the journal of its run.
///
/// # Errors
/// See [`AssembleError`].
pub fn rerun_parts(config: &Config) -> Result<RerunParts, AssembleError> {
    Ok(RerunParts { engine: engine(config)?, plan: slot_plan(config), sizes: ChannelSizes::of(config) })
}

/// The engine of a configuration. It is a few hundred kilobytes, so it is on the heap, and not on the stack of each caller.
///
/// # Errors
/// See [`AssembleError`]. A configuration that has passed its checks gives no error.
pub fn engine(config: &Config) -> Result<Box<Engine>, AssembleError> {
    config.validate()?;
    on_a_large_stack(|| assembled_here(config))
}

/// Does work that passes engines on by value, in a thread with room for it.
pub fn on_a_large_stack<T: Send>(mut work: impl FnMut() -> T + Send) -> T {
    let done = thread::scope(|scope| {
        let thread = thread::Builder::new().stack_size(LARGE_STACK_BYTES);
        thread.spawn_scoped(scope, &mut work).ok().map(ScopedJoinHandle::join)
    });
    match done {
        Some(Ok(done)) => done,
        Some(Err(panic)) => resume_unwind(panic),
        // Without a thread of its own, the stack of the caller has to do.
        None => work(),
    }
}

/// An engine and its parameters are passed on by value while they are made, which takes more than a megabyte of the stack in a debug
/// build. The caller's thread may have two in all.
const LARGE_STACK_BYTES: usize = 8 << 20;

/// The engine of a configuration that has passed its checks, made on the stack of the caller.
fn assembled_here(config: &Config) -> Result<Box<Engine>, AssembleError> {
    let period_ns = config.cycle.period_ns;
    let cycles = |ns: u64| u32::try_from(ns.div_ceil(period_ns.max(1))).unwrap_or(u32::MAX);
    let axes = config
        .axes
        .iter()
        .enumerate()
        .map(|(index, axis)| axis_parameters(index, axis, config, &cycles))
        .collect::<Result<_, _>>()?;
    let buses = config.buses.iter().enumerate().map(|(index, bus)| BusParameters {
        canopen: is_canopen(config, index).then_some(CanopenNetwork { sync_id: Id::canopen(0x080, 0) }),
        divider: bus.divider,
        service_frames_active: bus.service_frames_per_cycle,
        service_frames_passive: SERVICE_FRAMES_PASSIVE.max(bus.service_frames_per_cycle),
    });
    let tolerates_missed_slots = !config.simulation.stops_for_missed_slots
        && config.buses.iter().all(|bus| bus.interface == Interface::Simulated);
    let heartbeat = config
        .master
        .heartbeat_ns
        .map(|ns| Heartbeat { node: config.master.node, cycles: cycles(ns).max(1) });
    boxed(EngineParameters {
        period_ns,
        axes,
        groups: groups(config),
        buses: buses.collect(),
        heartbeat,
        time_cycles: config.master.time_ns.map(&cycles),
        enable_timeout_cycles: cycles(ENABLE_TIMEOUT_NS + enabled_from_ns(config)),
        not_transmitted_cycles: cycles(NOT_TRANSMITTED_NS),
        categories: config.stops,
        timing: TimingLadder {
            warning: config.missed_slots.warning,
            degraded: config.missed_slots.degraded,
            unfit: if tolerates_missed_slots { u32::MAX } else { config.missed_slots.stop },
            leak_slots: config.missed_slots.leak_slots,
        },
        acknowledge_timeout_cycles: cycles(ACKNOWLEDGE_TIMEOUT_NS),
    })
}

/// So long after power-on every drive can be enabled: some have just been switched on.
pub(super) fn enabled_from_ns(config: &Config) -> u64 {
    config.axes.iter().map(|axis| axis.drive.enabled_from_ns).max().unwrap_or(0)
}

/// Moves the engine to the heap. Each step that passes it on by value would take its size of the stack once more, so there is only one.
#[inline(never)]
fn boxed(parameters: EngineParameters) -> Result<Box<Engine>, AssembleError> {
    match Engine::new(parameters) {
        Ok(engine) => Ok(Box::new(engine)),
        Err(error) => Err(AssembleError::Engine(error)),
    }
}

/// The groups with their numbers in place of the names. A checked configuration has no number that does not fit.
fn groups(config: &Config) -> ArrayVec<GroupParameters, MAX_GROUPS> {
    let number = |index: &usize| u8::try_from(*index).unwrap_or(u8::MAX);
    let groups = config.groups.iter().take(MAX_GROUPS).map(|group| GroupParameters {
        axes: group.axes.iter().take(MAX_AXES).map(number).collect(),
        stops_with: group.stops_with.iter().take(MAX_GROUPS).map(number).collect(),
    });
    groups.collect()
}

/// Returns `true` if a bus has CANopen nodes: it has unless none of its drives has PDOs.
pub(super) fn is_canopen(config: &Config, bus: usize) -> bool {
    let mut axes = config.axes.iter().filter(|axis| axis.bus == bus).peekable();
    axes.peek().is_none() || axes.any(|axis| family::has_pdos(axis, config))
}

fn axis_parameters(
    index: usize,
    axis: &Axis,
    config: &Config,
    cycles: &impl Fn(u64) -> u32,
) -> Result<AxisParameters, AssembleError> {
    let data = ProcessData::of(axis, config);
    let wrong_mapping = |error| AssembleError::Mapping { axis: index, error };
    let command = |plan: &PdoPlan| -> Result<CommandPdo, MappingError> {
        let pdo = Pdo::classic(plan.id, Mapping::commands(&of_first_axis(plan, axis))?);
        Ok(CommandPdo { pdo, transmission: plan.transmission, axes: plan.axes })
    };
    let feedback = |plan: &PdoPlan| Ok(Pdo::classic(plan.id, Mapping::feedback(&of_first_axis(plan, axis))?));
    let exchange = match family::of(&axis.drive).field_drive(axis) {
        Some(fields) => Exchange::BitFields(fields),
        None if family::is_off_cycle(axis, config) => Exchange::OffCycle {
            report_cycles: family::report_cycles(axis, config),
            stop_frame: family::of(&axis.drive).off_cycle_stop_frame(axis),
        },
        None => Exchange::Pdos(Pdos {
            commands: data.commands.iter().map(command).collect::<Result<_, _>>().map_err(wrong_mapping)?,
            feedback: data.feedback.iter().map(feedback).collect::<Result<_, _>>().map_err(wrong_mapping)?,
            unused: data.unused.iter().map(|plan| plan.id).collect(),
        }),
    };
    let feedback_since = match exchange {
        Exchange::Pdos(_) => feedback_since(&data.feedback),
        Exchange::BitFields(_) if reports_by_itself(axis) => FeedbackSince::CommandPhase,
        Exchange::BitFields(_) => FeedbackSince::SetPoint,
        Exchange::OffCycle { .. } => FeedbackSince::CommandPhase,
    };
    Ok(AxisParameters {
        bus: u8::try_from(axis.bus).unwrap_or(u8::MAX),
        node: axis.node,
        node_axis: axis.drive.node_axis,
        exchange,
        feedback_since,
        codec: axis.drive.codec,
        controlword_spacing_cycles: u32::try_from(
            axis.drive.controlword_spacing_ns.div_ceil(config.bus_cycle(axis.bus).period_ns.max(1)),
        )
        .unwrap_or(u32::MAX),
        law: axis.control,
        mode_changes: ModeChanges {
            laws: axis.other_modes.iter().take(ModeChanges::MOST).copied().collect(),
            condition: axis.drive.mode_changes.condition().unwrap_or_default(),
            timeout_cycles: cycles(MODE_TIMEOUT_NS),
        },
        scale: axis.scale().map_err(|error| AssembleError::Scale { axis: index, error })?,
        counter: axis.drive.counter,
        limits: axis.limits,
        torque_limits: torque_limits(axis),
        feed_forward: axis.feed_forward,
        start_tolerance: axis.start_tolerance,
        follow: axis.follow,
        supervision: supervision(axis, config, cycles),
        stops_by_itself_cycles: family::stops_by_itself_after(axis, config)
            .ok()
            .and_then(|watchdog| watchdog.timeout_ns)
            .map(cycles),
        following_error_limit: axis.following_error.limit,
        following_error_cycles: cycles(axis.following_error.time_ns),
        missed_feedback_cycles: axis.missed_feedback_cycles,
    })
}

/// The objects of a PDO by the numbers that those of the first axis of a node have.
fn of_first_axis(plan: &PdoPlan, axis: &Axis) -> Vec<MappedObject> {
    plan.objects.iter().map(|object| object.as_of_first_axis(axis.drive.node_axis)).collect()
}

fn supervision(axis: &Axis, config: &Config, cycles: &impl Fn(u64) -> u32) -> Supervision {
    let supervision = axis.supervision(&config.master);
    // A heartbeat or a reply that is a little late is not lost.
    let timeout_cycles = supervision.timeout_ns().map_or(0, cycles);
    match supervision {
        config::Supervision::Feedback => Supervision::Feedback,
        config::Supervision::Heartbeat { .. } => Supervision::Heartbeat { timeout_cycles },
        // Rounded down: the drive waits for no longer than the guard time.
        config::Supervision::Guarding { guard_time_ns, .. } => Supervision::Guarding {
            guard_cycles: u32::try_from(guard_time_ns / config.cycle.period_ns.max(1))
                .unwrap_or(u32::MAX)
                .max(1),
            life_cycles: timeout_cycles,
        },
    }
}

fn torque_limits(axis: &Axis) -> TorqueLimits {
    let Compliance { stiffness_max, damping_max, torque_rise_ns } = axis.compliance;
    TorqueLimits {
        stiffness: stiffness_max,
        damping: damping_max,
        rate: axis.limits.torque * NANOSECONDS_PER_SECOND as f64 / torque_rise_ns.max(1) as f64,
    }
}

/// Transmission types up to this one answer SYNC (CiA 301, 7.5.2.36).
const LAST_SYNCHRONOUS: u8 = 240;

/// Since when the feedback of a drive is expected.
fn feedback_since(feedback: &[PdoPlan]) -> FeedbackSince {
    if feedback.iter().all(|pdo| pdo.reply == Reply::ToCommandsOnly) {
        FeedbackSince::SetPoint
    } else if feedback.iter().all(|pdo| pdo.transmission_type <= LAST_SYNCHRONOUS) {
        FeedbackSince::Sync
    } else {
        FeedbackSince::CommandPhase
    }
}

/// Returns `true` if a drive of bit fields reports without being asked.
fn reports_by_itself(axis: &Axis) -> bool {
    let device: Option<&FieldDevice> = axis.drive.description();
    device.is_some_and(|device| matches!(device.description.reply_moment, ReplyMoment::Cyclic { .. }))
}

/// The stream of each group of a configuration.
pub fn streams(config: &Config) -> Vec<GroupStream> {
    let stream = |group: usize| {
        let axes = config.axes_of_group(group);
        let look_ahead = look_ahead(config, &axes);
        GroupStream { axes: GroupAxes::new(axes), look_ahead }
    };
    (0..config.groups.len().max(1)).map(stream).collect()
}

/// How a stream for these axes is looked ahead. What is to be followed exactly is not limited before it is checked.
pub fn look_ahead(config: &Config, axes: &[usize]) -> LookAheadParameters {
    let limits = axes.iter().filter_map(|axis| config.axes.get(*axis)).map(|axis| match axis.follow {
        Follow::Smooth => axis.limits,
        Follow::Exact => AxisLimits::NONE,
    });
    LookAheadParameters {
        limits: limits.take(MAX_AXES).collect(),
        period_ns: config.cycle.period_ns,
        delay: config.stream_delay,
    }
}

impl ChannelSizes {
    /// Sizes for a configuration. The record ring is configured. The others hold a burst of SDO traffic of every node, and
    /// the events of a second in which the logger is late.
    pub fn of(config: &Config) -> Self {
        Self {
            groups: streams(config),
            axes: config.axes.len(),
            buses: config.buses.len(),
            records: config.telemetry.ring_records,
            events: 1024,
            requests: 16,
            service_out: 256,
            service_in: 1024,
        }
    }
}
