//! Somebody who has checked trajectories carried out: other ones in their place, faster and slower ones, paused ones; and some that begin
//! elsewhere, or too late.

use std::sync::Arc;

use takt::VirtualRun;
use takt::channels::{GivenTrajectory, GroupAxes};
use takt::config::{Axis, Config};
use takt::link::trace::TracedPort;
use takt::trajectory::{Trajectory, TrajectoryConditions, TrajectoryPoint};
use takt_rt::plan::State;
use takt_rt::{
    Answer, AxisLimits, ExecutionStart, MAX_GROUPS, MotionState, Phase, Request, RequestId, RequestTarget,
    Snapshot, TrajectoryId,
};

use crate::dice::Dice;
use crate::tap::Tap;

/// The next one begins at most so many cycles later.
const LEAD_CYCLES: usize = 30;

/// The newest trajectory of a group.
struct Present {
    motion: RequestId,
    id: TrajectoryId,
    given: Arc<GivenTrajectory>,
}

pub struct TrajectoryClient {
    dice: Dice,
    present: [Option<Present>; MAX_GROUPS],
    /// Requests whose grant has still to be seen, and how many were granted.
    awaited: Vec<RequestId>,
    pub begun: u64,
}

impl TrajectoryClient {
    pub fn new(dice: Dice) -> Self {
        Self { dice, present: Default::default(), awaited: vec![], begun: 0 }
    }

    /// Asks for a trajectory now and then, mostly when it can begin.
    pub fn act(&mut self, config: &Config, snapshot: &Snapshot, run: &mut VirtualRun<TracedPort<Tap>>) {
        let answers = &snapshot.answers;
        self.begun +=
            self.awaited.iter().filter(|request| answers.of(**request) == Answer::Granted).count() as u64;
        self.awaited
            .retain(|request| answers.of(*request) == Answer::None && !answers.have_forgotten(*request));
        let group = self.dice.below(snapshot.groups().len());
        let chance = match snapshot.groups()[group].phase {
            Phase::Holding => 0.1,
            Phase::Moving => 0.02,
            _ => 0.001,
        };
        if !self.dice.chance(chance) {
            return;
        }
        let numbers = config.axes_of_group(group);
        let axes: Vec<&Axis> = numbers.iter().map(|axis| &config.axes[*axis]).collect();
        let period_s = config.cycle.period_ns as f64 / 1e9;
        let is_under_way =
            |present: &&Present| snapshot.motions.of(present.motion) == Some(MotionState::InProgress);
        let made = match self.present[group].as_ref().filter(is_under_way) {
            Some(present) => follow_on(&mut self.dice, &axes, period_s, present),
            None => {
                let start: Vec<State> =
                    numbers.iter().map(|axis| State::rest(snapshot.axes[*axis].position_set)).collect();
                random(&mut self.dice, &axes, period_s, start).map(|made| (made, ExecutionStart::Now))
            }
        };
        // One that does not keep the limits is not handed over.
        let Some((trajectory, start)) = made else { return };
        let given = Arc::new(GivenTrajectory::new(trajectory, GroupAxes::new(numbers)));
        let giver = run.host().trajectories();
        let Some(id) = giver.give(group as u8, &given) else { return };
        let request = Request::Execute { trajectory: id, start };
        match run.host().request_of(RequestTarget::Group(group as u8), request) {
            Ok(request) => {
                self.awaited.push(request);
                let is_same = matches!(start, ExecutionStart::After { is_same_motion: true, .. });
                let present = self.present[group].take().filter(|_| is_same);
                let motion = present.map_or(request, |present| present.motion);
                self.present[group] = Some(Present { motion, id, given });
            }
            Err(_) => giver.take_back(id),
        }
    }
}

/// What takes the place of a trajectory under way: the same one at another rate, or another one.
fn follow_on(
    dice: &mut Dice,
    axes: &[&Axis],
    period_s: f64,
    present: &Present,
) -> Option<(Trajectory, ExecutionStart)> {
    let cycles = (present.given.at_s() / period_s).round() + dice.below(LEAD_CYCLES) as f64;
    let (of, at_s) = (present.given.trajectory(), cycles * period_s);
    let is_same_motion = dice.chance(0.6);
    let made = if is_same_motion {
        let rate = dice.pick(&[0.0, 0.3, 0.7, 1.0, 1.3]);
        of.at_rate(at_s, rate, &limits_of(axes)).ok()
    } else {
        let states = of.sample(at_s).states;
        random(dice, axes, period_s, states[..axes.len()].to_vec())
    };
    let start = ExecutionStart::After { trajectory: present.id, cycles: cycles as u64, is_same_motion };
    made.map(|made| (made, start))
}

/// One through a few points near and far, in about the time that the limits need, or less. A drive in a profile mode stays where it is.
fn random(dice: &mut Dice, axes: &[&Axis], period_s: f64, mut start: Vec<State>) -> Option<Trajectory> {
    let limits = limits_of(axes);
    if dice.chance(0.05) {
        // Nobody is there.
        start[0].position += dice.between(-0.01, 0.01);
    }
    let mut positions: Vec<f64> = start.iter().map(|state| state.position).collect();
    let (mut time_s, mut points) = (0.0, vec![]);
    let share = dice.pick(&[0.02, 0.1, 0.5]);
    for _ in 0..1 + dice.below(5) {
        let mut needed_s: f64 = 0.05;
        for ((position, axis), limits) in positions.iter_mut().zip(axes).zip(&limits) {
            if axis.control.is_profile() {
                continue;
            }
            let way = share * (dice.between(limits.position_min, limits.position_max) - *position);
            *position += way;
            needed_s = needed_s.max(needed_for(way.abs(), limits));
        }
        time_s += needed_s * dice.between(0.7, 2.0);
        points.push(TrajectoryPoint { time_s, positions: positions.clone(), ..TrajectoryPoint::default() });
    }
    Trajectory::new(&points, &TrajectoryConditions { start: &start, limits: &limits, period_s }).ok()
}

/// For a polynomial of the fifth degree from rest to rest.
fn needed_for(way: f64, limits: &AxisLimits) -> f64 {
    let acceleration = limits.acceleration.min(limits.deceleration);
    (1.9 * way / limits.velocity)
        .max((5.8 * way / acceleration).sqrt())
        .max((60.0 * way / limits.jerk).cbrt())
}

fn limits_of(axes: &[&Axis]) -> Vec<AxisLimits> {
    axes.iter().map(|axis| axis.limits).collect()
}
