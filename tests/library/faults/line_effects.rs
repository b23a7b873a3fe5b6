//! What becomes of the requests and replies on a serial line: each effect by itself.

use takt::faults::{
    Direction, Effect, FaultInjector, LineEffect, LineFaults, Part, Scenario, ScenarioFault, Selection,
    Trigger, Window,
};

const MS: u64 = 1_000_000;

/// A line with one fault from 10 ms to 20 ms, and the number of messages that it has affected.
fn line(effect: LineEffect, selection: Selection) -> (LineFaults, impl Fn() -> u64) {
    let window = Window { trigger: Trigger::Start, after_ns: 10 * MS, lasts_ns: Some(10 * MS) };
    let location = "bus line".to_owned();
    let effect = Effect::Line(effect);
    let fault = ScenarioFault { kind: "any", location, line: 1, bus: 0, window, selection, effect };
    let injector = FaultInjector::new(Scenario { faults: vec![fault] });
    let mut line = injector.of_line(0);
    line.advance(0);
    (line, move || injector.progress().next().unwrap().1.frames())
}

fn of(direction: Direction) -> Selection {
    Selection { direction, ..Selection::default() }
}

#[test]
fn everything_passes_outside_of_the_window() {
    let (mut line, affected) = line(LineEffect::Drop, Selection::default());
    for (now_ns, passes) in [(9 * MS, true), (10 * MS, false), (20 * MS, true)] {
        line.advance(now_ns);
        assert_eq!(line.send(now_ns, Some(vec![1, 2])) == [[1, 2]], passes, "{now_ns}");
        assert_eq!(line.receive(now_ns, vec![1, 2]) == [1, 2], passes, "{now_ns}");
    }
    assert_eq!(affected(), 2);
}

#[test]
fn a_lost_reply_is_lost_to_its_last_byte_and_the_next_one_is_another() {
    let (mut line, affected) =
        line(LineEffect::Drop, Selection { count: Some(1), ..of(Direction::Received) });
    line.advance(10 * MS);
    assert_eq!(line.send(10 * MS, Some(vec![1, 2])), [[1, 2]]);
    assert!(line.receive(11 * MS, vec![1]).is_empty() && line.receive(12 * MS, vec![2]).is_empty());
    line.send(13 * MS, Some(vec![1, 2]));
    assert_eq!(line.receive(14 * MS, vec![1, 2]), [1, 2]);
    assert_eq!(affected(), 1);
}

#[test]
fn what_is_late_comes_whole_and_in_its_order() {
    let (mut line, _) = line(LineEffect::Delay { by_ns: 5 * MS }, Selection::default());
    line.advance(10 * MS);
    assert!(line.send(10 * MS, Some(vec![1, 2])).is_empty());
    assert!(line.send(14 * MS, None).is_empty());
    assert_eq!(line.send(15 * MS, None), [[1, 2]]);
    assert!(line.receive(16 * MS, vec![7]).is_empty() && line.receive(17 * MS, vec![8]).is_empty());
    // It has been decided that this reply is late, whenever the fault ends.
    line.advance(20 * MS);
    assert_eq!(line.receive(21 * MS, vec![9]), [7]);
    assert_eq!(line.receive(30 * MS, vec![]), [8, 9]);
}

#[test]
fn so_many_bits_are_wrong_of_the_address_or_of_the_rest() {
    for (part, place) in [(Part::Identifier, 0..1), (Part::Payload, 1..4)] {
        let (mut line, _) = line(LineEffect::Corrupt { bits: 1, part }, Selection::default());
        line.advance(10 * MS);
        let request = line.send(10 * MS, Some(vec![0; 4])).concat();
        let reply = [vec![0], vec![0, 0], vec![0]].map(|bytes| line.receive(11 * MS, bytes)).concat();
        for message in [request, reply] {
            let wrong: Vec<usize> = (0..4).filter(|at| message[*at] != 0).collect();
            assert!(wrong.len() == 1 && place.contains(&wrong[0]), "{part:?}: {message:?}");
            assert_eq!(message.iter().map(|byte| byte.count_ones()).sum::<u32>(), 1);
        }
    }
}

#[test]
fn one_address_is_affected_and_the_others_are_not() {
    let (mut line, _) = line(LineEffect::Drop, Selection { node: Some(2), ..Selection::default() });
    line.advance(10 * MS);
    assert!(line.send(10 * MS, Some(vec![2, 3])).is_empty());
    assert_eq!(line.send(11 * MS, Some(vec![3, 3])), [[3, 3]]);
    assert_eq!(line.receive(12 * MS, vec![3, 3]), [3, 3]);
}

#[test]
fn a_line_that_is_gone_takes_and_brings_nothing() {
    let (mut line, _) = line(LineEffect::Gone, Selection::default());
    line.advance(10 * MS);
    assert!(line.is_gone());
    assert!(line.send(10 * MS, Some(vec![1])).is_empty() && line.receive(10 * MS, vec![1]).is_empty());
    line.advance(20 * MS);
    assert!(!line.is_gone());
    assert_eq!((line.send(20 * MS, None).len(), line.receive(20 * MS, vec![1])), (0, vec![1]));
}
