//! The analysis of one bus.

use takt_wire::frame_time::{BitRates, worst_case_bits};

use super::bound::Traffic;
use super::bus_schedule::{BusSchedule, EmergencyEffect, MessageSchedule, Shortfall};
use super::messages::{BusMessage, MessageKind, bit_rates, messages, while_enabled};
use super::send_phase;
use super::slot::{Slot, worst_slot};
use crate::config::{Config, Cycle};
use crate::family;

/// Analyses a bus, without remedies for what does not fit.
pub(super) fn analyse_bus(config: &Config, index: usize) -> BusSchedule {
    let bus = config.buses.get(index);
    let cycle = config.bus_cycle(index);
    let rates = bit_rates(config, index);
    let all = messages(config, index);
    let enabled = while_enabled(&all, config, index);
    let slot = worst_slot(config, index, &enabled).held(send_phase::held_ns(config));
    let is_queue_empty_at_sync = slot.is_queue_empty_at_sync;
    let response_ns = |at: usize| {
        let (messages, place) = beside(&enabled, at);
        Traffic { messages: &messages, is_queue_empty_at_sync, rates }.response_time(place)
    };
    let messages: Vec<MessageSchedule> = all
        .iter()
        .map(|message| {
            let bits = worst_case_bits(message.shape);
            let at = enabled.iter().position(|other| std::ptr::eq(*other, message));
            let (in_slot_ns, deadline_ns) = in_slot(message, &enabled, &slot, cycle, rates);
            MessageSchedule {
                kind: message.kind,
                axis: message.axis.and_then(|axis| config.axes.get(axis)).map(|axis| axis.name.clone()),
                id: message.id.value(),
                length: message.shape.length,
                bits: bits.nominal + bits.data,
                period_ns: message.period_ns,
                jitter_ns: message.jitter_ns,
                transmission_ns: rates.duration_ns(bits),
                is_sent_while_enabled: at.is_some(),
                response_ns: at.and_then(response_ns),
                in_slot_ns,
                deadline_ns,
            }
        })
        .collect();
    BusSchedule {
        name: bus.map(|bus| bus.name.clone()).unwrap_or_default(),
        bit_rate: rates.nominal,
        period_ns: cycle.period_ns,
        command_phase_ns: cycle.command_phase_ns,
        load_percent: load_percent(&messages) + line_load_percent(config, index),
        shortfalls: shortfalls(&messages, &slot, cycle),
        messages,
        slot,
        emergency: EmergencyEffect::on(&slot, cycle.command_phase_ns),
        remedies: vec![],
    }
}

/// When a message has arrived in the slot, if it has a moment there, and when it must have.
fn in_slot(
    message: &BusMessage,
    all: &[&BusMessage],
    slot: &Slot,
    cycle: Cycle,
    rates: BitRates,
) -> (Option<u64>, Option<u64>) {
    match message.kind {
        // Its lateness is part of the feedback's.
        MessageKind::Sync => (Some(slot.wait_before_sync_ns + slot.sync_ns), None),
        MessageKind::Feedback => (Some(slot.feedback_done_ns), Some(cycle.command_phase_ns)),
        MessageKind::SetPoint => {
            let counts = |kind| matches!(kind, MessageKind::SetPoint | MessageKind::Answer);
            let up_to = all.iter().filter(|other| counts(other.kind) && other.axis <= message.axis);
            let sent_ns: u64 = up_to.map(|other| rates.duration_ns(worst_case_bits(other.shape))).sum();
            let done_ns = cycle.command_phase_ns + slot.held_ns + slot.wait_before_set_points_ns + sent_ns;
            (Some(done_ns), Some(cycle.period_ns))
        }
        MessageKind::Answer => (Some(slot.set_points_done_ns), Some(cycle.period_ns)),
        MessageKind::Reply => (Some(slot.replies_done_ns), Some(cycle.period_ns + cycle.command_phase_ns)),
        _ => (None, message.deadline_ns),
    }
}

fn load_percent(messages: &[MessageSchedule]) -> f64 {
    messages
        .iter()
        .filter(|message| message.is_sent_while_enabled && message.kind != MessageKind::Emergency)
        .map(|message| 100.0 * message.transmission_ns as f64 / message.period_ns as f64)
        .sum()
}

/// The share of the time that bytes are on a serial line; 0 for a CAN bus.
fn line_load_percent(config: &Config, bus: usize) -> f64 {
    let on_line = config.axes_of_bus(bus).filter(|axis| axis.drive.protocol.is_of_serial_line());
    let budgets = on_line.filter_map(|axis| family::of(&axis.drive).off_cycle_budget(axis, config));
    100.0 * budgets.map(|budget| budget.bus_share).sum::<f64>()
}

fn shortfalls(messages: &[MessageSchedule], slot: &Slot, cycle: Cycle) -> Vec<Shortfall> {
    let (period_ns, command_phase_ns) = (cycle.period_ns, cycle.command_phase_ns);
    let feedback = (slot.feedback_done_ns > command_phase_ns)
        .then_some(Shortfall::FeedbackLate { done_ns: slot.feedback_done_ns, command_phase_ns });
    let set_points = (slot.set_points_done_ns > period_ns)
        .then_some(Shortfall::SetPointsLate { done_ns: slot.set_points_done_ns, period_ns });
    let next_command_phase_ns = period_ns + command_phase_ns;
    let replies = (slot.replies_done_ns > next_command_phase_ns)
        .then_some(Shortfall::RepliesLate { done_ns: slot.replies_done_ns, next_command_phase_ns });
    let others = messages.iter().filter_map(|message| {
        let deadline_ns = message.deadline_ns.filter(|_| message.kind.is_background())?;
        let is_late = message.response_ns.is_none_or(|response| response > deadline_ns);
        is_late.then(|| Shortfall::MessageLate {
            kind: message.kind,
            axis: message.axis.clone(),
            response_ns: message.response_ns,
            deadline_ns,
        })
    });
    feedback.into_iter().chain(set_points).chain(replies).chain(others).collect()
}

/// The messages that count for the response time of one message, and the place of that message among them. An emergency
/// message is analysed as the only one of its kind; all others are analysed without emergency messages.
fn beside<'a>(all: &[&'a BusMessage], at: usize) -> (Vec<&'a BusMessage>, usize) {
    let counts = |index: usize, message: &BusMessage| index == at || message.kind != MessageKind::Emergency;
    let counted = || all.iter().enumerate().filter(|(index, message)| counts(*index, message));
    let place = counted().take_while(|(index, _)| *index < at).count();
    (counted().map(|(_, message)| *message).collect(), place)
}
