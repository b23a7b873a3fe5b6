//! What is lost because a drive lacks an object.

use takt_wire::canopen::object::ObjectAddress;

use super::device::Device;
use crate::config::ErrorControl;

/// Objects that keep a drive safe, or let a person see why it is not, and what is lost without each.
const LOSSES: [(u16, u8, &str); 7] = [
    (0x1029, 1, "what the drive does when the controller is gone cannot be chosen (no 1029)"),
    (
        0x6061,
        0,
        "the drive does not show its mode (6061): a change of the mode by another master is not noticed",
    ),
    (0x6065, 0, "the drive does not watch its following error (6065): only the controller does"),
    (0x6085, 0, "the deceleration of a quick stop cannot be set (6085): the drive's own value holds"),
    (0x605A, 0, "what a quick stop does cannot be read (605A)"),
    (
        0x603F,
        0,
        "the drive's error code cannot be read (603F): a fault has a code only if the drive sends an emergency message",
    ),
    (0x6076, 0, "the drive does not tell its rated torque (6076): [axis.joint] rated_torque holds"),
];

/// What is lost by what the drive lacks, one sentence each.
pub(crate) fn remarks(device: &Device) -> Vec<&'static str> {
    let is_absent = |(index, subindex, _): &&(u16, u8, &str)| {
        device.entry(ObjectAddress::new(*index, *subindex)).is_none()
    };
    let unsupervised = (device.error_control() == ErrorControl::None).then_some(
        "the drive has neither a heartbeat (1017) nor node guarding (100C, 100D): only its process data shows that it is there",
    );
    let two_identities = device.has_two_identities().then_some(
        "its data sheet has two numbers of its vendor or product: that of object 1018 is expected, not that of [DeviceInfo]",
    );
    unsupervised
        .into_iter()
        .chain(two_identities)
        .chain(LOSSES.iter().filter(is_absent).map(|(_, _, loss)| *loss))
        .collect()
}
