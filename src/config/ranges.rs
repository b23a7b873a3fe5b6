//! The range of every number of a configuration. What lies outside cannot be, or is a slip of a unit or of a power of ten;
//! the message then says why. `configs/reference.toml` states these ranges beside the keys.

use std::ops::{Range, RangeInclusive};

use super::bounds::Bounds;

/// `cycle.period`, in seconds.
pub const PERIOD_S: RangeInclusive<f64> = 250e-6..=0.1;
/// `cycle.command_phase`, as a fraction of the period: the cycle must leave room on both sides of it.
pub const COMMAND_PHASE: RangeInclusive<f64> = 0.05..=0.95;
/// `stream.delay`
pub const STREAM_DELAY_S: RangeInclusive<f64> = 0.0..=1.0;
/// `cycle.missed_slots`, each step and the leak.
pub const MISSED_SLOTS: Range<i64> = 1..1_000_001;

/// `realtime.priority`
pub const PRIORITY: Range<i64> = 1..100;
/// `realtime.cpu`
pub const CPU: Range<i64> = 0..1024;
/// `realtime.spin_guard`, as a fraction of the period.
pub const SPIN_GUARD_AT_MOST: f64 = 0.5;

/// Node IDs of CANopen (CiA 301, 7.4.1).
pub const NODE_ID: Range<i64> = 1..128;
/// The addresses of slaves on a serial line (Modbus over Serial Line 1.02, 2.2).
pub const LINE_ADDRESS: Range<i64> = 1..248;
/// The axes of a node (CiA 402-2, multi-axis devices).
pub const NODE_AXIS: Range<i64> = 1..9;
/// Periods of heartbeats, in seconds; object 1017 has 16 bits.
pub const HEARTBEAT_S: RangeInclusive<f64> = 10e-3..=65.535;
/// `master.heartbeat_timeout`, in seconds; object 1016 has 16 bits.
pub const HEARTBEAT_TIMEOUT_S: RangeInclusive<f64> = 1e-3..=65.535;
/// `master.time`, in seconds. TIME more often than every 10 ms has no use.
pub const TIME_S: RangeInclusive<f64> = 10e-3..=3600.0;

/// `bus.bit_rate`: the bit rates of CiA 301, 5.3, which every adapter and every drive here divides its clock to.
pub const BIT_RATES: [u32; 8] = [10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
/// `bus.data_bit_rate`, at most.
pub const DATA_BIT_RATE_AT_MOST: f64 = 8e6;
/// The longest period of a bus, in seconds.
pub const BUS_PERIOD_AT_MOST_S: f64 = 0.1;
/// `bus.restart_ms`, a minute at most.
pub const RESTART_MS: Range<i64> = 0..60_001;
/// `bus.service_frames_per_cycle`
pub const SERVICE_FRAMES: Range<i64> = 1..33;

/// `axis.transmission_type`
pub const TRANSMISSION_TYPE: Range<i64> = 1..256;
/// `axis.missed_feedback_cycles`
pub const MISSED_FEEDBACK_CYCLES: Range<i64> = 1..1001;
/// `axis.feedback_delay`, in seconds.
pub const FEEDBACK_DELAY_S: RangeInclusive<f64> = 0.0..=0.01;
/// `axis.torque_loop.torque_rise`, in seconds.
pub const TORQUE_RISE_S: RangeInclusive<f64> = 0.001..=10.0;
/// `axis.following_error.time`, in seconds.
pub const FOLLOWING_ERROR_TIME_S: RangeInclusive<f64> = 0.0..=10.0;
/// `axis.power_up`, in seconds.
pub const POWER_UP_S: RangeInclusive<f64> = 0.0..=60.0;
/// `axis.counts_per_turn`
pub const COUNTS_PER_TURN: Bounds = Bounds::Plausible {
    low: 16.0,
    high: 4_294_967_296.0,
    reason: "coarser encoders cannot position a joint, and drives count in 32 bits",
};
/// `axis.gear_ratio`
pub const GEAR_RATIO: Bounds =
    Bounds::Plausible { low: 1e-3, high: 1e5, reason: "no gear of a joint has another ratio" };
/// `axis.lead`
pub const LEAD: Bounds = Bounds::Plausible {
    low: 1e-5,
    high: 10.0,
    reason: "no screw or belt moves a joint by less or more in a turn",
};
/// `axis.velocity_loop.position_gain`
pub const POSITION_GAIN: Bounds = Bounds::Plausible {
    low: 0.01,
    high: 1000.0,
    reason: "a lower gain takes minutes to correct an error, and no drive follows a higher one",
};
/// `axis.torque_loop.bandwidth`
pub const BANDWIDTH: Bounds = Bounds::Plausible {
    low: 0.1,
    high: 1000.0,
    reason: "a slower loop takes minutes to correct an error, and no loop over a bus is faster",
};

/// The longest time (s) that a stop from the highest speed may take.
pub const STOP_AT_MOST_S: f64 = 10.0;

/// `program.repeat`
pub const REPEAT: Range<i64> = 1..1_000_001;
/// Moves and rests that are longer, in seconds, are slips of the unit.
pub const PROGRAM_S: RangeInclusive<f64> = 0.0..=3600.0;
/// `program.move.velocity` and `program.move.acceleration`
pub const SCALE: Bounds = Bounds::Plausible {
    low: 0.001,
    high: 1.0,
    reason: "the limits are the most, and a smaller part of them would take hours",
};

/// `telemetry.black_box`, in seconds.
pub const BLACK_BOX_S: RangeInclusive<f64> = 0.1..=60.0;
/// `telemetry.ring_records`
pub const RING_RECORDS: Range<i64> = 16..1_048_577;
/// `simulation.longest_gap`, at most, in seconds.
pub const LONGEST_GAP_AT_MOST_S: f64 = 60.0;

/// The ranges of what an axis has in rad or in m.
pub struct AxisRanges {
    pub velocity: Bounds,
    pub acceleration: Bounds,
    pub jerk: Bounds,
    pub effort: Bounds,
    /// Following errors and tolerances.
    pub deviation: Bounds,
    pub inertia: Bounds,
    pub fed_forward_inertia: Bounds,
    pub friction: Bounds,
    pub stiffness: Bounds,
    pub damping: Bounds,
    pub viscous_friction: Bounds,
}

const SLOW: &str = "a slower joint takes hours for its range, and no joint is faster; check the unit";
const WEAK: &str = "no joint accelerates less or more; check the unit";
const ROUGH: &str = "no joint changes its acceleration less or more quickly; check the unit";
const STRONG: &str = "no joint has less or more; check the unit";
const FAR: &str = "less is below what a drive counts, and more would watch nothing; check the unit";
const HEAVY: &str = "no joint is lighter or heavier; check the unit";
const STIFF: &str = "no joint is held with less or more; check the unit";

impl AxisRanges {
    pub const ROTARY: Self = Self {
        velocity: Bounds::Plausible { low: 1e-4, high: 1e3, reason: SLOW },
        acceleration: Bounds::Plausible { low: 1e-3, high: 1e5, reason: WEAK },
        jerk: Bounds::PlausibleOrInfinite { low: 1e-2, high: 1e9, reason: ROUGH },
        effort: Bounds::Plausible { low: 1e-3, high: 1e6, reason: STRONG },
        deviation: Bounds::Plausible { low: 1e-6, high: 100.0, reason: FAR },
        inertia: Bounds::Plausible { low: 1e-7, high: 1e6, reason: HEAVY },
        fed_forward_inertia: Bounds::PlausibleOrZero { low: 1e-7, high: 1e6, reason: HEAVY },
        friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e6, reason: STRONG },
        stiffness: Bounds::Plausible { low: 1e-6, high: 1e9, reason: STIFF },
        damping: Bounds::PlausibleOrZero { low: 1e-9, high: 1e9, reason: STIFF },
        viscous_friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e6, reason: STRONG },
    };
    pub const LINEAR: Self = Self {
        velocity: Bounds::Plausible { low: 1e-6, high: 100.0, reason: SLOW },
        acceleration: Bounds::Plausible { low: 1e-5, high: 1e4, reason: WEAK },
        jerk: Bounds::PlausibleOrInfinite { low: 1e-4, high: 1e8, reason: ROUGH },
        effort: Bounds::Plausible { low: 1e-3, high: 1e7, reason: STRONG },
        deviation: Bounds::Plausible { low: 1e-8, high: 10.0, reason: FAR },
        inertia: Bounds::Plausible { low: 1e-4, high: 1e6, reason: HEAVY },
        fed_forward_inertia: Bounds::PlausibleOrZero { low: 1e-4, high: 1e6, reason: HEAVY },
        friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e7, reason: STRONG },
        stiffness: Bounds::Plausible { low: 1e-6, high: 1e10, reason: STIFF },
        damping: Bounds::PlausibleOrZero { low: 1e-9, high: 1e10, reason: STIFF },
        viscous_friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e7, reason: STRONG },
    };
}
