//! Process data as the drives report it, in place of what was expected.

use arrayvec::ArrayVec;

use super::Engine;
use crate::axis::{CommandPdo, MAX_PDOS, Pdo};
use crate::door::{AxisProcessData, MappedPdo};
use crate::pdo::{MAX_OBJECTS, MappedObject, Mapping};
use crate::stop::Phase;

impl Engine {
    /// Changes what is exchanged with an axis' drive. `None` where that cannot be: something moves already, the axis is
    /// not there, it has no PDO in one direction, an object has no use or value, or an identifier has another one. Then
    /// nothing is changed.
    pub(super) fn set_process_data(&mut self, data: &AxisProcessData) -> Option<()> {
        let axis = self.axes.get_mut(usize::from(data.axis)).filter(|_| self.phase == Phase::Passive)?;
        let table = self.dispatch.get_mut(usize::from(axis.parameters().bus))?;
        let commands = data.commands.iter().flatten().map(command);
        let commands: ArrayVec<CommandPdo, MAX_PDOS> = commands.collect::<Option<_>>()?;
        let feedback = data.feedback.iter().flatten().map(feedback);
        let feedback: ArrayVec<Pdo, MAX_PDOS> = feedback.collect::<Option<_>>()?;
        if commands.is_empty() || feedback.is_empty() {
            return None;
        }
        let mut changed = table.clone();
        changed.forget_process_data(data.axis);
        for (number, pdo) in (0..).zip(&feedback) {
            changed.feedback(pdo.id, data.axis, number).ok()?;
        }
        for id in data.unused.iter().flatten() {
            changed.unused(*id, data.axis).ok()?;
        }
        for command in &commands {
            changed.foreign(command.pdo.id);
        }
        *table = changed;
        axis.set_process_data(commands, feedback);
        Some(())
    }
}

fn objects(pdo: &MappedPdo) -> ArrayVec<MappedObject, MAX_OBJECTS> {
    pdo.objects.iter().flatten().copied().collect()
}

fn command(pdo: &MappedPdo) -> Option<CommandPdo> {
    let mapping = Mapping::commands(&objects(pdo)).ok()?;
    Some(CommandPdo { pdo: Pdo { id: pdo.id, mapping }, cadence: pdo.cadence })
}

fn feedback(pdo: &MappedPdo) -> Option<Pdo> {
    Some(Pdo { id: pdo.id, mapping: Mapping::feedback(&objects(pdo)).ok()? })
}
