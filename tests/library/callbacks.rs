//! A function of the owner that is called in each cycle, in virtual time.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use takt::channels::{CallbackRecord, GivenCallback};
use takt::controller::AfterBringUp;
use takt::rt::{AxisLimits, CallbackId, CallbackRun, MotionState};
use takt::sim::SimulatedBus;
use takt::{
    CallbackCommand, CallbackCycle, CallbackOptions, CallbackState, CommandError, Config, MotionError,
    Outcome, Phase, RejectReason, RequestId, Rule, StopCategory, VirtualController, VirtualRun,
};

const PATIENCE: Duration = Duration::from_secs(30);

fn config(name: &str) -> Config {
    Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)).unwrap()
}

fn start(name: &str) -> VirtualController {
    VirtualController::start(&config(name), None).unwrap()
}

/// Sets its flag when it is freed.
struct Freed(Arc<AtomicBool>);

impl Freed {
    fn new() -> (Self, Arc<AtomicBool>) {
        let is_freed = Arc::<AtomicBool>::default();
        (Self(Arc::clone(&is_freed)), is_freed)
    }
}

impl Drop for Freed {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_panic_is_a_stop_whose_message_the_owner_gets_and_the_function_is_not_called_again() {
    let joint = start("single-erob.toml");
    let (held, is_freed) = Freed::new();
    let calls = Arc::new(AtomicU64::new(0));
    let counting = Arc::clone(&calls);
    let callback = joint.in_loop(move |_, _, command| {
        let _held = &held;
        if counting.fetch_add(1, Ordering::Relaxed) == 99 {
            panic!("no solution for pose {}", 7);
        }
        command.position(0, 0.3);
    });
    let error = callback.unwrap().wait(PATIENCE).unwrap_err();
    let MotionError::CallbackPanicked { message, stopped } = &error else { panic!("{error}") };
    assert!(message.starts_with("no solution for pose 7, at tests/library/callbacks.rs:"), "{message}");
    assert_eq!(stopped.reason.category, StopCategory::Two);
    assert!(error.to_string().contains("no solution for pose 7"), "{error}");
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    assert_eq!(calls.load(Ordering::Relaxed), 100);
    assert!(is_freed.load(Ordering::Relaxed), "it has been freed");
    // A defect of the function is none of the run: after a reset everything is possible again.
    assert!(matches!(joint.in_loop(|_, _, _| {}), Err(CommandError::Refused(_))));
    joint.reset_faults().unwrap();
    let again = joint.in_loop(|_, _, command| command.finish()).unwrap();
    assert_eq!(again.wait(PATIENCE), Ok(()));
    assert_eq!(joint.finish(), Outcome::Finished);
}

#[test]
fn an_axis_that_the_group_does_not_have_is_a_panic_that_names_it() {
    let joint = start("single-erob.toml");
    let callback = joint.in_loop(|state, _, command| command.position(1, state[0].position));
    let error = callback.unwrap().wait(PATIENCE).unwrap_err();
    assert!(error.to_string().contains("the group has no axis 1: it has 1"), "{error}");
}

#[test]
fn what_cannot_be_run_is_refused_and_the_function_is_freed() {
    let joint = start("single-erob.toml");
    let holding = || {
        let (held, is_freed) = Freed::new();
        let body = move |_: &CallbackState<'_>, _: &CallbackCycle, _: &mut CallbackCommand<'_>| {
            let _held = &held;
        };
        (body, is_freed)
    };
    for budget in [Duration::ZERO, Duration::from_micros(251), Duration::MAX] {
        let options = CallbackOptions { budget: Some(budget), ..CallbackOptions::default() };
        let longest = Duration::from_micros(250);
        let (body, is_freed) = holding();
        let refused = joint.in_loop_with(options, body).err();
        assert_eq!(refused, Some(CommandError::Budget { budget, longest }));
        assert!(is_freed.load(Ordering::Relaxed));
    }
    joint.disable().unwrap();
    joint.wait_for(Phase::Disabled, PATIENCE).unwrap();
    for _ in 0..40 {
        let (body, is_freed) = holding();
        let Err(CommandError::Refused(refused)) = joint.in_loop(body) else { panic!("it is disabled") };
        assert_eq!(refused.refusal.map(|refusal| refusal.reason), Some(RejectReason::Phase));
        assert!(is_freed.load(Ordering::Relaxed));
    }
}

#[test]
fn moves_stops_and_other_functions_take_the_place_of_one_and_a_dropped_handle_does_not() {
    let joint = start("single-erob.toml");
    let home = joint.state().axes[0].position_set;
    let to = |offset: f64| {
        move |_: &CallbackState<'_>, _: &CallbackCycle, command: &mut CallbackCommand<'_>| {
            command.position(0, home + offset);
        }
    };
    let first = joint.in_loop(to(0.3)).unwrap();
    let first_motion = first.motion();
    drop(first);
    joint.pass(Duration::from_millis(100));
    assert_eq!((joint.state().groups[0].phase, joint.result_of(first_motion)), (Phase::Streaming, None));
    let second = joint.in_loop(to(-0.2)).unwrap();
    assert_eq!(joint.result_of(first_motion), Some(Err(MotionError::Replaced)));
    joint.pass(Duration::from_millis(100));
    let motion = joint.move_to(&[home + 0.1]).unwrap();
    assert_eq!(joint.wait(motion, PATIENCE), Ok(()));
    assert_eq!(second.wait(PATIENCE), Err(MotionError::Replaced));
    let third = joint.in_loop(to(0.0)).unwrap();
    joint.stop(StopCategory::Two).unwrap();
    assert!(matches!(third.wait(PATIENCE), Err(MotionError::Stopped(_))));
    assert_eq!(joint.wait_for(Phase::Holding, PATIENCE), Ok(()));
    joint.in_loop(to(0.0)).unwrap();
    assert_eq!(joint.finish(), Outcome::Finished, "it ends with the run");
}

#[test]
fn each_group_is_led_by_a_function_of_its_own() {
    let controller = start("arm-and-gripper.toml");
    let arm = controller.group("arm").unwrap();
    let refused = controller.in_loop(|_, _, _| {}).err();
    let Some(CommandError::Refused(refused)) = refused else { panic!("{refused:?}") };
    assert!(matches!(refused.refusal.unwrap().reason, RejectReason::GroupNotNamed { groups: 2 }));
    let home: Vec<f64> =
        arm.axis_numbers().iter().map(|axis| controller.state().axes[*axis].position_set).collect();
    let target = home.clone();
    let mut calls = 0;
    let leading = arm.in_loop(move |state, _, command| {
        assert_eq!(state.axes().len(), target.len());
        calls += 1;
        target.iter().enumerate().for_each(|(axis, home)| command.position(axis, home + 0.05));
        if calls == 1_500 {
            command.finish();
        }
    });
    // The gripper is in profile torque: a function can watch it, and it keeps what it was given.
    let gripper = controller.group("gripper").unwrap();
    let watching = gripper.in_loop(|state, _, _| assert_eq!(state.axes().len(), 1)).unwrap();
    assert_eq!((arm.group_state().phase, gripper.group_state().phase), (Phase::Streaming, Phase::Streaming));
    assert_eq!(leading.unwrap().wait(PATIENCE), Ok(()));
    for (axis, home) in arm.axis_numbers().iter().zip(&home) {
        let set = controller.state().axes[*axis].position_set;
        assert!((set - home - 0.05).abs() < 1e-3, "{set} from {home}");
    }
    assert_eq!((gripper.group_state().phase, watching.result()), (Phase::Streaming, None));
}

/// The budget of the calls in virtual time.
const BUDGET_NS: u64 = 50_000;

const RUN: CallbackRun =
    CallbackRun { callback: CallbackId(0), budget_ns: BUDGET_NS, overruns_allowed: 0, follow: None };

/// A joint that holds, in virtual time.
fn holding() -> VirtualRun<SimulatedBus> {
    let config = config("single-erob.toml");
    let ports = vec![takt::simulated_bus(&config, 0)];
    let mut run = VirtualRun::serving(&config, ports, AfterBringUp::Enable).unwrap().0;
    while run.snapshot().groups[0].phase != Phase::Holding {
        assert!(run.step());
    }
    run
}

fn lead(
    run: &mut VirtualRun<SimulatedBus>,
    body: impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send + 'static,
) -> (RequestId, Arc<CallbackRecord>) {
    let limits: AxisLimits = config("single-erob.toml").axes[0].limits;
    let given = GivenCallback::new(0, &[(0, limits)], Box::new(body));
    let record = given.record();
    (run.host().run_callback(given, RUN).unwrap(), record)
}

#[test]
fn in_virtual_time_a_call_takes_no_time_unless_it_is_said_how_long() {
    let mut run = holding();
    let (motion, record) = lead(&mut run, |_, cycle, command| {
        assert_eq!((cycle.time_left_ns, cycle.missed_slots), (BUDGET_NS, 0));
        command.position(0, 0.2);
    });
    (0..500).for_each(|_| assert!(run.step()));
    assert_eq!((run.snapshot().groups[0].phase, record.times().longest), (Phase::Streaming, Duration::ZERO));
    run.take_for_callbacks(BUDGET_NS);
    (0..50).for_each(|_| assert!(run.step()));
    assert_eq!(run.snapshot().groups[0].phase, Phase::Streaming);
    run.take_for_callbacks(BUDGET_NS + 1);
    (0..2).for_each(|_| assert!(run.step()));
    let stop = run.snapshot().groups[0].stop.unwrap();
    assert_eq!(stop.rule(), Rule::CallbackOverrun);
    assert_eq!(run.snapshot().motions.of(motion), Some(MotionState::Stopped(stop)));
    assert!(record.is_over());
    let times = record.times();
    assert_eq!((times.overruns, times.longest), (1, Duration::from_nanos(BUDGET_NS + 1)));
}

#[test]
fn the_same_function_gives_the_same_motion_in_every_virtual_run() {
    let motion = || {
        let mut run = holding();
        let mut phase = 0.0_f64;
        lead(&mut run, move |state, cycle, command| {
            phase += 2.0 * cycle.dt_s;
            command.position(0, 0.1 * phase.sin() + 0.001 * state[0].position);
        });
        let positions = (0..1_000).map(|_| {
            assert!(run.step());
            run.snapshot().axes[0].position_set.to_bits()
        });
        positions.collect::<Vec<_>>()
    };
    let first = motion();
    assert_eq!(first, motion());
    assert_ne!(first[0], first[999]);
}

#[test]
fn a_request_that_finds_no_room_gives_the_function_back() {
    let mut run = holding();
    let mut freed = vec![];
    let mut refused = 0;
    for _ in 0..64 {
        let (held, is_freed) = Freed::new();
        freed.push(is_freed);
        let limits: AxisLimits = config("single-erob.toml").axes[0].limits;
        let given = GivenCallback::new(0, &[(0, limits)], Box::new(move |_, _, _| _ = &held));
        refused += usize::from(run.host().run_callback(given, RUN).is_err());
    }
    let count = || freed.iter().filter(|is_freed| is_freed.load(Ordering::Relaxed)).count();
    assert!(refused > 0 && count() == refused, "{} of {refused}", count());
    (0..50).for_each(|_| assert!(run.step()));
    assert_eq!(count(), 63, "only the last one leads the joint");
}
