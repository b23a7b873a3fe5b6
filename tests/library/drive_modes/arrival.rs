//! Every configuration reaches what its program asks for.

use takt::Outcome;
use takt::config::ProgramTarget;
use takt_rt::{DriveState, Phase};

use crate::drive_modes::wire::counts_per_unit;
use crate::drive_modes::world::{World, load};

/// How far the true joints are from the target of each move at the end of the standstill after it, in counts.
fn errors_at_rest(name: &str) -> Vec<Vec<f64>> {
    let mut world = World::new(load(name));
    let moves = world.config.program.moves.clone();
    let mut errors = vec![vec![]; moves.len()];
    let outcome = world.run_to_the_end(|world| {
        let snapshot = world.run.snapshot();
        let finished = world.finished_motions().checked_sub(1);
        let Some(finished) = finished.filter(|_| snapshot.groups[0].phase == Phase::Holding) else { return };
        let ProgramTarget::Position(target) = &moves[finished].target else {
            panic!("{name} has no targets")
        };
        errors[finished] = (0..world.config.axes.len())
            .map(|axis| {
                (world.observe(axis).position - target[axis]) * counts_per_unit(&world.config.axes[axis])
            })
            .collect();
    });
    assert_eq!(outcome, Outcome::Finished, "{name}: {:?}", world.stops());
    assert_eq!(world.stops(), [], "{name}");
    for axis in 0..world.config.axes.len() {
        assert!(!world.observe(axis).state.has_torque(), "{name}");
        assert!(errors.iter().all(|errors| errors.len() == world.config.axes.len()), "{name}");
    }
    errors
}

fn assert_all_arrive(name: &str, counts: f64) {
    let errors = errors_at_rest(name);
    assert!(errors.iter().flatten().all(|error| error.abs() <= counts), "{name}: {errors:?}");
}

#[test]
fn the_gantry_of_yz_aims_reaches_every_target() {
    assert_all_arrive("gantry-yz-aim.toml", 2.0);
}

#[test]
fn the_mixed_arm_reaches_every_target_on_both_buses() {
    assert_all_arrive("mixed-arm.toml", 2.0);
}

#[test]
fn an_erob_reaches_every_target_in_cyclic_synchronous_position() {
    assert_all_arrive("erob-modes/erob-csp.toml", 2.0);
}

#[test]
fn an_erob_reaches_every_target_in_cyclic_synchronous_velocity() {
    assert_all_arrive("erob-modes/erob-csv.toml", 2.0);
}

/// A PD loop without an integral ends where its stiffness holds the joint's Coulomb friction.
#[test]
fn an_erob_reaches_every_target_in_cyclic_synchronous_torque() {
    let axis = &load("erob-modes/erob-cst.toml").axes[0];
    let takt::config::Control::Torque { stiffness, .. } = axis.control else { panic!("{:?}", axis.control) };
    let friction = axis.joint.coulomb_friction() / stiffness * counts_per_unit(axis);
    assert_all_arrive("erob-modes/erob-cst.toml", friction + 2.0);
}

#[test]
fn an_erob_reaches_every_target_in_interpolated_position() {
    assert_all_arrive("erob-modes/erob-ip.toml", 2.0);
}

#[test]
fn an_erob_reaches_every_target_in_profile_position() {
    assert_all_arrive("erob-modes/erob-pp.toml", 2.0);
}

#[test]
fn an_erob_in_profile_velocity_reaches_each_speed_keeps_it_for_its_time_and_stops() {
    let mut world = World::new(load("erob-modes/erob-pv.toml"));
    let wanted: Vec<(f64, f64)> = world
        .config
        .program
        .moves
        .iter()
        .map(|step| match &step.target {
            ProgramTarget::Velocity { velocity, duration_s } => (velocity[0], *duration_s),
            other => panic!("{other:?}"),
        })
        .collect();
    // Cycles in a row at the wanted speed, for each of the moves.
    let mut kept = vec![0_usize; wanted.len()];
    let mut rest = 0;
    let outcome = world.run_to_the_end(|world| {
        let seen = world.observe(0);
        for ((speed, _), kept) in wanted.iter().zip(&mut kept) {
            *kept += usize::from((seen.velocity - speed).abs() < 0.01 * speed.abs());
        }
        rest = if seen.velocity.abs() < 1e-3 { rest + 1 } else { 0 };
    });
    assert_eq!(outcome, Outcome::Finished, "{:?}", world.stops());
    for ((_, duration_s), kept) in wanted.iter().zip(&kept) {
        let most_ms = duration_s * 1e3 + 200.0;
        assert!(
            (duration_s * 1e3..most_ms).contains(&(*kept as f64)),
            "{kept} ms at speed, asked for {duration_s} s"
        );
    }
    assert!(rest > 100, "it ends at rest");
    assert_eq!(world.stops(), []);
}

#[test]
fn an_erob_in_profile_torque_pushes_as_asked_and_its_brake_holds_in_the_end() {
    let mut world = World::new(load("erob-modes/erob-pt.toml"));
    let mut pushed = vec![];
    let mut turned = (0.0_f64, 0.0_f64);
    let outcome = world.run_to_the_end(|world| {
        let seen = world.observe(0);
        if world.phase() == Phase::Moving && pushed.last() != Some(&seen.torque) {
            pushed.push(seen.torque);
        }
        turned = (turned.0.min(seen.velocity), turned.1.max(seen.velocity));
    });
    assert_eq!(outcome, Outcome::Finished, "{:?}", world.stops());
    // One per mille of 31 N·m is what can be asked for.
    for torque in [1.5, -1.5, 0.0] {
        assert!(pushed.iter().any(|seen| (seen - torque).abs() < 0.031), "{torque}: {pushed:?}");
    }
    assert!(pushed.iter().all(|seen| seen.abs() < 1.6), "{pushed:?}");
    assert!(turned.0 < -0.1 && turned.1 > 0.1, "{turned:?}");
    let seen = world.observe(0);
    assert!(seen.is_braked && seen.velocity == 0.0 && seen.state != DriveState::OperationEnabled);
    assert_eq!(world.stops(), []);
}
