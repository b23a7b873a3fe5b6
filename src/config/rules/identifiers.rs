//! Identifiers that two stations of a bus would send: where both send at once, their frames destroy each other.
//!
//! Axes of CANopen nodes have identifiers that never meet, so only drives with frames of their own are looked at.

use std::ops::Range;

use takt_rt::Id;
use takt_wire::bit_fields::FieldDevice;
use takt_wire::canopen::function_code;

use crate::config::identifiers::IdUse;
use crate::config::model::Axis;
use crate::config::problem_kind::ProblemKind;
use crate::config::spot::Spot;

const NMT: Id = Id::canopen(function_code::NMT, 0);

/// Checks the identifiers of an axis against those of CANopen, its own, and those of other axes.
pub fn axis<'a, 'o>(
    axis: &Axis,
    others: impl Iterator<Item = (&'o Axis, Option<&'o Range<usize>>)>,
    master_node: u8,
    at: impl Fn(&str) -> Spot<'a>,
) {
    let device = axis.drive.description::<FieldDevice>();
    let own = axis.drive.frame_identifiers(axis.node);
    if let Some(device) = device {
        let reply = device.reply_id(axis.node);
        // A drive that replies by its motor ID, whatever it is set to, does so by its nature.
        let is_set = device.description.reply.id.has_master();
        if is_set && device.request_ids(axis.node).contains(&reply) {
            let value = format!("{}, by which the commands to the motor are sent", show(reply));
            at("master_id").report_range(value, "another identifier than that of the commands".to_owned());
        }
    }
    if device.is_some() {
        reserved(&own, master_node, &at);
    }
    for (other, first) in others.filter(|(other, _)| (other.bus, other.node) != (axis.bus, axis.node)) {
        let is_looked_at = device.is_some() || other.drive.description::<FieldDevice>().is_some();
        if other.bus == axis.bus && is_looked_at {
            between(&own, other, first, &at);
            reply_by_nmt(axis, other, &at);
        }
    }
}

fn show(id: Id) -> String {
    if id.is_extended() { format!("0x{:08X}", id.value()) } else { format!("0x{:03X}", id.value()) }
}

/// The key that an identifier comes from.
const fn key_of(used: IdUse) -> &'static str {
    match used {
        IdUse::Reply => "master_id",
        IdUse::Request | IdUse::Heartbeat | IdUse::Setup | IdUse::Node => "node",
    }
}

/// What CANopen sends to all nodes, and the heartbeat of the controller. A drive may reply by the identifier of NMT where no CANopen is on the
/// bus, as those of the Mini Cheetah do from the factory.
fn reserved<'a>(own: &[(Id, IdUse)], master_node: u8, at: &impl Fn(&str) -> Spot<'a>) {
    let names = [
        (NMT, "NMT"),
        (Id::canopen(function_code::SYNC, 0), "SYNC"),
        (Id::canopen(function_code::TIME, 0), "TIME"),
        (Id::canopen(function_code::ERROR_CONTROL, master_node), "the heartbeat of the controller"),
    ];
    for (id, used) in own.iter().filter(|frame| **frame != (NMT, IdUse::Reply)) {
        if let Some((_, name)) = names.iter().find(|(reserved, _)| reserved == id) {
            let value = format!("identifier {}, which is that of {name} in CANopen", show(*id));
            at(key_of(*used)).report_range(value, "an identifier that nobody else sends".to_owned());
        }
    }
}

/// A drive that replies by the identifier of NMT, and a CANopen node on one bus.
fn reply_by_nmt<'a>(axis: &Axis, other: &Axis, at: &impl Fn(&str) -> Spot<'a>) {
    let replies_so = |axis: &Axis| axis.drive.frame_identifiers(axis.node).contains(&(NMT, IdUse::Reply));
    let is_canopen = |axis: &Axis| axis.drive.description::<FieldDevice>().is_none();
    let key = match (replies_so(axis) && is_canopen(other), replies_so(other) && is_canopen(axis)) {
        (true, _) => "master_id",
        (_, true) => "bus",
        _ => return,
    };
    at(key).report_range(
        format!(
            "a bus on which a motor replies by identifier {}, which is that of NMT in CANopen",
            show(NMT)
        ),
        "a `master_id` of the motor that nobody else sends".to_owned(),
    );
}

/// Reports the first identifier that an axis and an earlier one both use.
fn between<'a>(
    own: &[(Id, IdUse)],
    other: &Axis,
    first: Option<&Range<usize>>,
    at: &impl Fn(&str) -> Spot<'a>,
) {
    let theirs = other.drive.frame_identifiers(other.node);
    let met = own.iter().find_map(|(id, used)| {
        let is_it = |(their_id, their_use): &&(Id, IdUse)| {
            their_id == id && !(*used == IdUse::Setup && *their_use == IdUse::Setup)
        };
        theirs.iter().find(is_it).map(|(_, their_use)| (*id, *used, *their_use))
    });
    let Some((id, used, their_use)) = met else { return };
    let value = format!("identifier {}, which axis `{}` on the same bus has, too", show(id), other.name);
    let allowed = match (used, their_use) {
        (IdUse::Reply, IdUse::Reply) => {
            "an identifier of its own: two motors that reply at once by one identifier destroy each other's frames"
        }
        _ => "an identifier that no other drive on the bus sends or listens to",
    };
    let spot = at(key_of(used));
    let kind = ProblemKind::OutOfRange { key: spot.key.clone(), value, allowed: allowed.to_owned() };
    match first {
        Some(first) => spot.report_against(kind, first),
        None => spot.report(kind),
    }
}
