//! Simulated ODrives, message by message, as the documentation of CAN Simple has them.

use takt_rt::{Frame, Id};

use crate::bit_fields::damiao::{Bench, bytes};
use crate::rows::columns;

const VECTORS: &str = include_str!("../../vectors/odrive-vectors.csv");
const POSITION: &str = "drive = \"bit-fields\"\ndescription = \"odrive-can-simple\"\n";
const REPORT: u8 = 0x09;

fn id(node: u32, message: u8) -> Id {
    Id::base(node << 5 | u32::from(message)).unwrap()
}

fn message(message: u8, payload: &[u8]) -> Frame {
    Frame::data(id(1, message), payload).unwrap()
}

/// What a drive answers. It reports its estimates and its heartbeat by itself, too.
fn answers(bench: &mut Bench, frame: Frame, awaited: Option<u8>) -> Vec<Frame> {
    let heard = bench.ask(frame, 2);
    let is_it = |frame: &Frame| match awaited {
        Some(message) => frame.id() == id(1, message),
        None => ![0x01, REPORT].iter().any(|own| frame.id() == id(1, *own)),
    };
    heard.into_iter().filter(is_it).collect()
}

#[test]
fn every_message_of_can_simple_is_taken_and_answered_so() {
    let mut bench = Bench::new(POSITION, "");
    let mut case = String::new();
    for row in VECTORS.lines().skip(1).map(columns) {
        let [now, meaning, number, kind, payload, reply, _] = row.try_into().unwrap();
        if now != case {
            bench = Bench::new(POSITION, "");
            case = now;
        }
        let number = u8::from_str_radix(&number, 16).unwrap();
        let frame = match kind.as_str() {
            "remote" => Frame::remote(id(1, number), 8).unwrap(),
            _ => message(number, &bytes(&payload)),
        };
        let awaited = bytes(&reply).first().copied();
        let heard = answers(&mut bench, frame, awaited);
        match reply.is_empty() {
            true => assert!(heard.is_empty(), "{case}: {meaning}: {heard:?}"),
            false => assert!(
                heard.contains(&message(bytes(&reply)[0], &bytes(&reply)[1..])),
                "{case}: {meaning}: {heard:?}"
            ),
        }
    }
}

#[test]
fn an_odrive_follows_every_controller_mode_whatever_its_axis_is_described_as() {
    let mut bench = Bench::new(POSITION, "");
    bench.ask(message(0x07, &[8, 0, 0, 0]), 2);
    for _ in 0..500 {
        // A quarter of a turn, without the feed-forwards.
        bench.ask(message(0x0C, &bytes("00 00 80 3E")), 2);
    }
    let seen = bench.bus.observe(1).unwrap();
    assert!((seen.position - std::f64::consts::FRAC_PI_2).abs() < 0.02, "{seen:?}");
    bench.ask(message(0x0B, &bytes("02 00 00 00 01 00 00 00")), 2);
    bench.ask(message(0x0D, &bytes("00 00 80 3E 00 00 00 00")), 500);
    let seen = bench.bus.observe(1).unwrap();
    assert!((seen.velocity - std::f64::consts::FRAC_PI_2).abs() < 0.05, "{seen:?}");
    bench.ask(message(0x0B, &bytes("01 00 00 00 01 00 00 00")), 2);
    bench.ask(message(0x0E, &bytes("00 00 00 3F")), 10);
    let seen = bench.bus.observe(1).unwrap();
    assert!((seen.torque - 0.5).abs() < 0.01, "{seen:?}");
}

#[test]
fn all_odrives_tell_their_addresses_when_they_are_asked_together_and_take_another_node_id() {
    let mut bench = Bench::new(POSITION, "");
    let asked = Frame::remote(id(0x3F, 6), 8).unwrap();
    let heard = bench.ask(asked, 2);
    assert!(heard.contains(&message(6, &bytes("01 54 41 4B 54 00 01 00"))), "{heard:?}");
    bench.ask(Frame::data(id(0x3F, 6), &bytes("05 54 41 4B 54 00 01 00")).unwrap(), 2);
    let heard = bench.ask(Frame::remote(id(5, 1), 8).unwrap(), 2);
    assert!(heard.contains(&Frame::data(id(5, 1), &bytes("00 00 00 00 01 00 00 00")).unwrap()), "{heard:?}");
}
