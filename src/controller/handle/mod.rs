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

mod callbacks;
mod commands;
#[cfg(target_os = "linux")]
mod controller;
mod events;
mod group;
mod in_loop;
mod life;
mod messages;
mod motion;
mod pace;
mod question;
mod running_controller;
mod start_failure;
mod stream;
mod trajectories;
mod trajectory;
mod virtual_controller;
mod waiting;

use std::sync::Arc;
use std::time::Duration;

use takt_rt::Snapshot;

use crate::channels::{BringUpFailures, ClientRequests, EventReader, Observer, Questions, Streamer};
use crate::config::{Axis, Group};
use crate::telemetry::{LoopTiming, Machine, ShownTiming};
use callbacks::Callbacks;
use life::Life;
use messages::Messages;
use pace::{Pace, VirtualPace};
use trajectories::Trajectories;

#[cfg(target_os = "linux")]
pub use controller::Controller;
pub use events::Events;
pub use group::GroupHandle;
pub use in_loop::{CallbackHandle, CallbackOptions};
pub use start_failure::StartFailure;
pub use stream::StreamHandle;
pub use virtual_controller::VirtualController;

/// The drives must be brought up and enabled within this time. It covers the power-up time of all drives.
const ENABLE_TIMEOUT: Duration = Duration::from_secs(60);

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
    #[cfg(target_os = "linux")]
    realtime: takt_rt::linux::ThreadReport,
    timing: ShownTiming,
    clients: ClientRequests,
    observer: Observer,
    events: EventReader,
    streamer: Streamer,
    trajectories: Trajectories,
    callbacks: Callbacks,
    questions: Questions,
    bring_up_failures: BringUpFailures,
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

    /// The state after the newest complete cycle; after the end, the last one. Before the first one, no drive has reported. It says of each axis from when its feedback is:
    /// [`is_stale`](takt_rt::AxisSnapshot::is_stale), [`feedback_age_ns`](takt_rt::AxisSnapshot::feedback_age_ns).
    pub fn state(&self) -> Snapshot {
        self.0.observer.snapshot()
    }

    /// How punctual all cycles since the start were; a few milliseconds old. All times are 0 in virtual time.
    pub fn timing(&self) -> LoopTiming {
        self.0.timing.newest()
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

    /// Returns `true` if the run has ended, so that every command returns an error that says `Ended`.
    pub fn has_ended(&self) -> bool {
        self.0.life.is_over()
    }
}
