//! The message of each kind of failure.

use takt::config::Control;
use takt::family::bring_up::stages::{BringUp, Shutdown};
use takt::family::bring_up::{FailureCause, ProbeResult};
use takt_rt::DriveState;
use takt_wire::canopen::emcy::{Emergency, ErrorCode, ErrorRegister};
use takt_wire::canopen::sdo::AbortCode;

use super::scripted_drive::{ScriptedDrive, at};
use super::started;
use super::world::{World, config};

/// The message about a drive with these flaws.
fn message(spoil: impl FnOnce(&mut ScriptedDrive)) -> String {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    spoil(world.drive());
    world.run(&mut BringUp::new(&config)).unwrap_err().to_string()
}

#[test]
fn the_drive_is_missing() {
    assert_eq!(
        message(|drive| drive.power_up_at(u64::MAX)),
        "axis `joint1` (node 2 on bus `bus0`), restart of its communication: expected the state boot-up, waited \
         12000 ms, it reported nothing and answered neither SDO nor any other protocol; try: check that the drive is \
         powered (it needs 8 s), the wiring and the termination of the bus, its bit rate (1 Mbit/s), and its node ID"
    );
}

#[test]
fn the_drive_uses_the_vendors_protocol_only() {
    assert_eq!(
        message(|drive| drive.flaws.uses_vendor_protocol = true),
        "axis `joint1` (node 2 on bus `bus0`), restart of its communication: expected the state boot-up, waited \
         12000 ms, it reported nothing, but it answers the vendor's custom CAN protocol; try: load CANopen \
         firmware into the drive, or configure the protocol that it speaks"
    );
}

#[test]
fn the_drive_ignores_nmt() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().flaws.ignores_nmt = true;
    let failure = world.run(&mut BringUp::new(&config)).unwrap_err().failures.remove(0);
    assert!(matches!(failure.cause, FailureCause::StateNotReached { probe_result: ProbeResult::Sdo, .. }));
    assert!(failure.advice().contains("second master"));
}

#[test]
fn the_drive_is_from_another_vendor() {
    let mut config = config(&[(0, 2)]);
    config.axes[0].identity.vendor = Some(0x5A65_726F);
    let mut world = World::of(&config);
    world.drive().set(0x1018, 1, &0x331_u32.to_le_bytes());
    assert_eq!(
        world.run(&mut BringUp::new(&config)).unwrap_err().to_string(),
        "axis `joint1` (node 2 on bus `bus0`), identity: reading 1018:01 (vendor ID): expected 0x5A65726F, got \
         0x00000331; try: another drive than configured answers under this node ID: check the wiring and the \
         node IDs, or correct `identity` in the configuration"
    );
}

#[test]
fn the_device_is_not_a_drive() {
    let message = message(|drive| drive.set(0x1000, 0, &0x0000_0191_u32.to_le_bytes()));
    assert!(message.contains("1000:00 (device type): expected a device of profile CiA 402, got 0x00000191"));
}

#[test]
fn the_firmware_lacks_the_mode() {
    let message = message(|drive| drive.set(0x6502, 0, &0x0D_u32.to_le_bytes()));
    assert!(
        message.contains(
            "supported modes: reading 6502:00 (supported drive modes): expected bit 7 (cyclic synchronous position), \
             got 0x0000000D (profile position, profile velocity, profile torque); try: choose another control mode"
        ),
        "{message}"
    );
}

#[test]
fn the_mode_is_not_adopted() {
    let message = message(|drive| {
        drive.flaws.not_stored.insert(at(0x6060, 0));
    });
    assert!(
        message.contains(
            "mode of operation: reading 6061:00 (modes of operation display): expected 8, got 0 for 20"
        ),
        "{message}"
    );
}

#[test]
fn the_object_cannot_be_mapped() {
    let message = message(|drive| {
        drive.flaws.refused.insert(at(0x1A00, 3), AbortCode::ObjectCannotBeMapped);
    });
    assert!(
        message.contains(
            "TPDO mapping: writing 0x60770010 to 1A00:03 (mapped object): expected it to be accepted, got abort \
             0x06040041 (object cannot be mapped to the PDO); try: the drive cannot carry these objects in this PDO"
        ),
        "{message}"
    );
}

#[test]
fn a_write_is_acknowledged_but_not_kept() {
    let message = message(|drive| {
        drive.flaws.not_stored.insert(at(0x1029, 1));
    });
    assert!(
        message.contains(
            "heartbeat: reading 1029:01 (error behaviour on communication error) back after writing 2: expected 2, \
             got 0; try: choose heartbeat times that this drive accepts"
        ),
        "{message}"
    );
}

#[test]
fn the_drive_stops_answering() {
    let message = message(|drive| {
        drive.flaws.silent.insert(at(0x1006, 0));
    });
    assert!(
        message.contains(
            "SYNC: writing 1000 to 1006:00 (communication cycle period): expected it to be accepted, got no reply \
             within 500 ms in 3 attempts; try: the drive no longer answers"
        ),
        "{message}"
    );
}

#[test]
fn an_object_has_another_length() {
    let message = message(|drive| drive.set(0x6064, 0, &[1, 2]));
    assert!(
        message.contains("reading 6064:00 (position actual value): expected 4 bytes, got 2"),
        "{message}"
    );
}

#[test]
fn a_write_is_refused_because_of_the_drives_state() {
    let message = message(|drive| {
        drive.flaws.refused.insert(at(0x6060, 0), AbortCode::PresentDeviceState);
    });
    assert!(
        message.contains("try: the drive refuses this in its present state: clear its fault"),
        "{message}"
    );
}

#[test]
fn the_drive_keeps_its_torque() {
    let message = message(|drive| {
        drive.state = DriveState::OperationEnabled;
        drive.flaws.ignores_controlwords = true;
    });
    assert!(
        message.contains(
            "standstill without torque: reading 6041:00 (statusword): expected a state without torque, got 0x12A7 \
             (OperationEnabled) for 20"
        ),
        "{message}"
    );
}

/// The heartbeat consumer (1016) of the drive is off after the reset.
#[test]
fn a_drive_that_is_brought_up_again_and_may_have_torque_restarts_without_it() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    let mut bring_up = BringUp::new(&config);
    world.run(&mut bring_up).unwrap();
    for is_silent in [false, true] {
        let drive = world.drive();
        drive.state = DriveState::OperationEnabled;
        drive.flaws.ignores_controlwords = true;
        if is_silent {
            drive.flaws.silent.insert(at(0x6041, 0));
        }
        assert_eq!(world.run(&mut bring_up.again(&[0])).is_err(), is_silent);
        assert_eq!(world.drive().state, DriveState::SwitchOnDisabled);
    }
}

#[test]
fn a_drive_without_a_rated_torque_cannot_be_commanded_in_torque() {
    let mut config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().set(0x6076, 0, &[0; 4]);
    let facts = world.run(&mut BringUp::new(&config)).unwrap();
    assert_eq!(facts[0].rated_torque, None, "in position it does not matter");
    config.axes[0].joint.rated_torque = None;
    config.axes[0].control = Control::Torque {
        stiffness: 1.0,
        damping: 1.0,
        inertia: 0.0,
        viscous_friction: 0.0,
        coulomb_friction: 0.0,
    };
    let message = world.run(&mut BringUp::new(&config)).unwrap_err().to_string();
    assert!(
        message
            .contains("ratings: reading 6076:00 (motor rated torque): expected more than zero, got 0; try")
    );
}

#[test]
fn a_value_does_not_fit_its_object() {
    let mut config = config(&[(0, 2)]);
    config.axes[0].heartbeat_ns = Some(70_000_000_000);
    let message = World::of(&config).run(&mut BringUp::new(&config)).unwrap_err().to_string();
    assert!(
        message.contains("writing 70000 to 1017:00 (producer heartbeat time): it does not fit 16 bits"),
        "{message}"
    );
}

#[test]
fn the_drive_restarts_repeatedly() {
    let message = message(|drive| drive.flaws.restarts_at = Some((at(0x1006, 0), usize::MAX)));
    assert!(
        message.contains(
            "SYNC: expected it to keep running, but it has restarted 4 times; try: check the drive's supply"
        ),
        "{message}"
    );
}

#[test]
fn the_drive_restarts_while_it_is_started() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    let mut bring_up = BringUp::new(&config);
    world.run(&mut bring_up).unwrap();
    bring_up.start().unwrap();
    world.step(&mut bring_up);
    let now_ns = world.now_ns;
    world.drive().power_up_at(now_ns);
    let failure = world.run(&mut bring_up).unwrap_err().failures.remove(0);
    assert_eq!(failure.cause, FailureCause::Restarted { times: 1 });
}

#[test]
fn the_drive_restarts_between_its_configuration_and_its_start() {
    let config = config(&[(0, 1), (0, 2)]);
    let mut world = World::of(&config);
    let mut bring_up = BringUp::new(&config);
    world.run(&mut bring_up).unwrap();
    let now_ns = world.now_ns;
    world.drive().power_up_at(now_ns);
    world.step(&mut bring_up);
    bring_up.start().unwrap();
    let failures = world.run(&mut bring_up).unwrap_err().failures;
    assert_eq!((failures.len(), failures[0].axis), (1, 0), "it has lost its mapping");
    assert_eq!(failures[0].cause, FailureCause::Restarted { times: 1 });
}

#[test]
fn the_last_emergency_message_is_reported_with_the_failure() {
    let config = config(&[(0, 2)]);
    let mut world = World::of(&config);
    world.drive().flaws.refused.insert(at(0x6060, 0), AbortCode::General);
    let mut bring_up = BringUp::new(&config);
    world.step(&mut bring_up);
    let code = ErrorCode(0x3220);
    let emergency = Emergency { node: 2, code, register: ErrorRegister(0x05), manufacturer: [0; 5] };
    bring_up.receive(0, &emergency.frame());
    let message = world.run(&mut bring_up).unwrap_err().to_string();
    assert!(
        message.contains(
            "got abort 0x08000000 (general error); its last emergency: 0x3220 (DC link under-voltage), error \
             register: generic + voltage; try:"
        ),
        "{message}"
    );
}

#[test]
fn every_axis_that_fails_is_named_and_the_others_are_not() {
    let config = config(&[(0, 1), (0, 2), (1, 1)]);
    let mut world = World::of(&config);
    world.drives[0].1.flaws.refused.insert(at(0x6060, 0), AbortCode::General);
    world.drives[2].1.power_up_at(u64::MAX);
    let error = world.run(&mut BringUp::new(&config)).unwrap_err();
    let failed: Vec<(usize, &str)> = error.failures.iter().map(|f| (f.axis, f.bus.as_str())).collect();
    assert_eq!(failed, [(0, "bus0"), (2, "bus1")]);
    assert_eq!(error.to_string().lines().count(), 2);
}

#[test]
fn the_shutdown_continues_after_a_refusal_and_reports_it() {
    let config = config(&[(0, 2)]);
    let mut world = started(&config);
    world.drive().flaws.refused.insert(at(0x6040, 0), AbortCode::General);
    let error = world.run(&mut Shutdown::new(&config)).unwrap_err();
    assert_eq!((error.failures.len(), error.failures[0].step), (1, "standstill without torque"));
    assert_eq!(world.drive().number(0x1017, 0), 0, "its own heartbeat was switched off nevertheless");
    assert_ne!(world.drive().number(0x1016, 1), 0, "a drive that may have torque keeps its watchdog");
}

#[test]
fn the_shutdown_of_a_missing_drive_ends_soon() {
    let config = config(&[(0, 2)]);
    let mut world = started(&config);
    let begin = world.now_ns;
    world.drive().powered_up_at_ns = u64::MAX;
    world.run(&mut Shutdown::new(&config)).unwrap_err();
    assert!(world.now_ns - begin < 5_000_000_000, "{} ms", (world.now_ns - begin) / 1_000_000);
}
