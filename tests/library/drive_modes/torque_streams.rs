//! Streams of torques and impedances on a simulated eRob in cyclic synchronous torque.

use takt_rt::{AxisPoint, MAX_AXES, Phase, PointRole, Request, Rule, StopCategory, StreamPoint, StreamState};

use crate::drive_modes::world::{World, load};

fn streaming() -> World {
    let mut world = World::holding(load("erob-modes/erob-cst.toml"));
    world.request(Request::Stream);
    world
}

/// Streams a point once in so many cycles.
fn stream(world: &mut World, point: AxisPoint, cycles: usize) {
    for cycle in 0..cycles {
        if cycle % 10 == 0 {
            let (at_ns, axes) = (world.run.snapshot().at_ns, [point; MAX_AXES]);
            let point = StreamPoint { at_ns, role: PointRole::Single, axes };
            // A stop may have ended the stream.
            let _ = world.run.host().streamer().push(&[point]);
        }
        if !world.step() {
            break;
        }
    }
}

#[test]
fn a_torque_moves_the_joint_and_the_stream_that_runs_dry_leaves_it_held() {
    let mut world = streaming();
    // Coulomb friction is 0.5 N·m, viscous friction 1 N·m·s/rad.
    stream(&mut world, AxisPoint::Torque(1.0), 1500);
    assert!((world.run.snapshot().axes[0].torque_set - 1.0).abs() < 0.05);
    let moving = world.observe(0);
    assert!(moving.velocity > 0.2, "{moving:?}");
    world.run_for(2_000);
    assert_eq!(world.run.snapshot().groups[0].stream.state, StreamState::Dry);
    let rest = world.observe(0);
    assert!(rest.velocity.abs() < 1e-3 && rest.position < moving.position + 0.3, "{rest:?}");
    stream(&mut world, AxisPoint::Torque(-1.0), 500);
    assert!(world.observe(0).velocity < -0.05);
    assert_eq!((world.stops(), world.phase()), (vec![], Phase::Streaming));
}

#[test]
fn a_torque_towards_a_position_limit_is_a_stop_before_it() {
    let mut world = streaming();
    let limits = world.config.axes[0].limits;
    stream(&mut world, AxisPoint::Torque(1.5), 10_000);
    let stops = world.stops();
    assert_eq!(
        (stops.len(), stops[0].rule(), stops[0].category),
        (1, Rule::PositionLimit, StopCategory::Two)
    );
    assert!((limits.position_max - 0.2..limits.position_max).contains(&world.observe(0).position));
}

#[test]
fn kinds_that_follow_each_other_make_no_bump_in_the_torque() {
    let mut world = streaming();
    let soft = AxisPoint::position(0.3).with_impedance(40.0, 8.0);
    let mut torques = vec![];
    for point in [
        AxisPoint::position(0.0),
        soft,
        AxisPoint::Torque(1.5),
        soft.with_torque(3.0),
        AxisPoint::Velocity(0.2),
        AxisPoint::Torque(-1.0),
        AxisPoint::position(0.2).with_torque(2.0),
    ] {
        for _ in 0..40 {
            stream(&mut world, point, 10);
            torques.push(world.run.snapshot().axes[0].torque_set);
        }
    }
    assert_eq!((world.stops(), world.phase()), (vec![], Phase::Streaming));
    // 31 N·m in 100 ms is 3.1 N·m in ten cycles.
    for pair in torques.windows(2) {
        assert!((pair[1] - pair[0]).abs() < 4.5, "{pair:?}");
    }
}
