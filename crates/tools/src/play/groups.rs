//! The groups that a file plays: those of the joints that it names. The others hold.

use takt::config::Config;

/// A group with a joint that the file names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlayedGroup {
    /// Its number.
    pub number: u8,
    /// The numbers of its axes, in the order of the group.
    pub axes: Vec<usize>,
}

impl PlayedGroup {
    /// The groups of the axes with these numbers.
    pub fn of(config: &Config, named: &[usize]) -> Vec<Self> {
        let groups = (0..=u8::MAX).zip(0..config.groups.len().max(1));
        let groups = groups.map(|(number, group)| Self { number, axes: config.axes_of_group(group) });
        groups.filter(|group| group.axes.iter().any(|axis| named.contains(axis))).collect()
    }

    /// What is its own of what there is of every axis of the controller.
    pub fn pick<T: Copy>(&self, all: &[T]) -> Vec<T> {
        self.axes.iter().filter_map(|axis| all.get(*axis).copied()).collect()
    }
}
