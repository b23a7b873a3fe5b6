//! The analysis as text: sentences and sums.

use std::fmt::Write;

use super::bus_schedule::{BusSchedule, COMPUTE_RESERVE_NS, Remedy, Shortfall, WAKE_UP_RESERVE_NS};
use super::messages::MessageKind;

/// A length of time in microseconds.
pub fn microseconds(ns: u64) -> String {
    let microseconds = ns as f64 / 1000.0;
    if ns.is_multiple_of(1000) { format!("{microseconds:.0}") } else { format!("{microseconds:.1}") }
}

/// The name of a message.
pub fn message_name(kind: MessageKind) -> &'static str {
    match kind {
        MessageKind::Sync => "SYNC",
        MessageKind::Emergency => "emergency",
        MessageKind::Feedback => "feedback",
        MessageKind::SetPoint => "set-point",
        MessageKind::Answer => "answer",
        MessageKind::Reply => "reply",
        MessageKind::SdoResponse => "SDO answer",
        MessageKind::SdoRequest => "SDO request",
        MessageKind::OwnReply => "answer",
        MessageKind::OwnRequest => "request",
        MessageKind::DriveHeartbeat => "heartbeat",
        MessageKind::GuardRequest => "guard request",
        MessageKind::GuardReply => "guard reply",
        MessageKind::MasterHeartbeat => "master heartbeat",
        MessageKind::Time => "TIME",
    }
}

/// The terms that are not zero, with a plus between them.
fn sum(terms: &[(u64, &str)]) -> String {
    let shown = terms.iter().filter(|(ns, _)| *ns > 0);
    shown.map(|(ns, what)| format!("{} {what}", microseconds(*ns))).collect::<Vec<_>>().join(" + ")
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
    let parts = sum(&[
        (slot.sync_ns, "SYNC"),
        (slot.feedback_ns, "feedback"),
        (slot.set_points_ns, "set-points"),
        (slot.replies_ns, "replies"),
    ]);
    let process_data = match parts.is_empty() {
        true => "process data  none in the cycle".to_owned(),
        false => {
            format!("process data  {} µs = {parts}, in {} µs", us(slot.process_data_ns), us(bus.period_ns))
        }
    };
    let feedback = format!(
        "feedback      {} µs = {}; command phase at {} µs: {}",
        us(slot.feedback_done_ns),
        sum(&[
            (slot.wait_before_sync_ns, "wait"),
            (slot.sync_ns, "SYNC"),
            (slot.feedback_delay_ns, "drives' delay"),
            (slot.wait_before_feedback_ns, "wait"),
            (slot.feedback_ns, "feedback"),
        ]),
        us(bus.command_phase_ns),
        verdict(slot.feedback_done_ns, bus.command_phase_ns),
    );
    let set_points = format!(
        "set-points    {} µs = {}; next SYNC at {} µs: {}",
        us(slot.set_points_done_ns),
        sum(&[
            (bus.command_phase_ns, "command phase"),
            (slot.held_ns, "held"),
            (slot.wait_before_set_points_ns, "wait"),
            (slot.set_points_ns, "set-points")
        ]),
        us(bus.period_ns),
        verdict(slot.set_points_done_ns, bus.period_ns),
    );
    let next_phase_ns = bus.period_ns + bus.command_phase_ns;
    let replies = || {
        let last_ns = slot.replies_done_ns.saturating_sub(slot.set_points_done_ns + slot.reply_delay_ns);
        format!(
            "replies       {} µs = {}; next command phase at {} µs: {}",
            us(slot.replies_done_ns),
            sum(&[
                (slot.set_points_done_ns, "requests"),
                (slot.reply_delay_ns, "drives' delay"),
                (last_ns, "wait and reply")
            ]),
            us(next_phase_ns),
            verdict(slot.replies_done_ns, next_phase_ns),
        )
    };
    let has_feedback = slot.feedback_done_ns > 0;
    let mut lines = vec![process_data];
    lines.extend(has_feedback.then_some(feedback));
    lines.push(set_points);
    lines.extend((slot.replies_ns > 0).then(replies));
    lines
}

/// The reserve of the slot, and the effect of an emergency message. Empty for a bus that does not fit.
pub fn reserve(bus: &BusSchedule) -> Vec<String> {
    if !bus.fits() {
        return vec![];
    }
    let slot = &bus.slot;
    let us = microseconds;
    let mut lines = vec![format!(
        "reserve       SYNC may leave {} µs late; set-points may take {} µs for wake-up latency and computing",
        us(slot.sync_reserve_ns),
        us(slot.set_points_reserve_ns),
    )];
    lines.extend(bus.emergency.map(|emergency| {
        let effect = if emergency.fits() {
            "finds room too".to_owned()
        } else {
            let feedback = (emergency.feedback_late_ns > 0).then(|| {
                format!("feedback up to {} µs late, a missed cycle", us(emergency.feedback_late_ns))
            });
            let sync = (emergency.next_sync_late_ns > 0)
                .then(|| format!("the next SYNC up to {} µs late", us(emergency.next_sync_late_ns)));
            let effects: Vec<_> = feedback.into_iter().chain(sync).collect();
            format!("makes {} (it is harmless once)", effects.join(", "))
        };
        format!("emergency     one of {} µs {effect}", us(emergency.transmission_ns))
    }));
    lines
}

/// Why a fit is narrow.
pub fn narrow(bus: &BusSchedule) -> Option<String> {
    let us = microseconds;
    bus.is_narrow().then(|| {
        format!(
            "less reserve than a controller should have: {} µs for SYNC, {} µs for wake-up and computing",
            us(WAKE_UP_RESERVE_NS),
            us(WAKE_UP_RESERVE_NS + COMPUTE_RESERVE_NS),
        )
    })
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
        Shortfall::RepliesLate { done_ns, next_command_phase_ns } => format!(
            "replies of the drives can arrive until {} µs, but are needed at the next command phase, {} µs",
            us(*done_ns),
            us(*next_command_phase_ns)
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
            "no heartbeats of the drives, whose feedback shows that they are alive: heartbeat = \"off\""
                .to_owned()
        }
        Remedy::ServiceFrames { frames } => {
            format!("fewer service frames: service_frames_per_cycle = {frames}")
        }
        Remedy::SharedCommandFrames => {
            "command frames that axes share: [[bus]] command_frames = \"shared\"".to_owned()
        }
        Remedy::NoAnswersToSync => {
            "no answers to SYNC, at the price of feedback that is a cycle older: answers_sync = false"
                .to_owned()
        }
        Remedy::SmallerFeedback { without } => {
            let words: Vec<_> = without.iter().map(|object| format!("{:?}", object.word())).collect();
            format!("feedback without {}", words.join(", "))
        }
        Remedy::MasterHeartbeatOff => {
            "no heartbeat of the controller, though no drive then notices that it has \
                                       died: [master] heartbeat = \"off\""
                .to_owned()
        }
        Remedy::TimeOff => {
            "no TIME, where no drive needs the time of day: [master] time = \"off\"".to_owned()
        }
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
        write_remedies(&mut text, &bus.remedies);
    }
    text.truncate(text.trim_end().len());
    text
}

fn write_remedies(text: &mut String, remedies: &[Remedy]) {
    let lines: Vec<_> = remedies.iter().map(|change| format!("    - {}", remedy(change))).collect();
    if lines.is_empty() {
        let _ = writeln!(text, "  no single change that was tried makes it fit");
    } else {
        let _ = writeln!(text, "  what would fit:\n{}", lines.join("\n"));
    }
}

/// Why there is no command phase: for each bus that is a cause, from when to when it would have to be.
pub(super) fn no_command_phase(buses: &[BusSchedule]) -> String {
    let us = microseconds;
    let mut text = String::new();
    for bus in buses {
        let slot = &bus.slot;
        let latest = match bus.period_ns.checked_sub(slot.after_command_phase_ns) {
            Some(latest_ns) => format!("at {} µs at the latest", us(latest_ns)),
            None => "never early enough".to_owned(),
        };
        let _ = writeln!(
            text,
            "the bus {:?} needs it at {} µs at the earliest ({}), {latest} ({} period - {} until the next SYNC)",
            bus.name,
            us(slot.earliest_command_phase_ns),
            sum(&[
                (slot.sync_ns, "SYNC"),
                (slot.feedback_delay_ns, "drives' delay"),
                (slot.feedback_ns, "feedback"),
                (
                    slot.earliest_command_phase_ns - slot.sync_ns - slot.feedback_delay_ns - slot.feedback_ns,
                    "waits"
                ),
            ]),
            us(bus.period_ns),
            us(slot.after_command_phase_ns),
        );
        if slot.command_phases_ns.is_none() {
            write_remedies(&mut text, &bus.remedies);
        }
    }
    text.truncate(text.trim_end().len());
    text
}
