//! The analysis in words and sums, for people.

use std::fmt::Write;

use super::messages::MessageKind;
use super::{BusSchedule, Remedy, Shortfall};

/// A length of time in microseconds.
pub fn microseconds(ns: u64) -> String {
    let microseconds = ns as f64 / 1000.0;
    if ns.is_multiple_of(1000) { format!("{microseconds:.0}") } else { format!("{microseconds:.1}") }
}

/// What a message is called.
pub fn message_name(kind: MessageKind) -> &'static str {
    match kind {
        MessageKind::Sync => "SYNC",
        MessageKind::Emergency => "emergency",
        MessageKind::Feedback => "feedback",
        MessageKind::SetPoint => "set-point",
        MessageKind::SdoResponse => "SDO answer",
        MessageKind::SdoRequest => "SDO request",
        MessageKind::DriveHeartbeat => "heartbeat",
        MessageKind::MasterHeartbeat => "master heartbeat",
    }
}

/// The sums of the worst slot, one line each.
pub fn sums(bus: &BusSchedule) -> Vec<String> {
    let slot = &bus.slot;
    let us = microseconds;
    let verdict = |done: u64, until: u64| {
        if done <= until {
            format!("{} µs early", us(until - done))
        } else {
            format!("{} µs LATE", us(done - until))
        }
    };
    let process_data = format!(
        "process data  {} µs = {} SYNC + {} feedback + {} set-points, in {} µs",
        us(slot.process_data_ns),
        us(slot.sync_ns),
        us(slot.feedback_ns),
        us(slot.set_points_ns),
        us(bus.period_ns),
    );
    let feedback = format!(
        "feedback      {} µs = {} wait + {} SYNC + {} drives' delay + {} wait + {} frames; command phase at {} µs: {}",
        us(slot.feedback_done_ns),
        us(slot.wait_before_sync_ns),
        us(slot.sync_ns),
        us(slot.feedback_delay_ns),
        us(slot.wait_before_feedback_ns),
        us(slot.feedback_ns),
        us(bus.command_phase_ns),
        verdict(slot.feedback_done_ns, bus.command_phase_ns),
    );
    let set_points = format!(
        "set-points    {} µs = {} command phase + {} wait + {} frames; next SYNC at {} µs: {}",
        us(slot.set_points_done_ns),
        us(bus.command_phase_ns),
        us(slot.wait_before_set_points_ns),
        us(slot.set_points_ns),
        us(bus.period_ns),
        verdict(slot.set_points_done_ns, bus.period_ns),
    );
    vec![process_data, feedback, set_points]
}

/// What does not fit.
pub fn shortfall(shortfall: &Shortfall) -> String {
    let us = microseconds;
    match shortfall {
        Shortfall::FeedbackLate { done_ns, command_phase_ns } => format!(
            "feedback can arrive until {} µs, but is needed at the command phase, {} µs",
            us(*done_ns),
            us(*command_phase_ns)
        ),
        Shortfall::SetPointsLate { done_ns, period_ns } => format!(
            "set-points can take until {} µs, but the next SYNC is due at {} µs",
            us(*done_ns),
            us(*period_ns)
        ),
        Shortfall::MessageLate { kind, axis, response_ns, deadline_ns } => {
            let of = axis.as_ref().map(|axis| format!(" of {axis}")).unwrap_or_default();
            let takes = response_ns.map_or("has no bound".to_owned(), |ns| format!("can take {} µs", us(ns)));
            format!("the {}{of} {takes}, but is due within {} µs", message_name(*kind), us(*deadline_ns))
        }
    }
}

/// What would make it fit.
pub fn remedy(remedy: &Remedy) -> String {
    let us = microseconds;
    match remedy {
        Remedy::CommandPhase { earliest_ns, latest_ns } => {
            format!("a command phase of {} to {} µs: [cycle] command_phase", us(*earliest_ns), us(*latest_ns))
        }
        Remedy::SdoWhileDisabled => "no SDO transfers while enabled: sdo_while_enabled = false".to_owned(),
        Remedy::DriveHeartbeatsOff => {
            "no heartbeats of the drives, whose feedback shows that they live: heartbeat = \"off\"".to_owned()
        }
        Remedy::SmallerFeedback => "statusword and position only: feedback = []".to_owned(),
        Remedy::MoreBuses { axes_per_bus, buses } => {
            format!("{buses} buses: {axes_per_bus} of these axes fit one")
        }
        Remedy::LongerPeriod { period_ns } => {
            format!("a cycle of {} ms: [cycle] period", *period_ns as f64 / 1e6)
        }
    }
}

/// Why a configuration is refused: for each bus that does not fit the sums, what is late, and what would fit.
pub(super) fn refusal(buses: &[BusSchedule]) -> String {
    let mut text = String::new();
    for bus in buses.iter().filter(|bus| !bus.fits()) {
        let _ = writeln!(text, "the bus {:?} cannot carry its traffic in the worst case:", bus.name);
        for line in sums(bus) {
            let _ = writeln!(text, "    {line}");
        }
        for line in bus.shortfalls.iter().map(shortfall) {
            let _ = writeln!(text, "  {line}");
        }
        let remedies: Vec<_> = bus.remedies.iter().map(|way| format!("    - {}", remedy(way))).collect();
        if remedies.is_empty() {
            let _ = writeln!(text, "  no single change that was tried makes it fit");
        } else {
            let _ = writeln!(text, "  what would fit:\n{}", remedies.join("\n"));
        }
    }
    text.truncate(text.trim_end().len());
    text
}
