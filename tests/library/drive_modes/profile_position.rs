//! Profile position: the handshake, targets in motion, every stop, and what is refused.

use takt::Outcome;
use takt::config::Config;
use takt::sim::Defect;
use takt_rt::{
    EventKind, Frame, Phase, ProfileMove, ProfileTarget, Request, RequestId, Rule, StopCategory, controlword,
    statusword,
};

use crate::drive_modes::one_yz_aim::one_yz_aim;
use crate::drive_modes::wire::{MILLISECOND_NS, counts, counts_per_unit, id, word};
use crate::drive_modes::world::{World, load, parse};

const RPDO1: u32 = 0x201;
const TPDO1: u32 = 0x181;

fn erob() -> Config {
    load("erob-modes/erob-pp.toml")
}

fn target_counts(world: &World, position: f64) -> i32 {
    (position * counts_per_unit(&world.config.axes[0])).round() as i32
}

/// Controlword and target of every command since then.
fn commands_since(world: &mut World, since_ns: u64) -> Vec<(u64, u16, i32)> {
    let sent = world.port(0).sent_with(RPDO1);
    let since = sent.iter().filter(|(at_ns, _)| *at_ns > since_ns);
    since.map(|(at_ns, data)| (*at_ns, word(data), counts(&data[2..6]))).collect()
}

/// Runs until the joint is at its speed limit on a long way, and gives the present.
fn in_motion(world: &mut World) -> u64 {
    world.drive_to(0, ProfileTarget::Position(2.5));
    world.run_until(|world| world.observe(0).velocity > 0.9 * world.config.axes[0].limits.velocity);
    world.run_for(100);
    world.run.snapshot().at_ns
}

#[test]
fn a_target_is_offered_with_bit_4_acknowledged_with_bit_12_and_both_fall() {
    let mut world = World::holding(erob());
    let since_ns = world.run.snapshot().at_ns;
    let motion = world.drive_to(0, ProfileTarget::Position(0.5));
    world.run_until(|world| world.is_reached(motion));
    let target = target_counts(&world, 0.5);
    let commands = commands_since(&mut world, since_ns);
    let offers: Vec<_> = commands.iter().filter(|(_, word, _)| word & controlword::BIT_4 != 0).collect();
    assert!(offers.iter().all(|(_, word, to)| (*word, *to) == (0x3F, target)), "{offers:x?}");
    let (offered_ns, withdrawn_ns) = (offers[0].0, offers[offers.len() - 1].0);
    let inside = commands.iter().filter(|(at, ..)| (offered_ns..=withdrawn_ns).contains(at)).count();
    assert_eq!(inside, offers.len(), "bit 4 rises once");
    let after: Vec<_> = commands.iter().filter(|(at, ..)| *at > withdrawn_ns).collect();
    assert!(after.len() > 100 && after.iter().all(|(_, word, to)| (*word, *to) == (0x0F, target)));

    let answers: Vec<(u64, bool)> = world
        .port(0)
        .received
        .iter()
        .filter(|(at_ns, frame)| *at_ns > since_ns && frame.id().value() == TPDO1)
        .map(|(at_ns, frame)| (*at_ns, word(frame.payload()) & statusword::BIT_12 != 0))
        .collect();
    let acknowledged: Vec<u64> = answers.iter().filter(|(_, is_set)| *is_set).map(|(at, _)| *at).collect();
    assert!(acknowledged[0] > offered_ns && acknowledged[0] > withdrawn_ns, "withdrawn once acknowledged");
    let last_ns = *acknowledged.last().unwrap();
    assert!(last_ns > withdrawn_ns && answers.iter().any(|(at, is_set)| *at > last_ns && !is_set));
}

#[test]
fn a_new_target_in_motion_is_taken_at_once_and_the_old_one_is_left() {
    let mut world = World::holding(erob());
    in_motion(&mut world);
    let at = world.observe(0).position;
    let motion = world.drive_to(0, ProfileTarget::Position(-0.3));
    let mut furthest = at;
    while !world.is_reached(motion) {
        world.run_for(1);
        furthest = furthest.max(world.observe(0).position);
        assert!(world.observe(0).velocity.abs() <= 1.01 * world.config.axes[0].limits.velocity);
    }
    assert!(furthest < 2.0, "{furthest}");
    world.run_for(300);
    let error = (world.observe(0).position + 0.3) * counts_per_unit(&world.config.axes[0]);
    assert!(error.abs() <= 2.0, "{error}");
    assert_eq!(world.stops(), []);
}

/// The old handshake must not end the new one's, wherever it stands.
#[test]
fn a_second_target_so_many_cycles_after_the_first_is_where_the_joint_ends() {
    for gap in 0..12 {
        let mut world = World::holding(erob());
        world.drive_to(0, ProfileTarget::Position(0.1));
        world.run_for(gap);
        let motion = world.drive_to(0, ProfileTarget::Position(-0.05));
        world.run_until(|world| world.is_reached(motion));
        world.run_for(300);
        let error = (world.observe(0).position + 0.05) * counts_per_unit(&world.config.axes[0]);
        assert!(error.abs() <= 2.0, "{gap}: {error}");
        assert_eq!(world.stops(), [], "{gap}");
    }
}

#[test]
fn targets_that_come_in_every_cycle_are_followed_and_none_is_called_unacknowledged() {
    let mut world = World::holding(erob());
    let mut motion = RequestId::default();
    for step in 0..1500_u32 {
        motion = world.drive_to(0, ProfileTarget::Position(f64::from(step) * 2e-4));
    }
    let behind = 1499.0 * 2e-4 - world.observe(0).position;
    assert!(behind < 0.1, "{behind} rad behind");
    world.run_until(|world| world.is_reached(motion));
    assert_eq!(world.stops(), []);
}

#[test]
fn a_stop_of_category_2_comes_to_rest_at_the_deceleration_limit_and_never_starts_again() {
    let mut world = World::holding(erob());
    let limits = world.config.axes[0].limits;
    in_motion(&mut world);
    let (begun, speed) = (world.observe(0).position, world.observe(0).velocity);
    world.request(Request::Stop(StopCategory::Two));
    let mut velocities = vec![];
    while world.phase() != Phase::Holding {
        world.run_for(1);
        velocities.push(world.observe(0).velocity);
    }
    for _ in 0..3_000 {
        world.run_for(1);
        velocities.push(world.observe(0).velocity);
    }
    // Over 50 ms, in which the joint's own loops have come after.
    let slopes = velocities.windows(51).map(|span| (span[0] - span[50]) / 50e-3);
    let steepest = slopes.fold(0.0, f64::max);
    assert!(steepest <= 1.05 * limits.deceleration, "{steepest}");
    let most_negative = velocities.iter().copied().fold(0.0, f64::min);
    assert!(most_negative > -0.01 * speed, "it went back: {most_negative}");
    let way = world.observe(0).position - begun;
    let shortest = speed * speed / (2.0 * limits.deceleration);
    assert!((shortest..1.1 * shortest).contains(&way), "{way}, at the limit {shortest}");
    assert!(velocities[velocities.len() - 2_000..].iter().all(|velocity| velocity.abs() < 1e-3));
    assert_eq!(world.phase(), Phase::Holding);
    assert_eq!(world.stops().len(), 1);
}

/// The drive takes a target that lies nearer than it can stop, passes it and swings back. A stop does not.
#[test]
fn a_stop_on_the_way_to_a_target_that_is_too_near_to_stop_at_comes_to_rest_beyond_it_and_for_good() {
    let mut world = World::holding(erob());
    in_motion(&mut world);
    let (here, speed) = (world.observe(0).position, world.observe(0).velocity);
    let shortest = speed * speed / (2.0 * world.config.axes[0].limits.deceleration);
    world.drive_to(0, ProfileTarget::Position(here + 0.3 * shortest));
    world.request(Request::Stop(StopCategory::Two));
    world.run_until(|world| world.phase() == Phase::Holding);
    let held = world.observe(0);
    assert!(held.velocity.abs() < 0.02 * speed, "{held:?}");
    let way = held.position - here;
    assert!((shortest..1.2 * shortest).contains(&way), "{way}, at the limit {shortest}");
    for _ in 0..2_000 {
        world.run_for(1);
        let velocity = world.observe(0).velocity;
        assert!(velocity > -0.02 * speed, "it went back: {velocity}");
    }
    assert!((world.observe(0).position - held.position).abs() < 1e-2);
}

/// The cycle that follows missed slots is a long one; those of the stop are not.
#[test]
fn a_stop_right_after_missed_slots_is_no_longer_than_any_other() {
    let mut config = erob();
    config.simulation.longest_gap_ns = 100 * MILLISECOND_NS;
    let mut world = World::holding(config);
    in_motion(&mut world);
    world.run.clock().stall(12 * MILLISECOND_NS);
    world.request(Request::Stop(StopCategory::Two));
    assert_eq!(world.phase(), Phase::Stopping);
    let begun = world.observe(0);
    world.run_until(|world| world.phase() == Phase::Holding);
    let way = world.observe(0).position - begun.position;
    let shortest = begun.velocity * begun.velocity / (2.0 * world.config.axes[0].limits.deceleration);
    assert!((shortest..1.1 * shortest).contains(&way), "{way}, at the limit {shortest}");
}

#[test]
fn a_stop_of_category_1_brakes_in_the_end() {
    let mut world = World::holding(erob());
    in_motion(&mut world);
    world.events.clear();
    world.request(Request::Stop(StopCategory::One));
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.run_for(5);
    let seen = world.observe(0);
    assert!(seen.is_braked && seen.velocity == 0.0, "{seen:?}");
    let phases = world.events.iter().filter_map(|event| match event.kind {
        EventKind::PhaseChanged { to, .. } => Some(to),
        _ => None,
    });
    assert_eq!(phases.collect::<Vec<_>>(), [Phase::Stopping, Phase::Disabling, Phase::Disabled]);
}

/// The vendor's tool commands position 0 with "disable".
#[test]
fn disabling_keeps_the_last_target_and_never_commands_position_0() {
    let mut config = erob();
    config.axes[0].simulated.initial_position = 1.0;
    let mut world = World::holding(config);
    world.drive_to(0, ProfileTarget::Position(0.5));
    world.run_until(|world| world.phase() == Phase::Holding);
    let since_ns = world.run.snapshot().at_ns;
    world.request(Request::Disable);
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.run_for(100);
    let (target, all) = (target_counts(&world, 0.5), commands_since(&mut world, 0));
    assert!(all.iter().all(|(_, _, to)| *to > target - 100), "no 0 from the beginning on");
    let last = commands_since(&mut world, since_ns);
    assert!(last.iter().any(|(_, word, _)| *word == 0x06));
    assert!(last.iter().all(|(_, _, to)| (to - target).abs() <= 2), "{last:x?}");
}

#[test]
fn what_cannot_be_a_target_is_refused_and_changes_nothing_on_the_wire() {
    let mut world = World::holding(erob());
    let limits = world.config.axes[0].limits;
    let wanted = |axis, target| ProfileMove { axis, target, valid_until_ns: u64::MAX };
    let refused = [
        wanted(0, ProfileTarget::Position(limits.position_max + 0.01)),
        wanted(0, ProfileTarget::Position(f64::NAN)),
        wanted(0, ProfileTarget::Velocity(0.1)),
        wanted(0, ProfileTarget::Torque(0.1)),
        wanted(1, ProfileTarget::Position(0.1)),
    ];
    let since_ns = world.run.snapshot().at_ns;
    for (count, wanted) in (1..).zip(refused) {
        world.request(Request::SetProfileTarget(wanted));
        world.run_for(5);
        assert_eq!((world.run.snapshot().rejected, world.phase()), (count, Phase::Holding), "{wanted:?}");
    }
    let commands = commands_since(&mut world, since_ns);
    assert!(
        commands.len() > 20
            && commands.windows(2).all(|pair| (pair[0].1, pair[0].2) == (pair[1].1, pair[1].2))
    );
}

#[test]
fn a_drive_that_does_not_acknowledge_or_does_not_let_go_stops_the_group() {
    let never: fn(u16) -> u16 = |word| word & !statusword::BIT_12;
    let always: fn(u16) -> u16 = |word| word | statusword::BIT_12;
    for change in [never, always] {
        let mut world = World::holding(erob());
        world.port(0).alter = Some(Box::new(move |frame: Frame| match frame.payload() {
            [low, high, rest @ ..] if frame.id().value() == TPDO1 => {
                let word = change(u16::from_le_bytes([*low, *high])).to_le_bytes();
                Frame::data(frame.id(), &[&word[..], rest].concat()).unwrap()
            }
            _ => frame,
        }));
        world.drive_to(0, ProfileTarget::Position(0.5));
        let outcome = world.run_to_the_end(|_| ());
        let Outcome::Stopped(stop) = outcome else { panic!("{outcome:?}") };
        assert_eq!((stop.rule(), stop.axis()), (Rule::NotAcknowledged, Some(0)));
        assert_eq!(world.stops().len(), 1);
    }
}

#[test]
fn a_yz_aim_moves_to_targets_by_its_own_profile_and_stops_without_going_back() {
    for answers_sync in [true, false] {
        let mut config = parse(&one_yz_aim("pp", "to = 0"));
        config.axes[0].answers_sync = answers_sync;
        let mut world = World::holding(config);
        let motion = world.drive_to(0, ProfileTarget::Position(0.1));
        world.run_until(|world| world.is_reached(motion));
        world.run_for(300);
        let scale = counts_per_unit(&world.config.axes[0]);
        let error = (world.observe(0).position - 0.1) * scale;
        assert!(error.abs() <= 2.0, "{error}");
        world.drive_to(0, ProfileTarget::Position(0.7));
        world.run_until(|world| world.observe(0).velocity > 0.13);
        world.request(Request::Stop(StopCategory::Two));
        let mut slowest = f64::MAX;
        for _ in 0..2_000 {
            world.run_for(1);
            slowest = slowest.min(world.observe(0).velocity);
        }
        assert_eq!(world.phase(), Phase::Holding);
        assert!(slowest > -0.002, "it went back: {slowest}");
        assert!(world.observe(0).position < 0.5 && world.observe(0).velocity.abs() < 1e-4);
        assert!(world.port(0).sent_with(id(0x500, 1)).is_empty(), "RPDO1 alone");
    }
}

#[test]
fn a_joint_that_does_not_get_to_its_target_stops_the_group_instead_of_moving_for_ever() {
    let mut world = World::holding(erob());
    in_motion(&mut world);
    world.port(0).bus.inject_defect(1, Defect::BlockedJoint, true).unwrap();
    world.run_until(|world| !world.stops().is_empty());
    let stops = world.stops();
    let seen = [Rule::FollowingError, Rule::DriveFault, Rule::DriveDisabled];
    assert!(seen.contains(&stops[0].rule()) && stops[0].axis() == Some(0), "{stops:?}");
    world.run_until(|world| world.phase() == Phase::Disabled);
}
