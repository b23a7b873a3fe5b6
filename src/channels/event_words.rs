//! The layout of an event in 64-bit words.

use takt_rt::{
    Event, EventKind, OperationMode, Phase, RejectReason, RequestError, RequestId, RequestKind, StreamState,
    TimingLevel,
};

use super::latest::Words;
use super::stop_words::{phase_of, put_stop, take_stop};
use super::words::{drive_state_of, put_rejection, take_rejection};

/// The largest number of words of an event: when it was seen, its kind, and a stop.
pub const EVENT_WORDS: usize = 3 + 4;

/// The lowest byte of the third word.
const PHASE_CHANGED: u8 = 1;
const STOP: u8 = 2;
const MOTION_FINISHED: u8 = 3;
const DRIVE_STATE: u8 = 4;
const EMERGENCY: u8 = 5;
const MISSED_SLOTS: u8 = 6;
const TIMING: u8 = 7;
const REJECTED: u8 = 8;
const STREAM: u8 = 9;
const MODE: u8 = 10;

pub fn put_event(event: &Event, words: &mut Words<'_>) {
    words.put(event.slot);
    words.put(event.at_ns);
    let mut put_kind = |kind, [a, b, c, d, e]: [u8; 5]| {
        let group = event.group.map_or(0, |group| group.saturating_add(1));
        words.put(u64::from_le_bytes([kind, a, b, c, d, e, group, 0]));
    };
    match &event.kind {
        EventKind::PhaseChanged { from, to } => put_kind(PHASE_CHANGED, [*from as u8, *to as u8, 0, 0, 0]),
        EventKind::Stop(stop) => {
            put_kind(STOP, [0; 5]);
            put_stop(stop, words);
        }
        EventKind::MotionFinished { request } => {
            put_kind(MOTION_FINISHED, [0; 5]);
            words.put(request.0);
        }
        EventKind::DriveState { axis, state, statusword } => {
            let [low, high] = statusword.to_le_bytes();
            put_kind(DRIVE_STATE, [*axis, *state as u8, low, high, 0]);
        }
        EventKind::Mode { axis, mode } => put_kind(MODE, [*axis, *mode as u8, 0, 0, 0]),
        EventKind::Emergency { axis, code, register, manufacturer: [a, b, c, d, e] } => {
            let [low, high] = code.to_le_bytes();
            put_kind(EMERGENCY, [*axis, low, high, *register, 0]);
            words.put(u64::from_le_bytes([*a, *b, *c, *d, *e, 0, 0, 0]));
        }
        EventKind::MissedSlots { count } => {
            put_kind(MISSED_SLOTS, [0; 5]);
            words.put(*count);
        }
        EventKind::Stream { state } => put_kind(STREAM, [*state as u8, 0, 0, 0, 0]),
        EventKind::Timing { level } => put_kind(TIMING, [*level as u8, 0, 0, 0, 0]),
        EventKind::Rejected(rejected) => {
            put_kind(REJECTED, [0; 5]);
            put_rejection(rejected, words);
        }
    }
}

pub fn take_event(words: &mut Words<'_>) -> Event {
    let (slot, at_ns) = (words.take(), words.take());
    let [kind, a, b, c, d, _, group, _] = words.take().to_le_bytes();
    let kind = match kind {
        PHASE_CHANGED => EventKind::PhaseChanged { from: phase_of(a), to: phase_of(b) },
        STOP => EventKind::Stop(take_stop(words)),
        MOTION_FINISHED => EventKind::MotionFinished { request: RequestId(words.take()) },
        DRIVE_STATE => EventKind::DriveState {
            axis: a,
            state: drive_state_of(b),
            statusword: u16::from_le_bytes([c, d]),
        },
        EMERGENCY => {
            let [m0, m1, m2, m3, m4, ..] = words.take().to_le_bytes();
            let manufacturer = [m0, m1, m2, m3, m4];
            EventKind::Emergency { axis: a, code: u16::from_le_bytes([b, c]), register: d, manufacturer }
        }
        MODE => EventKind::Mode { axis: a, mode: OperationMode::from_number(b as i8).unwrap_or(NO_MODE) },
        MISSED_SLOTS => EventKind::MissedSlots { count: words.take() },
        STREAM => {
            EventKind::Stream { state: StreamState::ALL.get(usize::from(a)).copied().unwrap_or_default() }
        }
        TIMING => {
            EventKind::Timing { level: TimingLevel::ALL.get(usize::from(a)).copied().unwrap_or_default() }
        }
        _ => EventKind::Rejected(take_rejection(words).unwrap_or(NO_REJECTION)),
    };
    Event { slot, at_ns, group: group.checked_sub(1), kind }
}

/// In place of a mode that was overwritten while it was read.
const NO_MODE: OperationMode = OperationMode::CyclicSynchronousPosition;

/// In place of a rejection that was overwritten while it was read.
const NO_REJECTION: RequestError = RequestError {
    request: RequestKind::Sync,
    reason: RejectReason::Phase,
    axis: None,
    phase: Phase::Passive,
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channels::latest::latest;
    use crate::channels::words::tests::{rejections, stop_reasons};
    use proptest::prelude::*;
    use takt_rt::{DriveState, MAX_GROUPS};

    fn kinds() -> impl Strategy<Value = EventKind> {
        let phases = || prop::sample::select(&Phase::ALL[..]);
        let states = prop::sample::select(&DriveState::ALL[..]);
        let streams = prop::sample::select(&StreamState::ALL[..]);
        let modes = prop::sample::select(&OperationMode::ALL[..]);
        let levels = prop::sample::select(&TimingLevel::ALL[..]);
        prop_oneof![
            (phases(), phases()).prop_map(|(from, to)| EventKind::PhaseChanged { from, to }),
            stop_reasons().prop_map(EventKind::Stop),
            any::<u64>().prop_map(|id| EventKind::MotionFinished { request: RequestId(id) }),
            (any::<u8>(), states, any::<u16>()).prop_map(|(axis, state, statusword)| EventKind::DriveState {
                axis,
                state,
                statusword
            }),
            any::<(u8, u16, u8, [u8; 5])>().prop_map(|(axis, code, register, manufacturer)| {
                EventKind::Emergency { axis, code, register, manufacturer }
            }),
            any::<u64>().prop_map(|count| EventKind::MissedSlots { count }),
            streams.prop_map(|state| EventKind::Stream { state }),
            levels.prop_map(|level| EventKind::Timing { level }),
            (any::<u8>(), modes).prop_map(|(axis, mode)| EventKind::Mode { axis, mode }),
            rejections().prop_map(EventKind::Rejected),
        ]
    }

    proptest! {
        #[test]
        fn an_event_comes_out_as_it_went_in(
            kind in kinds(),
            slot in any::<u64>(),
            at_ns in any::<u64>(),
            group in prop::option::of(0..MAX_GROUPS as u8),
        ) {
            let event = Event { slot, at_ns, group, kind };
            let (mut writer, reader) = latest(EVENT_WORDS);
            writer.write(|words| put_event(&event, words));
            prop_assert_eq!(reader.read(1, take_event), Some(event));
        }
    }
}
