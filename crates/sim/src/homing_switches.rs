//! Limit and home switches along the travel of a joint, wired to a drive's inputs.

/// A switch that is closed over a part of the travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switch {
    /// Where it closes: rad (m).
    pub from: f64,
    /// Where it opens again: rad (m).
    pub to: f64,
}

impl Switch {
    /// A switch at the upper end of the travel: closed at this position and above.
    pub const fn above(position: f64) -> Self {
        Self { from: position, to: f64::INFINITY }
    }

    /// A switch at the lower end of the travel: closed at this position and below.
    pub const fn below(position: f64) -> Self {
        Self { from: f64::NEG_INFINITY, to: position }
    }

    /// Returns `true` if it is closed at a position.
    pub fn is_closed(&self, position: f64) -> bool {
        (self.from..=self.to).contains(&position)
    }
}

/// The two inputs of a YZ-AIM servo for switches; an input without one stays low.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HomingSwitches {
    /// On DIR: the negative limit (method 17) or the home switch (methods 19 to 22).
    pub dir: Option<Switch>,
    /// On PU: the positive limit (method 18).
    pub pu: Option<Switch>,
}

impl HomingSwitches {
    /// Returns `true` if DIR is high at a position.
    pub fn dir(&self, position: f64) -> bool {
        self.dir.is_some_and(|switch| switch.is_closed(position))
    }

    /// Returns `true` if PU is high at a position.
    pub fn pu(&self, position: f64) -> bool {
        self.pu.is_some_and(|switch| switch.is_closed(position))
    }
}

/// The switches and the index pulse that a drive's homing (object 6098) uses; one that is not wired stays low.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceSwitches {
    /// The switch at the lower end of the travel.
    pub negative_limit: Option<Switch>,
    /// The switch at the upper end of the travel.
    pub positive_limit: Option<Switch>,
    /// The home switch.
    pub home: Option<Switch>,
    /// The distance between two index pulses of the encoder: rad (m). One pulse is at 0.
    pub index_distance: Option<f64>,
}

impl ReferenceSwitches {
    /// The first index pulse on the way from one position to another.
    pub fn index_between(&self, from: f64, to: f64) -> Option<f64> {
        let distance = self.index_distance.filter(|distance| *distance > 0.0)?;
        let pulse = if to > from { (from / distance).floor() + 1.0 } else { (from / distance).ceil() - 1.0 }
            * distance;
        (from.min(to)..=from.max(to)).contains(&pulse).then_some(pulse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_switch_is_closed_over_its_part_of_the_travel() {
        let home = Switch { from: -0.1, to: 0.2 };
        assert_eq!(
            [-0.2, -0.1, 0.0, 0.2, 0.3].map(|at| home.is_closed(at)),
            [false, true, true, true, false]
        );
        assert!(Switch::above(1.0).is_closed(7.0) && !Switch::above(1.0).is_closed(0.9));
        assert!(Switch::below(-1.0).is_closed(-7.0) && !Switch::below(-1.0).is_closed(-0.9));
        assert!(!HomingSwitches::default().dir(0.0));
    }

    #[test]
    fn the_index_pulse_comes_once_a_distance_in_both_directions() {
        let switches = ReferenceSwitches { index_distance: Some(0.5), ..ReferenceSwitches::default() };
        assert_eq!(switches.index_between(0.4, 0.6), Some(0.5));
        assert_eq!(switches.index_between(0.6, 0.4), Some(0.5));
        assert_eq!(switches.index_between(0.1, 0.4), None);
        assert_eq!(switches.index_between(-0.1, 0.1), Some(0.0));
        assert_eq!(ReferenceSwitches::default().index_between(-9.0, 9.0), None);
    }
}
