//! Telling the cycle the time of day, which its clock does not know.

use takt_rt::Request;

use crate::canopen::time::since_epoch_ns;
use crate::config::Config;
use crate::telemetry::WallClock;

/// How long the cycle goes by the time that it was told last. After that it is told again, since the system's clock may
/// have been set.
const RENEWAL_NS: u64 = 60_000_000_000;

/// When the cycle of a configuration that sends TIME is to be told the time of day.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeOfDayKeeper {
    /// `None` where no TIME is sent.
    due_ns: Option<u64>,
}

impl TimeOfDayKeeper {
    pub fn of(config: &Config) -> Self {
        Self { due_ns: config.master.time_ns.map(|_| 0) }
    }

    /// What the cycle is to be told now.
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
    fn the_time_is_told_at_once_and_again_every_minute_in_case_the_clock_was_set() {
        let mut keeper = TimeOfDayKeeper { due_ns: Some(0) };
        let mut told = |now_ns, unix_s: u64| keeper.poll(now_ns, || WallClock::fixed(unix_s * 1_000_000_000));
        assert_eq!(told(5, 441_763_200), Some(Request::TimeOfDay { at_zero_ns: 0 }));
        assert_eq!(told(60_000_000_000, 441_763_200), None);
        let set = Request::TimeOfDay { at_zero_ns: 7_000_000_000 };
        assert_eq!(told(60_000_000_005, 441_763_207), Some(set));
        let mut silent = TimeOfDayKeeper { due_ns: None };
        assert_eq!(silent.poll(0, || WallClock::fixed(0)), None);
    }
}
