//! The load of a bus, by the frames that have passed its port.

use takt_rt::{BusHealth, Nanoseconds};
use takt_wire::wire_length::WireLength;

use super::machine::BusDescription;
use crate::link::trace::{TracedFrame, TracedHealth};

/// How often it is told.
const PERIOD_NS: Nanoseconds = 100_000_000;

/// Counts how long the frames of a bus have occupied it.
pub struct BusLoad {
    bit_rates: (u32, Option<u32>),
    health: BusHealth,
    /// When it was told last.
    told_ns: Option<Nanoseconds>,
}

impl BusLoad {
    /// Of this bus; `None` if its bit rate is not known.
    pub fn of(description: &BusDescription) -> Option<Self> {
        let bit_rates = (description.bit_rate?, description.data_bit_rate);
        Some(Self { bit_rates, health: BusHealth::default(), told_ns: None })
    }

    /// Adds a frame. Returns the state of the bus when it is time to tell it.
    pub fn frame(&mut self, traced: &TracedFrame) -> Option<TracedHealth> {
        let (bit_rate, data_bit_rate) = self.bit_rates;
        let now_ns = traced.at_ns;
        let is_due = self.told_ns.is_none_or(|told_ns| now_ns.saturating_sub(told_ns) >= PERIOD_NS);
        let told = is_due.then_some(TracedHealth { at_ns: now_ns, health: self.health });
        if is_due {
            self.told_ns = Some(now_ns);
        }
        self.health.busy_ns += WireLength::of(&traced.frame).duration_ns(bit_rate, data_bit_rate);
        self.health.tx_frames += u64::from(traced.is_sent);
        self.health.rx_frames += u64::from(!traced.is_sent);
        told
    }

    /// Takes a change of the state of the bus, and adds what was counted here.
    pub fn change(&mut self, change: &TracedHealth) -> TracedHealth {
        let BusHealth { busy_ns, tx_frames, rx_frames, .. } = self.health;
        self.health = BusHealth { busy_ns, tx_frames, rx_frames, ..change.health };
        TracedHealth { at_ns: change.at_ns, health: BusHealth { busy_ns, ..change.health } }
    }
}

#[cfg(test)]
mod tests {
    use takt_rt::{BusState, Frame, Id};

    use super::*;

    #[test]
    fn the_load_is_told_ten_times_a_second_with_the_time_that_the_frames_took() {
        let description = BusDescription {
            name: "left".to_owned(),
            interface: "can0".to_owned(),
            bit_rate: Some(1_000_000),
            data_bit_rate: None,
        };
        let mut load = BusLoad::of(&description).unwrap();
        let frame = Frame::of(Id::canopen(0x200, 1), [0x55; 8]);
        let frame_ns = WireLength::of(&frame).duration_ns(1_000_000, None);
        let told: Vec<TracedHealth> = (0..1000)
            .filter_map(|at_ms| load.frame(&TracedFrame { at_ns: at_ms * 1_000_000, is_sent: true, frame }))
            .collect();
        let times_ms: Vec<u64> = told.iter().map(|told| told.at_ns / 1_000_000).collect();
        assert_eq!(times_ms, (0..10).map(|tenth| tenth * 100).collect::<Vec<_>>());
        assert!((0..).zip(&told).all(|(tenth, told)| told.health.busy_ns == tenth * 100 * frame_ns));
        let health = BusHealth { state: BusState::BusOff, errors: 3, ..BusHealth::default() };
        let change = load.change(&TracedHealth { at_ns: 5, health });
        assert_eq!((change.health.state, change.health.busy_ns), (BusState::BusOff, 1000 * frame_ns));
    }
}
