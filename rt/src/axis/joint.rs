//! Where the joint of an axis is, by the reports that are plausible, and whether it stands.

use super::plausibility::{Plausibility, PlausibilityCheck, TravelBound};
use super::reception::ReportSpan;
use super::standstill::Standstill;
use super::{AT_REST, Jump};
use crate::units::Scale;

/// How the position of the joint is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
enum Source {
    /// It is not known.
    #[default]
    Unknown,
    /// The drive has reported it by SDO.
    Sdo,
    /// The drive reports it by process data.
    ProcessData,
}

/// The estimate of a joint's position and velocity. rad (m) and seconds.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct JointEstimate {
    check: PlausibilityCheck,
    source: Source,
    position: f64,
    position_counts: i32,
    velocity: f64,
    /// The last report, if the joint cannot have got there.
    jump: Option<Jump>,
    /// Whether it has come to rest since the last stop began.
    standstill: Standstill,
}

impl JointEstimate {
    /// Takes the position that a report gives in counts, and the velocity if it gives one. Where the joint cannot be it is
    /// not taken to be. Returns whether the position has become known by this.
    #[inline]
    pub(super) fn take_report(
        &mut self,
        counts: i32,
        velocity: Option<f64>,
        span: ReportSpan,
        scale: &Scale,
        velocity_limit: f64,
    ) -> bool {
        let position = scale.position_from_counts(counts);
        let bound = TravelBound { velocity: velocity_limit, count: 1.0 / scale.resolution() };
        let mut has_become_known = false;
        match self.check.judge(position, span.longest_s, bound) {
            Plausibility::Plausible { velocity: by_positions } => {
                self.jump = None;
                self.velocity = velocity.unwrap_or(by_positions);
                self.standstill.note(position, span, velocity_limit, bound.count);
                has_become_known = self.accept(position, counts);
            }
            Plausibility::Implausible { distance, reach } => self.jump = Some(Jump { distance, reach }),
        }
        self.source = Source::ProcessData;
        has_become_known
    }

    /// Takes the position that the drive has reported by SDO, unless it reports by process data. Returns whether the position
    /// has become known by this.
    pub(super) fn take_sdo_position(&mut self, counts: i32, scale: &Scale) -> bool {
        if self.is_heard() {
            return false;
        }
        let has_become_known = self.accept(scale.position_from_counts(counts), counts);
        self.source = Source::Sdo;
        has_become_known
    }

    fn accept(&mut self, position: f64, counts: i32) -> bool {
        (self.position, self.position_counts) = (position, counts);
        !self.is_known()
    }

    /// A stop begins: from now on it counts for how long the joint has stood.
    pub(super) fn begin_stop(&mut self) {
        self.standstill = Standstill::default();
    }

    /// Whether the position is known.
    pub(super) fn is_known(&self) -> bool {
        self.source != Source::Unknown
    }

    /// Whether the drive has reported by process data.
    pub(super) fn is_heard(&self) -> bool {
        self.source == Source::ProcessData
    }

    /// The last plausible position.
    pub(super) const fn position(&self) -> f64 {
        self.position
    }

    /// The last plausible position, in counts.
    pub(super) const fn position_counts(&self) -> i32 {
        self.position_counts
    }

    /// The last plausible velocity.
    pub(super) const fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The last report, if the joint cannot have got there.
    pub(super) const fn jump(&self) -> Option<Jump> {
        self.jump
    }

    /// Whether the joint is reported to be slow, if only for a moment.
    pub(super) fn is_standing(&self, velocity_limit: f64) -> bool {
        self.velocity.abs() <= AT_REST * velocity_limit
    }

    /// Whether the joint has been reported in one place for some cycles, since the last stop began.
    pub(super) const fn is_settled(&self) -> bool {
        self.standstill.is_at_rest()
    }
}

#[cfg(test)]
mod tests {
    use super::super::standstill::STANDING_REPORTS;
    use super::*;
    use crate::units::ScaleParameters;
    use core::f64::consts::TAU;

    const VELOCITY_LIMIT: f64 = 2.0;

    fn scale() -> Scale {
        Scale::new(ScaleParameters {
            counts_per_turn: TAU * 1e6,
            velocity_units_per_turn: TAU * 1e6,
            gear_ratio: 1.0,
            travel_per_turn: TAU,
            reversed: false,
            zero_counts: 0.0,
            rated_torque: 31.0,
        })
        .unwrap()
    }

    fn report(joint: &mut JointEstimate, counts: i32, is_known: bool) -> bool {
        joint.take_report(
            counts,
            None,
            ReportSpan { longest_s: 1e-3, cycle_s: 1e-3, is_known },
            &scale(),
            VELOCITY_LIMIT,
        )
    }

    #[test]
    fn a_position_becomes_known_once_and_process_data_go_before_sdo() {
        let mut joint = JointEstimate::default();
        assert!(joint.take_sdo_position(500, &scale()) && !joint.is_heard());
        assert!(!report(&mut joint, 600, true) && joint.is_heard());
        assert!(!joint.take_sdo_position(700, &scale()));
        assert_eq!(joint.position_counts(), 600);
    }

    #[test]
    fn where_the_joint_cannot_be_it_is_not_taken_to_be() {
        let mut joint = JointEstimate::default();
        report(&mut joint, 0, true);
        report(&mut joint, 500_000, true);
        assert_eq!(joint.position(), 0.0);
        assert!(joint.jump().is_some_and(|jump| (jump.distance - 0.5).abs() < 1e-9));
        report(&mut joint, 1_000, true);
        assert_eq!(joint.jump(), None);
        assert!((joint.position() - 1e-3).abs() < 1e-9);
    }

    #[test]
    fn a_joint_is_settled_after_it_has_stood_for_some_reports_since_the_last_stop_began() {
        let mut joint = JointEstimate::default();
        for _ in 0..=STANDING_REPORTS {
            assert!(!joint.is_settled());
            report(&mut joint, 0, true);
        }
        assert!(joint.is_settled());
        joint.begin_stop();
        assert!(!joint.is_settled());
    }
}
