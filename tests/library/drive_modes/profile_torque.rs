//! Profile torque: within its limit, by the rated torque that the drive reports, and let go when the joint is too fast.

use takt::Outcome;
use takt::config::Config;
use takt::sim::cia402::{Cia402Drive, Cia402Parameters};
use takt::sim::{Drive, SimulatedBus, WireBitRates};
use takt_rt::{DriveState, Phase, ProfileMove, ProfileTarget, Request, RequestId, Rule, StopCategory};

use crate::drive_modes::wire::word;
use crate::drive_modes::world::{World, load};

/// One eRob that differs from what the configuration says of it.
fn erob_with(config: Config, change: impl Fn(&mut Cia402Parameters)) -> (Config, Vec<SimulatedBus>) {
    let mut parameters = takt::family::cia402::simulated_parameters(&config.axes[0], &config);
    change(&mut parameters);
    let drive: Box<dyn Drive> = Box::new(Cia402Drive::new(parameters).unwrap());
    let rates = WireBitRates { nominal: 1_000_000, data: None };
    let bus = SimulatedBus::with_drives(rates, config.simulation.longest_gap_ns, vec![drive]);
    (config, vec![bus])
}

fn last_torque(world: &mut World) -> i16 {
    word(&world.port(0).sent_with(0x201).last().unwrap().1[2..4]) as i16
}

#[test]
fn torque_is_converted_by_the_rated_torque_that_the_drive_reports() {
    let config = load("erob-modes/erob-pt.toml");
    let configured = config.axes[0].rated_torque();
    let (config, buses) = erob_with(config, |parameters| parameters.axes[0].rated_torque = 2.0 * configured);
    let mut world = World::holding_on(config, buses);
    world.drive_to(0, ProfileTarget::Torque(2.0));
    // The drive has a ramp of its own to the torque.
    world.run_for(60);
    assert_eq!(last_torque(&mut world), (1000.0 * 2.0 / (2.0 * configured)).round() as i16);
    let seen = world.observe(0).torque;
    assert!((seen - 2.0).abs() < 0.05, "{seen} N·m for 2 N·m");
}

#[test]
fn a_torque_beyond_the_limit_is_refused_and_nothing_is_pushed() {
    let mut world = World::holding(load("erob-modes/erob-pt.toml"));
    let limit = world.config.axes[0].limits.torque;
    for (count, target) in (1..).zip([
        ProfileTarget::Torque(1.001 * limit),
        ProfileTarget::Torque(-1.001 * limit),
        ProfileTarget::Torque(f64::NAN),
        ProfileTarget::Velocity(0.1),
        ProfileTarget::Position(0.1),
    ]) {
        let wanted = ProfileMove { axis: 0, target, valid_until_ns: u64::MAX };
        world.request(Request::SetProfileTarget(wanted));
        world.run_for(3);
        assert_eq!((world.run.snapshot().rejected, last_torque(&mut world)), (count, 0), "{target:?}");
    }
}

#[test]
fn a_joint_that_gets_too_fast_is_let_go_and_braked() {
    let mut world = World::holding(load("erob-modes/erob-pt.toml"));
    let limit = world.config.axes[0].limits.velocity;
    world.drive_to(0, ProfileTarget::Torque(3.0));
    let mut fastest = 0.0_f64;
    let outcome = world.run_to_the_end(|world| fastest = fastest.max(world.observe(0).velocity));
    let Outcome::Stopped(stop) = outcome else { panic!("{outcome:?}") };
    assert_eq!(
        (stop.rule(), stop.axis(), stop.category),
        (Rule::MeasuredVelocity, Some(0), StopCategory::One)
    );
    assert!(fastest < 1.3 * limit, "{fastest}");
    assert_eq!(world.stops().len(), 1);
    let seen = world.observe(0);
    assert!(seen.is_braked && seen.velocity == 0.0, "{seen:?}");
}

/// Torque 0, which is the manual's stop, would let the joint coast.
#[test]
fn a_stop_in_motion_decelerates_the_joint_by_the_drives_quick_stop_and_then_brakes_it() {
    let mut world = World::holding(load("erob-modes/erob-pt.toml"));
    let limits = world.config.axes[0].limits;
    world.drive_to(0, ProfileTarget::Torque(1.5));
    world.run_for(500);
    let speed = world.observe(0).velocity;
    assert!(speed > 0.1 * limits.velocity, "{speed}");
    world.request(Request::Stop(StopCategory::One));
    let (mut cycles, mut last, mut states) = (0, speed, vec![]);
    while world.phase() != Phase::Disabled {
        world.run_for(1);
        cycles += 1;
        let seen = world.observe(0);
        assert!(!seen.is_braked || seen.velocity.abs() < 0.1 * limits.velocity, "{seen:?}");
        // The request is on its way for some cycles.
        assert!(cycles < 10 || seen.velocity <= last + 1e-9, "{cycles}: {seen:?} after {last}");
        last = seen.velocity;
        if states.last() != Some(&seen.state) {
            states.push(seen.state);
        }
    }
    assert!(states.contains(&DriveState::QuickStopActive), "{states:?}");
    let needed_ms = 1000.0 * speed / limits.deceleration;
    assert!(f64::from(cycles) < 1.1 * needed_ms + 20.0, "{cycles} ms, {needed_ms} ms at the limit");
    world.run_for(5);
    let seen = world.observe(0);
    assert!(seen.is_braked && seen.velocity == 0.0 && !seen.state.has_torque(), "{seen:?}");
    assert!(world.outcome().is_none() && world.stops().len() == 1, "{:?}", world.stops());
}

/// Its drive closes no loop that would hold the joint.
#[test]
fn a_stop_of_category_2_in_motion_becomes_one_of_category_1() {
    let mut world = World::holding(load("erob-modes/erob-pt.toml"));
    world.drive_to(0, ProfileTarget::Torque(1.5));
    world.run_for(500);
    assert_eq!(world.phase(), Phase::Moving);
    world.request(Request::Stop(StopCategory::Two));
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.run_for(5);
    assert_eq!(world.stops()[0].category, StopCategory::One);
    assert!(world.observe(0).is_braked);
}

/// A joint that hardly anything slows: at 20 deg/s it coasts for radians.
fn without_friction() -> World {
    let (config, buses) = erob_with(load("erob-modes/erob-pt.toml"), |parameters| {
        parameters.axes[0].joint.viscous_friction = 0.01;
        parameters.axes[0].joint.coulomb_friction = 0.02;
    });
    World::holding_on(config, buses)
}

/// Pushes the joint up to a speed and lets it go.
fn let_go_at(world: &mut World, speed: f64) -> RequestId {
    world.drive_to(0, ProfileTarget::Torque(1.0));
    world.run_until(|world| world.observe(0).velocity > speed);
    world.drive_to(0, ProfileTarget::Torque(0.0))
}

#[test]
fn a_move_that_ends_with_no_torque_is_over_when_the_joint_stands() {
    let mut world = World::holding(load("erob-modes/erob-pt.toml"));
    let motion = let_go_at(&mut world, 0.3);
    let standing = 0.02 * world.config.axes[0].limits.velocity;
    world.run_until(|world| world.is_reached(motion));
    // It was reported a cycle or two before.
    assert!(world.observe(0).velocity.abs() < 1.1 * standing, "{:?}", world.observe(0));
    world.run_for(1);
    assert_eq!((world.phase(), world.stops()), (Phase::Holding, vec![]));
}

#[test]
fn a_joint_that_is_let_go_and_coasts_is_stopped_before_its_position_limit() {
    let mut world = without_friction();
    let limit = world.config.axes[0].limits.position_max;
    let_go_at(&mut world, 0.8);
    let outcome = world.run_to_the_end(|_| ());
    let Outcome::Stopped(stop) = outcome else { panic!("{outcome:?}") };
    assert_eq!((stop.rule(), stop.axis(), stop.category), (Rule::PositionLimit, Some(0), StopCategory::One));
    let seen = world.observe(0);
    assert!(seen.is_braked && seen.velocity == 0.0, "{seen:?}");
    assert!((0.9 * limit..limit).contains(&seen.position), "{seen:?}, the limit is {limit}");
    assert_eq!(world.stops().len(), 1);
}

/// The brake is made to hold a joint, not to stop one.
#[test]
fn a_joint_that_a_load_pulls_away_while_the_group_holds_is_slowed_by_the_drive_before_it_is_braked() {
    let asked = [Some(Request::Disable), Some(Request::Stop(StopCategory::One)), None];
    for asked in asked {
        let mut world = without_friction();
        world.port(0).bus.set_load_torque(1, 0.5).unwrap();
        world.run_until(|world| world.observe(0).velocity > 0.8);
        assert_eq!(world.phase(), Phase::Holding);
        if let Some(request) = asked {
            world.request(request);
        }
        let mut is_slowed = false;
        while world.phase() != Phase::Disabled {
            world.run_for(1);
            let seen = world.observe(0);
            is_slowed |= seen.state == DriveState::QuickStopActive;
            assert!(!seen.is_braked || seen.velocity.abs() < 0.15, "{asked:?}: {seen:?}");
        }
        assert!(is_slowed, "{asked:?}");
        world.run_for(20);
        let seen = world.observe(0);
        assert!(seen.is_braked && seen.velocity == 0.0, "{asked:?}: {seen:?}");
        assert!(seen.position < world.config.axes[0].limits.position_max, "{asked:?}: {seen:?}");
        assert_eq!(world.stops().len(), 1, "{asked:?}: {:?}", world.stops());
    }
}

#[test]
fn firmware_without_interpolated_position_is_named() {
    let config = load("erob-modes/erob-ip.toml");
    let (config, buses) = erob_with(config, |parameters| parameters.quirks.undeclared_modes.clear());
    let mut world = World::on(config, buses);
    let outcome = world.run_to_the_end(|_| ());
    let Outcome::BringUpFailed(error) = outcome else { panic!("{outcome:?}") };
    let text = error.to_string();
    for part in ["firmware", "6061:00 (modes of operation display): expected 7", "6502", "mode = \"csp\""] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
}
