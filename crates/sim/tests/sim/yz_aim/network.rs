//! NMT, heartbeat producer and consumer, PDO timing.

use takt::sim::yz_aim::YzAimJoint;
use takt::sim::{Drive, Mailbox, NodeState, QueueOrder};
use takt_rt::{Frame, Id};
use takt_wire::quirks::{ObjectPattern, PowerUpState};

use super::{Bench, MILLISECOND_NS, NODE, bench, by_the_manual, parameters, with_quirks};

fn host_heartbeat(bench: &mut Bench) {
    bench.send_data(0x77F, [5]);
}

#[test]
fn a_stopped_drive_sends_no_pdo_and_still_receives_nmt() {
    let mut bench = bench(parameters(NODE));
    bench.nmt(0x02);
    bench.heard.clear();
    bench.send_data(0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    bench.send_data(0x205, [0x2F, 0, 1, 0, 0, 0, 0]);
    bench.send_data(0x080, []);
    bench.run_ms(3_000);
    assert!(bench.heard.is_empty());
    bench.nmt(0x01);
    bench.run_ms(1_000);
    assert_eq!(bench.take(0x705), [[5]]);
}

#[test]
fn resets_send_one_boot_up_message_and_lead_to_pre_operational() {
    for command in [0x81, 0x82] {
        let mut bench = bench(parameters(NODE));
        bench.nmt(0x01);
        bench.write(0x1017, 0, 2, 100).unwrap();
        bench.write(0x6081, 0, 4, 77).unwrap();
        bench.save();
        bench.write(0x1017, 0, 2, 500).unwrap();
        bench.write(0x6081, 0, 4, 88).unwrap();
        bench.heard.clear();
        bench.nmt(command);
        bench.run_ms(250);
        assert_eq!(bench.take(0x705), [[0], [0x7F], [0x7F]]);
        assert!(bench.heard.is_empty(), "no PDO in pre-operational");
        let speed = if command == 0x81 { 77 } else { 88 };
        assert_eq!((bench.read(0x1017, 0), bench.read(0x6081, 0)), (Ok(100), Ok(speed)));
    }
}

#[test]
fn the_state_after_power_up_and_its_boot_up_message_differ_between_units() {
    let unit = with_quirks(parameters(NODE), |device| {
        device.power_up = PowerUpState::Operational;
        device.simulated.is_power_up_silent = true;
    });
    let mut unit = bench(unit);
    assert_eq!(unit.observe().nmt, NodeState::Operational);
    unit.run_ms(1_000);
    assert_eq!(unit.take(0x705), [[5]]);
    unit.bus.power_cycle(NODE).unwrap();
    unit.run_ms(20);
    assert_eq!(unit.take(0x705).len(), 0);
    let mut usual = bench(parameters(NODE));
    usual.bus.power_cycle(NODE).unwrap();
    usual.run_ms(1_010);
    assert_eq!(usual.take(0x705), [[0], [0x7F]]);
}

#[test]
fn without_a_first_heartbeat_the_master_is_not_monitored() {
    let mut bench = bench(by_the_manual(NODE));
    bench.control(0x0F);
    bench.run_ms(5_000);
    assert_eq!(bench.alarm(), 0);
}

#[test]
fn a_lost_master_stops_the_motor_and_its_return_resumes_the_old_target() {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x1016, 1, 4, 0x007F_0064).unwrap();
    bench.nmt(0x01);
    bench.control(0x2F);
    host_heartbeat(&mut bench);
    bench.write(0x607A, 0, 4, 200_000).unwrap();
    bench.run_ms(96);
    assert_eq!(bench.alarm(), 0);
    bench.run_ms(200);
    assert_eq!((bench.alarm(), bench.statusword()), (0x20, 0x003F));
    let stopped = bench.position();
    assert!((20_000..120_000).contains(&stopped), "{stopped}");
    bench.heard.clear();
    bench.run_ms(1_000);
    assert_eq!(bench.take(0x705), [[0x04]]);
    // It may rest at the edge of a count.
    assert!((bench.position() - stopped).abs() <= 1, "{} after {stopped}", bench.position());
    for _ in 0..40 {
        host_heartbeat(&mut bench);
        bench.run_ms(40);
    }
    assert_eq!((bench.alarm(), bench.statusword(), bench.position()), (0, 0x0437, 200_000));
}

#[test]
fn only_node_127_is_monitored_and_a_time_of_0_disables_monitoring() {
    let mut bench = bench(by_the_manual(NODE));
    bench.write(0x1016, 1, 4, 0x007F_0064).unwrap();
    bench.send_data(0x701, [5]);
    bench.run_ms(500);
    assert_eq!(bench.alarm(), 0);
    bench.write(0x1016, 1, 4, 0x007F_0000).unwrap();
    host_heartbeat(&mut bench);
    bench.run_ms(5_000);
    assert_eq!(bench.alarm(), 0);
}

#[test]
fn tpdo1_and_tpdo3_are_sent_every_100_ms_and_tpdo2_at_every_sync() {
    let mut bench = bench(parameters(NODE));
    bench.nmt(0x01);
    bench.run_ms(1_000);
    assert_eq!((bench.take(0x185).len(), bench.take(0x385).len()), (10, 10));
    for _ in 0..10 {
        bench.send_data(0x080, []);
        bench.run_ms(2);
    }
    assert_eq!(bench.take(0x285).len(), 10);
    assert_eq!(bench.take(0x485).len(), 0);
    bench.write(0x1800, 5, 2, 0).unwrap();
    bench.write(0x1802, 5, 2, 20).unwrap();
    bench.write(0x1801, 2, 1, 255).unwrap();
    bench.heard.clear();
    for _ in 0..100 {
        bench.send_data(0x080, []);
        bench.run_ms(2);
    }
    assert_eq!([0x185, 0x285, 0x385].map(|id| bench.take(id).len()), [0, 0, 10]);
}

#[test]
fn an_event_timer_set_before_operational_has_no_effect_until_then() {
    let mut joint = YzAimJoint::new(parameters(NODE));
    let mut mailbox = Mailbox::new(QueueOrder::FirstInFirstOut, 8);
    joint.advance(10 * MILLISECOND_NS, &mut mailbox);
    let write = Frame::of(Id::canopen(0x600, NODE), [0x2B, 0x00, 0x18, 5, 20, 0, 0, 0]);
    joint.receive(11 * MILLISECOND_NS, &write, &mut mailbox);
    for now_ms in 12..100 {
        joint.advance(now_ms * MILLISECOND_NS, &mut mailbox);
    }
    assert!(joint.wake_ns() > 99 * MILLISECOND_NS + MILLISECOND_NS / 2, "{}", joint.wake_ns());
}

#[test]
fn a_unit_may_refuse_other_pdo_parameters() {
    let mut bench = bench(with_quirks(parameters(NODE), |device| {
        device.constant.push(ObjectPattern::Index(0x1801));
    }));
    assert_eq!(bench.write(0x1801, 2, 1, 255), Err(0x0601_0002));
    assert_eq!(bench.read(0x1801, 2), Ok(1));
}

#[test]
fn replies_to_rpdos_respect_the_inhibit_time() {
    let mut bench = bench(parameters(NODE));
    bench.nmt(0x01);
    bench.write(0x1803, 3, 2, 100).unwrap();
    bench.heard.clear();
    for _ in 0..5 {
        bench.send_data(0x505, [0, 0, 0, 0]);
        bench.run_ms(1);
    }
    bench.run_ms(20);
    // One frame is sent at once, and one with the newest data 10 ms later.
    let answers: Vec<_> =
        bench.heard.iter().filter(|heard| heard.frame.id() == Id::canopen(0x480, NODE)).collect();
    assert_eq!(answers.len(), 2);
    let apart_ns = answers[1].at_ns - answers[0].at_ns;
    assert!(apart_ns.abs_diff(10 * MILLISECOND_NS) < MILLISECOND_NS / 2, "{apart_ns}");
}

#[test]
fn an_inhibit_time_applies_after_the_next_tpdo() {
    let mut bench = bench(parameters(NODE));
    bench.nmt(0x01);
    bench.write(0x1803, 3, 2, 0).unwrap();
    bench.send_data(0x505, [0, 0, 0, 0]);
    bench.run_ms(1);
    bench.write(0x1803, 3, 2, 100).unwrap();
    bench.heard.clear();
    for expected in [1, 0] {
        bench.send_data(0x505, [0, 0, 0, 0]);
        bench.run_ms(2);
        assert_eq!(bench.take(0x485).len(), expected);
    }
    bench.run_ms(10);
    assert_eq!(bench.take(0x485).len(), 1);
}

#[test]
fn pdos_and_sync_do_nothing_before_operational() {
    let mut bench = bench(by_the_manual(NODE));
    bench.send_data(0x205, [0x2F, 0, 1, 0x50, 0xC3, 0, 0]);
    bench.send_data(0x080, []);
    bench.run_ms(300);
    assert_eq!((bench.position(), bench.statusword()), (0, 0x0404));
    assert!(bench.heard.is_empty());
}

#[test]
fn an_overlapping_sdo_request_is_lost_and_replies_take_about_300_microseconds() {
    let mut bench = bench(parameters(NODE));
    let began_ns = bench.now_ns;
    for index in [0x00, 0x17, 0x05] {
        bench.send_data(0x605, [0x40, index, 0x10, 0, 0, 0, 0, 0]);
    }
    bench.run_ms(5);
    let [answer] = &bench.heard[..] else { panic!("{} answers", bench.heard.len()) };
    assert_eq!(answer.frame, Frame::of(Id::canopen(0x580, NODE), [0x43, 0, 0x10, 0, 0x92, 0x01, 0x02, 0]));
    // The time of two frames of about 0.12 ms each on the wire plus the drive's reply time.
    assert!((450_000..700_000).contains(&(answer.at_ns - began_ns)));
}

#[test]
fn a_request_for_an_unknown_object_gets_no_reply() {
    let mut bench = bench(parameters(NODE));
    bench.send_data(0x605, [0x23, 0x84, 0x60, 0, 0x10, 0x27, 0, 0]);
    bench.run_ms(100);
    assert!(bench.heard.is_empty());
    assert_eq!(bench.read(0x1018, 1), Ok(0x331));
}
