//! The connection by which a client asks for stops.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use takt::CommandError;

use crate::commands::StopRequest;
use crate::no_answer::{LOOK, NoAnswer};
use crate::socket::{Names, Packets, Role};

/// Sends stops, and counts those that the other process has taken.
pub struct Stops {
    /// Where they are sent; or why they cannot be.
    connection: Result<Packets, io::ErrorKind>,
    sent: AtomicU64,
    taken: AtomicU64,
}

impl Stops {
    /// Stops of the controller of these names that is observed.
    pub fn new(names: &Names, observer: &Packets) -> Self {
        let connection = Packets::connect_as(names.command(), Role::Stops).map_err(|error| error.kind());
        let is_same = |connection: &Packets| connection.peer() == observer.peer();
        Self {
            // Another process may have the name by now.
            connection: connection.and_then(|connection| {
                is_same(&connection).then_some(connection).ok_or(io::ErrorKind::NotFound)
            }),
            sent: AtomicU64::new(0),
            taken: AtomicU64::new(0),
        }
    }

    /// Sends a stop. It waits for nothing, allocates nothing and takes no lock.
    pub fn send(&self, stop: StopRequest) -> Result<(), CommandError> {
        let connection = self.connection.as_ref().map_err(|kind| NoAnswer::from(*kind))?;
        // Before it is sent, so that a command that comes after it waits for it.
        self.sent.fetch_add(1, Ordering::AcqRel);
        let sent = connection.send(&stop.packet());
        self.taken(connection);
        sent.map_err(|error| {
            self.sent.fetch_sub(1, Ordering::AcqRel);
            match error.kind() {
                io::ErrorKind::WouldBlock => CommandError::NoReply { after: Duration::ZERO },
                _ => CommandError::Ended,
            }
        })
    }

    /// Waits until the other process has taken all that were sent: what is asked after a stop comes after it.
    pub fn await_taken(&self, at_most: Duration, has_ended: impl Fn() -> bool) -> Result<(), NoAnswer> {
        let Ok(connection) = &self.connection else { return Ok(()) };
        let (sent, begun) = (self.sent.load(Ordering::Acquire), Instant::now());
        while self.taken(connection) < sent {
            let left = at_most.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return Err(NoAnswer::NoReply);
            }
            if has_ended() || connection.is_closed() {
                return Err(NoAnswer::Ended);
            }
            connection.await_packet(left.min(LOOK));
        }
        Ok(())
    }

    /// How many the other process has taken. It does not wait.
    fn taken(&self, connection: &Packets) -> u64 {
        while let Some(taken) = connection.receive_word() {
            self.taken.fetch_max(taken, Ordering::AcqRel);
        }
        self.taken.load(Ordering::Acquire)
    }
}
