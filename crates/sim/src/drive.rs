//! The interface of a simulated drive: a passive state machine. The bus passes frames and time to it, and takes frames
//! from its mailbox. It has no thread and reads no clock, so the same drive runs in virtual time, in wall-clock time,
//! and on a real interface.

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::defect::{Defect, Unsupported};
use super::mailbox::Mailbox;
use super::plant::Gravity;

/// A simulated drive on a CAN bus. Time never runs backwards between calls, and no call allocates memory.
pub trait Drive: Send {
    /// Its node ID.
    fn node(&self) -> u8;

    /// Receives a frame of another station, whose last bit arrived at `now_ns`.
    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox);

    /// Advances to `now_ns` and does what is due.
    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox);

    /// The time of its next action, always later than the `now_ns` of the last call.
    fn wake_ns(&self) -> Nanoseconds;

    /// The true state at `now_ns`. Observing changes nothing.
    fn observe(&mut self, now_ns: Nanoseconds) -> Observation;

    /// Injects a fault. The drive detects it at its next advance.
    fn inject_fault(&mut self, fault: DriveFault);

    /// Cuts the supply and restores it at once: the drive boots with its saved parameters. The joint keeps its
    /// position, and the brake stops it.
    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox);

    /// From now on gravity loads the joint so.
    fn set_gravity(&mut self, gravity: Gravity);

    /// Sets the external load torque on the joint: N·m (N). It lasts until it is set again.
    fn set_load_torque(&mut self, torque: f64);

    /// Injects a defect from `now_ns` on (`is_present`), or removes it. An event happens at once and is not removed.
    ///
    /// # Errors
    /// [`Unsupported`] when this drive cannot have the defect; nothing has changed then.
    fn inject_defect(
        &mut self,
        now_ns: Nanoseconds,
        defect: Defect,
        is_present: bool,
    ) -> Result<(), Unsupported>;
}

/// The true state of a simulated drive and its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// True position of the joint: rad (m).
    pub position: f64,
    /// True velocity of the joint: rad/s (m/s).
    pub velocity: f64,
    /// Torque of the motor at the joint: N·m (N).
    pub torque: f64,
    /// The reported position in counts.
    pub position_counts: i32,
    /// Its CiA 402 state.
    pub state: DriveState,
    /// Its statusword (object 6041).
    pub statusword: u16,
    /// Its error code (object 603F).
    pub error_code: u16,
    /// The current mode of operation (object 6061).
    pub operation_mode: i8,
    /// Its NMT state.
    pub nmt: NodeState,
    /// True if the brake is engaged.
    pub is_braked: bool,
}

/// The NMT state of a simulated drive (CiA 301, 7.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeState {
    /// Booting; neither sends nor receives.
    Initialising,
    /// SDO works, PDOs do not.
    PreOperational,
    /// All services work.
    Operational,
    /// Only NMT and error control work.
    Stopped,
}

impl NodeState {
    /// The code in heartbeat and node guarding frames.
    pub const fn code(self) -> u8 {
        match self {
            Self::Initialising => 0,
            Self::Stopped => 4,
            Self::Operational => 5,
            Self::PreOperational => 127,
        }
    }
}

/// The cause of a drive fault. The error codes are those of CiA 402-2 (IEC 61800-7-201), unless the drive's own is
/// known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DriveFault {
    /// Short circuit or over-current at the motor: 0x2310. Power is cut at once.
    OverCurrent,
    /// Over-voltage in the intermediate circuit: 0x3210. Power is cut at once.
    OverVoltage,
    /// Under-voltage in the intermediate circuit: 0x3220. Power is cut at once.
    UnderVoltage,
    /// Over-temperature: 0x4310. The drive decelerates first.
    OverTemperature,
    /// Failure of the position encoder: 0x7305. Power is cut at once.
    Encoder,
    /// The battery of the multi-turn encoder is empty: 0x730F. A fault reset does not clear it.
    MultiTurnBattery,
    /// Blocked rotor: 0x7121. Power is cut at once.
    BlockedRotor,
    /// The motor does not reach the demanded speed: 0x8400. Power is cut at once.
    Stall,
}
