//! The CAN interfaces: those that the configuration needs, or else those there are.

mod checks;
mod coalescing;
mod driver;
mod interrupt;
mod link;

use super::finding::{Check, Finding, Group};
use super::source::Source;
use super::subject::{Subject, WantedBus};
use super::threads::Thread;
use link::Link;
use takt::link::interface_status;

const INTERFACE: Check = Check {
    key: "can_interface",
    group: Group::Can,
    title: "interface",
    source: "/sys/class/net",
    why: "the drives are reached through it",
};

const DETAILS: Check = Check {
    key: "can_details",
    group: Group::Can,
    title: "details",
    source: "ip -details -statistics -json link show",
    why: "bit rate, state and error counters are told by the kernel to programs like `ip` only",
};

/// The hardware type of CAN interfaces (`ARPHRD_CAN`).
const HARDWARE_TYPE: &str = "280";

const VIRTUAL: &str = "sudo modprobe vcan && sudo ip link add dev vcan0 type vcan && sudo ip link set vcan0 up   # a virtual one, to try";

pub fn findings(source: &Source, subject: &Subject, threads: &[Thread]) -> Vec<Finding> {
    let present = present(source);
    let named = subject.buses.iter().map(|bus| bus.interface.clone());
    let interfaces: Vec<String> = if subject.is_configured { named.collect() } else { present.clone() };
    if interfaces.is_empty() {
        return vec![none(source, subject, &present)];
    }
    let details = source.command("ip", &["-details", "-statistics", "-json", "link", "show"]);
    let links = details.as_deref().map(link::links).unwrap_or_default();
    let mut findings = vec![];
    for name in &interfaces {
        let wanted = subject.buses.iter().find(|bus| bus.interface == *name);
        if !present.contains(name) {
            findings.push(missing(source, name));
            continue;
        }
        let link = links.iter().find(|link| link.name == *name).cloned();
        let link = link.or_else(|| asked_of_the_kernel(source, name));
        let own = of_interface(source, name, wanted, link.as_ref(), subject, threads);
        findings.extend(own.into_iter().map(|finding| finding.on(name)));
    }
    findings
}

/// The names of the CAN interfaces.
fn present(source: &Source) -> Vec<String> {
    let names = source.names("/sys/class/net").into_iter();
    let is_can =
        |name: &String| source.text(&format!("/sys/class/net/{name}/type")).as_deref() == Some(HARDWARE_TYPE);
    names.filter(is_can).collect()
}

/// Without `ip`, or with one that cannot write JSON: what the kernel tells this program.
fn asked_of_the_kernel(source: &Source, name: &str) -> Option<Link> {
    let status = source.is_this_machine().then(|| interface_status(name).ok()).flatten()?;
    let queue = source.text(&format!("/sys/class/net/{name}/tx_queue_len"));
    Some(Link::of_status(&status, queue.and_then(|length| length.parse().ok())))
}

fn none(source: &Source, subject: &Subject, present: &[String]) -> Finding {
    if subject.is_configured {
        let others = match present {
            [] => String::new(),
            present => format!("; there would be {}", present.join(", ")),
        };
        return INTERFACE.not_known(format!("every bus of the configuration is simulated{others}"));
    }
    let kernel = if source.exists("/proc/net/can") { "" } else { ", and the kernel has no CAN loaded" };
    INTERFACE.not_known(format!("there is none{kernel}")).mend(VIRTUAL)
}

fn missing(source: &Source, name: &str) -> Finding {
    let read = match source.text(&format!("/sys/class/net/{name}/type")) {
        Some(_) => "is no CAN interface",
        None => "there is none of this name",
    };
    let finding = INTERFACE.forbids(read).on(name);
    if name.starts_with("vcan") {
        finding.mend(format!(
            "sudo modprobe vcan && sudo ip link add dev {name} type vcan && sudo ip link set {name} up"
        ))
    } else {
        finding.mend(
            "ip -brief link show   # the interfaces there are; `dmesg | grep -i can` tells of their drivers",
        )
    }
}

fn of_interface(
    source: &Source,
    name: &str,
    wanted: Option<&WantedBus>,
    link: Option<&Link>,
    subject: &Subject,
    threads: &[Thread],
) -> Vec<Finding> {
    let device = driver::Device::of(source, name, link);
    let mut findings = vec![driver::finding(&device)];
    match link {
        Some(link) => {
            findings.push(checks::state(link, wanted));
            if device.has_bit_timing() {
                findings.push(checks::bit_rate(link, wanted));
                findings.push(checks::restart(link, wanted));
                findings.push(checks::errors(link));
            } else {
                findings.extend(checks::frames(link, wanted));
            }
            findings.push(checks::queue(link));
        }
        None => {
            findings.push(checks::state_of_flags(
                name,
                source.text(&format!("/sys/class/net/{name}/flags")).as_deref(),
            ));
            findings.push(
                DETAILS
                    .not_known("`ip` is not installed, or too old for JSON")
                    .mend("sudo apt-get install iproute2"),
            );
        }
    }
    if device.has_interrupt() {
        let table = source.text("/proc/interrupts").unwrap_or_default();
        let priority = subject.realtime.priority.unwrap_or(0);
        findings.push(interrupt::finding(name, &device, &table, threads, priority));
        findings.push(coalescing::finding(name, source.command("ethtool", &["-c", name])));
    }
    findings
}
