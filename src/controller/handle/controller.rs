//! A controller in real time, and its owner.

use std::ops::Deref;
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};

use takt_rt::linux::ThreadReport;
use takt_rt::{Snapshot, StopCategory};

use super::callbacks::Callbacks;
use super::life::Life;
use super::messages::Messages;
use super::pace::Pace;
use super::start_failure::StartFailure;
use super::trajectories::Trajectories;
use super::{Handle, OwnProcess};
use crate::channels::MotionEnd;
use crate::config::Config;
use crate::controller::outcome::{Interrupt, Outcome, Progress};
use crate::controller::session::{self, Remote, RemoteHandles, Session, SessionError, SessionOptions};
use crate::controller::supervisor::AfterBringUp;
use crate::telemetry::{Machine, Notice};

/// The owner of a running controller. Dropping it brings the axes to rest, and disables and shuts down the drives.
///
/// It dereferences to its [`Handle`], which has all commands.
pub struct Controller {
    handle: Handle,
    thread: Option<JoinHandle<Result<Session, SessionError>>>,
    after_bring_up: AfterBringUp,
}

impl Controller {
    /// Brings the drives up and enables them. Returns when the axes hold their position.
    ///
    /// # Errors
    /// See [`StartFailure`]; nothing has moved then.
    pub fn start(config: Config, options: SessionOptions) -> Result<Self, StartFailure> {
        Self::start_watched(config, options, |_| {}, |_, _| None)
    }

    /// Brings the drives up and leaves them disabled: nothing is under power, and nothing has moved. Returns when every drive reports its
    /// position and none shows a fault. [`Handle::enable`] enables them.
    ///
    /// # Errors
    /// See [`StartFailure`].
    pub fn start_disabled(config: Config, options: SessionOptions) -> Result<Self, StartFailure> {
        Self::begin_watched(config, options, AfterBringUp::StayDisabled, |_| {}, |_, _| None)?.brought_up()
    }

    /// As [`Controller::start`], with what [`session::run`] takes: `tell` is called with each notice, and `watch` about once in a
    /// millisecond. An interrupt of `watch` ends the controller, at bring-up too.
    ///
    /// # Errors
    /// As [`Controller::start`].
    pub fn start_watched(
        config: Config,
        options: SessionOptions,
        tell: impl FnMut(&Notice) + Send + 'static,
        watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt> + Send + 'static,
    ) -> Result<Self, StartFailure> {
        Self::begin_watched(config, options, AfterBringUp::Enable, tell, watch)?.brought_up()
    }

    fn brought_up(self) -> Result<Self, StartFailure> {
        match self.wait_until_brought_up(self.after_bring_up) {
            Ok(()) => Ok(self),
            Err(_) => Err(self.into_failure()),
        }
    }

    /// As [`Controller::start`], but returns when the loop runs, while the drives are being brought up: for a program that wants to watch
    /// or to interrupt that. When [`Handle::wait_for`] of [`Phase::Holding`](crate::Phase::Holding) has succeeded, the axes hold their position; when it says
    /// that the run has ended, [`Controller::into_failure`] says why.
    ///
    /// # Errors
    /// See [`StartFailure`]; nothing was sent to the drives then.
    pub fn begin(config: Config, options: SessionOptions) -> Result<Self, StartFailure> {
        Self::begin_watched(config, options, AfterBringUp::Enable, |_| {}, |_, _| None)
    }

    fn begin_watched(
        config: Config,
        options: SessionOptions,
        after_bring_up: AfterBringUp,
        mut tell: impl FnMut(&Notice) + Send + 'static,
        mut watch: impl FnMut(&Snapshot, Progress) -> Option<Interrupt> + Send + 'static,
    ) -> Result<Self, StartFailure> {
        let (handles, handles_out) = mpsc::sync_channel(1);
        let remote = Remote { handles, after_bring_up };
        let (life, messages) = (Arc::<Life>::default(), Arc::<Messages>::default());
        let (axes, groups) = (config.axes.clone(), config.groups.clone());
        let machine = Machine::of(&config);
        let thread = {
            let (life, messages) = (Arc::clone(&life), Arc::clone(&messages));
            let notify = move |notice: &Notice| {
                match notice {
                    Notice::NotWritten(message) => messages.add(message.clone()),
                    // Observers get the events directly from the real-time thread.
                    Notice::Event(_) => {}
                }
                tell(notice);
            };
            let run = move || {
                let life = life.over_when_dropped();
                let watch = |state: &Snapshot, progress| {
                    life.is_ending().then_some(Interrupt::Controlled).max(watch(state, progress))
                };
                session::run_with(&config, options, Box::new(notify), watch, Some(remote))
            };
            thread::Builder::new().name("takt-session".into()).spawn(run)
        };
        let thread = thread.map_err(SessionError::Logger)?;
        let Ok(remote) = handles_out.recv() else { return Err(failed(thread)) };
        let RemoteHandles {
            observer,
            streamer,
            clients,
            trajectories,
            callbacks,
            questions,
            bring_up_failures,
            plan,
            events,
            realtime,
            timing,
        } = remote;
        let trajectories = Trajectories::new(trajectories);
        let handle = Handle::new(Arc::new(OwnProcess {
            axes,
            groups,
            machine,
            realtime,
            timing,
            clients,
            observer,
            events,
            streamer,
            trajectories,
            callbacks: Callbacks::new(callbacks, &plan),
            questions,
            bring_up_failures,
            messages,
            life,
            pace: Pace::Real,
        }));
        Ok(Self { handle, thread: Some(thread), after_bring_up })
    }

    /// Ends a run that [`Controller::begin`] has begun and whose drives have not been enabled, and returns why not.
    pub fn into_failure(mut self) -> StartFailure {
        self.begin_end();
        self.thread.take().map_or(StartFailure::Died, failed)
    }

    /// A handle for another thread.
    pub fn handle(&self) -> Handle {
        self.handle.clone()
    }

    /// Brings the axes to rest, disables and shuts down the drives, and returns the result of the run. From the beginning of this
    /// call on, handles can only stop and observe.
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

    /// Waits until the controller has been ended by what watches it, and returns the result of the run.
    ///
    /// # Errors
    /// [`StartFailure::Died`] if the session thread has panicked.
    pub fn ended(mut self) -> Result<Session, StartFailure> {
        let joined = self.thread.take().map(JoinHandle::join);
        joined.and_then(Result::ok).map_or(Err(StartFailure::Died), |session| Ok(session?))
    }

    /// Stops the present motion and ends the run. Waiting requests are discarded.
    fn begin_end(&self) {
        let shared = self.handle.backend();
        shared.life.begin_end();
        shared.clients.stop(MotionEnd::Stop(StopCategory::Two));
    }
}

impl Deref for Controller {
    type Target = Handle;

    fn deref(&self) -> &Handle {
        &self.handle
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

impl Handle {
    /// What the operating system granted to the real-time thread: scheduling policy and priority, CPU, locked memory; and what it
    /// refused.
    pub fn realtime(&self) -> &ThreadReport {
        &self.backend().realtime
    }
}

fn failed(thread: JoinHandle<Result<Session, SessionError>>) -> StartFailure {
    match thread.join() {
        Ok(Ok(session)) => StartFailure::NotEnabled(Box::new(session)),
        Ok(Err(error)) => error.into(),
        Err(_) => StartFailure::Died,
    }
}
