//! A client of a controller in another process.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use takt::command::Handle;

use crate::connection::Connection;

/// Commands and observes a controller of another process, from any thread. Clones are cheap and equal. It dereferences to its [`Handle`],
/// which has the calls of a [`takt::Handle`] with the same meaning and the same errors, but for those of the own process alone: the
/// callbacks in the real-time loop (`in_loop`), functions that make a trajectory (`execute_with`), its configuration (`axes`, `groups`),
/// and what its start has said (`realtime`, `not_written`).
///
/// # Who commands
/// Any number of clients observe. One of them commands: it has the *lease*. The first command takes the lease if nobody has it, and each
/// command renews it. It expires some time after the last one ([`ServeOptions::lease`](crate::ServeOptions)), or when its process ends;
/// then another client may take it. [`Handle::take_over`] takes it from a client that still has it; that one gets
/// [`LeaseError::TakenOver`](takt::LeaseError::TakenOver) from then on, until it takes the controller over again itself.
///
/// A lease that expires stops nothing: a move goes on to its end, and a stream runs dry and comes to rest within the limits, as one of the
/// own process does. [`Handle::stop`] needs no lease, and waits for nobody.
#[derive(Clone)]
pub struct Client(Handle<Connection>);

impl Client {
    /// By a connection.
    pub(crate) fn new(connection: Connection) -> Self {
        Self(Handle::new(Arc::new(connection)))
    }

    /// The name that it was connected by.
    pub fn name(&self) -> &str {
        &self.backend().names.name
    }

    /// The process of the controller.
    pub fn process(&self) -> u32 {
        self.backend().shown.process()
    }

    /// How long ago the process of the controller last showed a cycle. It is longer than a few periods if that is paused, or overloaded.
    pub fn silent_for(&self) -> Duration {
        self.backend().shown.silent_for()
    }

    /// Returns the number of times that the lease has changed hands. If it is another one than before, another client has commanded since
    /// then, or this one has taken the lease.
    pub fn lease_generation(&self) -> u64 {
        self.backend().shown.lease().generation
    }
}

impl Deref for Client {
    type Target = Handle<Connection>;

    fn deref(&self) -> &Handle<Connection> {
        &self.0
    }
}

impl From<Client> for takt::AnyHandle {
    fn from(client: Client) -> Self {
        client.0.into()
    }
}

impl fmt::Debug for Client {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Client")
            .field("name", &self.name())
            .field("process", &self.process())
            .finish()
    }
}
