//! The planner, given any numbers at all: it answers or refuses, in bounded time, and no answer holds a number that is
//! none.
//!
//! ```text
//! fuzz/run 60 plan
//! ```
#![no_main]

use libfuzzer_sys::fuzz_target;
use takt_rt::plan::{
    Limits, PlanOptions, Problem, Profile, Return, State, Synchronisation, stop, synchronised,
    synchronised_velocity,
};

/// Bytes of one axis: six numbers of the states, seven of the limits.
const AXIS_BYTES: usize = 13 * 8;
const AXES_MAX: usize = 7;

/// Reads numbers from bytes; 0 behind the end.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn next(&mut self) -> f64 {
        match self.0.split_first_chunk::<8>() {
            Some((bytes, rest)) => {
                self.0 = rest;
                f64::from_le_bytes(*bytes)
            }
            None => 0.0,
        }
    }

    fn state(&mut self) -> State {
        State { position: self.next(), velocity: self.next(), acceleration: self.next() }
    }

    /// Limits with the right signs, which leaves more inputs to be planned; wrong ones are left as they are if `raw`.
    fn limits(&mut self, raw: bool, travel: bool) -> Limits {
        let [vmax, vmin, amax, amin, jmax, pmin, pmax] = [(); 7].map(|()| self.next());
        let limits = if raw {
            Limits::asymmetric(vmax, vmin, amax, amin, jmax)
        } else {
            Limits::asymmetric(vmax.abs(), -vmin.abs(), amax.abs(), -amin.abs(), jmax.abs())
        };
        if travel { limits.with_position(pmin, pmax) } else { limits }
    }
}

fn timing(mode: u8, numbers: &mut Numbers) -> PlanOptions {
    let (minimum_s, cycle_s) = (numbers.next(), numbers.next());
    PlanOptions {
        synchronisation: match mode & 3 {
            0 => Synchronisation::Time,
            1 => Synchronisation::Phase,
            2 => Synchronisation::Straight,
            _ => Synchronisation::Independent,
        },
        minimum_duration_s: if mode & 4 == 0 { 0.0 } else { minimum_s },
        cycle_s: (mode & 8 != 0).then_some(cycle_s),
        return_to_limits: if mode & 16 == 0 { Return::Fastest } else { Return::Settled },
    }
}

fn assert_numbers(state: &State) {
    let State { position, velocity, acceleration } = state;
    assert!(position.is_finite() && velocity.is_finite() && acceleration.is_finite(), "{state:?}");
}

fn check(duration_s: f64, profiles: &[Profile]) {
    assert!(duration_s.is_finite() && duration_s >= 0.0);
    for profile in profiles {
        assert!(profile.duration_s().is_finite() && profile.duration_s() >= 0.0);
        for part in [-1.0, 0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0] {
            assert_numbers(&profile.sample(part * profile.duration_s()));
        }
        let extrema = profile.extrema();
        for range in [extrema.position, extrema.velocity, extrema.acceleration] {
            assert!(range.min <= range.max, "{extrema:?}");
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some(([mode, kind], rest)) = bytes.split_first_chunk::<2>() else { return };
    let mut numbers = Numbers(rest);
    let timing = timing(*mode, &mut numbers);
    let axes = (numbers.0.len() / AXIS_BYTES).clamp(1, AXES_MAX);
    let problems: Vec<Problem> = (0..axes)
        .map(|_| Problem {
            start: numbers.state(),
            target: numbers.state(),
            limits: numbers.limits(kind & 1 != 0, kind & 2 != 0),
        })
        .collect();
    let mut profiles = vec![Profile::hold(0.0); axes];
    if let Ok(duration_s) = synchronised(&problems, &mut profiles, timing) {
        check(duration_s, &profiles);
    }
    if let Ok(duration_s) = synchronised_velocity(&problems, &mut profiles, timing) {
        check(duration_s, &profiles);
    }
    let starts: Vec<State> = problems.iter().map(|problem| problem.start).collect();
    let limits: Vec<Limits> = problems.iter().map(|problem| problem.limits).collect();
    if let Ok(duration_s) = stop(&starts, &limits, &mut profiles) {
        check(duration_s, &profiles);
    }
    for problem in &problems {
        if let Ok(next) = problem.track(0.001) {
            assert_numbers(&next);
        }
    }
});
