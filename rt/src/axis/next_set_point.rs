//! Where an axis is to be: its next set-point, and what the guard says of it.

use super::Axis;
use crate::control::TorqueDemand;
use crate::fault::Fault;
use crate::group_trajectory::fastest_stop;
use crate::guard::{self, SetPointSteps, braking_distance};
use crate::plan::State;
use crate::source::Follow;

/// How far the velocity of a joint on a spring may overshoot its limit.
const VELOCITY_OVERSHOOT: f64 = 1.2;
/// A velocity that is too high for a stop in time is made lower by this factor, down to this share of it.
const SLOWED_DOWN: f64 = 0.9;
const SLOWEST_SHARE: f64 = 0.01;
/// Cycles from the report of a joint to the first set-point of a stop that it is reason for, beside those that set-points wait.
const REACTION_CYCLES: f64 = 3.0;

impl Axis {
    /// The newest set-point.
    pub fn set_point(&self) -> State {
        self.set_points.newest()
    }

    /// Gives the newest set-point the velocity and the acceleration that its steps show, where a stream was followed exactly:
    /// what it said of its velocity may be wrong, where it has led is known. Whatever is planned from now on goes on from that.
    pub fn derive_from_steps(&mut self, period_s: f64) {
        if self.is_profile() || self.follow == Follow::Smooth {
            return;
        }
        self.set_points.refine_newest(self.state_by_steps(period_s));
    }

    /// The state of the newest set-point, as the steps to it show it.
    fn state_by_steps(&self, period_s: f64) -> State {
        let [newest, last, before] = self.set_points.positions();
        let steps = SetPointSteps { sent: [last, before, before], next: newest, period_s };
        steps.state(&self.parameters.limits)
    }

    /// Makes the actual position the set-point, as if it had always been: for an axis whose drive has been sent none.
    pub fn start_from_actual(&mut self) {
        self.rest_at(self.joint.position());
    }

    /// Lets the set-point follow the joint, as the target of a drive that may be enabled on it. It moves no faster than the
    /// joint may. So it makes no step, whether the reported position does or the drive obeys although it says otherwise.
    ///
    /// The set-point of an axis that is latched off stays where it was.
    pub fn follow_actual(&mut self, period_s: f64) {
        let here = self.set_point().position;
        // In a profile mode the drive gets no set-points.
        let fastest = if self.is_profile() { f64::INFINITY } else { self.parameters.limits.velocity };
        let most = fastest * period_s;
        let way = (self.joint.position() - here).clamp(-most, most);
        // The sum of the difference need not be the actual position to the last bit.
        let is_there = way.abs() < most;
        let next = if is_there { self.joint.position() } else { here + way };
        self.rest_at(if self.is_latched_off() { here } else { next });
    }

    /// Leaves the set-point where it is.
    pub fn stay(&mut self) {
        if self.is_enabled() {
            self.advance(State::rest(self.set_point().position));
        } else {
            self.set_points.rest_here();
            self.following.restart();
        }
    }

    /// Goes on by one cycle on the fastest stop of this axis alone, and leaves the set-point where it stands: for a group whose
    /// planned stop cannot be followed any more. A set-point that just stayed would leap to a standstill.
    pub fn slow_down(&mut self, period_s: f64) {
        let [last, before_last, _] = self.set_points.positions();
        if !self.is_enabled() || last == before_last {
            return self.stay();
        }
        let stopping = fastest_stop(&self.set_point(), &self.parameters.limits);
        let next = match stopping.map(|profile| profile.sample(period_s)) {
            Ok(next) if self.check(&next, period_s).is_ok() => next,
            _ => self.decelerating(period_s),
        };
        self.advance(next);
    }

    /// The next set-point with the deceleration limit, whatever the jerk.
    fn decelerating(&self, period_s: f64) -> State {
        let [last, before_last, _] = self.set_points.positions();
        let most = self.parameters.limits.deceleration * period_s;
        let last_velocity = (last - before_last) / period_s;
        let change = -last_velocity.clamp(-most, most);
        let velocity = last_velocity + change;
        State { position: last + velocity * period_s, velocity, acceleration: change / period_s }
    }

    /// Returns `true` if the set-point is where the joint is, but for one step within the limits.
    pub fn is_on_joint(&self, period_s: f64) -> bool {
        (self.joint.position() - self.set_point().position).abs()
            <= self.parameters.limits.velocity * period_s
    }

    fn rest_at(&mut self, position: f64) {
        self.set_points.rest_at(position);
        self.following.clear();
    }

    /// Lets the set-point begin anew where the joint is, as fast as that moves, but for what no stop within the limits would
    /// end in time.
    pub(super) fn begin_on_joint(&mut self, period_s: f64) {
        let limits = &self.parameters.limits;
        let position = self.joint.position();
        let mut velocity = self.joint.velocity().clamp(-limits.velocity, limits.velocity);
        let slowest = velocity.abs() * SLOWEST_SHARE;
        while velocity != 0.0
            && self.beyond_limit(position, velocity, period_s).is_some_and(|(_, by)| by > 0.0)
        {
            velocity = if velocity.abs() > slowest { velocity * SLOWED_DOWN } else { 0.0 };
        }
        self.set_points.begin_at(position, velocity, period_s);
        self.following.clear();
    }

    /// Where a joint would rest that is stopped now, and by how much that is beyond its position limit; `None` where it stands.
    /// A stop begins ahead of the report by the cycles that it takes to be obeyed.
    fn beyond_limit(&self, position: f64, velocity: f64, period_s: f64) -> Option<(f64, f64)> {
        let limits = &self.parameters.limits;
        let reaction_cycles = REACTION_CYCLES + self.set_points.delay_cycles();
        let begin = position + reaction_cycles * velocity * period_s;
        let way = braking_distance(limits, velocity.abs(), 0.0);
        if velocity > 0.0 {
            Some((begin + way, begin + way - limits.position_max))
        } else if velocity < 0.0 {
            Some((begin - way, limits.position_min - (begin - way)))
        } else {
            None
        }
    }

    /// Checks the next set-point against the guard; and where the joint need not be on its set-point, the joint too.
    #[inline]
    pub fn check(&self, next: &State, period_s: f64) -> Result<(), Fault> {
        match self.torque_loop.demand() {
            TorqueDemand::Law { .. } => {}
            TorqueDemand::Impedance { .. } => self.check_joint(
                VELOCITY_OVERSHOOT * self.parameters.limits.velocity,
                self.parameters.following_error_limit,
                period_s,
            )?,
            TorqueDemand::Torque(_) => {
                return self.check_joint(self.parameters.limits.velocity, 0.0, period_s);
            }
        }
        let [last, before_last, _] = self.set_points.positions();
        guard::check(&self.parameters.limits, period_s, before_last, last, next)
    }

    /// Checks that the joint is not too fast, and can still be stopped before its position limits, or so far behind them.
    fn check_joint(&self, fastest: f64, room: f64, period_s: f64) -> Result<(), Fault> {
        let limits = &self.parameters.limits;
        let (position, velocity) = (self.joint.position(), self.joint.velocity());
        if velocity.abs() > fastest {
            return Err(Fault::VelocityLimit { velocity, limit: fastest });
        }
        match self.beyond_limit(position, velocity, period_s) {
            Some((rest, by)) if by > room => {
                let limit = if velocity > 0.0 { limits.position_max } else { limits.position_min };
                Err(Fault::PositionLimit { position: rest, limit })
            }
            _ => Ok(()),
        }
    }

    /// Checks the next set-point of a stream, beyond [`Axis::check`].
    pub fn check_stream(&self, next: &State, period_s: f64) -> Result<(), Fault> {
        let limits = &self.parameters.limits;
        guard::check_jerk(limits.jerk, &self.steps(next, period_s))?;
        guard::check_braking(limits, &self.steps(next, period_s))
    }

    /// A set-point of a stream, of which the position counts: what it says of its velocity and acceleration is fed forward
    /// as far as its step and the limits agree, so that a stated velocity without a step of the position moves no joint. What is
    /// no number is left to [`Axis::check`].
    pub fn agreeing(&self, next: &State, period_s: f64) -> State {
        let limits = &self.parameters.limits;
        let most = limits.acceleration.max(limits.deceleration);
        let (step, room) = ((next.position - self.set_point().position) / period_s, most * period_s);
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

    fn steps(&self, next: &State, period_s: f64) -> SetPointSteps {
        SetPointSteps { sent: self.set_points.positions(), next: next.position, period_s }
    }

    /// Checks that a stream begins where the joint is. What is no number is left to [`Axis::check`].
    pub fn check_start(&self, first: &State) -> Result<(), Fault> {
        let (distance, limit) =
            ((first.position - self.joint.position()).abs(), self.parameters.start_tolerance);
        if distance > limit { Err(Fault::StartPose { distance, limit }) } else { Ok(()) }
    }

    /// Checks for how long the following error has been too large, if there is feedback of this cycle. [`Axis::watch`] counts.
    pub fn check_following(&self) -> Result<(), Fault> {
        if self.feedback_age() > 0 { Ok(()) } else { self.following.check() }
    }

    /// Has set-points wait for so many cycles before they are sent, for the axes on slower buses.
    pub fn delay_set_points(&mut self, cycles: u32) {
        self.set_points.set_delay(cycles);
    }

    /// Takes the next set-point. In a profile mode there is none: the target stays. Where a torque drives the joint, the
    /// set-point is on it already.
    pub fn advance(&mut self, next: State) {
        if self.torque_loop.is_torque() {
            return;
        }
        let next = if self.is_profile() { self.shown_set_point() } else { next };
        self.set_points.push(next);
    }
}

#[cfg(test)]
mod tests {
    use super::super::AxisParameters;
    use super::super::parameters::tests::parameters;
    use super::*;
    use crate::frame::{Frame, Id};
    use crate::guard::AxisLimits;

    const PERIOD_S: f64 = 1e-3;

    fn enabled(limits: AxisLimits) -> Axis {
        let mut axis = Axis::new(0, AxisParameters { limits, ..parameters() });
        axis.set_cycle(PERIOD_S);
        axis.request_feedback(0);
        axis.receive(0, &Frame::of(Id::canopen(0x180, 5), [0x37, 0x02]), 1).unwrap();
        axis.begin_cycle(PERIOD_S);
        assert!(axis.is_enabled());
        axis
    }

    #[test]
    fn an_axis_that_stops_alone_keeps_its_limits_of_acceleration_and_jerk() {
        let limits = AxisLimits { jerk: 100.0, ..parameters().limits };
        for (direction, acceleration) in [(1.0, 0.0), (1.0, 5.0), (-1.0, 5.0), (-1.0, 0.0)] {
            let mut axis = enabled(limits);
            let start = State { position: 0.1, velocity: direction, acceleration };
            (0..4).for_each(|cycle| axis.advance(start.after(f64::from(cycle - 3) * PERIOD_S)));
            let [newest, last, before] = axis.set_points.positions();
            let mut sent = [newest, last, before];
            for _ in 0..1000 {
                axis.slow_down(PERIOD_S);
                let next = axis.set_point().position;
                let velocities =
                    [next - sent[0], sent[0] - sent[1], sent[1] - sent[2]].map(|way| way / PERIOD_S);
                let accelerations = [velocities[0] - velocities[1], velocities[1] - velocities[2]]
                    .map(|change| change / PERIOD_S);
                let jerk = (accelerations[0] - accelerations[1]) / PERIOD_S;
                assert!(accelerations[0].abs() <= limits.deceleration * (1.0 + 1e-6), "{accelerations:?}");
                assert!(jerk.abs() <= limits.jerk * (1.0 + 1e-4), "{jerk}");
                sent = [next, sent[0], sent[1]];
            }
            assert_eq!(axis.set_point().velocity, 0.0);
        }
    }

    #[test]
    fn a_set_point_that_no_planned_stop_ends_slows_down_within_its_limit_and_stays() {
        let limits = parameters().limits;
        for direction in [1.0, -1.0] {
            let mut axis = enabled(limits);
            let step = direction * limits.velocity * PERIOD_S;
            (0..3).for_each(|cycle| axis.advance(State::rest(f64::from(cycle) * step)));
            let (mut last, mut last_step) = (axis.set_point().position, step);
            for _ in 0..300 {
                axis.slow_down(PERIOD_S);
                let here = axis.set_point().position;
                let acceleration = (here - last - last_step) / (PERIOD_S * PERIOD_S);
                assert!(acceleration.abs() <= limits.deceleration * (1.0 + 1e-6), "{acceleration}");
                (last, last_step) = (here, here - last);
            }
            assert_eq!((last_step, axis.set_point().velocity), (0.0, 0.0));
            let way = direction * limits.velocity * limits.velocity / (2.0 * limits.deceleration);
            assert!((last - 2.0 * step - way).abs() < 2e-3, "{last}");
        }
    }
}
