//! When in the slot the set-points leave, where drives carry them out as they arrive.
//!
//! A drive that is synchronised carries out its set-point with the next SYNC, whenever before it the set-point came. A drive of bit fields
//! carries it out when it arrives, and reads its joint for the reply then: for such a drive the request takes the place of SYNC. A move is
//! planned in some cycles and not in others, which then take longer to compute. So the frames of a controller with such drives are held, and
//! leave at one moment of every slot, the send phase.
//!
//! What is held leaves no later than it may: no bus that carries its traffic without a send phase does not carry it with one. Frames
//! that are ready later than that leave as soon as they are ready.

use takt_rt::SlotPlan;

use super::messages::{messages, while_enabled};
use super::slot::worst_slot;
use crate::config::{Config, Protocol};

/// What waking up and computing may take with the set-points still at their moment. A longer wait would make them older, and the thread spins
/// while it waits.
const LONGEST_NS: u64 = 100_000;
/// What is kept of the time that the buses leave, for handing the frames over.
const HAND_OVER_RESERVE_NS: u64 = 20_000;
/// The send phase begins a whole number of these after the command phase.
const STEP_NS: u64 = 1_000;

/// When the send phase of a configuration begins, in ns after the start of the slot: its frames leave then, whatever computing took. `None`
/// where they leave as soon as they are made: without drives that carry out set-points as they arrive, or without room for it on
/// the buses.
pub fn send_phase_ns(config: &Config) -> Option<u64> {
    let held_ns = held_ns(config);
    (held_ns > 0).then(|| config.cycle.command_phase_ns.saturating_add(held_ns))
}

/// How long after the beginning of the command phase the send phase begins; 0 without one.
pub(super) fn held_ns(config: &Config) -> u64 {
    if !config.axes.iter().any(|axis| axis.drive.protocol == Protocol::BitFields) {
        return 0;
    }
    let plan = SlotPlan::usual(config.cycle.period_ns, config.cycle.command_phase_ns);
    // A wake-up that is late for the send phase is still in time for the deadline.
    let half_ns = plan.latest_set_points_ns.saturating_sub(plan.command_phase_ns) / 2;
    let room_ns = (0..config.buses.len()).map(|bus| room_ns(config, bus)).min().unwrap_or(0);
    LONGEST_NS.min(half_ns).min(room_ns.saturating_sub(HAND_OVER_RESERVE_NS)) / STEP_NS * STEP_NS
}

/// By how much the set-points of a bus can leave later with everything still in time.
fn room_ns(config: &Config, bus: usize) -> u64 {
    let all = messages(config, bus);
    let slot = worst_slot(config, bus, &while_enabled(&all, config, bus));
    let cycle = config.bus_cycle(bus);
    if slot.feedback_done_ns > cycle.command_phase_ns {
        return 0;
    }
    let replies_due_ns = cycle.period_ns.saturating_add(cycle.command_phase_ns);
    slot.set_points_reserve_ns.min(replies_due_ns.saturating_sub(slot.replies_done_ns))
}
