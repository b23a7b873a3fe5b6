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

    /// Whether it is closed at a position.
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
    /// Whether DIR is high at a position.
    pub fn dir(&self, position: f64) -> bool {
        self.dir.is_some_and(|switch| switch.is_closed(position))
    }

    /// Whether PU is high at a position.
    pub fn pu(&self, position: f64) -> bool {
        self.pu.is_some_and(|switch| switch.is_closed(position))
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
}
