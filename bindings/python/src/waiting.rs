//! Waiting without the interpreter's lock, so that other threads of the program go on, and with an eye on signals, so that Ctrl-C works.

use std::time::Duration;

use pyo3::prelude::*;
use takt::rt::RequestTarget;
use takt::{AnyHandle, CommandError, StopCategory, WaitError};

use crate::error::raise_timeout;
use crate::link::{Link, duration};

/// The longest time from a signal to its Python handler.
const SLICE: Duration = Duration::from_millis(50);

/// The longest time of a wait. Calls that command before they wait ask first, so that they change nothing when it is none.
pub fn longest(py: Python<'_>, timeout: Option<f64>) -> PyResult<Option<Duration>> {
    timeout.map(|seconds| duration(py, "timeout", seconds)).transpose()
}

/// What becomes of the axes when a signal's handler raises in a wait, as that of Ctrl-C does.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Interrupted {
    /// They stop (category 2).
    Stop,
    /// They go on: whoever waits has only observed them.
    GoOn,
}

/// Tries until `attempt` gives something, which waits for no longer than it is told to. `words` say what has not happened in `timeout`
/// seconds of the arm's time.
///
/// When a signal's handler raises, as that of Ctrl-C does, a stop of category 2 is asked for, and the exception is passed on.
pub fn until<T: Send>(
    py: Python<'_>,
    link: &Link,
    timeout: Option<f64>,
    words: &str,
    attempt: impl FnMut(&AnyHandle, Duration) -> Option<T> + Send,
) -> PyResult<T> {
    until_interrupted(py, link, timeout, words, Interrupted::Stop, attempt)
}

/// As [`until`], for a wait whose interruption has this effect.
pub fn until_interrupted<T: Send>(
    py: Python<'_>,
    link: &Link,
    timeout: Option<f64>,
    words: &str,
    interrupted: Interrupted,
    mut attempt: impl FnMut(&AnyHandle, Duration) -> Option<T> + Send,
) -> PyResult<T> {
    let controller = link.controller(py)?;
    let timeout = longest(py, timeout)?;
    let begun_ns = controller.now_ns();
    loop {
        let passed = Duration::from_nanos(controller.now_ns().saturating_sub(begun_ns));
        let left = timeout.map(|timeout| timeout.saturating_sub(passed));
        let slice = left.map_or(SLICE, |left| left.min(SLICE));
        if let Some(found) = py.detach(|| attempt(controller, slice)) {
            return Ok(found);
        }
        match interrupted {
            Interrupted::Stop => look_for_signals(py, controller)?,
            Interrupted::GoOn => py.check_signals()?,
        }
        if left.is_some_and(|left| left <= slice) {
            return Err(raise_timeout(py, words));
        }
    }
}

/// Runs the handlers of signals that have come. If one raises, the axes stop.
pub fn look_for_signals(py: Python<'_>, controller: &AnyHandle) -> PyResult<()> {
    py.check_signals().inspect_err(|_| {
        // It is refused only after the end.
        let _ = controller.stop(StopCategory::Two);
    })
}

/// Asks for a stop, and waits until the axes hold or are off. Why there is no stop is handed on.
pub fn stop_and_wait(
    py: Python<'_>,
    link: &Link,
    target: RequestTarget,
    category: StopCategory,
    timeout: Option<f64>,
) -> PyResult<Result<(), CommandError>> {
    let controller = link.controller(py)?;
    let before = controller.of(target).newest_stop();
    if let Err(error) = controller.of(target).stop(category) {
        return Ok(Err(error));
    }
    until(py, link, timeout, "the axes have not come to rest in time", |controller, at_most| {
        let still = controller.of(target).wait_until_still(before, at_most);
        (still != Err(WaitError::NotInTime)).then_some(())
    })?;
    Ok(Ok(()))
}
