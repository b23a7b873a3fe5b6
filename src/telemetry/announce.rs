//! Tells `tracing` what happens in a run. It is called in the threads beside the real-time thread, which has no part in it.

use takt_rt::{Event, EventKind, Origin, StopReason, TimingLevel};
use tracing::{debug, error, info, warn};

use super::machine::Machine;
use super::words;

/// The target of what happens in the loop.
const RUN: &str = "takt::run";
/// The target of what is written.
const RECORDING: &str = "takt::recording";

/// An event of the real-time thread, whose words are `text`.
pub(super) fn event(event: &Event, text: &str, machine: &Machine) {
    let slot = event.slot;
    let group = event.group.map(|group| machine.group_name(group));
    let group = group.as_deref();
    match event.kind {
        EventKind::PhaseChanged { from, to } => {
            let (from, to) = (words::phase(from), words::phase(to));
            info!(target: RUN, slot, group, from, to, "{text}");
        }
        EventKind::Stop(reason) => stop(&reason, slot, group, text, machine),
        EventKind::DriveState { axis, state, statusword } => {
            let (axis, is_faulted, state) = (machine.axis_name(axis), state.is_faulted(), state.name());
            if is_faulted {
                warn!(target: RUN, slot, group, axis, state, statusword, "{text}");
            } else {
                debug!(target: RUN, slot, group, axis, state, statusword, "{text}");
            }
        }
        EventKind::Emergency { axis, code, register, .. } => {
            let name = machine.axis_name(axis);
            if code == 0 {
                info!(target: RUN, slot, group, axis = name, code, register, "{text}");
            } else {
                let reason = machine.drive_error(axis, code).to_string();
                let cure = machine.drive_cure(axis, code);
                warn!(target: RUN, slot, group, axis = name, code, register, reason, cure, "{text}");
            }
        }
        EventKind::Mode { axis, mode } => {
            let axis = machine.axis_name(axis);
            info!(target: RUN, slot, group, axis, mode = mode.name(), "{text}");
        }
        EventKind::MissedSlots { count } => warn!(target: RUN, slot, count, "{text}"),
        EventKind::Timing { level: TimingLevel::Normal } => info!(target: RUN, slot, "{text}"),
        EventKind::Timing { .. } => warn!(target: RUN, slot, "{text}"),
        EventKind::Rejected(refusal) => {
            let axis = refusal.axis.map(|axis| machine.axis_name(axis));
            let (axis, reason) = (axis.as_deref(), refusal.reason.to_string());
            warn!(target: RUN, slot, group, axis, reason, "{text}");
        }
        EventKind::Stream { .. } => debug!(target: RUN, slot, group, "{text}"),
        EventKind::MotionFinished { request } => {
            debug!(target: RUN, slot, group, request = request.0, "{text}");
        }
    }
}

fn stop(stop: &StopReason, slot: u64, group: Option<&str>, text: &str, machine: &Machine) {
    let (axis, bus) = match stop.origin {
        Origin::Group => (None, None),
        Origin::Axis(axis) => (Some(machine.axis_name(axis)), None),
        Origin::Bus(bus) => (None, Some(machine.bus_name(bus))),
    };
    let (axis, bus) = (axis.as_deref(), bus.as_deref());
    let (rule, category) = (words::rule_key(stop.rule()), stop.category as u8);
    let reason = words::stop(stop, machine).to_string();
    if stop.is_requested() {
        info!(target: RUN, slot, group, axis, bus, rule, category, reason, "{text}");
    } else {
        error!(target: RUN, slot, group, axis, bus, rule, category, reason, "{text}");
    }
}

/// A file was opened: a `kind` such as "recording".
pub(super) fn opened(kind: &'static str, file: &str) {
    info!(target: RECORDING, kind, file, "{kind} opened: {file}");
}

/// A file was written to its end.
pub(super) fn closed(kind: &'static str, file: &str) {
    info!(target: RECORDING, kind, file, "{kind} closed: {file}");
}

/// A file was not written, or not to its end.
pub(super) fn not_written(reason: &str) {
    error!(target: RECORDING, reason, "{reason}");
}

/// What the rings had no room for.
pub(super) fn dropped(records: u64, events: u64, frames: u64) {
    if records + events + frames > 0 {
        warn!(target: RECORDING, records, events, frames, "the logger was too slow, and what it did not take is lost");
    }
}
