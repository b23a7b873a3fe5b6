//! A running controller, offered to other processes: see [the crate](crate) for what they see and send.
//!
//! ```text
//! publisher   ── after each cycle: events, state, lease ──▶ shared memory
//! connections ── connecting, stops, the end of clients (one thread, which never waits for the controller)
//! worker      ── the commands of one client, one after another: decode, check the lease, call the controller, reply
//! ```
//!
//! All of them are ordinary threads beside the real-time one, and call the controller as the own program's threads do. So nothing that a
//! client does or leaves undone reaches the loop but by the checked calls of a handle. A worker that waits for the controller holds up
//! its own client alone, and no stop. A stop overtakes the packets that wait for a worker: what was asked before it is not carried out.

mod connections;
mod lease;
mod publisher;
mod served;
mod worker;

use std::fmt;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use takt::command::AnyHandle;
use takt_rt::RequestTarget;

use crate::layout::Description;
use crate::shown::ShownWriter;
use crate::socket::{Claimed, NameError, Names, SocketError};
use connections::Connections;
use served::Served;

/// How a controller is served.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ServeOptions {
    /// Who may observe and command, as file permissions: of 0o640 the owner commands, and the group observes. 0o600 by default: both are
    /// for the same user alone.
    pub mode: u32,
    /// How long after its last command a client keeps its lease: 1 s by default.
    pub lease: Duration,
}

impl Default for ServeOptions {
    fn default() -> Self {
        Self { mode: 0o600, lease: Duration::from_secs(1) }
    }
}

impl ServeOptions {
    /// With these permissions.
    #[must_use]
    pub const fn with_mode(mut self, mode: u32) -> Self {
        self.mode = mode;
        self
    }

    /// With a lease of this length.
    #[must_use]
    pub const fn with_lease(mut self, lease: Duration) -> Self {
        self.lease = lease;
        self
    }
}

/// Why a controller cannot be served.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// It cannot be a name.
    #[error("{words}")]
    Name {
        /// Why.
        words: String,
    },
    /// Another process has the name.
    #[error("another process serves by the name {name:?}; choose another name, or end that process")]
    InUse {
        /// The name.
        name: String,
    },
    /// The permissions are more than read and write bits.
    #[error("{mode:#o} are no permissions to observe (read) and to command (write)")]
    Mode {
        /// The permissions.
        mode: u32,
    },
    /// The memory, the sockets or the threads cannot be had.
    #[error("the controller cannot be served: {words}")]
    Failed {
        /// Why.
        words: String,
    },
}

impl fmt::Debug for ServeError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

impl From<NameError> for ServeError {
    fn from(error: NameError) -> Self {
        Self::Name { words: error.to_string() }
    }
}

impl From<SocketError> for ServeError {
    fn from(error: SocketError) -> Self {
        Self::Failed { words: error.to_string() }
    }
}

impl From<io::Error> for ServeError {
    fn from(error: io::Error) -> Self {
        Self::Failed { words: error.to_string() }
    }
}

/// Offers a running controller to other processes as long as it lives. When it is dropped, its clients' calls say that it has ended. The
/// controller goes on.
pub struct Server {
    served: Arc<Served>,
    /// To drop it wakes the thread of the connections.
    waker: Option<OwnedFd>,
    threads: Vec<JoinHandle<()>>,
}

/// Offers a running controller to other processes by a name: see [`connect`](crate::connect). A name with a slash is the beginning of the
/// paths of its sockets.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let config = takt::Config::load("arm.toml".as_ref())?;
/// let arm = takt::Controller::start(config, takt::SessionOptions::default())?;
/// let _server = takt_remote::serve(arm.handle(), "arm", takt_remote::ServeOptions::default())?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`ServeError`].
pub fn serve(
    controller: impl Into<AnyHandle>,
    name: &str,
    options: ServeOptions,
) -> Result<Server, ServeError> {
    Claim::new(name, options)?.serve(controller)
}

/// A name that this process will serve by. No other process can, from now on.
pub struct Claim {
    claimed: Claimed,
    options: ServeOptions,
}

impl Claim {
    /// Claims a name, before there is a controller.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn new(name: &str, options: ServeOptions) -> Result<Self, ServeError> {
        if options.mode & !0o666 != 0 {
            return Err(ServeError::Mode { mode: options.mode });
        }
        let claimed = Claimed::new(Names::to_serve(name, options.mode)?).map_err(|error| match error {
            SocketError::InUse => ServeError::InUse { name: name.to_owned() },
            error => error.into(),
        })?;
        Ok(Self { claimed, options })
    }

    /// See [`serve()`].
    pub fn serve(self, controller: impl Into<AnyHandle>) -> Result<Server, ServeError> {
        let (Self { claimed, options }, controller) = (self, controller.into());
        let shown = ShownWriter::new(&description(&controller))?;
        let memory = shown.memory();
        let listener = claimed.listen(options.mode)?;
        let served = Arc::new(Served::new(controller, options.lease));
        let (wake, waker) = nix::unistd::pipe().map_err(io::Error::from)?;
        let mut server = Server { served: Arc::clone(&served), waker: Some(waker), threads: vec![] };
        // The first state is there before a client can connect.
        let mut publisher = publisher::Publisher::new(Arc::clone(&served), shown);
        publisher.publish();
        server.spawn("takt-publish", move || publisher.run())?;
        server.spawn("takt-connect", move || Connections::new(served, listener, memory, wake).run())?;
        Ok(server)
    }
}

impl Server {
    fn spawn(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> io::Result<()> {
        self.threads.push(thread::Builder::new().name(name.to_owned()).spawn(run)?);
        Ok(())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.served.end();
        self.waker = None;
        for thread in self.threads.drain(..) {
            // A thread that has panicked has told so.
            let _ = thread.join();
        }
    }
}

fn description(controller: &AnyHandle) -> Description {
    let machine = controller.machine().clone();
    let groups = (0u8..)
        .zip(&machine.groups)
        .map(|(group, _)| controller.of(RequestTarget::Group(group)).axis_numbers())
        .collect();
    let axes = (0..machine.axes.len()).filter_map(|axis| controller.axis_properties(axis)).collect();
    Description { machine, groups, axes }
}
