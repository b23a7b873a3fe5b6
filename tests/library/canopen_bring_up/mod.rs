//! The bring-up of eRob joints against scripted drives with an object dictionary.
//! The tests check the objects that are written, the facts that are read, and the messages of failures.

mod configuration_file;
mod failures;
mod planner;
mod scripted_drive;
mod world;

use proptest::prelude::*;
use scripted_drive::at;
use takt::config::{Config, Control};
use takt::family::bring_up::BringUpTiming;
use takt::family::bring_up::stages::{BringUp, BringUpProgress, NotConfigured, Shutdown, Stage};
use takt_rt::{DriveState, Frame, Id};
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::nmt::{ErrorControl, NmtState};
use world::{World, config};

/// A world whose drives are configured and started.
fn started(config: &Config) -> World {
    let mut world = World::of(config);
    let mut bring_up = BringUp::new(config);
    world.run(&mut bring_up).unwrap();
    bring_up.start().unwrap();
    world.run(&mut bring_up).unwrap();
    world
}

#[test]
fn a_configured_drive_is_pre_operational_mapped_and_targets_its_actual_position() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.run(&mut BringUp::new(&config)).unwrap();
    let drive = world.drive();
    assert_eq!((drive.nmt, drive.state), (NmtState::PreOperational, DriveState::SwitchOnDisabled));
    let expected = [
        (0x1005, 0, 0x80),
        (0x1006, 0, 1000),
        (0x1400, 1, 0x202),
        (0x1400, 2, 1),
        (0x1400, 5, 0),
        (0x1600, 0, 2),
        (0x1600, 1, 0x6040_0010),
        (0x1600, 2, 0x607A_0020),
        (0x1401, 1, 0x8000_0302),
        (0x1402, 1, 0x8000_0402),
        (0x1403, 1, 0x8000_0502),
        (0x1800, 1, 0x182),
        (0x1800, 2, 1),
        (0x1800, 5, 0),
        (0x1A00, 0, 3),
        (0x1A00, 1, 0x6041_0010),
        (0x1A00, 2, 0x6064_0020),
        (0x1A00, 3, 0x6077_0010),
        (0x1801, 1, 0x8000_0282),
        (0x1802, 1, 0x8000_0382),
        (0x1803, 1, 0x8000_0482),
        (0x1016, 1, 127 << 16 | 100),
        (0x1017, 0, 50),
        (0x1029, 1, 2),
        (0x6060, 0, 8),
        (0x607A, 0, u64::from((-123_456_i32) as u32)),
        (0x60FF, 0, 0),
        (0x6071, 0, 0),
        (0x60B0, 0, 0),
        (0x60B1, 0, 0),
        (0x60B2, 0, 0),
        (0x60C2, 1, 1),
        (0x60C2, 2, 0xFD),
        (0x6065, 0, 8344),
        (0x6081, 0, 166_886),
        (0x6083, 0, 333_772),
        (0x6084, 0, 417_215),
        (0x6085, 0, 417_215),
    ];
    for (index, subindex, value) in expected {
        assert_eq!(drive.number(index, subindex), value, "{}", at(index, subindex));
    }
}

#[test]
fn a_pdo_is_mapped_in_the_order_that_the_drive_needs() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.run(&mut BringUp::new(&config)).unwrap();
    let is_of_tpdo_1 = |index| index == 0x1800 || index == 0x1A00;
    let order: Vec<String> = world
        .drive()
        .writes
        .iter()
        .filter(|(object, _)| is_of_tpdo_1(object.index))
        .map(|(object, bytes)| format!("{object} {bytes:02X?}"))
        .collect();
    let expected = [
        "1800:01 [82, 01, 00, 80]",
        "1800:02 [01]",
        "1800:03 [00, 00]",
        "1800:05 [00, 00]",
        "1A00:00 [00]",
        "1A00:01 [10, 00, 41, 60]",
        "1A00:02 [20, 00, 64, 60]",
        "1A00:03 [10, 00, 77, 60]",
        "1A00:00 [03]",
        "1800:01 [82, 01, 00, 00]",
    ];
    assert_eq!(order, expected);
}

#[test]
fn the_facts_are_read_from_the_drive_and_converted_to_si_units() {
    let config = config(&[(0, 2)]);
    let facts = World::of(&config).run(&mut BringUp::new(&config)).unwrap().remove(0);
    assert_eq!((facts.rated_torque, facts.rated_current_a), (Some(31.0), Some(6.3)));
    assert_eq!(facts.position_counts, -123_456);
    assert_eq!((facts.identity.vendor_id, facts.identity.device_type), (0x5A65_726F, 0x0042_0192));
    assert_eq!((facts.identity.product_code, facts.identity.revision_number), (0x2648_3052, 0x0002_0111));
    assert_eq!(facts.texts.device_name.as_deref(), Some("eRob80H120I-BM-18CN"));
    assert_eq!((facts.supported_modes, facts.statusword), (909, 0x12C0));
    assert_eq!((facts.fault(), facts.restarts), (None, 0));
    let absent = [
        (0x1009, 0),
        (0x100A, 0),
        (0x6072, 0),
        (0x605A, 0),
        (0x607D, 1),
        (0x607D, 2),
        (0x6080, 0),
        (0x6007, 0),
    ];
    assert_eq!(facts.absent, absent.map(|(index, subindex)| at(index, subindex)));
}

#[test]
fn every_mode_maps_its_own_target() {
    let velocity = Control::Velocity { position_gain: 20.0 };
    let torque = Control::Torque {
        stiffness: 1.0,
        damping: 1.0,
        inertia: 0.0,
        viscous_friction: 0.0,
        coulomb_friction: 0.0,
    };
    let expected =
        [(Control::Position, 8, 0x607A_0020), (velocity, 9, 0x60FF_0020), (torque, 10, 0x6071_0010)];
    for (control, mode, target) in expected {
        let mut config = config(&[(0, 2)]);
        config.axes[0].control = control;
        let mut world = World::of(&config);
        world.run(&mut BringUp::new(&config)).unwrap();
        assert_eq!((world.drive().number(0x6061, 0), world.drive().number(0x1600, 2)), (mode, target));
    }
}

#[test]
fn axes_of_several_buses_are_brought_up_in_parallel() {
    let axes = [(0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)];
    let (one, six) = (config(&axes[..1]), config(&axes));
    let duration = |config: &Config| {
        let mut world = World::of(config);
        world.run(&mut BringUp::new(config)).unwrap();
        world.now_ns
    };
    let begin = World::of(&one).now_ns;
    let (alone, together) = (duration(&one) - begin, duration(&six) - begin);
    // Three axes share a channel of two frames a cycle: the longest queue is three frames, so one exchange takes two
    // cycles.
    assert!(together <= 2 * alone + 10_000_000, "{together} ns instead of {alone} ns");
}

#[test]
fn start_makes_every_node_operational_after_all_are_configured() {
    let config = config(&[(0, 1), (1, 1)]);
    let mut world = World::of(&config);
    let mut bring_up = BringUp::new(&config);
    assert_eq!(bring_up.start(), Err(NotConfigured));
    world.run(&mut bring_up).unwrap();
    assert!(world.drives.iter().all(|(_, drive)| drive.nmt == NmtState::PreOperational));
    bring_up.start().unwrap();
    assert_eq!((bring_up.stage(), bring_up.outcome()), (Stage::Start, None));
    let facts = world.run(&mut bring_up).unwrap();
    assert!(world.drives.iter().all(|(_, drive)| drive.nmt == NmtState::Operational));
    assert_eq!(facts[1].rated_torque, Some(31.0), "what was learnt before is kept");
    assert_eq!(bring_up.start(), Err(NotConfigured));
}

#[test]
fn without_heartbeats_nothing_waits_for_one() {
    let mut config = config(&[(0, 2)]);
    config.axes[0].heartbeat_ns = None;
    config.master.heartbeat_ns = None;
    let mut world = started(&config);
    assert_eq!(world.drive().nmt, NmtState::Operational);
    assert_eq!((world.drive().number(0x1016, 1), world.drive().number(0x1017, 0)), (0, 0));
    world.run(&mut Shutdown::new(&config)).unwrap();
    assert_eq!(world.drive().nmt, NmtState::PreOperational);
}

#[test]
fn nodes_that_are_stopped_or_operational_are_recovered() {
    for left in [NmtState::Stopped, NmtState::Operational] {
        let config = config(&[(0, 2)]);
        let mut world = World::of(&config);
        world.drive().nmt = left;
        world.run(&mut BringUp::new(&config)).unwrap();
        assert_eq!(world.drive().nmt, NmtState::PreOperational);
    }
}

#[test]
fn the_bring_up_waits_for_a_drive_that_is_still_powering_up() {
    let config = config(&[(0, 1), (0, 2)]);
    let mut world = World::of(&config);
    let begin = world.now_ns;
    world.drive().power_up_at(begin + 8_300_000_000);
    let facts = world.run(&mut BringUp::new(&config)).unwrap();
    assert!(world.now_ns - begin > 8_300_000_000);
    assert_eq!(facts[0].restarts, 0);
}

#[test]
fn an_enabled_drive_is_stopped_by_its_ramp_and_disabled_before_any_change() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().state = DriveState::OperationEnabled;
    world.drive().set(0x606C, 0, &200_000_i32.to_le_bytes());
    let mut bring_up = BringUp::new(&config);
    for _ in 0..500 {
        world.step(&mut bring_up);
    }
    assert_eq!(world.drive().state, DriveState::QuickStopActive, "it is still moving");
    assert_eq!(world.drive().number(0x6085, 0), 417_215, "on the ramp of the configuration");
    world.drive().set(0x606C, 0, &(-1_500_i32).to_le_bytes());
    world.run(&mut bring_up).unwrap();
    let drive = world.drive();
    assert_eq!(drive.state, DriveState::SwitchOnDisabled);
    let controlwords: Vec<&[u8]> = drive
        .writes
        .iter()
        .filter(|(object, _)| *object == at(0x6040, 0))
        .map(|(_, bytes)| &bytes[..])
        .collect();
    assert_eq!(controlwords, [[0x02, 0x00], [0x00, 0x00]]);
}

#[test]
fn a_fault_is_reported_and_does_not_end_the_bring_up() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().state = DriveState::Fault;
    world.drive().set(0x603F, 0, &0x730F_u16.to_le_bytes());
    let facts = world.run(&mut BringUp::new(&config)).unwrap();
    assert_eq!(facts[0].fault(), Some(ErrorCode(0x730F)));
}

#[test]
fn requests_are_repeated_after_lost_replies() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().flaws.lost_replies = 2;
    world.run(&mut BringUp::new(&config)).unwrap();
}

#[test]
fn a_drive_that_restarts_during_the_bring_up_is_configured_again() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().flaws.restarts_at = Some((at(0x1016, 1), 2));
    let facts = world.run(&mut BringUp::new(&config)).unwrap();
    assert_eq!(facts[0].restarts, 2);
    assert_eq!(world.drive().number(0x1600, 2), 0x607A_0020, "the mapping was lost and set again");
}

#[test]
fn a_restart_ends_the_request_under_way_without_a_repetition() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    let mut bring_up = BringUp::new(&config);
    for _ in 0..3 {
        world.step(&mut bring_up);
    }
    // The next request is lost, and the drive boots before the reply timeout is noticed.
    bring_up.poll(world.now_ns, &mut |_, _| ());
    let boot_up = ErrorControl { node: 2, state: NmtState::BootUp }.frame();
    bring_up.receive(0, &boot_up);
    let mut requests = vec![];
    bring_up.poll(world.now_ns + 600_000_000, &mut |_, frame| requests.push(frame));
    assert_eq!(format!("{requests:?}"), "[602#4000100000000000]", "the identity is read again");
}

#[test]
fn a_shutdown_disables_the_drive_its_heartbeat_consumer_and_its_watch_for_sync() {
    let config = config(&[(0, 2)]);
    let mut world = started(&config);
    world.drive().state = DriveState::ReadyToSwitchOn;
    let facts = world.run(&mut Shutdown::new(&config)).unwrap();
    let drive = world.drive();
    assert_eq!((drive.nmt, drive.state), (NmtState::PreOperational, DriveState::SwitchOnDisabled));
    assert_eq!((drive.number(0x1006, 0), drive.number(0x1016, 1), drive.number(0x1017, 0)), (0, 0, 0));
    assert_eq!(facts[0].state(), DriveState::SwitchOnDisabled);
}

#[test]
fn the_shutdown_of_an_axis_with_torque_stops_it() {
    let config = config(&[(0, 2)]);
    let mut world = started(&config);
    world.drive().state = DriveState::OperationEnabled;
    world.run(&mut Shutdown::new(&config)).unwrap();
    assert_eq!(world.drive().state, DriveState::SwitchOnDisabled);
}

#[test]
fn progress_rises_to_the_end_and_names_the_slowest_axis() {
    let config = config(&[(0, 1), (0, 2)]);
    let mut world = World::of(&config);
    let begin = world.now_ns;
    world.drives[1].1.power_up_at(begin + 2_000_000_000);
    let mut bring_up = BringUp::new(&config);
    let reset = "restart of its communication";
    assert_eq!(bring_up.progress(), BringUpProgress { fraction: 0.0, step: reset, axis: 0 });
    let mut last = 0.0;
    while bring_up.outcome().is_none() {
        world.step(&mut bring_up);
        let progress = bring_up.progress();
        assert!((last..=1.0).contains(&progress.fraction));
        last = progress.fraction;
        if world.now_ns == begin + 1_000_000_000 {
            assert_eq!(progress, BringUpProgress { fraction: 0.5, step: reset, axis: 1 });
        }
    }
    assert!(world.now_ns > begin + 1_000_000_000);
    assert_eq!((bring_up.progress().fraction, bring_up.progress().step), (1.0, ""));
}

#[test]
fn the_caller_sets_the_time_outs() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    let begin = world.now_ns;
    world.drive().power_up_at(u64::MAX);
    let timing = BringUpTiming { boot_up_timeout_ns: 300_000_000, ..BringUpTiming::default() };
    world.run(&mut BringUp::with_timing(&config, timing)).unwrap_err();
    assert!(world.now_ns - begin < 2_000_000_000, "300 ms, and three questions of 500 ms each");
}

/// Frames that a drive might send about objects of the bring-up.
fn any_frame() -> impl Strategy<Value = Frame> {
    let id = prop_oneof![6 => Just(0x582), 2 => Just(0x702), 1 => Just(0x082), 1 => 0..0x7FFu32];
    let first = prop_oneof![Just(0x43), Just(0x4F), Just(0x60), Just(0x80), Just(0x41), any::<u8>()];
    let object =
        prop_oneof![Just([0x00, 0x10, 0]), Just([0x18, 0x10, 1]), Just([0x41, 0x60, 0]), any::<[u8; 3]>()];
    let sdo = (first, object, any::<[u8; 4]>())
        .prop_map(|(first, object, tail)| [&[first][..], &object, &tail].concat());
    let payload = prop_oneof![3 => sdo, 1 => Just(vec![0]), 1 => prop::collection::vec(any::<u8>(), 0..=8)];
    (id, payload).prop_map(|(id, payload)| Frame::data(Id::base(id).unwrap(), &payload).unwrap())
}

proptest! {
    #[test]
    fn arbitrary_frames_never_panic_and_never_complete_a_bring_up(
        frames in prop::collection::vec((any_frame(), 0..200_000_000u64), 0..200),
    ) {
        let config = config(&[(0, 2)]);
        let mut bring_up = BringUp::new(&config);
        let mut now_ns = 0;
        for (frame, pause_ns) in frames {
            let mut requests = 0;
            bring_up.poll(now_ns, &mut |_, frame| {
                // An abort has no reply, so a request may follow it at once.
                let is_abort = frame.payload().first() == Some(&0x80);
                requests += usize::from(frame.id().value() == 0x602 && !is_abort);
            });
            prop_assert!(requests <= 1, "two SDO requests at once");
            bring_up.receive(0, &frame);
            now_ns += pause_ns;
        }
        prop_assert!(!matches!(bring_up.outcome(), Some(Ok(_))));
    }
}
