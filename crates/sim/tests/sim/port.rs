//! The simulated bus as a port of the real-time thread: timing, pauses, counters, determinism.

use takt::config::{Config, Travel};
use takt::sim::{SimulatedBus, UnknownNode, WireBitRates};
use takt_rt::{BusPort, BusState, Frame, Id, RECEIVE_BATCH, ReceiveBatch};
use takt_wire::wire_length::WireLength;

use super::bench::{Bench, MILLISECOND_NS, NODE, drive, parameters};

const RATES: WireBitRates = WireBitRates { nominal: 1_000_000, data: None };

fn bus(longest_gap_ns: u64) -> SimulatedBus {
    SimulatedBus::with_drives(RATES, longest_gap_ns, vec![Box::new(drive(parameters(NODE)))])
}

fn received(bus: &mut SimulatedBus, now_ns: u64) -> Vec<(u64, u32)> {
    let mut batch = ReceiveBatch::new();
    bus.receive(now_ns, &mut batch);
    batch.iter().map(|received| (received.at_ns, received.frame.id().value())).collect()
}

#[test]
fn simulated_time_begins_with_the_first_call_at_any_clock_value() {
    let start_ns = 77_123_456_789;
    let mut bus = bus(u64::MAX);
    assert!(received(&mut bus, start_ns).is_empty());
    let boot_up = received(&mut bus, start_ns + 6 * MILLISECOND_NS);
    let duration_ns = RATES.duration_ns(&Frame::of(Id::canopen(0x700, NODE), [0]));
    assert_eq!(boot_up, [(start_ns + 5 * MILLISECOND_NS + duration_ns - 3_000, 0x705)]);
}

#[test]
fn a_frame_is_unconfirmed_until_its_last_bit() {
    let mut bus = bus(u64::MAX);
    let frame = Frame::of(Id::canopen(0x200, 99), [1, 2, 3, 4, 5, 6]);
    let duration_ns = RATES.duration_ns(&frame);
    assert_eq!(bus.send(0, &[frame, frame]), 2);
    assert_eq!(bus.unconfirmed(0), 2);
    assert_eq!(bus.unconfirmed(duration_ns - 3_001), 2);
    assert_eq!(bus.unconfirmed(duration_ns - 3_000), 1);
    assert_eq!(bus.unconfirmed(2 * duration_ns - 3_000), 0);
    let health = bus.health();
    assert_eq!((health.tx_frames, health.busy_ns, health.state), (2, 2 * duration_ns, BusState::ErrorActive));
}

#[test]
fn frames_beyond_the_queue_are_refused_and_counted() {
    let mut bus = bus(u64::MAX);
    let frame = Frame::of(Id::canopen(0x200, 99), []);
    let taken = bus.send(0, &[frame; 300]);
    assert!((256..260).contains(&taken));
    assert_eq!(bus.health().tx_overruns, 300 - taken as u64);
}

#[test]
fn a_batch_is_never_overfilled_and_the_rest_follows_in_the_next() {
    let mut bench = Bench::new();
    bench.write(0x1017, 0, 2, 1).unwrap();
    let mut batch = ReceiveBatch::new();
    let later_ns = bench.now_ns + 200 * MILLISECOND_NS;
    let mut sizes = vec![];
    loop {
        bench.bus.receive(later_ns, &mut batch);
        sizes.push(batch.len());
        if batch.len() < RECEIVE_BATCH {
            break;
        }
        batch.clear();
    }
    assert_eq!(sizes[..3], [RECEIVE_BATCH; 3]);
    assert!((198..=201).contains(&sizes.iter().sum::<usize>()), "{sizes:?}");
}

#[test]
fn a_pause_of_the_caller_stops_the_simulated_time() {
    let mut bus = bus(5 * MILLISECOND_NS);
    bus.send(0, &[]);
    let mut now_ns = 0;
    while now_ns < 20 * MILLISECOND_NS {
        now_ns += MILLISECOND_NS;
        received(&mut bus, now_ns);
    }
    // The drive expects a heartbeat every 50 ms. The caller pauses for a second and then resumes in time.
    for frame in [
        Frame::of(Id::canopen(0x600, NODE), [0x23, 0x16, 0x10, 1, 50, 0, 1, 0]),
        Frame::of(Id::canopen(0x700, 1), [5]),
    ] {
        bus.send(now_ns, &[frame]);
        now_ns += 3 * MILLISECOND_NS;
        received(&mut bus, now_ns);
    }
    now_ns += 1000 * MILLISECOND_NS;
    received(&mut bus, now_ns);
    assert_eq!(bus.paused_ns(), 995 * MILLISECOND_NS);
    assert_eq!(bus.observe(NODE).unwrap().error_code, 0);
    // Frames that arrive afterwards carry the caller's time.
    bus.send(now_ns, &[Frame::of(Id::canopen(0x600, NODE), [0x40, 0x00, 0x10, 0, 0, 0, 0, 0])]);
    let answer = received(&mut bus, now_ns + 2 * MILLISECOND_NS);
    assert!(answer.len() == 1 && (now_ns..now_ns + 2 * MILLISECOND_NS).contains(&answer[0].0));
}

#[test]
fn a_clock_that_stops_or_steps_back_moves_nothing() {
    let mut bus = bus(u64::MAX);
    bus.send(10 * MILLISECOND_NS, &[]);
    received(&mut bus, 20 * MILLISECOND_NS);
    let before = bus.observe(NODE).unwrap();
    assert!(received(&mut bus, 20 * MILLISECOND_NS).is_empty());
    assert!(received(&mut bus, 3 * MILLISECOND_NS).is_empty());
    assert_eq!(bus.observe(NODE).unwrap(), before);
}

#[test]
fn a_silenced_drive_neither_sends_nor_receives_but_keeps_running() {
    let mut bench = Bench::new();
    bench.enable(9, 0x60FF_0020, 0);
    for _ in 0..300 {
        bench.cycle(0x0F, 100_000);
    }
    bench.bus.silence(NODE, true).unwrap();
    let before = bench.observe().position;
    for _ in 0..100 {
        bench.send_data(0x080, []);
        bench.run_ms(1);
    }
    assert!(bench.heard.is_empty());
    assert!(bench.observe().position > before + 0.1);
    bench.bus.silence(NODE, false).unwrap();
    bench.cycle(0x0F, 100_000);
}

#[test]
fn a_missing_drive_is_named_in_the_error() {
    let mut bus = bus(u64::MAX);
    let error = UnknownNode { node: 9 };
    assert_eq!(bus.observe(9), Err(error));
    assert_eq!(bus.silence(9, true), Err(error));
    assert_eq!(error.to_string(), "no simulated drive with node ID 9 on this bus");
    assert_eq!(bus.nodes().collect::<Vec<_>>(), [NODE]);
}

#[test]
fn tpdos_of_several_drives_follow_in_identifier_order_without_a_gap() {
    let mut bench = Bench::with([7, 5, 6].map(parameters).to_vec());
    for node in [5u8, 6, 7] {
        bench.send_data(0x600 + u32::from(node), [0x2F, 0x00, 0x18, 2, 1, 0, 0, 0]);
    }
    bench.run_ms(3);
    bench.send_data(0x000, [1, 0]);
    bench.run_ms(3);
    bench.heard.clear();
    bench.send_data(0x080, []);
    bench.run_ms(1);
    let ids: Vec<_> = bench.heard.iter().map(|received| received.frame.id().value()).collect();
    assert_eq!(ids, [0x185, 0x186, 0x187]);
    for pair in bench.heard.windows(2) {
        assert_eq!(pair[1].at_ns - pair[0].at_ns, RATES.duration_ns(&pair[1].frame));
    }
    assert!(WireLength::of(&bench.heard[0].frame).nominal_bits >= 63);
}

#[test]
fn the_same_calls_give_the_same_bytes_at_the_same_times() {
    let run = || {
        let mut bench = Bench::with(vec![parameters(NODE)]);
        bench.enable(8, 0x607A_0020, 0);
        let mut heard = vec![];
        for cycle in 0..500i32 {
            bench.send_data(0x080, []);
            bench.run_ns(600_000);
            let [a, b, c, d] = (40 * cycle).to_le_bytes();
            bench.send_data(0x205, [0x0F, 0, a, b, c, d]);
            bench.run_ns(400_000);
            heard.append(&mut bench.heard);
        }
        heard
    };
    assert_eq!(run(), run());
}

/// The example arm with a reversed axis that has an offset and a linear one on a second, slower bus.
fn config() -> Config {
    let mut config =
        Config::parse("arm6-erob.toml", include_str!("../../../../configs/arm6-erob.toml")).unwrap();
    config.axes.truncate(3);
    config.buses[1].bit_rate = 500_000;
    let [first, reversed, linear] = &mut config.axes[..] else { panic!("three axes") };
    (first.bus, reversed.bus, linear.bus) = (0, 1, 1);
    (reversed.reversed, reversed.zero_counts) = (true, 1000);
    (linear.reversed, linear.travel, linear.gear_ratio) = (false, Travel::Linear { lead_m: 0.01 }, 2.0);
    for axis in [first, reversed, linear] {
        axis.simulated.initial_position = 0.5;
        axis.power_up_ns = 0;
    }
    config
}

#[test]
fn a_configured_bus_has_one_drive_per_axis_with_the_scale_of_the_axis() {
    let config = config();
    assert_eq!(takt::simulated_bus(&config, 0).nodes().collect::<Vec<_>>(), [1]);
    let mut bus = takt::simulated_bus(&config, 1);
    assert_eq!(bus.nodes().collect::<Vec<_>>(), [2, 3]);
    bus.send(0, &[]);
    let counts = [2, 3].map(|node| bus.observe(node).unwrap().position_counts);
    assert_eq!(counts, [1000 - 41_722, 52_428_800]);
    // Half the bit rate doubles the time between the boot-up messages.
    let boot_ups = received(&mut bus, 4 * MILLISECOND_NS);
    let slow = WireBitRates { nominal: 500_000, data: None };
    let duration_ns = slow.duration_ns(&Frame::of(Id::canopen(0x700, 3), [0]));
    assert_eq!(boot_ups[1].0 - boot_ups[0].0, duration_ns);
}

#[test]
fn a_simulated_bus_can_be_handed_to_another_thread() {
    let bus = bus(u64::MAX);
    let nodes = std::thread::spawn(move || bus.nodes().count());
    assert_eq!(nodes.join().unwrap(), 1);
}
