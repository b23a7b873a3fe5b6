//! The set-points of a stream: its commands where they come and fit, and otherwise the motion that they show.

use super::Axis;
use crate::fault::Fault;
use crate::group_trajectory::stop_limits;
use crate::guard::{StreamCommands, braking_distance, keeps_velocity};
use crate::plan::{self, Limits, Problem, Profile, State};

/// Steps before a set-point in its third difference.
const STEPS_OF_JERK: u8 = 3;
/// See [`Axis::met_within`].
const MET_SHARE: f64 = 1e-3;

/// What an axis knows of the present stream.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StreamFollower {
    commands: StreamCommands,
    following: Following,
}

/// What the set-points of a stream follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Following {
    /// The commands: each is a set-point.
    #[default]
    Commands,
    /// Nothing yet: the first command has not come.
    Awaited,
    /// The motion that the commands show, since one has not come; so many of the last set-points have met their commands again.
    Motion { met: u8 },
}

impl Axis {
    /// A stream is asked for: the set-points so far count as the commands before its first one.
    pub fn begin_stream(&mut self) {
        let commands = StreamCommands::begin(self.set_points.positions());
        self.stream = StreamFollower { commands, following: Following::Commands };
    }

    /// Lets a cycle pass in which the first command of a stream has not come yet. Its owner may have begun to move.
    pub fn await_stream(&mut self) {
        self.stream.commands.pass();
        self.stream.following = Following::Awaited;
    }

    /// Another set-point takes the place of a command: what follows is judged from there.
    pub(super) fn follow_commands(&mut self) {
        self.stream.following = Following::Commands;
    }

    /// The next set-point of a stream, of which a command has come in this cycle or has not. A command that fits the set-points
    /// before it is taken as it is. Where one does not come, the motion of the commands so far is followed in its place, within
    /// all limits; and so is that of the commands after it until one is met, if they keep the limits by themselves.
    ///
    /// # Errors
    /// The limit that the stream breaks.
    pub fn streamed(&mut self, command: Option<&State>, period_s: f64) -> Result<State, Fault> {
        self.stream.commands.pass();
        let Some(command) = command else {
            return self.follow_motion(period_s);
        };
        if command.position.is_finite() {
            self.stream.commands.take(command.position);
        }
        let checked = self.check(command, period_s).and_then(|()| self.check_stream(command, period_s));
        match (checked, self.stream.following) {
            (Ok(()), Following::Commands | Following::Awaited) => {
                self.stream.following = Following::Commands;
                return Ok(self.agreeing(command, period_s));
            }
            (Err(fault), following)
                if following == Following::Commands || matches!(fault, Fault::NotFinite { .. }) =>
            {
                return Err(fault);
            }
            _ => self.stream.commands.check(&self.parameters.limits, period_s)?,
        }
        let met = match self.stream.following {
            Following::Motion { met } => met,
            Following::Commands | Following::Awaited => 0,
        };
        let next = self.follow_motion(period_s)?;
        let distance = (command.position - next.position).abs();
        match checked {
            Ok(()) if distance <= self.met_within(period_s) => {
                self.stream.following = if met < STEPS_OF_JERK {
                    Following::Motion { met: met + 1 }
                } else {
                    Following::Commands
                };
                Ok(State { position: command.position, ..next })
            }
            Err(fault) if distance > self.parameters.start_tolerance => Err(fault),
            _ => Ok(next),
        }
    }

    /// The next set-point on the way to the motion that the commands of a stream show.
    fn follow_motion(&mut self, period_s: f64) -> Result<State, Fault> {
        let limits = &self.parameters.limits;
        let start = match self.stream.following {
            Following::Motion { .. } => self.set_points.newest(),
            Following::Commands | Following::Awaited => self.state_by_steps(period_s),
        };
        let motion = self.stream.commands.motion(period_s, limits);
        // What is planned here is known to its acceleration, and must be possible to stop from that.
        let can_stop = |next: &State| {
            let (position, velocity, acceleration) = (next.position, next.velocity, next.acceleration);
            let highest = position + braking_distance(limits, velocity, acceleration);
            let lowest = position - braking_distance(limits, -velocity, -acceleration);
            highest <= limits.position_max.max(start.position)
                && lowest >= limits.position_min.min(start.position)
                && keeps_velocity(limits, next)
        };
        let is_within = |next: &State| {
            can_stop(next)
                && self.check(next, period_s).and_then(|()| self.check_stream(next, period_s)).is_ok()
        };
        let met = motion.meet(&start, limits, period_s).filter(is_within);
        let next = match met {
            Some(next) => next,
            // It is bound for a limit, and following it as closely as possible would be, too. The planner is told where it is now.
            None => {
                let target = State { acceleration: 0.0, ..motion.after(-period_s).state };
                let problem = Problem { start, target, limits: stop_limits(&start, limits) };
                match problem.track(period_s).ok().filter(is_within) {
                    Some(next) => next,
                    // Whatever was sent before could be stopped within the limits from there.
                    None => stopped(&start, &problem.limits, period_s)?,
                }
            }
        };
        self.stream.following = Following::Motion { met: 0 };
        Ok(next)
    }

    /// How near its command a set-point has to be for the stream to be met: a small share of what the limits of acceleration and
    /// jerk make of a position in a cycle.
    fn met_within(&self, period_s: f64) -> f64 {
        let limits = &self.parameters.limits;
        let steepest = limits.acceleration.max(limits.deceleration);
        MET_SHARE * (limits.jerk * period_s).min(steepest) * period_s * period_s
    }
}

/// The first set-point of the shortest stop.
fn stopped(start: &State, limits: &Limits, period_s: f64) -> Result<State, Fault> {
    let mut stop = [Profile::hold(start.position)];
    match plan::stop(&[*start], &[*limits], &mut stop) {
        Ok(_) => Ok(stop.map(|profile| profile.sample(period_s))[0]),
        Err(_) => Err(Fault::NoTrajectory),
    }
}
