//! A checked trajectory in words, for the journal of a run.

use std::sync::Arc;

use takt_rt::{Polynomial, TimeLawPhase};

use super::{Path, Trajectory};
use crate::packet::{Malformed, Put, Take};

impl Trajectory {
    /// Puts it.
    pub(crate) fn put(&self, put: &mut Put) {
        let Path { axes, times_s, polynomials, points } = &*self.path;
        put.index(*axes).numbers(times_s).index(polynomials.len());
        for Polynomial(coefficients) in polynomials {
            coefficients.iter().for_each(|coefficient| {
                put.number(*coefficient);
            });
        }
        put.index(points.len());
        points.iter().for_each(|point| {
            put.index(*point);
        });
        put.index(self.law.len());
        for TimeLawPhase { from_s, path_s } in &self.law {
            put.number(*from_s);
            path_s.iter().for_each(|coefficient| {
                put.number(*coefficient);
            });
        }
        put.number(self.duration_s);
    }

    /// Takes one that was put.
    pub(crate) fn take(take: &mut Take<'_>) -> Result<Self, Malformed> {
        let (axes, times_s) = (take.index()?, take.numbers()?);
        let count = take.count_of(6)?;
        let polynomials = (0..count).map(|_| numbers(take).map(Polynomial)).collect::<Result<Vec<_>, _>>()?;
        let count = take.count_of(1)?;
        let points = (0..count).map(|_| take.index()).collect::<Result<_, _>>()?;
        let count = take.count_of(6)?;
        let law = (0..count)
            .map(|_| Ok(TimeLawPhase { from_s: take.number()?, path_s: numbers(take)? }))
            .collect::<Result<_, _>>()?;
        // What is sampled must be there for each axis at each time.
        if times_s.len().checked_mul(axes) != Some(polynomials.len()) {
            return Err(Malformed);
        }
        let path = Arc::new(Path { axes, times_s, polynomials, points });
        Ok(Self { path, law, duration_s: take.number()? })
    }
}

fn numbers<const N: usize>(take: &mut Take<'_>) -> Result<[f64; N], Malformed> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = take.number()?;
    }
    Ok(numbers)
}
