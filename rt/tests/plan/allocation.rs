//! The planner allocates nothing on any path: every allocation of the thread is counted.

use super::families::FAMILIES;
use super::random::Random;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use takt_rt::plan::{
    Limit, Limits, PlanError, PlanOptions, Problem, Profile, Quantity, Return, State, Synchronisation,
    position, stop, synchronised, synchronised_velocity, velocity,
};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The allocator of the system, with a count for each thread.
struct Counting;

// SAFETY: every call goes unchanged to the allocator of the system. The count touches no memory of the heap.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`, which is the same here.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: `pointer` came from `System` with this layout, and the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often `work` allocates.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn the_count_notices_an_allocation() {
    let mut numbers = Vec::new();
    assert_eq!(allocations(|| numbers.push(1)), 1);
    assert_eq!(numbers, [1]);
}

const MODES: [Synchronisation; 4] =
    [Synchronisation::Time, Synchronisation::Phase, Synchronisation::Straight, Synchronisation::Independent];

#[test]
fn no_plan_stop_sample_or_step_of_tracking_allocates() {
    let mut random = Random(9);
    let (mut planned, mut refused) = (0, 0);
    for number in 0..6000 {
        let family = FAMILIES[number % FAMILIES.len()];
        // Every third set has position limits, which some of the motions leave.
        let problems: [Problem; 3] = [(); 3].map(|()| {
            let problem = family.problem(&mut random);
            let (one, other) = (problem.start.position, problem.target.position);
            let room = random.uniform(0.0, 2.0);
            let limits = match number % 3 {
                0 => problem.limits.with_position(one.min(other) - room, one.max(other) + room),
                _ => problem.limits,
            };
            Problem { limits, ..problem }
        });
        let timing = PlanOptions {
            synchronisation: MODES[number / 3 % MODES.len()],
            minimum_duration_s: random.one_of([0.0, 5.0]),
            cycle_s: (random.uniform(0.0, 1.0) < 0.3).then_some(0.001),
            return_to_limits: if number % 2 == 0 { Return::Fastest } else { Return::Settled },
        };
        let (starts, limits) =
            (problems.map(|problem| problem.start), problems.map(|problem| problem.limits));
        let mut profiles = [Profile::hold(0.0); 3];
        let count = allocations(|| {
            match synchronised(&problems, &mut profiles, timing) {
                Ok(duration_s) => {
                    planned += 1;
                    for profile in &profiles {
                        core::hint::black_box((profile.sample(0.3 * duration_s), profile.extrema()));
                        core::hint::black_box((profile.phases().count(), profile.blocked().len()));
                    }
                }
                Err(_) => refused += 1,
            }
            let _ = core::hint::black_box(synchronised_velocity(&problems, &mut profiles, timing));
            let _ = core::hint::black_box(stop(&starts, &limits, &mut profiles));
            let _ = core::hint::black_box((position(&problems[0]), velocity(&problems[0])));
            let _ = core::hint::black_box(problems[0].track(0.001));
        });
        assert_eq!(count, 0, "{family:?} {problems:?} {timing:?}");
    }
    assert!(planned > 3000 && refused > 500, "{planned} {refused}");
}

/// Errors are plain data: they can be copied and compared, so they contain no string.
fn assert_plain<Data: Copy + Eq + 'static>(_: &Data) {}

#[test]
fn every_error_is_a_plain_enum_and_made_without_allocating() {
    let limits = Limits::symmetric(1.0, 2.0, 10.0);
    let good = Problem { start: State::rest(0.0), target: State::rest(1.0), limits };
    let moving = State { velocity: 0.9, ..State::rest(0.0) };
    let walled = Problem { start: moving, limits: limits.with_position(-1.0, 0.01), ..good };
    let walled = Problem { target: State::rest(-0.5), ..walled };
    let cases = [
        (
            Problem { target: State::rest(f64::NAN), ..good },
            PlanError::NotFinite { axis: 1, quantity: Quantity::TargetPosition },
        ),
        (
            Problem { limits: Limits { jerk_max: 0.0, ..limits }, ..good },
            PlanError::InvalidLimit { axis: 1, limit: Limit::JerkMax },
        ),
        (
            Problem { target: State { velocity: 2.0, ..good.target }, ..good },
            PlanError::TargetBeyondLimit { axis: 1, limit: Limit::VelocityMax },
        ),
        (walled, PlanError::PositionBeyondLimit { axis: 1, limit: Limit::PositionMax }),
        (Problem { start: moving, ..good }, PlanError::NotStraight { axis: 1 }),
        (Problem { target: State::rest(1e200), ..good }, PlanError::NotRepresentable { axis: 1 }),
    ];
    for (bad, expected) in cases {
        let straight = matches!(expected, PlanError::NotStraight { .. });
        let synchronisation = if straight { Synchronisation::Straight } else { Synchronisation::Time };
        let timing = PlanOptions { synchronisation, ..PlanOptions::default() };
        let (mut answer, mut profiles) = (Ok(0.0), [Profile::hold(0.0); 2]);
        let count = allocations(|| answer = synchronised(&[good, bad], &mut profiles, timing));
        assert_eq!((answer, count), (Err(expected), 0));
        assert_plain(&expected);
    }
    let mut profiles = [Profile::hold(0.0); 2];
    let mut answers = [Ok(0.0); 2];
    let count = allocations(|| {
        answers[0] = synchronised(&[good], &mut profiles, PlanOptions::default());
        let timing = PlanOptions { cycle_s: Some(0.0), ..PlanOptions::default() };
        answers[1] = synchronised(&[good, good], &mut profiles, timing);
    });
    let length = PlanError::LengthMismatch { expected: 1, received: 2 };
    assert_eq!((answers, count), ([Err(length), Err(PlanError::InvalidTiming)], 0));
}
