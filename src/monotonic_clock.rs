//! The clock of real time. Where takt runs in virtual time alone, there is none.

#[cfg(target_os = "linux")]
pub use takt_rt::linux::MonotonicClock;

/// Stands at zero.
#[cfg(not(target_os = "linux"))]
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock;

#[cfg(not(target_os = "linux"))]
impl takt_rt::Clock for MonotonicClock {
    fn now_ns(&mut self) -> u64 {
        0
    }

    fn wait_until(&mut self, _: u64) -> takt_rt::Wake {
        takt_rt::Wake { now_ns: 0, timer_latency_ns: 0, suspended_ns: 0 }
    }
}
