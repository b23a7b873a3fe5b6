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

mod backend;
mod callbacks;
mod commands;
#[cfg(target_os = "linux")]
mod controller;
mod events;
mod in_loop;
mod life;
mod messages;
mod pace;
mod question;
mod start_failure;
mod stream;
mod trajectories;
mod trajectory;
mod virtual_controller;
mod waiting;

use std::sync::Arc;
use std::time::Duration;

use crate::channels::{BringUpFailures, ClientRequests, EventReader, Observer, Questions, Streamer};
use crate::command;
use crate::config::{Axis, Group};
use crate::telemetry::{Machine, ShownTiming};
use callbacks::Callbacks;
use life::Life;
use messages::Messages;
use pace::{Pace, VirtualPace};
use trajectories::Trajectories;

#[cfg(target_os = "linux")]
pub use controller::Controller;
pub use in_loop::{CallbackHandle, CallbackOptions};
pub use start_failure::StartFailure;
pub use virtual_controller::VirtualController;

/// The drives must be brought up and enabled within this time. It covers the power-up time of all drives.
const ENABLE_TIMEOUT: Duration = Duration::from_secs(60);

/// Commands and observes a controller of this process, or one of its groups, from any thread: see [`command::Handle`]. It has, beside the
/// calls that a controller of another process has too, those that only its own process has: callbacks in the real-time loop
/// ([`Handle::in_loop`](command::Handle::in_loop)), functions that make a trajectory ([`Handle::execute_with`](command::Handle::execute_with)),
/// and what its configuration and its start have said.
pub type Handle = command::Handle<OwnProcess>;

/// A running controller of this process.
pub struct OwnProcess {
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
    /// All axes of the controller, in the order of the configuration.
    pub fn axes(&self) -> &[Axis] {
        &self.backend().axes
    }

    /// The groups of the configuration; none where all axes are one group.
    pub fn groups(&self) -> &[Group] {
        &self.backend().groups
    }

    /// The failures to write a recording, a candump log or a black box until now. The motion goes on after them.
    pub fn not_written(&self) -> Vec<String> {
        self.backend().messages.all()
    }
}

impl OwnProcess {
    /// Who runs the cycles in virtual time; `None` in real time.
    fn virtual_pace(&self) -> Option<&VirtualPace> {
        match &self.pace {
            Pace::Real => None,
            Pace::Virtual(pace) => Some(pace),
        }
    }
}
