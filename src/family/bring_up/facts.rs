//! What a bring-up reads from a drive.

use takt_rt::{Cia402Codec, DriveState};
use takt_wire::canopen::emcy::{Emergency, ErrorCode};
use takt_wire::canopen::object::ObjectAddress;

use super::process_data::ProcessData;

/// What a drive has reported, each value as it was last read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisFacts {
    /// The codec of its statusword.
    pub codec: Cia402Codec,
    /// Its identity.
    pub identity: DeviceIdentity,
    /// Its names and versions, where it has them.
    pub texts: DeviceTexts,
    /// Object 6502: a bit for each mode.
    pub supported_modes: u32,
    /// Object 6041.
    pub statusword: u16,
    /// Object 603F.
    pub error_code: ErrorCode,
    /// Object 6064 in counts.
    pub position_counts: i32,
    /// Object 6076 in N·m: 1000 per mille of torque objects. `None` when the drive does not report it.
    pub rated_torque: Option<f64>,
    /// Object 6075 in A: 1000 per mille of current objects. `None` when the drive does not report it.
    pub rated_current_a: Option<f64>,
    /// Object 6072 in per mille of the rated torque. `None` when the drive does not have it.
    pub max_torque_per_mille: Option<u16>,
    /// Object 605A. `None` when the drive does not have it.
    pub quick_stop_option_code: Option<i16>,
    /// The last emergency message, unless an "error reset" message (code 00xx) followed.
    pub emergency: Option<Emergency>,
    /// The process data that the drive has reported, if its own mapping is used.
    pub process_data: Option<ProcessData>,
    /// Optional objects that the drive does not have.
    pub absent: Vec<ObjectAddress>,
    /// Number of boot-ups after the first one; each led to a new configuration. A reset during the drive's power-up
    /// also counts, because the drive executes it later.
    pub restarts: u8,
}

/// Objects 1000 and 1018.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceIdentity {
    /// Object 1000.
    pub device_type: u32,
    /// Object 1018:1.
    pub vendor_id: u32,
    /// Object 1018:2.
    pub product_code: u32,
    /// Object 1018:3.
    pub revision_number: u32,
}

/// Objects 1008, 1009 and 100A, where they exist.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceTexts {
    /// Object 1008.
    pub device_name: Option<String>,
    /// Object 1009.
    pub hardware_version: Option<String>,
    /// Object 100A.
    pub software_version: Option<String>,
}

impl AxisFacts {
    /// The state in the last statusword.
    pub const fn state(&self) -> DriveState {
        self.codec.state(self.statusword)
    }

    /// The error code of a drive in a fault: object 603F; when it is zero, the code of the last emergency message.
    pub fn fault(&self) -> Option<ErrorCode> {
        let reported = match self.error_code {
            ErrorCode::NONE => self.emergency.map_or(ErrorCode::NONE, |emergency| emergency.code),
            code => code,
        };
        self.state().is_faulted().then_some(reported)
    }
}
