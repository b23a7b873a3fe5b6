//! A stop is over within the time and the distance that are stated of it.

use takt::config::{Axis, Config};
use takt_rt::{Phase, StopCategory};

use super::phases::is_unbounded;
use super::{REST, Seen};
use crate::bounds;
use crate::heartbeat::MissedHeartbeat;

pub struct Stops {
    group: usize,
    /// The axes of the group: all of them stop together.
    numbers: Vec<usize>,
    axes: Vec<Axis>,
    /// Where each joint was when the present stop began.
    positions: Vec<f64>,
    /// Cycles since the stop under way began.
    cycles: Option<u64>,
    /// True if it has become one that cuts the power at once.
    is_cut: bool,
    /// True if the drive of each axis has missed the heartbeat since then, and has taken its power by itself.
    has_cut_itself: Vec<bool>,
}

impl Stops {
    pub fn new(config: &Config, group: usize) -> Self {
        let numbers = config.axes_of_group(group);
        let axes: Vec<Axis> = numbers.iter().map(|axis| config.axes[*axis].clone()).collect();
        let (positions, has_cut_itself) = (vec![0.0; axes.len()], vec![false; axes.len()]);
        Self { group, numbers, positions, axes, cycles: None, is_cut: false, has_cut_itself }
    }

    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        let (config, group) = (seen.config, &seen.snapshot.groups()[self.group]);
        match (group.phase, self.cycles) {
            (Phase::Moving | Phase::Streaming | Phase::Enabling, _) => self.cycles = None,
            (Phase::Stopping, None) => {
                (self.cycles, self.is_cut) = (Some(0), false);
                self.has_cut_itself.fill(false);
                let positions = self.positions.iter_mut().zip(&self.numbers);
                positions.for_each(|(position, axis)| *position = seen.truth[*axis].position);
                let (planned_s, stated_s) = (group.remaining_s, bounds::planned_s(&self.axes));
                if planned_s > stated_s {
                    return Err(format!("a stop of {planned_s} s, beyond the {stated_s} s that are stated"));
                }
            }
            (_, Some(cycles)) => self.cycles = Some(cycles + 1),
            _ => {}
        }
        let Some(cycles) = self.cycles else { return Ok(()) };
        self.is_cut |= group.stop.is_some_and(|stop| stop.category == StopCategory::Zero);
        for (place, axis) in self.axes.iter().enumerate() {
            let number = self.numbers[place];
            self.has_cut_itself[place] |= seen.concerns[number].missed_heartbeat == MissedHeartbeat::Shown;
            if seen.concerns[number].is_present {
                continue;
            }
            let truth = &seen.truth[number];
            let travelled = (truth.position - self.positions[place]).abs();
            // The controller has no more part in where a joint coasts to.
            let is_cut = self.is_cut || self.has_cut_itself[place];
            let coasting_s = if is_cut { bounds::coasting_s(axis) } else { 0.0 };
            let is_over = cycles > bounds::cycles(config, bounds::to_rest_s(&self.axes) + coasting_s);
            let limit = bounds::to_rest_distance(&self.axes, axis) + axis.limits.velocity * coasting_s / 2.0;
            if travelled > limit && !is_unbounded(&axis.control) {
                return Err(format!("{}: {travelled} since the stop began, beyond {limit}", axis.name));
            }
            // That one is braked once the group is disabled.
            if is_over
                && !is_unbounded(&axis.control)
                && truth.velocity.abs() > REST.max(0.01 * axis.limits.velocity)
            {
                return Err(format!("{}: {} after the time to rest", axis.name, truth.velocity));
            }
        }
        Ok(())
    }
}
