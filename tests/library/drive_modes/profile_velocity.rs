//! Profile velocity: it stops by velocity 0, expires, and does not run into a position limit.

use takt_rt::{Phase, ProfileMove, ProfileTarget, Request, Rule, StopCategory};

use crate::drive_modes::one_yz_aim::one_yz_aim;
use crate::drive_modes::wire::{MILLISECOND_NS, counts, word};
use crate::drive_modes::world::{World, load, parse};

fn erob() -> World {
    World::holding(load("erob-modes/erob-pv.toml"))
}

fn yz_aim() -> World {
    World::holding(parse(&one_yz_aim("pv", "to = 0")))
}

fn turn(world: &mut World, velocity: f64) {
    world.drive_to(0, ProfileTarget::Velocity(velocity));
    world.run_until(|world| (world.observe(0).velocity - velocity).abs() < 0.01 * velocity.abs());
}

#[test]
fn a_stop_is_velocity_0_and_holds() {
    let mut world = erob();
    turn(&mut world, 1.0);
    let since_ns = world.run.snapshot().at_ns;
    world.request(Request::Stop(StopCategory::Two));
    world.run_until(|world| world.phase() == Phase::Holding);
    world.run_for(1_000);
    let sent = world.port(0).sent_with(0x201);
    let after: Vec<(u16, i32)> = sent
        .iter()
        .filter(|(at_ns, _)| *at_ns > since_ns)
        .map(|(_, data)| (word(data), counts(&data[2..6])))
        .collect();
    assert!(after.len() > 1_000 && after[1..].iter().all(|command| *command == (0x0F, 0)));
    assert!(world.observe(0).velocity.abs() < 1e-3);
    assert_eq!(world.stops().len(), 1);
}

/// Its answer to a velocity shows no statusword, so it answers SYNC, whatever is wanted to spare the bus.
#[test]
fn a_yz_aim_turns_and_stops_also_where_answers_to_sync_are_not_wanted() {
    let mut config = parse(&one_yz_aim("pv", "to = 0"));
    config.axes[0].answers_sync = false;
    let mut world = World::holding(config);
    turn(&mut world, 0.1);
    world.request(Request::Stop(StopCategory::Two));
    world.run_until(|world| world.phase() == Phase::Holding);
    world.run_for(300);
    assert!(world.observe(0).velocity.abs() < 1e-3);
    assert_eq!(world.stops().len(), 1);
}

#[test]
fn a_velocity_that_nobody_renews_expires_and_the_group_stops() {
    for mut world in [erob(), yz_aim()] {
        let velocity = 0.5 * world.config.axes[0].limits.velocity;
        let valid_until_ns = world.run.snapshot().at_ns + 500 * MILLISECOND_NS;
        let target = ProfileTarget::Velocity(velocity);
        world.request(Request::SetProfileTarget(ProfileMove { axis: 0, target, valid_until_ns }));
        world.run_until(|world| !world.stops().is_empty());
        let stop = world.stops()[0];
        assert_eq!(
            (stop.rule(), stop.axis(), stop.category),
            (Rule::StaleCommand, Some(0), StopCategory::Two)
        );
        let late_ns = world.run.snapshot().at_ns - valid_until_ns;
        assert!(late_ns <= 2 * MILLISECOND_NS, "{late_ns}");
        while world.phase() == Phase::Stopping {
            assert!(world.step());
        }
        assert!(world.observe(0).velocity.abs() < 0.03 * world.config.axes[0].limits.velocity);
        assert_eq!(world.stops().len(), 1);
    }
}

#[test]
fn a_velocity_that_is_renewed_in_time_goes_on() {
    let mut world = erob();
    let target = ProfileTarget::Velocity(0.5);
    for _ in 0..20 {
        let valid_until_ns = world.run.snapshot().at_ns + 110 * MILLISECOND_NS;
        world.request(Request::SetProfileTarget(ProfileMove { axis: 0, target, valid_until_ns }));
        world.run_for(99);
    }
    assert_eq!((world.phase(), world.stops().len()), (Phase::Moving, 0));
}

#[test]
fn on_the_way_to_a_position_limit_the_joint_is_stopped_before_it() {
    for direction in [1.0, -1.0] {
        for mut world in [erob(), yz_aim()] {
            let limits = world.config.axes[0].limits;
            let velocity = direction * 0.99 * limits.velocity;
            world.drive_to(0, ProfileTarget::Velocity(velocity));
            let is_at_limit = limits.position_min == 0.0 && direction < 0.0;
            if !is_at_limit {
                world.run_until(|world| (world.observe(0).velocity - velocity).abs() < 0.01 * velocity.abs());
            }
            let mut furthest = 0.0_f64;
            world.run_to_the_end(|world| {
                let position = world.observe(0).position;
                furthest = if direction > 0.0 { furthest.max(position) } else { furthest.min(position) };
            });
            let stops = world.stops();
            assert_eq!(stops.iter().map(|stop| stop.rule()).collect::<Vec<_>>(), [Rule::PositionLimit]);
            let limit = if direction > 0.0 { limits.position_max } else { limits.position_min };
            // At the limit itself it takes the drive's first movement to see where it goes.
            let allowed = if is_at_limit { 1e-3 * limits.position_max } else { 0.0 };
            assert!((furthest - limit) * direction <= allowed, "{furthest} beyond {limit}");
            assert!(
                (furthest - limit).abs() < 0.05 * (limits.position_max - limits.position_min),
                "{furthest}"
            );
        }
    }
}
