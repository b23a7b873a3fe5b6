//! From a call of the header to the wire, in cycles: counted in virtual time, where nothing else is late.
#![allow(clippy::undocumented_unsafe_blocks, reason = "every pointer here is one of a local variable")]

use std::ffi::{CString, c_void};
use std::mem::MaybeUninit;
use std::ptr;

use takt_c::callback::{takt_begin_callback, takt_callback_cycle};
use takt_c::errors::takt_result::{TAKT_ERROR_HANDLE, TAKT_OK};
use takt_c::handles::{takt_callback, takt_handle};
use takt_c::life::{takt_advance, takt_close, takt_now_ns, takt_stop, takt_wait_phase};
use takt_c::motion::takt_move_to;
use takt_c::open::{takt_drives, takt_open, takt_options};
use takt_c::state::{takt_axis_state, takt_phase, takt_read_state, takt_state};
use takt_c::stream::{takt_begin_stream, takt_push_positions_at, takt_target};

const PATIENCE_S: f64 = 30.0;

fn open() -> takt_handle {
    let path = CString::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/first.toml")).unwrap();
    let options = takt_options { drives: takt_drives::TAKT_VIRTUAL as i32, ..takt_options::default() };
    let mut arm = takt_handle { number: 0 };
    assert_eq!(unsafe { takt_open(path.as_ptr(), &raw const options, &raw mut arm) }, TAKT_OK);
    arm
}

fn state(arm: takt_handle) -> takt_state {
    let mut state = MaybeUninit::<takt_state>::zeroed();
    unsafe { (&raw mut (*state.as_mut_ptr()).size).write(size_of::<takt_state>() as u32) };
    assert_eq!(unsafe { takt_read_state(arm, state.as_mut_ptr()) }, TAKT_OK);
    // Every number of it has been written.
    unsafe { state.assume_init() }
}

/// Runs cycles until the set-point that is sent is another one than it would be, and counts them.
fn cycles_until(arm: takt_handle, is_there: impl Fn(&takt_state) -> bool) -> u32 {
    for cycle in 1..1_000 {
        assert_eq!(unsafe { takt_advance(arm, 1, ptr::null_mut()) }, TAKT_OK);
        if is_there(&state(arm)) {
            return cycle;
        }
    }
    panic!("nothing has come of it within 1000 cycles")
}

fn begin_move(arm: takt_handle, to: f64) {
    assert_eq!(unsafe { takt_move_to(arm, &raw const to, 1, ptr::null(), ptr::null_mut()) }, TAKT_OK);
}

fn is_moving(state: &takt_state) -> bool {
    state.axes[0].velocity_set != 0.0
}

#[test]
fn a_move_and_a_stop_are_on_the_wire_in_the_next_cycle() {
    let arm = open();
    begin_move(arm, 0.5);
    assert_eq!(cycles_until(arm, is_moving), 1);
    assert_eq!(unsafe { takt_advance(arm, 400, ptr::null_mut()) }, TAKT_OK);
    assert_eq!(takt_stop(arm, 2), TAKT_OK);
    let stopping = takt_phase::TAKT_PHASE_STOPPING as i32;
    assert_eq!(cycles_until(arm, |state| state.groups[0].phase == stopping), 1);
    assert_eq!(takt_close(arm), TAKT_OK);
}

/// Turns at a tenth of a radian a second.
unsafe extern "C" fn turns(
    _: *mut c_void,
    _: *const takt_callback_cycle,
    _: *const takt_axis_state,
    targets: *mut takt_target,
    _: usize,
) -> i32 {
    unsafe {
        (*targets).kind = 2;
        (*targets).velocity = 0.1;
    }
    0
}

#[test]
fn a_callback_is_on_the_wire_in_the_cycle_that_grants_it() {
    let arm = open();
    let (slot, mut callback) = (state(arm).slot, takt_callback { number: 0 });
    let begun =
        unsafe { takt_begin_callback(arm, Some(turns), ptr::null_mut(), ptr::null(), &raw mut callback) };
    assert_eq!(begun, TAKT_OK);
    assert_eq!(state(arm).slot, slot + 1);
    assert!(is_moving(&state(arm)));
    assert_eq!(takt_close(arm), TAKT_OK);
}

#[test]
fn a_point_is_on_the_wire_in_the_next_cycle_ahead_of_the_lag_that_the_state_shows() {
    let arm = open();
    assert_eq!(takt_begin_stream(arm), TAKT_OK);
    let push = |position: f64, at_ns: u64| {
        assert_eq!(unsafe { takt_push_positions_at(arm, at_ns, &raw const position, 1) }, TAKT_OK);
    };
    let here = state(arm).axes[0].position_set;
    for _ in 0..500 {
        push(here, takt_now_ns(arm));
        assert_eq!(unsafe { takt_advance(arm, 1, ptr::null_mut()) }, TAKT_OK);
    }
    let lag_cycles = state(arm).groups[0].stream_lag_ns.div_ceil(1_000_000) as u32;
    push(here + 0.001, takt_now_ns(arm));
    let taken = cycles_until(arm, |state| state.axes[0].position_set != here);
    assert!(taken <= lag_cycles + 1, "{taken} cycles, at a lag of {lag_cycles}");
    assert_eq!(takt_stop(arm, 2), TAKT_OK);
    assert_eq!(takt_wait_phase(arm, takt_phase::TAKT_PHASE_HOLDING as i32, PATIENCE_S), TAKT_OK);
    assert_eq!((takt_close(arm), takt_close(arm)), (TAKT_OK, TAKT_ERROR_HANDLE));
}
