//! How often each drive of a line is spoken to.

use takt_rt::Nanoseconds;
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::MasterTiming;

use crate::config::{Config, Interface};
use crate::family::OffCycleBudget;
use crate::link::adapter_latency_ns;

/// From a request to its reply, at the longest. The manual says nothing of it; this is twice what is simulated.
const REPLY_NS: Nanoseconds = 2_000_000;
/// From the end of a wait to the next look at the line.
const LOOK_NS: Nanoseconds = 1_000_000;
/// What is waited beyond that for a reply, and after one that did not come.
const PATIENCE_NS: Nanoseconds = 20_000_000;
/// The longest exchanges of a round, request and reply in bytes: the set-point, the position, velocity and current.
const ROUND: [(usize, usize); 3] = [(13, 8), (8, 19), (8, 25)];

/// How long bytes take on a line, and how long its adapter holds them back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineBudget {
    /// The line.
    pub line: LineTiming,
    /// So long its adapter holds bytes back at most.
    pub latency_ns: Nanoseconds,
    /// The drives on it.
    pub drives: u32,
}

impl LineBudget {
    /// That of a bus of a configuration, on this machine.
    pub fn of(config: &Config, bus: usize) -> Option<Self> {
        let settings = config.buses.get(bus)?;
        let latency_ns = match &settings.interface {
            Interface::Serial(device) => adapter_latency_ns(&device.device).unwrap_or(0),
            Interface::Simulated
            | Interface::SocketCan(_)
            | Interface::Slcan(_)
            | Interface::Converter(_) => 0,
        };
        let drives = u32::try_from(config.axes_of_bus(bus).count()).unwrap_or(u32::MAX);
        Some(Self { line: LineTiming::new(settings.bit_rate), latency_ns, drives })
    }

    /// The times of its master. A request is not repeated: the next one brings what is new.
    pub const fn timing(&self) -> MasterTiming {
        let patience_ns = PATIENCE_NS + 2 * self.latency_ns;
        MasterTiming {
            reply_timeout_ns: patience_ns,
            late_reply_ns: patience_ns,
            retries: 0,
            ..MasterTiming::new(self.line)
        }
    }

    /// A set-point, a read of the position and another read for every drive: the time from one report of a drive to the next.
    pub fn round_ns(&self) -> Nanoseconds {
        let pause_ns = self.line.silence_ns() + REPLY_NS + self.latency_ns + LOOK_NS;
        let exchange = |(request, reply): &(usize, usize)| self.line.duration_ns(request + reply) + pause_ns;
        ROUND.iter().map(exchange).sum::<Nanoseconds>() * u64::from(self.drives.max(1))
    }

    /// So long the bytes of the round of one drive are on the line.
    fn bytes_ns(&self) -> Nanoseconds {
        ROUND.iter().map(|(request, reply)| self.line.duration_ns(request + reply)).sum()
    }

    /// What a drive of the line asks of it.
    pub fn of_drive(&self) -> OffCycleBudget {
        let round_ns = self.round_ns();
        OffCycleBudget {
            requests_per_s: ROUND.len() as f64 * 1e9 / round_ns as f64,
            report_ns: round_ns,
            bus_share: self.bytes_ns() as f64 / round_ns as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_has_the_bytes_the_silences_and_the_latency_of_the_adapter_for_every_drive() {
        let alone = LineBudget { line: LineTiming::new(115_200), latency_ns: 0, drives: 1 };
        // 81 bytes of 86.8 µs, and three times 4.75 ms.
        assert_eq!(alone.round_ns() / 1_000, 21_281);
        let three = LineBudget { drives: 3, ..alone };
        assert_eq!(three.round_ns(), 3 * alone.round_ns());
        let held_back = LineBudget { latency_ns: 16_000_000, ..alone };
        assert_eq!(held_back.round_ns(), alone.round_ns() + 3 * 16_000_000);
        let slow = LineBudget { line: LineTiming::new(9_600), ..alone };
        assert_eq!(slow.round_ns() / 1_000_000, 104);
        assert!((140.0..142.0).contains(&alone.of_drive().requests_per_s));
    }
}
