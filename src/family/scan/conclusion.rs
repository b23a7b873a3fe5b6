//! What follows from what a scan has heard.

use takt_rt::Nanoseconds;

use super::canopen;
use super::device::{Answered, FoundDevice};
use super::heard::{Heard, HeardNode};

/// More frames in a second than drives send that nobody commands: a third of what a bus of 1 Mbit/s carries.
const FLOODED_HZ: f64 = 3_000.0;

/// Adds the devices that were heard alone.
pub fn add_heard(heard: &Heard, devices: &mut Vec<FoundDevice>) {
    for (place, protocol) in heard.protocols().iter().enumerate() {
        for (node, _) in heard.drives_of(place) {
            let is_known = devices
                .iter()
                .any(|device| device.node == Some(node) && device.answered == Answered::Own(protocol.name()));
            if !is_known {
                devices.push(protocol.overheard(node));
            }
        }
    }
    for (place, node) in heard.heartbeating() {
        devices.extend(heard.protocols().get(place).map(|protocol| protocol.overheard(node)));
    }
    for (node, shown) in heard.nodes().filter(|(_, shown)| !heard.is_mistaken(shown)) {
        let place = devices.iter().position(|device| {
            device.node == Some(node) && matches!(device.answered, Answered::Sdo | Answered::Heard(_))
        });
        match place.and_then(|place| devices.get_mut(place)) {
            Some(device) => canopen::remark_heard(device, shown),
            None => devices.extend(canopen::heard_alone(node, shown)),
        }
    }
}

/// Remarks on devices that share a node ID.
pub fn mark_duplicates(heard: &Heard, devices: &mut [FoundDevice]) {
    for device in devices {
        let Some(node) = device.node else { continue };
        let is_double = match device.answered {
            Answered::Sdo => heard.node(node).is_some_and(HeardNode::answers_twice),
            Answered::Own(name) => heard.protocols().iter().enumerate().any(|(place, protocol)| {
                protocol.name() == name
                    && heard.drives_of(place).any(|(drive, heard)| drive == node && heard.answers_twice())
            }),
            Answered::Heard(_) | Answered::Modbus { .. } | Answered::Lss | Answered::OfController => false,
        };
        if is_double {
            device.remark(
                "two devices answer with this node ID, and what stands here may be of either: give one of them another ID",
            );
        }
    }
}

/// That another master is active, if one is.
pub fn active_master(heard: &Heard) -> Option<String> {
    let frames = heard.master_frames();
    (frames > 0).then(|| format!("a master is active: {frames} of its frames were heard"))
}

/// What is odd on the bus as a whole.
pub fn remarks(heard: &Heard, duration_ns: Nanoseconds) -> Vec<String> {
    let mut remarks = vec![];
    let rate = heard.frames() as f64 / (duration_ns.max(1) as f64 * 1e-9);
    if rate > FLOODED_HZ {
        remarks.push(format!(
            "the bus is flooded: {rate:.0} frames/s were heard, so that answers may be missing; `takt monitor --stats` shows who sends \
             them"
        ));
    }
    let others: Vec<String> = heard.others().map(|(id, frames)| format!("{id:?} ({frames})")).collect();
    if !others.is_empty() {
        remarks.push(format!(
            "frames that belong to nothing known here, by identifier: {}; `takt monitor` shows them",
            others.join(", ")
        ));
    }
    remarks
}
