//! The defects of the simulated drives, as seen on the bus.

use std::path::Path;

use takt::config::Config;
use takt::sim::{Defect, InjectDefectError, SimulatedBus};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};

fn bus() -> SimulatedBus {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 1_000_000);
    config.simulation.longest_gap_ns = u64::MAX;
    let mut bus = takt::simulated_bus(&config, 0);
    received(&mut bus, 0);
    received(&mut bus, 3_000_000);
    bus
}

fn received(bus: &mut SimulatedBus, now_ns: u64) -> Vec<Frame> {
    let mut batch = ReceiveBatch::new();
    bus.receive(now_ns, &mut batch);
    batch.iter().map(|received| received.frame).collect()
}

const READ_DEVICE_TYPE: [u8; 8] = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];

#[test]
fn a_silent_sdo_server_does_not_reply_until_the_defect_is_removed() {
    let mut bus = bus();
    bus.inject_defect(1, Defect::SilentSdoServer, true).unwrap();
    bus.send(4_000_000, &[Frame::of(Id::canopen(0x600, 1), READ_DEVICE_TYPE)]);
    assert_eq!(received(&mut bus, 8_000_000), []);
    bus.inject_defect(1, Defect::SilentSdoServer, false).unwrap();
    bus.send(9_000_000, &[Frame::of(Id::canopen(0x600, 1), READ_DEVICE_TYPE)]);
    assert_eq!(received(&mut bus, 12_000_000).len(), 1);
}

#[test]
fn an_emergency_message_is_sent_without_a_fault_and_an_alarm_with_one() {
    for (defect, code, is_fault) in
        [(Defect::Emergency { code: 0x4210 }, 0x4210, false), (Defect::Alarm { code: 0x7500 }, 0x7500, true)]
    {
        let mut bus = bus();
        bus.inject_defect(2, defect, true).unwrap();
        let frames = received(&mut bus, 6_000_000);
        assert_eq!((frames.len(), frames[0].id()), (1, Id::canopen(0x080, 2)));
        assert_eq!(frames[0].first_word() as u16, code);
        let seen = bus.observe(2).unwrap();
        assert_eq!((seen.state.is_faulted(), seen.error_code == code), (is_fault, is_fault));
    }
}

#[test]
fn an_encoder_jump_changes_the_counts_but_not_the_joint() {
    let mut bus = bus();
    let before = bus.observe(3).unwrap();
    bus.inject_defect(3, Defect::EncoderJump { distance: 0.1 }, true).unwrap();
    let after = bus.observe(3).unwrap();
    assert_eq!(after.position, before.position);
    // This axis is reversed.
    let counts = -(0.1 * 524_288.0 / std::f64::consts::TAU).round() as i32;
    assert_eq!(after.position_counts - before.position_counts, counts);
}

#[test]
fn a_blocked_joint_withstands_any_torque() {
    let mut bus = bus();
    let before = bus.observe(1).unwrap().position;
    bus.inject_defect(1, Defect::BlockedJoint, true).unwrap();
    bus.set_load_torque(1, 1e6).unwrap();
    received(&mut bus, 100_000_000);
    assert_eq!(bus.observe(1).unwrap().position, before);
    bus.inject_defect(1, Defect::BlockedJoint, false).unwrap();
    received(&mut bus, 110_000_000);
    assert_ne!(bus.observe(1).unwrap().position, before);
}

#[test]
fn a_frame_of_a_foreign_station_reaches_the_master_and_the_drives() {
    let mut bus = bus();
    let start = Frame::of(Id::canopen(0, 0), [1, 0]);
    assert!(bus.send_foreign(4_000_000, &start));
    assert_eq!(received(&mut bus, 5_000_000)[0], start);
    assert_eq!(bus.observe(1).unwrap().nmt, takt::sim::NodeState::Operational);
}

#[test]
fn a_missing_node_is_named() {
    let error = bus().inject_defect(99, Defect::StuckBrake, true);
    assert!(matches!(error, Err(InjectDefectError::UnknownNode(unknown)) if unknown.node == 99), "{error:?}");
}
