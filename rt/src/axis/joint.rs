//! Where the joint of an axis is, by the reports that are plausible, and whether it stands.

use super::parameters::AxisParameters;
use super::plausibility::{Meaning, Plausibility, PlausibilityCheck, TravelBound};
use super::position_counter::PositionCounter;
use super::reception::ReportSpan;
use super::standstill::{AT_REST, Standstill};
use super::velocity_estimate::{CountRate, VelocityEstimate};
use crate::guard::AxisLimits;
use crate::units::Scale;

/// What is known of a joint beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointFacts<'a> {
    pub(super) scale: &'a Scale,
    pub(super) counter: PositionCounter,
    pub(super) limits: &'a AxisLimits,
}

impl<'a> JointFacts<'a> {
    pub(super) fn of(parameters: &'a AxisParameters) -> Self {
        Self { scale: &parameters.scale, counter: parameters.counter, limits: &parameters.limits }
    }

    /// Of all counts that the drive reports as this one, that which is nearest to the middle of the position limits: where the joint is
    /// if it has not been watched.
    #[inline]
    fn by_limits(self, reported: i32) -> i64 {
        let AxisLimits { position_min, position_max, .. } = *self.limits;
        self.counter.nearest(reported, self.scale.counts_at(0.5 * (position_min + position_max)))
    }

    fn position(self, counts: i64) -> f64 {
        self.scale.position_from_counts(counts)
    }

    /// The way of one lap of the counter: rad (m).
    fn lap(self) -> f64 {
        self.counter.lap() as f64 / self.scale.resolution()
    }
}

/// A report of a joint where it cannot have got to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Jump {
    /// How far that is from its last plausible position: rad (m).
    pub distance: f64,
    /// How far it can have got: rad (m).
    pub reach: f64,
}

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
    /// The counts of that position, over all wraps of the drive's counter.
    counts: i64,
    /// The same as the drive has reported them.
    reported_counts: i32,
    velocity: f64,
    /// By how much the velocity may be wrong.
    velocity_uncertainty: f64,
    /// The velocity by positions, for a drive that reports none.
    by_positions: VelocityEstimate,
    /// The last report, if the joint cannot have got there.
    jump: Option<Jump>,
    /// True if it has come to rest since the last stop began.
    standstill: Standstill,
}

impl JointEstimate {
    /// Takes the position that a report gives in counts, and the velocity in the drive's unit if it gives one. Where the joint cannot be
    /// it is not taken to be. Returns whether the position has become known by this.
    #[inline]
    pub(super) fn take_report(
        &mut self,
        reported: i32,
        velocity: Option<i32>,
        span: ReportSpan,
        facts: JointFacts<'_>,
    ) -> bool {
        let counted = self.counts + facts.counter.step(self.reported_counts, reported);
        let position = facts.position(counted);
        let (velocity_limit, count) = (facts.limits.velocity, 1.0 / facts.scale.resolution());
        let half_lap = 0.5 * facts.counter.lap() as f64 * count;
        let bound = TravelBound { velocity: velocity_limit, count, half_lap };
        let by_limits = || facts.position(facts.by_limits(reported));
        let mut has_become_known = false;
        match self.check.judge(position, by_limits, span.longest_s, bound) {
            Plausibility::Plausible(meaning) => {
                let (counts, position) = match meaning {
                    Meaning::Counted => (counted, position),
                    Meaning::ByLimits => (facts.by_limits(reported), by_limits()),
                };
                self.jump = None;
                match velocity {
                    Some(units) => {
                        self.velocity = facts.scale.velocity_from_drive(units);
                        self.velocity_uncertainty = facts.scale.velocity_resolution();
                    }
                    None => self.take_velocity(counts, meaning, span.longest_s, facts),
                }
                has_become_known = self.accept(reported, counts, position);
                self.standstill.note(self.position, span, velocity_limit, count);
            }
            Plausibility::Implausible { distance, reach } => self.jump = Some(Jump { distance, reach }),
        }
        self.source = Source::ProcessData;
        has_become_known
    }

    /// Derives the velocity from the positions.
    #[inline]
    fn take_velocity(&mut self, counts: i64, meaning: Meaning, elapsed_s: f64, facts: JointFacts<'_>) {
        let CountRate { rate, uncertainty } = match meaning {
            Meaning::Counted => self.by_positions.take(counts, elapsed_s),
            Meaning::ByLimits => {
                self.by_positions = VelocityEstimate::begin(counts);
                CountRate::default()
            }
        };
        let count = facts.scale.way_per_count();
        (self.velocity, self.velocity_uncertainty) = (rate * count, uncertainty * count.abs());
    }

    /// Takes the position that the drive has reported by SDO, unless it reports by process data. Returns whether the position
    /// has become known by this.
    pub(super) fn take_sdo_position(&mut self, reported: i32, facts: JointFacts<'_>) -> bool {
        if self.is_heard() {
            return false;
        }
        let counts = facts.by_limits(reported);
        let has_become_known = self.accept(reported, counts, facts.position(counts));
        self.source = Source::Sdo;
        has_become_known
    }

    fn accept(&mut self, reported: i32, counts: i64, position: f64) -> bool {
        (self.reported_counts, self.counts, self.position) = (reported, counts, position);
        !self.is_known()
    }

    /// Returns true if the drive can be commanded where the joint is: its counter has no wrap between the joint and the position limits, and the
    /// joint is not so far beyond them that it may as well be a lap of the counter away.
    pub(super) fn is_commandable(&self, facts: JointFacts<'_>) -> bool {
        /// Share of the counts outside of the limits, on either side, in which the joint is not taken to be a lap away.
        const SHARE: f64 = 0.25;
        let AxisLimits { position_min, position_max, .. } = *facts.limits;
        let beyond = (self.position - position_max).max(position_min - self.position);
        let outside = facts.lap() - (position_max - position_min);
        facts.counter.contains(self.counts) && (beyond <= 0.0 || beyond <= SHARE * outside)
    }

    /// A stop begins: from now on it counts for how long the joint has stood.
    pub(super) fn begin_stop(&mut self) {
        self.standstill = Standstill::default();
    }

    /// Returns `true` if the position is known.
    pub(super) fn is_known(&self) -> bool {
        self.source != Source::Unknown
    }

    /// Returns `true` if the drive has reported by process data.
    pub(super) fn is_heard(&self) -> bool {
        self.source == Source::ProcessData
    }

    /// The last plausible position.
    pub(super) const fn position(&self) -> f64 {
        self.position
    }

    /// The last plausible position, in counts as the drive has reported it.
    pub(super) const fn position_counts(&self) -> i32 {
        self.reported_counts
    }

    /// The last plausible velocity.
    pub(super) const fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The last report, if the joint cannot have got there.
    pub(super) const fn jump(&self) -> Option<Jump> {
        self.jump
    }

    /// By how much the velocity may be wrong that is derived from positions: half of a count on either side.
    pub(super) const fn velocity_uncertainty(&self) -> f64 {
        self.velocity_uncertainty
    }

    /// Returns `true` if the joint is reported to be slow, if only for a moment.
    pub(super) fn is_standing(&self, velocity_limit: f64) -> bool {
        self.velocity.abs() <= AT_REST * velocity_limit
    }

    /// How fast the joint moves, and how fast it might at rest.
    pub(super) fn motion(&self, velocity_limit: f64) -> Option<(f64, f64)> {
        self.standstill.motion(velocity_limit)
    }

    /// Returns `true` if the joint has been reported in one place for some cycles, since the last stop began.
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

    const SCALE: ScaleParameters = ScaleParameters {
        counts_per_turn: TAU * 1e6,
        velocity_units_per_turn: TAU * 1e6,
        gear_ratio: 1.0,
        travel_per_turn: TAU,
        reversed: false,
        zero_counts: 0.0,
        rated_torque: 31.0,
    };

    fn scale() -> Scale {
        Scale::new(SCALE).unwrap()
    }

    const LIMITS: AxisLimits =
        AxisLimits { position_min: -3.0, position_max: 3.0, velocity: 2.0, ..AxisLimits::NONE };

    fn facts(scale: &Scale) -> JointFacts<'_> {
        JointFacts { scale, counter: PositionCounter::default(), limits: &LIMITS }
    }

    fn report(joint: &mut JointEstimate, counts: i32, is_known: bool) -> bool {
        joint.take_report(
            counts,
            None,
            ReportSpan { longest_s: 1e-3, cycle_s: 1e-3, is_known },
            facts(&scale()),
        )
    }

    /// The position of a joint after these reports.
    fn position_after(facts: JointFacts<'_>, reports: impl IntoIterator<Item = i32>) -> (f64, bool) {
        let mut joint = JointEstimate::default();
        let span = ReportSpan { longest_s: 1e-3, cycle_s: 1e-3, is_known: true };
        for counts in reports {
            joint.take_report(counts, None, span, facts);
        }
        (joint.position(), joint.is_commandable(facts))
    }

    #[test]
    fn a_joint_whose_drive_counts_over_a_wrap_goes_on_there_and_is_not_commanded_beyond_it() {
        let scale = Scale::new(ScaleParameters { zero_counts: 2_147_000_000.0, ..SCALE }).unwrap();
        let facts = facts(&scale);
        let up = (0..200).map(|step| 2_147_400_000_i32.wrapping_add(step * 1_000));
        let (position, is_commandable) = position_after(facts, up.clone());
        assert!((position - 0.599).abs() < 1e-9, "{position}");
        assert!(!is_commandable);
        let (position, is_commandable) = position_after(facts, up.clone().chain(up.rev()));
        assert!((position - 0.4).abs() < 1e-9, "{position}");
        assert!(is_commandable);
    }

    #[test]
    fn the_limits_say_on_which_side_of_a_wrap_a_joint_is_that_nobody_has_watched() {
        // One lap of the counter is 16 rad.
        let counter = PositionCounter::new(-8_000_000, 7_999_999).unwrap();
        let scale = Scale::new(ScaleParameters { zero_counts: 4_500_000.0, ..SCALE }).unwrap();
        let facts = JointFacts { counter, ..facts(&scale) };
        let at = |joint: f64| {
            let counts = (joint * 1e6) as i64 + 4_500_000;
            position_after(facts, [((counts + 8_000_000).rem_euclid(16_000_000) - 8_000_000) as i32])
        };
        for (joint, is_expected) in [
            (0.0, true),
            (-3.0, true),
            (3.0, true),
            (3.3, true),
            (3.6, false),
            (5.4, false),
            (-5.4, true),
            (-5.7, false),
        ] {
            let (position, is_commandable) = at(joint);
            assert!((position - joint).abs() < 1e-6, "{position} for {joint}");
            assert_eq!(is_commandable, is_expected, "{joint}");
        }
    }

    #[test]
    fn a_position_becomes_known_once_and_process_data_go_before_sdo() {
        let mut joint = JointEstimate::default();
        assert!(joint.take_sdo_position(500, facts(&scale())) && !joint.is_heard());
        assert!(!report(&mut joint, 600, true) && joint.is_heard());
        assert!(!joint.take_sdo_position(700, facts(&scale())));
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
