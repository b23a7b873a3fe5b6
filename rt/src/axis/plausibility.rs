//! Which of the positions that a drive reports are plausible.

/// A joint that seems faster than this many times its velocity limit has not moved: its encoder, or its drive's report,
/// is wrong. The counts are for limits so low that a count is more than they allow in a cycle.
const IMPLAUSIBLE_SPEED: f64 = 4.0;
const IMPLAUSIBLE_COUNTS: f64 = 64.0;

/// What bounds the travel of a joint. rad (m) and seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct TravelBound {
    /// The velocity limit.
    pub(super) velocity: f64,
    /// The distance of one count.
    pub(super) count: f64,
    /// Half a lap of the drive's position counter. A joint that can have moved farther may have passed a wrap unseen.
    pub(super) half_lap: f64,
}

impl TravelBound {
    fn within(self, seconds: f64) -> f64 {
        IMPLAUSIBLE_SPEED * self.velocity * seconds + IMPLAUSIBLE_COUNTS * self.count
    }
}

/// Which position a report means, of those that are whole laps of the drive's position counter apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    /// The nearest one to the last position.
    Counted,
    /// The nearest one to the middle of the position limits: the joint has not been watched all the way.
    ByLimits,
}

/// The verdict on a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plausibility {
    /// The joint is there: at this one of the positions that the report may mean.
    Plausible(Meaning),
    /// The joint cannot have got there.
    Implausible {
        /// How far that is from its last plausible position: rad (m).
        distance: f64,
        /// How far it can have got: rad (m).
        reach: f64,
    },
}

/// Accepts a position that the joint can have reached since its last plausible position. Another position is accepted when
/// the next report agrees with it: a corrupted frame does not agree with the next one, an encoder that has jumped does.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct PlausibilityCheck {
    accepted: Option<f64>,
    /// Seconds since the accepted position was reported.
    accepted_s: f64,
    /// The last report, if it was not accepted.
    rejected: Option<f64>,
}

impl PlausibilityCheck {
    /// Takes a report, so many seconds after the one before: where the joint is if the laps of the counter are counted from its last
    /// position, and if the position limits decide.
    #[inline]
    pub(super) fn judge(
        &mut self,
        counted: f64,
        by_limits: impl FnOnce() -> f64,
        elapsed_s: f64,
        bound: TravelBound,
    ) -> Plausibility {
        self.accepted_s += elapsed_s;
        let reach = bound.within(self.accepted_s);
        match self.accepted {
            Some(from) if reach < bound.half_lap && (counted - from).abs() <= reach => {
                self.accept(counted, Meaning::Counted)
            }
            accepted => self.judge_anew(accepted, by_limits(), reach, bound.within(elapsed_s)),
        }
    }

    /// Takes a report that does not follow from the last position. The joint can have got so far since the accepted position, and so
    /// far since the last report.
    #[cold]
    fn judge_anew(
        &mut self,
        accepted: Option<f64>,
        reported: f64,
        reach: f64,
        reach_of_report: f64,
    ) -> Plausibility {
        let Some(accepted) = accepted else { return self.accept(reported, Meaning::ByLimits) };
        let before = [Some((accepted, reach)), self.rejected.map(|from| (from, reach_of_report))];
        if before.into_iter().flatten().any(|(from, reach)| (reported - from).abs() <= reach) {
            return self.accept(reported, Meaning::ByLimits);
        }
        self.rejected = Some(reported);
        Plausibility::Implausible { distance: (reported - accepted).abs(), reach }
    }

    fn accept(&mut self, position: f64, meaning: Meaning) -> Plausibility {
        *self = Self { accepted: Some(position), accepted_s: 0.0, rejected: None };
        Plausibility::Plausible(meaning)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 mrad in a millisecond, and a little more.
    const BOUND: TravelBound = TravelBound { velocity: 2.0, count: 1e-6, half_lap: 1e3 };

    /// Takes a report of a joint that passes no wrap.
    fn judge(check: &mut PlausibilityCheck, reported: f64, elapsed_s: f64) -> Plausibility {
        check.judge(reported, || reported, elapsed_s, BOUND)
    }

    fn judged(reports: &[f64]) -> [bool; 8] {
        let mut check = PlausibilityCheck::default();
        let mut accepted = [false; 8];
        for (is_accepted, report) in accepted.iter_mut().zip(reports) {
            *is_accepted = matches!(judge(&mut check, *report, 1e-3), Plausibility::Plausible(_));
        }
        accepted
    }

    #[test]
    fn a_position_out_of_reach_is_accepted_when_the_next_report_agrees() {
        assert_eq!(
            judged(&[0.0, 0.007, 0.014, 0.5, 0.501, 0.502])[..6],
            [true, true, true, false, true, true]
        );
    }

    #[test]
    fn reports_that_do_not_agree_are_not_accepted_until_one_is_within_reach() {
        let accepted = judged(&[0.0, 0.5, -0.5, 0.9, 0.001, -3.0, 0.002, 0.003]);
        assert_eq!(accepted, [true, false, false, false, true, false, true, true]);
    }

    #[test]
    fn the_longer_nothing_is_accepted_the_further_the_joint_can_have_moved() {
        let mut check = PlausibilityCheck::default();
        judge(&mut check, 0.0, 1e-3);
        assert_eq!(judge(&mut check, 0.1, 0.1), Plausibility::Plausible(Meaning::Counted));
        let verdict = judge(&mut check, 0.2, 1e-3);
        let Plausibility::Implausible { distance, reach } = verdict else { panic!("{verdict:?}") };
        assert!((distance - 0.1).abs() < 1e-12);
        assert!((reach - (4.0 * 2.0 * 1e-3 + 64.0 * 1e-6)).abs() < 1e-12);
    }

    #[test]
    fn the_limits_say_what_a_report_means_that_does_not_follow_from_the_last_position() {
        let meaning =
            |check: &mut PlausibilityCheck, counted: f64, by_limits: f64, elapsed_s: f64| match check.judge(
                counted,
                || by_limits,
                elapsed_s,
                BOUND,
            ) {
                Plausibility::Plausible(meaning) => Some(meaning),
                Plausibility::Implausible { .. } => None,
            };
        let mut check = PlausibilityCheck::default();
        assert_eq!(meaning(&mut check, 2_003.0, 3.0, 1e-3), Some(Meaning::ByLimits), "the first one");
        assert_eq!(meaning(&mut check, 3.001, -1_997.0, 1e-3), Some(Meaning::Counted), "beyond the limits");
        assert_eq!(meaning(&mut check, 3.5, -1_996.5, 1e-3), None, "out of reach");
        assert_eq!(meaning(&mut check, 3.5, -1_996.5, 1e-3), Some(Meaning::ByLimits), "and again");
        // After 200 s of silence, in which it can have moved by more than half a lap.
        assert_eq!(meaning(&mut check, -1_996.5, 3.5, 200.0), None);
        assert_eq!(meaning(&mut check, -1_996.5, 3.5, 300.0), Some(Meaning::ByLimits));
    }
}
