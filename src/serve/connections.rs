//! Who comes and goes, and who asks for a stop.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use takt_rt::RequestTarget;

use super::Served;
use super::lease::Claimant;
use super::worker::Worker;
use crate::command::LeaseError;
use crate::remote::{
    Answer, Listener, Memory, PACKET_WORDS, Packets, Received, Reply, Role, StopRequest, accept, now_ns,
};

/// Observers, and connections for stops, at most.
const PEERS: usize = 128;
/// Clients with commands, at most: each has a thread.
const WORKERS: usize = 32;
/// Stops of one client that are taken before those of the next one.
const STOPS_AT_ONCE: usize = 16;
/// The pause after the system has no more descriptors.
const PAUSE: Duration = Duration::from_millis(10);

/// One thread that never waits for the controller nor for a client.
pub struct Connections {
    served: Arc<Served>,
    listener: Listener,
    memory: Arc<Memory>,
    wake: OwnedFd,
    peers: Vec<Peer>,
    workers: Vec<Packets>,
    working: Arc<AtomicUsize>,
    connections: u64,
}

/// A connection that this thread looks after.
struct Peer {
    connection: Packets,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// It has the memory; the connection shows each side the end of the other.
    Observer,
    /// A client that has not said its role yet.
    Undecided,
    /// A client that may ask for stops, and has asked for so many.
    Stops { taken: u64 },
}

impl Connections {
    /// The connections of these sockets. It closes when the other end of `wake` is closed.
    pub fn new(served: Arc<Served>, listener: Listener, memory: Arc<Memory>, wake: OwnedFd) -> Self {
        let working = Arc::new(AtomicUsize::new(0));
        Self { served, listener, memory, wake, peers: vec![], workers: vec![], working, connections: 0 }
    }

    /// Looks after all connections until the server ends.
    pub fn run(mut self) {
        while !self.served.has_ended() {
            let ready = self.wait();
            self.attend_peers(&ready);
            self.let_in();
        }
        self.workers.iter().for_each(Packets::shut_down);
    }

    /// Waits until something happens, and returns at which peers.
    fn wait(&self) -> Vec<bool> {
        let own = [self.wake.as_fd(), self.listener.observers.as_fd(), self.listener.clients.as_fd()];
        let peers = self.peers.iter().map(|peer| peer.connection.descriptor());
        let mut all: Vec<PollFd<'_>> = own.into_iter().chain(peers).map(watched).collect();
        match poll(&mut all, PollTimeout::NONE) {
            Ok(_) | Err(Errno::EINTR) => {}
            Err(_) => thread::sleep(PAUSE),
        }
        all.iter().skip(own.len()).map(|peer| peer.any().unwrap_or(false)).collect()
    }

    fn attend_peers(&mut self, ready: &[bool]) {
        let mut words = [0; PACKET_WORDS];
        let peers = std::mem::take(&mut self.peers);
        let mut ready = ready.iter();
        for peer in peers {
            if ready.next() == Some(&true) {
                self.attend(peer, &mut words);
            } else {
                self.peers.push(peer);
            }
        }
    }

    /// Takes what a peer has sent. One that is gone, or sends what it may not, is disconnected.
    fn attend(&mut self, mut peer: Peer, words: &mut [u64; PACKET_WORDS]) {
        for _ in 0..STOPS_AT_ONCE {
            let count = match peer.connection.receive(words, false) {
                Received::Words(count) => count,
                Received::Nothing => break,
                Received::Closed => return,
            };
            let words = words.get(..count).unwrap_or_default();
            match &mut peer.kind {
                Kind::Observer => return,
                Kind::Undecided => return self.decide(peer.connection, Role::of(words)),
                Kind::Stops { taken } => match StopRequest::of(words) {
                    Ok(stop) if self.is_known(stop.target) => {
                        self.served.stops.note(stop.target, now_ns());
                        // It fails only when the controller has ended.
                        let _ = self.served.controller.request_stop(stop.target, stop.category);
                        *taken += 1;
                        // A client that does not receive it loses nothing but its own order.
                        let _ = peer.connection.send(&[*taken]);
                    }
                    _ => return,
                },
            }
        }
        self.peers.push(peer);
    }

    fn is_known(&self, target: RequestTarget) -> bool {
        target == RequestTarget::All || !self.served.controller.axes_of(target).is_empty()
    }

    fn decide(&mut self, connection: Packets, role: Option<Role>) {
        match role {
            None => {}
            Some(Role::Stops) => self.peers.push(Peer { connection, kind: Kind::Stops { taken: 0 } }),
            Some(Role::Commands) => self.employ(connection),
        }
    }

    /// Begins a thread for the commands of a client.
    fn employ(&mut self, connection: Packets) {
        self.workers.retain(|worker| !worker.is_closed());
        let refuse = |connection: &Packets| {
            // The client may be gone already.
            let reply = Reply::lease(LeaseError::TooManyClients);
            let _ = connection.send(&Answer { number: u64::MAX, slot: 0, reply }.words());
        };
        let (Ok(own), true) = (connection.try_clone(), self.working.load(Ordering::Acquire) < WORKERS) else {
            return refuse(&connection);
        };
        self.connections += 1;
        let claimant = Claimant { connection: self.connections, process: connection.process() };
        let worker = Worker::new(Arc::clone(&self.served), claimant);
        let counted = Counted::new(&self.working);
        let run = move || {
            let _counted = counted;
            worker.run(&connection);
        };
        match thread::Builder::new().name("takt-worker".into()).spawn(run) {
            Ok(_) => self.workers.push(own),
            Err(_) => refuse(&own),
        }
    }

    fn let_in(&mut self) {
        while let Some(connection) = accepted(self.listener.observers.as_fd()) {
            if self.peers.len() < PEERS && connection.send_memory(&self.memory).is_ok() {
                self.peers.push(Peer { connection, kind: Kind::Observer });
            }
        }
        while let Some(connection) = accepted(self.listener.clients.as_fd()) {
            if self.peers.len() < PEERS {
                self.peers.push(Peer { connection, kind: Kind::Undecided });
            }
        }
    }
}

/// The next connection that waits.
fn accepted(listening: BorrowedFd<'_>) -> Option<Packets> {
    accept(listening).unwrap_or_else(|_| {
        // There are no more descriptors, and it goes on waiting: poll would return at once.
        thread::sleep(PAUSE);
        None
    })
}

/// A descriptor to wait for.
fn watched(descriptor: BorrowedFd<'_>) -> PollFd<'_> {
    PollFd::new(descriptor, PollFlags::POLLIN)
}

/// One more at work, as long as it lives.
struct Counted(Arc<AtomicUsize>);

impl Counted {
    fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::AcqRel);
        Self(Arc::clone(count))
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}
