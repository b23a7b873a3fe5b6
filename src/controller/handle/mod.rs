//! A controller to embed in a program. [`Controller::start`] brings the drives up and enables them. The program's own threads
//! command it. [`Controller::finish`] brings the axes to rest and shuts the drives down.
//!
//! ```no_run
//! use std::time::Duration;
//! use takt::config::Config;
//! use takt::controller::Controller;
//! use takt::controller::session::SessionOptions;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = Config::load("configs/arm6-erob.toml".as_ref()).map_err(miette::Report::new)?;
//! let mut arm = Controller::start(config, SessionOptions::default())?;
//! let motion = arm.move_to(&[0.3, -0.2, 0.1, -0.5, 0.0, 0.4])?;
//! arm.wait(motion, Duration::from_secs(10))?;
//! let session = arm.finish()?;
//! println!("{:?}", session.outcome);
//! # Ok(())
//! # }
//! ```

mod error;
mod stream;
mod waiting_requests;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use takt_rt::linux::MonotonicClock;
use takt_rt::{
    Answer, Clock, ControlLaw, MAX_AXES, MotionState, Move, Phase, ProfileMove, ProfileTarget, Request,
    RequestEnvelope, RequestId, Snapshot, StopCategory,
};

use super::channels::{Observer, RequestNumbers, Streamer};
use super::outcome::{Interrupt, Outcome};
use super::session::{self, Remote, RemoteHandles, Session, SessionError, SessionOptions};
use crate::config::{Axis, Config};
use crate::telemetry::Machine;
use waiting_requests::REQUESTS_AT_MOST;

pub(super) use waiting_requests::WaitingRequests;

pub use stream::{StreamError, StreamHandle};

pub use error::{CommandError, MotionError, Refused, StartFailure, Stopped};

/// The time between two polls of the state.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// The drives must be enabled within this time. It covers the power-up time of all drives.
const ENABLE_TIMEOUT: Duration = Duration::from_secs(60);

/// A group of axes that is enabled. Dropping it brings the axes to rest, and disables and shuts down the drives.
pub struct Controller {
    axes: Vec<Axis>,
    machine: Machine,
    requests: Arc<WaitingRequests>,
    numbers: RequestNumbers,
    observer: Observer,
    streamer: Streamer,
    is_ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<Session, SessionError>>>,
}

/// Identifies a motion, for [`Controller::wait`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MotionId(RequestId);

/// Parameters of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveOptions {
    /// Fraction of the velocity limits, above 0 up to 1.
    pub velocity_scale: f64,
    /// Fraction of the acceleration and jerk limits, above 0 up to 1.
    pub acceleration_scale: f64,
    /// The shortest duration of the move, in seconds.
    pub minimum_duration_s: f64,
}

impl Default for MoveOptions {
    fn default() -> Self {
        Self { velocity_scale: 1.0, acceleration_scale: 1.0, minimum_duration_s: 0.0 }
    }
}

impl Controller {
    /// Brings the drives up and enables them. Returns when the axes hold their position.
    ///
    /// # Errors
    /// See [`StartFailure`]; nothing has moved then.
    pub fn start(config: Config, options: SessionOptions) -> Result<Self, StartFailure> {
        let requests = Arc::new(WaitingRequests::default());
        let (handles_in, handles_out) = mpsc::sync_channel(1);
        let remote = Remote { requests: Arc::clone(&requests), handles: handles_in };
        let is_ending = Arc::new(AtomicBool::new(false));
        let (axes, machine) = (config.axes.clone(), Machine::of(&config));
        let thread = {
            let is_ending = Arc::clone(&is_ending);
            let watch =
                move |_: &Snapshot, _| is_ending.load(Ordering::Relaxed).then_some(Interrupt::Controlled);
            let run = move || session::run_with(&config, options, Box::new(|_| {}), watch, Some(remote));
            thread::Builder::new().name("takt-session".into()).spawn(run)
        };
        let thread = thread.map_err(SessionError::Logger)?;
        let Ok(RemoteHandles { observer, streamer, numbers }) = handles_out.recv() else {
            return Err(failed(thread));
        };
        let thread = Some(thread);
        let mut controller = Self { axes, machine, requests, numbers, observer, streamer, is_ending, thread };
        let begun = Instant::now();
        while controller.state().phase != Phase::Holding {
            if controller.has_ended() || begun.elapsed() > ENABLE_TIMEOUT {
                controller.is_ending.store(true, Ordering::Relaxed);
                return Err(controller.thread.take().map_or(StartFailure::Died, failed));
            }
            thread::sleep(POLL_INTERVAL);
        }
        Ok(controller)
    }

    /// The axes, in the order of the configuration.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The state after the newest complete cycle.
    pub fn state(&self) -> Snapshot {
        self.observer.snapshot()
    }

    /// A handle to the state for another thread.
    pub fn observer(&self) -> Observer {
        self.observer.clone()
    }

    /// Starts a coordinated move of every axis to its target (rad or m), where the axes come to rest. A move in progress is
    /// replanned from the present set-points. A drive in profile position plans its own profile. A drive in profile velocity
    /// or profile torque keeps its velocity or torque.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_to(&mut self, target: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// The same as [`Controller::move_to`], within fractions of the limits.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_with(&mut self, target: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        if target.len() != self.axes.len() {
            return Err(CommandError::Count { given: target.len(), axes: self.axes.len() });
        }
        for (axis, value) in self.axes.iter().zip(target) {
            within(axis, *value, axis.limits.position_min, axis.limits.position_max)?;
        }
        let mut all = [0.0; MAX_AXES];
        all.iter_mut().zip(target).for_each(|(to, from)| *to = *from);
        let id = self.numbers.next();
        let request = Request::Move(Move {
            target: all,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: options.velocity_scale,
            acceleration_scale: options.acceleration_scale,
            minimum_duration_s: options.minimum_duration_s,
        });
        self.begin(id, request)
    }

    /// Gives a drive in profile velocity a velocity (rad/s or m/s). Unless it is given again within `valid_for`, the group
    /// stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn velocity(
        &mut self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileVelocity, "profile velocity, mode = \"pv\"")?;
        within(own, velocity, -own.limits.velocity, own.limits.velocity)?;
        self.drive(axis, ProfileTarget::Velocity(velocity), valid_for)
    }

    /// Gives a drive in profile torque a torque (N·m or N). Unless it is given again within `valid_for`, the group stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn torque(
        &mut self,
        axis: usize,
        torque: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileTorque, "profile torque, mode = \"pt\"")?;
        within(own, torque, -own.limits.torque, own.limits.torque)?;
        self.drive(axis, ProfileTarget::Torque(torque), valid_for)
    }

    /// Begins to follow the points of [`Controller::stream`]. The first one must come within the enable time-out. The axes are led
    /// to it within their limits; where an axis is to `follow = "exact"`, it must be near the joint.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the group holds its position and is punctual, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn begin_stream(&mut self) -> Result<(), CommandError> {
        self.request_and_wait(Request::Stream)
    }

    /// Requests a stop of this category, and returns at once. A stop is never refused. It discards all requests that are still
    /// waiting, so that they neither delay the stop nor begin after it.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn stop(&mut self, category: StopCategory) -> Result<(), CommandError> {
        self.send(Request::Stop(category)).map(drop)
    }

    /// Begins to bring the axes to rest and to disable them. It discards waiting requests as [`Controller::stop`] does.
    ///
    /// # Errors
    /// [`CommandError::Refused`], [`CommandError::Ended`].
    pub fn disable(&mut self) -> Result<(), CommandError> {
        self.request_and_wait(Request::Disable)
    }

    /// Begins to enable the axes again: after [`Controller::disable`], or after a fault and [`Controller::reset_faults`].
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the axes are disabled and no fault is latched, [`CommandError::Full`],
    /// [`CommandError::Ended`].
    pub fn enable(&mut self) -> Result<(), CommandError> {
        self.request_and_wait(Request::Enable)
    }

    /// Clears latched faults.
    ///
    /// # Errors
    /// [`CommandError::Refused`] in motion, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn reset_faults(&mut self) -> Result<(), CommandError> {
        self.request_and_wait(Request::ResetFaults)
    }

    /// Waits until a motion has reached its targets: until the axes are at rest there, or a velocity or torque is reached. The
    /// result is that of this motion, independent of what the group did before and after it.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        let begun = Instant::now();
        loop {
            // This is read before the state, so that the state includes the last cycle before the end.
            let has_ended = self.has_ended();
            if let Some(result) = self.result_of(motion) {
                return result;
            }
            if has_ended {
                return Err(MotionError::Ended);
            }
            if begun.elapsed() > at_most {
                return Err(MotionError::NotInTime);
            }
            thread::sleep(POLL_INTERVAL);
        }
    }

    /// How a motion ended, if it has.
    fn result_of(&self, MotionId(request): MotionId) -> Option<Result<(), MotionError>> {
        let state = self.state();
        let result = match (state.motions.of(request), state.answers.of(request)) {
            (Some(MotionState::InProgress), _) => return None,
            (Some(MotionState::Finished), _) => Ok(()),
            (Some(MotionState::Stopped(reason)), _) => Err(Stopped::new(reason, &self.machine).into()),
            (Some(MotionState::Replaced { .. }), _) => Err(MotionError::Replaced),
            (None, Answer::Rejected(refusal)) => Err(Refused::new(refusal, &self.machine).into()),
            (None, Answer::Granted) => Err(MotionError::Forgotten),
            (None, Answer::None) if state.answers.have_forgotten(request) => Err(MotionError::Forgotten),
            (None, Answer::None) if self.requests.is_discarded(request) => Err(MotionError::Overtaken),
            (None, Answer::None) => return None,
        };
        Some(result)
    }

    /// Waits until the group is in a phase. Returns whether that happened in time.
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> bool {
        let begun = Instant::now();
        while self.state().phase != phase {
            if self.has_ended() || begun.elapsed() > at_most {
                return false;
            }
            thread::sleep(POLL_INTERVAL);
        }
        true
    }

    /// Brings the axes to rest, disables and shuts down the drives, and returns the result of the run.
    ///
    /// # Errors
    /// [`StartFailure::Died`] if the session thread has panicked.
    pub fn finish(mut self) -> Result<Session, StartFailure> {
        self.begin_end();
        let Some(thread) = self.thread.take() else { return Err(StartFailure::Died) };
        match thread.join() {
            // An interrupt is the regular end of this run.
            Ok(Ok(session)) if session.outcome == Outcome::Interrupted => {
                Ok(Session { outcome: Outcome::Finished, ..session })
            }
            Ok(session) => Ok(session?),
            Err(_) => Err(StartFailure::Died),
        }
    }

    /// Stops the present motion and ends the run. Waiting requests are discarded.
    fn begin_end(&self) {
        // This fails only if the controller has already ended.
        let _ = self.send(Request::Stop(StopCategory::Two));
        self.is_ending.store(true, Ordering::Relaxed);
    }

    fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    fn axis(&self, axis: usize, mode: ControlLaw, needed: &'static str) -> Result<&Axis, CommandError> {
        let own = self.axes.get(axis).ok_or(CommandError::NoSuchAxis { axis, axes: self.axes.len() })?;
        if own.control == mode {
            Ok(own)
        } else {
            Err(CommandError::WrongMode { axis: own.name.clone(), needed })
        }
    }

    fn drive(
        &mut self,
        axis: usize,
        target: ProfileTarget,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        let id = self.numbers.next();
        // The number of an existing axis fits.
        let axis = axis as u8;
        let wanted = ProfileMove { axis, target, valid_until_ns: expiry_ns(valid_for) };
        self.begin(id, Request::SetProfileTarget(wanted))
    }

    fn begin(&self, id: RequestId, request: Request) -> Result<MotionId, CommandError> {
        self.submit(RequestEnvelope { id, request })?;
        Ok(MotionId(id))
    }

    /// Sends a request and waits until it is granted.
    fn request_and_wait(&self, request: Request) -> Result<(), CommandError> {
        let id = self.send(request)?;
        loop {
            let answers = self.state().answers;
            match answers.of(id) {
                Answer::Granted => return Ok(()),
                Answer::Rejected(refusal) => return Err(Refused::new(refusal, &self.machine).into()),
                Answer::None if answers.have_forgotten(id) => return Err(CommandError::Unanswered),
                Answer::None if self.requests.is_discarded(id) => return Err(CommandError::Overtaken),
                Answer::None if self.has_ended() => return Err(CommandError::Ended),
                Answer::None => thread::sleep(POLL_INTERVAL),
            }
        }
    }

    fn send(&self, request: Request) -> Result<RequestId, CommandError> {
        let id = self.numbers.next();
        self.submit(RequestEnvelope { id, request }).map(|()| id)
    }

    fn submit(&self, envelope: RequestEnvelope) -> Result<(), CommandError> {
        if self.has_ended() {
            Err(CommandError::Ended)
        } else if self.requests.submit(envelope) {
            Ok(())
        } else {
            Err(CommandError::Full { waiting: REQUESTS_AT_MOST })
        }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.begin_end();
        if let Some(thread) = self.thread.take() {
            // A dropped controller has no receiver for its result.
            let _ = thread.join();
        }
    }
}

fn failed(thread: JoinHandle<Result<Session, SessionError>>) -> StartFailure {
    match thread.join() {
        Ok(Ok(session)) => StartFailure::NotEnabled(Box::new(session)),
        Ok(Err(error)) => error.into(),
        Err(_) => StartFailure::Died,
    }
}

fn within(axis: &Axis, value: f64, lowest: f64, highest: f64) -> Result<(), CommandError> {
    if (lowest..=highest).contains(&value) {
        Ok(())
    } else {
        Err(CommandError::OutsideLimits { axis: axis.name.clone(), value, lowest, highest })
    }
}

fn expiry_ns(valid_for: Duration) -> u64 {
    let valid_ns = u64::try_from(valid_for.as_nanos()).unwrap_or(u64::MAX);
    MonotonicClock::default().now_ns().saturating_add(valid_ns)
}
