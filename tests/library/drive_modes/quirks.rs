//! What real YZ-AIMs do beside their manual keeps neither bring-up nor motion from working.

use takt::Outcome;
use takt::config::Config;
use takt::sim::yz_aim::{Quirks, YzAimJoint, YzAimParameters};
use takt::sim::{Drive, DriveFault, SimulatedBus, WireBitRates};
use takt_rt::Phase;

use crate::drive_modes::wire::{counts_per_unit, id};
use crate::drive_modes::world::{World, load};

/// The gantry with drives that differ from the usual ones.
fn gantry_with(config: Config, change: impl Fn(&mut YzAimParameters)) -> World {
    let drives = config.axes.iter().map(|axis| -> Box<dyn Drive> {
        let mut parameters = takt::family::yz_aim::simulated_parameters(axis, 1_000_000, &config.simulation);
        change(&mut parameters);
        Box::new(YzAimJoint::new(parameters))
    });
    let rates = WireBitRates { nominal: 1_000_000, data: None };
    let bus = SimulatedBus::with_drives(rates, config.simulation.longest_gap_ns, drives.collect());
    World::on(config, vec![bus])
}

/// The largest distance of a true joint from where the program ends, in counts.
fn error_after_the_program(mut world: World) -> f64 {
    let outcome = world.run_to_the_end(|_| ());
    assert_eq!(outcome, Outcome::Finished, "{:?}", world.stops());
    let errors = (0..3).map(|axis| world.observe(axis).position * counts_per_unit(&world.config.axes[axis]));
    errors.fold(0.0, |largest, error| error.abs().max(largest))
}

#[test]
fn the_program_ends_where_it_should_with_any_of_the_quirks_and_without_them() {
    let all = Quirks::default();
    let none = Quirks::none();
    // Its deviations, whether it is silent for objects that it lacks, and whether it powers up in silence.
    let kinds = [
        (all, true, false),
        (none, false, false),
        (Quirks { ignores_first_target: true, ..none }, false, false),
        (Quirks { needs_shutdown_first: true, ..none }, false, false),
        (Quirks { controlword_interval_ns: 20_000_000, ..none }, false, false),
        (none, true, false),
        (all, true, true),
    ];
    for (quirks, is_silent_if_absent, is_power_up_silent) in kinds {
        let mut config = load("gantry-yz-aim.toml");
        config.program.moves.remove(0);
        let error = error_after_the_program(gantry_with(config, |parameters| {
            parameters.quirks = quirks;
            parameters.device.is_silent_if_absent = is_silent_if_absent;
            parameters.device.simulated.is_power_up_silent = is_power_up_silent;
        }));
        assert!(error <= 2.0, "{quirks:?}: {error}");
    }
}

#[test]
fn interpolation_that_was_not_stored_is_refused_by_its_object_with_the_remedy() {
    let mut world = gantry_with(load("gantry-yz-aim.toml"), |parameters| {
        if parameters.node == 2 {
            parameters.special_function = 0;
        }
    });
    let outcome = world.run_to_the_end(|_| ());
    let Outcome::BringUpFailed(error) = outcome else { panic!("{outcome:?}") };
    assert_eq!(error.failures.len(), 1);
    assert_eq!(error.failures[0].name, "y");
    let text = error.to_string();
    for part in ["2619", "special function", "expected 7", "write 2619 7", "save", "power-cycle"] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    assert!(world.port(0).sent_with(id(0x500, 1)).is_empty(), "no axis gets a target");
}

/// TPDO2 is silent, and what the controller works with is the answer to RPDO4.
#[test]
fn a_gantry_that_does_not_answer_sync_is_heard_by_its_answers_to_targets() {
    let mut config = load("gantry-yz-aim.toml");
    config.axes.iter_mut().for_each(|axis| axis.answers_sync = false);
    let mut world = World::new(config);
    let count = |world: &mut World, node: u8| {
        let port = world.port(0);
        let came = |function| {
            port.received.iter().filter(|(_, frame)| frame.id().value() == id(function, node)).count()
        };
        (port.sent_with(id(0x500, node)).len(), came(0x480), came(0x280))
    };
    let mut while_moving = vec![];
    let outcome = world.run_to_the_end(|world| {
        if world.phase() == Phase::Moving && world.run.snapshot().slot % 100 == 0 {
            while_moving = (1..=3).map(|node| count(world, node)).collect();
        }
    });
    assert_eq!(outcome, Outcome::Finished, "{:?}", world.stops());
    for (axis, (targets, answers, _)) in while_moving.into_iter().enumerate() {
        let seen = world.observe(axis).position * counts_per_unit(&world.config.axes[axis]);
        assert!(seen.abs() <= 2.0, "{seen}");
        assert!(targets > 1000 && (0..=1).contains(&(targets - answers)), "{targets} {answers}");
        let answers_to_sync = count(&mut world, axis as u8 + 1).2;
        assert_eq!(answers_to_sync, 0);
    }
}

#[test]
fn the_alarm_of_a_yz_aim_is_known_after_the_run_though_its_process_data_have_no_error_code() {
    let mut world = World::holding(load("gantry-yz-aim.toml"));
    let node = world.config.axes[0].node;
    world.port(0).bus.inject_fault(node, DriveFault::BlockedRotor).unwrap();
    let outcome = world.run_to_the_end(|_| ());
    assert!(matches!(outcome, Outcome::Stopped(_)), "{outcome:?}");
    assert_eq!(world.run.supervisor().drive_errors(), [(0, 0x12)]);
}
