//! The values that a number may have.

/// The values that a quantity or a number may have.
#[derive(Clone, Copy, Debug)]
pub enum Bounds {
    /// From here to here, both included.
    Between(f64, f64),
    /// From here to here, both included: what lies outside is a slip, for the reason given.
    Plausible { low: f64, high: f64, reason: &'static str },
    /// As [`Bounds::Plausible`]; infinity means without a limit.
    PlausibleOrInfinite { low: f64, high: f64, reason: &'static str },
    /// Zero, or as [`Bounds::Plausible`].
    PlausibleOrZero { low: f64, high: f64, reason: &'static str },
    /// Above zero up to and with one.
    Share,
    /// Any finite number.
    Finite,
}

impl Bounds {
    pub fn contain(self, value: f64) -> bool {
        match self {
            Self::Between(low, high) | Self::Plausible { low, high, .. } => (low..=high).contains(&value),
            Self::PlausibleOrInfinite { low, high, .. } => {
                (low..=high).contains(&value) || value == f64::INFINITY
            }
            Self::PlausibleOrZero { low, high, .. } => (low..=high).contains(&value) || value == 0.0,
            Self::Share => value > 0.0 && value <= 1.0,
            Self::Finite => value.is_finite(),
        }
    }

    pub fn show(self, show: impl Fn(f64) -> String) -> String {
        match self {
            Self::Between(low, high) => format!("{} to {}", show(low), show(high)),
            Self::Plausible { low, high, reason } => {
                format!("{} to {}: {reason}", show(low), show(high))
            }
            Self::PlausibleOrInfinite { low, high, reason } => {
                format!("{} to {}, or inf for no limit: {reason}", show(low), show(high))
            }
            Self::PlausibleOrZero { low, high, reason } => {
                format!("0, or {} to {}: {reason}", show(low), show(high))
            }
            Self::Share => format!("above {} up to {}", show(0.0), show(1.0)),
            Self::Finite => "any finite number".to_owned(),
        }
    }
}
