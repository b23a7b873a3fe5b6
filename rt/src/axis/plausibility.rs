//! Which of the positions that a drive reports are believed.

/// A joint that seems faster than this many times its velocity limit has not moved: its encoder, or its drive's report,
/// is wrong. The counts are for limits so low that a count is more than they allow in a cycle.
const IMPLAUSIBLE_SPEED: f64 = 4.0;
const IMPLAUSIBLE_COUNTS: f64 = 64.0;

/// How far a joint can get. rad (m) and seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct TravelBound {
    /// The velocity limit.
    pub(super) velocity: f64,
    /// What a count is.
    pub(super) count: f64,
}

impl TravelBound {
    fn within(self, seconds: f64) -> f64 {
        IMPLAUSIBLE_SPEED * self.velocity * seconds + IMPLAUSIBLE_COUNTS * self.count
    }
}

/// What is made of a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plausibility {
    /// The joint is there.
    Plausible {
        /// The velocity that got it there: rad/s (m/s).
        velocity: f64,
    },
    /// It cannot have got there.
    Implausible {
        /// How far it is from where it was: rad (m).
        distance: f64,
        /// How far it can have got: rad (m).
        reach: f64,
    },
}

/// Believes what a joint can have got to since it was believed to be somewhere; and what it cannot have got to when the
/// next report agrees. A frame that was corrupted does not agree with the next one, an encoder that has jumped does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PlausibilityCheck {
    believed: Option<f64>,
    /// Seconds since that was reported.
    believed_s: f64,
    /// The last report, if it was not believed.
    doubtful: Option<f64>,
}

impl PlausibilityCheck {
    /// Takes a report, so many seconds after the one before.
    pub(super) fn judge(&mut self, reported: f64, elapsed_s: f64, reach: TravelBound) -> Plausibility {
        self.believed_s += elapsed_s;
        let Some(believed) = self.believed else {
            self.accept(reported);
            return Plausibility::Plausible { velocity: 0.0 };
        };
        let sources = [Some((believed, self.believed_s)), self.doubtful.map(|from| (from, elapsed_s))];
        let source = sources
            .into_iter()
            .flatten()
            .find(|(from, seconds)| (reported - from).abs() <= reach.within(*seconds));
        match source {
            Some((from, seconds)) => {
                self.accept(reported);
                let velocity = if seconds > 0.0 { (reported - from) / seconds } else { 0.0 };
                Plausibility::Plausible { velocity }
            }
            None => {
                self.doubtful = Some(reported);
                let distance = (reported - believed).abs();
                Plausibility::Implausible { distance, reach: reach.within(self.believed_s) }
            }
        }
    }

    fn accept(&mut self, position: f64) {
        *self = Self { believed: Some(position), believed_s: 0.0, doubtful: None };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 mrad in a millisecond, and a little more.
    const REACH: TravelBound = TravelBound { velocity: 2.0, count: 1e-6 };

    fn judged(reports: &[f64]) -> [bool; 8] {
        let mut watch = PlausibilityCheck::default();
        let mut believed = [false; 8];
        for (is_believed, report) in believed.iter_mut().zip(reports) {
            *is_believed = matches!(watch.judge(*report, 1e-3, REACH), Plausibility::Plausible { .. });
        }
        believed
    }

    #[test]
    fn what_the_joint_cannot_have_got_to_is_believed_when_the_next_report_agrees() {
        assert_eq!(
            judged(&[0.0, 0.007, 0.014, 0.5, 0.501, 0.502])[..6],
            [true, true, true, false, true, true]
        );
    }

    #[test]
    fn reports_that_do_not_agree_are_not_believed_until_the_joint_is_where_it_can_be() {
        let believed = judged(&[0.0, 0.5, -0.5, 0.9, 0.001, -3.0, 0.002, 0.003]);
        assert_eq!(believed, [true, false, false, false, true, false, true, true]);
    }

    #[test]
    fn the_longer_nothing_is_believed_the_further_the_joint_can_have_got() {
        let mut watch = PlausibilityCheck::default();
        watch.judge(0.0, 1e-3, REACH);
        assert_eq!(watch.judge(0.1, 0.1, REACH), Plausibility::Plausible { velocity: 1.0 });
        let doubtful = watch.judge(0.2, 1e-3, REACH);
        let Plausibility::Implausible { distance, reach } = doubtful else { panic!("{doubtful:?}") };
        assert!((distance - 0.1).abs() < 1e-12);
        assert!((reach - (4.0 * 2.0 * 1e-3 + 64.0 * 1e-6)).abs() < 1e-12);
        // Of two that agree the second tells the velocity.
        let Plausibility::Plausible { velocity } = watch.judge(0.201, 1e-3, REACH) else { panic!() };
        assert!((velocity - 1.0).abs() < 1e-9);
    }
}
