//! What a simulated drive is to its bus: a passive machine that is handed frames and time, and leaves frames in its
//! mailbox. It has no thread and asks no clock, so that the same drive runs on a simulated bus in virtual time, on one
//! in wall-clock time, and behind a real interface.

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::defect::{Defect, Unsupported};
use super::mailbox::Mailbox;

/// A simulated drive on a CAN bus. Time never runs backwards between calls, and no call takes heap memory.
pub trait Drive: Send {
    /// Its node number.
    fn node(&self) -> u8;

    /// Takes a frame of another station, whose last bit came at `now_ns`.
    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox);

    /// Lives on until `now_ns` and does what is due.
    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox);

    /// When it wants to be advanced next, always after the present that it was last told.
    fn wake_ns(&self) -> Nanoseconds;

    /// What an observer with eyes for everything sees at `now_ns`. Looking changes nothing.
    fn observe(&mut self, now_ns: Nanoseconds) -> Observation;

    /// Something breaks. The drive notices it when it is advanced next.
    fn inject(&mut self, fault: DriveFault);

    /// The supply is cut and returns at once: the drive starts anew, with what it had saved. The joint keeps its
    /// position, and the brake stops it.
    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox);

    /// Sets a torque from outside on the joint: N·m (N). It lasts until it is set again.
    fn set_load_torque(&mut self, torque: f64);

    /// Something about the drive or its joint is wrong from `now_ns` on (`is_present`), or is well again. An event just
    /// happens when it comes, and has nothing to mend.
    ///
    /// # Errors
    /// [`Unsupported`] when this drive cannot be broken in this way; nothing has changed then.
    fn afflict(&mut self, now_ns: Nanoseconds, defect: Defect, is_present: bool) -> Result<(), Unsupported>;
}

/// The truth about a simulated drive and its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// True position of the joint: rad (m).
    pub position: f64,
    /// True velocity of the joint: rad/s (m/s).
    pub velocity: f64,
    /// Torque of the motor at the joint: N·m (N).
    pub torque: f64,
    /// What the drive reports as position: counts.
    pub position_counts: i32,
    /// The state of its CiA 402 machine.
    pub state: DriveState,
    /// Its statusword (object 6041).
    pub statusword: u16,
    /// Its error code (object 603F).
    pub error_code: u16,
    /// The mode of operation that is in force (object 6061).
    pub operation_mode: i8,
    /// Its state as a CANopen node.
    pub nmt: NmtState,
    /// Whether the brake is engaged.
    pub is_braked: bool,
}

/// The state of a CANopen node (CiA 301, 7.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtState {
    /// Starting; says and hears nothing.
    Initialising,
    /// SDO, no PDO.
    PreOperational,
    /// Everything.
    Operational,
    /// NMT and error control only.
    Stopped,
}

impl NmtState {
    /// The number in heartbeat and guarding frames.
    pub const fn code(self) -> u8 {
        match self {
            Self::Initialising => 0,
            Self::Stopped => 4,
            Self::Operational => 5,
            Self::PreOperational => 127,
        }
    }
}

/// Something that breaks in a drive. The error codes are those of CiA 402-2 (IEC 61800-7-201), unless the drive's
/// own is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveFault {
    /// Short circuit or over-current at the motor: 0x2310. Power is cut at once.
    OverCurrent,
    /// Over-voltage in the intermediate circuit: 0x3210. Power is cut at once.
    OverVoltage,
    /// Under-voltage in the intermediate circuit: 0x3220. Power is cut at once.
    UnderVoltage,
    /// The drive is too hot: 0x4310. The drive decelerates first.
    OverTemperature,
    /// The position encoder has failed: 0x7305. Power is cut at once.
    Encoder,
    /// The battery of the multi-turn encoder is empty: 0x730F. A fault reset does not clear it.
    MultiTurnBattery,
    /// Something holds the rotor: 0x7121. Power is cut at once.
    BlockedRotor,
    /// The motor does not come to the demanded speed: 0x8400. Power is cut at once.
    Stall,
}
