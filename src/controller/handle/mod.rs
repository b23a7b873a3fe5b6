//! A controller to embed: brought up and enabled by [`Controller::start`], commanded by a program's own threads, brought
//! to rest and left by [`Controller::finish`].
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
//! let there = arm.move_to(&[0.3, -0.2, 0.1, -0.5, 0.0, 0.4])?;
//! arm.wait(there, Duration::from_secs(10))?;
//! let session = arm.finish()?;
//! println!("{:?}", session.outcome);
//! # Ok(())
//! # }
//! ```

mod error;
mod waiting_requests;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use takt_rt::linux::MonotonicClock;
use takt_rt::plan::State;
use takt_rt::{
    Answer, Clock, ControlLaw, MAX_AXES, MotionState, Move, Phase, ProfileMove, ProfileTarget, Request,
    RequestEnvelope, RequestId, Snapshot, StopCategory, StreamCommand,
};

use super::channels::{Observer, RequestNumbers, Streamer};
use super::outcome::{Interrupt, Outcome};
use super::session::{self, Remote, Session, SessionError, SessionOptions};
use crate::config::{Axis, Config};
use crate::telemetry::Machine;
use waiting_requests::REQUESTS_AT_MOST;

pub(super) use waiting_requests::WaitingRequests;

pub use error::{CommandError, MotionError, Refused, StartFailure, Stopped};

/// Between two looks at the state by whoever waits.
const LOOK: Duration = Duration::from_millis(1);
/// Enabling takes the drives' power-up time at the most, and somewhat longer for all of them.
const ENABLE_PATIENCE: Duration = Duration::from_secs(60);

/// A group of axes that is enabled and obeys. Dropping it brings the axes to rest, disables and leaves them.
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

/// A motion that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion {
    request: RequestId,
    slot: u64,
    ends_at_rest: bool,
}

/// How a move is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveOptions {
    /// Fraction of the velocity limits, above 0 up to 1.
    pub velocity_scale: f64,
    /// Fraction of the acceleration and jerk limits, above 0 up to 1.
    pub acceleration_scale: f64,
    /// It takes at least this long, in seconds.
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
        let (introduce, introduced) = mpsc::sync_channel(1);
        let remote = Remote { requests: Arc::clone(&requests), introduce };
        let is_ending = Arc::new(AtomicBool::new(false));
        let (axes, machine) = (config.axes.clone(), Machine::of(&config));
        let thread = {
            let is_ending = Arc::clone(&is_ending);
            let watch =
                move |_: &Snapshot, _| is_ending.load(Ordering::Relaxed).then_some(Interrupt::Controlled);
            let lead = move || session::lead(&config, options, Box::new(|_| {}), watch, Some(remote));
            thread::Builder::new().name("takt-lead".into()).spawn(lead)
        };
        let thread = thread.map_err(SessionError::Logger)?;
        let Ok((observer, streamer, numbers)) = introduced.recv() else {
            return Err(failed(thread));
        };
        let thread = Some(thread);
        let mut controller = Self { axes, machine, requests, numbers, observer, streamer, is_ending, thread };
        let begun = Instant::now();
        while controller.state().phase != Phase::Holding {
            if controller.has_ended() || begun.elapsed() > ENABLE_PATIENCE {
                controller.is_ending.store(true, Ordering::Relaxed);
                return Err(controller.thread.take().map_or(StartFailure::Died, failed));
            }
            thread::sleep(LOOK);
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

    /// A handle for another thread that wants to see the state.
    pub fn observer(&self) -> Observer {
        self.observer.clone()
    }

    /// Moves every axis to its target (rad or m), coordinated, to rest. A move under way is re-planned from where it is.
    /// Drives in profile position make their own way; those in profile velocity and torque are left as they are.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_to(&mut self, target: &[f64]) -> Result<Motion, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// As [`Controller::move_to`], within fractions of the limits.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn move_with(&mut self, target: &[f64], options: MoveOptions) -> Result<Motion, CommandError> {
        if target.len() != self.axes.len() {
            return Err(CommandError::Count { given: target.len(), axes: self.axes.len() });
        }
        for (axis, value) in self.axes.iter().zip(target) {
            let is_positioned =
                !matches!(axis.control, ControlLaw::ProfileVelocity | ControlLaw::ProfileTorque);
            if is_positioned {
                within(axis, *value, axis.limits.position_min, axis.limits.position_max)?;
            }
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
        self.begin(id, request, true)
    }

    /// Lets a drive in profile velocity go at a speed (rad/s or m/s). When that has not been renewed within `valid_for`,
    /// the group stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn velocity(
        &mut self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<Motion, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileVelocity, "profile velocity, mode = \"pv\"")?;
        within(own, velocity, -own.limits.velocity, own.limits.velocity)?;
        self.drive(axis, ProfileTarget::Velocity(velocity), velocity == 0.0, valid_for)
    }

    /// Lets a drive in profile torque push with a torque (N·m or N). When that has not been renewed within `valid_for`,
    /// the group stops.
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then.
    pub fn torque(&mut self, axis: usize, torque: f64, valid_for: Duration) -> Result<Motion, CommandError> {
        let own = self.axis(axis, ControlLaw::ProfileTorque, "profile torque, mode = \"pt\"")?;
        within(own, torque, -own.limits.torque, own.limits.torque)?;
        self.drive(axis, ProfileTarget::Torque(torque), torque == 0.0, valid_for)
    }

    /// Begins to follow [`Controller::stream`]: what is streamed from now on counts. The first set-points must come within
    /// the time that enabling may take, and begin where the joints are.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the group holds its position and is punctual, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn begin_stream(&mut self) -> Result<(), CommandError> {
        self.obtain(Request::Stream)
    }

    /// Replaces the streamed set-points, one for each axis; the real-time thread takes the newest ones. They expire after
    /// `valid_for`: then the group decelerates and holds.
    ///
    /// # Errors
    /// [`CommandError::Count`].
    pub fn stream(&mut self, set_points: &[State], valid_for: Duration) -> Result<(), CommandError> {
        if set_points.len() != self.axes.len() {
            return Err(CommandError::Count { given: set_points.len(), axes: self.axes.len() });
        }
        let mut all = [State::default(); MAX_AXES];
        all.iter_mut().zip(set_points).for_each(|(to, from)| *to = *from);
        self.streamer.stream(&StreamCommand { valid_until_ns: expiry_ns(valid_for), set_points: all });
        Ok(())
    }

    /// Stops the group by this category. That is never refused, and not waited for. Whatever has been asked for before and is
    /// still waiting is forgotten, so that it neither holds the stop up nor is begun after it.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn stop(&mut self, category: StopCategory) -> Result<(), CommandError> {
        self.ask(Request::Stop(category)).map(drop)
    }

    /// Begins to bring the axes to rest if need be, and to disable them. It overtakes what is waiting as [`Controller::stop`]
    /// does.
    ///
    /// # Errors
    /// [`CommandError::Refused`], [`CommandError::Ended`].
    pub fn disable(&mut self) -> Result<(), CommandError> {
        self.obtain(Request::Disable)
    }

    /// Begins to enable the axes again, after [`Controller::disable`], or after a fault and [`Controller::reset_faults`].
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the axes are disabled and no fault is latched, [`CommandError::Full`],
    /// [`CommandError::Ended`].
    pub fn enable(&mut self) -> Result<(), CommandError> {
        self.obtain(Request::Enable)
    }

    /// Clears latched faults.
    ///
    /// # Errors
    /// [`CommandError::Refused`] in motion, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn reset_faults(&mut self) -> Result<(), CommandError> {
        self.obtain(Request::ResetFaults)
    }

    /// Waits until a motion is over: until the axes are at rest at their targets, or a speed or torque has been reached.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn wait(&self, motion: Motion, at_most: Duration) -> Result<(), MotionError> {
        let begun = Instant::now();
        loop {
            let state = self.state();
            match state.motions.of(motion.request) {
                Some(MotionState::Finished) if !motion.ends_at_rest || state.phase == Phase::Holding => {
                    return Ok(());
                }
                Some(MotionState::Stopped(reason)) => return Err(Stopped::new(reason, &self.machine).into()),
                Some(MotionState::Replaced { .. }) => return Err(MotionError::Overtaken),
                _ => {}
            }
            if let Answer::Rejected(refusal) = state.answers.of(motion.request) {
                return Err(Refused::new(refusal, &self.machine).into());
            }
            if self.requests.has_forgotten(motion.request) {
                return Err(MotionError::Overtaken);
            }
            if self.has_ended() {
                return Err(MotionError::Ended);
            }
            if begun.elapsed() > at_most {
                return Err(MotionError::NotInTime);
            }
            thread::sleep(LOOK);
        }
    }

    /// Waits for a phase. Returns whether it came in time.
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> bool {
        let begun = Instant::now();
        while self.state().phase != phase {
            if self.has_ended() || begun.elapsed() > at_most {
                return false;
            }
            thread::sleep(LOOK);
        }
        true
    }

    /// Brings the axes to rest, disables and leaves them, and tells what is left of the run.
    ///
    /// # Errors
    /// [`StartFailure::Died`] when the thread that leads the controller did not end by itself.
    pub fn finish(mut self) -> Result<Session, StartFailure> {
        self.begin_end();
        let Some(thread) = self.thread.take() else { return Err(StartFailure::Died) };
        match thread.join() {
            // To be asked to end is how such a run is over.
            Ok(Ok(session)) if session.outcome == Outcome::Interrupted => {
                Ok(Session { outcome: Outcome::Finished, ..session })
            }
            Ok(session) => Ok(session?),
            Err(_) => Err(StartFailure::Died),
        }
    }

    /// Ends the run from its present motion: what waits behind it is not begun any more.
    fn begin_end(&self) {
        // Where the controller has ended there is nothing to stop.
        let _ = self.ask(Request::Stop(StopCategory::Two));
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
        ends_at_rest: bool,
        valid_for: Duration,
    ) -> Result<Motion, CommandError> {
        let id = self.numbers.next();
        // An axis that exists has a number that fits.
        let axis = axis as u8;
        let wanted = ProfileMove { axis, target, valid_until_ns: expiry_ns(valid_for) };
        self.begin(id, Request::SetProfileTarget(wanted), ends_at_rest)
    }

    fn begin(&self, id: RequestId, request: Request, ends_at_rest: bool) -> Result<Motion, CommandError> {
        let slot = self.state().slot;
        self.hand_in(RequestEnvelope { id, request })?;
        Ok(Motion { request: id, slot, ends_at_rest })
    }

    /// Asks for something, and waits until it has been granted.
    fn obtain(&self, request: Request) -> Result<(), CommandError> {
        let asked = self.ask(request)?;
        loop {
            let answers = self.state().answers;
            match answers.of(asked) {
                Answer::Granted => return Ok(()),
                Answer::Rejected(refusal) => return Err(Refused::new(refusal, &self.machine).into()),
                Answer::None if answers.have_forgotten(asked) => return Err(CommandError::Unanswered),
                Answer::None if self.requests.has_forgotten(asked) => return Err(CommandError::Overtaken),
                Answer::None if self.has_ended() => return Err(CommandError::Ended),
                Answer::None => thread::sleep(LOOK),
            }
        }
    }

    fn ask(&self, request: Request) -> Result<RequestId, CommandError> {
        let id = self.numbers.next();
        self.hand_in(RequestEnvelope { id, request }).map(|()| id)
    }

    fn hand_in(&self, asked: RequestEnvelope) -> Result<(), CommandError> {
        if self.has_ended() {
            Err(CommandError::Ended)
        } else if self.requests.ask(asked) {
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
            // Its outcome interests nobody any more.
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
