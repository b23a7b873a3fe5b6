//! `command_phase = "auto"`: where in the slot the set-points are best made.
//!
//! Between the last feedback and the moment at which the set-points must be in the queue lies what the worst case
//! leaves of the slot. It is divided so that both wake-ups of the controller may be equally late: the one for SYNC,
//! which the feedback follows, and the one for the set-points, after which [`COMPUTE_RESERVE_NS`] are kept for
//! computing. That maximises the latency that the slot stands. What the feedback is given ends at a tenth of the
//! period, since a SYNC that is later than that is not sent at all ([`takt_rt::SlotPlan`]); all beyond goes to
//! the set-points.

use takt_rt::SlotPlan;

use super::bus_schedule::COMPUTE_RESERVE_NS;

/// The command phase is a whole number of these.
const STEP_NS: u64 = 1_000;

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
