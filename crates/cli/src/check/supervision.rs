//! How an axis and the controller see that the other one is there.

use serde::Serialize;
use takt::config::{Axis, Config, Supervision};
use takt::family::{SignOfLife, stops_by_itself_after};

/// By what, and after which time, the one notices that the other is gone.
#[derive(Clone, PartialEq, Serialize)]
pub struct SupervisionCheck {
    /// How the controller sees that the drive lives.
    pub drive: Sign,
    /// After so long without such a sign of life the group stops.
    pub drive_lost_after_ns: u64,
    /// How the drive sees that the controller lives; `None` if it does not.
    pub controller: Option<Sign>,
    /// After so long without a sign of life the drive stops by itself; `None` if it does not, or after a time that is not known.
    pub controller_lost_after_ns: Option<u64>,
}

/// A sign of life.
#[derive(Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "by", rename_all = "snake_case")]
pub enum Sign {
    /// The drive's feedback.
    Feedback,
    /// A heartbeat.
    Heartbeat {
        /// Its period.
        period_ns: u64,
    },
    /// Requests and replies of node guarding.
    NodeGuarding {
        /// The guard time.
        period_ns: u64,
    },
    /// A command.
    Command,
    /// A request on its serial line.
    Request,
}

impl SupervisionCheck {
    /// Of an axis.
    pub fn of(axis: &Axis, config: &Config) -> Self {
        let supervision = axis.supervision(&config.master);
        let drive = match supervision {
            Supervision::Feedback => Sign::Feedback,
            Supervision::Heartbeat { period_ns } => Sign::Heartbeat { period_ns },
            Supervision::Guarding { guard_time_ns, .. } => Sign::NodeGuarding { period_ns: guard_time_ns },
        };
        let watchdog = stops_by_itself_after(axis, config).ok();
        let controller = watchdog.and_then(|watchdog| match watchdog.sign {
            SignOfLife::Heartbeat => {
                config.master.heartbeat_ns.map(|period_ns| Sign::Heartbeat { period_ns })
            }
            SignOfLife::Guarding => Some(drive),
            SignOfLife::Command => Some(Sign::Command),
            SignOfLife::Request => Some(Sign::Request),
            _ => None,
        });
        let cycle_ns = config.bus_cycle(axis.bus).period_ns;
        let feedback_ns = u64::from(axis.missed_feedback_cycles).saturating_mul(cycle_ns);
        Self {
            drive,
            drive_lost_after_ns: supervision.timeout_ns().unwrap_or(feedback_ns),
            controller,
            controller_lost_after_ns: watchdog.and_then(|watchdog| watchdog.timeout_ns),
        }
    }
}

impl Sign {
    /// It in words.
    pub fn words(self, time: impl Fn(u64) -> String) -> String {
        match self {
            Self::Feedback => "feedback alone".to_owned(),
            Self::Heartbeat { period_ns } => format!("heartbeat every {}", time(period_ns)),
            Self::NodeGuarding { period_ns } => format!("node guarding every {}", time(period_ns)),
            Self::Command => "commands".to_owned(),
            Self::Request => "requests".to_owned(),
        }
    }
}
