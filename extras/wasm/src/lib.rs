//! takt for a page without a machine: the exports of the WebAssembly module. `takt.mjs` is its other half.
//!
//! Text and bytes are handed over in memory of [`takt_memory`], and are taken by the call that they are given to. Every call leaves an
//! answer ([`takt_answer`], [`takt_answer_length`]), and returns 0, or 1 if the answer says what is wrong. There is one arm at a time.

use std::cell::{Cell, RefCell};

use takt_panel::browser::{SimulatedArm, replay};

thread_local! {
    static ANSWER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static ARM: RefCell<Option<SimulatedArm>> = const { RefCell::new(None) };
    static WATCHES_PANICS: Cell<bool> = const { Cell::new(false) };
}

/// Memory for what a call is given, of exactly this length.
#[unsafe(no_mangle)]
pub extern "C" fn takt_memory(length: usize) -> *mut u8 {
    Box::leak(vec![0; length].into_boxed_slice()).as_mut_ptr()
}

/// Where the newest answer is. It stays until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn takt_answer() -> *const u8 {
    ANSWER.with_borrow(Vec::as_ptr)
}

/// How long the newest answer is.
#[unsafe(no_mangle)]
pub extern "C" fn takt_answer_length() -> usize {
    ANSWER.with_borrow(Vec::len)
}

/// Takes what was given.
///
/// # Safety
/// It is memory of [`takt_memory`] with this length, which nobody has taken.
unsafe fn taken(given: *mut u8, length: usize) -> Vec<u8> {
    // SAFETY: the memory was a boxed slice of this length, as the caller promises.
    unsafe { Vec::from_raw_parts(given, length, length) }
}

/// As [`taken`].
///
/// # Safety
/// As [`taken`].
unsafe fn taken_text(given: *mut u8, length: usize) -> String {
    // SAFETY: as the caller promises.
    let bytes = unsafe { taken(given, length) };
    String::from_utf8(bytes).unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned())
}

fn answer(result: Result<Vec<u8>, String>) -> u32 {
    let (bytes, is_error) = match result {
        Ok(bytes) => (bytes, 0),
        Err(words) => (words.into_bytes(), 1),
    };
    ANSWER.set(bytes);
    is_error
}

/// A panic ends the module: its message is the answer.
fn watch_panics() {
    if !WATCHES_PANICS.replace(true) {
        std::panic::set_hook(Box::new(|panic| ANSWER.set(panic.to_string().into_bytes())));
    }
}

fn with_arm(carry_out: impl FnOnce(&mut SimulatedArm) -> Result<Vec<u8>, String>) -> u32 {
    let result = ARM.with_borrow_mut(|arm| match arm {
        Some(arm) => carry_out(arm),
        None => Err("there is no arm; start one first".to_owned()),
    });
    answer(result)
}

/// Replays a recording, with a JSON list of changed values: see [`replay`].
///
/// # Safety
/// All three are memory of [`takt_memory`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_replay(
    name: *mut u8,
    name_length: usize,
    recording: *mut u8,
    recording_length: usize,
    settings: *mut u8,
    settings_length: usize,
) -> u32 {
    watch_panics();
    // SAFETY: as the caller promises.
    let (name, recording, settings) = unsafe {
        let name = taken_text(name, name_length);
        (name, taken(recording, recording_length), taken_text(settings, settings_length))
    };
    let settings = serde_json::from_str::<Vec<String>>(&settings).map_err(|error| error.to_string());
    answer(settings.and_then(|settings| replay(&name, recording, &settings)).map(String::into_bytes))
}

/// Starts an arm in place of the one before: see [`SimulatedArm::start`].
///
/// # Safety
/// It is memory of [`takt_memory`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_start(files: *mut u8, length: usize) -> u32 {
    watch_panics();
    // SAFETY: as the caller promises.
    let files = unsafe { taken_text(files, length) };
    ARM.set(None);
    answer(SimulatedArm::start(&files).map(|arm| {
        ARM.set(Some(arm));
        vec![]
    }))
}

/// See [`SimulatedArm::machine`].
#[unsafe(no_mangle)]
pub extern "C" fn takt_machine() -> u32 {
    with_arm(|arm| Ok(arm.machine().into_bytes()))
}

/// See [`SimulatedArm::page`].
#[unsafe(no_mangle)]
pub extern "C" fn takt_page() -> u32 {
    with_arm(|arm| Ok(arm.page().into_bytes()))
}

/// See [`SimulatedArm::advance`].
#[unsafe(no_mangle)]
pub extern "C" fn takt_advance(by_ms: f64) -> u32 {
    with_arm(|arm| Ok(arm.advance(by_ms).into_bytes()))
}

/// See [`SimulatedArm::command`].
///
/// # Safety
/// It is memory of [`takt_memory`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_command(command: *mut u8, length: usize) -> u32 {
    // SAFETY: as the caller promises.
    let command = unsafe { taken_text(command, length) };
    with_arm(|arm| arm.command(&command).map(|()| vec![]))
}

/// See [`SimulatedArm::stop`].
///
/// # Safety
/// It is memory of [`takt_memory`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_stop(stop: *mut u8, length: usize) -> u32 {
    // SAFETY: as the caller promises.
    let stop = unsafe { taken_text(stop, length) };
    with_arm(|arm| arm.stop(&stop).map(|()| vec![]))
}

/// See [`SimulatedArm::break_something`].
///
/// # Safety
/// It is memory of [`takt_memory`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_break(breakage: *mut u8, length: usize) -> u32 {
    // SAFETY: as the caller promises.
    let breakage = unsafe { taken_text(breakage, length) };
    with_arm(|arm| arm.break_something(&breakage).map(|()| vec![]))
}

/// See [`SimulatedArm::black_boxes`].
#[unsafe(no_mangle)]
pub extern "C" fn takt_black_boxes() -> u32 {
    with_arm(|arm| Ok(arm.black_boxes().into_bytes()))
}

/// See [`SimulatedArm::black_box`].
#[unsafe(no_mangle)]
pub extern "C" fn takt_black_box(place: usize) -> u32 {
    with_arm(|arm| arm.black_box(place))
}

/// See [`SimulatedArm::report`].
#[unsafe(no_mangle)]
pub extern "C" fn takt_report(place: usize) -> u32 {
    with_arm(|arm| arm.report(place).map(String::into_bytes))
}
