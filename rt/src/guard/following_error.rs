//! For how long a joint has been too far from its set-point.

use crate::fault::Fault;

/// The following error of a joint, and for how long it has been too large.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct FollowingErrorGuard {
    limit: f64,
    allowed_cycles: u32,
    error: f64,
    /// Cycles in a row in which the error has been larger than the limit.
    cycles: u32,
}

impl FollowingErrorGuard {
    /// Allows an error beyond `limit` (rad or m) for `allowed_cycles` cycles in a row.
    pub const fn new(limit: f64, allowed_cycles: u32) -> Self {
        Self { limit, allowed_cycles, error: 0.0, cycles: 0 }
    }

    /// Allows from now on what another one allows.
    #[cfg(feature = "checkpoint")]
    pub fn take_limit_of(&mut self, other: &Self) {
        (self.limit, self.allowed_cycles) = (other.limit, other.allowed_cycles);
    }

    /// Takes the error that a report shows.
    pub fn set_error(&mut self, error: f64) {
        self.error = error;
    }

    /// The last error.
    pub const fn error(&self) -> f64 {
        self.error
    }

    /// Lets a cycle pass in which the error is known.
    pub fn pass(&mut self) {
        self.cycles = if self.error.abs() > self.limit { self.cycles.saturating_add(1) } else { 0 };
    }

    /// Returns `true` if the error has been too large for too long.
    pub fn check(&self) -> Result<(), Fault> {
        if self.cycles > self.allowed_cycles {
            return Err(Fault::FollowingError { error: self.error, limit: self.limit });
        }
        Ok(())
    }

    /// Forgets for how long the error has been too large.
    pub fn restart(&mut self) {
        self.cycles = 0;
    }

    /// The set-point is where the joint is: there is no error.
    pub fn clear(&mut self) {
        self.error = 0.0;
        self.restart();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_following_error_may_be_short_but_not_long() {
        let mut guard = FollowingErrorGuard::new(0.1, 3);
        let mut take = |error: f64| {
            guard.set_error(error);
            guard.pass();
            // Looking twice changes nothing.
            assert_eq!(guard.check(), guard.check());
            guard.check()
        };
        for _ in 0..3 {
            assert_eq!(take(-0.2), Ok(()));
        }
        assert_eq!(take(0.05), Ok(()));
        for _ in 0..3 {
            assert_eq!(take(0.2), Ok(()));
        }
        assert_eq!(take(0.2), Err(Fault::FollowingError { error: 0.2, limit: 0.1 }));
        guard.restart();
        assert_eq!((guard.check(), guard.error()), (Ok(()), 0.2));
    }
}
