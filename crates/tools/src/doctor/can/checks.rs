//! State, bit rate, recovery, queue and errors of a CAN interface.

use super::link::{Link, LinkTiming};
use crate::doctor::finding::{Check, Finding, Group};
use crate::doctor::subject::WantedBus;
use takt::link::QUEUE_FRAMES;

const SOURCE: &str = "ip -details -statistics -json link show";

const STATE: Check = Check {
    key: "can_state",
    group: Group::Can,
    title: "state",
    source: SOURCE,
    why: "a controller that is down or off the bus sends nothing; one that is error passive is mostly alone, or has the wrong bit rate",
};

const BIT_RATE: Check = Check {
    key: "can_bit_rate",
    group: Group::Can,
    title: "bit rate",
    source: SOURCE,
    why: "every node of a bus must have the same bit rate, and sample bits at about the same point",
};

const FRAMES: Check = Check {
    key: "can_frames",
    group: Group::Can,
    title: "frames",
    source: SOURCE,
    why: "an interface for classic frames refuses those of CAN FD",
};

const RESTART: Check = Check {
    key: "can_restart_ms",
    group: Group::Can,
    title: "restart",
    source: SOURCE,
    why: "without it a controller that has once gone off the bus stays off until somebody restarts it by hand",
};

const ERRORS: Check = Check {
    key: "can_errors",
    group: Group::Can,
    title: "errors",
    source: SOURCE,
    why: "errors on the bus mean frames sent again, and late: look for termination, ground, cable, bit rate",
};

const QUEUE: Check = Check {
    key: "can_queue",
    group: Group::Can,
    title: "queue",
    source: SOURCE,
    why: "a queue that is long, or that sorts, lets set-points leave late and in another order",
};

/// A queue that holds at least what a cycle sends, and not what many cycles send.
const QUEUE_LENGTHS: std::ops::RangeInclusive<u64> = 10..=128;

fn wants_fd(wanted: Option<&WantedBus>) -> bool {
    wanted.is_some_and(|bus| bus.data_bit_rate.is_some())
}

fn bring_up(name: &str, wanted: Option<&WantedBus>) -> String {
    if name.starts_with("vcan") || name.starts_with("vxcan") {
        let mtu = if wants_fd(wanted) { " mtu 72" } else { "" };
        return format!("sudo ip link set {name}{mtu} up");
    }
    let bit_rate = wanted.map_or(1_000_000, |bus| bus.bit_rate);
    let data = wanted
        .and_then(|bus| bus.data_bit_rate)
        .map_or(String::new(), |rate| format!(" dbitrate {rate} fd on"));
    let restart_ms = wanted.map_or(100, |bus| bus.restart_ms);
    format!("sudo ip link set {name} up type can bitrate {bit_rate}{data} restart-ms {restart_ms}")
}

/// Takes the interface down, changes it and brings it up again; a running one cannot be changed.
fn change(name: &str, settings: &str) -> String {
    format!(
        "sudo ip link set {name} down && sudo ip link set {name} type can {settings} && sudo ip link set {name} up"
    )
}

pub fn state(link: &Link, wanted: Option<&WantedBus>) -> Finding {
    let name = &link.name;
    if !link.is_up {
        return down(name, wanted);
    }
    match link.state.as_deref() {
        None => STATE.good("up").applied(true),
        Some("ERROR-ACTIVE") => STATE.good("up, error active").applied(true),
        Some(state @ "BUS-OFF") => STATE.forbids(state.to_lowercase()).mend(format!(
            "sudo ip link set {name} type can restart   # after the cause is found: see the errors"
        )),
        Some(state @ ("STOPPED" | "SLEEPING")) => {
            STATE.forbids(state.to_lowercase()).mend(bring_up(name, wanted))
        }
        Some(state) => STATE
            .could_be_better(state.to_lowercase().replace('-', " "))
            .mend(format!("candump -e {name},0:0,#FFFFFFFF   # says which errors; are the drives powered?")),
    }
}

fn down(name: &str, wanted: Option<&WantedBus>) -> Finding {
    let finding = match wanted {
        Some(_) => STATE.forbids("down"),
        None => STATE.could_be_better("down"),
    };
    finding.applied(false).mend(bring_up(name, wanted))
}

/// Without `ip`: the flags of `/sys/class/net/*/flags`, whose lowest bit is `IFF_UP`.
pub fn state_of_flags(name: &str, flags: Option<&str>) -> Finding {
    let flags = flags.and_then(|hex| u32::from_str_radix(hex.trim_start_matches("0x"), 16).ok());
    match flags {
        Some(flags) if flags & 1 == 1 => STATE.good("up").applied(true),
        Some(_) => down(name, None),
        None => STATE.not_known("cannot be read"),
    }
}

/// Whether a virtual interface carries the frames of CAN FD, where the configuration has them. That of a controller does when it has a
/// data phase.
pub fn frames(link: &Link, wanted: Option<&WantedBus>) -> Option<Finding> {
    let name = &link.name;
    if !wants_fd(wanted) {
        return None;
    }
    Some(match link.has_fd {
        true => FRAMES.good("CAN FD and classic ones").applied(true),
        false => FRAMES
            .forbids("classic ones; the configuration says CAN FD")
            .applied(false)
            .mend(format!("sudo ip link set {name} down && {}", bring_up(name, wanted))),
    })
}

pub fn bit_rate(link: &Link, wanted: Option<&WantedBus>) -> Finding {
    let name = &link.name;
    let Some(timing) = link.timing else {
        return BIT_RATE.not_known("not set yet").applied(false).mend(bring_up(name, wanted));
    };
    let read = words(timing, link.data_timing);
    let rate = timing.bit_rate;
    let is_fd_missing =
        |bus: &&WantedBus| bus.data_bit_rate.map(u64::from) != link.data_timing.map(|data| data.bit_rate);
    if let Some(bus) = wanted.filter(|bus| u64::from(bus.bit_rate) != rate) {
        let settings = format!("bitrate {}", bus.bit_rate);
        return BIT_RATE
            .forbids(format!("{read}; the configuration says {} kbit/s", bus.bit_rate / 1_000))
            .applied(false)
            .mend(change(name, &settings));
    }
    if let Some((bus, data)) = wanted.filter(is_fd_missing).and_then(|bus| Some((bus, bus.data_bit_rate?))) {
        return BIT_RATE
            .forbids(format!("{read}; the configuration says {} kbit/s in the data phase", data / 1_000))
            .applied(false)
            .mend(change(name, &format!("bitrate {} dbitrate {data} fd on", bus.bit_rate)));
    }
    let recommended = recommended_sample_point(rate);
    if (timing.sample_point - recommended).abs() > SAMPLE_POINT_TOLERANCE {
        let settings = format!("bitrate {rate} sample-point {recommended}");
        return BIT_RATE
            .could_be_better(format!("{read}; CiA recommends {:.1} %", recommended * 100.0))
            .mend(change(name, &settings));
    }
    BIT_RATE.good(read).applied(true)
}

fn words(timing: LinkTiming, data: Option<LinkTiming>) -> String {
    let phase = |timing: LinkTiming| {
        format!("{} kbit/s sampled at {:.1} %", timing.bit_rate / 1_000, timing.sample_point * 100.0)
    };
    match data {
        Some(data) => format!("{}, data phase {}", phase(timing), phase(data)),
        None => phase(timing),
    }
}

/// The sample point that CiA recommends and the kernel chooses by itself.
fn recommended_sample_point(bit_rate: u64) -> f64 {
    match bit_rate {
        800_001.. => 0.75,
        500_001.. => 0.8,
        _ => 0.875,
    }
}

const SAMPLE_POINT_TOLERANCE: f64 = 0.051;

pub fn restart(link: &Link, wanted: Option<&WantedBus>) -> Finding {
    let wanted_ms = wanted.map_or(100, |bus| bus.restart_ms);
    match link.restart_ms {
        None => RESTART.not_known("the driver does not tell"),
        Some(0) if wanted_ms == 0 => RESTART.good("never by itself, as configured").applied(true),
        Some(0) => RESTART
            .could_be_better("never by itself")
            .applied(false)
            .mend(change(&link.name, &format!("restart-ms {wanted_ms}"))),
        Some(ms) => RESTART.good(format!("{ms} ms after bus-off")).applied(true),
    }
}

pub fn errors(link: &Link) -> Finding {
    let counters = link.error_counters.filter(|(tx, rx)| tx + rx > 0);
    let counters =
        counters.map(|(tx, rx)| format!("counters of the controller: {tx} sending, {rx} receiving"));
    let events = link.events.iter().map(|(name, count)| format!("{name} {count}"));
    let words: Vec<String> = counters.into_iter().chain(events).collect();
    if words.is_empty() {
        return ERRORS.good("none");
    }
    ERRORS
        .could_be_better(words.join(", "))
        .mend(format!("candump -e {},0:0,#FFFFFFFF   # shows each error as it happens", link.name))
}

pub fn queue(link: &Link) -> Finding {
    let name = &link.name;
    let Some(length) = link.queue_length else { return QUEUE.not_known("its length is not told") };
    let Some(queueing) = link.queueing.as_deref() else {
        return queue_of_length(name, format!("{length} frames"), length);
    };
    if matches!(queueing, "noqueue" | "noop") {
        return QUEUE.good("none");
    }
    let read = format!("{length} frames, {queueing}");
    let keeps_order = matches!(queueing, "pfifo_fast" | "pfifo" | "pfifo_head_drop" | "prio" | "mq");
    if !keeps_order {
        QUEUE
            .could_be_better(read)
            .mend(format!("sudo tc qdisc replace dev {name} root pfifo limit {QUEUE_FRAMES}"))
    } else {
        queue_of_length(name, read, length)
    }
}

fn queue_of_length(name: &str, read: String, length: u64) -> Finding {
    if QUEUE_LENGTHS.contains(&length) {
        QUEUE.good(read)
    } else {
        QUEUE.could_be_better(read).mend(format!("sudo ip link set {name} txqueuelen {QUEUE_FRAMES}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;
    use crate::doctor::can::link::{links, tests::MCP251XFD};

    fn can0() -> Link {
        links(MCP251XFD).remove(0)
    }

    fn wanted(bit_rate: u32, data_bit_rate: Option<u32>) -> WantedBus {
        WantedBus { interface: "can0".to_owned(), bit_rate, data_bit_rate, restart_ms: 250 }
    }

    #[test]
    fn every_state_of_a_controller_has_its_verdict() {
        for (name, verdict) in [
            ("ERROR-ACTIVE", Verdict::Good),
            ("ERROR-WARNING", Verdict::CouldBeBetter),
            ("ERROR-PASSIVE", Verdict::CouldBeBetter),
            ("BUS-OFF", Verdict::ForbidsRealTime),
            ("STOPPED", Verdict::ForbidsRealTime),
        ] {
            let finding = state(&Link { state: Some(name.to_owned()), ..can0() }, None);
            assert_eq!(finding.verdict, verdict, "{name}");
            assert_eq!(finding.mend.is_empty(), verdict == Verdict::Good, "{name}");
        }
        let down = Link { is_up: false, ..can0() };
        assert_eq!(state(&down, None).verdict, Verdict::CouldBeBetter);
        let needed = state(&down, Some(&wanted(500_000, Some(2_000_000))));
        assert_eq!(needed.verdict, Verdict::ForbidsRealTime);
        assert_eq!(
            needed.mend,
            ["sudo ip link set can0 up type can bitrate 500000 dbitrate 2000000 fd on restart-ms 250"]
        );
    }

    #[test]
    fn a_virtual_interface_has_room_for_the_frames_of_the_configuration() {
        let vcan = |has_fd| Link { name: "vcan2".to_owned(), has_fd, ..Link::default() };
        let fd = wanted(1_000_000, Some(5_000_000));
        assert_eq!(frames(&vcan(true), Some(&fd)).map(|finding| finding.verdict), Some(Verdict::Good));
        let finding = frames(&vcan(false), Some(&fd)).unwrap();
        assert_eq!(finding.verdict, Verdict::ForbidsRealTime);
        assert_eq!(finding.mend, ["sudo ip link set vcan2 down && sudo ip link set vcan2 mtu 72 up"]);
        assert_eq!(frames(&vcan(false), Some(&wanted(1_000_000, None))), None);
        assert_eq!(frames(&vcan(false), None), None);
        assert_eq!(state(&vcan(false), Some(&fd)).mend, ["sudo ip link set vcan2 mtu 72 up"]);
    }

    #[test]
    fn without_ip_the_flags_tell_whether_it_is_up() {
        assert_eq!(state_of_flags("can0", Some("0x40081")).verdict, Verdict::Good);
        assert_eq!(state_of_flags("can0", Some("0x40080")).verdict, Verdict::CouldBeBetter);
        assert_eq!(state_of_flags("can0", Some("")).verdict, Verdict::NotKnown);
    }

    #[test]
    fn a_bit_rate_is_compared_with_the_configuration_and_its_sample_point_with_cia() {
        let good = bit_rate(&can0(), Some(&wanted(1_000_000, Some(5_000_000))));
        assert_eq!(good.verdict, Verdict::Good);
        assert_eq!(good.read, "1000 kbit/s sampled at 75.0 %, data phase 5000 kbit/s sampled at 75.0 %");
        assert_eq!(bit_rate(&can0(), Some(&wanted(500_000, None))).verdict, Verdict::ForbidsRealTime);
        assert_eq!(
            bit_rate(&can0(), Some(&wanted(1_000_000, Some(2_000_000)))).verdict,
            Verdict::ForbidsRealTime
        );
        // A classic bus on an interface that could do more is no trouble.
        assert_eq!(bit_rate(&can0(), Some(&wanted(1_000_000, None))).verdict, Verdict::Good);
        let early = Link { timing: Some(LinkTiming { bit_rate: 1_000_000, sample_point: 0.5 }), ..can0() };
        assert_eq!(bit_rate(&early, None).verdict, Verdict::CouldBeBetter);
        assert_eq!(bit_rate(&Link { timing: None, ..can0() }, None).verdict, Verdict::NotKnown);
        let slow = Link { timing: Some(LinkTiming { bit_rate: 250_000, sample_point: 0.875 }), ..can0() };
        assert_eq!(bit_rate(&slow, None).verdict, Verdict::Good);
    }

    #[test]
    fn a_queue_that_sorts_or_is_long_is_named_with_the_command() {
        let with = |length, queueing: &str| Link {
            queue_length: Some(length),
            queueing: Some(queueing.to_owned()),
            ..can0()
        };
        assert_eq!(queue(&with(10, "pfifo_fast")).verdict, Verdict::Good);
        assert_eq!(queue(&with(1_000, "noqueue")).verdict, Verdict::Good);
        assert_eq!(queue(&with(1_000, "pfifo_fast")).mend, ["sudo ip link set can0 txqueuelen 64"]);
        assert_eq!(queue(&with(10, "fq_codel")).mend, ["sudo tc qdisc replace dev can0 root pfifo limit 64"]);
        assert_eq!(queue(&with(1, "pfifo")).verdict, Verdict::CouldBeBetter);
        let without_ip = Link { queueing: None, queue_length: Some(10), ..can0() };
        assert_eq!(queue(&without_ip).read, "10 frames");
        assert_eq!(queue(&Link { queue_length: None, ..without_ip }).verdict, Verdict::NotKnown);
    }

    #[test]
    fn errors_are_told_by_name_and_none_is_good() {
        let finding = errors(&can0());
        assert_eq!(finding.verdict, Verdict::CouldBeBetter);
        assert_eq!(
            finding.read,
            "counters of the controller: 0 sending, 3 receiving, bus error 12, error warning 1, received: over errors 2"
        );
        let quiet = Link { error_counters: Some((0, 0)), events: vec![], ..can0() };
        assert_eq!(errors(&quiet).verdict, Verdict::Good);
    }

    #[test]
    fn a_controller_that_does_not_come_back_is_told() {
        assert_eq!(restart(&can0(), None).read, "100 ms after bus-off");
        assert_eq!(restart(&Link { restart_ms: None, ..can0() }, None).verdict, Verdict::NotKnown);
        let never = Link { restart_ms: Some(0), ..can0() };
        assert_eq!(restart(&never, None).verdict, Verdict::CouldBeBetter);
        let finding = restart(&never, Some(&wanted(1_000_000, None)));
        assert!(finding.mend[0].contains("type can restart-ms 250 "), "{:?}", finding.mend);
        let as_configured = WantedBus { restart_ms: 0, ..wanted(1_000_000, None) };
        assert_eq!(restart(&never, Some(&as_configured)).verdict, Verdict::Good);
    }
}
