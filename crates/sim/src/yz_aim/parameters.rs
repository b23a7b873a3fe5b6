//! The parameters of one YZ-AIM servo and its joint.

use std::f64::consts::TAU;
use std::sync::Arc;

use takt_rt::Nanoseconds;
use takt_wire::canopen::eds;
use takt_wire::quirks as wire;

use crate::homing_switches::HomingSwitches;
use crate::plant::{Encoder, EndStops, JointParameters};

/// Counts per turn of the motor.
pub const COUNTS_PER_TURN: f64 = 32_768.0;
/// Counts per second at one r/min.
pub(super) const COUNTS_PER_SECOND_PER_RPM: f64 = COUNTS_PER_TURN / 60.0;

/// The models of the manual's table (chapter II) that differ for a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code, reason = "the whole table of the manual")]
pub enum Model {
    /// 42AIM10C: 0.33 N·m, single-turn.
    Aim42x10C,
    /// 42AIM15C: 0.48 N·m, single-turn.
    Aim42x15C,
    /// 57AIM15C: 0.48 N·m, multi-turn.
    Aim57x15C,
    /// 57AIM15CH: 0.24 N·m, 2500 r/min, multi-turn.
    Aim57x15CH,
    /// 57AIM30C: 0.96 N·m, multi-turn.
    Aim57x30C,
    /// 57AIM30CH: 0.48 N·m, 2500 r/min, multi-turn.
    Aim57x30CH,
    /// 60AIM25C: 2 N·m, single-turn.
    Aim60x25C,
    /// 60AIM25CH: 1 N·m, 2500 r/min, single-turn.
    Aim60x25CH,
}

/// The ratings of a model, at the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratings {
    /// N·m
    pub torque: f64,
    /// A
    pub current: f64,
    /// r/min
    pub maximum_speed_rpm: f64,
    /// V
    pub supply_voltage: f64,
    /// True if a battery keeps the turn count.
    pub has_battery: bool,
}

impl Model {
    /// The ratings.
    pub const fn ratings(self) -> Ratings {
        let (torque, current, maximum_speed_rpm, supply_voltage, has_battery) = match self {
            Self::Aim42x10C => (0.33, 1.6, 1500.0, 24.0, false),
            Self::Aim42x15C => (0.48, 2.2, 1500.0, 24.0, false),
            Self::Aim57x15C => (0.48, 2.2, 1500.0, 24.0, true),
            Self::Aim57x15CH => (0.24, 2.2, 2500.0, 24.0, true),
            Self::Aim57x30C => (0.96, 4.4, 1500.0, 24.0, true),
            Self::Aim57x30CH => (0.48, 4.4, 2500.0, 24.0, true),
            Self::Aim60x25C => (2.0, 7.0, 1500.0, 36.0, false),
            Self::Aim60x25CH => (1.0, 7.0, 2500.0, 36.0, false),
        };
        Ratings { torque, current, maximum_speed_rpm, supply_voltage, has_battery }
    }
}

/// The gear between motor and joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gearing {
    /// Turns of the motor for one turn of the gear's output.
    pub ratio: f64,
    /// Travel of the joint for one turn of the gear's output: 2π rad, or the lead in m.
    pub travel_per_turn: f64,
    /// True if the count decreases with the position.
    pub is_reversed: bool,
    /// The count at the joint's zero, if the drive counts turns.
    pub zero_counts: f64,
}

impl Gearing {
    /// Turns of the motor for one rad (m) of the joint.
    fn turns_per_unit(&self) -> f64 {
        self.ratio / self.travel_per_turn
    }
}

/// Deviations of real units from the manual that only such a unit has. Each can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quirks {
    /// After power-up, 0007h and 000Fh are ignored before 0006h.
    pub needs_shutdown_first: bool,
    /// A controlword that raises the level is ignored sooner than this after the last one.
    pub controlword_interval_ns: Nanoseconds,
    /// The first target after enabling is ignored.
    pub ignores_first_target: bool,
    /// True if statusword and heartbeat report the battery alarm 10h, which does not stop the motor.
    pub shows_battery_alarm: bool,
    /// True if TPDO3 has 0.1 r/min per bit like 606Ch by SDO, instead of 1 r/min as in the manual's example.
    pub has_fine_velocity_in_tpdo3: bool,
}

impl Default for Quirks {
    /// The behaviour of real units.
    fn default() -> Self {
        Self {
            needs_shutdown_first: true,
            controlword_interval_ns: 20_000_000,
            ignores_first_target: true,
            shows_battery_alarm: true,
            has_fine_velocity_in_tpdo3: false,
        }
    }
}

impl Quirks {
    /// The behaviour in the manual's examples.
    pub fn none() -> Self {
        Self {
            needs_shutdown_first: false,
            controlword_interval_ns: 0,
            ignores_first_target: false,
            ..Self::default()
        }
    }
}

/// The homing parameters of the unit, for which there are no objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingBehaviour {
    /// Speed towards the switch: r/min. The edge is searched at a tenth of it.
    pub speed_rpm: f64,
    /// Timeout of the search, followed by the homing error; `None`: no timeout.
    pub gives_up_ns: Option<Nanoseconds>,
    /// True if methods 20 and 22 work as in CiA 402; otherwise they lead to the homing error at once.
    pub has_undescribed_methods: bool,
}

impl Default for HomingBehaviour {
    fn default() -> Self {
        Self { speed_rpm: 300.0, gives_up_ns: Some(30_000_000_000), has_undescribed_methods: false }
    }
}

/// The parameters of one servo.
#[derive(Clone, Debug, PartialEq)]
pub struct YzAimParameters {
    /// Its data sheet.
    pub sheet: Arc<eds::ObjectDictionary>,
    /// In what its communication deviates from the data sheet and from CiA 301.
    pub device: wire::Quirks,
    /// Node ID, 1 to 127, stored in 2615h.
    pub node: u8,
    /// Bit rate of the bus: bit/s. The drive starts with the same one.
    pub bit_rate: u32,
    /// The mechanics at the joint, including the rotor's inertia. There is no brake.
    pub joint: JointParameters,
    /// The mechanical end stops.
    pub end_stops: Option<EndStops>,
    /// The switches along the travel.
    pub switches: HomingSwitches,
    /// The motor's encoder, seen from the joint: 32768 counts per turn of the motor.
    pub encoder: Encoder,
    /// Position at the first power-up: rad (m).
    pub initial_position: f64,
    /// Torque at the joint at the rated current: N·m (N).
    pub rated_torque: f64,
    /// Highest torque at the joint: N·m (N).
    pub peak_torque: f64,
    /// Rated current: A.
    pub rated_current: f64,
    /// The highest speed of the motor: r/min.
    pub maximum_speed_rpm: f64,
    /// Supply voltage: V.
    pub supply_voltage: f64,
    /// The value stored in 2619h; interpolation needs 7.
    pub special_function: u16,
    /// The value stored in 6083h: (r/min)/s; at 60000 and above there is no ramp.
    pub acceleration: u16,
    /// Boot time after power-up or "reset node".
    pub power_up_ns: Nanoseconds,
    /// Time from a frame until the PDO that replies to it is ready to send.
    pub feedback_delay_ns: Nanoseconds,
    /// The homing parameters.
    pub homing: HomingBehaviour,
    /// The quirks.
    pub quirks: Quirks,
    /// Seed of what differs between units and runs: SDO latencies, the digit after setting the zero.
    pub seed: u64,
}

impl YzAimParameters {
    /// A new unit of a model, by its data sheet and its quirks, on a bus at 1 Mbit/s, with a gear and a joint. The peak torque is three times the rated
    /// torque.
    pub fn new(
        (sheet, mut device): (Arc<eds::ObjectDictionary>, wire::Quirks),
        node: u8,
        model: Model,
        gearing: Gearing,
        joint: JointParameters,
    ) -> Self {
        let ratings = model.ratings();
        device.simulated.lacks_battery = !ratings.has_battery;
        let direction = if gearing.is_reversed { -1.0 } else { 1.0 };
        let torque = ratings.torque * gearing.turns_per_unit() * TAU;
        Self {
            sheet,
            device,
            node,
            bit_rate: 1_000_000,
            joint,
            end_stops: None,
            switches: HomingSwitches::default(),
            encoder: Encoder {
                counts_per_unit: direction * COUNTS_PER_TURN * gearing.turns_per_unit(),
                zero_counts: gearing.zero_counts,
            },
            initial_position: 0.0,
            rated_torque: torque,
            peak_torque: 3.0 * torque,
            rated_current: ratings.current,
            maximum_speed_rpm: ratings.maximum_speed_rpm,
            supply_voltage: ratings.supply_voltage,
            special_function: 0,
            acceleration: 20_000,
            power_up_ns: 100_000_000,
            feedback_delay_ns: 50_000,
            homing: HomingBehaviour::default(),
            quirks: Quirks::default(),
            seed: 0,
        }
    }

    /// The highest speed: counts/s.
    pub(super) fn highest_speed(&self) -> f64 {
        self.maximum_speed_rpm * COUNTS_PER_SECOND_PER_RPM
    }

    /// Torque at the joint for one ampere.
    pub(super) fn torque_per_ampere(&self) -> f64 {
        self.rated_torque / self.rated_current
    }
}
