//! What is sent beside the target: the velocity offset (object 60B1) and the torque offset (object 60B2).

use takt_rt::{AxisPoint, MAX_AXES, Phase, PointRole, PositionPoint, Request, StreamPoint};

use crate::drive_modes::wire::{counts_per_unit, id};
use crate::drive_modes::world::{World, parse, text_of};

/// An eRob in this mode with this `feed_forward`, which streams a slow swing with a torque of 6 N·m fed forward. The payloads of
/// its commands, newest last, and the velocity of the set-point in counts/s.
fn streamed(mode: &str, feed_forward: &str) -> (World, f64) {
    let text = text_of(&format!("erob-modes/erob-{mode}.toml"));
    let config = parse(&text.replace("node = 1\n", &format!("node = 1\nfeed_forward = {feed_forward:?}\n")));
    let mut world = World::holding(config);
    world.request(Request::Stream);
    for cycle in 1..400 {
        let time_s = f64::from(cycle) * 1e-3;
        let motion = PositionPoint {
            position: 0.1 * (1.0 - (2.0 * time_s).cos()),
            velocity: Some(0.2 * (2.0 * time_s).sin()),
            acceleration: None,
        };
        let axes = [AxisPoint::motion(motion).with_torque(6.0); MAX_AXES];
        let at_ns = world.run.snapshot().at_ns;
        world.run.host().streamer().push(&[StreamPoint { at_ns, role: PointRole::Single, axes }]).unwrap();
        world.run_for(1);
    }
    assert_eq!((world.phase(), world.stops()), (Phase::Streaming, vec![]));
    let velocity = world.run.snapshot().axes[0].velocity_set * counts_per_unit(&world.config.axes[0]);
    (world, velocity)
}

fn last_command(world: &mut World, function: u16) -> Option<Vec<u8>> {
    world.port(0).sent_with(id(function, 1)).last().map(|(_, payload)| payload.clone())
}

fn torque_of(bytes: &[u8]) -> f64 {
    // Per mille of the rated 31 N·m.
    f64::from(i16::from_le_bytes([bytes[0], bytes[1]])) * 31.0 / 1000.0
}

#[test]
fn a_drive_that_follows_positions_gets_velocity_and_torque_beside_them() {
    let (mut world, velocity) = streamed("csp", "velocity-and-torque");
    let command = last_command(&mut world, 0x200).unwrap();
    assert_eq!(command.len(), 8);
    assert!((torque_of(&command[6..]) - 6.0).abs() < 0.02, "{}", torque_of(&command[6..]));
    let offset = last_command(&mut world, 0x300).unwrap();
    assert_eq!(offset.len(), 4);
    let sent = f64::from(i32::from_le_bytes([offset[0], offset[1], offset[2], offset[3]]));
    assert!(velocity > 8_000.0 && (sent - velocity).abs() < 200.0, "{sent} for {velocity}");
    assert!((world.run.snapshot().axes[0].torque_set - 6.0).abs() < 1e-9);
}

#[test]
fn the_torque_alone_takes_no_frame_more_and_reaches_a_drive_that_follows_velocities_too() {
    for mode in ["csp", "csv", "ip"] {
        let (mut world, _) = streamed(mode, "torque");
        let command = last_command(&mut world, 0x200).unwrap();
        assert_eq!(command.len(), 8, "{mode}");
        assert!((torque_of(&command[6..]) - 6.0).abs() < 0.02, "{mode}");
        assert_eq!(last_command(&mut world, 0x300), None);
    }
}

#[test]
fn without_feed_forward_a_torque_goes_nowhere_and_is_not_shown_as_commanded() {
    let (mut world, _) = streamed("csp", "none");
    assert_eq!(last_command(&mut world, 0x200).unwrap().len(), 6);
    assert_eq!(world.run.snapshot().axes[0].torque_set, 0.0);
}

#[test]
fn the_offsets_of_a_drive_that_is_disabled_are_zero() {
    let (mut world, _) = streamed("csp", "velocity-and-torque");
    world.request(Request::Disable);
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.run_for(5);
    assert_eq!(last_command(&mut world, 0x200).unwrap()[6..], [0, 0]);
    assert_eq!(last_command(&mut world, 0x300).unwrap(), [0; 4]);
}
