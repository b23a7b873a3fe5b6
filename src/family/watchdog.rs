//! Drives whose controller is gone: the one fact that the engine, `takt check`, the end of a run and its report read.

use std::fmt;

use takt_rt::Nanoseconds;

use super::registry;
use crate::config::{Axis, Config, ErrorControl, Supervision};

/// How long a drive that does not stop by itself is told to stop at the end of a run, at the least: longer than a bus is usually
/// disturbed. Such a drive that has misheard it would go on without end.
const UNWATCHED_SHUT_DOWN_NS: Nanoseconds = 1_000_000_000;

/// The watchdog of a drive on its controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Watchdog {
    /// What the drive waits for.
    pub sign: SignOfLife,
    /// From the last sign of life to the stop; `None` where a setting of the drive decides that takt does not know.
    pub timeout_ns: Option<Nanoseconds>,
}

/// A sign of life of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SignOfLife {
    /// A heartbeat (object 1016).
    Heartbeat,
    /// A request of node guarding (objects 100C and 100D).
    Guarding,
    /// A command of the cycle.
    Command,
    /// A request on a serial line.
    Request,
}

/// Why a drive does not stop by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unwatched {
    /// It has no watchdog.
    NoWatchdog,
    /// It has neither a consumer heartbeat (1016) that can be written nor node guarding.
    NoErrorControl,
    /// `[master] heartbeat` is off.
    HeartbeatOff,
    /// `communication_timeout` of the axis is off.
    TimeoutOff,
}

impl Watchdog {
    /// A watchdog that waits so long for this sign of life.
    pub const fn new(sign: SignOfLife, timeout_ns: Option<Nanoseconds>) -> Self {
        Self { sign, timeout_ns }
    }

    /// The watchdog of a CANopen drive: its consumer heartbeat, or node guarding (CiA 301, 7.2.8).
    ///
    /// # Errors
    /// It does not stop by itself.
    pub fn of_canopen(axis: &Axis, config: &Config) -> Result<Self, Unwatched> {
        let (supervision, master) = (axis.supervision(&config.master), &config.master);
        let can_be_guarded = matches!(axis.drive.error_control, ErrorControl::Guarding { .. });
        match supervision {
            Supervision::Guarding { .. } => Ok(Self::new(SignOfLife::Guarding, supervision.timeout_ns())),
            _ if !axis.drive.consumes_heartbeat && !can_be_guarded => Err(Unwatched::NoErrorControl),
            _ if master.heartbeat_ns.is_none() => Err(Unwatched::HeartbeatOff),
            _ => Ok(Self::new(SignOfLife::Heartbeat, Some(master.heartbeat_timeout_ns))),
        }
    }
}

impl fmt::Display for Watchdog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.timeout_ns {
            Some(timeout_ns) => write!(f, "stops by itself {} ms", timeout_ns.div_ceil(1_000_000))?,
            None => f.write_str("stops by itself, after a time that is set in it,")?,
        }
        f.write_str(match self.sign {
            SignOfLife::Heartbeat => " after the last heartbeat that it has heard",
            SignOfLife::Guarding => " after the last request of node guarding that it has heard",
            SignOfLife::Command => " after the last command that it has heard",
            SignOfLife::Request => " after the last request that it has heard, by its communication time-out",
        })
    }
}

impl Unwatched {
    /// The reason in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::NoWatchdog => "its drive has no watchdog",
            Self::NoErrorControl => {
                "its drive has neither a consumer heartbeat (1016) that can be written nor node guarding"
            }
            Self::HeartbeatOff => "[master] heartbeat is off",
            Self::TimeoutOff => "its communication_timeout is off",
        }
    }

    /// What helps.
    pub(super) const fn cure(self) -> &'static str {
        match self {
            Self::HeartbeatOff => "switch the heartbeat on",
            Self::TimeoutOff => "give it a communication_timeout",
            Self::NoWatchdog | Self::NoErrorControl => {
                "have its supply cut by a relay that opens when the controller's output or heartbeat stops"
            }
        }
    }
}

impl fmt::Display for Unwatched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.words())
    }
}

/// The watchdog of the drive of an axis.
///
/// # Errors
/// The drive does not stop by itself.
pub fn stops_by_itself_after(axis: &Axis, config: &Config) -> Result<Watchdog, Unwatched> {
    registry::of(&axis.drive).stops_by_itself_after(axis, config)
}

/// How long the drive of an axis is told to stop, at the least, before the controller leaves it.
pub(crate) fn least_shut_down_ns(axis: &Axis, config: &Config) -> Nanoseconds {
    stops_by_itself_after(axis, config).map_or(UNWATCHED_SHUT_DOWN_NS, |_| 0)
}

/// Sentences about axes, by their indices, whose drives did not confirm in the end that they have no torque. Axes that stop for the
/// same reason, or do not for the same reason, are in one.
pub fn unreached_words(config: &Config, unreached: &[usize]) -> Vec<String> {
    let mut groups: Vec<(Result<Watchdog, Unwatched>, Vec<&str>)> = vec![];
    for axis in unreached.iter().filter_map(|index| config.axes.get(*index)) {
        let fact = stops_by_itself_after(axis, config);
        match groups.iter_mut().find(|(known, _)| *known == fact) {
            Some((_, names)) => names.push(&axis.name),
            None => groups.push((fact, vec![&axis.name])),
        }
    }
    let words = |(fact, names): (Result<Watchdog, Unwatched>, Vec<&str>)| {
        let fact = match fact {
            Ok(watchdog) => {
                format!("if it was brought up and obeys its watchdog, it {watchdog}, which is not confirmed")
            }
            Err(unwatched) => format!("it does not stop by itself ({unwatched})"),
        };
        format!(
            "{}: the drive has not confirmed that it has no torque, so that the axis may still move; {fact}. Make sure that it stands \
             before you come near, and switch its power off before you repair the bus",
            names.join(", ")
        )
    };
    groups.into_iter().map(words).collect()
}
