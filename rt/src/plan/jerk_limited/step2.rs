//! Step 2: a motion of given duration (`otg.md` section 2, 5).
//!
//! The motions with a cruise have one parameter, its velocity, and the distance grows with it wherever there is
//! time to cruise. Above the velocity before the target and below the one behind the start that is a
//! bracketed root. In between, and where the acceleration never comes to zero, two motions of this duration are
//! known, one that goes too far and one not far enough; as the limits are convex, the right mixture of both is
//! a motion within the limits.

use super::motion::{Motion, Shape, Swing};
use super::roots::{Point, excess, rising_root};
use super::step1::Edges;

/// A motion of given duration.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slower {
    /// Seven phases.
    Plain(Shape),
    /// The mixture `share · first + (1 − share) · second` of two motions.
    Mixture { first: Shape, second: Shape, share: f64 },
}

impl Edges {
    /// The motion over the wanted distance in this duration, which must not be blocked.
    pub(super) fn lasting(&self, duration: f64) -> Slower {
        let distance = self.motion.distance;
        let at_upper = self.cruise_distance(self.upper_base, self.upper.base, duration);
        let at_lower = self.cruise_distance(self.lower_base, -self.lower.base, duration);
        if duration < self.direct_duration.min(self.upper_base.1).min(self.lower_base.1) {
            return self.lasting_in_lens(duration);
        }
        if duration >= self.upper_base.1 && distance >= at_upper {
            return Slower::Plain(self.outside(self.upper.lasting(distance, duration)));
        }
        if duration >= self.lower_base.1 && distance <= at_lower {
            return Slower::Plain(self.outside(self.lower.lasting(-distance, duration).mirrored()));
        }
        let (first, far) = if duration >= self.upper_base.1 {
            (self.upper.shape(0.0, duration - self.upper_base.1), at_upper)
        } else {
            let passage = self.upper_passage();
            let least = passage.lasting(0.0, duration);
            (passage.shape(least), passage.dip(least).distance)
        };
        let (second, near) = if duration >= self.lower_base.1 {
            (self.lower.shape(0.0, duration - self.lower_base.1).mirrored(), at_lower)
        } else {
            let passage = self.lower_passage();
            let least = passage.lasting(0.0, duration);
            (passage.shape(least).reversed(), -passage.dip(least).distance)
        };
        if let Some(shape) = self.between(duration) {
            return Slower::Plain(self.outside(shape));
        }
        mixture(self.outside(first), far, self.outside(second), near, distance)
    }

    fn cruise_distance(&self, base: (f64, f64), velocity: f64, duration: f64) -> f64 {
        base.0 + velocity * (duration - base.1)
    }

    /// The motion that cruises at a velocity between the one behind the start and the one before the target.
    fn between(&self, duration: f64) -> Option<Shape> {
        let rise = Rise::of(&self.motion);
        let (low, high) = (-self.lower.base, self.upper.base);
        let distance = self.motion.distance;
        let offset = |velocity: f64| rise.stage(velocity, duration).distance - distance;
        if offset(low) > 0.0 || offset(high) < 0.0 {
            return None;
        }
        let velocity = rising_root(low, high, 0.5 * (low + high), |velocity| {
            let stage = rise.stage(velocity, duration);
            Point { value: excess(stage.distance, stage.size, distance), slope: stage.slope }
        });
        let stage = rise.stage(velocity, duration);
        // A root that was cut off by the bound on evaluations is no root.
        let rounding = 1e-13 * (distance.abs() + duration * (low.abs() + high.abs()));
        let solved = (stage.distance - distance).abs() <= rounding;
        (solved && stage.cruise >= 0.0).then(|| rise.shape(&stage))
    }

    fn lasting_in_lens(&self, duration: f64) -> Slower {
        let Some(lens) = self.lens() else {
            // Shorter than the fastest by rounding.
            let af = self.motion.af;
            let direct = if af > 0.0 { self.upper_passage().shape(af) } else { self.upper.shape(0.0, 0.0) };
            return Slower::Plain(self.outside(direct));
        };
        let upper = lens.upper.lasting(lens.least, duration);
        let lower = lens.lower.lasting(lens.least, duration);
        let first = self.outside(lens.upper.shape(upper).mirrored());
        let second = self.outside(lens.lower.shape(lower).reversed().mirrored());
        let (far, near) = (lens.upper.dip(upper).distance, -lens.lower.dip(lower).distance);
        mixture(first, far, second, near, lens.motion.distance)
    }
}

fn mixture(first: Shape, far: f64, second: Shape, near: f64, distance: f64) -> Slower {
    let share = if far > near { ((distance - near) / (far - near)).clamp(0.0, 1.0) } else { 1.0 };
    if share >= 1.0 {
        Slower::Plain(first)
    } else if share <= 0.0 {
        Slower::Plain(second)
    } else {
        Slower::Mixture { first, second, share }
    }
}

/// Up to a cruise, and up again from it.
struct Rise {
    start_root: f64,
    target_root: f64,
    a0: f64,
    af: f64,
    limit: f64,
    distance_beside: f64,
}

struct Stage {
    first: Swing,
    second: Swing,
    cruise: f64,
    distance: f64,
    /// The size of the terms of the distance, to which its rounding error is relative.
    size: f64,
    slope: f64,
}

impl Rise {
    fn of(motion: &Motion) -> Self {
        let Motion { a0, af, vf, up, .. } = *motion;
        let start_root = motion.start_root();
        let target_root = vf + 0.5 * af * af;
        let distance_beside =
            -(start_root * a0 + a0 * a0 * a0 / 6.0) - (target_root * af - af * af * af / 6.0);
        Self { start_root, target_root, a0, af, limit: up, distance_beside }
    }

    fn stage(&self, velocity: f64, duration: f64) -> Stage {
        let first = Swing::over(velocity - self.start_root, self.limit);
        let second = Swing::over(self.target_root - velocity, self.limit);
        let (s1, s2) = (first.duration(), second.duration());
        let cruise = duration - (s1 - self.a0) - (s2 - self.af);
        let terms = [
            0.5 * (self.start_root + velocity) * s1,
            0.5 * (velocity + self.target_root) * s2,
            self.distance_beside,
            velocity * cruise,
        ];
        Stage {
            first,
            second,
            cruise,
            distance: terms.iter().sum(),
            size: terms.iter().map(|term| term.abs()).sum(),
            slope: cruise + 0.5 * (first.peak + second.peak),
        }
    }

    fn shape(&self, stage: &Stage) -> Shape {
        let Stage { first, second, cruise, .. } = stage;
        Shape {
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
