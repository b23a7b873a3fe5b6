//! Serial adapters on USB: RS-485 lines and SLCAN adapters are reached through them.

use takt_wire::modbus::line_timing::LineTiming;

use super::finding::{Check, Finding, Group};
use super::source::Source;

const LATENCY: Check = Check {
    key: "serial_latency",
    group: Group::Serial,
    title: "latency timer",
    source: "/sys/bus/usb-serial/devices/*/latency_timer",
    why: "an FTDI chip holds received bytes back for this time, so that every reply of a drive is late by up to so much",
};

const RATE: Check = Check {
    key: "serial_rate",
    group: Group::Serial,
    title: "line rate",
    source: "stty -F",
    why: "at a low rate the bytes of a request and its reply take longer than the drive itself",
};

const DEVICES: &str = "/sys/bus/usb-serial/devices";

/// The longest latency that costs nothing: USB itself asks for bytes once a millisecond.
const GOOD_MS: u64 = 1;

/// The bytes of a read of a position by Modbus, and of its reply.
const EXCHANGE: usize = 8 + 9;
/// An exchange that takes longer than this (ns) leaves room for few readings in a second.
const SLOW_NS: u64 = 10_000_000;

pub fn findings(source: &Source) -> Vec<Finding> {
    source.names(DEVICES).iter().flat_map(|name| of_adapter(source, name)).collect()
}

fn of_adapter(source: &Source, name: &str) -> [Finding; 2] {
    let driver = source.link_name(&format!("{DEVICES}/{name}/driver"));
    let latency = source.text(&format!("{DEVICES}/{name}/latency_timer"));
    let device = format!("/dev/{name}");
    let rate = source.command("stty", &["-F", &device, "speed"]);
    [latency_of(name, driver.as_deref(), latency.as_deref()), rate_of(rate.ok().as_deref())]
        .map(|finding| finding.on(name))
}

fn latency_of(name: &str, driver: Option<&str>, latency: Option<&str>) -> Finding {
    let driver = driver.unwrap_or("an unknown driver");
    match latency.map(str::parse::<u64>) {
        None => LATENCY.good(format!("{driver} has none")),
        Some(Ok(ms)) if ms <= GOOD_MS => LATENCY.good(format!("{ms} ms ({driver})")).applied(true),
        Some(Ok(ms)) => LATENCY
            .could_be_better(format!("{ms} ms ({driver})"))
            .applied(false)
            .mend(format!("echo {GOOD_MS} | sudo tee {DEVICES}/{name}/latency_timer   # until it is unplugged"))
            .mend(format!(
                "echo 'ACTION==\"add\", SUBSYSTEM==\"usb-serial\", DRIVER==\"{driver}\", ATTR{{latency_timer}}=\"{GOOD_MS}\"' \
                 | sudo tee /etc/udev/rules.d/99-takt-serial.rules && sudo udevadm control --reload   # from now on"
            )),
        Some(Err(_)) => LATENCY.not_known(format!("{:?} ({driver})", latency.unwrap_or_default())),
    }
}

/// Who opens the line sets its rate: what is read is what the last program has left.
fn rate_of(answer: Option<&str>) -> Finding {
    let rate: Option<u32> = answer.and_then(|text| text.trim().parse().ok()).filter(|rate| *rate > 0);
    let Some(rate) = rate else {
        return RATE.not_known("`stty` does not tell: is the line open to this user?");
    };
    let line = LineTiming::new(rate);
    let exchange_ns = line.duration_ns(EXCHANGE) + 2 * line.silence_ns();
    let read = format!(
        "{rate} bit/s, as the last program has left it: reading a position by Modbus takes {:.1} ms and the time of the drive",
        exchange_ns as f64 / 1e6
    );
    if exchange_ns <= SLOW_NS {
        RATE.good(read)
    } else {
        RATE.could_be_better(read)
            .mend("# if this is the rate of your drives too: set them and the line to 115200 bit/s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn sixteen_milliseconds_of_an_ftdi_chip_are_found_with_the_command_that_mends_them() {
        let finding = latency_of("ttyUSB0", Some("ftdi_sio"), Some("16"));
        assert_eq!((finding.verdict, finding.read.as_str()), (Verdict::CouldBeBetter, "16 ms (ftdi_sio)"));
        let now =
            "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer   # until it is unplugged";
        assert_eq!(finding.mend[0], now);
        assert!(
            finding.mend[1].contains("DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\""),
            "{:?}",
            finding.mend
        );
        for (latency, verdict) in
            [(Some("1"), Verdict::Good), (None, Verdict::Good), (Some("?"), Verdict::NotKnown)]
        {
            assert_eq!(latency_of("ttyUSB0", Some("ch341-uart"), latency).verdict, verdict);
        }
    }

    #[test]
    fn a_rate_is_judged_by_the_time_of_an_exchange() {
        let finding = rate_of(Some("115200\n"));
        assert_eq!(finding.verdict, Verdict::Good);
        assert!(finding.read.contains("takes 5.0 ms"), "{}", finding.read);
        let slow = rate_of(Some("9600"));
        assert_eq!((slow.verdict, slow.mend.len()), (Verdict::CouldBeBetter, 1));
        assert!(slow.read.contains("takes 25.0 ms"), "{}", slow.read);
        for nothing in [None, Some(""), Some("0"), Some("x")] {
            assert_eq!(rate_of(nothing).verdict, Verdict::NotKnown);
        }
    }
}
