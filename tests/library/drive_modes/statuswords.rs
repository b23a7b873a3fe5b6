//! What a drive is told whose statuswords show what nobody has asked for.

use takt::config::{Config, Feedback};
use takt_rt::{Frame, Phase, Request, Rule};

use crate::drive_modes::wire::{id, word};
use crate::drive_modes::world::{World, load};

const FAULT: u16 = 0x1208;
const READY_TO_SWITCH_ON: u16 = 0x1231;
const OPERATION_ENABLED: u16 = 0x1237;
const FAULT_RESET: u16 = 0x80;
/// CSP and another mode, as object 6061 shows them.
const OUR_MODE: u8 = 8;
const OTHER_MODE: u8 = 9;

/// One eRob that reports its mode of operation behind the statusword and the position.
fn erob() -> Config {
    let mut config = load("erob-modes/erob-csp.toml");
    config.axes[0].feedback = vec![Feedback::OperationMode];
    config
}

/// From now on the drive seems to report these statuswords and modes, one after the other, and the last one for good.
fn seem(world: &mut World, reports: &'static [(u16, u8)]) {
    let tpdo = id(0x180, 1);
    let mut next = 0;
    world.port(0).alter = Some(Box::new(move |frame: Frame| match frame.payload() {
        [_, _, position @ .., _] if frame.id().value() == tpdo => {
            let (word, mode) = reports[next.min(reports.len() - 1)];
            next += 1;
            Frame::data(frame.id(), &[&word.to_le_bytes()[..], position, &[mode]].concat()).unwrap()
        }
        _ => frame,
    }));
}

/// The controlwords since this time.
fn words_since(world: &mut World, since_ns: u64) -> Vec<u16> {
    let sent = world.port(0).sent_with(id(0x200, 1));
    sent.iter().filter(|(at_ns, _)| *at_ns > since_ns).map(|(_, payload)| word(payload)).collect()
}

#[test]
fn a_fault_that_comes_up_while_the_drives_are_enabled_is_not_reset_by_what_was_asked_for_before() {
    let mut world = World::holding(erob());
    world.request(Request::Disable);
    world.run_until(|world| world.phase() == Phase::Disabled);
    world.run_for(50);
    world.request(Request::ResetFaults);
    world.request(Request::Enable);
    let since_ns = world.run.snapshot().at_ns;
    seem(&mut world, &[(FAULT, OUR_MODE)]);
    for _ in 0..60 {
        world.step();
    }
    assert_eq!(world.stops().last().map(|stop| stop.rule()), Some(Rule::DriveFault));
    let words = words_since(&mut world, since_ns);
    assert!(words.len() > 20 && words.iter().all(|word| word & FAULT_RESET == 0), "{words:x?}");
}

#[test]
fn a_drive_that_was_seen_disabled_is_not_led_back_whatever_else_was_wrong_with_it_then() {
    let mut world = World::new(erob());
    world.run_until(|world| world.phase() == Phase::Moving);
    world.run_for(100);
    const DISABLED: (u16, u8) = (READY_TO_SWITCH_ON, OTHER_MODE);
    seem(&mut world, &[DISABLED, DISABLED, DISABLED, (OPERATION_ENABLED, OUR_MODE)]);
    world.run_for(4);
    assert_eq!((world.phase(), world.stops()[0].rule()), (Phase::Stopping, Rule::ModeChanged));
    let since_ns = world.run.snapshot().at_ns;
    world.run_for(20);
    let words = words_since(&mut world, since_ns);
    assert!(words.len() > 10 && words.iter().all(|word| word & 0xF != 0xF), "{words:x?}");
}
