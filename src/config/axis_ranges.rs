//! The ranges of what an axis has in rad or in m.

use super::bounds::Bounds;

/// The ranges of what an axis has in rad or in m.
pub struct AxisRanges {
    pub velocity: Bounds,
    pub acceleration: Bounds,
    pub jerk: Bounds,
    pub effort: Bounds,
    /// Following errors and tolerances.
    pub deviation: Bounds,
    pub inertia: Bounds,
    pub fed_forward_inertia: Bounds,
    pub friction: Bounds,
    pub stiffness: Bounds,
    pub damping: Bounds,
    pub viscous_friction: Bounds,
}

const SLOW: &str = "a slower joint takes hours for its range, and no joint is faster; check the unit";
const WEAK: &str = "no joint accelerates less or more; check the unit";
const ROUGH: &str = "no joint changes its acceleration less or more quickly; check the unit";
const STRONG: &str = "no joint has less or more; check the unit";
const FAR: &str = "less is below what a drive counts, and more would watch nothing; check the unit";
const HEAVY: &str = "no joint is lighter or heavier; check the unit";
const STIFF: &str = "no joint is held with less or more; check the unit";

impl AxisRanges {
    pub const ROTARY: Self = Self {
        velocity: Bounds::Plausible { low: 1e-4, high: 1e3, reason: SLOW },
        acceleration: Bounds::Plausible { low: 1e-3, high: 1e5, reason: WEAK },
        jerk: Bounds::PlausibleOrInfinite { low: 1e-2, high: 1e9, reason: ROUGH },
        effort: Bounds::Plausible { low: 1e-3, high: 1e6, reason: STRONG },
        deviation: Bounds::Plausible { low: 1e-6, high: 100.0, reason: FAR },
        inertia: Bounds::Plausible { low: 1e-7, high: 1e6, reason: HEAVY },
        fed_forward_inertia: Bounds::PlausibleOrZero { low: 1e-7, high: 1e6, reason: HEAVY },
        friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e6, reason: STRONG },
        stiffness: Bounds::Plausible { low: 1e-6, high: 1e9, reason: STIFF },
        damping: Bounds::PlausibleOrZero { low: 1e-9, high: 1e9, reason: STIFF },
        viscous_friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e6, reason: STRONG },
    };
    pub const LINEAR: Self = Self {
        velocity: Bounds::Plausible { low: 1e-6, high: 100.0, reason: SLOW },
        acceleration: Bounds::Plausible { low: 1e-5, high: 1e4, reason: WEAK },
        jerk: Bounds::PlausibleOrInfinite { low: 1e-4, high: 1e8, reason: ROUGH },
        effort: Bounds::Plausible { low: 1e-3, high: 1e7, reason: STRONG },
        deviation: Bounds::Plausible { low: 1e-8, high: 10.0, reason: FAR },
        inertia: Bounds::Plausible { low: 1e-4, high: 1e6, reason: HEAVY },
        fed_forward_inertia: Bounds::PlausibleOrZero { low: 1e-4, high: 1e6, reason: HEAVY },
        friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e7, reason: STRONG },
        stiffness: Bounds::Plausible { low: 1e-6, high: 1e10, reason: STIFF },
        damping: Bounds::PlausibleOrZero { low: 1e-9, high: 1e10, reason: STIFF },
        viscous_friction: Bounds::PlausibleOrZero { low: 1e-9, high: 1e7, reason: STRONG },
    };
}
