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
}

impl TravelBound {
    fn within(self, seconds: f64) -> f64 {
        IMPLAUSIBLE_SPEED * self.velocity * seconds + IMPLAUSIBLE_COUNTS * self.count
    }
}

/// The verdict on a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plausibility {
    /// The joint is there.
    Plausible {
        /// The velocity that brought it there: rad/s (m/s).
        velocity: f64,
    },
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
    /// Takes a report, so many seconds after the one before.
    #[inline]
    pub(super) fn judge(&mut self, reported: f64, elapsed_s: f64, bound: TravelBound) -> Plausibility {
        self.accepted_s += elapsed_s;
        let Some(accepted) = self.accepted else {
            self.accept(reported);
            return Plausibility::Plausible { velocity: 0.0 };
        };
        let is_reached = |from: f64, seconds: f64| (reported - from).abs() <= bound.within(seconds);
        let source = if is_reached(accepted, self.accepted_s) {
            Some((accepted, self.accepted_s))
        } else {
            let rejected = self.rejected.map(|from| (from, elapsed_s));
            rejected.filter(|(from, seconds)| is_reached(*from, *seconds))
        };
        match source {
            Some((from, seconds)) => {
                self.accept(reported);
                let velocity = if seconds > 0.0 { (reported - from) / seconds } else { 0.0 };
                Plausibility::Plausible { velocity }
            }
            None => {
                self.rejected = Some(reported);
                let distance = (reported - accepted).abs();
                Plausibility::Implausible { distance, reach: bound.within(self.accepted_s) }
            }
        }
    }

    fn accept(&mut self, position: f64) {
        *self = Self { accepted: Some(position), accepted_s: 0.0, rejected: None };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 mrad in a millisecond, and a little more.
    const BOUND: TravelBound = TravelBound { velocity: 2.0, count: 1e-6 };

    fn judged(reports: &[f64]) -> [bool; 8] {
        let mut check = PlausibilityCheck::default();
        let mut accepted = [false; 8];
        for (is_accepted, report) in accepted.iter_mut().zip(reports) {
            *is_accepted = matches!(check.judge(*report, 1e-3, BOUND), Plausibility::Plausible { .. });
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
        check.judge(0.0, 1e-3, BOUND);
        assert_eq!(check.judge(0.1, 0.1, BOUND), Plausibility::Plausible { velocity: 1.0 });
        let verdict = check.judge(0.2, 1e-3, BOUND);
        let Plausibility::Implausible { distance, reach } = verdict else { panic!("{verdict:?}") };
        assert!((distance - 0.1).abs() < 1e-12);
        assert!((reach - (4.0 * 2.0 * 1e-3 + 64.0 * 1e-6)).abs() < 1e-12);
        // Of two that agree the second tells the velocity.
        let Plausibility::Plausible { velocity } = check.judge(0.201, 1e-3, BOUND) else { panic!() };
        assert!((velocity - 1.0).abs() < 1e-9);
    }
}
