//! Points that somebody streams: of every kind, rate and disorder.

use takt::config::{Axis, Control};
use takt_rt::plan::State;
use takt_rt::{AxisPoint, MAX_AXES, PointRole, StreamPoint};

use crate::dice::Dice;

/// What a point says of an axis beside its position.
#[derive(Clone, Copy, PartialEq)]
enum Words {
    Nothing,
    Velocity,
    All,
    False,
}

/// What the points command of an axis.
#[derive(Clone, Copy)]
enum Kind {
    Position,
    Velocity,
    /// The rest needs a mode that takes a torque.
    FedForward,
    Torque,
    /// A share of the highest stiffness and damping.
    Impedance {
        stiffness: f64,
        damping: f64,
    },
}

impl Kind {
    /// Any that the mode of the axis allows.
    fn any(dice: &mut Dice, axis: &Axis) -> Self {
        let (stiffness, damping) = (dice.between(0.0, 1.0), dice.between(0.0, 1.0));
        match axis.control {
            Control::Torque { .. } => dice.pick(&[
                Self::Position,
                Self::Velocity,
                Self::FedForward,
                Self::Torque,
                Self::Impedance { stiffness, damping },
            ]),
            control if control.is_profile() => Self::Position,
            _ => dice.pick(&[Self::Position, Self::Velocity]),
        }
    }
}

/// Which streams there are.
#[derive(Clone, Copy)]
pub struct StreamVariety {
    /// True if they are led near the limits and beyond, and say what they like of their velocity.
    pub is_wild: bool,
    /// True if they command velocities, torques and impedances too, and not positions alone.
    pub has_every_kind: bool,
}

/// What is wrong with some of the points.
#[derive(Clone, Copy, PartialEq)]
enum Badness {
    None,
    /// The first axis leaps.
    Leap,
    NotFinite,
    /// Meant for a time that is over, or far ahead.
    FarStamp,
    /// Far too many at once.
    Flood,
}

/// A stream under way.
pub struct ClientStream {
    dice: Dice,
    /// The axes of the group.
    axes: Vec<Axis>,
    begun_ns: u64,
    begun: Vec<f64>,
    /// The next point is meant for so long after the beginning, in seconds.
    next_s: f64,
    interval_s: f64,
    end_s: f64,
    /// The share of the limits of velocity and acceleration to which it goes.
    share: f64,
    words: Words,
    /// Of each axis.
    kinds: Vec<Kind>,
    /// How likely an axis is commanded otherwise from the next point on.
    change: f64,
    badness: Badness,
    /// Of an interval: how unevenly the points are meant, and how unevenly they come.
    stamp_jitter: f64,
    jitter: f64,
    latency_s: f64,
    loss: f64,
    /// Points that come together, each lot in place of the future of the one before; 1 where they come one by one.
    chunk: usize,
    /// When they come, and what.
    on_way: Vec<(u64, StreamPoint)>,
}

impl ClientStream {
    /// One from now on and from where the axes of the group are.
    pub fn new(
        mut dice: Dice,
        axes: Vec<Axis>,
        period_s: f64,
        (begun_ns, mut begun): (u64, Vec<f64>),
        StreamVariety { is_wild, has_every_kind }: StreamVariety,
    ) -> Self {
        if dice.chance(0.1) {
            // They have to be led there.
            let limits = &axes[0].limits;
            begun[0] = dice.between(limits.position_min, limits.position_max);
        }
        let is_chunked = dice.chance(0.3);
        let mut stream = Self {
            begun_ns,
            begun,
            next_s: 0.0,
            interval_s: match dice.below(4) {
                0 => period_s,
                1 => dice.between(1.0, 10.0) * period_s,
                2 => dice.between(0.01, 0.05),
                _ => dice.between(0.03, 0.2),
            },
            end_s: dice.between(0.01, 2.0),
            share: if is_wild { dice.pick(&[0.7, 0.98, 1.5, 5.0]) } else { dice.pick(&[0.1, 0.3, 0.7]) },
            words: dice.pick(&[Words::Nothing, Words::Velocity, Words::All, Words::False]),
            badness: dice.pick(&[
                Badness::None,
                Badness::None,
                Badness::None,
                Badness::Leap,
                Badness::NotFinite,
                Badness::FarStamp,
                Badness::Flood,
            ]),
            stamp_jitter: dice.pick(&[0.0, 0.0, 0.1, 0.5, 3.0]),
            jitter: dice.pick(&[0.0, 0.1, 0.5, 3.0]),
            latency_s: dice.pick(&[0.0, 0.0, 0.002, 0.05, 0.3]),
            loss: dice.pick(&[0.0, 0.0, 0.05, 0.3]),
            chunk: if is_chunked { 2 + dice.below(40) } else { 1 },
            on_way: vec![],
            kinds: vec![Kind::Position; axes.len()],
            change: 0.0,
            axes,
            dice,
        };
        if has_every_kind {
            stream.kinds = stream.axes.iter().map(|axis| Kind::any(&mut stream.dice, axis)).collect();
            stream.change = stream.dice.pick(&[0.0, 0.0, 0.01, 0.2]);
        }
        stream
    }

    /// The points that have come up to this time.
    pub fn points(&mut self, now_ns: u64) -> Vec<StreamPoint> {
        while self.next_s <= now_ns.saturating_sub(self.begun_ns) as f64 * 1e-9 && self.next_s < self.end_s {
            self.send();
        }
        let mut come = vec![];
        self.on_way.retain(|(at_ns, point)| {
            if *at_ns <= now_ns {
                come.push(*point);
            }
            *at_ns > now_ns
        });
        come
    }

    /// Sends the next point, or the next chunk.
    fn send(&mut self) {
        let from_s = self.next_s;
        let late_s = self.latency_s + self.dice.between(0.0, 1.0) * self.jitter * self.interval_s;
        let arrives_ns = self.time_ns(from_s + late_s);
        let count = if self.badness == Badness::Flood && self.dice.chance(0.05) { 200 } else { self.chunk };
        for number in 0..count {
            let meant_s = from_s + number as f64 * self.interval_s;
            let uneven_s = self.dice.between(-1.0, 1.0) * self.stamp_jitter * self.interval_s;
            if self.dice.chance(self.loss) {
                continue;
            }
            if self.change > 0.0 && self.dice.chance(self.change) {
                let index = self.dice.below(self.axes.len());
                self.kinds[index] = Kind::any(&mut self.dice, &self.axes[index]);
            }
            let stamp_s = if self.chunk == 1 { meant_s + uneven_s } else { meant_s };
            let role = match self.chunk {
                1 => PointRole::Single,
                _ => PointRole::Chunk { is_first: number == 0, is_last: number + 1 == count },
            };
            let mut point = StreamPoint { at_ns: self.time_ns(stamp_s), role, axes: self.axes(meant_s) };
            if self.dice.chance(0.02) {
                self.spoil(&mut point);
            }
            self.on_way.push((arrives_ns, point));
        }
        // A chunk goes on beyond the beginning of the next one.
        let overlap = if self.chunk == 1 { 1.0 } else { self.dice.between(0.3, 1.2) };
        self.next_s += self.interval_s * (self.chunk as f64 * overlap).max(1.0);
    }

    fn time_ns(&self, time_s: f64) -> u64 {
        self.begun_ns.saturating_add_signed((time_s * 1e9) as i64)
    }

    /// A swing to and fro from where the axes were.
    fn axes(&self, time_s: f64) -> [AxisPoint; MAX_AXES] {
        let mut axes = [AxisPoint::default(); MAX_AXES];
        for (index, axis) in self.axes.iter().enumerate() {
            let limits = &axis.limits;
            let highest = limits.acceleration.min(limits.deceleration);
            // At both limits in turn, with a share of 1.
            let (way, rate) =
                (self.share * limits.velocity * limits.velocity / highest, highest / limits.velocity);
            // Eases in with no velocity, no acceleration and little jerk.
            let ease = (time_s / 0.5).clamp(0.0, 1.0);
            let ease = ease * ease * ease * (10.0 + ease * (6.0 * ease - 15.0));
            let phase = rate * time_s;
            let position = self.begun[index] + way * ease * (1.0 - phase.cos());
            let velocity = way * ease * rate * phase.sin();
            let acceleration = way * ease * rate * rate * phase.cos();
            let point = match self.words {
                Words::Nothing => AxisPoint::position(position),
                Words::Velocity => AxisPoint::moving(position, velocity),
                Words::All => AxisPoint::from(State { position, velocity, acceleration }),
                Words::False => AxisPoint::from(State {
                    position,
                    velocity: -3.0 * velocity,
                    acceleration: 1e3 * velocity,
                }),
            };
            let torque = 0.2 * self.share.min(1.0) * limits.torque * ease * phase.sin();
            axes[index] = match self.kinds[index] {
                Kind::Position => point,
                Kind::Velocity => AxisPoint::Velocity(velocity),
                Kind::FedForward => point.with_torque(torque),
                Kind::Torque => AxisPoint::Torque(torque),
                Kind::Impedance { stiffness, damping } => {
                    let most = &axis.compliance;
                    let (stiffness, damping) = (stiffness * most.stiffness_max, damping * most.damping_max);
                    point.with_impedance(stiffness, damping).with_torque(torque)
                }
            };
        }
        axes
    }

    fn spoil(&mut self, point: &mut StreamPoint) {
        match self.badness {
            Badness::None | Badness::Flood => {}
            Badness::Leap => {
                let leap = self.dice.between(-1.0, 1.0);
                if let AxisPoint::Position { motion, .. } = &mut point.axes[0] {
                    motion.position += leap;
                }
            }
            Badness::NotFinite => point.axes[0] = f64::NAN.into(),
            Badness::FarStamp => point.at_ns = self.dice.pick(&[0, 1, u64::MAX, u64::MAX / 2]),
        }
    }
}
