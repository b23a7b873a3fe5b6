//! The controller falls silent in motion and comes back, as a process that was stopped and continued.

use takt::Outcome;
use takt::config::Config;
use takt::family;
use takt_rt::{BusPort, DriveState, Phase, Rule};

use crate::drive_modes::one_yz_aim::one_yz_aim;
use crate::drive_modes::wire::{MILLISECOND_NS, counts_per_unit, id, word};
use crate::drive_modes::world::{World, load, parse};

const SILENCE_NS: u64 = 3_000 * MILLISECOND_NS;
const COMMUNICATION_LOST: u16 = 0x20;
/// What a joint may move without anybody wanting it, in counts: the settling of its loops.
const TOLERANCE_COUNTS: f64 = 20.0;

/// Runs into a move, and lets the controller be away.
fn away(mut config: Config, after_cycles: usize) -> World {
    config.simulation.longest_gap_ns = 10 * SILENCE_NS;
    let mut world = World::new(config);
    world.run_until(|world| world.phase() == Phase::Moving);
    world.run_for(after_cycles);
    world.run.clock().stall(SILENCE_NS);
    world
}

/// Lets the world go on to just before the controller returns, and says where the joints are then.
fn positions_before_return(world: &mut World) -> Vec<f64> {
    let until_ns = world.run.snapshot().at_ns + SILENCE_NS - 5 * MILLISECOND_NS;
    for port in world.run.ports() {
        port.unconfirmed(until_ns);
    }
    (0..world.config.axes.len()).map(|axis| world.observe(axis).position).collect()
}

/// How far the joints move from now to the end of the run, at the most, in counts.
fn largest_way_to_the_end(world: &mut World, from: &[f64]) -> f64 {
    let mut largest = 0.0_f64;
    let outcome = world.run_to_the_end(|world| {
        for (axis, from) in from.iter().enumerate() {
            let way = (world.observe(axis).position - from) * counts_per_unit(&world.config.axes[axis]);
            largest = largest.max(way.abs());
        }
    });
    assert!(matches!(outcome, Outcome::Stopped(_)), "{outcome:?}");
    largest
}

/// A YZ-AIM shows its alarm in process data, and is led down as soon as it does; its last word may be repeated until then.
fn assert_nobody_enables_after(world: &mut World, since_ns: u64) {
    let axes = world.config.axes.iter().filter(|axis| axis.drive == family::YZ_AIM);
    let rpdos =
        [0x200, 0x400].map(|function| axes.clone().map(move |axis| (axis.bus, id(function, axis.node))));
    for (bus, id) in rpdos.into_iter().flatten().collect::<Vec<_>>() {
        let sent = world.port(bus).sent_with(id);
        let words: Vec<u16> =
            sent.iter().filter(|(at, _)| *at > since_ns).map(|(_, data)| word(data)).collect();
        let up = words.iter().rposition(|word| word & 0x0F == 0x0F).map_or(0, |last| last + 1);
        assert!(up <= 3 && words[..up].iter().all(|word| word & 0x0F == 0x0F), "{:x?}", &words[..up]);
    }
}

/// The controller is away for 3 s in the middle of a move, with the drive silent on SYNC or not, and with any place of
/// our heartbeat in the cycle.
#[test]
fn a_yz_aim_whose_controller_was_away_stays_where_it_stopped_and_is_not_enabled_again() {
    for (answers_sync, after_cycles) in [(true, 200), (true, 213), (false, 200), (false, 225)] {
        let mut config = load("gantry-yz-aim.toml");
        config.axes.iter_mut().for_each(|axis| axis.answers_sync = answers_sync);
        let mut world = away(config, after_cycles);
        let before = positions_before_return(&mut world);
        for axis in 0..3 {
            let seen = world.observe(axis);
            assert_eq!(seen.error_code, COMMUNICATION_LOST);
            assert!(seen.velocity.abs() < 1e-3, "{seen:?}");
            assert!(seen.position.abs() > 0.001, "it was on its way: {seen:?}");
        }
        let since_ns = world.run.snapshot().at_ns;
        let way = largest_way_to_the_end(&mut world, &before);
        assert!(way <= TOLERANCE_COUNTS, "{way} counts, {answers_sync}, {after_cycles}");
        let rules: Vec<Rule> = world.stops().iter().map(|stop| stop.rule()).collect();
        assert_eq!(rules, [Rule::DriveFault], "{answers_sync}, {after_cycles}");
        assert_nobody_enables_after(&mut world, since_ns);
    }
}

/// On the divided bus the first slot after the absence may be one without a cycle there: our heartbeat must not overtake
/// the new targets.
#[test]
fn on_two_buses_the_yz_aims_and_the_erobs_stay_where_they_stopped() {
    for after_cycles in [400, 401, 433, 450] {
        let mut world = away(load("mixed-arm.toml"), after_cycles);
        let before = positions_before_return(&mut world);
        for axis in 0..5 {
            let seen = world.observe(axis);
            assert!(seen.velocity.abs() < 1e-3, "{seen:?}");
            assert!(seen.state == DriveState::Fault || seen.error_code == COMMUNICATION_LOST, "{seen:?}");
        }
        let since_ns = world.run.snapshot().at_ns;
        let way = largest_way_to_the_end(&mut world, &before);
        assert!(way <= TOLERANCE_COUNTS, "{way} counts, {after_cycles}");
        assert_eq!(world.stops().len(), 1, "{:?}", world.stops());
        assert_nobody_enables_after(&mut world, since_ns);
    }
}

#[test]
fn an_erob_whose_controller_was_away_has_stopped_and_left_operational_and_stays_where_it_is() {
    for name in ["erob-csp", "erob-csv", "erob-cst", "erob-ip", "erob-pp", "erob-pv", "erob-pt"] {
        let mut world = away(load(&format!("erob-modes/{name}.toml")), 300);
        let before = positions_before_return(&mut world);
        let seen = world.observe(0);
        assert_eq!((seen.nmt, seen.state), (takt::sim::NodeState::Stopped, DriveState::Fault), "{name}");
        assert!(seen.velocity.abs() < 1e-3, "{name}: {seen:?}");
        let way = largest_way_to_the_end(&mut world, &before);
        assert!(way <= TOLERANCE_COUNTS, "{name}: {way} counts");
        let rules: Vec<Rule> = world.stops().iter().map(|stop| stop.rule()).collect();
        assert_eq!(rules, [Rule::MissedFeedback], "{name}");
    }
}

/// Its reports answer set-points, and that of the cycle before the pause comes behind it.
#[test]
fn a_yz_aim_does_not_seem_faster_than_it_is_when_some_slots_are_missed() {
    for answers_sync in [true, false] {
        for missed in 1..=8 {
            let mut config = parse(&one_yz_aim("pp", "to = \"500 mm\""));
            config.axes[0].answers_sync = answers_sync;
            let mut world = World::new(config);
            world.run_until(|world| world.phase() == Phase::Moving);
            world.run_for(400);
            world.run.clock().stall(2 * missed * MILLISECOND_NS);
            for _ in 0..20 {
                world.run_for(1);
                let (velocity, limit) =
                    (world.run.snapshot().axes[0].velocity, world.config.axes[0].limits.velocity);
                assert!(velocity <= 1.05 * limit, "{velocity} after {missed} missed slots, {answers_sync}");
            }
            assert_eq!(world.phase(), Phase::Moving, "{missed}, {answers_sync}: {:?}", world.stops());
        }
    }
}

/// A YZ-AIM that goes on by itself when the heartbeat returns would turn at its old speed, or go on to its old target. Our
/// heartbeat is due in every 100th slot, of which every second one is no cycle of the bus: each place of the absence in
/// that is tried.
#[test]
fn a_yz_aim_in_a_profile_mode_does_not_take_its_old_motion_up_again() {
    let speed = "speed = \"0.05 m/s\"\nfor = \"5 s\"";
    for (mode, step, answers_sync) in [("pv", speed, true), ("pp", "to = \"500 mm\"", false)] {
        for after_cycles in 300..400 {
            let mut config = parse(&one_yz_aim(mode, step));
            config.axes[0].answers_sync = answers_sync;
            let mut world = away(config, after_cycles);
            let before = positions_before_return(&mut world);
            let seen = world.observe(0);
            assert_eq!(seen.error_code, COMMUNICATION_LOST);
            assert!(seen.velocity.abs() < 1e-3, "{seen:?}");
            let since_ns = world.run.snapshot().at_ns;
            let way = largest_way_to_the_end(&mut world, &before);
            assert!(way <= TOLERANCE_COUNTS, "{mode}: {way} counts, {after_cycles}");
            assert_eq!(world.stops().len(), 1, "{mode}: {:?}", world.stops());
            assert_nobody_enables_after(&mut world, since_ns);
        }
    }
}
