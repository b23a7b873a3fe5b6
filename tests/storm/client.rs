//! Somebody who asks the groups for anything at any time.

use takt::config::{Config, Control};
use takt_rt::{
    GroupSnapshot, MAX_AXES, MAX_GROUPS, Move, Phase, ProfileMove, ProfileTarget, Request, RequestTarget,
    Snapshot, StopCategory, StreamPoint,
};

use crate::client_stream::{ClientStream, StreamVariety};
use crate::dice::Dice;

/// What has been asked of a group up to a cycle, as far as invariants depend on it.
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
    pub requests: Vec<(RequestTarget, Request)>,
    /// Each for the stream of a group.
    pub points: Vec<(u8, StreamPoint)>,
    /// How much too late the next wake-up is.
    pub late_ns: u64,
}

pub struct Client {
    dice: Dice,
    restlessness: f64,
    /// The last stream of each group.
    streams: [Option<ClientStream>; MAX_GROUPS],
    variety: StreamVariety,
}

impl Client {
    pub fn new(mut dice: Dice, variety: StreamVariety) -> Self {
        let restlessness = dice.pick(&[0.002, 0.01, 0.05, 0.2]);
        Self { dice, restlessness, streams: Default::default(), variety }
    }

    /// What it wants after a cycle.
    pub fn wishes(&mut self, config: &Config, snapshot: &Snapshot) -> Wishes {
        let mut points = vec![];
        for (group, stream) in (0..).zip(&mut self.streams) {
            let come = stream.iter_mut().flat_map(|stream| stream.points(snapshot.at_ns));
            points.extend(come.map(|point| (group, point)));
        }
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

    /// For one of the groups, mostly; some do not say for which one, or are wrong about it.
    fn request(&mut self, config: &Config, snapshot: &Snapshot) -> (RequestTarget, Request) {
        if config.groups.len() < 2 {
            return (RequestTarget::All, self.request_of(config, snapshot, 0));
        }
        let group = self.dice.below(config.groups.len());
        let target = match self.dice.below(64) {
            0 => RequestTarget::Group(self.dice.below(MAX_GROUPS) as u8),
            1..=6 => RequestTarget::All,
            _ => RequestTarget::Group(group as u8),
        };
        (target, self.request_of(config, snapshot, group))
    }

    fn request_of(&mut self, config: &Config, snapshot: &Snapshot, group: usize) -> Request {
        // Whoever finds the group stopped and disabled mostly wants it back, though not always in the right order.
        if snapshot.groups()[group].phase == Phase::Disabled && self.dice.chance(0.8) {
            return match self.dice.fraction() {
                0.0..0.49 => Request::Enable,
                0.49..0.5 => Request::BringUp,
                _ => Request::ResetFaults,
            };
        }
        match self.dice.below(24) {
            0 => Request::Stop(self.dice.pick(&[StopCategory::Two, StopCategory::One, StopCategory::Zero])),
            1 => Request::Stop(StopCategory::Two),
            2 => Request::Disable,
            3 => Request::Enable,
            4..=5 => Request::ResetFaults,
            // It is for whoever brings the drives up: a client has no such call.
            6 if snapshot.groups()[group].phase == Phase::Passive => Request::Enable,
            6 => Request::Activate,
            7..=11 => {
                self.begin_stream(config, snapshot, group);
                Request::Stream
            }
            12..=14 => self.profile_target(config, snapshot, group),
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

    fn profile_target(&mut self, config: &Config, snapshot: &Snapshot, group: usize) -> Request {
        let axes = config.axes_of_group(group);
        let axis = axes[self.dice.below(axes.len())];
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

    fn begin_stream(&mut self, config: &Config, snapshot: &Snapshot, group: usize) {
        let dice = self.dice.split(snapshot.slot);
        let numbers = config.axes_of_group(group);
        let positions = numbers.iter().map(|axis| snapshot.axes[*axis].position_set).collect();
        let axes = numbers.iter().map(|axis| config.axes[*axis].clone()).collect();
        let period_s = config.cycle.period_ns as f64 * 1e-9;
        let begun = (snapshot.at_ns, positions);
        self.streams[group] = Some(ClientStream::new(dice, axes, period_s, begun, self.variety));
    }
}

/// Returns `true` if the groups can be asked for something beside a program: nothing has stopped one by itself.
pub fn are_open(snapshot: &Snapshot) -> bool {
    let is_open = |group: &GroupSnapshot| {
        let has_own_stop = group.stop.is_some_and(|stop| stop.rule() != takt_rt::Rule::Requested);
        group.phase != Phase::Passive && !has_own_stop
    };
    snapshot.groups().iter().all(is_open)
}
