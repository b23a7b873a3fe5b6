//! Process data as the drives report it, in place of what was expected.

use arrayvec::ArrayVec;

use super::parameters::OTHER_FRAMES;
use super::targets::Rejection;
use super::{Engine, SEND_BATCH};
use crate::axis::{CommandPdo, Pdo, Pdos};
use crate::dispatch::IdTaken;
use crate::frame::Id;
use crate::pdo::{MAX_OBJECTS, MAX_PDOS, MappedObject, Mapping, MappingError};
use crate::phase::Phase;
use crate::rejection::RejectReason;
use crate::request::{AxisProcessData, MappedPdo};

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// Changes what is exchanged with an axis' drive. Not where something moves already, the axis is not there, it has no PDO
    /// in one direction, an object has no use or value, or an identifier has another one. Then nothing is changed.
    pub(super) fn set_process_data(&mut self, data: &AxisProcessData) -> Result<(), Rejection> {
        self.require_phase_of(data.axis, &[Phase::Passive])?;
        let place = self.place_of(data.axis)?;
        let parameters = self.axis_mut(data.axis)?.parameters();
        let (bus, node_axis) = (usize::from(parameters.bus), parameters.node_axis);
        self.exchange(data, place, bus, node_axis).map_err(|reason| reason.of_axis(data.axis))
    }

    fn exchange(
        &mut self,
        data: &AxisProcessData,
        place: usize,
        bus: usize,
        node_axis: u8,
    ) -> Result<(), RejectReason> {
        let commands = data.commands.iter().flatten().map(|pdo| command(pdo, node_axis));
        let commands: ArrayVec<CommandPdo, MAX_PDOS> =
            commands.collect::<Result<_, _>>().map_err(unmapped)?;
        let feedback = data.feedback.iter().flatten().map(|pdo| feedback(pdo, node_axis));
        let feedback: ArrayVec<Pdo, MAX_PDOS> = feedback.collect::<Result<_, _>>().map_err(unmapped)?;
        let frames = self.frames_beside(place, bus) + commands.len();
        if frames > SEND_BATCH {
            return Err(RejectReason::TooManyFrames { frames: frames as u16, limit: SEND_BATCH as u16 });
        }
        // An engine has a table for every bus of an axis, and a place for every axis in it.
        let (Some(table), Some(axis)) = (self.dispatch.get_mut(bus), self.axes.get_mut(place)) else {
            return Err(RejectReason::NoProcessData);
        };
        // The part of the others would be missing in a frame that they share.
        if let Some(shared) = axis.parameters().exchange.commands().iter().find(|command| command.axes > 1) {
            return Err(RejectReason::IdTaken { id: shared.pdo.id });
        }
        if commands.is_empty() || feedback.is_empty() || !axis.has_pdos() {
            return Err(RejectReason::NoProcessData);
        }
        let (mut changed, entry) = (table.clone(), place as u8);
        changed.forget_process_data(entry);
        for (number, pdo) in (0..).zip(&feedback) {
            changed.feedback(pdo.id, pdo.format, pdo.sender, (entry, number)).map_err(taken)?;
        }
        let unused: ArrayVec<Id, MAX_PDOS> = data.unused.iter().flatten().copied().collect();
        for id in &unused {
            changed.unused(*id, entry).map_err(taken)?;
        }
        for command in &commands {
            changed.foreign(command.pdo.id, command.pdo.format);
        }
        *table = changed;
        axis.set_process_data(Pdos { commands, feedback, unused });
        Ok(())
    }

    /// The most frames of a bus in one cycle, without the set-points of one axis.
    fn frames_beside(&self, place: usize, bus: usize) -> usize {
        let others = self
            .axes
            .iter()
            .enumerate()
            .filter(|(other, axis)| *other != place && usize::from(axis.parameters().bus) == bus);
        OTHER_FRAMES + others.map(|(_, axis)| axis.parameters().exchange.frames()).sum::<usize>()
    }
}

fn unmapped(error: MappingError) -> RejectReason {
    match error {
        MappingError::TooManyObjects { .. } => RejectReason::TooManyObjects,
        MappingError::TooLong { object, .. }
        | MappingError::Width { object }
        | MappingError::NothingToSend { object } => RejectReason::Mapping { object },
    }
}

fn taken(IdTaken { id }: IdTaken) -> RejectReason {
    RejectReason::IdTaken { id }
}

/// The objects of an axis by the numbers that those of the first axis of a node have.
fn objects(pdo: &MappedPdo, node_axis: u8) -> ArrayVec<MappedObject, MAX_OBJECTS> {
    pdo.objects.iter().flatten().map(|object| object.as_of_first_axis(node_axis)).collect()
}

fn command(pdo: &MappedPdo, node_axis: u8) -> Result<CommandPdo, MappingError> {
    let mapping = Mapping::commands(&objects(pdo, node_axis))?;
    Ok(CommandPdo { pdo: Pdo::classic(pdo.id, mapping), transmission: pdo.transmission, axes: 1 })
}

fn feedback(pdo: &MappedPdo, node_axis: u8) -> Result<Pdo, MappingError> {
    Ok(Pdo::classic(pdo.id, Mapping::feedback(&objects(pdo, node_axis))?))
}
