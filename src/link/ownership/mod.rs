//! One master for each bus. Two masters that command one arm would move it in ways that neither of them has planned.
//!
//! So a process locks every real interface before it sends its first frame on it: see [`InterfaceLock`]. Then it listens
//! there for a while, because another master may run on another host or be another program: see [`Listening`]. Simulated
//! buses are inside the process and need neither.

mod listening;
mod lock;
mod name_owner;

use std::io;

use nix::unistd::geteuid;
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, Clock, Nanoseconds, ReceiveBatch};

use super::interface::{self, InterfaceSettings};
use super::open_error::OpenError;
use super::real_interface::RealInterface;
use super::socketcan::SocketCanOptions;

pub use super::process::Process;
pub use listening::{CommandedDrive, HeardMaster, Listening, MasterActivity, MasterTraffic, Verdict};
pub use lock::{InterfaceLock, LockError, ReleaseError, Role, TakeOverError};

/// The pause between two polls of the buses. At most about forty frames pass a bus of 1 Mbit/s in it.
const POLL_NS: Nanoseconds = 2_000_000;

/// What happens when another process of this host is the master of an interface already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IfOwned {
    /// The start is refused.
    #[default]
    Refuse,
    /// That process is asked to stop in control, and its end is awaited. Another master that cannot be asked, on another
    /// host or of another program, is still refused. A process with CAP_NET_ADMIN continues without the lock if another
    /// user than root keeps it, and then listens for a master as ever.
    TakeOver,
}

/// An interface that is to be commanded.
#[derive(Clone, Debug)]
pub struct BusClaim {
    /// The name of the bus for people.
    pub bus: String,
    /// The interface.
    pub interface: RealInterface,
    /// How it is brought up if it is down.
    pub settings: InterfaceSettings,
    /// How another master is recognised on it.
    pub traffic: MasterTraffic,
}

/// Why this process may not command a bus. Nothing has been sent then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClaimError {
    /// The interface could not be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The lock could not be created.
    #[error("bus `{bus}`: locking {interface}: {error}")]
    Lock {
        /// The bus.
        bus: String,
        /// The interface.
        interface: String,
        /// What the system said.
        #[source]
        error: io::Error,
    },
    /// A process of this host has the same role on the interface.
    #[error("bus `{bus}`: {interface} has a {} already: {holder}. Nothing was sent. Stop that process first", role.name())]
    Held {
        /// The bus.
        bus: String,
        /// The interface.
        interface: String,
        /// Master or simulator.
        role: Role,
        /// The process.
        holder: Process,
    },
    /// A process of this host is the master of the interface and has not released it.
    #[error(
        "bus `{bus}`: {holder} is the master of {interface} and does not release it: {error}. Nothing was sent"
    )]
    NotReleased {
        /// The bus.
        bus: String,
        /// The interface.
        interface: String,
        /// The process.
        holder: Process,
        /// Why.
        error: ReleaseError,
    },
    /// Another master is active on the bus.
    #[error(
        "bus `{bus}`: another master is active on {interface}: {heard} was heard. Nothing was sent. That master is no takt \
         of this host and cannot be asked to stop: stop it first"
    )]
    OtherMaster {
        /// The bus.
        bus: String,
        /// The interface.
        interface: String,
        /// What was heard.
        heard: HeardMaster,
    },
}

impl ClaimError {
    /// Returns `true` if a process of a user that is neither root nor this one keeps the lock, whoever asks for it. Anybody in the network
    /// namespace can bind its name.
    fn is_of_stranger(&self) -> bool {
        matches!(self, Self::NotReleased { holder, .. } if holder.user != 0 && holder.user != geteuid().as_raw())
    }

    /// Returns `true` if [`IfOwned::TakeOver`] may help.
    pub const fn can_be_taken_over(&self) -> bool {
        matches!(self, Self::Held { role: Role::Master, .. })
    }
}

/// The right of this process to command its interfaces, until it is dropped.
#[derive(Debug, Default)]
pub struct Ownership {
    locks: Vec<InterfaceLock>,
}

impl Ownership {
    /// Takes the locks of these interfaces, and listens on all of them at once.
    ///
    /// # Errors
    /// See [`ClaimError`].
    pub fn claim(claims: Vec<BusClaim>, if_owned: IfOwned) -> Result<Self, ClaimError> {
        let mut named = vec![];
        for claim in claims {
            named.push((claim.interface.lock_name(&claim.bus)?, claim));
        }
        // All processes take the locks in the same order, so that no two of them wait for each other.
        named.sort_by(|(one, _), (other, _)| one.cmp(other));
        let mut locks = vec![];
        for (name, claim) in &named {
            match take(Role::Master, name, &claim.bus, &claim.interface, if_owned) {
                Ok(lock) => locks.push(lock),
                Err(error) if error.is_of_stranger() && interface::this_process_may_configure() => {
                    tracing::warn!("{error}. This process has CAP_NET_ADMIN and continues without the lock");
                }
                Err(error) => return Err(error),
            }
        }
        // Only now: until the lock is taken, the interface belongs to another process.
        for (_, claim) in &named {
            claim.interface.prepare(&claim.bus, &claim.settings)?;
        }
        let mut clock = MonotonicClock::default();
        let mut buses = vec![];
        // A serial line has one master by its wiring: nobody else of another host is on it.
        named.retain(|(_, claim)| claim.interface.is_can());
        for (_, claim) in &named {
            let options = SocketCanOptions::default();
            let port = claim.interface.open_prepared(&claim.bus, &claim.settings, &options)?;
            buses.push((port, Listening::new(claim.traffic.clone(), clock.now_ns())));
        }
        match listen(&mut buses, &mut clock) {
            None => Ok(Self { locks }),
            Some((bus, heard)) => {
                let (_, claim) = named.swap_remove(bus);
                Err(ClaimError::OtherMaster { bus: claim.bus, interface: claim.interface.to_string(), heard })
            }
        }
    }

    /// Takes the lock of an interface that has taken the place of a claimed one, and prepares it.
    ///
    /// # Errors
    /// See [`ClaimError`].
    pub fn claim_successor(&mut self, claim: &BusClaim) -> Result<(), ClaimError> {
        let name = claim.interface.lock_name(&claim.bus)?;
        match take(Role::Master, &name, &claim.bus, &claim.interface, IfOwned::Refuse) {
            Ok(lock) => self.locks.push(lock),
            Err(ClaimError::Held { holder, .. }) if holder.is_this() => {}
            Err(error) => return Err(error),
        }
        claim.interface.prepare(&claim.bus, &claim.settings)?;
        Ok(())
    }

    /// With these locks, whatever they are of.
    #[cfg(test)]
    pub(crate) const fn of_locks(locks: Vec<InterfaceLock>) -> Self {
        Self { locks }
    }

    /// The process that asks this one to stop in control and to release its interfaces, if there is one. Does not block.
    pub fn poll_release_request(&mut self) -> Option<Process> {
        let mut asking = None;
        for lock in &mut self.locks {
            asking = lock.poll_release_request().or(asking);
        }
        asking
    }
}

/// Locks an interface for a simulator of drives. A simulator waits for a master, so it does not listen for one.
///
/// # Errors
/// See [`ClaimError`].
pub fn lock_for_simulator(bus: &str, interface: &RealInterface) -> Result<InterfaceLock, ClaimError> {
    take(Role::Simulator, &interface.lock_name(bus)?, bus, interface, IfOwned::Refuse)
}

fn take(
    role: Role,
    name: &str,
    bus: &str,
    interface: &RealInterface,
    if_owned: IfOwned,
) -> Result<InterfaceLock, ClaimError> {
    let (bus, interface) = (bus.to_owned(), interface.to_string());
    match if_owned {
        IfOwned::Refuse => InterfaceLock::take(role, name).map_err(|error| match error {
            LockError::Held(holder) => ClaimError::Held { bus, interface, role, holder },
            LockError::System(error) => ClaimError::Lock { bus, interface, error },
        }),
        IfOwned::TakeOver => InterfaceLock::take_over(role, name).map_err(|error| match error {
            TakeOverError::NotReleased { holder, error } => {
                ClaimError::NotReleased { bus, interface, holder, error }
            }
            TakeOverError::System(error) => ClaimError::Lock { bus, interface, error },
        }),
    }
}

/// Listens until another master is heard on one of the buses, or all of them are free.
fn listen<P: BusPort>(buses: &mut [(P, Listening)], clock: &mut impl Clock) -> Option<(usize, HeardMaster)> {
    loop {
        let now_ns = clock.now_ns();
        let mut is_undecided = false;
        for (index, (port, listening)) in buses.iter_mut().enumerate() {
            receive_all(port, now_ns, listening);
            match listening.verdict(now_ns) {
                Verdict::Occupied(heard) => return Some((index, heard)),
                Verdict::Undecided => is_undecided = true,
                Verdict::Free => {}
            }
        }
        if !is_undecided {
            return None;
        }
        clock.wait_until(now_ns + POLL_NS);
    }
}

fn receive_all(port: &mut impl BusPort, now_ns: Nanoseconds, listening: &mut Listening) {
    // Bounded, because a bus may receive frames as fast as they are read.
    for _ in 0..BATCHES {
        let mut batch = ReceiveBatch::new();
        port.receive(now_ns, &mut batch);
        batch.iter().for_each(|received| listening.receive(&received.frame));
        if !batch.is_full() {
            return;
        }
    }
}

/// Batches that are read from a bus in one poll: more frames than its socket keeps.
const BATCHES: usize = 32;

#[cfg(test)]
mod tests {
    use std::os::fd::AsRawFd;
    use std::os::unix::net::UnixDatagram;

    use takt_rt::linux::SocketCanPort;
    use takt_rt::{Frame, Id};

    use super::*;
    use takt_rt::Wake;

    /// Jumps to the end of every wait.
    #[derive(Default)]
    struct JumpingClock {
        now_ns: Nanoseconds,
    }

    impl Clock for JumpingClock {
        fn now_ns(&mut self) -> Nanoseconds {
            self.now_ns
        }

        fn wait_until(&mut self, deadline_ns: Nanoseconds) -> Wake {
            self.now_ns = deadline_ns;
            Wake { now_ns: deadline_ns, ..Wake::default() }
        }

        fn wait_to_send(&mut self, deadline_ns: Nanoseconds) -> Wake {
            self.wait_until(deadline_ns)
        }
    }

    /// Two buses that are listened to, and the other ends of them.
    fn listened() -> (Vec<(SocketCanPort, Listening)>, Vec<SocketCanPort>) {
        let port = |socket: &UnixDatagram| SocketCanPort::new(socket.as_raw_fd(), 1_000_000, None).unwrap();
        let pairs = [1, 4].map(|node| {
            let (ours, theirs) = UnixDatagram::pair().unwrap();
            let traffic = MasterTraffic::without_configuration(Some(node));
            ((port(&ours), Listening::new(traffic, 0)), port(&theirs))
        });
        pairs.into_iter().unzip()
    }

    #[test]
    fn a_silent_bus_and_one_with_drives_only_are_free_at_the_end_of_the_time() {
        let (mut ours, mut theirs) = listened();
        let feedback = Frame::of(Id::canopen(0x180, 4), [0; 8]);
        assert_eq!(theirs[1].send(0, &[feedback; 100]), 100);
        let mut clock = JumpingClock::default();
        assert_eq!(listen(&mut ours, &mut clock), None);
        assert_eq!(clock.now_ns(), 300_000_000);
    }

    #[test]
    fn a_lock_that_is_kept_is_of_a_stranger_unless_root_or_this_user_keeps_it() {
        let kept_by = |user| ClaimError::NotReleased {
            bus: "arm".to_owned(),
            interface: "can0".to_owned(),
            holder: Process { pid: 1, user },
            error: ReleaseError::Unanswered,
        };
        let own = geteuid().as_raw();
        assert!(!kept_by(0).is_of_stranger() && !kept_by(own).is_of_stranger());
        assert!(kept_by(own + 1).is_of_stranger());
    }

    #[test]
    fn a_master_is_found_on_its_bus_behind_the_frames_of_the_drives_and_at_once() {
        let (mut ours, mut theirs) = listened();
        let feedback = Frame::of(Id::canopen(0x180, 4), [0; 8]);
        assert_eq!(theirs[1].send(0, &[feedback; 100]), 100);
        assert_eq!(theirs[1].send(0, &[Frame::of(Id::canopen(0x080, 0), [])]), 1);
        let mut clock = JumpingClock::default();
        let (bus, heard) = listen(&mut ours, &mut clock).expect("there is a master");
        assert_eq!((bus, heard.activity), (1, MasterActivity::Sync));
        assert_eq!(clock.now_ns(), 0);
    }
}
