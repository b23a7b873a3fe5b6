//! A controller to embed in a program. [`Controller::start`] brings the drives up and enables them. The program's own threads
//! command and observe it through [`Handle`]s. [`Controller::finish`] brings the axes to rest and shuts the drives down.
//!
//! ```no_run
//! use std::time::Duration;
//! use takt::{Config, Controller, SessionOptions};
//!
//! fn main() -> takt::Result {
//!     let config = Config::load("arm.toml".as_ref())?;
//!     let arm = Controller::start(config, SessionOptions::default())?;
//!     let motion = arm.move_to(&[0.3, -0.2, 0.1, -0.5, 0.0, 0.4])?;
//!     arm.wait(motion, Duration::from_secs(10))?;
//!     let session = arm.finish()?;
//!     println!("{:?}", session.outcome);
//!     Ok(())
//! }
//! ```
//!
//! # The owner and its handles
//! There is one [`Controller`]: it owns the run, and the run ends with it. So no forgotten clone in some thread keeps an arm
//! enabled, and the end is at one place of the program. There are any number of [`Handle`]s: they are `Clone + Send + Sync`, and
//! every call takes `&self`. After the end every command and every wait of a handle returns an error that says `Ended`. The
//! owner dereferences to a handle, so a program of one thread needs no handle of its own.

mod commands;
mod events;
mod group;
mod in_loop;
mod life;
mod messages;
mod motion;
mod pace;
mod running_controller;
mod start_failure;
mod stream;
mod trajectory;
mod virtual_controller;
mod waiting;

use std::ops::Deref;
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use takt_rt::linux::ThreadReport;
use takt_rt::{Snapshot, StopCategory};

use super::outcome::{Interrupt, Outcome, Progress};
use super::session::{self, Remote, RemoteHandles, Session, SessionError, SessionOptions};
use super::supervisor::AfterBringUp;
use crate::channels::{ClientRequests, EventReader, MotionEnd, Observer, Streamer};
use crate::config::{Axis, Config, Group};
use crate::telemetry::{LoopTiming, Machine, Notice, ShownTiming};
use in_loop::Callbacks;
use life::Life;
use messages::Messages;
use pace::{Pace, VirtualPace};
use trajectory::Trajectories;

pub use events::Events;
pub use group::GroupHandle;
pub use in_loop::{CallbackHandle, CallbackOptions};
pub use start_failure::StartFailure;
pub use stream::StreamHandle;
pub use virtual_controller::VirtualController;

/// The drives must be brought up and enabled within this time. It covers the power-up time of all drives.
const ENABLE_TIMEOUT: Duration = Duration::from_secs(60);

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
    pub(crate) fn start_watched(
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
            plan,
            events,
            realtime,
            timing,
        } = remote;
        let trajectories = Trajectories::new(trajectories);
        let handle = Handle(Arc::new(Shared {
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
    #[cfg(feature = "cli")]
    pub(crate) fn ended(mut self) -> Result<Session, StartFailure> {
        let joined = self.thread.take().map(JoinHandle::join);
        joined.and_then(Result::ok).map_or(Err(StartFailure::Died), |session| Ok(session?))
    }

    /// Stops the present motion and ends the run. Waiting requests are discarded.
    fn begin_end(&self) {
        let shared = &self.handle.0;
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

/// Commands and observes a running controller, from any thread. Clones are cheap and equal.
///
/// No command waits for a lock that another thread could hold, with two exceptions: clients that push points of a stream wait for
/// each other, and so do commands of trajectories.
/// [`Handle::stop`] is wait-free, so it may also be called in a signal handler.
#[derive(Clone)]
pub struct Handle(Arc<Shared>);

struct Shared {
    axes: Vec<Axis>,
    groups: Vec<Group>,
    machine: Machine,
    realtime: ThreadReport,
    timing: ShownTiming,
    clients: ClientRequests,
    observer: Observer,
    events: EventReader,
    streamer: Streamer,
    trajectories: Trajectories,
    callbacks: Callbacks,
    messages: Arc<Messages>,
    life: Arc<Life>,
    pace: Pace,
}

impl Handle {
    /// The axes, in the order of the configuration.
    pub fn axes(&self) -> &[Axis] {
        &self.0.axes
    }

    /// The groups of the configuration; none where all axes are one group.
    pub fn groups(&self) -> &[Group] {
        &self.0.groups
    }

    /// The names of the parts of the machine, for texts about events and states.
    pub fn machine(&self) -> &Machine {
        &self.0.machine
    }

    /// What the operating system granted to the real-time thread: scheduling policy and priority, CPU, locked memory; and what it
    /// refused.
    pub fn realtime(&self) -> &ThreadReport {
        &self.0.realtime
    }

    /// The state after the newest complete cycle; after the end, the last one. Before the first one, no drive has reported. It says of each axis from when its feedback is:
    /// [`is_stale`](takt_rt::AxisSnapshot::is_stale), [`feedback_age_ns`](takt_rt::AxisSnapshot::feedback_age_ns).
    pub fn state(&self) -> Snapshot {
        self.0.observer.snapshot()
    }

    /// How punctual all cycles since the start were; a few milliseconds old. All times are 0 in virtual time.
    pub fn timing(&self) -> LoopTiming {
        self.0.timing.newest()
    }

    /// The events from now on. Each observer has its own place among them.
    pub fn events(&self) -> Events {
        Events::new(self)
    }

    /// The failures to write a recording, a candump log or a black box until now. The motion goes on after them.
    pub fn not_written(&self) -> Vec<String> {
        self.0.messages.all()
    }

    /// Who runs the cycles in virtual time; `None` in real time.
    fn virtual_pace(&self) -> Option<&VirtualPace> {
        match &self.0.pace {
            Pace::Real => None,
            Pace::Virtual(pace) => Some(pace),
        }
    }

    /// Whether the run has ended, so that every command returns an error that says `Ended`.
    pub fn has_ended(&self) -> bool {
        self.0.life.is_over()
    }
}

fn failed(thread: JoinHandle<Result<Session, SessionError>>) -> StartFailure {
    match thread.join() {
        Ok(Ok(session)) => StartFailure::NotEnabled(Box::new(session)),
        Ok(Err(error)) => error.into(),
        Err(_) => StartFailure::Died,
    }
}
