//! Everything about the controller that does not change while it runs, and how it is checked.

use arrayvec::ArrayVec;

use super::send_batch::SEND_BATCH;
use crate::axis::{Axis, AxisParameters, AxisParametersError, Exchange, FeedbackSince, Supervision};
use crate::bit_fields::FieldDriveParameters;
use crate::bit_set::BitSet;
use crate::capacity::{MAX_AXES, MAX_BUSES, MAX_GROUPS};
use crate::dispatch::{Dispatch, IdTaken};
use crate::frame::{FrameFormat, Id};
use crate::function_code;
use crate::stop::StopCategories;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::watch::TimingLadder;

/// A bus as the engine knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct BusParameters {
    /// What makes it a CANopen network. On any other bus, nothing leaves but what its axes are commanded by, and the service frames of
    /// the host: no SYNC, NMT, heartbeat, TIME or SDO.
    pub canopen: Option<CanopenNetwork>,
    /// Slots in one cycle of this bus, 1 to 32: it has SYNC, feedback and set-points in every slot whose number this
    /// divides.
    pub divider: u32,
    /// The most service frames in a cycle while set-points are sent.
    pub service_frames_active: usize,
    /// The most service frames in a cycle before that.
    pub service_frames_passive: usize,
}

/// What a bus has where its nodes speak CANopen (CiA 301).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CanopenNetwork {
    /// Identifier of SYNC.
    pub sync_id: Id,
}

/// The heartbeat of this controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Heartbeat {
    /// Its node ID, 1 to 127.
    pub node: u8,
    /// Cycles from one to the next.
    pub cycles: u32,
}

/// A group of axes, which start, move, stop and fault together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GroupParameters<const AXES: usize = MAX_AXES> {
    /// Its axes, by their numbers.
    pub axes: ArrayVec<u8, AXES>,
    /// The groups that stop this one, too, when they stop, by their numbers.
    pub stops_with: ArrayVec<u8, MAX_GROUPS>,
}

/// Everything about the controller that does not change while it runs.
#[derive(Clone, Debug)]
pub struct EngineParameters<const AXES: usize = MAX_AXES, const BUSES: usize = MAX_BUSES> {
    /// The period of the cycle.
    pub period_ns: Nanoseconds,
    /// The axes.
    pub axes: ArrayVec<AxisParameters, AXES>,
    /// The groups, each axis in one of them. Without any, all axes are one group.
    pub groups: ArrayVec<GroupParameters<AXES>, MAX_GROUPS>,
    /// The buses.
    pub buses: ArrayVec<BusParameters, BUSES>,
    /// The heartbeat, if one is sent, on each CANopen bus.
    pub heartbeat: Option<Heartbeat>,
    /// Cycles from one TIME message to the next, where the drives on each CANopen bus are told the time of day.
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

/// Why an engine cannot be set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetUpError {
    /// The period is zero or longer than [`EngineParameters::LONGEST_PERIOD_NS`].
    Period {
        /// The period.
        period_ns: Nanoseconds,
    },
    /// There is no axis.
    NoAxis,
    /// A bus has a cycle of no slot, or of more than [`EngineParameters::LARGEST_DIVIDER`].
    Divider {
        /// The bus.
        bus: usize,
        /// The slots of its cycle.
        divider: u32,
    },
    /// An axis names a bus that is not there.
    UnknownBus {
        /// The axis.
        axis: usize,
    },
    /// An axis cannot be set up.
    Axis {
        /// The axis.
        axis: usize,
        /// The reason.
        error: AxisParametersError,
    },
    /// An axis waits for SYNC, or for a heartbeat of its node or its replies to node guarding, on a bus that is no CANopen network.
    NotCanopen {
        /// The axis.
        axis: usize,
    },
    /// The node ID of the controller is not 1 to 127.
    MasterNodeId {
        /// The node ID.
        node: u8,
    },
    /// Two nodes have one node ID: an axis and the controller, or two axes of a bus that have the same number in their node.
    DuplicateNodeId {
        /// The axis that came second, or that has the node ID of the controller.
        axis: usize,
        /// The node ID.
        node: u8,
    },
    /// A command frame for several axes is not alike for all of them, or they are not of one group on one bus.
    SharedCommand {
        /// One of them.
        axis: usize,
        /// The identifier.
        id: Id,
    },
    /// Axes of one node are to be supervised in different ways.
    NodeSupervision {
        /// One of them.
        axis: usize,
        /// The node ID.
        node: u8,
    },
    /// A group has no axis.
    EmptyGroup {
        /// The group.
        group: usize,
    },
    /// A group names an axis that is not there.
    UnknownGroupAxis {
        /// The group.
        group: usize,
        /// The number of the axis.
        axis: usize,
    },
    /// An axis is in no group, or in more than one.
    GroupsOfAxis {
        /// The axis.
        axis: usize,
        /// How many groups it is in.
        groups: usize,
    },
    /// A group is to stop with one that is not there, or with itself.
    StopsWith {
        /// The group.
        group: usize,
        /// The number of the group that it is to stop with.
        with: usize,
    },
    /// A number of cycles is zero where at least one must pass.
    NoCycles {
        /// Which number.
        of: CycleCount,
    },
    /// Two axes of a bus expect the same identifier.
    IdTaken {
        /// The axis that came second.
        axis: usize,
        /// The identifier.
        id: Id,
    },
    /// The frames of one cycle of a bus do not fit into one batch.
    TooManyFrames {
        /// The bus.
        bus: usize,
        /// How many frames it needs.
        frames: usize,
        /// How many fit.
        limit: usize,
    },
}

/// A number of cycles in [`EngineParameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CycleCount {
    /// From one heartbeat to the next.
    Heartbeat,
    /// Until a drive stops by itself for want of a sign of life.
    SelfStop,
    /// From one request of node guarding to the next.
    Guard,
    /// From one TIME message to the next.
    Time,
    /// Until every drive must be enabled.
    EnableTimeout,
    /// For which frames may fail to get onto the wire.
    NotTransmitted,
    /// Until a drive must acknowledge its target.
    AcknowledgeTimeout,
    /// For which feedback may be missed.
    MissedFeedback,
}

impl core::fmt::Display for SetUpError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Period { period_ns } => {
                write!(f, "a period of {period_ns} ns is not possible (1 ns to 1 s)")
            }
            Self::NoAxis => write!(f, "there is no axis"),
            Self::Divider { bus, divider } => {
                write!(f, "bus {bus}: a cycle of {divider} slots is not possible (1 to 32)")
            }
            Self::UnknownBus { axis } => write!(f, "axis {axis} names a bus that does not exist"),
            Self::Axis { axis, error } => write!(f, "axis {axis}: {error}"),
            Self::NotCanopen { axis } => {
                write!(f, "axis {axis} needs SYNC or heartbeats, and its bus is no CANopen network")
            }
            Self::MasterNodeId { node } => {
                write!(f, "{node} is not a node ID for the controller: 1 to 127 are")
            }
            Self::DuplicateNodeId { axis, node } => {
                write!(f, "axis {axis}: another node has its node ID, {node}")
            }
            Self::SharedCommand { axis, id } => {
                write!(
                    f,
                    "axis {axis}: the command {id:?} cannot be shared with the other axes that it is for"
                )
            }
            Self::NodeSupervision { axis, node } => {
                write!(f, "axis {axis}: another axis of node {node} is supervised in another way")
            }
            Self::EmptyGroup { group } => write!(f, "group {group} has no axis"),
            Self::UnknownGroupAxis { group, axis } => {
                write!(f, "group {group} names axis {axis}, which does not exist")
            }
            Self::GroupsOfAxis { axis, groups } => {
                write!(f, "axis {axis} is in {groups} groups: it must be in one")
            }
            Self::StopsWith { group, with } => write!(f, "group {group} cannot stop with group {with}"),
            Self::NoCycles { of } => write!(f, "at least one cycle must pass ({of:?})"),
            Self::IdTaken { axis, id } => write!(f, "axis {axis}: identifier {id:?} is in use already"),
            Self::TooManyFrames { bus, frames, limit } => {
                write!(f, "bus {bus} needs {frames} frames in a cycle; {limit} fit")
            }
        }
    }
}

impl core::error::Error for SetUpError {}

/// Frames of a cycle beside set-points: the heartbeat, TIME, a request of node guarding, and one service frame.
pub(super) const OTHER_FRAMES: usize = 4;

impl<const AXES: usize, const BUSES: usize> EngineParameters<AXES, BUSES> {
    /// The longest period of the cycle.
    pub const LONGEST_PERIOD_NS: Nanoseconds = NANOSECONDS_PER_SECOND;
    /// The most slots in a cycle of a bus: set-points of other buses wait for twice as long, in a ring of 64.
    pub const LARGEST_DIVIDER: u32 = 32;

    /// Checks everything that the engine relies on.
    pub(super) fn validate(&self) -> Result<(), SetUpError> {
        if !(1..=Self::LONGEST_PERIOD_NS).contains(&self.period_ns) {
            return Err(SetUpError::Period { period_ns: self.period_ns });
        }
        if self.axes.is_empty() {
            return Err(SetUpError::NoAxis);
        }
        self.validate_groups()?;
        self.validate_cycles()?;
        for (axis, own) in self.axes.iter().enumerate() {
            self.validate_axis(axis, own)?;
        }
        if let Some(node) = self.heartbeat.map(|heartbeat| heartbeat.node) {
            if !(1..=127).contains(&node) {
                return Err(SetUpError::MasterNodeId { node });
            }
            let is_taken = |axis: &AxisParameters| axis.node == node && self.is_canopen(axis.bus);
            if let Some(axis) = self.axes.iter().position(is_taken) {
                return Err(SetUpError::DuplicateNodeId { axis, node });
            }
        }
        for (bus, own) in self.buses.iter().enumerate() {
            if !(1..=Self::LARGEST_DIVIDER).contains(&own.divider) {
                return Err(SetUpError::Divider { bus, divider: own.divider });
            }
            let of_bus = self.axes.iter().filter(|axis| usize::from(axis.bus) == bus);
            let frames = OTHER_FRAMES + of_bus.map(|axis| axis.exchange.frames()).sum::<usize>();
            if frames > SEND_BATCH {
                return Err(SetUpError::TooManyFrames { bus, frames, limit: SEND_BATCH });
            }
        }
        Ok(())
    }

    fn validate_groups(&self) -> Result<(), SetUpError> {
        for (group, own) in self.groups.iter().enumerate() {
            if own.axes.is_empty() {
                return Err(SetUpError::EmptyGroup { group });
            }
            let unknown =
                own.axes.iter().map(|axis| usize::from(*axis)).find(|axis| *axis >= self.axes.len());
            if let Some(axis) = unknown {
                return Err(SetUpError::UnknownGroupAxis { group, axis });
            }
            let mut with = own.stops_with.iter().map(|with| usize::from(*with));
            if let Some(with) = with.find(|with| *with >= self.groups.len() || *with == group) {
                return Err(SetUpError::StopsWith { group, with });
            }
        }
        for axis in 0..self.axes.len() {
            let all = self.groups.iter().flat_map(|group| &group.axes);
            let groups = all.filter(|number| usize::from(**number) == axis).count();
            if groups != 1 && !self.groups.is_empty() {
                return Err(SetUpError::GroupsOfAxis { axis, groups });
            }
        }
        Ok(())
    }

    /// The numbers of the axes of each group; without groups, of all axes.
    pub(super) fn axes_of_groups(&self) -> impl Iterator<Item = ArrayVec<u8, AXES>> {
        let all = self.groups.is_empty().then(|| (0..self.axes.len() as u8).collect());
        self.groups.iter().map(|group| group.axes.clone()).chain(all)
    }

    /// The groups that stop a group, too, when they stop, directly or by way of others.
    pub(super) fn stops_with(&self, group: u8) -> ArrayVec<u8, MAX_GROUPS> {
        let direct = |group: u8| self.groups.get(usize::from(group)).map(|own| own.stops_with.as_slice());
        let mut all: ArrayVec<u8, MAX_GROUPS> = ArrayVec::new();
        let mut next = Some(group);
        let mut followed = 0;
        while let Some(of) = next {
            for with in direct(of).unwrap_or_default() {
                if *with != group && !all.contains(with) {
                    let _ = all.try_push(*with);
                }
            }
            next = all.get(followed).copied();
            followed += 1;
        }
        all
    }

    fn is_canopen(&self, bus: u8) -> bool {
        self.buses.get(usize::from(bus)).is_some_and(|bus| bus.canopen.is_some())
    }

    fn bus_of(&self, axis: u8) -> Option<usize> {
        self.axes.get(usize::from(axis)).map(|axis| usize::from(axis.bus))
    }

    /// The buses that concern a group: those with an axis of it, and those without any axis.
    pub(super) fn buses_of(&self, axes: &[u8]) -> BitSet {
        let has_others = |bus: usize| self.axes.iter().any(|axis| usize::from(axis.bus) == bus);
        let mut buses = BitSet::default();
        for bus in 0..self.buses.len() {
            if axes.iter().any(|axis| self.bus_of(*axis) == Some(bus)) || !has_others(bus) {
                buses.insert(bus);
            }
        }
        buses
    }

    /// The buses on which a group sends set-points in the cycle: those with an axis of it that is spoken to there.
    pub(super) fn set_point_buses_of(&self, axes: &[u8]) -> BitSet {
        let mut buses = BitSet::default();
        let own = axes.iter().filter_map(|axis| self.axes.get(usize::from(*axis)));
        for axis in own.filter(|axis| !matches!(axis.exchange, Exchange::OffCycle { .. })) {
            buses.insert(axis.bus.into());
        }
        buses
    }

    fn validate_cycles(&self) -> Result<(), SetUpError> {
        let counts = [
            (CycleCount::Heartbeat, self.heartbeat.map_or(1, |heartbeat| heartbeat.cycles)),
            (
                CycleCount::SelfStop,
                self.axes.iter().filter_map(|axis| axis.stops_by_itself_cycles).min().unwrap_or(1),
            ),
            (
                CycleCount::Guard,
                self.axes.iter().filter_map(|axis| axis.supervision.guard_cycles()).min().unwrap_or(1),
            ),
            (CycleCount::Time, self.time_cycles.unwrap_or(1)),
            (CycleCount::EnableTimeout, self.enable_timeout_cycles),
            (CycleCount::NotTransmitted, self.not_transmitted_cycles),
            (CycleCount::AcknowledgeTimeout, self.acknowledge_timeout_cycles),
            (
                CycleCount::MissedFeedback,
                self.axes.iter().map(|axis| axis.missed_feedback_cycles.into()).min().unwrap_or(1),
            ),
        ];
        match counts.into_iter().find(|(_, cycles)| *cycles == 0) {
            Some((of, _)) => Err(SetUpError::NoCycles { of }),
            None => Ok(()),
        }
    }

    fn validate_axis(&self, axis: usize, own: &AxisParameters) -> Result<(), SetUpError> {
        if usize::from(own.bus) >= self.buses.len() {
            return Err(SetUpError::UnknownBus { axis });
        }
        own.validate().map_err(|error| SetUpError::Axis { axis, error })?;
        let is_asked_by_sync = own.feedback_since == FeedbackSince::Sync;
        if (is_asked_by_sync || own.supervision != Supervision::Feedback) && !self.is_canopen(own.bus) {
            return Err(SetUpError::NotCanopen { axis });
        }
        let mut before = self.axes.iter().take(axis);
        let place = |axis: &AxisParameters| (axis.bus, axis.node, axis.node_axis);
        if before.any(|other| place(other) == place(own)) {
            return Err(SetUpError::DuplicateNodeId { axis, node: own.node });
        }
        self.validate_shared_commands(axis, own)?;
        let mut of_node = self.axes.iter().filter(|other| (other.bus, other.node) == (own.bus, own.node));
        if of_node.any(|other| other.supervision != own.supervision) {
            return Err(SetUpError::NodeSupervision { axis, node: own.node });
        }
        Ok(())
    }
}

/// The axes, those of a group beside each other. The set-points of those on faster buses wait for those of their group on its
/// slowest: a joint is where the trajectory was two cycles of its bus ago.
pub(super) fn axes_of<const AXES: usize, const BUSES: usize>(
    parameters: &EngineParameters<AXES, BUSES>,
) -> ArrayVec<Axis, AXES> {
    let mut axes: ArrayVec<Axis, AXES> = ArrayVec::new();
    let divider =
        |axis: &Axis| parameters.buses.get(usize::from(axis.parameters().bus)).map_or(1, |bus| bus.divider);
    let period_s = parameters.period_ns as f64 / NANOSECONDS_PER_SECOND as f64;
    for numbers in parameters.axes_of_groups() {
        let first = axes.len();
        // In place, without an array of axes beside this one on the stack.
        for number in numbers {
            if let Some(own) = parameters.axes.get(usize::from(number)) {
                axes.push(Axis::new(number, own.clone()));
            }
        }
        let group = axes.get_mut(first..).unwrap_or_default();
        // A drive in a profile mode gets no set-points, so that no other axis waits for it.
        let slowest = group.iter().filter(|axis| !axis.is_profile()).map(divider).max().unwrap_or(1);
        for axis in group {
            axis.delay_set_points(slowest.saturating_sub(divider(axis)).saturating_mul(2));
            axis.set_cycle(period_s * f64::from(divider(axis)));
        }
    }
    axes
}

/// The owner of each identifier, on each bus: the place of an axis among those of the engine.
pub(super) fn dispatch_of<const AXES: usize, const BUSES: usize>(
    parameters: &EngineParameters<AXES, BUSES>,
) -> Result<[Dispatch; BUSES], SetUpError> {
    let mut dispatch: [Dispatch; BUSES] = core::array::from_fn(|_| Dispatch::default());
    let mut nodes: ArrayVec<(u8, u8), AXES> = ArrayVec::new();
    for (place, number) in (0..).zip(parameters.axes_of_groups().flatten()) {
        let axis = usize::from(number);
        let own = parameters.axes.get(axis).ok_or(SetUpError::NoAxis)?;
        let table = dispatch.get_mut(usize::from(own.bus));
        let taken = |taken: IdTaken| SetUpError::IdTaken { axis, id: taken.id };
        let table = table.ok_or(SetUpError::UnknownBus { axis })?;
        enter_process_data(table, place, own).map_err(taken)?;
        if parameters.is_canopen(own.bus) && !nodes.contains(&(own.bus, own.node)) {
            // What a node sends beside process data reaches each of its axes, by the entry of the first of them.
            nodes.push((own.bus, own.node));
            enter_services(table, place, own).map_err(taken)?;
        }
    }
    for ((number, bus), table) in (0..).zip(&parameters.buses).zip(&mut dispatch) {
        let Some(CanopenNetwork { sync_id }) = bus.canopen else { continue };
        for (_, node) in nodes.iter().filter(|(of, _)| *of == number) {
            table.foreign(Id::canopen(function_code::SDO_REQUEST, *node), FrameFormat::Classic);
        }
        table.foreign(NMT, FrameFormat::Classic);
        table.foreign(sync_id, FrameFormat::Classic);
        if let Some(heartbeat) = parameters.heartbeat {
            table.foreign(Id::canopen(function_code::ERROR_CONTROL, heartbeat.node), FrameFormat::Classic);
        }
    }
    Ok(dispatch)
}

/// What a CANopen node sends beside process data.
fn enter_services(table: &mut Dispatch, place: u8, own: &AxisParameters) -> Result<(), IdTaken> {
    table.emergency(Id::canopen(function_code::EMERGENCY, own.node), place)?;
    table.error_control(Id::canopen(function_code::ERROR_CONTROL, own.node), place)
}

fn enter_process_data(table: &mut Dispatch, place: u8, own: &AxisParameters) -> Result<(), IdTaken> {
    match &own.exchange {
        Exchange::Pdos(pdos) => {
            for (number, pdo) in (0..).zip(&pdos.feedback) {
                table.feedback(pdo.id, pdo.format, pdo.sender, (place, number))?;
            }
            for command in &pdos.commands {
                table.foreign(command.pdo.id, command.pdo.format);
            }
            pdos.unused.iter().try_for_each(|id| table.unused(*id, place))
        }
        Exchange::BitFields(FieldDriveParameters { command, reply, .. }) => {
            table.feedback(reply.id(), reply.format(), reply.sender(), (place, 0))?;
            // Some drives reply by the identifier of their commands: it stays that of feedback then.
            table.foreign(command.id(), command.format());
            Ok(())
        }
        Exchange::OffCycle { .. } => Ok(()),
    }
}

const NMT: Id = Id::canopen(function_code::NMT, 0);
