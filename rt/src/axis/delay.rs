//! One trajectory time for axes on buses with different cycles.
//!
//! A set-point leaves in a cycle of its bus, is latched at the next SYNC, and is reached one cycle of that bus later: the
//! joint is where the trajectory was two bus cycles ago. On a slower bus that is longer ago, so a joint there would be behind
//! the others on the common path. The set-points of the faster buses therefore wait for the difference. Those of the slower
//! bus cannot be sent earlier instead: a stream has no future.

use crate::plan::State;

/// Set-points that can be waiting.
const LENGTH: usize = 64;

/// The last set-points of an axis, of which one so many cycles old is due.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct SetPointDelay {
    line: [State; LENGTH],
    newest: usize,
    cycles: usize,
}

impl Default for SetPointDelay {
    fn default() -> Self {
        Self { line: [State::default(); LENGTH], newest: 0, cycles: 0 }
    }
}

impl SetPointDelay {
    /// From now on set-points wait for so many cycles, at most 63.
    pub fn set(&mut self, cycles: u32) {
        self.cycles = (cycles as usize).min(LENGTH - 1);
    }

    /// Without set-points, which will wait for as many cycles.
    pub fn anew(&self) -> Self {
        Self { cycles: self.cycles, ..Self::default() }
    }

    /// How many cycles set-points wait.
    pub fn cycles(&self) -> usize {
        self.cycles
    }

    /// As if the axis had always been there. Only the places in use are written, since this is done in every cycle of an axis
    /// that is not enabled.
    pub fn fill(&mut self, state: State) {
        self.newest = self.cycles;
        self.line.iter_mut().take(self.cycles + 1).for_each(|place| *place = state);
    }

    /// As if the set-points had always been these: by how many cycles ago they were the newest.
    pub fn fill_with(&mut self, ago: impl Fn(usize) -> State) {
        self.newest = self.cycles;
        let places = self.line.iter_mut().take(self.cycles + 1).rev().enumerate();
        places.for_each(|(cycles, place)| *place = ago(cycles));
    }

    /// Takes the set-point of this cycle.
    pub fn push(&mut self, state: State) {
        self.newest = (self.newest + 1) % LENGTH;
        if let Some(place) = self.line.get_mut(self.newest) {
            *place = state;
        }
    }

    /// The set-point that is due.
    pub fn due(&self) -> State {
        let at = (self.newest + LENGTH - self.cycles) % LENGTH;
        self.line.get(at).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_point_is_due_so_many_cycles_later_and_at_once_without_a_delay() {
        for cycles in [0, 1, 2, 63] {
            let mut delay = SetPointDelay::default();
            delay.set(cycles);
            delay.fill(State { position: -1.0, ..State::default() });
            for number in 0..200 {
                delay.push(State { position: f64::from(number), ..State::default() });
                let expected = if number < cycles { -1.0 } else { f64::from(number - cycles) };
                assert_eq!(delay.due().position, expected);
            }
        }
    }
}
