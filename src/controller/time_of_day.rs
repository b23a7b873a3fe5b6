//! Gives the cycle the time of day, which its monotonic clock does not have.

use takt_rt::Request;
use takt_wire::canopen::time::since_epoch_ns;

use crate::config::Config;
use crate::telemetry::WallClock;

/// The interval at which the cycle gets the time of day again, since the system's clock may have been set.
const RENEWAL_NS: u64 = 60_000_000_000;

/// Decides when the cycle gets the time of day, if the configuration sends TIME.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeOfDayKeeper {
    /// `None` if no TIME is sent.
    due_ns: Option<u64>,
}

impl TimeOfDayKeeper {
    pub fn of(config: &Config) -> Self {
        Self { due_ns: config.master.time_ns.map(|_| 0) }
    }

    /// The request that is due now.
    pub fn poll(&mut self, now_ns: u64, wall_clock: impl FnOnce() -> WallClock) -> Option<Request> {
        let due_ns = self.due_ns.as_mut().filter(|due_ns| now_ns >= **due_ns)?;
        *due_ns = now_ns.saturating_add(RENEWAL_NS);
        Some(Request::TimeOfDay { at_zero_ns: since_epoch_ns(wall_clock().unix_ns(0)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_given_at_once_and_again_every_minute() {
        let mut keeper = TimeOfDayKeeper { due_ns: Some(0) };
        let mut given =
            |now_ns, unix_s: u64| keeper.poll(now_ns, || WallClock::fixed(unix_s * 1_000_000_000));
        assert_eq!(given(5, 441_763_200), Some(Request::TimeOfDay { at_zero_ns: 0 }));
        assert_eq!(given(60_000_000_000, 441_763_200), None);
        let set = Request::TimeOfDay { at_zero_ns: 7_000_000_000 };
        assert_eq!(given(60_000_000_005, 441_763_207), Some(set));
        let mut silent = TimeOfDayKeeper { due_ns: None };
        assert_eq!(silent.poll(0, || WallClock::fixed(0)), None);
    }
}
