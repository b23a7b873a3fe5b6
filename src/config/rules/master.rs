//! The controller as a CANopen node, and heartbeats.

use super::Fields;
use crate::config::keys::master::{HEARTBEAT, HEARTBEAT_TIMEOUT, NODE, TIME};
use crate::config::model::Master;
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

pub fn validate(master: &Master, fields: &Fields<'_>) {
    fields.integer(&NODE, master.node);
    if let Some(heartbeat_ns) = master.heartbeat_ns {
        heartbeat(&fields.at("heartbeat"), heartbeat_ns);
    }
    let timeout = fields.at("heartbeat_timeout");
    if heartbeat_timeout(&timeout, master.heartbeat_timeout_ns).is_some() {
        outlasts_heartbeat(&timeout, master.heartbeat_timeout_ns, master.heartbeat_ns);
    }
    if let Some(time_ns) = master.time_ns {
        fields.duration(&TIME, time_ns);
    }
}

/// The period of a heartbeat (object 1017).
pub fn heartbeat(spot: &Spot<'_>, period_ns: u64) -> Option<u64> {
    spot.duration_of(&HEARTBEAT, period_ns)?;
    whole_milliseconds(spot, period_ns)
}

/// The time after which a missing heartbeat is noticed (object 1016).
pub fn heartbeat_timeout(spot: &Spot<'_>, timeout_ns: u64) -> Option<u64> {
    spot.duration_of(&HEARTBEAT_TIMEOUT, timeout_ns)?;
    whole_milliseconds(spot, timeout_ns)
}

/// Objects 1016 and 1017 hold whole milliseconds (CiA 301, 7.5.2.16 and 7.5.2.17).
fn whole_milliseconds(spot: &Spot<'_>, ns: u64) -> Option<u64> {
    if ns.is_multiple_of(1_000_000) {
        return Some(ns);
    }
    spot.report_range(Quantity::DURATION.show(ns as f64 / 1e9), "whole milliseconds".to_owned());
    None
}

/// A time-out must be longer than the period of the heartbeat that it waits for.
pub fn outlasts_heartbeat(spot: &Spot<'_>, timeout_ns: u64, heartbeat_ns: Option<u64>) {
    if let Some(period_ns) = heartbeat_ns.filter(|period_ns| timeout_ns <= *period_ns) {
        let show = |ns: u64| Quantity::DURATION.show(ns as f64 / 1e9);
        spot.report_range(show(timeout_ns), format!("longer than heartbeat, {}", show(period_ns)));
    }
}
