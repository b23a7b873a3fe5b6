//! Whether a joint has come to rest: for some time it has not left one place.
//!
//! A low velocity alone is no rest. A joint that turns round is slow for a moment, and so is one that a torque has only begun to
//! move. How far such a joint goes in a known time bounds how fast it is in the end.
//!
//! A position is known to some counts of the encoder: it flickers by that much at rest. A place is no smaller than that, and where
//! the velocity limit is low and the encoder coarse, it takes longer to show that a joint stands there: as long as a joint at
//! the mean speed that is allowed would take for the counts that have been seen, and one for the rounding.

use super::controlword::SETTLED_CYCLES;
use super::reception::ReportSpan;

/// A joint slower than this fraction of its velocity limit stands.
pub(super) const AT_REST: f64 = 0.02;

/// Reports that show the joint in one place before it counts as at rest: several times what a drive takes to obey.
pub(super) const STANDING_REPORTS: u32 = 5 * SETTLED_CYCLES;

/// How large a place may be, as a share of the way at the velocity limit in the time of these reports. A joint that turns round
/// in the middle of them is four times as fast at their end as its mean speed from end to end of its place. Until its drive has
/// obeyed the command that takes its power it gets faster by up to half of that again.
const PLACE: f64 = AT_REST / 6.0;

/// Smallest size of a place, in counts of the encoder: noise of three counts either way, and the rounding of a position
/// between two counts.
const NOISE_COUNTS: f64 = 8.0;

/// A joint that has been in a place of the size of the noise for this long is at rest, in seconds. The encoder shows no lower
/// speed sooner: 8 counts of 2^17 a turn in this time are a mean speed of 0.004 rad/s.
const LONGEST_S: f64 = 0.1;

/// The place where a joint has been reported lately.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct Standstill {
    /// The lowest and the highest position there: rad (m). `None` before the first report.
    place: Option<(f64, f64)>,
    /// Reports from there, after the first one.
    reports: u32,
    /// True if enough reports in a row came from one place, and none since then from elsewhere.
    is_at_rest: bool,
    /// Mean speed from end to end of the place that the joint left last: rad/s (m/s).
    left_at: f64,
}

impl Standstill {
    /// Takes a reported position. `count` is the resolution of the drive's encoder, by some of which the position of a standing joint
    /// changes. Over slots that were missed it is not known in which time the joint has moved how far: such a report does not count.
    #[inline]
    pub(super) fn note(&mut self, position: f64, span: ReportSpan, velocity_limit: f64, count: f64) {
        let reach = |reports: u32| PLACE * velocity_limit * f64::from(reports) * span.cycle_s;
        let farthest = reach(STANDING_REPORTS).max(NOISE_COUNTS * count);
        let (lowest, highest) = self.place.unwrap_or((position, position));
        let (lowest, highest) = (lowest.min(position), highest.max(position));
        if highest - lowest > farthest {
            let left_at = (highest - lowest) / (f64::from(self.reports + 1) * span.cycle_s);
            *self = Self { place: Some((position, position)), reports: 0, is_at_rest: false, left_at };
            return;
        }
        let has_counted = self.place.is_some() && span.is_known;
        self.reports += u32::from(has_counted);
        self.place = Some((lowest, highest));
        let is_slow = highest - lowest + count <= reach(self.reports);
        let is_long = f64::from(self.reports) * span.cycle_s >= LONGEST_S;
        if self.reports >= STANDING_REPORTS && (is_slow || is_long) {
            // From here on anew: a joint may creep out of a place in a long time.
            *self = Self { place: Some((position, position)), reports: 0, is_at_rest: true, left_at: 0.0 };
        }
    }

    /// How fast the joint left the place where it was seen last, and the mean speed up to which it would have stayed there; `None` at rest,
    /// and before it has left one.
    pub(super) fn motion(&self, velocity_limit: f64) -> Option<(f64, f64)> {
        (!self.is_at_rest && self.left_at > 0.0).then_some((self.left_at, PLACE * velocity_limit))
    }

    /// Returns `true` if the joint has been in one place for as long as is needed.
    pub(super) const fn is_at_rest(&self) -> bool {
        self.is_at_rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_S: f64 = 1e-3;
    const VELOCITY_LIMIT: f64 = 1.0;
    const COUNT: f64 = 2e-6;

    fn note(standstill: &mut Standstill, position: f64, is_known: bool) {
        let counts = (position / COUNT).round();
        let span = ReportSpan { longest_s: CYCLE_S, cycle_s: CYCLE_S, is_known };
        standstill.note(counts * COUNT, span, VELOCITY_LIMIT, COUNT);
    }

    /// How fast the joint is, as a share of its limit, when it is first taken to be at rest; `None` if it never is.
    fn speed_at_rest(position: impl Fn(f64) -> f64) -> Option<f64> {
        let mut standstill = Standstill::default();
        let at_s = |cycle: u32| f64::from(cycle) * CYCLE_S;
        let cycle = (0..2_000).find(|cycle| {
            note(&mut standstill, position(at_s(*cycle)), true);
            standstill.is_at_rest()
        })?;
        Some((position(at_s(cycle + 1)) - position(at_s(cycle))).abs() / CYCLE_S / VELOCITY_LIMIT)
    }

    #[test]
    fn a_joint_that_turns_round_is_slow_whenever_it_is_taken_to_be_at_rest() {
        for acceleration in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0] {
            for turns_at_ms in 5..60 {
                let turns_at_s = f64::from(turns_at_ms) * 1e-3;
                let turning = |at_s: f64| acceleration / 2.0 * (at_s - turns_at_s).powi(2);
                let speed = speed_at_rest(turning).unwrap_or(0.0);
                assert!(speed <= AT_REST, "{acceleration}, after {turns_at_ms} ms: {speed}");
            }
        }
    }

    #[test]
    fn a_joint_is_at_rest_that_its_encoder_reports_one_count_to_and_fro() {
        let flickering = |at_s: f64| COUNT * f64::from((at_s / CYCLE_S).round() as u32 % 2);
        assert!(speed_at_rest(flickering).is_some());
    }

    /// A joint whose encoder has this many counts a turn, behind a gear of this ratio, and noise of up to so many counts either way.
    #[derive(Clone, Copy, Debug)]
    struct Noisy {
        counts_per_turn: f64,
        gear_ratio: f64,
        noise: i32,
        cycle_s: f64,
    }

    impl Noisy {
        const VELOCITY_LIMIT: f64 = 5.0 * core::f64::consts::PI / 180.0;

        fn all() -> impl Iterator<Item = Self> {
            let encoders =
                [17, 19, 20].into_iter().flat_map(|bits| [1.0, 50.0, 100.0].map(|ratio| (bits, ratio)));
            let noisy = encoders.flat_map(|encoder| [0, 1, 2, 3].map(|noise| (encoder, noise)));
            noisy.flat_map(|((bits, gear_ratio), noise)| {
                [1e-3, 2e-3].map(|cycle_s| Self {
                    counts_per_turn: f64::from(1 << bits),
                    gear_ratio,
                    noise,
                    cycle_s,
                })
            })
        }

        /// The times at which a joint that is there is taken to be at rest, within so many seconds.
        fn rests(self, position: impl Fn(f64) -> f64, duration_s: f64) -> impl Iterator<Item = f64> {
            let count = core::f64::consts::TAU / (self.counts_per_turn * self.gear_ratio);
            let (mut standstill, mut random) = (Standstill::default(), 1_u32);
            let cycles = (duration_s / self.cycle_s) as u32;
            (0..cycles).filter_map(move |cycle| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let noise = (random >> 8) as i32 % (2 * self.noise + 1) - self.noise;
                let at_s = f64::from(cycle) * self.cycle_s;
                let counts = (position(at_s) / count).round() + f64::from(noise);
                let span = ReportSpan { longest_s: self.cycle_s, cycle_s: self.cycle_s, is_known: true };
                standstill.note(counts * count, span, Self::VELOCITY_LIMIT, count);
                standstill.is_at_rest().then_some(at_s)
            })
        }
    }

    #[test]
    fn a_joint_stands_however_its_encoder_flickers_by_some_counts() {
        for noisy in Noisy::all() {
            // Half way between two counts.
            let place = 0.3 + 0.5 * core::f64::consts::TAU / (noisy.counts_per_turn * noisy.gear_ratio);
            let mut rests = noisy.rests(|_| place, 20.0);
            let first_s = rests.next().unwrap_or(f64::INFINITY);
            assert!(first_s <= LONGEST_S + noisy.cycle_s, "{noisy:?}: at rest after {first_s} s");
            let (count, cycles) = (rests.count() + 3, ((20.0 - first_s) / noisy.cycle_s) as usize);
            assert!(count >= cycles, "{noisy:?}: at rest in {count} of {cycles} cycles");
        }
    }

    #[test]
    fn a_joint_that_drifts_or_swings_by_more_than_the_noise_is_not_at_rest() {
        for noisy in Noisy::all() {
            for drift in [0.01, -0.01, 0.03] {
                assert_eq!(noisy.rests(|at_s| drift * at_s, 5.0).next(), None, "{noisy:?}: {drift} rad/s");
            }
            for frequency_hz in [5.0, 20.0, 50.0, 100.0] {
                let swinging = |at_s: f64| 1e-3 * (core::f64::consts::TAU * frequency_hz * at_s + 0.1).sin();
                assert_eq!(noisy.rests(swinging, 5.0).next(), None, "{noisy:?}: {frequency_hz} Hz");
            }
        }
    }

    #[test]
    fn a_joint_that_swings_or_creeps_is_not_at_rest() {
        for frequency_hz in [5.0, 20.0, 50.0, 100.0, 200.0] {
            let swinging = |at_s: f64| 2e-3 * (core::f64::consts::TAU * frequency_hz * at_s).sin();
            assert_eq!(speed_at_rest(swinging), None, "{frequency_hz} Hz");
        }
        assert_eq!(speed_at_rest(|at_s| 0.01 * at_s), None);
    }

    #[test]
    fn a_joint_that_settles_under_its_load_for_seconds_stays_at_rest_and_one_that_is_pushed_does_not() {
        let mut standstill = Standstill::default();
        for cycle in 0..10_000 {
            note(&mut standstill, 1e-6 * f64::from(cycle), true);
            assert!(cycle < 2 * STANDING_REPORTS || standstill.is_at_rest(), "{cycle}");
        }
        for cycle in 0..10 {
            note(&mut standstill, 0.01 + 3e-5 * f64::from(cycle), true);
        }
        assert!(!standstill.is_at_rest());
    }

    #[test]
    fn reports_after_slots_that_were_missed_do_not_count() {
        let mut standstill = Standstill::default();
        for report in 0..=STANDING_REPORTS {
            assert!(!standstill.is_at_rest());
            note(&mut standstill, 0.0, report != 7);
        }
        assert!(!standstill.is_at_rest(), "one of them was not counted");
        note(&mut standstill, 0.0, true);
        assert!(standstill.is_at_rest());
    }
}
