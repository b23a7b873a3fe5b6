//! What unruly clients ask for: a gentle motion of every joint, to and fro.

use std::f64::consts::TAU;
use std::time::Duration;

/// From one point to the next.
pub const INTERVAL: Duration = Duration::from_millis(10);

/// A sine of 0.25 Hz about the place where the joints were, which grows from rest.
pub struct Motion {
    /// rad (m)
    pub home: Vec<f64>,
}

impl Motion {
    /// The joints so long after the beginning: rad (m).
    pub fn after(&self, since: Duration) -> Vec<f64> {
        let since_s = since.as_secs_f64();
        let amplitude = 0.1 * (since_s / 2.0).min(1.0).powi(3);
        self.home.iter().map(|home| home + amplitude * (TAU * 0.25 * since_s).sin()).collect()
    }

    /// The next fifth of a second.
    pub fn chunk(&self, since: Duration) -> Vec<Vec<f64>> {
        (0..20).map(|index| self.after(since + INTERVAL * index)).collect()
    }
}
