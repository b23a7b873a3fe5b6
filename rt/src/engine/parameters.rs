//! Everything about the group that does not change while it runs, and why it may be refused.

use arrayvec::ArrayVec;

use crate::axis::{Axis, AxisParameters};
use crate::dispatch::{Dispatch, IdTaken};
use crate::frame::Id;
use crate::record::{MAX_AXES, MAX_BUSES};
use crate::stop::StopCategories;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::watch::TimingLadder;

/// A bus as the engine knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusParameters {
    /// Identifier of SYNC.
    pub sync_id: Id,
    /// Slots in one cycle of this bus, at least 1: it has SYNC, feedback and set-points in every slot whose number this
    /// divides.
    pub divider: u32,
    /// The most service frames in a cycle while set-points are sent.
    pub service_frames_active: usize,
    /// The most service frames in a cycle before that.
    pub service_frames_passive: usize,
}

/// The heartbeat of this controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Its node number.
    pub node: u8,
    /// Cycles from one to the next.
    pub cycles: u32,
    /// Cycles without one after which the drives stop by themselves.
    pub timeout_cycles: u32,
}

/// Everything about the group that does not change while it runs.
#[derive(Clone, Debug)]
pub struct EngineParameters {
    /// The period of the cycle.
    pub period_ns: Nanoseconds,
    /// The axes.
    pub axes: ArrayVec<AxisParameters, MAX_AXES>,
    /// The buses.
    pub buses: ArrayVec<BusParameters, MAX_BUSES>,
    /// The heartbeat, if one is sent.
    pub heartbeat: Option<Heartbeat>,
    /// Cycles from one TIME message to the next, where the drives are told the time of day.
    pub time_cycles: Option<u32>,
    /// How each rule stops the group.
    pub categories: StopCategories,
    /// How many missed slots are too many.
    pub timing: TimingLadder,
    /// Cycles within which a drive must acknowledge a set-point of profile position.
    pub acknowledge_timeout_cycles: u32,
    /// Cycles within which every drive must reach operation enabled.
    pub enable_timeout_cycles: u32,
    /// Cycles in a row in which set-points may fail to get onto the wire.
    pub not_transmitted_cycles: u32,
}

/// Why an engine cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetUpError {
    /// The period is zero.
    NoPeriod,
    /// There is no axis.
    NoAxis,
    /// The cycle of a bus has no slot.
    NoDivider {
        /// The bus.
        bus: usize,
    },
    /// An axis names a bus that is not there.
    UnknownBus {
        /// The axis.
        axis: usize,
    },
    /// An axis has no PDO in one of the directions.
    NoPdo {
        /// The axis.
        axis: usize,
    },
    /// A limit of an axis is not a number that can be kept.
    ImpossibleLimits {
        /// The axis.
        axis: usize,
    },
    /// Two axes of a bus expect the same identifier.
    IdTaken {
        /// The axis that came second.
        axis: usize,
        /// The identifier.
        id: Id,
    },
}

/// The axes. The set-points of those on faster buses wait for those on the slowest: a joint is where the trajectory was two
/// cycles of its bus ago.
pub(super) fn axes_of(parameters: &EngineParameters) -> ArrayVec<Axis, MAX_AXES> {
    let mut axes: ArrayVec<Axis, MAX_AXES> = parameters.axes.iter().cloned().map(Axis::new).collect();
    let divider =
        |axis: &Axis| parameters.buses.get(usize::from(axis.parameters().bus)).map_or(1, |bus| bus.divider);
    // A drive in a profile mode gets no set-points that anybody would have to wait for.
    let slowest = axes.iter().filter(|axis| !axis.is_profile()).map(divider).max().unwrap_or(1);
    let period_s = parameters.period_ns as f64 / NANOSECONDS_PER_SECOND as f64;
    for axis in &mut axes {
        axis.delay_set_points(slowest.saturating_sub(divider(axis)).saturating_mul(2));
        axis.set_cycle(period_s * f64::from(divider(axis)));
    }
    axes
}

/// Who is meant by each identifier, on each bus.
pub(super) fn dispatch_of(parameters: &EngineParameters) -> Result<[Dispatch; MAX_BUSES], SetUpError> {
    let mut dispatch: [Dispatch; MAX_BUSES] = core::array::from_fn(|_| Dispatch::default());
    for (axis, own) in parameters.axes.iter().enumerate() {
        let is_bus_known = usize::from(own.bus) < parameters.buses.len();
        let table = dispatch.get_mut(usize::from(own.bus)).filter(|_| is_bus_known);
        enter(table.ok_or(SetUpError::UnknownBus { axis })?, axis, own)?;
    }
    for (bus, table) in parameters.buses.iter().zip(&mut dispatch) {
        table.foreign(NMT);
        table.foreign(bus.sync_id);
        if let Some(heartbeat) = parameters.heartbeat {
            table.foreign(Id::canopen(0x700, heartbeat.node));
        }
    }
    Ok(dispatch)
}

fn enter(table: &mut Dispatch, axis: usize, own: &AxisParameters) -> Result<(), SetUpError> {
    if own.commands.is_empty() || own.feedback.is_empty() {
        return Err(SetUpError::NoPdo { axis });
    }
    if !own.limits.are_possible() {
        return Err(SetUpError::ImpossibleLimits { axis });
    }
    let taken = |taken: IdTaken| SetUpError::IdTaken { axis, id: taken.id };
    table.emergency(Id::canopen(0x080, own.node), axis as u8).map_err(taken)?;
    for (number, pdo) in own.feedback.iter().enumerate() {
        table.feedback(pdo.id, axis as u8, number as u8).map_err(taken)?;
    }
    table.error_control(Id::canopen(0x700, own.node), axis as u8).map_err(taken)?;
    for command in &own.commands {
        table.foreign(command.pdo.id);
    }
    for id in &own.unused {
        table.unused(*id, axis as u8).map_err(taken)?;
    }
    Ok(())
}

const NMT: Id = Id::canopen(0x000, 0);
