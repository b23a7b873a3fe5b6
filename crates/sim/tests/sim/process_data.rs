//! The time at which PDOs act, and PDOs of a wrong length (CiA 301, 7.2.2).

use takt_rt::{Frame, Id};

use super::bench::{Bench, NODE};

const TARGET_POSITION: u32 = 0x607A_0020;

#[test]
fn nothing_is_sent_at_sync_before_the_node_is_started() {
    let mut bench = Bench::new();
    bench.write(0x1800, 2, 1, 1).unwrap();
    bench.send_data(0x080, []);
    bench.run_ms(2);
    assert!(bench.heard.is_empty());
    bench.nmt(0x01);
    bench.send_data(0x080, []);
    bench.run_ms(2);
    assert_eq!(bench.take(0x185).len(), 1);
}

#[test]
fn an_event_driven_tpdo_without_objects_is_not_sent() {
    let mut bench = Bench::new();
    bench.write(0x1803, 1, 4, 0x485).unwrap();
    bench.nmt(0x01);
    bench.run_ms(5);
    assert_eq!((bench.take(0x185).len(), bench.take(0x485).len()), (1, 0));
}

#[test]
fn a_tpdo_of_type_n_is_sent_shortly_after_every_nth_sync() {
    for transmission_type in [1, 3, 240] {
        let mut bench = Bench::new();
        bench.write(0x1800, 2, 1, transmission_type).unwrap();
        bench.nmt(0x01);
        let mut syncs_ns = vec![];
        for _ in 0..480 {
            syncs_ns.push(bench.now_ns);
            bench.send_data(0x080, []);
            bench.run_ms(1);
        }
        let expected: Vec<_> = syncs_ns
            .iter()
            .skip(transmission_type as usize - 1)
            .step_by(transmission_type as usize)
            .collect();
        assert_eq!(bench.heard.len(), expected.len());
        for (received, sync_ns) in bench.heard.iter().zip(expected) {
            // SYNC, 20 µs, then the frame of two bytes.
            let latency_ns = received.at_ns - sync_ns;
            assert!((110_000..160_000).contains(&latency_ns), "{latency_ns}");
        }
    }
}

#[test]
fn transmission_type_0_is_sent_at_sync_only_after_a_change() {
    let mut bench = Bench::new();
    bench.write(0x1800, 2, 1, 0).unwrap();
    bench.nmt(0x01);
    for expected in [1, 0, 0] {
        bench.send_data(0x080, []);
        bench.run_ms(2);
        assert_eq!(bench.take(0x185).len(), expected);
    }
    bench.write(0x6040, 0, 2, 6).unwrap();
    bench.send_data(0x080, []);
    bench.run_ms(2);
    assert_eq!(bench.take(0x185).len(), 1);
}

#[test]
fn an_event_driven_tpdo_is_sent_at_the_start_and_at_every_change_of_state() {
    let mut bench = Bench::new();
    bench.nmt(0x01);
    bench.run_ms(20);
    assert_eq!(bench.take(0x185).len(), 1);
    bench.write(0x6040, 0, 2, 6).unwrap();
    bench.run_ms(2);
    let [statusword] = &bench.take(0x185)[..] else { panic!("one frame") };
    assert_eq!(u16::from_le_bytes([statusword[0], statusword[1]]) & 0x6F, 0x21);
}

#[test]
fn the_event_timer_repeats_a_tpdo_and_the_inhibit_time_limits_its_rate() {
    let mut bench = Bench::new();
    bench.write(0x1800, 5, 2, 10).unwrap();
    bench.nmt(0x01);
    bench.heard.clear();
    bench.run_ms(100);
    assert!((9..=10).contains(&bench.take(0x185).len()));
    bench.write(0x1800, 5, 2, 0).unwrap();
    bench.write(0x1800, 3, 2, 500).unwrap();
    bench.heard.clear();
    for controlword in [6, 0, 6, 0, 6, 0, 6, 0, 6, 0] {
        bench.write(0x6040, 0, 2, controlword).unwrap();
        bench.run_ms(8);
    }
    bench.run_ms(5);
    let sent = bench.take(0x185).len();
    assert!((2..=3).contains(&sent), "{sent} in 105 ms with 50 ms between them");
}

#[test]
fn a_synchronous_rpdo_acts_at_sync_and_an_event_driven_one_at_once() {
    for (transmission_type, is_immediate) in [(0, false), (1, false), (240, false), (254, true), (255, true)]
    {
        let mut bench = Bench::new();
        bench.write(0x1400, 2, 1, transmission_type).unwrap();
        bench.nmt(0x01);
        bench.send_data(0x205, [0x06, 0x00]);
        bench.run_ms(2);
        assert_eq!(bench.read(0x6040, 0), Ok(if is_immediate { 6 } else { 0 }), "type {transmission_type}");
        bench.send_data(0x080, []);
        bench.run_ms(2);
        assert_eq!(bench.read(0x6040, 0), Ok(6));
    }
}

#[test]
fn a_short_rpdo_is_ignored_and_causes_one_emergency_message_until_a_valid_one() {
    let mut bench = Bench::new();
    bench.start_process_data(TARGET_POSITION);
    for _ in 0..3 {
        bench.send_data(0x205, [0x06, 0x00, 1, 2, 3]);
        bench.run_ms(1);
    }
    assert_eq!(bench.take(0x085), [[0x10, 0x82, 0x11, 0, 0, 0, 0, 0]]);
    bench.send_data(0x080, []);
    bench.run_ms(1);
    assert_eq!((bench.read(0x6040, 0), bench.read(0x607A, 0)), (Ok(0), Ok(0)));
    // A longer frame than the mapping is accepted, and its additional bytes are ignored.
    bench.send_data(0x205, [0x06, 0x00, 1, 0, 0, 0, 9, 9]);
    bench.send_data(0x080, []);
    bench.run_ms(1);
    assert_eq!(bench.take(0x085), [[0; 8]]);
    assert_eq!((bench.read(0x6040, 0), bench.read(0x607A, 0)), (Ok(6), Ok(1)));
}

#[test]
fn latched_data_is_discarded_when_the_node_leaves_operational() {
    let mut bench = Bench::new();
    bench.start_process_data(TARGET_POSITION);
    bench.send_data(0x205, [0x06, 0x00, 1, 0, 0, 0]);
    bench.nmt(0x80);
    bench.nmt(0x01);
    bench.send_data(0x080, []);
    bench.run_ms(1);
    assert_eq!(bench.read(0x6040, 0), Ok(0));
}

#[test]
fn a_remote_request_for_a_tpdo_is_answered_with_the_current_values() {
    let mut bench = Bench::new();
    bench.start_process_data(TARGET_POSITION);
    bench.send(Frame::remote(Id::canopen(0x180, NODE), 6).unwrap());
    bench.run_ms(1);
    let [answer] = &bench.take(0x185)[..] else { panic!("one frame") };
    assert_eq!(answer.len(), 6);
}

#[test]
fn sync_may_have_another_identifier() {
    let mut bench = Bench::new();
    bench.write(0x1005, 0, 4, 0x0A0).unwrap();
    bench.write(0x1800, 2, 1, 1).unwrap();
    bench.nmt(0x01);
    bench.send_data(0x080, []);
    bench.run_ms(1);
    assert!(bench.take(0x185).is_empty());
    bench.send_data(0x0A0, []);
    bench.run_ms(1);
    assert_eq!(bench.take(0x185).len(), 1);
}

#[test]
fn a_drive_told_to_produce_sync_sends_it_in_its_period_and_acts_on_it() {
    let mut bench = Bench::new();
    bench.write(0x1800, 2, 1, 1).unwrap();
    bench.write(0x1006, 0, 4, 2000).unwrap();
    bench.run_ms(20);
    assert!(bench.take(0x080).is_empty(), "without bit 30 it is no producer");
    bench.write(0x1005, 0, 4, 0x4000_0080).unwrap();
    assert_eq!(bench.read(0x1005, 0), Ok(0x4000_0080));
    bench.nmt(0x01);
    bench.take(0x080);
    bench.take(0x185);
    bench.run_ms(20);
    assert_eq!((bench.take(0x080).len(), bench.take(0x185).len()), (10, 10));
    bench.nmt(0x02);
    bench.take(0x080);
    bench.run_ms(20);
    assert!(bench.take(0x080).is_empty(), "a stopped node is silent");
    bench.nmt(0x82);
    bench.run_ms(20);
    assert!(bench.take(0x080).is_empty(), "the reset has restored the default of 1005");
}

#[test]
fn the_position_is_sampled_at_sync_and_not_at_transmission() {
    let mut bench = Bench::new();
    bench.enable(9, 0x60FF_0020, 0);
    for _ in 0..300 {
        bench.cycle(0x0F, 80_000);
    }
    // At a constant velocity, the positions at equidistant SYNCs are equidistant.
    let mut positions = vec![];
    for _ in 0..50 {
        positions.push(bench.cycle(0x0F, 80_000).1);
    }
    for pair in positions.windows(2) {
        assert!((pair[1] - pair[0] - 80).abs() <= 1, "{}", pair[1] - pair[0]);
    }
}
