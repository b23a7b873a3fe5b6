//! The same calls of a handle in Rust, of the header in C, and of a client of a served controller, for `benches/instructions`: how many
//! instructions each takes on its way to the real-time thread and back; and a cycle of six simulated drives in virtual time.
//!
//! ```text
//! call_instructions WORK REPETITIONS
//! ```
#![allow(clippy::undocumented_unsafe_blocks, reason = "every pointer here is one of a local variable")]

use std::ffi::CString;
use std::hint::black_box;
use std::mem::MaybeUninit;
use std::ptr;

use takt::{Config, MoveOptions, StopCategory, VirtualController};
use takt_c::errors::takt_result::{self, TAKT_OK};
use takt_c::handles::takt_handle;
use takt_c::life::{takt_now_ns, takt_stop};
use takt_c::open::{takt_drives, takt_open, takt_options};
use takt_c::state::{takt_read_state, takt_state};
use takt_c::stream::{takt_push_at, takt_push_positions_at, takt_target};
use takt_remote::{Client, ServeOptions};

const AXES: usize = 6;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let work = arguments.next().unwrap_or_default();
    let repetitions: u64 = arguments.next().and_then(|count| count.parse().ok()).unwrap_or(1);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/arm6-erob.toml");
    let path = CString::new(path).unwrap_or_default();
    let options = takt_options { drives: takt_drives::TAKT_VIRTUAL as i32, ..takt_options::default() };
    let mut arm = takt_handle { number: 0 };
    assert_eq!(unsafe { takt_open(path.as_ptr(), &raw const options, &raw mut arm) }, TAKT_OK);
    let mut state = MaybeUninit::<takt_state>::zeroed();
    unsafe { (&raw mut (*state.as_mut_ptr()).size).write(size_of::<takt_state>() as u32) };
    let positions = [0.1; AXES];
    let targets = [takt_target { kind: 1, position: 0.1, ..unsafe { std::mem::zeroed() } }; AXES];
    if in_rust(&work, repetitions) || of_another_process(&work, repetitions) {
        std::process::exit(0);
    }
    let mut result = TAKT_OK;
    for stamp_ns in 0..repetitions {
        let called: takt_result = match work.as_str() {
            "read-state-6" => unsafe { takt_read_state(arm, state.as_mut_ptr()) },
            // No cycle takes them: there is room for 256.
            "push-positions-6" => unsafe { takt_push_positions_at(arm, stamp_ns, positions.as_ptr(), AXES) },
            "push-targets-6" => unsafe { takt_push_at(arm, stamp_ns, targets.as_ptr(), AXES) },
            "stop" => takt_stop(arm, 2),
            "now" => {
                assert!(takt_now_ns(arm) > 0);
                TAKT_OK
            }
            "wrong-handle" => unsafe { takt_read_state(takt_handle { number: 3 }, ptr::null_mut()) },
            _ => {
                eprintln!("call_instructions: there is no work {work:?}");
                std::process::exit(2);
            }
        };
        result = called;
    }
    assert!(repetitions > 0 && result != takt_result::TAKT_ERROR_DEFECT);
    // Without an end: the process is measured, and ends here.
    std::process::exit(0);
}

/// The work by a handle in Rust; `false` if it is none of that.
fn in_rust(work: &str, repetitions: u64) -> bool {
    if !work.starts_with("rust-") && !work.starts_with("simulate-") {
        return false;
    }
    let Some(arm) = simulated() else { return false };
    let positions = [0.1; AXES];
    match work {
        "rust-read-state-6" => (0..repetitions).for_each(|_| assert!(black_box(arm.state()).slot > 0)),
        // No cycle takes them: there is room for 256.
        "rust-push-positions-6" => (0..repetitions).for_each(|stamp_ns| {
            assert_eq!(arm.stream().push(stamp_ns, &positions), Ok(()));
        }),
        "rust-look-at-state-6" => (0..repetitions).for_each(|_| {
            arm.look_at_state(|shown| assert!(black_box(shown).slot > 0));
        }),
        "rust-stop" => (0..repetitions).for_each(|_| assert_eq!(arm.stop(StopCategory::Two), Ok(()))),
        "simulate-6" => assert_eq!(arm.step(repetitions), repetitions),
        "simulate-6-by-one" => (0..repetitions).for_each(|_| assert_eq!(arm.step(1), 1)),
        "simulate-6-streaming" => {
            let here: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
            assert!(arm.begin_stream().is_ok());
            for cycle in 0..repetitions {
                let offset = 0.05 * (cycle as f64 / 500.0).sin();
                let point: Vec<f64> = here.iter().map(|position| position + offset).collect();
                assert_eq!(arm.stream().push_now(&point), Ok(()));
                assert_eq!(arm.step(1), 1);
            }
        }
        "simulate-6-moving" => {
            let there: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set + 0.05).collect();
            // It takes longer than is counted.
            let options = MoveOptions { minimum_duration_s: 60.0, ..MoveOptions::default() };
            assert!(arm.move_with(&there, options).is_ok());
            assert_eq!(arm.step(repetitions), repetitions);
        }
        _ => return false,
    }
    true
}

fn simulated() -> Option<VirtualController> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/arm6-erob.toml");
    VirtualController::start(&Config::load(path.as_ref()).ok()?, None).ok()
}

/// The work by a client, with the threads that serve it: they are in this process, so that both are counted. The one that shows the state goes
/// by the time of the computer, so `benches/instructions` leaves it out. `false` if it is none of that.
fn of_another_process(work: &str, repetitions: u64) -> bool {
    let Some(work) = work.strip_prefix("served-") else { return false };
    let Some((arm, folder)) = simulated().zip(tempfile::tempdir().ok()) else { return false };
    let name = folder.path().join("arm").display().to_string();
    let Ok(_server) = takt_remote::serve(arm.handle(), &name, ServeOptions::default()) else { return false };
    let Ok(client) = takt_remote::connect(&name) else { return false };
    let repeat = |call: &dyn Fn(&Client, u64) -> bool| {
        (0..repetitions).for_each(|number| assert!(call(&client, number)));
    };
    match work {
        "read-state-6" => repeat(&|client, _| black_box(client.state()).slot > 0),
        "command" => repeat(&|client, _| client.take_lease().is_ok()),
        // No cycle takes them: there is room for 256.
        "push-positions-6" => repeat(&|client, at_ns| client.stream().push(at_ns, &[0.1; AXES]).is_ok()),
        "stop" => repeat(&|client, _| client.stop(StopCategory::Two).is_ok()),
        _ => return false,
    }
    // It is answered when all stops have been taken.
    assert!(client.take_lease().is_ok());
    true
}
