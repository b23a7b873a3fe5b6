//! The wrapper around a port: each effect by itself.

use std::sync::Arc;

use proptest::prelude::*;
use takt::faults::{
    DelayPlace, Direction, Effect, FaultProgress, FaultyPort, ForeignFrames, FrameEffect, Injectable,
    InterfaceEffect, Part, ScenarioFault, Selection, Trigger, TriggerTimes, Window,
};
use takt_rt::{BusHealth, BusPort, BusState, Frame, Id, ReceiveBatch, Received};

/// A port that keeps the sent frames, and receives the frames that the test gives it.
#[derive(Default)]
struct RecordingPort {
    sent: Vec<(u64, Frame)>,
    waiting: Vec<Received>,
    room: Option<usize>,
}

impl BusPort for RecordingPort {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        let taken = frames.len().min(self.room.unwrap_or(usize::MAX));
        self.sent.extend(frames.iter().take(taken).map(|frame| (now_ns, *frame)));
        taken
    }

    fn receive(&mut self, _now_ns: u64, batch: &mut ReceiveBatch) {
        let count = self.waiting.len().min(batch.remaining_capacity());
        batch.extend(self.waiting.drain(..count));
    }

    fn unconfirmed(&mut self, _now_ns: u64) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        BusHealth::default()
    }
}

impl Injectable for RecordingPort {}

fn frame(id: u32, byte: u8) -> Frame {
    Frame::of(Id::base(id).unwrap(), [byte; 8])
}

fn numbered(count: u8) -> Vec<Frame> {
    (0..count).map(|number| frame(0x200 + u32::from(number), number)).collect()
}

fn wrapped(
    effect: Effect,
    selection: Selection,
    lasts_ns: Option<u64>,
) -> (FaultyPort<RecordingPort>, Arc<FaultProgress>) {
    let window = Window { trigger: Trigger::Start, after_ns: 0, lasts_ns };
    let fault =
        ScenarioFault { kind: "", location: String::new(), line: 1, bus: 0, window, selection, effect };
    let progress = Arc::new(FaultProgress::default());
    (
        FaultyPort::new(
            RecordingPort::default(),
            &fault,
            Arc::new(TriggerTimes::default()),
            Arc::clone(&progress),
        ),
        progress,
    )
}

fn frames(effect: FrameEffect) -> FaultyPort<RecordingPort> {
    wrapped(Effect::Frames(effect), Selection::default(), None).0
}

fn received(port: &mut FaultyPort<RecordingPort>, now_ns: u64) -> Vec<Received> {
    let mut batch = ReceiveBatch::new();
    port.receive(now_ns, &mut batch);
    batch.to_vec()
}

fn sent(port: &mut FaultyPort<RecordingPort>) -> Vec<Frame> {
    port.inner_mut().sent.iter().map(|(_, frame)| *frame).collect()
}

fn receives(port: &mut FaultyPort<RecordingPort>, frames: &[Frame], at_ns: u64) {
    port.inner_mut().waiting.extend(frames.iter().map(|frame| Received { frame: *frame, at_ns }));
}

#[test]
fn a_dropped_frame_is_lost_and_counts_as_sent() {
    let mut port = frames(FrameEffect::Drop);
    assert_eq!(port.send(0, &numbered(3)), 3);
    receives(&mut port, &numbered(2), 0);
    assert_eq!((sent(&mut port), received(&mut port, 1)), (vec![], vec![]));
    assert_eq!((port.unconfirmed(1), port.health().tx_frames), (0, 3));
}

#[test]
fn only_selected_frames_are_affected_and_the_others_keep_their_order() {
    let selection = Selection { ids: 0x201..=0x202, direction: Direction::Sent, ..Selection::default() };
    let (mut port, progress) = wrapped(Effect::Frames(FrameEffect::Drop), selection, None);
    assert_eq!(port.send(0, &numbered(5)), 5);
    let left: Vec<u32> = sent(&mut port).iter().map(|frame| frame.id().value()).collect();
    assert_eq!((left, progress.frames()), (vec![0x200, 0x203, 0x204], 2));
    receives(&mut port, &numbered(5), 0);
    assert_eq!(received(&mut port, 1).len(), 5);
}

#[test]
fn a_delayed_frame_is_sent_at_its_time_and_is_unconfirmed_until_then() {
    let selection = Selection { ids: 0x201..=0x201, ..Selection::default() };
    let (mut port, _) = wrapped(
        Effect::Frames(FrameEffect::Delay { by_ns: 300, place: DelayPlace::Machine }),
        selection,
        None,
    );
    assert_eq!(port.send(1000, &numbered(3)), 3);
    assert_eq!((port.unconfirmed(1299), port.unconfirmed(1500)), (1, 0));
    let times: Vec<(u64, u32)> =
        port.inner_mut().sent.iter().map(|(at_ns, frame)| (*at_ns, frame.id().value())).collect();
    assert_eq!(times, [(1000, 0x200), (1000, 0x202), (1300, 0x201)]);
}

#[test]
fn a_frame_delayed_in_the_machine_keeps_its_arrival_time() {
    let mut port = frames(FrameEffect::Delay { by_ns: 300, place: DelayPlace::Machine });
    receives(&mut port, &[frame(0x181, 1)], 1000);
    assert_eq!(received(&mut port, 1010), []);
    assert_eq!(received(&mut port, 1299), []);
    assert_eq!(received(&mut port, 1300), [Received { frame: frame(0x181, 1), at_ns: 1000 }]);
    receives(&mut port, &[frame(0x181, 2)], 2000);
    assert_eq!(received(&mut port, 2400), [Received { frame: frame(0x181, 2), at_ns: 2000 }]);
}

#[test]
fn a_frame_delayed_on_the_bus_has_a_later_arrival_time() {
    let mut port = frames(FrameEffect::Delay { by_ns: 300, place: DelayPlace::Bus });
    receives(&mut port, &[frame(0x181, 1)], 1000);
    assert_eq!(received(&mut port, 1299), []);
    assert_eq!(received(&mut port, 1300), [Received { frame: frame(0x181, 1), at_ns: 1300 }]);
}

#[test]
fn duplicates_follow_their_original() {
    let mut port = frames(FrameEffect::Duplicate { copies: 2 });
    assert_eq!(port.send(0, &numbered(2)), 2);
    let ids: Vec<u32> = sent(&mut port).iter().map(|frame| frame.id().value()).collect();
    assert_eq!(ids, [0x200, 0x200, 0x200, 0x201, 0x201, 0x201]);
    receives(&mut port, &numbered(1), 5);
    assert_eq!(received(&mut port, 5).len(), 3);
}

#[test]
fn the_number_of_refused_frames_is_that_of_the_caller() {
    let mut port = frames(FrameEffect::Duplicate { copies: 2 });
    port.inner_mut().room = Some(4);
    assert_eq!(port.send(0, &numbered(4)), 1);
}

#[test]
fn more_copies_than_a_batch_holds_are_received_in_the_next_one() {
    let mut port = frames(FrameEffect::Duplicate { copies: 8 });
    receives(&mut port, &numbered(60), 5);
    let counts: Vec<usize> = (0..10).map(|now_ns| received(&mut port, now_ns).len()).collect();
    assert_eq!(counts, [64, 64, 64, 64, 64, 64, 64, 64, 28, 0]);
}

#[test]
fn a_full_queue_refuses_selected_frames_and_all_after_them() {
    let selection = Selection { ids: 0x202..=0x202, ..Selection::default() };
    let (mut port, _) = wrapped(Effect::Frames(FrameEffect::FullQueue), selection, None);
    assert_eq!(port.send(0, &numbered(5)), 2);
    assert_eq!((sent(&mut port).len(), port.health().tx_overruns), (2, 3));
}

#[test]
fn frames_with_a_lost_echo_stay_unconfirmed_while_the_fault_is_active() {
    let effect = Effect::Frames(FrameEffect::EchoLoss);
    let (mut port, _) = wrapped(effect, Selection::default(), Some(100));
    assert_eq!(port.send(0, &numbered(3)), 3);
    receives(&mut port, &numbered(5), 10);
    assert_eq!(received(&mut port, 20).len(), 5);
    assert_eq!((sent(&mut port).len(), port.unconfirmed(50), port.unconfirmed(100)), (3, 3, 0));
}

#[test]
fn a_disconnected_interface_neither_sends_nor_receives_and_drops_frames_meanwhile() {
    for (effect, state) in
        [(InterfaceEffect::BusOff, BusState::BusOff), (InterfaceEffect::Down, BusState::Down)]
    {
        let (mut port, _) = wrapped(Effect::Interface(effect), Selection::default(), Some(100));
        assert_eq!(port.send(0, &numbered(3)), 0);
        receives(&mut port, &numbered(3), 0);
        assert_eq!((received(&mut port, 50), port.health().state), (vec![], state));
        assert_eq!((received(&mut port, 100), port.health().state), (vec![], BusState::ErrorActive));
        assert_eq!(port.send(101, &numbered(3)), 3);
        assert_eq!((sent(&mut port).len(), port.health().tx_overruns), (3, 0));
    }
}

#[test]
fn corruption_inverts_bits_of_the_selected_part() {
    let mut port = frames(FrameEffect::Corrupt { bits: 1, part: Part::Payload });
    assert_eq!(port.send(0, &numbered(4)), 4);
    for (broken, whole) in sent(&mut port).iter().zip(numbered(4)) {
        assert_eq!((broken.first_word() ^ whole.first_word()).count_ones(), 1);
        assert_eq!(broken.id(), whole.id());
    }
}

#[test]
fn a_foreign_station_sends_periodically_and_is_received_here_too() {
    let says = frame(0x123, 9);
    let effect = Effect::Foreign(ForeignFrames::Frame { frame: says, period_ns: Some(100) });
    let (mut port, progress) = wrapped(effect, Selection::default(), Some(350));
    received(&mut port, 0);
    let received_ns: Vec<u64> = received(&mut port, 320).iter().map(|received| received.at_ns).collect();
    assert_eq!(received_ns, [100, 200, 300]);
    assert_eq!(received(&mut port, 1000), []);
    let said: Vec<u64> = port.inner_mut().sent.iter().map(|(at_ns, _)| *at_ns).collect();
    assert_eq!((said, progress.frames()), (vec![0, 100, 200, 300], 4));
}

#[test]
fn a_foreign_station_does_not_catch_up_after_a_long_pause() {
    let effect = Effect::Foreign(ForeignFrames::Frame { frame: frame(1, 0), period_ns: Some(20) });
    let (mut port, _) = wrapped(effect, Selection::default(), None);
    port.send(0, &[]);
    port.send(1_000_000_000, &[]);
    assert!(port.inner_mut().sent.len() < 100, "{}", port.inner_mut().sent.len());
}

#[test]
fn another_master_repeats_the_set_points_from_before_it_began() {
    let effect = Effect::Foreign(ForeignFrames::SetPoints { id: Id::canopen(0x200, 1), period_ns: 100 });
    let window = Window { trigger: Trigger::Start, after_ns: 1000, lasts_ns: None };
    let fault = ScenarioFault {
        kind: "",
        location: String::new(),
        line: 1,
        bus: 0,
        window,
        selection: Selection::default(),
        effect,
    };
    let mut port = FaultyPort::new(RecordingPort::default(), &fault, Arc::default(), Arc::default());
    port.send(0, &[frame(0x201, 1), frame(0x202, 2)]);
    port.send(900, &[frame(0x201, 3)]);
    port.send(1000, &[frame(0x201, 4)]);
    port.send(1100, &[frame(0x201, 5)]);
    let said: Vec<u8> = sent(&mut port).iter().map(|frame| frame.payload()[0]).collect();
    assert_eq!(said, [1, 2, 3, 3, 4, 3, 5]);
}

fn any_effect() -> impl Strategy<Value = FrameEffect> {
    prop_oneof![
        Just(FrameEffect::Drop),
        (0u64..5_000).prop_map(|by_ns| FrameEffect::Delay { by_ns, place: DelayPlace::Machine }),
        (1u8..=8).prop_map(|copies| FrameEffect::Duplicate { copies }),
        (1u8..=64).prop_map(|bits| FrameEffect::Corrupt { bits, part: Part::Payload }),
        (1u8..=11).prop_map(|bits| FrameEffect::Corrupt { bits, part: Part::Identifier }),
        Just(FrameEffect::Reorder),
        Just(FrameEffect::EchoLoss),
        Just(FrameEffect::FullQueue),
    ]
}

proptest! {
    /// Reordering neither loses nor adds frames.
    #[test]
    fn reordering_keeps_every_frame(seed: u64, count in 1u8..60) {
        let selection = Selection { seed, ids: 0x200..=0x210, ..Selection::default() };
        let (mut port, _) = wrapped(Effect::Frames(FrameEffect::Reorder), selection, None);
        prop_assert_eq!(port.send(0, &numbered(count)), usize::from(count));
        receives(&mut port, &numbered(count), 0);
        let heard: Vec<Frame> = received(&mut port, 1).iter().map(|received| received.frame).collect();
        for mut passed in [sent(&mut port), heard] {
            // Frames that are not selected keep their positions.
            for (at, frame) in passed.iter().enumerate().skip(0x11) {
                prop_assert_eq!(frame.id().value(), 0x200 + at as u32);
            }
            passed.sort_by_key(|frame| frame.id().value());
            prop_assert_eq!(passed, numbered(count));
        }
    }

    /// Two nested wrappers: no call panics, every promise of a port is kept, and memory stays bounded.
    #[test]
    fn any_two_effects_compose(
        effects in (any_effect(), any_effect()),
        probability in 0.01f64..=1.0,
        calls in proptest::collection::vec((0u64..2_000, 0u8..60, 0u8..60), 1..40),
    ) {
        let selection = || Selection { probability, ..Selection::default() };
        let fault = |effect| ScenarioFault {
            kind: "", location: String::new(), line: 1, bus: 0,
            window: Window { trigger: Trigger::Start, after_ns: 500, lasts_ns: Some(20_000) },
            selection: selection(), effect: Effect::Frames(effect),
        };
        let inner = FaultyPort::new(RecordingPort::default(), &fault(effects.0), Arc::default(), Arc::default());
        let mut port = FaultyPort::new(inner, &fault(effects.1), Arc::default(), Arc::default());
        let mut now_ns = 0;
        for (pause_ns, sends, hears) in calls {
            now_ns += pause_ns;
            prop_assert!(port.send(now_ns, &numbered(sends)) <= usize::from(sends));
            let waiting = numbered(hears).into_iter().map(|frame| Received { frame, at_ns: now_ns });
            port.inner_mut().inner_mut().waiting.extend(waiting);
            let mut batch = ReceiveBatch::new();
            port.receive(now_ns, &mut batch);
            prop_assert!(batch.iter().all(|received| received.at_ns <= now_ns));
            port.unconfirmed(now_ns);
        }
        // Long after the end no frame is delayed any more.
        port.unconfirmed(now_ns + 1_000_000);
        prop_assert_eq!(port.unconfirmed(now_ns + 1_000_001), 0);
    }
}
