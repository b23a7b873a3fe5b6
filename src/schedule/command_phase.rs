//! `command_phase = "auto"`: where in the slot the set-points are best made.
//!
//! Between the last feedback and the moment at which the set-points must be in the queue lies what the worst case
//! leaves of the slot. It is divided so that both wake-ups of the controller may be equally late: the one for SYNC,
//! which the feedback follows, and the one for the set-points, after which [`COMPUTE_RESERVE_NS`] are kept for
//! computing. That maximises the latency that the slot stands. What the feedback is given ends at a tenth of the
//! period, since a SYNC that is later than that is not sent at all ([`takt_rt::SlotPlan`]); all beyond goes to
//! the set-points.

use takt_rt::SlotPlan;
use thiserror::Error;

use super::{BusSchedule, COMPUTE_RESERVE_NS, analyse_bus, remedy, text};
use crate::config::Config;

/// The command phase is a whole number of these.
const STEP_NS: u64 = 1_000;

/// There is no command phase at which feedback and set-points of all buses are in time. `Display` gives the sums of
/// the buses that are the cause, and what would fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", text::no_command_phase(.0))]
pub struct NoCommandPhase(
    /// The cause: each bus that has no command phase; where each has one, the one whose feedback is the last to
    /// arrive and the one whose set-points must leave first.
    pub Vec<BusSchedule>,
);

/// The command phase that `"auto"` stands for, in ns after the start of the slot, whatever the configuration says now.
///
/// # Errors
/// None is possible.
pub fn automatic_command_phase(config: &Config) -> Result<u64, NoCommandPhase> {
    let buses: Vec<_> = (0..config.buses.len()).map(|index| analyse_bus(config, index)).collect();
    let without: Vec<_> =
        (0..).zip(&buses).filter(|(_, schedule)| schedule.slot.command_phases_ns.is_none()).collect();
    if !without.is_empty() {
        let with_remedies = without.into_iter().map(|(index, schedule)| BusSchedule {
            remedies: remedy::remedies_at_any_phase(config, index),
            ..schedule.clone()
        });
        return Err(NoCommandPhase(with_remedies.collect()));
    }
    let phases = || buses.iter().filter_map(|schedule| Some((schedule, schedule.slot.command_phases_ns?)));
    let last = phases().max_by_key(|(_, (earliest, _))| *earliest);
    let first = phases().min_by_key(|(_, (_, latest))| *latest);
    let (Some((last, (earliest_ns, _))), Some((first, (_, latest_ns)))) = (last, first) else {
        // Without buses nothing has to be waited for.
        return Ok(config.cycle.command_phase_ns);
    };
    match divide(config.cycle.period_ns, earliest_ns, latest_ns) {
        Some(command_phase_ns) => Ok(command_phase_ns),
        None => Err(NoCommandPhase(vec![last.clone(), first.clone()])),
    }
}

/// The command phase between these two that leaves both wake-ups the same latency.
pub(super) fn divide(period_ns: u64, earliest_ns: u64, latest_ns: u64) -> Option<u64> {
    let slack_ns = latest_ns.checked_sub(earliest_ns)?;
    let useful_ns = SlotPlan::usual(period_ns, earliest_ns).latest_sync_ns;
    let before_ns = (slack_ns.saturating_sub(COMPUTE_RESERVE_NS) / 2).min(useful_ns);
    let exact_ns = earliest_ns + before_ns;
    let whole_ns = exact_ns / STEP_NS * STEP_NS;
    Some(if whole_ns >= earliest_ns { whole_ns } else { exact_ns })
}

#[cfg(test)]
mod tests {
    use super::divide;

    #[test]
    fn both_wake_ups_may_be_equally_late_and_computing_has_its_time() {
        assert_eq!(divide(1_000_000, 420_000, 590_000), Some(495_000));
        assert_eq!(divide(1_000_000, 420_000, 460_500), Some(430_000));
    }

    #[test]
    fn where_there_is_hardly_any_room_the_set_points_come_as_soon_as_they_can() {
        assert_eq!(divide(1_000_000, 420_500, 440_000), Some(420_500));
        assert_eq!(divide(1_000_000, 420_000, 420_000), Some(420_000));
        assert_eq!(divide(1_000_000, 420_001, 420_000), None);
    }

    #[test]
    fn feedback_is_given_no_more_than_sync_may_be_late() {
        assert_eq!(divide(1_000_000, 200_000, 800_000), Some(300_000));
        assert_eq!(divide(2_000_000, 200_000, 800_000), Some(400_000));
    }
}
