//! Process data as the drives report it, in place of what was expected.

use arrayvec::ArrayVec;

use super::Engine;
use super::obstacle::Obstacle;
use crate::axis::{CommandPdo, MAX_PDOS, Pdo};
use crate::dispatch::IdTaken;
use crate::host::{AxisProcessData, MappedPdo};
use crate::pdo::{MAX_OBJECTS, MappedObject, Mapping, MappingError};
use crate::refusal::RejectReason;
use crate::stop::Phase;

impl Engine {
    /// Changes what is exchanged with an axis' drive. Not where something moves already, the axis is not there, it has no PDO
    /// in one direction, an object has no use or value, or an identifier has another one. Then nothing is changed.
    pub(super) fn set_process_data(&mut self, data: &AxisProcessData) -> Result<(), Obstacle> {
        self.require_phase(&[Phase::Passive])?;
        let index = usize::from(data.axis);
        let bus = usize::from(self.axis_mut(data.axis)?.parameters().bus);
        self.exchange(data, index, bus).map_err(|obstacle| obstacle.of_axis(index))
    }

    fn exchange(&mut self, data: &AxisProcessData, index: usize, bus: usize) -> Result<(), Obstacle> {
        let commands = data.commands.iter().flatten().map(command);
        let commands: ArrayVec<CommandPdo, MAX_PDOS> =
            commands.collect::<Result<_, _>>().map_err(unmapped)?;
        let feedback = data.feedback.iter().flatten().map(feedback);
        let feedback: ArrayVec<Pdo, MAX_PDOS> = feedback.collect::<Result<_, _>>().map_err(unmapped)?;
        // An engine has a table for every bus of an axis, and a place for every axis in it.
        let (Some(table), Some(axis)) = (self.dispatch.get_mut(bus), self.axes.get_mut(index)) else {
            return Err(RejectReason::UnknownAxis.into());
        };
        if commands.is_empty() || feedback.is_empty() {
            return Err(RejectReason::NoProcessData.into());
        }
        let mut changed = table.clone();
        changed.forget_process_data(data.axis);
        for (number, pdo) in (0..).zip(&feedback) {
            changed.feedback(pdo.id, data.axis, number).map_err(taken)?;
        }
        for id in data.unused.iter().flatten() {
            changed.unused(*id, data.axis).map_err(taken)?;
        }
        for command in &commands {
            changed.foreign(command.pdo.id);
        }
        *table = changed;
        axis.set_process_data(commands, feedback);
        Ok(())
    }
}

fn unmapped(error: MappingError) -> Obstacle {
    let parameter = match error {
        MappingError::TooManyObjects { .. } => 0,
        MappingError::TooLong { object, .. }
        | MappingError::Width { object }
        | MappingError::NothingToSend { object } => object.parameter(),
    };
    Obstacle::from(RejectReason::Mapping).with(parameter.into(), 0.0)
}

fn taken(IdTaken { id }: IdTaken) -> Obstacle {
    Obstacle::from(RejectReason::IdTaken).with(id.value().into(), 0.0)
}

fn objects(pdo: &MappedPdo) -> ArrayVec<MappedObject, MAX_OBJECTS> {
    pdo.objects.iter().flatten().copied().collect()
}

fn command(pdo: &MappedPdo) -> Result<CommandPdo, MappingError> {
    let mapping = Mapping::commands(&objects(pdo))?;
    Ok(CommandPdo { pdo: Pdo { id: pdo.id, mapping }, cadence: pdo.cadence })
}

fn feedback(pdo: &MappedPdo) -> Result<Pdo, MappingError> {
    Ok(Pdo { id: pdo.id, mapping: Mapping::feedback(&objects(pdo))? })
}
