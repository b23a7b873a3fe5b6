//! A stream of set-points that ends in a stop.

use takt_rt::{AxisPoint, DriveState, MAX_AXES, Phase, PointRole, Request, StopCategory, StreamPoint};

use crate::drive_modes::world::{World, load};

const CYCLE_S: f64 = 0.001;

/// The joint, with an acceleration that grows in this direction until the cycle in which these stops are asked for; the
/// stream gives positions alone. Returns the positions up to when the drive is disabled, or holds.
fn streamed_positions(direction: f64, stops: &[StopCategory]) -> Vec<f64> {
    let mut world = World::holding(load("erob-modes/erob-csp.toml"));
    let jerk = 0.9 * world.config.axes[0].limits.jerk * direction;
    world.request(Request::Stream);
    let begun = world.run.snapshot().axes[0].position_set;
    let mut positions = vec![begun; 3];
    for cycle in 1..=80 {
        let time_s = f64::from(cycle) * CYCLE_S;
        let mut axes = [AxisPoint::default(); MAX_AXES];
        axes[0] = (begun + jerk * time_s.powi(3) / 6.0).into();
        let at_ns = world.run.snapshot().at_ns;
        world.run.host().streamer().push(&[StreamPoint { at_ns, role: PointRole::Single, axes }]).unwrap();
        world.run_for(1);
        positions.push(world.run.snapshot().axes[0].position_set);
    }
    assert_eq!(world.phase(), Phase::Streaming);
    for stop in stops {
        world.run.host().request(Request::Stop(*stop)).unwrap();
    }
    while world.step() {
        let snapshot = world.run.snapshot();
        if snapshot.axes[0].drive_state != DriveState::OperationEnabled
            || snapshot.groups[0].phase == Phase::Holding
        {
            break;
        }
        positions.push(snapshot.axes[0].position_set);
    }
    positions
}

#[test]
fn a_stop_goes_on_from_the_steps_of_a_stream_also_if_a_harder_one_is_asked_for_in_the_same_cycle() {
    let limits = load("erob-modes/erob-csp.toml").axes[0].limits;
    for direction in [1.0, -1.0] {
        for stops in [
            &[StopCategory::Two][..],
            &[StopCategory::One, StopCategory::Zero],
            &[StopCategory::Two, StopCategory::Zero],
        ] {
            let positions = streamed_positions(direction, stops);
            assert!(positions.len() > 84, "the stop is seen: {}", positions.len());
            for four in positions.windows(4) {
                let jerk = (four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]) / CYCLE_S.powi(3);
                assert!(jerk.abs() <= limits.jerk * (1.0 + 1e-4), "{jerk} beyond {}, {stops:?}", limits.jerk);
            }
        }
    }
}
