//! The mechanics of one joint: inertia, friction, brake, end stops and encoder, in SI units. A linear axis has metres
//! and newtons instead of radians and newton metres.

/// Dependence of the Coulomb friction of a simulated joint on its speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionShape {
    /// It does not: it is the same at rest and in motion.
    #[default]
    Constant,
    /// As measured on a joint with a harmonic drive: little of it at rest, from where it rises steeply to the whole at about 0.8 rad/s.
    HarmonicDrive,
}

/// The parameters of a joint, at the output side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointParameters {
    /// Inertia of rotor and load: kg·m² (kg).
    pub inertia: f64,
    /// Viscous friction: N·m·s/rad (N·s/m).
    pub viscous_friction: f64,
    /// Coulomb friction: N·m (N), as it is at speed.
    pub coulomb_friction: f64,
    /// How much of it there is at low speed.
    pub friction_shape: FrictionShape,
    /// Friction of the engaged brake: N·m (N).
    pub brake_torque: f64,
}

/// Speeds of the output (rad/s), and the share of Coulomb friction there, of a joint with a harmonic drive. The currents measured on an
/// eRob 70H, ratio 100 (0.1 r/min 50 mA, 0.72 160, 7.25 245, 26.1 316), less the viscous part that the last two of them have: 36 mA for
/// 1 rad/s.
const HARMONIC_DRIVE: [(f64, f64); 3] = [(0.0105, 0.228), (0.0754, 0.723), (0.759, 1.0)];

/// The share of Coulomb friction at a speed (rad/s), from 0 to 1. At rest it is that of the lowest measured speed.
fn coulomb_share(shape: FrictionShape, speed: f64) -> f64 {
    let [first @ (slowest, at_rest), second, last] = match shape {
        FrictionShape::Constant => return 1.0,
        FrictionShape::HarmonicDrive => HARMONIC_DRIVE,
    };
    let between = |(from, low): (f64, f64), (to, high): (f64, f64)| {
        low + (high - low) * ((speed - from) / (to - from)).min(1.0)
    };
    match speed {
        _ if speed <= slowest => at_rest,
        _ if speed <= second.0 => between(first, second),
        _ => between(second, last),
    }
}

/// The mechanical end stops of the travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndStops {
    /// rad (m)
    pub lowest: f64,
    /// rad (m)
    pub highest: f64,
}

/// How gravity loads a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Gravity {
    /// Not at all.
    #[default]
    None,
    /// As a pendulum that hangs at 0: by this torque (N·m) a quarter turn from there.
    Pendulum(f64),
    /// By this force (N) against the direction of the axis, everywhere.
    Weight(f64),
}

impl Gravity {
    fn torque(self, position: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Pendulum(torque) => -torque * position.sin(),
            Self::Weight(force) => -force,
        }
    }
}

/// The mechanical state of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    parameters: JointParameters,
    position: f64,
    velocity: f64,
    /// External torque: contact.
    load_torque: f64,
    gravity: Gravity,
    /// A position, and the torque of gravity there: a joint is often where it was.
    weight: (f64, f64),
    stops: Option<EndStops>,
}

impl Joint {
    /// A joint at rest.
    pub fn new(parameters: JointParameters, position: f64) -> Self {
        Self {
            parameters,
            position,
            velocity: 0.0,
            load_torque: 0.0,
            gravity: Gravity::None,
            weight: (position, 0.0),
            stops: None,
        }
    }

    /// The same joint with end stops, which stop it without rebound.
    pub fn between(self, stops: Option<EndStops>) -> Self {
        Self { stops, ..self }
    }

    /// Position in rad (m).
    pub fn position(&self) -> f64 {
        self.position
    }

    /// Velocity in rad/s (m/s).
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Sets the external torque (N·m, N), which lasts until it is set again.
    pub fn set_load_torque(&mut self, torque: f64) {
        self.load_torque = torque;
    }

    /// From now on gravity loads the joint so.
    pub fn set_gravity(&mut self, gravity: Gravity) {
        self.gravity = gravity;
        self.weight = (self.position, gravity.torque(self.position));
    }

    /// The torque of gravity where the joint is.
    #[inline]
    fn gravity_torque(&mut self) -> f64 {
        if self.weight.0 != self.position {
            self.weight = (self.position, self.gravity.torque(self.position));
        }
        self.weight.1
    }

    /// Stops at once, like a joint that hits an obstacle.
    pub fn halt(&mut self) {
        self.velocity = 0.0;
    }

    /// Advances by `duration_s` under a constant motor torque.
    ///
    /// Coulomb friction is exact: a step in which the velocity would change its sign is split at standstill, and the
    /// joint stays there while the friction can hold it. So it neither creeps nor chatters. Viscous friction is
    /// integrated implicitly, which is stable for any coefficient.
    #[inline]
    pub fn step(&mut self, duration_s: f64, motor_torque: f64, is_braked: bool) {
        let brake = if is_braked { self.parameters.brake_torque } else { 0.0 };
        let friction = self.coulomb_friction() + brake;
        let torque = motor_torque + self.load_torque + self.gravity_torque();
        let mut left_s = duration_s;
        if self.velocity != 0.0 {
            let ended = self.accelerated(torque - friction.copysign(self.velocity), left_s);
            if ended * self.velocity > 0.0 {
                self.travel(ended, left_s);
                return;
            }
            let stopping_s = left_s * self.velocity / (self.velocity - ended);
            self.travel(0.0, stopping_s);
            left_s -= stopping_s;
        }
        let friction = self.coulomb_friction() + brake;
        if torque.abs() > friction {
            let ended = self.accelerated(torque - friction.copysign(torque), left_s);
            self.travel(ended, left_s);
        }
    }

    /// Coulomb friction at the present speed: N·m (N).
    fn coulomb_friction(&self) -> f64 {
        let JointParameters { coulomb_friction, friction_shape, .. } = self.parameters;
        coulomb_friction * coulomb_share(friction_shape, self.velocity.abs())
    }

    /// The velocity after `duration_s` under a constant torque and viscous friction.
    fn accelerated(&self, torque: f64, duration_s: f64) -> f64 {
        let JointParameters { inertia, viscous_friction, .. } = self.parameters;
        (inertia * self.velocity + torque * duration_s) / (inertia + viscous_friction * duration_s)
    }

    fn travel(&mut self, ended: f64, duration_s: f64) {
        self.position += 0.5 * (self.velocity + ended) * duration_s;
        self.velocity = ended;
        if let Some(EndStops { lowest, highest }) = self.stops {
            let within = self.position.min(highest).max(lowest);
            if within != self.position {
                self.position = within;
                self.velocity = 0.0;
            }
        }
    }
}

/// The encoder of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Counts per rad (m); negative when the count decreases with the position.
    pub counts_per_unit: f64,
    /// The count at position zero.
    pub zero_counts: f64,
}

impl Encoder {
    /// The count at a position, wrapped to the 32 bits of the position objects.
    #[inline]
    pub fn counts(&self, position: f64) -> i32 {
        ((position * self.counts_per_unit + self.zero_counts).round_ties_even() as i64) as i32
    }

    /// Counts per second at a velocity.
    pub fn counts_per_second(&self, velocity: f64) -> f64 {
        velocity * self.counts_per_unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PARAMETERS: JointParameters = JointParameters {
        inertia: 0.3,
        viscous_friction: 2.0,
        coulomb_friction: 4.0,
        friction_shape: FrictionShape::Constant,
        brake_torque: 60.0,
    };
    const STEP_S: f64 = 125e-6;

    #[test]
    fn gravity_pulls_a_pendulum_to_zero_and_a_weight_down() {
        let free = JointParameters { coulomb_friction: 0.0, ..PARAMETERS };
        let settled = |gravity: Gravity, position: f64| {
            let mut joint = Joint::new(free, position);
            joint.set_gravity(gravity);
            (0..20_000).for_each(|_| joint.step(0.001, 0.0, false));
            joint
        };
        for position in [1.0, -2.5] {
            let hanging = settled(Gravity::Pendulum(3.0), position);
            assert!(hanging.position().abs() < 1e-3, "{}", hanging.position());
        }
        // It falls as fast as viscous friction lets it.
        let falling = settled(Gravity::Weight(3.0), 0.0);
        assert!((falling.velocity() + 3.0 / free.viscous_friction).abs() < 1e-6, "{}", falling.velocity());
    }

    #[test]
    fn a_torque_below_the_friction_moves_nothing() {
        let mut joint = Joint::new(PARAMETERS, 0.5);
        for _ in 0..10_000 {
            joint.step(STEP_S, 3.999, false);
        }
        assert_eq!((joint.position(), joint.velocity()), (0.5, 0.0));
    }

    #[test]
    fn a_constant_torque_leads_to_the_velocity_where_friction_balances_it() {
        let mut joint = Joint::new(PARAMETERS, 0.0);
        for _ in 0..80_000 {
            joint.step(STEP_S, 10.0, false);
        }
        assert!((joint.velocity() - 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_joint_with_a_harmonic_drive_needs_the_measured_currents_for_the_measured_speeds() {
        // N·m for 1 A at the output of the module does not matter for the shape: 1 A counts as 1 N·m here.
        let parameters = JointParameters {
            inertia: 0.1,
            viscous_friction: 0.036,
            coulomb_friction: 0.2177,
            friction_shape: FrictionShape::HarmonicDrive,
            brake_torque: 0.0,
        };
        for (revolutions_per_minute, current) in [(0.1, 0.050), (0.72, 0.160), (7.25, 0.245), (26.1, 0.316)] {
            let speed = revolutions_per_minute * std::f64::consts::TAU / 60.0;
            let joint = Joint { velocity: speed, ..Joint::new(parameters, 0.0) };
            let needed = joint.coulomb_friction() + parameters.viscous_friction * speed;
            assert!((needed - current).abs() < 0.001, "{revolutions_per_minute} r/min: {needed} A");
        }
        // Half of the friction at speed moves it, but slowly.
        let mut joint = Joint::new(parameters, 0.0);
        (0..400_000).for_each(|_| joint.step(STEP_S, 0.110, false));
        assert!((0.02..0.06).contains(&joint.velocity()), "{}", joint.velocity());
        let mut resting = Joint::new(parameters, 0.0);
        (0..1_000).for_each(|_| resting.step(STEP_S, 0.049, false));
        assert_eq!(resting.velocity(), 0.0);
    }

    #[test]
    fn a_coasting_joint_stops_and_stays_without_chatter() {
        let mut joint = Joint::new(PARAMETERS, 0.0);
        while joint.velocity() < 2.0 {
            joint.step(STEP_S, 50.0, false);
        }
        for _ in 0..8_000 {
            joint.step(STEP_S, 0.0, false);
        }
        let rest = joint.position();
        joint.step(STEP_S, 0.0, false);
        assert_eq!((joint.position(), joint.velocity()), (rest, 0.0));
    }

    #[test]
    fn the_brake_holds_what_the_friction_cannot() {
        let mut joint = Joint::new(PARAMETERS, 0.0);
        joint.set_load_torque(50.0);
        joint.step(STEP_S, 0.0, true);
        assert_eq!(joint.velocity(), 0.0);
        joint.step(STEP_S, 0.0, false);
        assert!(joint.velocity() > 0.0);
    }

    #[test]
    fn an_end_stop_holds_any_torque_and_releases_the_joint_in_the_other_direction() {
        let stops = EndStops { lowest: -1.0, highest: 0.5 };
        let mut joint = Joint::new(PARAMETERS, 0.4).between(Some(stops));
        for _ in 0..8_000 {
            joint.step(STEP_S, 500.0, false);
        }
        assert_eq!(joint.position(), 0.5);
        for _ in 0..8_000 {
            joint.step(STEP_S, -20.0, false);
        }
        assert_eq!(joint.position(), -1.0);
    }

    #[test]
    fn a_reversal_passes_through_standstill_within_one_step() {
        let mut joint = Joint::new(JointParameters { viscous_friction: 0.0, ..PARAMETERS }, 0.0);
        joint.velocity = 0.001;
        joint.step(0.001, -10.0, false);
        // 14 N·m brake 0.001 rad/s in 21.4 µs, then 6 N·m accelerate for the rest.
        let stopping_s = 0.3 * 0.001 / 14.0;
        let expected = -6.0 / 0.3 * (0.001 - stopping_s);
        assert!((joint.velocity() - expected).abs() < 1e-12);
    }

    #[test]
    fn the_encoder_rounds_to_the_nearest_count_and_wraps_at_32_bits() {
        let encoder = Encoder { counts_per_unit: -100.0, zero_counts: 7.0 };
        assert_eq!(encoder.counts(0.0249), 5);
        assert_eq!(encoder.counts(-21_474_837.0), i32::MIN + 59);
    }

    proptest! {
        #[test]
        fn friction_alone_never_gains_speed(velocity in -10.0f64..10.0, step_s in 1e-9f64..1e-3) {
            let mut joint = Joint::new(PARAMETERS, 0.0);
            joint.velocity = velocity;
            for _ in 0..100 {
                let before = joint.velocity();
                joint.step(step_s, 0.0, false);
                prop_assert!(joint.velocity().abs() <= before.abs());
                prop_assert!(joint.velocity() * before >= 0.0);
            }
        }
    }
}
