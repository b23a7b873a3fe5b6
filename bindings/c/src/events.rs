//! What happens in a controller, polled or waited for, with its words.

use std::ffi::c_char;
use std::sync::{Mutex, PoisonError};

use takt::telemetry::{Machine, event_words};
use takt::{Event, EventKind, Events};

use crate::border::{self, Growing, put_text};
use crate::errors::takt_result;
use crate::handles::{self, Entry, Unusable, takt_events, takt_handle};
use crate::posix;

/// Room for the words of an event, with the zero at their end.
pub const TAKT_WORDS_LENGTH: usize = 512;

/// The kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_event_kind {
    /// A kind that this header does not know yet. The words tell it.
    TAKT_EVENT_OTHER = 0,
    /// A group went to another phase: `code` is the takt_phase.
    TAKT_EVENT_PHASE = 1,
    /// A stop began: `code` is the takt_stop_category.
    TAKT_EVENT_STOP = 2,
    /// A stream has begun, has run dry, or goes on again: `code` is the takt_stream_state.
    TAKT_EVENT_STREAM = 3,
    /// A motion has reached its targets.
    TAKT_EVENT_MOTION_FINISHED = 4,
    /// The state of a drive has changed: `code` is that of CiA 402, as in takt_axis_state.
    TAKT_EVENT_DRIVE_STATE = 5,
    /// A drive shows another mode of operation: `code` is object 6061.
    TAKT_EVENT_MODE = 6,
    /// A drive has sent an emergency message: `code` is its error code; 0 when all errors are gone.
    TAKT_EVENT_EMERGENCY = 7,
    /// Slots passed unused because the real-time thread was late: `code` is how many.
    TAKT_EVENT_MISSED_SLOTS = 8,
    /// Slots are missed more often, or less often, than before: `code` is as `timing` in takt_state.
    TAKT_EVENT_TIMING = 9,
    /// A request was rejected, and has changed nothing.
    TAKT_EVENT_REJECTED = 10,
}

/// Something that has happened. Set `size` to `sizeof(takt_event)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_event {
    /// `sizeof(takt_event)`
    pub size: u32,
    /// A takt_event_kind.
    pub kind: i32,
    /// The slot in which it was seen.
    pub slot: u64,
    /// The time at which it was seen, on the clock of takt_now_ns().
    pub at_ns: u64,
    /// The group, from 0 on; -1 where it concerns none.
    pub group: i32,
    /// The axis, from 0 on among those of the controller; -1 where it concerns none.
    pub axis: i32,
    /// See its kind.
    pub code: i64,
    /// How many events this handle has missed until now, because it was more than 1024 behind.
    pub missed: u64,
    /// It as a sentence, with the names of axes and buses. UTF-8.
    pub words: [c_char; TAKT_WORDS_LENGTH],
}

// SAFETY: it begins with its size, and has only numbers.
unsafe impl Growing for takt_event {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// Opens a place among the events of a controller, from now on. Each has its own. Of a group, they are those of its controller.
///
/// Any thread, not in a callback; does not block. takt_close_events() closes it.
///
/// Errors: TAKT_ERROR_FULL, TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `events` is null, or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_open_events(handle: takt_handle, events: *mut takt_events) -> takt_result {
    border::carry_out(|| {
        border::check_pointer(events, "events")?;
        let scope = handle.scope()?;
        let source = Mutex::new(scope.controller.events());
        let number = handles::open(Entry::Events(source, scope.controller.clone()))?;
        // SAFETY: the caller promises it.
        unsafe { border::put(events, takt_events { number }, "events") }
    })
}

/// Takes the next event; with `timeout_s` 0 it does not wait. In virtual time the wait runs cycles.
///
/// Any thread, not in a callback; blocks for up to `timeout_s`, and while another thread waits with the same handle.
///
/// Errors: TAKT_ERROR_TIMEOUT when none has come, TAKT_ERROR_ENDED when the controller has ended and no event is left,
/// TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `event` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C-unwind" fn takt_next_event(
    events: takt_events,
    timeout_s: f64,
    event: *mut takt_event,
) -> takt_result {
    let result = border::carry_out(|| {
        let used = handles::using(events.number)?;
        let Entry::Events(reader, controller) = &*used else { return Err(Unusable::Wrong.into()) };
        let timeout = border::duration(timeout_s, "timeout_s")?;
        border::check_pointer(event, "event")?;
        let mut reader = reader.lock().unwrap_or_else(PoisonError::into_inner);
        let taken = reader.wait(timeout)?;
        let shown = takt_event::of(&taken, &reader, controller.machine());
        // SAFETY: the caller promises it.
        unsafe { border::put_growing(event, &shown, "event") }
    });
    posix::cancellation_point();
    result
}

/// Closes a place among the events.
///
/// Any thread, not in a callback; blocks while another thread waits with it.
///
/// Errors: TAKT_ERROR_HANDLE.
#[unsafe(no_mangle)]
pub extern "C" fn takt_close_events(events: takt_events) -> takt_result {
    border::carry_out(|| handles::close(events.number, |entry| matches!(entry, Entry::Events(..)), |_| ()))
}

impl takt_event {
    fn of(event: &Event, events: &Events, machine: &Machine) -> Self {
        let (kind, axis, code) = meaning(&event.kind);
        Self {
            size: size_of::<Self>() as u32,
            kind: kind as i32,
            slot: event.slot,
            at_ns: event.at_ns,
            group: event.group.map_or(-1, i32::from),
            axis: axis.map_or(-1, i32::from),
            code,
            missed: events.missed(),
            words: put_text(&event_words(event, machine).to_string()),
        }
    }
}

/// The kind, the axis and the code.
fn meaning(kind: &EventKind) -> (takt_event_kind, Option<u8>, i64) {
    use takt_event_kind as known;
    match kind {
        EventKind::PhaseChanged { to, .. } => (known::TAKT_EVENT_PHASE, None, *to as i64),
        EventKind::Stop(stop) => (known::TAKT_EVENT_STOP, stop.axis(), stop.category as i64),
        EventKind::Stream { state } => (known::TAKT_EVENT_STREAM, None, *state as i64),
        EventKind::MotionFinished { .. } => (known::TAKT_EVENT_MOTION_FINISHED, None, 0),
        EventKind::DriveState { axis, state, .. } => {
            (known::TAKT_EVENT_DRIVE_STATE, Some(*axis), *state as i64)
        }
        EventKind::Mode { axis, mode } => (known::TAKT_EVENT_MODE, Some(*axis), *mode as i64),
        EventKind::Emergency { axis, code, .. } => {
            (known::TAKT_EVENT_EMERGENCY, Some(*axis), i64::from(*code))
        }
        EventKind::MissedSlots { count } => {
            (known::TAKT_EVENT_MISSED_SLOTS, None, i64::try_from(*count).unwrap_or(i64::MAX))
        }
        EventKind::Timing { level } => (known::TAKT_EVENT_TIMING, None, *level as i64),
        EventKind::Rejected(refused) => (known::TAKT_EVENT_REJECTED, refused.axis, 0),
    }
}
