//! Where an axis is to be.

use super::Axis;
use crate::guard::{self, Course, StreamCommands, Violation};
use crate::motion::stop_limits;
use crate::plan::{Problem, State};
use crate::stop::Rule;

/// Steps before a set-point in its third difference.
const STEPS_OF_JERK: u8 = 3;
/// See [`Axis::met_within`].
const MET_SHARE: f64 = 1e-3;

/// What the set-points of a stream follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Following {
    /// The commands: each is a set-point.
    Commands,
    /// Nothing yet: the first command has not come.
    Awaited,
    /// The motion that the commands show, since one has not come; so many of the last set-points have met their commands again.
    Motion { met: u8 },
}

impl Axis {
    /// The newest set-point.
    pub fn set_point(&self) -> State {
        self.set[0]
    }

    /// Gives the newest set-point the velocity and the acceleration that its steps show: when a stream ends, of which what it
    /// said of them may be wrong. Where it has led is known, and whatever is planned from now on goes on from that.
    pub fn take_steps(&mut self, period_s: f64) {
        if self.is_profile() {
            return;
        }
        self.set[0] = self.state_by_steps(period_s);
    }

    fn state_by_steps(&self, period_s: f64) -> State {
        let [newest, last, before] = self.set.map(|state| state.position);
        let course = Course { sent: [last, before, before], next: newest, period_s };
        course.state(&self.parameters.limits)
    }

    /// Makes the actual position the set-point, as if it had always been: for an axis whose drive has been sent none.
    pub fn start_from_actual(&mut self) {
        self.rest_at(self.position);
    }

    /// Lets the set-point follow the joint, as the target of a drive that may be enabled on it. It goes no faster than the
    /// joint may, so that it leaps for nobody: not when the joint did, nor when the drive obeys although it says otherwise.
    ///
    /// The set-point of an axis that has been given up stays where it was.
    pub fn follow_actual(&mut self, period_s: f64) {
        let here = self.set[0].position;
        // In a profile mode the drive gets no set-points.
        let fastest = if self.is_profile() { f64::INFINITY } else { self.parameters.limits.velocity };
        let most = fastest * period_s;
        let way = (self.position - here).clamp(-most, most);
        // The sum of the difference need not be the actual position to the last bit.
        let is_there = way.abs() < most;
        let next = if is_there { self.position } else { here + way };
        self.rest_at(if self.is_lost { here } else { next });
    }

    /// Leaves the set-point where it is.
    pub fn stay(&mut self) {
        let position = self.set[0].position;
        if self.is_enabled() {
            self.advance(State { position, ..State::default() });
        } else {
            // What waits to be sent is still sent: a drive that obeys although it says otherwise gets no step.
            self.set = [State { position, ..State::default() }; 3];
            self.delay.push(self.set[0]);
            self.following_guard.reset();
        }
    }

    /// Whether the set-point is where the joint is, but for one step within the limits.
    pub fn is_on_joint(&self, period_s: f64) -> bool {
        (self.position - self.set[0].position).abs() <= self.parameters.limits.velocity * period_s
    }

    fn rest_at(&mut self, position: f64) {
        self.set = [State { position, ..State::default() }; 3];
        self.delay.fill(self.set[0]);
        self.sent = self.set;
        self.following_error = 0.0;
        self.following_guard.reset();
    }

    /// Checks the next set-point against the guard.
    pub fn check(&self, next: &State, period_s: f64) -> Result<(), Violation> {
        guard::check(&self.parameters.limits, period_s, self.set[1].position, self.set[0].position, next)
    }

    /// Checks the next set-point of a stream, beyond [`Axis::check`].
    pub fn check_stream(&self, next: &State, period_s: f64) -> Result<(), Violation> {
        let limits = &self.parameters.limits;
        guard::check_jerk(limits.jerk, &self.course(next, period_s))?;
        guard::check_braking(limits, &self.course(next, period_s))
    }

    /// The set-point within the limits that is nearest to one of a stream.
    pub fn clamped(&mut self, next: &State, period_s: f64) -> State {
        self.following = Following::Commands;
        guard::clamp(&self.parameters.limits, &self.course(next, period_s))
    }

    /// A set-point of a stream, of which the position counts: what it says of its velocity and acceleration is fed forward
    /// as far as its step and the limits agree, so that nobody turns a joint by words alone. What is no number is left to
    /// [`Axis::check`].
    pub fn agreeing(&self, next: &State, period_s: f64) -> State {
        let limits = &self.parameters.limits;
        let most = limits.acceleration.max(limits.deceleration);
        let (step, room) = ((next.position - self.set[0].position) / period_s, most * period_s);
        let within = |value: f64, lowest: f64, highest: f64| value.max(lowest).min(highest);
        if !(next.velocity.is_finite() && next.acceleration.is_finite() && step.is_finite()) {
            return *next;
        }
        State {
            position: next.position,
            velocity: within(next.velocity, step - room, step + room),
            acceleration: within(next.acceleration, -most, most),
        }
    }

    /// A stream is asked for: the set-points so far count as the commands before its first one.
    pub fn begin_stream(&mut self) {
        self.stream = StreamCommands::begin(self.set.map(|state| state.position));
        self.following = Following::Commands;
    }

    /// Lets a cycle pass in which the first command of a stream has not come yet. Its owner may have begun to move.
    pub fn await_stream(&mut self) {
        self.stream.pass();
        self.following = Following::Awaited;
    }

    /// The next set-point of a stream, of which a command has come in this cycle or has not. A command that fits the set-points
    /// before it is taken as it is. Where one does not come, the motion of the commands so far is followed in its place, within
    /// all limits; and so is that of the commands after it until one is met, if they keep the limits by themselves.
    ///
    /// # Errors
    /// The limit that the stream breaks.
    pub fn streamed(&mut self, command: Option<&State>, period_s: f64) -> Result<State, Violation> {
        self.stream.pass();
        let Some(command) = command else {
            return self.follow_motion(period_s);
        };
        if command.position.is_finite() {
            self.stream.take(command.position);
        }
        let checked = self.check(command, period_s).and_then(|()| self.check_stream(command, period_s));
        match (checked, self.following) {
            (Ok(()), Following::Commands | Following::Awaited) => {
                self.following = Following::Commands;
                return Ok(self.agreeing(command, period_s));
            }
            (Err(violation), following)
                if following == Following::Commands || violation.rule == Rule::NotFinite =>
            {
                return Err(violation);
            }
            _ => self.stream.check(&self.parameters.limits, period_s)?,
        }
        let met = match self.following {
            Following::Motion { met } => met,
            Following::Commands | Following::Awaited => 0,
        };
        let next = self.follow_motion(period_s)?;
        let distance = (command.position - next.position).abs();
        match checked {
            Ok(()) if distance <= self.met_within(period_s) => {
                self.following = if met < STEPS_OF_JERK {
                    Following::Motion { met: met + 1 }
                } else {
                    Following::Commands
                };
                Ok(State { position: command.position, ..next })
            }
            Err(violation) if distance > self.parameters.start_tolerance => Err(violation),
            _ => Ok(next),
        }
    }

    /// The next set-point on the way to the motion that the commands of a stream show.
    fn follow_motion(&mut self, period_s: f64) -> Result<State, Violation> {
        let limits = &self.parameters.limits;
        let start = match self.following {
            Following::Motion { .. } => self.set[0],
            Following::Commands | Following::Awaited => self.state_by_steps(period_s),
        };
        let motion = self.stream.motion(period_s, limits);
        let is_within = |next: &State| {
            self.check(next, period_s).and_then(|()| self.check_stream(next, period_s)).is_ok()
        };
        let met = motion.meet(&start, limits, period_s).filter(is_within);
        let next = match met {
            Some(next) => next,
            // It is bound for a limit, and following it as closely as possible would be, too. The planner is told where it is now.
            None => {
                let target = State { acceleration: 0.0, ..motion.after(-period_s).state };
                let problem = Problem { start, target, limits: stop_limits(&start, limits) };
                let untracked =
                    |_| Violation { rule: Rule::NoTrajectory, value: target.position, limit: 0.0 };
                problem.track(period_s).map_err(untracked)?
            }
        };
        self.following = Following::Motion { met: 0 };
        Ok(next)
    }

    /// How near its command a set-point has to be for the stream to be met: a small share of what the limits of acceleration and
    /// jerk make of a position in a cycle.
    fn met_within(&self, period_s: f64) -> f64 {
        let limits = &self.parameters.limits;
        let steepest = limits.acceleration.max(limits.deceleration);
        MET_SHARE * (limits.jerk * period_s).min(steepest) * period_s * period_s
    }

    fn course(&self, next: &State, period_s: f64) -> Course {
        let sent = [self.set[0].position, self.set[1].position, self.set[2].position];
        Course { sent, next: next.position, period_s }
    }

    /// Checks that a stream begins where the joint is. What is no number is left to [`Axis::check`].
    pub fn check_start(&self, first: &State) -> Result<(), Violation> {
        let (distance, limit) = ((first.position - self.position).abs(), self.parameters.start_tolerance);
        if distance > limit {
            Err(Violation { rule: Rule::StartPose, value: distance, limit })
        } else {
            Ok(())
        }
    }

    /// Checks the following error of this cycle, if there was feedback.
    pub fn check_following(&mut self) -> Result<(), Violation> {
        if self.age > 0 { Ok(()) } else { self.following_guard.check(self.following_error) }
    }

    /// Has set-points wait for so many cycles before they are sent, for the axes on slower buses.
    pub fn delay_set_points(&mut self, cycles: u32) {
        self.delay.set(cycles);
    }

    /// Takes the next set-point. In a profile mode there is none: the target stays.
    pub fn advance(&mut self, next: State) {
        let next = if self.is_profile() { self.shown_set_point() } else { next };
        self.set = [next, self.set[0], self.set[1]];
        self.delay.push(next);
    }
}
