//! Rotary or linear.

/// Whether an axis turns or slides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Travel {
    /// rad
    Rotary,
    /// m; so many in one turn.
    Linear {
        /// Lead in m.
        lead_m: f64,
    },
}
