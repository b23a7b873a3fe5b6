//! TIME: when it is sent, what it says, and that nobody minds.

use takt::Outcome;
use takt::schedule::{self, MessageKind};
use takt_rt::TIME_ID;
use takt_wire::canopen::time::TimeOfDay;

use crate::drive_modes::wire::MILLISECOND_NS;
use crate::drive_modes::world::{World, parse, text_of};

/// 2000-01-01, where virtual time begins.
const FIRST_DAY: u16 = 16 * 365 + 4;

fn with_time(name: &str, period: &str) -> String {
    text_of(name) + &format!("\n[master]\ntime = \"{period}\"\n")
}

#[test]
fn both_families_are_told_the_time_behind_their_set_points_and_move_as_ever() {
    let mut world = World::new(parse(&with_time("mixed-arm.toml", "100 ms")));
    assert_eq!(world.run_to_the_end(|_| {}), Outcome::Finished);
    assert!(world.stops().is_empty());
    for bus in 0..2 {
        let told = world.port(bus).sent_with(TIME_ID.value());
        assert!(told.len() > 20, "{}", told.len());
        let steps: Vec<u64> = told.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        assert!(steps.iter().all(|step| *step == 100 * MILLISECOND_NS), "{steps:?}");
        for (at_ns, payload) in &told {
            let time = TimeOfDay::from_bytes(payload.as_slice().try_into().unwrap());
            assert_eq!((time.days, u64::from(time.milliseconds)), (FIRST_DAY, at_ns / MILLISECOND_NS));
        }
        // In each cycle in which it is sent it is the last but for services.
        let sent = &world.port(bus).sent;
        let behind = told.iter().filter(|(at_ns, _)| {
            let of_cycle =
                || sent.iter().filter(|(sent_ns, ..)| sent_ns == at_ns).map(|(_, frame, _)| frame.id());
            let is_set_point = |id: takt_rt::Id| (0x200..0x580).contains(&id.value());
            let place = of_cycle().position(|id| id == TIME_ID).unwrap();
            of_cycle().skip(place).any(is_set_point)
        });
        assert_eq!(behind.count(), 0, "TIME before a set-point");
    }
}

#[test]
fn a_controller_that_is_not_asked_to_tell_the_time_does_not() {
    let mut world = World::new(parse(&text_of("mixed-arm.toml")));
    world.run_to_the_end(|_| {});
    assert!(world.port(0).sent_with(TIME_ID.value()).is_empty());
}

#[test]
fn time_is_in_the_sums_of_every_bus() {
    let configs = ["single-erob.toml", "gantry-yz-aim.toml"].map(|name| parse(&with_time(name, "1 s")));
    for bus in configs.iter().flat_map(schedule::analyse) {
        let time = bus.messages.iter().find(|message| message.kind == MessageKind::Time).unwrap();
        assert_eq!((time.id, time.length, time.period_ns), (0x100, 6, 1000 * MILLISECOND_NS));
        assert!(time.is_sent_while_enabled && bus.fits());
    }
}
