//! NMT, boot-up, heartbeat producer and consumer, node guarding, emergency messages.

use takt::sim::cia402::Cia402Parameters;
use takt::sim::{DriveFault, NodeState};
use takt_rt::{DriveState, Frame, Id};

use super::bench::{Bench, MILLISECOND_NS, NODE, parameters};

const MASTER_HEARTBEAT: u32 = 0x701;

#[test]
fn a_drive_sends_nothing_before_its_boot_up_message() {
    let slow = Cia402Parameters { power_up_ns: 8_000 * MILLISECOND_NS, ..parameters(NODE) };
    let mut bench = Bench::with(vec![slow]);
    bench.send_data(0x605, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    bench.send_data(0x000, [0x01, 0x00]);
    bench.run_ms(7_989);
    assert!(bench.heard.is_empty());
    bench.run_ms(2);
    let [boot_up] = &bench.heard[..] else { panic!("{} frames", bench.heard.len()) };
    assert_eq!(boot_up.frame, Frame::of(Id::canopen(0x700, NODE), [0]));
    assert_eq!(bench.observe().nmt, NodeState::PreOperational);
}

#[test]
fn a_stopped_node_answers_no_sdo_request_until_it_is_reset() {
    let mut bench = Bench::new();
    bench.nmt(0x02);
    bench.send_data(0x605, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    bench.run_ms(5);
    assert!(bench.heard.is_empty());
    let reset_ns = bench.now_ns;
    bench.nmt(0x82);
    let boot_up = bench.heard.pop().unwrap();
    assert_eq!(boot_up.frame, Frame::of(Id::canopen(0x700, NODE), [0]));
    assert!(boot_up.at_ns - reset_ns < MILLISECOND_NS);
    assert_eq!(bench.read(0x1000, 0), Ok(0x0042_0192));
}

#[test]
fn nmt_commands_address_one_node_or_all_with_node_id_0() {
    let mut bench = Bench::with(vec![parameters(NODE), parameters(6)]);
    bench.send_data(0x000, [0x01, 6]);
    bench.run_ms(1);
    let state = |bench: &mut Bench, node| bench.bus.observe(node).unwrap().nmt;
    assert_eq!(
        (state(&mut bench, NODE), state(&mut bench, 6)),
        (NodeState::PreOperational, NodeState::Operational)
    );
    bench.send_data(0x000, [0x80, 0]);
    bench.run_ms(1);
    bench.send_data(0x000, [0x01, 0]);
    bench.run_ms(1);
    assert_eq!(
        (state(&mut bench, NODE), state(&mut bench, 6)),
        (NodeState::Operational, NodeState::Operational)
    );
    // A command with a wrong length or node ID changes nothing.
    bench.send_data(0x000, [0x02, NODE, 0]);
    bench.send_data(0x000, [0x03, NODE]);
    bench.run_ms(1);
    assert_eq!(state(&mut bench, NODE), NodeState::Operational);
}

#[test]
fn reset_communication_restores_the_communication_objects_and_reset_node_all() {
    let mut bench = Bench::new();
    bench.write(0x1006, 0, 4, 1000).unwrap();
    bench.write(0x6081, 0, 4, 5566).unwrap();
    bench.nmt(0x82);
    bench.heard.clear();
    assert_eq!((bench.read(0x1006, 0), bench.read(0x6081, 0)), (Ok(0), Ok(5566)));
    bench.nmt(0x81);
    bench.run_ms(10);
    assert_eq!(bench.take(0x705), [[0]]);
    assert_eq!(bench.read(0x6081, 0), Ok(10_000));
}

#[test]
fn the_heartbeat_shows_the_state_at_its_period() {
    let mut bench = Bench::new();
    bench.write(0x1017, 0, 2, 20).unwrap();
    bench.heard.clear();
    let began_ns = bench.now_ns;
    bench.run_ms(100);
    let beats: Vec<_> = std::mem::take(&mut bench.heard);
    assert_eq!(beats.len(), 5);
    for (beat, number) in beats.iter().zip(0..) {
        assert_eq!(beat.frame, Frame::of(Id::canopen(0x700, NODE), [127]));
        let expected_ns = began_ns + (number * 20 + 18) * MILLISECOND_NS;
        assert!(beat.at_ns.abs_diff(expected_ns) < 2 * MILLISECOND_NS);
    }
    bench.nmt(0x01);
    bench.run_ms(20);
    assert_eq!(bench.take(0x705).last().unwrap(), &[5]);
    bench.nmt(0x02);
    bench.run_ms(20);
    assert_eq!(bench.take(0x705).last().unwrap(), &[4]);
}

/// A started drive that consumes the master's heartbeat, receives it once, and then reaches the time-out.
fn loses_master(error_behaviour: i64) -> Bench {
    let mut bench = Bench::new();
    bench.write(0x1016, 1, 4, 0x0001_0032).unwrap();
    bench.write(0x1029, 1, 1, error_behaviour).unwrap();
    bench.nmt(0x01);
    bench.run_ms(200);
    assert_eq!(bench.observe().nmt, NodeState::Operational, "watched before the first heartbeat");
    for _ in 0..5 {
        bench.send_data(MASTER_HEARTBEAT, [5]);
        bench.run_ms(40);
    }
    assert_eq!(bench.observe().state, DriveState::SwitchOnDisabled);
    bench.heard.clear();
    bench.run_ms(11);
    assert_eq!(bench.observe().error_code, 0x8130);
    bench
}

#[test]
fn a_lost_master_causes_a_fault_an_emergency_message_and_the_state_of_1029() {
    let mut bench = loses_master(0);
    assert_eq!(bench.take(0x085), [[0x30, 0x81, 0x11, 0, 0, 0, 0, 0]]);
    assert_eq!((bench.observe().nmt, bench.observe().state), (NodeState::PreOperational, DriveState::Fault));
    assert_eq!(bench.read(0x1003, 1), Ok(0x8130));
    assert_eq!(loses_master(1).observe().nmt, NodeState::Operational);
    assert_eq!(loses_master(2).observe().nmt, NodeState::Stopped);
}

#[test]
fn without_a_heartbeat_consumer_a_lost_master_is_not_detected() {
    let mut bench = Bench::new();
    bench.nmt(0x01);
    bench.send_data(MASTER_HEARTBEAT, [5]);
    bench.run_ms(5_000);
    assert_eq!((bench.observe().nmt, bench.observe().error_code), (NodeState::Operational, 0));
}

#[test]
fn node_guarding_is_answered_with_a_toggle_bit_unless_the_heartbeat_is_on() {
    let mut bench = Bench::new();
    let request = Frame::remote(Id::canopen(0x700, NODE), 1).unwrap();
    for expected in [127, 255, 127] {
        bench.send(request);
        bench.run_ms(1);
        assert_eq!(bench.take(0x705), [[expected]]);
    }
    bench.write(0x1017, 0, 2, 1000).unwrap();
    bench.send(request);
    bench.run_ms(5);
    assert!(bench.take(0x705).is_empty());
}

#[test]
fn a_guarded_node_detects_missing_guarding() {
    let mut bench = Bench::new();
    bench.write(0x100C, 0, 2, 20).unwrap();
    bench.write(0x100D, 0, 1, 3).unwrap();
    bench.nmt(0x01);
    bench.send(Frame::remote(Id::canopen(0x700, NODE), 1).unwrap());
    bench.run_ms(59);
    assert_eq!(bench.observe().error_code, 0);
    bench.run_ms(3);
    assert_eq!((bench.observe().error_code, bench.observe().nmt), (0x8130, NodeState::PreOperational));
}

#[test]
fn errors_fill_the_history_newest_first_and_writing_0_clears_it() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(0x1003, 0), Ok(0));
    assert_eq!(bench.read(0x1003, 1), Err(0x0800_0024));
    bench.bus.inject_fault(NODE, DriveFault::OverCurrent).unwrap();
    bench.run_ms(1);
    bench.bus.inject_fault(NODE, DriveFault::Encoder).unwrap();
    bench.run_ms(1);
    assert_eq!(bench.take(0x085), [[0x10, 0x23, 0x03, 0, 0, 0, 0, 0], [0x05, 0x73, 0x23, 0, 0, 0, 0, 0]]);
    assert_eq!((bench.read(0x1003, 0), bench.read(0x1001, 0)), (Ok(2), Ok(0x23)));
    assert_eq!((bench.read(0x1003, 1), bench.read(0x1003, 2)), (Ok(0x7305), Ok(0x2310)));
    assert_eq!(bench.write(0x1003, 0, 1, 1), Err(0x0609_0030));
    bench.write(0x1003, 0, 1, 0).unwrap();
    assert_eq!(bench.read(0x1003, 1), Err(0x0800_0024));
}

#[test]
fn the_drive_ignores_frames_of_other_protocols_and_nodes() {
    let mut bench = Bench::new();
    bench.nmt(0x01);
    bench.run_ms(5);
    bench.heard.clear();
    // The vendor's other protocol, services of another node, an extended identifier, a CAN FD frame.
    bench.send_data(0x645, [0x00, 0x02]);
    bench.send_data(0x606, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    bench.send_data(0x206, [0x06, 0x00]);
    bench.send_data(0x305, [0x06, 0x00, 0, 0, 0, 0]);
    bench.send(Frame::of(Id::extended(0x605).unwrap(), [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]));
    bench.send(Frame::fd(Id::canopen(0x600, NODE), &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0], false).unwrap());
    bench.run_ms(20);
    assert!(bench.heard.is_empty(), "{:?}", bench.heard[0].frame);
}
