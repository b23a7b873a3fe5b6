//! Homing on a switch (manual 5.09, with the directions of CiA 402-2).

/// The switch input that a method uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// DIR
    Dir,
    /// PU
    Pu,
}

/// The edge that a method searches: the point where the switch changes in one direction of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Search {
    input: Input,
    /// The direction of the search: 1 or −1.
    direction: f64,
    /// True if the switch closes at the edge; otherwise it opens.
    closes: bool,
}

impl Search {
    fn of(method: i64, has_undescribed_methods: bool) -> Option<Self> {
        let (input, direction, closes) = match method {
            17 | 21 => (Input::Dir, 1.0, false),
            18 => (Input::Pu, -1.0, false),
            19 => (Input::Dir, -1.0, false),
            20 if has_undescribed_methods => (Input::Dir, 1.0, true),
            22 if has_undescribed_methods => (Input::Dir, -1.0, true),
            _ => return None,
        };
        Some(Self { input, direction, closes })
    }
}

/// The state of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Idle,
    /// Fast, against the search direction, to the other side of the edge.
    Approaching(Search),
    /// Slowly in the search direction. The flag: the other side of the edge has been seen.
    Searching(Search, bool),
    /// The zero is set; the motor decelerates to standstill.
    Settling,
    Done,
    Failed,
}

/// A homing.
#[derive(Clone, Copy, Debug)]
pub struct Homing {
    state: State,
    elapsed_s: f64,
}

impl Homing {
    /// No homing.
    pub const fn idle() -> Self {
        Self { state: State::Idle, elapsed_s: 0.0 }
    }

    /// Starts a homing. A method that the unit does not have fails at once.
    pub fn start(method: i64, has_undescribed_methods: bool) -> Self {
        let search = Search::of(method, has_undescribed_methods);
        Self { state: search.map_or(State::Failed, State::Approaching), elapsed_s: 0.0 }
    }

    /// Aborts the homing.
    pub fn fail(&mut self) {
        if self.is_running() {
            self.state = State::Failed;
        }
    }

    /// Returns `true` if the homing is running.
    pub fn is_running(&self) -> bool {
        matches!(self.state, State::Approaching(_) | State::Searching(..) | State::Settling)
    }

    /// Returns `true` if a homing was started since the mode was set.
    pub fn is_begun(&self) -> bool {
        self.state != State::Idle
    }

    /// Statusword bit 12: homing complete.
    pub fn is_done(&self) -> bool {
        self.state == State::Done
    }

    /// Statusword bit 13: homing error.
    pub fn has_failed(&self) -> bool {
        self.state == State::Failed
    }

    /// The input that is evaluated.
    pub fn input(&self) -> Option<Input> {
        match self.state {
            State::Approaching(search) | State::Searching(search, _) => Some(search.input),
            _ => None,
        }
    }

    /// How long the homing has run.
    pub fn elapsed_s(&self) -> f64 {
        self.elapsed_s
    }

    /// The velocity set-point, relative to the fast speed.
    pub fn speed(&self) -> Option<f64> {
        match self.state {
            State::Approaching(search) => Some(-search.direction),
            State::Searching(search, _) => Some(0.1 * search.direction),
            State::Settling => Some(0.0),
            _ => None,
        }
    }

    /// Evaluates the switch after a step of `duration_s` at `velocity`. Returns whether this is the zero position.
    pub fn step(&mut self, is_closed: bool, velocity: f64, is_at_rest: bool, duration_s: f64) -> bool {
        self.elapsed_s += duration_s;
        match self.state {
            State::Approaching(search) if is_closed != search.closes => {
                self.state = State::Searching(search, false);
            }
            // The motor moves back from the overshoot of the approach.
            State::Searching(search, has_seen) if velocity * search.direction > 0.0 => {
                if has_seen && is_closed == search.closes {
                    self.state = State::Settling;
                    return true;
                }
                self.state = State::Searching(search, has_seen || is_closed != search.closes);
            }
            State::Settling if is_at_rest => self.state = State::Done,
            _ => {}
        }
        false
    }
}
