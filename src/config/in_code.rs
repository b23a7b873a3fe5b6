//! A configuration that is made in code, with the same defaults as one that is read from a file.
//!
//! ```
//! use takt::config::{Axis, Bus, Config, Interface, Limits};
//! use takt::family;
//!
//! let limits = Limits {
//!     position_min: -2.9,
//!     position_max: 2.9,
//!     velocity: 2.0,
//!     acceleration: 8.0,
//!     deceleration: 8.0,
//!     jerk: 100.0,
//!     torque: 87.0,
//! };
//! let joint = |name: &str, node| Axis::new(name, 0, node, family::EROB_CANOPEN, limits);
//! let shoulder = Axis { reversed: true, ..joint("shoulder", 1) };
//! let config = Config::new("arm", vec![Bus::new("can", Interface::Simulated)], vec![shoulder, joint("elbow", 2)]);
//! config.validate()?;
//! # Ok::<(), takt::ConfigError>(())
//! ```
//!
//! Every field is public. Whoever starts with a configuration checks it first, by the rules of the reader of files.

use std::path::PathBuf;

use takt_rt::{FeedForward, Follow, StopCategories, StreamDelay};

use super::defaults;
use super::drive_family::DriveFamily;
use super::keys;
use super::model::{
    Axis, Bus, CommandFrames, Config, Control, Cycle, FollowingError, FrictionShape, Interface, Joint,
    Limits, Master, MissedSlots, PowerUpState, Program, Realtime, SimulatedJoint, Simulation, Telemetry,
    Travel,
};
use super::position_unit::PositionUnit;

impl Config {
    /// A controller of these axes on these buses, without a program. The period is 1 ms: see [`Config::with_period`].
    pub fn new(name: impl Into<String>, buses: Vec<Bus>, axes: Vec<Axis>) -> Self {
        let config = Self {
            name: name.into(),
            cycle: Cycle { period_ns: 0, command_phase_ns: 0 },
            missed_slots: MissedSlots::default(),
            stops: StopCategories::default(),
            realtime: Realtime::default(),
            master: Master {
                node: defaults::MASTER_NODE,
                heartbeat_ns: None,
                heartbeat_timeout_ns: defaults::HEARTBEAT_TIMEOUT_NS,
                time_ns: None,
            },
            stream_delay: StreamDelay::default(),
            buses,
            axes,
            groups: vec![],
            program: Program { repeat: defaults::REPEAT, moves: vec![] },
            telemetry: Telemetry::default(),
            simulation: Simulation {
                seed: defaults::SEED,
                longest_gap_ns: 0,
                stops_for_missed_slots: const { keys::simulation::STOPS_FOR_MISSED_SLOTS.default_boolean() },
            },
        };
        config.with_period(defaults::PERIOD_NS)
    }

    /// Sets the period of the cycle, and the values whose defaults depend on it: the command phase, the heartbeat of the
    /// controller and its time-out, the longest gap of the simulation.
    #[must_use]
    pub fn with_period(mut self, period_ns: u64) -> Self {
        self.cycle = Cycle { period_ns, command_phase_ns: defaults::command_phase_ns(period_ns) };
        self.master.heartbeat_ns = Some(defaults::master_heartbeat_ns(&self.axes, period_ns.max(1)));
        self.master.heartbeat_timeout_ns = defaults::heartbeat_timeout_ns(self.master.heartbeat_ns);
        self.simulation.longest_gap_ns = defaults::longest_gap_ns(period_ns);
        self
    }
}

impl Default for MissedSlots {
    fn default() -> Self {
        defaults::MISSED_SLOTS
    }
}

impl Default for Realtime {
    fn default() -> Self {
        defaults::REALTIME
    }
}

impl Default for Telemetry {
    fn default() -> Self {
        use keys::telemetry::{BLACK_BOX, CANDUMP, DIRECTORY, RECORD, RING_RECORDS};

        Self {
            directory: PathBuf::from(const { DIRECTORY.default_word() }),
            is_recorded: const { RECORD.default_boolean() },
            is_candump_written: const { CANDUMP.default_boolean() },
            black_box_ns: Some(const { BLACK_BOX.default_ns() }),
            ring_records: const { RING_RECORDS.default_number() as usize },
        }
    }
}

impl Bus {
    /// A classic bus of 1 Mbit/s with the cycle of the controller.
    pub fn new(name: impl Into<String>, interface: Interface) -> Self {
        use keys::bus::{BIT_RATE, RESTART_MS, SDO_WHILE_ENABLED, SERVICE_FRAMES};

        Self {
            name: name.into(),
            interface,
            divider: 1,
            bit_rate: const { BIT_RATE.default_number() as u32 },
            data_bit_rate: None,
            restart_ms: const { RESTART_MS.default_number() as u32 },
            service_frames_per_cycle: const { SERVICE_FRAMES.default_number() as usize },
            sdo_while_enabled: const { SDO_WHILE_ENABLED.default_boolean() },
            command_frames: CommandFrames::default(),
        }
    }
}

impl Axis {
    /// A rotary axis in the usual mode of its family: an index into the buses, a node ID from 1 to 127, and limits in rad.
    pub fn new(name: impl Into<String>, bus: usize, node: u8, drive: DriveFamily, limits: Limits) -> Self {
        use keys::axis;

        let (travel, control, mapping) = (Travel::Rotary, drive.usual_mode, defaults::mapping(&drive));
        let counts_per_turn = drive.counts_per_turn.unwrap_or(defaults::COUNTS_PER_TURN);
        let (identity, feedback) = (drive.identity, defaults::feedback(&drive, mapping));
        Self {
            name: name.into(),
            bus,
            node,
            drive,
            control,
            other_modes: vec![],
            travel,
            counts_per_turn,
            gear_ratio: const { axis::GEAR_RATIO.default_number() },
            reversed: false,
            zero_counts: 0,
            limits,
            urdf: None,
            shown_in: PositionUnit::of(travel),
            compliance: defaults::compliance(&[control]),
            feed_forward: FeedForward::default(),
            following_error: FollowingError {
                limit: defaults::following_error(travel),
                time_ns: const { keys::following_error::TIME.default_ns() },
            },
            start_tolerance: defaults::start_tolerance(travel),
            target_tolerance: defaults::target_tolerance(travel, &[control]),
            follow: Follow::default(),
            missed_feedback_cycles: const { axis::MISSED_FEEDBACK_CYCLES.default_number() as u16 },
            transmission_type: const { axis::TRANSMISSION_TYPE.default_number() as u8 },
            mapping,
            feedback,
            answers_sync: const { axis::ANSWERS_SYNC.default_boolean() },
            feedback_delay_ns: const { axis::FEEDBACK_DELAY.default_ns() },
            heartbeat_ns: None,
            identity,
            dcf: None,
            power_up_ns: const { axis::POWER_UP.default_ns() },
            joint: Joint::default(),
            simulated: SimulatedJoint::within(&limits, limits.torque),
        }
    }

    /// The same as a linear axis with a lead in m, and limits in m. Sets the tolerances of a linear axis.
    #[must_use]
    pub fn linear(mut self, lead_m: f64) -> Self {
        self.travel = Travel::Linear { lead_m };
        self.shown_in = PositionUnit::of(self.travel);
        self.following_error.limit = defaults::following_error(self.travel);
        self.start_tolerance = defaults::start_tolerance(self.travel);
        self.set_defaults_of_modes();
        self
    }

    /// The same in another mode. In CST the target tolerance allows for static friction, and an impedance has the gains of the
    /// loop at most.
    #[must_use]
    pub fn with_control(mut self, control: Control) -> Self {
        self.control = control;
        self.set_defaults_of_modes();
        self
    }

    /// The same, which may be changed to these modes at run time as well. Their defaults are as for
    /// [`with_control`](Self::with_control).
    #[must_use]
    pub fn with_other_modes(mut self, other_modes: Vec<Control>) -> Self {
        self.other_modes = other_modes;
        self.set_defaults_of_modes();
        self
    }

    fn set_defaults_of_modes(&mut self) {
        let controls: Vec<Control> = self.controls().copied().collect();
        self.compliance = defaults::compliance(&controls);
        self.target_tolerance = defaults::target_tolerance(self.travel, &controls);
    }
}

impl Joint {
    /// Rotor and load at the joint: kg·m² (kg).
    pub fn inertia(&self) -> f64 {
        self.inertia.unwrap_or(defaults::INERTIA)
    }

    /// N·m·s/rad (N·s/m)
    pub fn viscous_friction(&self) -> f64 {
        self.viscous_friction.unwrap_or(defaults::VISCOUS_FRICTION)
    }

    /// N·m (N)
    pub fn coulomb_friction(&self) -> f64 {
        self.coulomb_friction.unwrap_or(defaults::COULOMB_FRICTION)
    }
}

impl Axis {
    /// The rated torque of the drive at the joint, as long as the drive has not reported its own: N·m (N).
    pub fn rated_torque(&self) -> f64 {
        self.joint.rated_torque.unwrap_or(self.limits.torque)
    }
}

impl SimulatedJoint {
    /// A joint with these limits and this rated torque.
    pub fn within(limits: &Limits, rated_torque: f64) -> Self {
        Self {
            gravity: 0.0,
            friction: FrictionShape::Constant,
            peak_torque: defaults::PEAK_TO_RATED_TORQUE * rated_torque,
            initial_position: defaults::initial_position(limits),
            power_up: PowerUpState::default(),
        }
    }
}
