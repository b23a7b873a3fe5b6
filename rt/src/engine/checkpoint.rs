//! The state of the engine as bytes, and back.

extern crate alloc;

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::Engine;
use super::group::Group;
use super::shared::Shared;
use crate::axis::Axis;
use crate::checkpoint::CheckpointError;

impl<const AXES: usize, const BUSES: usize> Engine<AXES, BUSES> {
    /// The state between two cycles.
    pub fn checkpoint(&self) -> Vec<u8> {
        bitcode::encode(self)
    }

    /// Takes over the state of an engine of the same machine, and goes on from there. Its own parameters stay, but for what
    /// bring-up has told that engine or the drives: process data, units, the grid, and how drives and controller watch each other.
    ///
    /// # Errors
    /// See [`CheckpointError`]. Nothing has changed then.
    pub fn resume(&mut self, checkpoint: &[u8]) -> Result<(), CheckpointError> {
        let mut resumed: Box<Self> = bitcode::decode(checkpoint)?;
        let is_of_same_machine = resumed.axes.len() == self.axes.len()
            && resumed.groups.len() == self.groups.len()
            && resumed.axes.iter().zip(&self.axes).all(|(axis, own)| axis.is_the_same_joint_as(own))
            && resumed.groups.iter().zip(&self.groups).all(|(group, own)| group.places == own.places)
            && resumed.shared.is_of_same_machine_as(&self.shared);
        if !is_of_same_machine {
            return Err(CheckpointError::OtherMachine);
        }
        resumed.axes.iter_mut().zip(&self.axes).for_each(|(axis, own)| axis.take_parameters_of(own));
        resumed.groups.iter_mut().zip(&self.groups).for_each(|(group, own)| group.take_parameters_of(own));
        resumed.shared.take_parameters_of(&self.shared);
        core::mem::swap(self, &mut resumed);
        Ok(())
    }
}

impl Axis {
    fn is_the_same_joint_as(&self, other: &Self) -> bool {
        let place = |axis: &Self| {
            let parameters = axis.parameters();
            (axis.number(), parameters.bus, parameters.node, parameters.node_axis)
        };
        place(self) == place(other)
    }
}

impl<const AXES: usize, const BUSES: usize> Group<AXES, BUSES> {
    fn take_parameters_of(&mut self, other: &Self) {
        self.stops_with = other.stops_with.clone();
        self.has_other_modes = other.has_other_modes;
    }
}

impl<const AXES: usize, const BUSES: usize> Shared<AXES, BUSES> {
    fn is_of_same_machine_as(&self, other: &Self) -> bool {
        let dividers = |shared: &Self| shared.buses.iter().map(|bus| bus.divider).collect::<Vec<_>>();
        self.period_ns == other.period_ns && dividers(self) == dividers(other)
    }

    fn take_parameters_of(&mut self, other: &Self) {
        self.enable_timeout_cycles = other.enable_timeout_cycles;
        self.not_transmitted_cycles = other.not_transmitted_cycles;
        self.acknowledge_timeout_cycles = other.acknowledge_timeout_cycles;
        self.categories = other.categories;
        self.slots.take_ladder_of(&other.slots);
    }
}
