//! The checked configuration as plain data. Whoever holds a [`Config`] may rely on every value being possible.

use std::path::PathBuf;

use takt_rt::cia402::OperationMode;

/// A whole controller: one cycle, its buses, its axes and what they are to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The name of the machine, for people and file names.
    pub name: String,
    /// The cycle.
    pub cycle: Cycle,
    /// What is asked of the operating system.
    pub realtime: Realtime,
    /// This controller as a CANopen node.
    pub master: Master,
    /// The buses, in the order of the file.
    pub buses: Vec<Bus>,
    /// The axes, in the order of the file.
    pub axes: Vec<Axis>,
    /// What `takt run` does with them.
    pub program: Program,
    /// What is written down.
    pub telemetry: Telemetry,
    /// How simulated buses behave.
    pub simulation: Simulation,
}

/// The cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Period of SYNC and set-points.
    pub period_ns: u64,
    /// When the command phase begins, after the start of the slot.
    pub command_phase_ns: u64,
}

/// What is asked of the operating system for the real-time thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Realtime {
    /// SCHED_FIFO priority, 1 to 99; `None` leaves the thread in the normal class.
    pub priority: Option<u8>,
    /// The CPU to pin the thread to; `None` lets takt take the last one it may use.
    pub cpu: Option<usize>,
    /// Whether to lock all memory.
    pub lock_memory: bool,
    /// Whether to hold the CPU out of deep idle states.
    pub hold_dma_latency: bool,
    /// How long before a deadline to stop sleeping and spin; `None` measures the wake-up latency and chooses.
    pub spin_guard_ns: Option<u64>,
}

/// This controller as a CANopen node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Master {
    /// Its own node number, under which its heartbeat is sent.
    pub node: u8,
    /// Period of its heartbeat; `None` sends none.
    pub heartbeat_ns: Option<u64>,
    /// Time after which a drive that no longer hears it must react (object 1016 of the drives).
    pub heartbeat_timeout_ns: u64,
}

/// One bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Its name in the configuration and the report.
    pub name: String,
    /// What it is connected to.
    pub interface: Interface,
    /// Bit rate (bit/s) of classic frames and of the arbitration phase.
    pub bit_rate: u32,
    /// Bit rate of the data phase of CAN FD frames.
    pub data_bit_rate: Option<u32>,
    /// The most service frames (SDO, NMT …) sent in one cycle while the axes are enabled.
    pub service_frames_per_cycle: usize,
}

/// What a bus is connected to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Simulated drives inside this process.
    Simulated,
    /// A SocketCAN network interface, by name.
    SocketCan(String),
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name in the configuration and the report.
    pub name: String,
    /// Its bus, an index into [`Config::buses`].
    pub bus: usize,
    /// Its CANopen node number, 1 to 127.
    pub node: u8,
    /// The family of the drive.
    pub drive: DriveFamily,
    /// How it is commanded, with the gains of the loop that the controller closes itself.
    pub control: Control,
    /// Rotary or linear.
    pub travel: Travel,
    /// Counts of one turn of the position that the drive reports.
    pub counts_per_turn: f64,
    /// Turns of the reported position for one turn of the joint.
    pub gear_ratio: f64,
    /// Whether positive counts are negative travel.
    pub reversed: bool,
    /// The count at which the joint's position is zero.
    pub zero_counts: i32,
    /// What may never be exceeded.
    pub limits: Limits,
    /// How far the joint may be from its set-point.
    pub following_error: FollowingError,
    /// Cycles without feedback before the group stops.
    pub missed_feedback_cycles: u16,
    /// Transmission type of the PDOs (1 = every SYNC).
    pub transmission_type: u8,
    /// What the drive reports every cycle beside statusword and position.
    pub feedback: Vec<Feedback>,
    /// Period of the drive's own heartbeat (object 1017); `None` leaves it off.
    pub heartbeat_ns: Option<u64>,
    /// What is known of the drive beforehand and compared at bring-up.
    pub identity: Identity,
    /// The drive and joint that stand in on a simulated bus.
    pub simulated: SimulatedJoint,
}

/// A family of drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveFamily {
    /// ZeroErr eRob, CANopen firmware.
    ErobCanopen,
}

/// Something a drive can report every cycle beside statusword and position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// 6061, one byte.
    OperationMode,
    /// 606C, four bytes.
    Velocity,
    /// 6077, two bytes.
    Torque,
    /// 6078, two bytes.
    Current,
    /// 603F, two bytes.
    ErrorCode,
}

/// How an axis is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Cyclic synchronous position: the drive closes every loop.
    Position,
    /// Cyclic synchronous velocity: the controller closes the position loop.
    Velocity {
        /// Gain of the position loop in 1/s.
        position_gain: f64,
    },
    /// Cyclic synchronous torque: the controller closes position and velocity loops.
    Torque {
        /// N·m/rad (N/m).
        stiffness: f64,
        /// N·m·s/rad (N·s/m).
        damping: f64,
        /// Feed-forward of the acceleration: kg·m² (kg).
        inertia: f64,
        /// Feed-forward of the velocity: N·m·s/rad (N·s/m).
        viscous_friction: f64,
        /// Feed-forward of the direction of motion: N·m (N).
        coulomb_friction: f64,
    },
}

impl Control {
    /// The mode of operation that this needs in the drive.
    pub fn operation_mode(self) -> OperationMode {
        match self {
            Self::Position => OperationMode::CyclicSynchronousPosition,
            Self::Velocity { .. } => OperationMode::CyclicSynchronousVelocity,
            Self::Torque { .. } => OperationMode::CyclicSynchronousTorque,
        }
    }
}

/// Whether an axis turns or slides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Travel {
    /// rad
    Rotary,
    /// m; so many in one turn.
    Linear {
        /// Lead in m.
        lead_m: f64,
    },
}

/// Limits of an axis in rad (m) and seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lowest position.
    pub position_min: f64,
    /// Highest position.
    pub position_max: f64,
    /// Highest speed.
    pub velocity: f64,
    /// Highest acceleration.
    pub acceleration: f64,
    /// Highest deceleration.
    pub deceleration: f64,
    /// Highest jerk; infinite plans trapezoids.
    pub jerk: f64,
    /// Highest torque in N·m (force in N).
    pub torque: f64,
}

/// How far the joint may be from its set-point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowingError {
    /// rad or m.
    pub limit: f64,
    /// For how long it may be further.
    pub time_ns: u64,
}

/// What a drive must say of itself; `None` accepts anything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Object 1000.
    pub device_type: Option<u32>,
    /// Object 1018:1.
    pub vendor: Option<u32>,
    /// Object 1018:2.
    pub product: Option<u32>,
    /// Object 1018:3.
    pub revision: Option<u32>,
}

/// What `takt run` does: the moves one after the other, the whole list `repeat` times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// How often the list is run, at least once.
    pub repeat: u32,
    /// The moves.
    pub moves: Vec<ProgramMove>,
}

/// A coordinated move of every axis to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramMove {
    /// Targets in rad (m), in the order of the axes.
    pub target: Vec<f64>,
    /// Fraction of the velocity limits.
    pub velocity_scale: f64,
    /// Fraction of the acceleration and jerk limits.
    pub acceleration_scale: f64,
    /// The move takes at least this long, in seconds.
    pub minimum_duration_s: f64,
    /// Standstill after it, in seconds.
    pub dwell_s: f64,
}

/// What is written down.
#[derive(Clone, Debug, PartialEq)]
pub struct Telemetry {
    /// The folder for recordings.
    pub directory: PathBuf,
    /// Whether a recording is made.
    pub is_recorded: bool,
    /// Whether the frames of every bus are written as candump logs.
    pub is_candump_written: bool,
    /// Cycle records that the ring to the logger can hold.
    pub ring_records: usize,
}

/// How simulated buses behave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulation {
    /// Seed of everything random.
    pub seed: u64,
    /// A pause of this process that is longer than this stops the simulated world too: the host's stalls are
    /// not the bus's.
    pub longest_gap_ns: u64,
}

/// The drive and joint that stand in for an axis on a simulated bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedJoint {
    /// Rotor and load at the joint: kg·m² (kg).
    pub inertia: f64,
    /// N·m·s/rad (N·s/m).
    pub viscous_friction: f64,
    /// N·m (N).
    pub coulomb_friction: f64,
    /// What the drive calls rated torque (object 6076): N·m (N).
    pub rated_torque: f64,
    /// Peak torque: N·m (N).
    pub peak_torque: f64,
    /// Position at power-up: rad (m).
    pub initial_position: f64,
    /// From power-up to the first answer.
    pub power_up_ns: u64,
}
