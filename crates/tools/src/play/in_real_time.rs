//! A performance in real time, on the buses of the configuration.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use takt_rt::{CycleRecord, Nanoseconds, RequestId, RequestTarget, Snapshot, StopCategory, StreamPoint};

use super::groups::PlayedGroup;
use super::performance::{APPROACH_SCALE, MakeTrajectory, PlayError, Stage};
use super::set_points::{AxisMaxima, SetPointLog};
use takt::command::MoveOptions;
use takt::controller::session::Session;
use takt::controller::{Controller, Handle, StartFailure};

/// The time from one look at the state to the next.
const LOOK: Duration = Duration::from_millis(1);
/// The logger brings the last set-points within this time.
const LAST_RECORDS: Duration = Duration::from_secs(1);

/// A log of set-points that the logger's thread fills.
#[derive(Clone)]
pub struct SharedSetPointLog(Arc<Mutex<Option<SetPointLog>>>);

impl SharedSetPointLog {
    /// Shares a log.
    pub fn new(log: SetPointLog) -> Self {
        Self(Arc::new(Mutex::new(Some(log))))
    }

    /// Takes the record of the next cycle.
    pub fn add(&self, record: &CycleRecord) {
        if let Some(log) = self.lock().as_mut() {
            log.add(record);
        }
    }

    /// The largest rates, and the first error of writing.
    pub fn finish(&self) -> (Vec<AxisMaxima>, Option<io::Error>) {
        self.lock().take().map_or_else(|| (vec![], None), SetPointLog::finish)
    }

    fn is_over(&self) -> bool {
        self.lock().as_ref().is_none_or(SetPointLog::is_over)
    }

    fn lock(&self) -> MutexGuard<'_, Option<SetPointLog>> {
        // A panic of another holder of the lock leaves the log consistent.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An arm in real time.
pub struct RealStage<'a> {
    controller: Controller,
    set_points: SharedSetPointLog,
    interrupted: &'a AtomicBool,
    was_interrupted: bool,
}

impl<'a> RealStage<'a> {
    /// A controller that is enabled, and whose records go into `set_points`. It ends in control once `interrupted` is set.
    pub const fn new(
        controller: Controller,
        set_points: SharedSetPointLog,
        interrupted: &'a AtomicBool,
    ) -> Self {
        Self { controller, set_points, interrupted, was_interrupted: false }
    }

    fn group(&self, group: &PlayedGroup) -> Handle {
        self.controller.of(RequestTarget::Group(group.number))
    }

    /// Returns `true` if it was interrupted.
    pub const fn was_interrupted(&self) -> bool {
        self.was_interrupted
    }

    /// Brings the arm to rest, disables and shuts down the drives.
    ///
    /// # Errors
    /// [`StartFailure::Died`] if the session thread has panicked.
    pub fn finish(self) -> Result<Session, StartFailure> {
        let begun = Instant::now();
        while !self.was_interrupted && !self.set_points.is_over() && begun.elapsed() < LAST_RECORDS {
            thread::sleep(LOOK);
        }
        self.controller.finish()
    }
}

impl Stage for RealStage<'_> {
    fn snapshot(&mut self) -> Snapshot {
        self.controller.state()
    }

    fn pass(&mut self) -> bool {
        self.was_interrupted |= self.interrupted.swap(false, Ordering::Relaxed);
        thread::sleep(LOOK);
        !self.was_interrupted && !self.controller.has_ended()
    }

    fn move_to(&mut self, group: &PlayedGroup, target: &[f64]) -> Result<RequestId, PlayError> {
        let options = MoveOptions {
            velocity_scale: APPROACH_SCALE,
            acceleration_scale: APPROACH_SCALE,
            ..MoveOptions::default()
        };
        let motion = self.group(group).move_with(&group.pick(target), options);
        motion.map(|motion| motion.request()).map_err(|error| PlayError::Command(error.to_string()))
    }

    fn execute(&mut self, group: &PlayedGroup, make: MakeTrajectory<'_>) -> Result<RequestId, PlayError> {
        let motion = self.group(group).execute_with(make);
        motion.map(|motion| motion.request()).map_err(|error| PlayError::Command(error.to_string()))
    }

    fn begin_stream(&mut self, group: &PlayedGroup) -> Result<RequestId, PlayError> {
        self.group(group).begin_stream().map_err(|error| PlayError::Command(error.to_string()))?;
        // It has been granted.
        Ok(RequestId::default())
    }

    fn push(&mut self, group: &PlayedGroup, points: &[StreamPoint]) -> bool {
        self.group(group).stream().push_points(points).is_ok()
    }

    fn stop(&mut self) -> Result<(), PlayError> {
        let stopped = self.controller.stop(StopCategory::Two);
        stopped.map_err(|error| PlayError::Command(error.to_string()))
    }

    fn time_ns(&mut self) -> Nanoseconds {
        self.controller.now_ns()
    }
}
