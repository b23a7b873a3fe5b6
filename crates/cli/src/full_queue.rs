//! Why frames do not leave an interface, and what mends it.

use takt::config::{Bus, Config, Interface};
use takt::link::{QUEUE_FRAMES, transmit_queue_length};
use takt_rt::{BusHealth, BusState, Snapshot};

/// How long an error-passive controller sends in vain until that counts. It may have been error-passive before the run, and a frame
/// takes less than a millisecond.
const UNACKNOWLEDGED_NS: u64 = 300_000_000;

/// Explains once for each bus why its frames do not leave.
pub struct FullQueues {
    /// The buses that have not been explained yet, with their index.
    unmentioned: Vec<(usize, Bus)>,
    /// The time of the first look.
    first_ns: Option<u64>,
}

impl FullQueues {
    /// For the buses of a configuration.
    pub fn new(config: &Config) -> Self {
        Self { unmentioned: config.buses.iter().cloned().enumerate().collect(), first_ns: None }
    }

    /// The explanations that are due now.
    pub fn poll(&mut self, snapshot: &Snapshot) -> impl Iterator<Item = String> + use<> {
        let mut said = vec![];
        let first_ns = *self.first_ns.get_or_insert(snapshot.at_ns);
        let is_sending = snapshot.at_ns.saturating_sub(first_ns) >= UNACKNOWLEDGED_NS;
        let is_stuck = |health: &&BusHealth| {
            health.tx_overruns > 0
                || is_sending && health.tx_frames == 0 && health.state == BusState::ErrorPassive
        };
        self.unmentioned.retain(|(index, bus)| {
            let health = snapshot.buses.get(*index).filter(is_stuck);
            said.extend(health.map(|health| explanation(bus, health, queue_length(bus))));
            health.is_none()
        });
        said.into_iter()
    }
}

/// The likely cause of a failure when frames found no room; `None` when none was lost.
pub fn cause(config: &Config, snapshot: &Snapshot) -> Option<String> {
    let overrun = |(_, health): &(&Bus, &BusHealth)| health.tx_overruns > 0;
    let (bus, health) = config.buses.iter().zip(&snapshot.buses).find(overrun)?;
    let frames = health.tx_overruns;
    Some(format!(
        "before that, {frames} frames found no room in the queue of bus {}: mend that first",
        bus.name
    ))
}

fn queue_length(bus: &Bus) -> Option<u32> {
    match &bus.interface {
        Interface::SocketCan(interface) => transmit_queue_length(interface),
        _ => None,
    }
}

fn explanation(bus: &Bus, health: &BusHealth, queue_length: Option<u32>) -> String {
    let Bus { name, interface, .. } = bus;
    let is_acknowledged = health.tx_frames > 0 && health.state == BusState::ErrorActive;
    match queue_length {
        _ if !is_acknowledged => format!(
            "bus {name}: no node acknowledges a frame. Is the drives' power on, is the bus terminated, is the bit rate \
             right?"
        ),
        Some(length) if length < QUEUE_FRAMES => format!(
            "bus {name} takes no more frames: the queue of {interface} holds only {length} (txqueuelen). A longer one: \
             sudo ip link set {interface} txqueuelen {QUEUE_FRAMES}"
        ),
        _ => format!(
            "bus {name} takes no more frames: they leave more slowly than they come. Do frames of a higher priority \
             flood the bus?"
        ),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn arm() -> Config {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs/arm6-erob.toml");
        Config::load(&path).unwrap()
    }

    #[test]
    fn frames_that_find_no_room_are_explained_once_for_each_bus() {
        let mut queues = FullQueues::new(&arm());
        let mut snapshot = Snapshot::default();
        assert_eq!(queues.poll(&snapshot).count(), 0);
        snapshot.buses[1].tx_overruns = 1;
        let said: Vec<String> = queues.poll(&snapshot).collect();
        assert!(said.len() == 1 && said[0].starts_with("bus wrist: "), "{said:?}");
        assert_eq!(queues.poll(&snapshot).count(), 0);
        snapshot.buses[0].tx_overruns = 1;
        assert_eq!(queues.poll(&snapshot).count(), 1);
    }

    #[test]
    fn a_bus_on_which_nobody_acknowledges_is_named_at_the_start_and_not_when_its_queue_is_full() {
        let mut queues = FullQueues::new(&arm());
        let mut snapshot = Snapshot { at_ns: 1_000_000_000, ..Snapshot::default() };
        snapshot.buses[1].state = BusState::ErrorPassive;
        assert_eq!(queues.poll(&snapshot).count(), 0, "it may have been error-passive before");
        snapshot.at_ns += UNACKNOWLEDGED_NS;
        let said: Vec<String> = queues.poll(&snapshot).collect();
        assert!(
            said.len() == 1 && said[0].starts_with("bus wrist: no node acknowledges a frame."),
            "{said:?}"
        );
        assert_eq!(queues.poll(&snapshot).count(), 0);
        // One that is acknowledged may be error-passive for other causes.
        snapshot.buses[0] = BusHealth { tx_frames: 1, ..snapshot.buses[1] };
        assert_eq!(queues.poll(&snapshot).count(), 0);
    }

    #[test]
    fn a_short_queue_is_told_from_a_bus_without_drives_and_from_a_flooded_one() {
        let bus = Bus { interface: Interface::SocketCan("can0".to_owned()), ..arm().buses[0].clone() };
        let healthy = BusHealth { tx_frames: 9, tx_overruns: 1, ..BusHealth::default() };
        let said = |health: &BusHealth, length| explanation(&bus, health, length);
        assert!(
            said(&healthy, Some(1))
                .ends_with("holds only 1 (txqueuelen). A longer one: sudo ip link set can0 txqueuelen 64")
        );
        assert!(said(&healthy, Some(1000)).ends_with("flood the bus?"));
        assert!(said(&healthy, None).ends_with("flood the bus?"));
        let passive = BusHealth { state: BusState::ErrorPassive, ..healthy };
        let unheard = BusHealth { tx_frames: 0, ..healthy };
        for health in [passive, unheard] {
            assert!(
                said(&health, Some(1)).contains("no node acknowledges a frame"),
                "{}",
                said(&health, Some(1))
            );
        }
    }

    #[test]
    fn a_failure_after_frames_were_lost_names_them_first() {
        let mut snapshot = Snapshot::default();
        assert_eq!(cause(&arm(), &snapshot), None);
        snapshot.buses[1].tx_overruns = 7;
        assert_eq!(
            cause(&arm(), &snapshot).unwrap(),
            "before that, 7 frames found no room in the queue of bus wrist: mend that first"
        );
    }
}
