//! What bounds the motion of a drive by itself is raised or refused, and read back.

use takt::config::{Config, Control};
use takt::family::bring_up::stages::BringUp;

use super::world::{World, config};

fn in_profile_velocity() -> Config {
    let mut config = config(&[(0, 2)]);
    config.axes[0].control = Control::ProfileVelocity;
    config
}

/// The bring-up of a drive in which these objects have values, and its first failure.
fn brought_up(config: &Config, objects: &[(u16, u32)]) -> (World, Option<String>) {
    let mut world = World::of(config);
    for (index, value) in objects {
        world.drive().set(*index, 0, &value.to_le_bytes());
    }
    let outcome = world.run(&mut BringUp::new(config));
    (world, outcome.err().map(|error| error.to_string()))
}

#[test]
fn a_drive_that_may_not_change_its_speed_as_fast_as_planned_is_told_that_it_may() {
    let config = in_profile_velocity();
    let (mut world, failure) = brought_up(&config, &[(0x60C5, 200), (0x60C6, 200)]);
    assert_eq!(failure, None);
    let drive = world.drive();
    assert_eq!(drive.number(0x60C5, 0), drive.number(0x6083, 0));
    assert_eq!(drive.number(0x60C6, 0), drive.number(0x6084, 0));
    for kept in [0, u32::MAX] {
        let (mut world, failure) = brought_up(&config, &[(0x60C6, kept)]);
        assert_eq!((failure, world.drive().number(0x60C6, 0)), (None, kept.into()));
    }
}

#[test]
fn a_drive_whose_highest_speed_is_below_the_limit_is_refused_with_object_and_value() {
    let (_, failure) = brought_up(&in_profile_velocity(), &[(0x607F, 1_000)]);
    let failure = failure.unwrap();
    for part in [
        "`joint1`",
        "planner of the drive",
        "607F:00 (max profile velocity)",
        "at least 166886 = 2 rad/s (114.592 deg/s), or 0 for no bound",
        "got 1000 = 0.0119842 rad/s (0.686646 deg/s)",
    ] {
        assert!(failure.contains(part), "{part}: {failure}");
    }
}

#[test]
fn a_drive_that_follows_set_points_may_have_any_planner() {
    let (mut world, failure) = brought_up(&config(&[(0, 2)]), &[(0x60C6, 200), (0x607F, 1_000)]);
    assert_eq!((failure, world.drive().number(0x60C6, 0)), (None, 200));
}

/// The first failure of a bring-up in which the drive of a joint within ±3 rad has these software position limits.
fn within(config: &Config, lowest: i32, highest: i32) -> Option<String> {
    let mut world = World::of(config);
    world.drive().set(0x607D, 1, &lowest.to_le_bytes());
    world.drive().set(0x607D, 2, &highest.to_le_bytes());
    let outcome = world.run(&mut BringUp::new(config));
    outcome.err().map(|error| error.to_string())
}

#[test]
fn a_drive_that_stops_before_the_position_limits_is_refused_in_every_mode() {
    // 3 rad are 250329.08 counts.
    for config in [config(&[(0, 2)]), in_profile_velocity()] {
        for suits in [(i32::MIN, i32::MAX), (-250_330, 250_330), (-250_329, 250_329)] {
            assert_eq!(within(&config, suits.0, suits.1), None, "{suits:?}");
        }
        let lowest = within(&config, -1_000, i32::MAX).unwrap();
        for part in ["607D:01", "at most -250329 = -3.00000 rad", "got -1000 = -0.0119842 rad"] {
            assert!(lowest.contains(&part.replace("-3.00000", "-3")), "{part}: {lowest}");
        }
        let highest = within(&config, i32::MIN, 250_000).unwrap();
        for part in ["607D:02", "at least 250329", "got 250000 = 2.99606 rad"] {
            assert!(highest.contains(part), "{part}: {highest}");
        }
        // Nothing says that an eRob takes this for no limit.
        assert!(within(&config, 0, 0).is_some());
    }
}

#[test]
fn software_limits_are_those_of_the_counts_of_a_reversed_joint_with_another_zero() {
    let mut config = config(&[(0, 2)]);
    let axis = &mut config.axes[0];
    (axis.reversed, axis.zero_counts) = (true, 100_000);
    (axis.limits.position_min, axis.limits.position_max) = (-1.0, 2.0);
    assert_eq!(within(&config, 100_000 - 166_886, 100_000 + 83_443), None);
    let failure = within(&config, -60_000, i32::MAX).unwrap();
    assert!(failure.contains("got -60000 = 1.91748 rad"), "{failure}");
    assert!(within(&config, i32::MIN, 180_000).is_some());
}

#[test]
fn a_drive_whose_motor_may_not_turn_as_fast_as_the_axis_is_refused() {
    // 2 rad/s are 19.1 r/min.
    for config in [config(&[(0, 2)]), in_profile_velocity()] {
        for suits in [0, 19, 3_000, u32::MAX] {
            assert_eq!(brought_up(&config, &[(0x6080, suits)]).1, None, "{suits}");
        }
        let failure = brought_up(&config, &[(0x6080, 18)]).1.unwrap();
        for part in ["6080:00 (max motor speed)", "at least 19 = ", "got 18 = 1.88496 rad/s"] {
            assert!(failure.contains(part), "{part}: {failure}");
        }
    }
}
