//! What became of the motions that were begun last: each motion by the request that began it.

use crate::capacity::{MAX_AXES, MAX_GROUPS};
use crate::request::RequestId;
use crate::stop::StopReason;

/// What has become of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum MotionState {
    /// It is under way.
    InProgress,
    /// Every target has been reached. A velocity or a torque that has been reached goes on.
    Finished,
    /// The group has stopped before that.
    Stopped(StopReason),
    /// A later motion has taken its place before that.
    Replaced {
        /// The request for the later motion.
        by: RequestId,
    },
}

/// One motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct MotionReport {
    /// The request that began it.
    pub request: RequestId,
    /// The group that moves.
    pub group: u8,
    /// The axis, if it is the motion of one drive in a profile mode; `None` if it is one of the whole group.
    pub axis: Option<u8>,
    /// What has become of it.
    pub state: MotionState,
}

impl MotionReport {
    fn is_in_progress(&self) -> bool {
        matches!(self.state, MotionState::InProgress)
    }

    fn is_under_way_in(&self, group: u8) -> bool {
        self.group == group && self.is_in_progress()
    }
}

/// The motions in progress, and of those of each group that have ended the last [`MotionReports::ENDED`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct MotionReports {
    /// The newest first, without gaps.
    pub reports: [Option<MotionReport>; Self::CAPACITY],
}

impl Default for MotionReports {
    fn default() -> Self {
        Self { reports: [None; Self::CAPACITY] }
    }
}

impl MotionReports {
    /// How many motions of a group are remembered that have ended.
    pub const ENDED: usize = 8;
    /// There is room for a motion of each axis, and for one of each group and one that is to take its place, all in progress,
    /// beside those that have ended.
    pub const CAPACITY: usize = MAX_AXES + (2 + Self::ENDED) * MAX_GROUPS;

    /// What has become of the motion that a request began. `None` if the request began no motion, or one that has ended and
    /// was followed by many others of its group.
    pub fn of(&self, request: RequestId) -> Option<MotionState> {
        self.iter().find(|report| report.request == request).map(|report| report.state)
    }

    /// The motions, the newest first.
    pub fn iter(&self) -> impl Iterator<Item = &MotionReport> {
        self.reports.iter().map_while(Option::as_ref)
    }

    /// Begins a motion of a group. Those of that group in progress whose axis (`None`: all of it) it takes over are replaced. What
    /// is in progress is kept, and the newest of each group that have ended.
    pub fn begin(
        &mut self,
        request: RequestId,
        group: u8,
        axis: Option<u8>,
        takes_over: impl Fn(Option<u8>) -> bool,
    ) {
        let (mut ended, mut kept) = ([0; MAX_GROUPS], 0);
        for index in 0..Self::CAPACITY {
            let Some(report) = self.reports.get_mut(index).and_then(Option::as_mut) else { break };
            if report.is_under_way_in(group) && takes_over(report.axis) {
                report.state = MotionState::Replaced { by: request };
            }
            let is_kept = report.is_in_progress()
                || ended.get_mut(usize::from(report.group)).is_some_and(|ended| {
                    *ended += 1;
                    *ended <= Self::ENDED
                });
            // What is not kept gathers at the end.
            if is_kept {
                if kept < index {
                    self.reports.swap(kept, index);
                }
                kept += 1;
            }
        }
        let forgotten = self.reports.iter_mut().skip(kept);
        forgotten.take_while(|report| report.is_some()).for_each(|report| *report = None);
        if let Some(with_newest) = self.reports.get_mut(..(kept + 1).min(Self::CAPACITY)) {
            with_newest.rotate_right(1);
        }
        if let Some(newest) = self.reports.first_mut() {
            *newest = Some(MotionReport { request, group, axis, state: MotionState::InProgress });
        }
    }

    /// A motion that has begun to wait takes the place of one in progress.
    pub fn replace(&mut self, replaced: RequestId, by: RequestId) {
        for report in self.reports.iter_mut().flatten() {
            if report.request == replaced && report.is_in_progress() {
                report.state = MotionState::Replaced { by };
            }
        }
    }

    /// Ends every motion of a group that is in progress, and names the request that began each.
    pub fn end_all(&mut self, group: u8, state: MotionState, mut ended: impl FnMut(RequestId)) {
        for report in self.reports.iter_mut().flatten().filter(|report| report.is_under_way_in(group)) {
            report.state = state;
            ended(report.request);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    const WHOLE: fn(Option<u8>) -> bool = |axis| axis.is_none();

    fn of(reports: &MotionReports, request: u64) -> Option<MotionState> {
        reports.of(RequestId(request))
    }

    #[test]
    fn a_motion_that_is_followed_by_another_one_was_replaced_by_it_and_stays_so() {
        let mut reports = MotionReports::default();
        reports.begin(RequestId(4), 0, None, WHOLE);
        reports.begin(RequestId(7), 0, None, WHOLE);
        assert_eq!(of(&reports, 4), Some(MotionState::Replaced { by: RequestId(7) }));
        let end = |reports: &mut MotionReports| {
            let mut ended = Vec::new();
            reports.end_all(0, MotionState::Finished, |request| ended.push(request));
            ended
        };
        assert_eq!(end(&mut reports), [RequestId(7)]);
        assert_eq!(end(&mut reports), [], "nothing is in progress");
        assert_eq!(of(&reports, 4), Some(MotionState::Replaced { by: RequestId(7) }));
        assert_eq!((of(&reports, 7), of(&reports, 5)), (Some(MotionState::Finished), None));
    }

    #[test]
    fn a_motion_of_one_axis_replaces_only_that_of_the_same_axis() {
        let mut reports = MotionReports::default();
        reports.begin(RequestId(1), 0, Some(0), |axis| axis == Some(0));
        reports.begin(RequestId(2), 0, Some(1), |axis| axis == Some(1));
        reports.begin(RequestId(3), 0, Some(0), |axis| axis == Some(0));
        assert_eq!(of(&reports, 1), Some(MotionState::Replaced { by: RequestId(3) }));
        assert_eq!(of(&reports, 2), Some(MotionState::InProgress));
    }

    #[test]
    fn the_last_that_have_ended_are_remembered_and_all_that_are_in_progress() {
        let mut reports = MotionReports::default();
        let axes = MAX_AXES as u8;
        for axis in 0..axes {
            reports.begin(RequestId(u64::from(axis)), 0, Some(axis), |other| other == Some(axis));
        }
        for request in 1_000..1_100 {
            reports.begin(RequestId(request), 0, None, WHOLE);
        }
        assert!((0..axes).all(|axis| of(&reports, axis.into()) == Some(MotionState::InProgress)));
        let remembered: Vec<u64> =
            reports.iter().filter(|report| report.axis.is_none()).map(|report| report.request.0).collect();
        assert_eq!(remembered, (1_091..1_100).rev().collect::<Vec<_>>());
    }

    #[test]
    fn what_became_of_a_motion_is_not_forgotten_for_those_of_another_group() {
        let mut reports = MotionReports::default();
        for group in 0..MAX_GROUPS as u8 {
            for request in 0..100 {
                reports.begin(RequestId(1_000 * u64::from(group) + request), group, None, WHOLE);
                reports.end_all(group, MotionState::Finished, |_| {});
            }
        }
        for group in 0..MAX_GROUPS as u64 {
            let remembered = (0..100).filter(|request| of(&reports, 1_000 * group + request).is_some());
            assert_eq!(remembered.count(), MotionReports::ENDED + usize::from(group + 1 == 8), "{group}");
        }
    }

    #[test]
    fn the_motion_of_a_group_neither_replaces_nor_ends_that_of_another() {
        let mut reports = MotionReports::default();
        reports.begin(RequestId(1), 0, None, WHOLE);
        reports.begin(RequestId(2), 1, None, WHOLE);
        assert_eq!(of(&reports, 1), Some(MotionState::InProgress));
        reports.end_all(1, MotionState::Finished, |request| assert_eq!(request, RequestId(2)));
        assert_eq!(
            (of(&reports, 1), of(&reports, 2)),
            (Some(MotionState::InProgress), Some(MotionState::Finished))
        );
    }
}
