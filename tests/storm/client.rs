//! Somebody who asks the group for anything at any time.

use takt::config::{Config, Control};
use takt_rt::{
    MAX_AXES, Move, Phase, ProfileMove, ProfileTarget, Request, Snapshot, StopCategory, StreamPoint,
};

use crate::client_stream::ClientStream;
use crate::dice::Dice;

/// What has been asked of the group up to a cycle, as far as invariants depend on it.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecentRequests {
    /// A reset of faults that somebody has asked for was granted in this cycle.
    pub has_reset: bool,
    /// The same, not long ago.
    pub has_reset_lately: bool,
}

/// The most requests in one cycle: more than the host interface holds.
const REQUESTS_AT_MOST: usize = 24;

/// What the client wants in a cycle.
#[derive(Default)]
pub struct Wishes {
    pub requests: Vec<Request>,
    pub points: Vec<StreamPoint>,
    /// How much too late the next wake-up is.
    pub late_ns: u64,
}

pub struct Client {
    dice: Dice,
    restlessness: f64,
    stream: Option<ClientStream>,
    are_streams_wild: bool,
}

impl Client {
    pub fn new(mut dice: Dice, are_streams_wild: bool) -> Self {
        let restlessness = dice.pick(&[0.002, 0.01, 0.05, 0.2]);
        Self { dice, restlessness, stream: None, are_streams_wild }
    }

    /// What it wants after a cycle.
    pub fn wishes(&mut self, config: &Config, snapshot: &Snapshot) -> Wishes {
        let points =
            self.stream.as_mut().map_or_else(Vec::new, |stream| stream.points(config, snapshot.at_ns));
        let mut wishes = Wishes { points, ..Wishes::default() };
        if !self.dice.chance(self.restlessness) {
            return wishes;
        }
        if self.dice.chance(0.05) {
            wishes.late_ns = (self.dice.between(0.1, 12.0) * config.cycle.period_ns as f64) as u64;
            return wishes;
        }
        let requests = if self.dice.chance(0.01) { REQUESTS_AT_MOST } else { 1 };
        for _ in 0..requests {
            let request = self.request(config, snapshot);
            wishes.requests.push(request);
        }
        wishes
    }

    fn request(&mut self, config: &Config, snapshot: &Snapshot) -> Request {
        // Whoever finds the group stopped and disabled mostly wants it back, though not always in the right order.
        if snapshot.phase == Phase::Disabled && self.dice.chance(0.8) {
            return if self.dice.chance(0.5) { Request::Enable } else { Request::ResetFaults };
        }
        match self.dice.below(24) {
            0 => Request::Stop(self.dice.pick(&[StopCategory::Two, StopCategory::One, StopCategory::Zero])),
            1 => Request::Stop(StopCategory::Two),
            2 => Request::Disable,
            3 => Request::Enable,
            4..=5 => Request::ResetFaults,
            6 => Request::Activate,
            7..=11 => {
                self.begin_stream(config, snapshot);
                Request::Stream
            }
            12..=14 => self.profile_target(config, snapshot),
            _ => self.random_move(config),
        }
    }

    fn scale(&mut self) -> f64 {
        if self.dice.chance(0.03) {
            self.dice.pick(&[0.0, -1.0, 2.0, f64::NAN])
        } else {
            self.dice.between(0.05, 1.0)
        }
    }

    fn random_move(&mut self, config: &Config) -> Request {
        let (mut target, mut target_velocity) = ([0.0; MAX_AXES], [0.0; MAX_AXES]);
        let is_passing = self.dice.chance(0.1);
        for (index, axis) in config.axes.iter().enumerate() {
            let (low, high) = (axis.limits.position_min, axis.limits.position_max);
            target[index] = self.dice.between(low, high);
            if is_passing {
                target_velocity[index] = self.dice.between(-1.0, 1.0) * axis.limits.velocity;
            }
        }
        if self.dice.chance(0.05) {
            target[0] = self.dice.pick(&[f64::NAN, f64::INFINITY, 1e9, -1e9]);
        }
        let minimum_duration_s = if self.dice.chance(0.1) { self.dice.between(0.0, 2.0) } else { 0.0 };
        let (velocity_scale, acceleration_scale) = (self.scale(), self.scale());
        Request::Move(Move {
            target,
            target_velocity,
            velocity_scale,
            acceleration_scale,
            minimum_duration_s,
        })
    }

    fn profile_target(&mut self, config: &Config, snapshot: &Snapshot) -> Request {
        let axis = self.dice.below(config.axes.len());
        let limits = &config.axes[axis].limits;
        let share = self.dice.between(-1.1, 1.1);
        let fitting = match config.axes[axis].control {
            Control::ProfileVelocity => 1,
            Control::ProfileTorque => 2,
            _ => 0,
        };
        let kind = if self.dice.chance(0.8) { fitting } else { self.dice.below(3) };
        let target = match kind {
            0 => ProfileTarget::Position(self.dice.between(limits.position_min, limits.position_max)),
            1 => ProfileTarget::Velocity(share * limits.velocity),
            _ => ProfileTarget::Torque(share * limits.torque * 0.2),
        };
        let valid_until_ns = snapshot.at_ns + self.dice.below(2_000_000_000) as u64;
        Request::SetProfileTarget(ProfileMove { axis: axis as u8, target, valid_until_ns })
    }

    fn begin_stream(&mut self, config: &Config, snapshot: &Snapshot) {
        let positions: Vec<f64> =
            snapshot.axes[..config.axes.len()].iter().map(|axis| axis.position_set).collect();
        let dice = self.dice.split(snapshot.slot);
        self.stream =
            Some(ClientStream::new(dice, config, snapshot.at_ns, &positions, self.are_streams_wild));
    }
}

/// Whether the group can be asked for something beside a program: nothing has stopped it by itself.
pub fn is_open(snapshot: &Snapshot) -> bool {
    let has_own_stop = snapshot.stop.is_some_and(|stop| stop.rule() != takt_rt::Rule::Requested);
    snapshot.phase != Phase::Passive && !has_own_stop
}
