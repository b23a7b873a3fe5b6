//! Who comes and goes, and who asks for a stop.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::unistd::geteuid;
use takt::command::LeaseError;
use takt_rt::RequestTarget;

use super::lease::Claimant;
use super::served::Served;
use super::worker::Worker;
use crate::commands::StopRequest;
use crate::memory::Memory;
use crate::replies::{Answer, Replied};
use crate::shown::now_ns;
use crate::socket::{Listener, PACKET_BYTES, Packets, Received, Role, accept};

/// Places for observers, for connections that ask for stops, and for those that have not said their role: none of them takes one of
/// the others.
const PEERS: usize = 128;
/// Places for clients with commands: each has a thread.
const WORKERS: usize = 32;
/// Time for a connection to say its role.
const DECIDED_WITHIN: Duration = Duration::from_secs(1);
/// Connections that are accepted before the peers are attended to again.
const ACCEPTED_AT_ONCE: usize = 64;
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
    workers: Vec<Employed>,
    working: Arc<AtomicUsize>,
    connections: u64,
}

/// A connection that this thread looks after.
struct Peer {
    connection: Packets,
    user: u32,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// It has the memory; the connection shows each side the end of the other.
    Observer,
    /// A client that has not said its role yet, and is closed at this time.
    Undecided { until: Instant },
    /// A client that may ask for stops, and has asked for this many. One that has found no place is closed at `until`.
    Stops { taken: u64, until: Option<Instant> },
}

impl Kind {
    /// The time at which it is closed.
    const fn until(self) -> Option<Instant> {
        match self {
            Self::Undecided { until } => Some(until),
            Self::Stops { until, .. } => until,
            Self::Observer => None,
        }
    }

    const fn is_observer(self) -> bool {
        matches!(self, Self::Observer)
    }

    /// True if it asks for stops, and has a place for that.
    const fn is_placed_for_stops(self) -> bool {
        matches!(self, Self::Stops { until: None, .. })
    }

    /// True if it has only time, and no place.
    const fn is_temporary(self) -> bool {
        self.until().is_some()
    }
}

/// A thread that carries the commands of a client out.
struct Employed {
    connection: Packets,
    user: u32,
}

/// Returns `true` if a connection of `user` finds one of `places`, which connections of `present` have. The user of this process and root
/// may have all of them. Another user may have a quarter, and all others together three quarters.
fn has_room(places: usize, user: u32, own: u32, present: impl Iterator<Item = u32>) -> bool {
    let is_stranger = |user: u32| user != own && user != 0;
    let (mut all, mut of_strangers, mut of_user) = (0, 0, 0);
    for other in present {
        all += 1;
        of_strangers += usize::from(is_stranger(other));
        of_user += usize::from(other == user);
    }
    all < places && (!is_stranger(user) || of_user < places / 4 && of_strangers < places / 4 * 3)
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
        self.workers.iter().for_each(|worker| worker.connection.shut_down());
    }

    /// Waits until something happens or the time of a peer is over, and returns the peers at which something has happened.
    fn wait(&self) -> Vec<bool> {
        let own = [self.wake.as_fd(), self.listener.observers.as_fd(), self.listener.clients.as_fd()];
        let peers = self.peers.iter().map(|peer| peer.connection.descriptor());
        let mut all: Vec<PollFd<'_>> = own.into_iter().chain(peers).map(watched).collect();
        let next = self.peers.iter().filter_map(|peer| peer.kind.until()).min();
        // Rounded up: in the last millisecond it would return at once, again and again.
        let left = next.map(|next| next.saturating_duration_since(Instant::now()) + Duration::from_millis(1));
        let at_most = left.map_or(PollTimeout::NONE, |left| left.try_into().unwrap_or(PollTimeout::MAX));
        match poll(&mut all, at_most) {
            Ok(_) | Err(Errno::EINTR) => {}
            Err(_) => thread::sleep(PAUSE),
        }
        all.iter().skip(own.len()).map(|peer| peer.any().unwrap_or(false)).collect()
    }

    fn attend_peers(&mut self, ready: &[bool]) {
        let mut packet = [0; PACKET_BYTES];
        let peers = std::mem::take(&mut self.peers).into_iter().zip(ready.iter().copied());
        let (ready, idle): (Vec<_>, Vec<_>) = peers.partition(|(_, is_ready)| *is_ready);
        // All of them count for the places.
        self.peers.extend(idle.into_iter().map(|(peer, _)| peer));
        ready.into_iter().for_each(|(peer, _)| self.attend(peer, &mut packet));
        let now = Instant::now();
        self.peers.retain(|peer| peer.kind.until().is_none_or(|until| now < until));
    }

    /// Takes what a peer has sent. One that is gone, or sends what it may not, is disconnected.
    fn attend(&mut self, mut peer: Peer, packet: &mut [u8; PACKET_BYTES]) {
        for _ in 0..STOPS_AT_ONCE {
            let count = match peer.connection.receive(packet, false) {
                Received::Bytes(count) => count,
                Received::Nothing => break,
                Received::Closed => return,
            };
            let packet = packet.get(..count).unwrap_or_default();
            match &mut peer.kind {
                Kind::Observer => return,
                Kind::Undecided { until } => match Role::of(packet) {
                    None => return,
                    Some(Role::Stops) => {
                        let has_place = self.has_room(PEERS, peer.user, Kind::is_placed_for_stops);
                        peer.kind = Kind::Stops { taken: 0, until: (!has_place).then_some(*until) };
                    }
                    Some(Role::Commands) => return self.employ(peer.connection, peer.user),
                },
                Kind::Stops { taken, .. } => match StopRequest::of(packet) {
                    Some(stop) if self.is_known(stop.target) => {
                        self.served.stops.note(stop.target, now_ns());
                        // It fails only when the controller has ended.
                        let _ = self.served.controller.backend().stop(stop.target, stop.category);
                        *taken += 1;
                        // A client that does not receive it loses nothing but its own order.
                        let _ = peer.connection.send(&taken.to_ne_bytes());
                    }
                    _ => return,
                },
            }
        }
        self.peers.push(peer);
    }

    fn is_known(&self, target: RequestTarget) -> bool {
        target == RequestTarget::All || !self.served.controller.backend().axes_of(target).is_empty()
    }

    fn has_room(&self, places: usize, user: u32, is_of_kind: impl Fn(Kind) -> bool) -> bool {
        let present = self.peers.iter().filter(|peer| is_of_kind(peer.kind)).map(|peer| peer.user);
        has_room(places, user, geteuid().as_raw(), present)
    }

    /// Begins a thread for the commands of a client.
    fn employ(&mut self, connection: Packets, user: u32) {
        self.workers.retain(|worker| !worker.connection.is_closed());
        let refuse = |connection: &Packets| {
            // The client may be gone already.
            let reply = Replied::Command(Err(LeaseError::TooManyClients.into()));
            let _ = connection.send(&Answer { number: u64::MAX, slot: 0, reply }.packet());
        };
        let has_place = self.working.load(Ordering::Acquire) < WORKERS
            && has_room(WORKERS, user, geteuid().as_raw(), self.workers.iter().map(|worker| worker.user));
        let (Ok(own), true) = (connection.try_clone(), has_place) else {
            return refuse(&connection);
        };
        self.connections += 1;
        let claimant = Claimant { connection: self.connections, process: connection.peer().pid as u32 };
        let worker = Worker::new(Arc::clone(&self.served), claimant);
        let counted = Counted::new(&self.working);
        let run = move || {
            let _counted = counted;
            worker.run(&connection);
        };
        match thread::Builder::new().name("takt-worker".into()).spawn(run) {
            Ok(_) => self.workers.push(Employed { connection: own, user }),
            Err(_) => refuse(&own),
        }
    }

    fn let_in(&mut self) {
        for _ in 0..ACCEPTED_AT_ONCE {
            let Some(connection) = accepted(self.listener.observers.as_fd()) else { break };
            let user = connection.peer().user;
            if self.has_room(PEERS, user, Kind::is_observer) && connection.send_memory(&self.memory).is_ok() {
                self.peers.push(Peer { connection, user, kind: Kind::Observer });
            }
        }
        for _ in 0..ACCEPTED_AT_ONCE {
            let Some(connection) = accepted(self.listener.clients.as_fd()) else { break };
            let user = connection.peer().user;
            // Without a free place it takes that of the oldest one of its user.
            let oldest = self.peers.iter().position(|peer| peer.user == user && peer.kind.is_temporary());
            if !self.has_room(PEERS, user, Kind::is_temporary)
                && let Some(oldest) = oldest
            {
                self.peers.remove(oldest);
            }
            if self.has_room(PEERS, user, Kind::is_temporary) {
                let kind = Kind::Undecided { until: Instant::now() + DECIDED_WITHIN };
                self.peers.push(Peer { connection, user, kind });
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strangers_leave_places_to_each_other_and_to_the_user_of_this_process_and_root() {
        let (own, one, other) = (1000, 65_534, 65_533);
        let room = |user, present: &[(u32, usize)]| {
            let present = present.iter().flat_map(|(user, count)| std::iter::repeat_n(*user, *count));
            has_room(128, user, own, present)
        };
        assert!(room(one, &[(one, 31)]) && !room(one, &[(one, 32)]));
        assert!(room(other, &[(one, 32)]));
        let strangers = [(1, 32), (2, 32), (3, 32)];
        assert!(!room(one, &strangers) && room(own, &strangers) && room(0, &strangers));
        assert!(room(own, &[(own, 127)]) && !room(own, &[(own, 128)]));
    }
}
