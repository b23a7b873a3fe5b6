//! How drive and controller see that the other one is there, beside process data: heartbeats, or node guarding (CiA 301, 7.2.8).

use super::error_control::ErrorControl;
use super::model::{Axis, Master};

/// The supervision of a drive that is in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supervision {
    /// Its feedback in every cycle alone shows that it lives.
    Feedback,
    /// It sends heartbeats.
    Heartbeat {
        /// Their period.
        period_ns: u64,
    },
    /// The controller asks it, and so the drive sees that the controller lives.
    Guarding {
        /// From one request to the next, in whole milliseconds: object 100C.
        guard_time_ns: u64,
        /// Number of guard times without a reply, or without a request, until node guarding fails: object 100D.
        life_time_factor: u8,
    },
}

/// Heartbeats that may be missed in a row, and a little time for the next one.
const HEARTBEATS: u64 = 3;
/// A single lost reply leaves the toggle bit of the next one unchanged, so that two are lost with it.
const SHORTEST_LIFE_TIME: u64 = 3;
const MILLISECOND_NS: u64 = 1_000_000;

impl Supervision {
    /// Returns the longest time without a sign of life of the drive; `None` where none is expected besides feedback.
    pub const fn timeout_ns(self) -> Option<u64> {
        match self {
            Self::Feedback => None,
            Self::Heartbeat { period_ns } => Some(HEARTBEATS.saturating_mul(period_ns)),
            Self::Guarding { guard_time_ns, life_time_factor } => {
                Some(guard_time_ns.saturating_mul(life_time_factor as u64))
            }
        }
    }
}

impl Axis {
    /// The supervision of the drive. The drive's own heartbeat is on where `heartbeat` of the axis asks for it. A drive that has
    /// none is guarded, at that period, or else at the period of the controller's heartbeat: beside its feedback nothing else
    /// shows the controller that it lives, and nothing may show the drive that the controller lives.
    pub fn supervision(&self, master: &Master) -> Supervision {
        match self.drive.error_control {
            ErrorControl::Heartbeat { fixed_ms } => {
                let fixed_ns = fixed_ms.map(|ms| u64::from(ms) * MILLISECOND_NS);
                fixed_ns
                    .or(self.heartbeat_ns)
                    .map_or(Supervision::Feedback, |period_ns| Supervision::Heartbeat { period_ns })
            }
            ErrorControl::Guarding { fixed_guard_time_ms, fixed_life_time_factor } => {
                let wanted_ns = self.heartbeat_ns.or(master.heartbeat_ns);
                let fixed_ns = fixed_guard_time_ms.map(|ms| u64::from(ms) * MILLISECOND_NS);
                let Some(wanted_ns) = wanted_ns else { return Supervision::Feedback };
                let guard_time_ns = fixed_ns.unwrap_or(wanted_ns).max(MILLISECOND_NS);
                let factor = master.heartbeat_timeout_ns.div_ceil(guard_time_ns).max(SHORTEST_LIFE_TIME);
                let factor = u8::try_from(factor).unwrap_or(u8::MAX);
                let life_time_factor = fixed_life_time_factor.unwrap_or(factor);
                Supervision::Guarding { guard_time_ns, life_time_factor }
            }
            ErrorControl::None => Supervision::Feedback,
        }
    }
}
