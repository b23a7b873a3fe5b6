//! What bounds the motion that a drive plans by itself is raised or refused, and read back.

use takt::config::{Config, Control};
use takt::internals::family::bring_up::BringUp;

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
    for part in ["607F", "max profile velocity", "1000", "at least", "planner of the drive"] {
        assert!(failure.contains(part), "{part}: {failure}");
    }
}

#[test]
fn a_drive_that_follows_set_points_may_have_any_planner() {
    let (mut world, failure) = brought_up(&config(&[(0, 2)]), &[(0x60C6, 200), (0x607F, 1_000)]);
    assert_eq!((failure, world.drive().number(0x60C6, 0)), (None, 200));
}
