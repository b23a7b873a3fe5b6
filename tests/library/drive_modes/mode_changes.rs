//! Changes of the mode of operation at run time on a simulated eRob, which must be disabled for each.

use takt::Outcome;
use takt_rt::OperationMode::{
    CyclicSynchronousPosition as CSP, CyclicSynchronousTorque as CST, CyclicSynchronousVelocity as CSV,
};
use takt_rt::{
    Answer, AxisPoint, Fault, Frame, MAX_AXES, ModeChange, MotionState, Move, OperationMode, Phase,
    PointRole, RejectReason, Request, RequestId, StopCategory, StopCause, StreamPoint,
};

use crate::drive_modes::wire::{counts_per_unit, id};
use crate::drive_modes::world::{World, load};

const PERIOD_S: f64 = 1e-3;

fn holding() -> World {
    World::holding(load("erob-modes/erob-changing.toml"))
}

fn to(mode: OperationMode) -> Request {
    Request::ChangeMode(ModeChange { modes: [Some(mode); MAX_AXES] })
}

fn move_to(world: &mut World, target: f64) {
    let request = world.request(Request::Move(Move {
        target: [target; MAX_AXES],
        target_velocity: [0.0; MAX_AXES],
        velocity_scale: 1.0,
        acceleration_scale: 1.0,
        minimum_duration_s: 0.0,
    }));
    world.run_until(|world| world.run.snapshot().motions.of(request) == Some(MotionState::Finished));
    world.run_for(500);
}

fn disable(world: &mut World) {
    world.request(Request::Disable);
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.run_for(20);
}

fn enable(world: &mut World) {
    world.request(Request::Enable);
    world.run_until(|world| world.phase() == Phase::Holding);
}

/// Changes the mode of a disabled drive. The cycles that it takes.
fn change(world: &mut World, mode: OperationMode) -> usize {
    let request = world.request(to(mode));
    for cycles in 1..100 {
        if world.run.snapshot().motions.of(request) == Some(MotionState::Finished) {
            return cycles;
        }
        world.run_for(1);
    }
    panic!("{:?}", world.run.snapshot().motions.of(request));
}

fn stream(world: &mut World, point: AxisPoint, cycles: usize) {
    for cycle in 0..cycles {
        if cycle % 10 == 0 {
            let (at_ns, axes) = (world.run.snapshot().at_ns, [point; MAX_AXES]);
            let point = StreamPoint { at_ns, role: PointRole::Single, axes };
            world.run.host().streamer().push(&[point]).unwrap();
        }
        world.run_for(1);
    }
}

fn refusal(world: &mut World, request: Request) -> Option<RejectReason> {
    let request: RequestId = world.request(request);
    match world.run.snapshot().answers.of(request) {
        Answer::Rejected(rejected) => Some(rejected.unwrap().reason),
        _ => None,
    }
}

#[test]
fn positions_velocities_and_a_soft_spring_follow_each_other_on_one_drive_under_load() {
    let mut world = holding();
    move_to(&mut world, 0.6);
    let limits = world.config.axes[0].limits;
    for (mode, point) in [
        (CSV, AxisPoint::Velocity(0.3)),
        (CST, AxisPoint::position(0.8).with_impedance(100.0, 20.0).with_torque(4.0)),
        (CSP, AxisPoint::position(0.5)),
        (CST, AxisPoint::Torque(3.0)),
        (CSV, AxisPoint::Velocity(-0.2)),
        (CSP, AxisPoint::position(0.1)),
    ] {
        disable(&mut world);
        let braked = world.observe(0);
        let cycles = change(&mut world, mode);
        assert!(cycles < 10, "{mode:?} after {cycles}");
        let changed = world.observe(0);
        assert_eq!((changed.operation_mode, changed.is_braked), (mode as i8, true));
        assert!((changed.position - braked.position).abs() < 1e-6, "{mode:?} {braked:?} {changed:?}");
        let axis = world.run.snapshot().axes[0];
        assert_eq!((axis.mode, axis.mode_set), (Some(mode as i8), mode as i8));

        enable(&mut world);
        world.run_for(300);
        // In CST nothing makes up for the load: 6 N·m at a stiffness of 1600 N·m/rad, and friction.
        let sag = (world.observe(0).position - changed.position).abs();
        assert!(sag < if mode == CST { 5e-3 } else { 1e-3 }, "{mode:?} {sag}");

        world.request(Request::Stream);
        let mut velocities = vec![world.run.snapshot().axes[0].velocity_set];
        for _ in 0..100 {
            stream(&mut world, point, 5);
            velocities.push(world.run.snapshot().axes[0].velocity_set);
        }
        for pair in velocities.windows(2) {
            let acceleration = (pair[1] - pair[0]) / (5.0 * PERIOD_S);
            assert!(acceleration.abs() <= 1.01 * limits.acceleration, "{mode:?} {acceleration}");
        }
        assert_eq!((world.stops(), world.phase()), (vec![], Phase::Streaming), "{mode:?}");
        world.request(Request::Stop(StopCategory::Two));
        world.run_until(|world| world.phase() == Phase::Holding);
        // A joint that has not come to rest yet would be stopped once more, to be disabled.
        world.run_for(300);
        world.events.clear();
    }
    move_to(&mut world, 0.0);
    assert!(world.observe(0).position.abs() < 2e-3);
}

#[test]
fn object_6060_and_the_target_of_every_mode_are_sent_in_every_cycle_and_those_of_other_modes_are_at_rest() {
    let mut world = holding();
    move_to(&mut world, 0.4);
    disable(&mut world);
    change(&mut world, CSV);
    enable(&mut world);
    let since_ns = world.run.snapshot().at_ns;
    move_to(&mut world, -0.3);
    let counts_per_rad = counts_per_unit(&world.config.axes[0]);
    let joint = (world.observe(0).position * counts_per_rad).round() as i32;
    let first = world.port(0).sent_with(id(0x200, 1));
    let second = world.port(0).sent_with(id(0x300, 1));
    let since = |sent: Vec<(u64, Vec<u8>)>| -> Vec<Vec<u8>> {
        sent.into_iter().filter(|(at_ns, _)| *at_ns > since_ns).map(|(_, payload)| payload).collect()
    };
    let (first, second) = (since(first), since(second));
    assert!(first.len() > 500 && first.len() == second.len(), "{} {}", first.len(), second.len());
    // RPDO 1: 6040, 607A, 6060. RPDO 2: 60FF, 6071.
    assert!(first.iter().all(|payload| payload.len() == 7 && payload[6] == CSV as u8));
    assert!(second.iter().all(|payload| payload.len() == 6 && payload[4..] == [0, 0]));
    assert!(second.iter().any(|payload| payload[..4] != [0; 4]));
    let last = first.last().unwrap();
    let position = i32::from_le_bytes([last[2], last[3], last[4], last[5]]);
    assert!((position - joint).abs() < 100, "{position} {joint}");
}

#[test]
fn an_enabled_erob_keeps_its_mode() {
    let mut world = holding();
    assert_eq!(refusal(&mut world, to(CSV)), Some(RejectReason::NotDisabled));
    world.run_for(50);
    assert_eq!((world.observe(0).operation_mode, world.stops()), (CSP as i8, vec![]));
}

#[test]
fn a_drive_that_does_not_show_its_new_mode_in_time_is_a_fault_and_is_told_its_former_one() {
    let mut world = holding();
    disable(&mut world);
    // It seems to show CSP whatever it is told: object 6061 is behind the statusword and the position.
    let tpdo = id(0x180, 1);
    world.port(0).alter = Some(Box::new(move |frame: Frame| match frame.payload() {
        [before @ .., _] if frame.id().value() == tpdo && before.len() == 6 => {
            Frame::data(frame.id(), &[before, &[CSP as u8]].concat()).unwrap()
        }
        _ => frame,
    }));
    let request = world.request(to(CST));
    world.run_for(50);
    assert_eq!(refusal(&mut world, Request::Enable), Some(RejectReason::ModeChanging));
    while world.step() {}
    let Some(Outcome::Stopped(reason)) = world.outcome() else { panic!("{:?}", world.outcome()) };
    let fault = StopCause::Fault(Fault::ModeNotShown { shown: CSP as i8, expected: CST });
    assert_eq!((reason.cause, reason.axis(), reason.phase), (fault, Some(0), Phase::Disabled));
    assert_eq!(world.run.snapshot().motions.of(request), Some(MotionState::Stopped(reason)));
    let told: Vec<u8> = world.port(0).sent_with(id(0x200, 1)).iter().map(|(_, payload)| payload[6]).collect();
    // For half a second.
    let in_vain = told.iter().filter(|mode| **mode == CST as u8).count();
    assert!((500..=502).contains(&in_vain), "{in_vain}");
    assert_eq!(told.last(), Some(&(CSP as u8)));
}

#[test]
fn a_change_that_comes_by_pdo_while_the_drive_has_torque_waits_until_the_torque_is_gone() {
    let mut world = holding();
    let mode = |world: &mut World| world.observe(0).operation_mode;
    // As a master that ignores the manual.
    let frame = |world: &mut World| {
        let sent = world.port(0).sent_with(id(0x200, 1));
        let (_, mut payload) = sent.last().unwrap().clone();
        payload[6] = CSV as u8;
        Frame::data(takt_rt::Id::canopen(0x200, 1), &payload).unwrap()
    };
    for _ in 0..20 {
        let told = frame(&mut world);
        let now_ns = world.run.snapshot().at_ns;
        takt_rt::BusPort::send(&mut world.port(0).bus, now_ns, &[told]);
        world.run_for(1);
        assert_eq!(mode(&mut world), CSP as i8);
    }
    assert_eq!(world.stops(), vec![]);
}
