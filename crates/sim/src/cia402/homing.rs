//! Homing with the standard methods of object 6098 (CiA 402-2, homing mode): limit switches, home switch, index pulse, and
//! the current position.

use crate::homing_switches::{ReferenceSwitches, Switch};

/// A switch that a method uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Input {
    NegativeLimit,
    PositiveLimit,
    Home,
}

impl Input {
    fn switch(self, switches: &ReferenceSwitches) -> Option<Switch> {
        match self {
            Self::NegativeLimit => switches.negative_limit,
            Self::PositiveLimit => switches.positive_limit,
            Self::Home => switches.home,
        }
    }

    fn is_closed(self, switches: &ReferenceSwitches, position: f64) -> bool {
        self.switch(switches).is_some_and(|switch| switch.is_closed(position))
    }
}

/// What a method looks for: an edge of a switch, an index pulse, or the pulse after the edge.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Method {
    /// The edge; `None` for the index pulse alone.
    edge: Option<Edge>,
    /// The direction of the slow search: 1 or −1.
    direction: f64,
    uses_index: bool,
}

/// The edge of a switch.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edge {
    input: Input,
    /// The direction in which the switch is looked for: 1 or −1.
    initial: f64,
    /// True if the switch closes at the edge in the direction of the search; otherwise it opens.
    closes: bool,
}

impl Method {
    /// The standard method with this number; 35 and 37 need no motion and are no search.
    fn of(number: i64) -> Option<Self> {
        if let 33 | 34 = number {
            let direction = if number == 33 { -1.0 } else { 1.0 };
            return Some(Self { edge: None, direction, uses_index: true });
        }
        let uses_index = (1..=14).contains(&number);
        if !uses_index && !(17..=30).contains(&number) {
            return None;
        }
        let (input, initial, direction, closes) = match if uses_index { number } else { number - 16 } {
            1 => (Input::NegativeLimit, -1.0, 1.0, false),
            2 => (Input::PositiveLimit, 1.0, -1.0, false),
            // The home switch is closed from its edge to the positive end (3, 4) or to the negative end (5, 6).
            3 => (Input::Home, 1.0, -1.0, false),
            4 => (Input::Home, 1.0, 1.0, true),
            5 => (Input::Home, -1.0, 1.0, false),
            6 => (Input::Home, -1.0, -1.0, true),
            // The home switch is closed over a part of the travel.
            7 => (Input::Home, 1.0, -1.0, false),
            8 => (Input::Home, 1.0, 1.0, true),
            9 => (Input::Home, 1.0, -1.0, true),
            10 => (Input::Home, 1.0, 1.0, false),
            11 => (Input::Home, -1.0, 1.0, false),
            12 => (Input::Home, -1.0, -1.0, true),
            13 => (Input::Home, -1.0, 1.0, true),
            _ => (Input::Home, -1.0, -1.0, false),
        };
        Some(Self { edge: Some(Edge { input, initial, closes }), direction, uses_index })
    }

    fn is_wired(self, switches: &ReferenceSwitches) -> bool {
        self.edge.is_none_or(|edge| edge.input.switch(switches).is_some())
            && (!self.uses_index || switches.index_distance.is_some())
    }
}

/// The state of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    /// None was started since the mode was set.
    Idle,
    /// Fast, in this direction, until the switch closes; a limit switch turns the axis round once.
    Seeking {
        method: Method,
        edge: Edge,
        direction: f64,
        has_turned: bool,
    },
    /// Fast, against the direction of the search, until the switch opens.
    Leaving {
        method: Method,
        edge: Edge,
    },
    /// Slowly to the edge.
    Searching {
        method: Method,
        edge: Edge,
    },
    /// Slowly to the index pulse.
    Indexing {
        method: Method,
    },
    /// The home position is set; the axis decelerates to standstill.
    Settling,
    Done,
    Failed,
}

/// What a step of the homing needs to know. Directions are those of the position units.
#[derive(Clone, Copy, Debug)]
pub struct HomingStep<'a> {
    /// The switches.
    pub switches: &'a ReferenceSwitches,
    /// The position of the joint before the step: rad (m).
    pub from: f64,
    /// The position of the joint after the step: rad (m).
    pub to: f64,
    /// 1 when the position units increase with the position of the joint, otherwise −1.
    pub direction: f64,
    /// True if the axis is at rest.
    pub is_at_rest: bool,
}

/// How fast the axis moves in a homing, and in which direction (1 or −1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingSpeed {
    /// With object 6099:1.
    Switch(f64),
    /// With object 6099:2.
    Zero(f64),
    /// At rest.
    Rest,
}

/// A homing.
#[derive(Clone, Copy, Debug)]
pub struct Homing {
    state: State,
}

impl Homing {
    /// No homing.
    pub const fn idle() -> Self {
        Self { state: State::Idle }
    }

    /// Starts a homing. Returns whether the present position is the home position already (methods 35 and 37). A method
    /// that is not standard, or whose switches are not wired, fails at once.
    pub fn start(&mut self, number: i64, switches: &ReferenceSwitches) -> bool {
        if let 35 | 37 = number {
            self.state = State::Done;
            return true;
        }
        self.state = match Method::of(number).filter(|method| method.is_wired(switches)) {
            None => State::Failed,
            Some(method) => match method.edge {
                None => State::Indexing { method },
                Some(edge) => State::Seeking { method, edge, direction: edge.initial, has_turned: false },
            },
        };
        false
    }

    /// Interrupts a running homing; it can be started again.
    pub fn interrupt(&mut self) {
        if self.is_running() {
            self.state = State::Idle;
        }
    }

    /// Ends a running homing with an error.
    pub fn fail(&mut self) {
        if self.is_running() {
            self.state = State::Failed;
        }
    }

    /// Returns `true` if one was started since the mode was set.
    pub fn is_begun(&self) -> bool {
        self.state != State::Idle
    }

    /// Returns `true` if the homing is running.
    pub fn is_running(&self) -> bool {
        !matches!(self.state, State::Idle | State::Done | State::Failed)
    }

    /// Statusword bit 12: homing attained.
    pub fn is_done(&self) -> bool {
        self.state == State::Done
    }

    /// Statusword bit 13: homing error.
    pub fn has_failed(&self) -> bool {
        self.state == State::Failed
    }

    /// The speed set-point.
    pub fn speed(&self) -> HomingSpeed {
        match self.state {
            State::Seeking { direction, .. } => HomingSpeed::Switch(direction),
            State::Leaving { method, .. } => HomingSpeed::Switch(-method.direction),
            State::Searching { method, .. } | State::Indexing { method } => {
                HomingSpeed::Zero(method.direction)
            }
            _ => HomingSpeed::Rest,
        }
    }

    /// Evaluates the switches after a step. Returns the home position when it has just been found: rad (m).
    pub fn step(&mut self, step: HomingStep<'_>) -> Option<f64> {
        let HomingStep { switches, from, to, direction: sign, is_at_rest } = step;
        let is_closed = |input: Input, position| input.is_closed(switches, position);
        // After an overshoot the axis moves against the direction of the search at first.
        let searches = |method: Method| (to - from) * sign * method.direction > 0.0;
        match self.state {
            State::Seeking { method, edge, direction, has_turned } => {
                let ahead = if direction > 0.0 { Input::PositiveLimit } else { Input::NegativeLimit };
                if is_closed(edge.input, to) {
                    self.state = match edge.closes {
                        true => State::Leaving { method, edge },
                        false => State::Searching { method, edge },
                    };
                } else if is_closed(ahead, to) {
                    self.state = match has_turned {
                        true => State::Failed,
                        false => State::Seeking { method, edge, direction: -direction, has_turned: true },
                    };
                }
            }
            State::Leaving { method, edge } if !is_closed(edge.input, to) => {
                self.state = State::Searching { method, edge };
            }
            State::Searching { method, edge }
                if searches(method)
                    && is_closed(edge.input, from) != edge.closes
                    && is_closed(edge.input, to) == edge.closes =>
            {
                self.state = if method.uses_index { State::Indexing { method } } else { State::Settling };
                return (!method.uses_index).then_some(to);
            }
            State::Indexing { method } if searches(method) => {
                let index = switches.index_between(from, to);
                if index.is_some() {
                    self.state = State::Settling;
                }
                return index;
            }
            State::Settling if is_at_rest => self.state = State::Done,
            _ => {}
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves a massless axis until the homing ends; returns where the home position was found.
    fn home(number: i64, home: Switch, begin: f64) -> Option<f64> {
        let switches = ReferenceSwitches {
            negative_limit: Some(Switch::below(-10.0)),
            positive_limit: Some(Switch::above(10.0)),
            home: Some(home),
            index_distance: Some(0.7),
        };
        let mut homing = Homing::idle();
        let mut position = begin;
        let mut found = homing.start(number, &switches).then_some(position);
        for _ in 0..1_000_000 {
            let step = match homing.speed() {
                HomingSpeed::Switch(direction) => direction * 0.01,
                HomingSpeed::Zero(direction) => direction * 0.001,
                HomingSpeed::Rest => 0.0,
            };
            let (from, to) = (position, position + step);
            let step = HomingStep { switches: &switches, from, to, direction: 1.0, is_at_rest: step == 0.0 };
            position = to;
            found = homing.step(step).or(found);
            if !homing.is_running() {
                return found.filter(|_| homing.is_done());
            }
        }
        None
    }

    fn assert_home(number: i64, switch: Switch, wanted: f64) {
        for begin in [-9.5, -3.0, 0.3, 2.5, 9.5] {
            let found = home(number, switch, begin);
            let is_right = found.is_some_and(|found| (found - wanted).abs() < 0.002);
            assert!(is_right, "method {number} from {begin}: {found:?}");
        }
    }

    const PART: Switch = Switch { from: 0.0, to: 2.0 };

    #[test]
    fn every_method_without_index_ends_at_its_edge_from_anywhere() {
        assert_home(17, PART, -10.0);
        assert_home(18, PART, 10.0);
        for number in [19, 20] {
            assert_home(number, Switch::above(0.0), 0.0);
        }
        for number in [21, 22] {
            assert_home(number, Switch::below(0.0), 0.0);
        }
        for number in [23, 24, 29, 30] {
            assert_home(number, PART, 0.0);
        }
        for number in [25, 26, 27, 28] {
            assert_home(number, PART, 2.0);
        }
    }

    #[test]
    fn every_method_with_index_ends_at_the_next_pulse_behind_its_edge() {
        // Pulses are at multiples of 0.7.
        assert_home(1, PART, -9.8);
        assert_home(2, PART, 9.8);
        let beside_the_part =
            [(7, -0.7), (8, 0.7), (9, 1.4), (10, 2.1), (11, 2.1), (12, 1.4), (13, 0.7), (14, -0.7)];
        for (number, wanted) in beside_the_part {
            assert_home(number, PART, wanted);
        }
        for (number, switch, wanted) in [
            (3, Switch::above(0.1), 0.0),
            (4, Switch::above(0.1), 0.7),
            (5, Switch::below(0.1), 0.7),
            (6, Switch::below(0.1), 0.0),
        ] {
            assert_home(number, switch, wanted);
        }
    }

    #[test]
    fn the_index_pulse_alone_and_the_current_position_need_no_switch() {
        assert!(home(33, PART, 0.3).unwrap().abs() < 0.002);
        assert!((home(34, PART, 0.3).unwrap() - 0.7).abs() < 0.002);
        assert_eq!(home(35, PART, 0.3), Some(0.3));
        assert_eq!(home(37, PART, 0.3), Some(0.3));
    }

    #[test]
    fn other_methods_and_missing_switches_are_a_homing_error() {
        for number in [0, 15, 16, 31, 32, 36, 38, -1] {
            assert_eq!(home(number, PART, 0.3), None, "{number}");
        }
        let mut homing = Homing::idle();
        homing.start(17, &ReferenceSwitches::default());
        assert!(homing.has_failed());
    }
}
