//! Where an axis is to be.

use super::Axis;
use crate::guard::{self, SetPointSteps, Violation};
use crate::plan::State;
use crate::stop::Rule;

impl Axis {
    /// The newest set-point.
    pub fn set_point(&self) -> State {
        self.set[0]
    }

    /// Gives the newest set-point the velocity and the acceleration that its steps show: when a stream ends, of which what it
    /// said of them may be wrong. Where it has led is known, and whatever is planned from now on goes on from that.
    pub fn derive_from_steps(&mut self, period_s: f64) {
        if self.is_profile() {
            return;
        }
        let [newest, last, before] = self.set.map(|state| state.position);
        let steps = SetPointSteps { sent: [last, before, before], next: newest, period_s };
        self.set[0] = steps.state(&self.parameters.limits);
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

    /// Checks the next set-point of a stream, beyond [`Axis::check`]. After a command that did not come and was bridged the
    /// jerk is not the stream's own, and is not judged.
    pub fn check_stream(&self, next: &State, period_s: f64, is_bridged: bool) -> Result<(), Violation> {
        let limits = &self.parameters.limits;
        let jerk = if is_bridged { f64::INFINITY } else { limits.jerk };
        guard::check_jerk(jerk, &self.steps(next, period_s))?;
        guard::check_braking(limits, &self.steps(next, period_s))
    }

    /// The set-point within the limits that is nearest to one of a stream.
    pub fn clamped(&self, next: &State, period_s: f64) -> State {
        guard::clamp(&self.parameters.limits, &self.steps(next, period_s))
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

    /// What takes the place of the next command of a stream when it does not come in time: for one cycle the motion goes on as
    /// it did, with its acceleration, so that the one after it fits in; from then on at its velocity. What the stream says of
    /// itself counts if its steps agree; of one that says nothing they are all that is known.
    pub fn extrapolated(&self, command: &State, period_s: f64) -> State {
        let limits = &self.parameters.limits;
        let most = limits.acceleration.max(limits.deceleration);
        let [newest, last, before] = self.set.map(|state| state.position);
        let (step, step_before) = ((newest - last) / period_s, (last - before) / period_s);
        let says_something = command.velocity != 0.0 || command.acceleration != 0.0;
        let is_said = says_something && (command.velocity - step).abs() <= most * period_s;
        let (velocity, change) = if is_said {
            (command.velocity, command.acceleration * period_s)
        } else {
            (step, step - step_before)
        };
        let end = velocity + change.max(-most * period_s).min(most * period_s);
        // It neither turns round nor leaves the limits by itself.
        let is_turned = end * velocity < 0.0;
        let end = if is_turned { 0.0 } else { end.max(-limits.velocity).min(limits.velocity) };
        // What it says is its velocity at the end of a step, and what the steps show is that of their middle.
        let mean = if is_said { (velocity + end) / 2.0 } else { end };
        State { position: command.position + mean * period_s, velocity: end, acceleration: 0.0 }
    }

    fn steps(&self, next: &State, period_s: f64) -> SetPointSteps {
        let sent = [self.set[0].position, self.set[1].position, self.set[2].position];
        SetPointSteps { sent, next: next.position, period_s }
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
