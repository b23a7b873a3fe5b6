//! Somebody who asks the group for anything at any time.

use takt::config::{Config, Control};
use takt_rt::plan::State;
use takt_rt::{
    MAX_AXES, Move, Phase, ProfileMove, ProfileTarget, Request, Snapshot, StopCategory, StreamCommand,
};

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
    pub stream: Option<StreamCommand>,
    /// How much too late the next wake-up is.
    pub late_ns: u64,
}

/// A stream under way.
#[derive(Clone, Copy)]
struct Stream {
    cycles_left: usize,
    begun: [f64; MAX_AXES],
    elapsed_s: f64,
    swing: f64,
    badness: Badness,
    wildness: Option<Wildness>,
}

/// What makes a stream harder to follow.
#[derive(Clone, Copy)]
struct Wildness {
    /// The share of the limits of velocity and acceleration to which it goes.
    share: f64,
    words: Words,
    /// How likely it is that commands stay away from a cycle on, and for how many cycles.
    absence: f64,
    absent_cycles: usize,
    /// So many are still to stay away.
    absent: usize,
}

/// What a stream says of its velocity and acceleration.
#[derive(Clone, Copy, PartialEq)]
enum Words {
    True,
    Velocity,
    Nothing,
    False,
}

#[derive(Clone, Copy, PartialEq)]
enum Badness {
    None,
    Leap,
    NotFinite,
    Fast,
    /// Some commands do not come.
    Patchy,
    /// They come when they have expired.
    Stale,
}

pub struct Client {
    dice: Dice,
    restlessness: f64,
    stream: Option<Stream>,
    are_streams_wild: bool,
}

impl Client {
    pub fn new(mut dice: Dice, are_streams_wild: bool) -> Self {
        let restlessness = dice.pick(&[0.002, 0.01, 0.05, 0.2]);
        Self { dice, restlessness, stream: None, are_streams_wild }
    }

    /// What it wants after a cycle.
    pub fn wishes(&mut self, config: &Config, snapshot: &Snapshot) -> Wishes {
        let mut wishes = Wishes { stream: self.streamed(config, snapshot), ..Wishes::default() };
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
        let mut begun = [0.0; MAX_AXES];
        for (begun, axis) in begun.iter_mut().zip(&snapshot.axes[..config.axes.len()]) {
            *begun = axis.position_set;
        }
        if self.dice.chance(0.05) {
            begun[0] += 1.0;
        }
        let badness = self.dice.pick(&[
            Badness::None,
            Badness::None,
            Badness::None,
            Badness::Leap,
            Badness::NotFinite,
            Badness::Fast,
            Badness::Patchy,
            Badness::Stale,
        ]);
        let (cycles_left, swing) = (1 + self.dice.below(1000), self.dice.between(-0.5, 0.5));
        let wildness = self.are_streams_wild.then(|| self.wildness());
        self.stream = Some(Stream { cycles_left, begun, elapsed_s: 0.0, swing, badness, wildness });
    }

    fn wildness(&mut self) -> Wildness {
        Wildness {
            share: self.dice.pick(&[0.3, 0.7, 0.9, 0.98]),
            words: self.dice.pick(&[Words::True, Words::Velocity, Words::Nothing, Words::False]),
            absence: self.dice.pick(&[0.0, 0.01, 0.1, 0.3]),
            absent_cycles: self.dice.pick(&[1, 1, 2, 5, 20]),
            absent: 0,
        }
    }

    /// A swing to and fro from where the axes were, well within their limits as long as it is a good one.
    fn streamed(&mut self, config: &Config, snapshot: &Snapshot) -> Option<StreamCommand> {
        let stream = self.stream.as_mut()?;
        let period_s = config.cycle.period_ns as f64 * 1e-9;
        stream.elapsed_s += period_s;
        stream.cycles_left = stream.cycles_left.saturating_sub(1);
        let is_last = stream.cycles_left == 0;
        let rate = if stream.badness == Badness::Fast { 12.0 } else { 3.0 };
        let mut set_points = [State::default(); MAX_AXES];
        for (index, axis) in config.axes.iter().enumerate() {
            let limits = &axis.limits;
            let (amplitude, rate) = match stream.wildness {
                // At both limits in turn.
                Some(Wildness { share, .. }) => {
                    let highest = limits.acceleration.min(limits.deceleration);
                    let way = share * limits.velocity * limits.velocity / highest;
                    (way.copysign(stream.swing), highest / limits.velocity)
                }
                None => (stream.swing * limits.velocity.min(limits.acceleration) / 6.0, rate),
            };
            // Eases in with no velocity, no acceleration and little jerk.
            let ease = (stream.elapsed_s / 0.5).min(1.0);
            let ease = ease * ease * ease * (10.0 + ease * (6.0 * ease - 15.0));
            let phase = rate * stream.elapsed_s;
            let position = stream.begun[index] + amplitude * ease * (1.0 - phase.cos());
            let velocity = amplitude * ease * rate * phase.sin();
            let acceleration = amplitude * ease * rate * rate * phase.cos();
            set_points[index] = match stream.wildness.map(|wild| wild.words) {
                Some(Words::True) => State { position, velocity, acceleration },
                Some(Words::Nothing) => State { position, ..State::default() },
                Some(Words::False) => {
                    State { position, velocity: -3.0 * velocity, acceleration: 1e3 * velocity }
                }
                Some(Words::Velocity) | None => State { position, velocity, acceleration: 0.0 },
            };
        }
        if is_last {
            match stream.badness {
                Badness::Leap => set_points[0].position += 0.5,
                Badness::NotFinite => set_points[0].position = f64::NAN,
                Badness::None | Badness::Fast | Badness::Patchy | Badness::Stale => {}
            }
        }
        let mut is_left_out = stream.badness == Badness::Patchy && self.dice.chance(0.2);
        if let Some(wild) = &mut stream.wildness {
            if wild.absent == 0 && self.dice.chance(wild.absence) {
                wild.absent = 1 + self.dice.below(wild.absent_cycles);
            }
            is_left_out |= wild.absent > 0;
            wild.absent = wild.absent.saturating_sub(1);
        }
        let is_stale = stream.badness == Badness::Stale && is_last;
        let at_ns = if is_stale { 0 } else { snapshot.at_ns };
        let valid_until_ns = at_ns + self.dice.between(0.5, 30.0) as u64 * config.cycle.period_ns;
        if is_last {
            self.stream = None;
        }
        (!is_left_out).then_some(StreamCommand { valid_until_ns, set_points })
    }
}

/// Whether the group can be asked for something beside a program: nothing has stopped it by itself.
pub fn is_open(snapshot: &Snapshot) -> bool {
    let has_own_stop = snapshot.stop.is_some_and(|stop| stop.rule() != takt_rt::Rule::Requested);
    snapshot.phase != Phase::Passive && !has_own_stop
}
