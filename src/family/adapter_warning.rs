//! What is to be known about a bus behind an SLCAN adapter or a converter on a serial line, and about the adapter of a serial line.

use takt_wire::bit_fields::FieldDevice;

use crate::config::{Config, Interface};
use crate::family::WarningKind;
use crate::family::bring_up::ProcessData;
use crate::link::{adapter_latency_ns, shortest_latency_command};

/// A line has these characters beside two for each byte of its frame: letter, identifier, length code and CR.
const LINE_CHARACTERS: u64 = 6;
/// A character is ten bits on a serial line: a start bit, eight bits, a stop bit.
const BITS_PER_CHARACTER: u64 = 10;
/// The devices of adapters without a chip for a serial line. USB alone says how fast they are.
const WITHOUT_SERIAL_CHIP: &str = "ttyACM";

/// The warnings about a bus, if it is behind an adapter.
pub fn of_bus(config: &Config, bus: usize) -> Vec<WarningKind> {
    let Some(settings) = config.buses.get(bus) else { return vec![] };
    let line = match &settings.interface {
        Interface::Slcan(line) => line,
        // Its load is that of its bus: the schedule has the time on the line, too.
        Interface::Converter(_) => {
            return vec![WarningKind::Adapter { interface: settings.interface.to_string() }];
        }
        Interface::Simulated | Interface::SocketCan(_) | Interface::Serial(_) => return vec![],
    };
    let mut kinds = vec![WarningKind::Adapter { interface: settings.interface.to_string() }];
    let characters = longest_direction(config, bus);
    let line_ns = characters * BITS_PER_CHARACTER * 1_000_000_000 / u64::from(line.baud_rate.max(1));
    let period_ns = config.bus_cycle(bus).period_ns;
    if line_ns > period_ns && !line.device.contains(WITHOUT_SERIAL_CHIP) {
        let needed = characters * BITS_PER_CHARACTER * 1_000_000_000 / period_ns.max(1);
        let device = line.device.clone();
        kinds.push(WarningKind::SlowLine { device, baud_rate: line.baud_rate, line_ns, period_ns, needed });
    }
    kinds
}

/// The adapter of a serial line is as fast as USB if it holds bytes back no longer than this.
const USB_NS: u64 = 1_000_000;

/// The warning about a serial line, if its adapter holds bytes back.
pub fn of_line(config: &Config, bus: usize) -> Option<WarningKind> {
    let Interface::Serial(line) = &config.buses.get(bus)?.interface else { return None };
    let latency_ns = adapter_latency_ns(&line.device).filter(|latency_ns| *latency_ns > USB_NS)?;
    Some(WarningKind::AdapterLatency { latency_ns, mend: shortest_latency_command(&line.device) })
}

/// The characters of a cycle in the direction that has more of them. A serial line carries both directions at once.
fn longest_direction(config: &Config, bus: usize) -> u64 {
    let sync = LINE_CHARACTERS;
    let (mut to_drives, mut from_drives) = (sync, 0);
    for axis in config.axes.iter().filter(|axis| axis.bus == bus) {
        let data = ProcessData::of(axis, config);
        if let Some(device) = axis.drive.description::<FieldDevice>() {
            let FieldDevice { description, .. } = device;
            to_drives += LINE_CHARACTERS + 2 * description.command.bytes as u64;
            from_drives += LINE_CHARACTERS + 2 * description.reply.bytes as u64;
        }
        let characters = |length: usize| LINE_CHARACTERS + 2 * length as u64;
        to_drives += data.commands.iter().map(|pdo| characters(pdo.length())).sum::<u64>();
        let sent = data.feedback.iter().chain(&data.unused);
        from_drives += sent.map(|pdo| characters(pdo.length())).sum::<u64>();
    }
    to_drives.max(from_drives)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn warnings(interface: &str, period_ns: u64) -> Vec<String> {
        let mut config = Config::load(Path::new("configs/arm6-erob.toml")).unwrap();
        config.cycle.period_ns = period_ns;
        config.buses[0].interface = interface.parse().unwrap();
        of_bus(&config, 0).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_bus_behind_an_adapter_is_not_hard_real_time_and_no_other_bus_is_warned_about() {
        let words = warnings("slcan:/dev/ttyACM0", 1_000_000);
        assert_eq!(words.len(), 1, "{words:?}");
        assert!(words[0].contains("USB is not hard real time"), "{words:?}");
        for interface in ["sim", "can0"] {
            assert_eq!(warnings(interface, 1_000_000), Vec::<String>::new());
        }
    }

    #[test]
    fn a_bus_behind_a_converter_is_not_hard_real_time_either() {
        let mut config = Config::load(Path::new("configs/hollow-leg-fd.toml")).unwrap();
        config.buses[0].interface = "rs485-canfd:/dev/ttyUSB0".parse().unwrap();
        let words: Vec<String> = of_bus(&config, 0).iter().map(ToString::to_string).collect();
        assert!(words.len() == 1 && words[0].contains("USB is not hard real time"), "{words:?}");
    }

    #[test]
    fn a_serial_line_that_is_slower_than_the_cycle_is_named_with_the_rate_that_it_would_need() {
        let words = warnings("slcan:/dev/ttyUSB0@115200", 1_000_000);
        assert!(words[1].contains("115200 baud") && words[1].contains("a cycle has 1 ms"), "{words:?}");
        assert_eq!(warnings("slcan:/dev/ttyUSB0@3000000", 1_000_000).len(), 1);
        assert_eq!(warnings("slcan:/dev/ttyUSB0@115200", 100_000_000).len(), 1);
    }
}
