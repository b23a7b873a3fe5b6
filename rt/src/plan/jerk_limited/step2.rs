//! Step 2: a motion of given duration.
//!
//! A motion with a cruise has one parameter, the velocity of the cruise. The distance grows with it wherever there is time
//! to cruise. Above the velocity before the target (UDDU), and below the velocity behind the start (its mirror image), that
//! gives a root in a bracket. Between the two (UDUD) it does too.
//!
//! In the remaining cases, two motions of this duration are known: one that goes too far, and one that does not go far enough. The
//! limits are convex, so a mixture of both keeps the limits, and the right mixture has the wanted distance.

use super::motion::{Motion, SevenPhases, VelocityStep};
use super::roots::{Point, excess, rising_root};
use super::step1::Edges;

/// A motion of given duration.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slower {
    /// A profile of seven phases.
    Plain(SevenPhases),
    /// The mixture `share · first + (1 − share) · second` of two motions.
    Mixture { first: SevenPhases, second: SevenPhases, share: f64 },
}

impl Edges {
    /// The motion over the wanted distance in this duration, which must not be blocked.
    pub(super) fn lasting(&self, duration: f64) -> Slower {
        let distance = self.motion.distance;
        let at_upper = self.cruise_distance(self.upper_base, self.upper.base, duration);
        let at_lower = self.cruise_distance(self.lower_base, -self.lower.base, duration);
        if duration < self.direct_duration.min(self.upper_base.1).min(self.lower_base.1) {
            return self.lasting_with_same_sign(duration);
        }
        if duration >= self.upper_base.1 && distance >= at_upper {
            return Slower::Plain(self.outside(self.upper.lasting(distance, duration)));
        }
        if duration >= self.lower_base.1 && distance <= at_lower {
            return Slower::Plain(self.outside(self.lower.lasting(-distance, duration).mirrored()));
        }
        let (first, far) = if duration >= self.upper_base.1 {
            (self.upper.phases(0.0, duration - self.upper_base.1), at_upper)
        } else {
            let family = self.upper_udu();
            let least = family.lasting(0.0, duration);
            (family.phases(least), family.at(least).distance)
        };
        let (second, near) = if duration >= self.lower_base.1 {
            (self.lower.phases(0.0, duration - self.lower_base.1).mirrored(), at_lower)
        } else {
            let family = self.lower_udu();
            let least = family.lasting(0.0, duration);
            (family.phases(least).reversed(), -family.at(least).distance)
        };
        if let Some(phases) = self.between(duration) {
            return Slower::Plain(self.outside(phases));
        }
        mixture(self.outside(first), far, self.outside(second), near, distance)
    }

    fn cruise_distance(&self, base: (f64, f64), velocity: f64, duration: f64) -> f64 {
        base.0 + velocity * (duration - base.1)
    }

    /// The UDUD motion, which cruises between the velocity behind the start and the velocity before the target.
    fn between(&self, duration: f64) -> Option<SevenPhases> {
        let family = Udud::of(&self.motion);
        let (low, high) = (-self.lower.base, self.upper.base);
        let distance = self.motion.distance;
        let offset = |velocity: f64| family.at(velocity, duration).distance - distance;
        if offset(low) > 0.0 || offset(high) < 0.0 {
            return None;
        }
        let velocity = rising_root(low, high, 0.5 * (low + high), |velocity| {
            let motion = family.at(velocity, duration);
            Point { value: excess(motion.distance, motion.size, distance), slope: motion.slope }
        });
        let motion = family.at(velocity, duration);
        // A search that reached the bound on its evaluations has found no root.
        let rounding = 1e-13 * (distance.abs() + duration * (low.abs() + high.abs()));
        let solved = (motion.distance - distance).abs() <= rounding;
        (solved && motion.cruise >= 0.0).then(|| family.phases(&motion))
    }

    fn lasting_with_same_sign(&self, duration: f64) -> Slower {
        let Some(same_sign) = self.same_sign() else {
            // The duration is shorter than the fastest one by rounding.
            let af = self.motion.af;
            let direct = if af > 0.0 { self.upper_udu().phases(af) } else { self.upper.phases(0.0, 0.0) };
            return Slower::Plain(self.outside(direct));
        };
        let upper = same_sign.upper.lasting(same_sign.least, duration);
        let lower = same_sign.lower.lasting(same_sign.least, duration);
        let first = self.outside(same_sign.upper.phases(upper).mirrored());
        let second = self.outside(same_sign.lower.phases(lower).reversed().mirrored());
        let (far, near) = (same_sign.upper.at(upper).distance, -same_sign.lower.at(lower).distance);
        mixture(first, far, second, near, same_sign.motion.distance)
    }
}

/// The mixture of two motions that has the wanted distance. `far` and `near` are the distances of the first and the second one.
fn mixture(first: SevenPhases, far: f64, second: SevenPhases, near: f64, distance: f64) -> Slower {
    let share = if far > near { ((distance - near) / (far - near)).clamp(0.0, 1.0) } else { 1.0 };
    if share >= 1.0 {
        Slower::Plain(first)
    } else if share <= 0.0 {
        Slower::Plain(second)
    } else {
        Slower::Mixture { first, second, share }
    }
}

/// All UDUD motions of a problem: the velocity rises to a cruise, and rises again behind it.
struct Udud {
    start_root: f64,
    target_root: f64,
    a0: f64,
    af: f64,
    limit: f64,
    distance_beside: f64,
}

/// The UDUD motion with one velocity of its cruise.
struct UdudMotion {
    first: VelocityStep,
    second: VelocityStep,
    cruise: f64,
    distance: f64,
    /// The size of the terms of the distance. The rounding error of the distance is relative to it.
    size: f64,
    /// The change of the distance with the velocity of the cruise.
    slope: f64,
}

impl Udud {
    fn of(motion: &Motion) -> Self {
        let Motion { a0, af, vf, up, .. } = *motion;
        let start_root = motion.start_root();
        let target_root = vf + 0.5 * af * af;
        let distance_beside =
            -(start_root * a0 + a0 * a0 * a0 / 6.0) - (target_root * af - af * af * af / 6.0);
        Self { start_root, target_root, a0, af, limit: up, distance_beside }
    }

    /// The motion of this duration that cruises at this velocity.
    fn at(&self, velocity: f64, duration: f64) -> UdudMotion {
        let first = VelocityStep::over(velocity - self.start_root, self.limit);
        let second = VelocityStep::over(self.target_root - velocity, self.limit);
        let (s1, s2) = (first.duration(), second.duration());
        let cruise = duration - (s1 - self.a0) - (s2 - self.af);
        let terms = [
            0.5 * (self.start_root + velocity) * s1,
            0.5 * (velocity + self.target_root) * s2,
            self.distance_beside,
            velocity * cruise,
        ];
        UdudMotion {
            first,
            second,
            cruise,
            distance: terms.iter().sum(),
            size: terms.iter().map(|term| term.abs()).sum(),
            slope: cruise + 0.5 * (first.peak + second.peak),
        }
    }

    fn phases(&self, motion: &UdudMotion) -> SevenPhases {
        let UdudMotion { first, second, cruise, .. } = motion;
        SevenPhases {
            durations: [
                first.peak - self.a0,
                first.hold,
                first.peak,
                *cruise,
                second.peak,
                second.hold,
                second.peak - self.af,
            ],
            jerks: [1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0],
        }
    }
}
