//! The configuration as plain data. Every value of a [`Config`] that was read from a file is possible. One that was changed in
//! code is checked by [`Config::validate`]. The defaults that are named here hold where the file says nothing; they are constants of
//! `defaults.rs`, and `configs/reference.toml` shows them as a file.

use std::f64::consts::TAU;
use std::path::PathBuf;

use serde::Serialize;
/// Limits of an axis in rad (m) and seconds. Defaults: the deceleration is the acceleration, the jerk is infinite.
pub use takt_rt::AxisLimits as Limits;
/// Control mode of an axis. Defaults of the gains: a position gain of 20 1/s; in CST a stiffness of inertia · bandwidth² and
/// a damping of 2 · inertia · bandwidth with a bandwidth of 40 rad/s, and the inertia and friction of the simulated joint.
pub use takt_rt::ControlLaw as Control;
pub use takt_rt::{FeedForward, Follow, StopCategories, StreamDelay};
pub use takt_sim::plant::FrictionShape;
use takt_wire::canopen::dcf::DeviceConfiguration;
pub use takt_wire::quirks::PowerUpState;

use super::drive_family::DriveFamily;
pub use super::identity::Identity;
use super::position_unit::PositionUnit;
pub use super::travel::Travel;
use super::urdf_limits::UrdfLimits;

/// A whole controller: one cycle, its buses, its axes and what they are to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The name of the machine, for people and file names.
    pub name: String,
    /// The cycle.
    pub cycle: Cycle,
    /// When missed slots are too many.
    pub missed_slots: MissedSlots,
    /// Stop category of each rule. Default: see [`takt_rt::Rule::default_category`].
    pub stops: StopCategories,
    /// Delay of a stream behind the stamps of its points; up to 1 s. Default: as long as the points need.
    pub stream_delay: StreamDelay,
    /// Settings of the real-time thread.
    pub realtime: Realtime,
    /// This controller as a CANopen node.
    pub master: Master,
    /// The buses, in the order of the file.
    pub buses: Vec<Bus>,
    /// The axes, in the order of the file.
    pub axes: Vec<Axis>,
    /// The groups, each axis in one of them. Without any, all axes are one group.
    pub groups: Vec<Group>,
    /// The moves of `takt run`.
    pub program: Program,
    /// Recordings and black boxes.
    pub telemetry: Telemetry,
    /// Simulated buses.
    pub simulation: Simulation,
}

/// The cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Period of SYNC and set-points; 250 µs to 100 ms in whole microseconds. Default 1 ms.
    pub period_ns: u64,
    /// When the command phase begins, after the start of the slot; 5 % to 95 % of the period. Default 55 %. A file
    /// may leave it to [`automatic_command_phase`](crate::schedule::automatic_command_phase); this is what that finds.
    pub command_phase_ns: u64,
}

/// Axes that start, move, stop and fault together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its name in the configuration and the report.
    pub name: String,
    /// Its axes, indices into [`Config::axes`].
    pub axes: Vec<usize>,
    /// The groups that stop this one, too, when they stop, indices into [`Config::groups`]. Default: none.
    pub stops_with: Vec<usize>,
}

impl Config {
    /// The axes of a group, indices into [`Config::axes`]; without groups, all of them.
    pub fn axes_of_group(&self, group: usize) -> Vec<usize> {
        match self.groups.get(group) {
            Some(group) => group.axes.clone(),
            None => (0..self.axes.len()).collect(),
        }
    }

    /// The group of an axis, an index into [`Config::groups`]; without groups, the only one.
    pub fn group_of_axis(&self, axis: usize) -> usize {
        self.groups.iter().position(|group| group.axes.contains(&axis)).unwrap_or(0)
    }

    /// Returns `true` if a bus is a serial line, and no CAN bus: by its interface, or, where it is simulated, by the drives on it.
    pub fn is_serial_line(&self, bus: usize) -> bool {
        match self.buses.get(bus).map(|bus| &bus.interface) {
            Some(Interface::Serial(_)) => true,
            Some(Interface::Simulated) => {
                self.axes.iter().any(|axis| axis.bus == bus && axis.drive.protocol.is_of_serial_line())
            }
            Some(Interface::SocketCan(_) | Interface::Slcan(_) | Interface::Converter(_)) | None => false,
        }
    }

    /// The axes of a bus, in the order of the configuration.
    pub fn axes_of_bus(&self, bus: usize) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter(move |axis| axis.bus == bus)
    }

    /// The cycle of a bus: as the controller's, or a multiple of it. A bus that is not there has the controller's.
    pub fn bus_cycle(&self, bus: usize) -> Cycle {
        let divider = self.buses.get(bus).map_or(1, |bus| bus.divider.max(1));
        Cycle { period_ns: self.cycle.period_ns * u64::from(divider), ..self.cycle }
    }
}

/// When missed slots are too many: a bucket that every missed slot fills by one and that loses one in a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MissedSlots {
    /// Slots in the bucket from which on the operator is warned. Default 10.
    pub warning: u32,
    /// Slots from which on no stream is begun. Default 50.
    pub degraded: u32,
    /// Slots from which on the group stops, unless all of its buses are simulated. Default 250.
    pub stop: u32,
    /// Used slots after which the bucket loses one. Default 10.
    pub leak_slots: u32,
}

/// Settings of the operating system for the real-time thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Realtime {
    /// SCHED_FIFO priority, 1 to 99; `None` leaves the thread in the normal class. Default 80.
    pub priority: Option<u8>,
    /// The CPU to pin the thread to; `None`, the default, lets takt take the last one it may use.
    pub cpu: Option<usize>,
    /// True to lock all memory. Default `true`.
    pub lock_memory: bool,
    /// True to hold the CPU out of deep idle states. Default `true`.
    pub hold_dma_latency: bool,
    /// Time before a deadline from which the thread spins instead of sleeping; `None`, the default, measures the wake-up latency and
    /// chooses.
    pub spin_guard_ns: Option<u64>,
}

/// This controller as a CANopen node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Master {
    /// Its own node ID, under which its heartbeat is sent. Default 127.
    pub node: u8,
    /// Period of its heartbeat in whole milliseconds; `None` sends none. Default 100 ms.
    pub heartbeat_ns: Option<u64>,
    /// Time after which a drive that no longer hears it must react (object 1016 of the drives), in whole
    /// milliseconds. Default 500 ms.
    pub heartbeat_timeout_ns: u64,
    /// Period of TIME, which tells the drives the time of day; `None`, the default, sends none.
    pub time_ns: Option<u64>,
}

/// One bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Its name in the configuration and the report.
    pub name: String,
    /// Interface. Default: simulated.
    pub interface: Interface,
    /// Cycles of the controller in one cycle of this bus (SYNC, feedback, set-points). Default 1: a file gives the
    /// period.
    pub divider: u32,
    /// Bit rate (bit/s) of classic frames and of the arbitration phase. Default 1 Mbit/s; 115200 bit/s on a serial line.
    pub bit_rate: u32,
    /// Bit rate (bit/s) of the data phase of CAN FD frames; `None`, the default, on a classic bus.
    pub data_bit_rate: Option<u32>,
    /// Time (ms) from bus-off to the restart of the controller by the kernel; 0 leaves it off. It holds where takt
    /// brings the interface up itself. Default 100 ms.
    pub restart_ms: u32,
    /// The most service frames (NMT, SDO …) sent in one cycle while the axes are enabled, beside the heartbeat.
    /// Default 1.
    pub service_frames_per_cycle: usize,
    /// True if SDO transfers go on while the axes are enabled. A request and its answer then need room in the
    /// worst cycle; else they wait until the axes are disabled. Default `false`.
    pub sdo_while_enabled: bool,
    /// Whether axes share command frames. Default: each has its own. A file may leave it to the schedule; this is what that finds.
    pub command_frames: CommandFrames,
}

/// Whose commands a frame carries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CommandFrames {
    /// Each axis has frames of its own.
    #[default]
    OnePerAxis,
    /// Axes of one group share frames, as far as the data sheets of their drives allow it (dummy mapping) and it makes the frames
    /// of a cycle shorter.
    Shared,
}

/// Interface of a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Interface {
    /// Simulated drives inside this process.
    Simulated,
    /// A SocketCAN network interface, by name.
    SocketCan(String),
    /// An SLCAN adapter on a serial line.
    Slcan(CanLine),
    /// A transparent converter between RS-485 and CAN FD on a serial line.
    Converter(CanLine),
    /// A serial line with drives on it, and no CAN bus.
    Serial(SerialDevice),
}

/// A serial line with drives on it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SerialDevice {
    /// The path of the device: `/dev/ttyUSB0`.
    pub device: String,
    /// bit/s, where it is named with the device; then it is that of the bus.
    pub bit_rate: Option<u32>,
}

/// The serial line of an adapter or a converter, behind which a bus is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanLine {
    /// The path of the device: `/dev/ttyACM0`.
    pub device: String,
    /// Baud of the line. Default 1,000,000. An adapter without a chip for a serial line (`/dev/ttyACM…`) ignores it.
    pub baud_rate: u32,
}

/// Limits on what a source commands to the torque loop of an axis: of an impedance, and of how fast a torque changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance {
    /// The highest stiffness of an impedance: N·m/rad (N/m). Default: that of the axis' own loop; 0 where it has none.
    pub stiffness_max: f64,
    /// The highest damping of an impedance: N·m·s/rad (N·s/m). Default: that of the axis' own loop; 0 where it has none.
    pub damping_max: f64,
    /// The time in which the torque goes from zero to its limit when a source asks for that. Default 100 ms.
    pub torque_rise_ns: u64,
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name in the configuration and the report.
    pub name: String,
    /// Its bus, an index into [`Config::buses`].
    pub bus: usize,
    /// The CANopen node ID of its drive, 1 to 127. Axes of one drive with several axes have the same bus and node ID, and each
    /// another [`node_axis`](super::DriveFacts::node_axis).
    pub node: u8,
    /// The family of the drive.
    pub drive: DriveFamily,
    /// Control mode, with the gains of the loop that the controller closes itself. Default: position.
    pub control: Control,
    /// The modes that it may be changed to at run time, beside that one, with their gains: cyclic synchronous modes, each once.
    /// Everything that each of them needs is required and mapped. Default: none.
    pub other_modes: Vec<Control>,
    /// Rotary (the default) or linear.
    pub travel: Travel,
    /// Counts of one turn of the position that the drive reports. Default: the family's.
    pub counts_per_turn: f64,
    /// Turns of the reported position for one turn of the joint. Default 1.
    pub gear_ratio: f64,
    /// True if positive counts are negative travel. Default `false`.
    pub reversed: bool,
    /// The count at which the joint's position is zero. Default 0.
    pub zero_counts: i32,
    /// Limits that are never exceeded.
    pub limits: Limits,
    /// Which limits a robot description has, and which the configuration. Default: there is none.
    pub urdf: Option<UrdfLimits>,
    /// The unit in which its positions are shown to people. Default: that in which the file has the limits of its position.
    pub shown_in: PositionUnit,
    /// Limits on what a source commands to the torque loop. Default: no more than the gains of the axis' own loop.
    pub compliance: Compliance,
    /// Feed-forward that is sent with the target. Default: none.
    pub feed_forward: FeedForward,
    /// Limit of the following error.
    pub following_error: FollowingError,
    /// Largest distance from the joint to the first point of a stream: rad (m). Default 0.02 rad or 0.002 m.
    pub start_tolerance: f64,
    /// Largest distance from the target at which a program counts as finished: rad (m). Default 0.01 rad or 1 mm; in CST
    /// 1.5 · coulomb_friction / stiffness where that is more, since static friction holds a joint off its target there.
    pub target_tolerance: f64,
    /// Handling of a stream beyond the limits. Default: the axis follows as far as they go.
    pub follow: Follow,
    /// Cycles without feedback before the group stops. Default 5.
    pub missed_feedback_cycles: u16,
    /// Transmission type of the PDOs (1 = every SYNC). Default 1.
    pub transmission_type: u8,
    /// Whose mapping of the PDOs counts. Default: the controller's, or the drive's where the family cannot be
    /// mapped.
    pub mapping: PdoMapping,
    /// Feedback of every cycle besides statusword and position. Default: the mode of operation, where the PDOs are
    /// written.
    pub feedback: Vec<Feedback>,
    /// True if the drive answers SYNC with its position, the default, or set-points alone, which spares the bus a frame and makes
    /// the feedback a cycle older. Only drives with [`may_ignore_sync`](super::DriveFacts::may_ignore_sync) can do that; the
    /// others always answer SYNC.
    pub answers_sync: bool,
    /// The longest time from SYNC until the drive has its feedback ready to be sent. Default 20 µs.
    pub feedback_delay_ns: u64,
    /// Period of the drive's own heartbeat (object 1017); `None`, the default, leaves it off: feedback in every cycle
    /// proves the drive alive without loading the bus. A drive without a heartbeat is asked at this period instead, by default at
    /// that of the controller's heartbeat: node guarding, see [`Axis::supervision`].
    pub heartbeat_ns: Option<u64>,
    /// Expected identity of the drive, compared at bring-up. Default: the family's, any revision.
    pub identity: Identity,
    /// Configuration file (DCF or concise DCF), whose values are written to the drive at bring-up, before the controller writes
    /// what it needs itself. Default: none.
    pub dcf: Option<DeviceConfiguration>,
    /// From power-up of the drive to its first answer; commissioning waits for it. Default 200 ms.
    pub power_up_ns: u64,
    /// The mechanics of the joint.
    pub joint: Joint,
    /// The simulated drive, besides the joint.
    pub simulated: SimulatedJoint,
}

impl Axis {
    /// Returns the control modes: the one in which it starts, and those to which it may be changed.
    pub fn controls(&self) -> impl Iterator<Item = &Control> {
        std::iter::once(&self.control).chain(&self.other_modes)
    }
}

impl Travel {
    /// Returns the travel of the joint for one turn: rad (m).
    pub const fn per_turn(self) -> f64 {
        match self {
            Self::Rotary => TAU,
            Self::Linear { lead_m } => lead_m,
        }
    }
}

/// Whose mapping of a drive's PDOs counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PdoMapping {
    /// The controller writes it at bring-up.
    Written,
    /// The drive keeps what it has, tells it at bring-up, and the controller works with that.
    AsStored,
}

/// Something a drive can report every cycle beside statusword and position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
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

impl Feedback {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::OperationMode, Self::Velocity, Self::Torque, Self::Current, Self::ErrorCode];

    /// The word for it in a configuration.
    pub const fn word(self) -> &'static str {
        match self {
            Self::OperationMode => "operation_mode",
            Self::Velocity => "velocity",
            Self::Torque => "torque",
            Self::Current => "current",
            Self::ErrorCode => "error_code",
        }
    }

    /// Its size in a PDO, in bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::OperationMode => 1,
            Self::Velocity => 4,
            Self::Torque | Self::Current | Self::ErrorCode => 2,
        }
    }
}

/// Limit of the following error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowingError {
    /// rad or m. Default 0.1 rad or 0.01 m.
    pub limit: f64,
    /// For how long it may be further. Default 50 ms.
    pub time_ns: u64,
}

/// The moves of `takt run`, one after the other, the whole list `repeat` times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// Number of passes, at least 1. Default 1.
    pub repeat: u32,
    /// The moves.
    pub moves: Vec<ProgramMove>,
}

/// A coordinated move of every axis to rest, or for drives in profile velocity or torque a time at one.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramMove {
    /// The group that moves, an index into [`Config::groups`]; 0 where there are no groups.
    pub group: usize,
    /// Targets of the axes of the group, in their order.
    pub target: ProgramTarget,
    /// Fraction of the velocity limits. Default 1.
    pub velocity_scale: f64,
    /// Fraction of the acceleration and jerk limits. Default 1.
    pub acceleration_scale: f64,
    /// The move takes at least this long, in seconds. Default 0.
    pub minimum_duration_s: f64,
    /// Standstill after it, in seconds. Default 0.
    pub dwell_s: f64,
}

/// Target of a move, for every axis.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ProgramTarget {
    /// To be there: rad (m).
    Position(Vec<f64>),
    /// Drives in profile velocity go at a speed for a time, and stop.
    Velocity {
        /// rad/s (m/s); 0 for axes in other modes.
        velocity: Vec<f64>,
        /// In seconds, from when it has been reached.
        duration_s: f64,
    },
    /// Drives in profile torque push with a torque for a time, and let go.
    Torque {
        /// N·m (N); 0 for axes in other modes.
        torque: Vec<f64>,
        /// In seconds, from when it has been reached.
        duration_s: f64,
    },
}

/// Recordings and black boxes.
#[derive(Clone, Debug, PartialEq)]
pub struct Telemetry {
    /// The folder for recordings. Default `runs`.
    pub directory: PathBuf,
    /// True if a recording is made. Default `true`.
    pub is_recorded: bool,
    /// True if the frames of every bus are written as candump logs. Default `false`.
    pub is_candump_written: bool,
    /// Length of the black box that is written at a fault; 100 ms to 60 s, `None` has no black box.
    /// Default 5 s.
    pub black_box_ns: Option<u64>,
    /// Cycle records that the ring to the logger can hold. Default 4096.
    pub ring_records: usize,
}

/// Simulated buses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulation {
    /// Seed of everything random. Default 1.
    pub seed: u64,
    /// A pause of this process that is longer than this stops the simulated world too: the host's stalls are
    /// not the bus's. A period of the cycle at least; default 2 ms, or two periods where that is more.
    pub longest_gap_ns: u64,
    /// True if too many missed slots stop the group although every bus is simulated, as they do on a real one. Default no:
    /// the drives stand still while the process does, and nothing is lost by a slot that they miss as well.
    pub stops_for_missed_slots: bool,
}

/// The mechanics of a joint. The torque loop of CST feeds them forward, and the simulated joint obeys them. An axis in CST on a
/// real bus must give inertia and friction; elsewhere there are defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joint {
    /// Rotor and load at the joint: kg·m² (kg). Default 1.
    pub inertia: Option<f64>,
    /// N·m·s/rad (N·s/m). Default 1.
    pub viscous_friction: Option<f64>,
    /// N·m (N). Default 0.5.
    pub coulomb_friction: Option<f64>,
    /// The rated torque of the drive at the joint: N·m (N). What the drive reports (object 6076) goes before it. Default: the
    /// torque limit.
    pub rated_torque: Option<f64>,
}

/// The simulated drive of an axis, besides its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedJoint {
    /// The torque of gravity a quarter turn from 0, where the joint hangs: N·m (the weight of a linear axis: N). Default 0.
    pub gravity: f64,
    /// Dependence of the Coulomb friction on the speed. Default: none.
    pub friction: FrictionShape,
    /// Peak torque: N·m (N). Default: three times the rated torque.
    pub peak_torque: f64,
    /// Position at power-up: rad (m). Default 0, or the limit nearest to it.
    pub initial_position: f64,
    /// The NMT state after power-up; operational only where the family allows it. Default: pre-operational.
    pub power_up: PowerUpState,
}
