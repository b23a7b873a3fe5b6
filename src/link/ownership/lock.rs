//! One master, and one simulator, for each CAN interface of a host.
//!
//! The lock is a listening Unix socket with an abstract name, made from the role and the interface. The kernel removes
//! it when the process ends, also after `kill -9`. It needs no folder, no rights and no cleaning up, and it works across
//! users. Like the interface itself, the name belongs to one network namespace. A second process that connects learns
//! from the kernel which process holds the lock. It may ask that process to stop in control and to release the lock.
//!
//! Any process can bind the name and accept no connection, so nothing waits for a holder without a bound.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::socket::sockopt::PeerCredentials;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, UnixAddr, connect, getsockopt, socket};
use nix::unistd::geteuid;

use super::name_owner;
use crate::link::process::Process;

/// The request to the holder, and its answers.
const REQUEST: &[u8] = b"release\n";
const AGREED: u8 = b'y';
const DENIED: u8 = b'n';

/// The pause before the next attempt, when another process is just taking or releasing the lock.
const RETRY: Duration = Duration::from_millis(5);
/// How long to try to connect to the holder. A healthy one accepts connections about once in a millisecond.
const CONNECT_PATIENCE: Duration = Duration::from_secs(1);
/// How long to wait for the answer. A healthy holder polls for requests about once in a millisecond.
const ANSWER_PATIENCE: Duration = Duration::from_secs(2);
/// How long to wait for the release. A controlled stop takes a few seconds at most.
const RELEASE_PATIENCE: Duration = Duration::from_secs(30);
/// Connections whose request has not arrived yet, at most. The oldest one is closed for a new one.
const UNREAD_CONNECTIONS: usize = 16;

/// The role of a process on an interface. There may be one process of each role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Commands the drives.
    Master,
    /// Plays the drives.
    Simulator,
}

impl Role {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Master => "master",
            Self::Simulator => "simulator",
        }
    }
}

/// Why there is no lock.
#[derive(Debug)]
#[non_exhaustive]
pub enum LockError {
    /// Another process has it.
    Held(Process),
    /// The system refused.
    System(io::Error),
}

impl From<io::Error> for LockError {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

/// Why a lock was not released.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReleaseError {
    /// The holder belongs to another user; only that user and root may ask.
    #[error("it belongs to another user; only that user and root may have it stopped")]
    Denied,
    /// The holder does not answer.
    #[error("it does not answer")]
    Unanswered,
    /// The holder has agreed, and has not released the lock in time.
    #[error("it has agreed to stop and has not come to an end in {} s", RELEASE_PATIENCE.as_secs())]
    Unfinished,
}

/// The right to be master or simulator on an interface. Dropping it releases it.
#[derive(Debug)]
pub struct InterfaceLock {
    // Dropped first: the name must be free before the waiting processes see the end of their connection.
    listener: UnixListener,
    /// Connections whose request has not arrived yet.
    unread: Vec<UnixStream>,
    /// Connections of processes that wait for the release. They see it as the end of the connection.
    waiting: Vec<UnixStream>,
}

fn socket_name(role: Role, interface: &str) -> String {
    format!("takt/{}/{interface}", role.name())
}

/// What an attempt to take a lock has found.
enum Found {
    /// It was free.
    Free(InterfaceLock),
    /// Its holder, to which there is a connection.
    Holder(Process, UnixStream),
    /// A process that has its name and accepts no connection.
    Silent(Process),
}

impl InterfaceLock {
    /// Takes the lock. `interface` names the interface for as long as it exists.
    ///
    /// # Errors
    /// See [`LockError`].
    pub fn take(role: Role, interface: &str) -> Result<Self, LockError> {
        match Self::attempt(&socket_name(role, interface))? {
            Found::Free(lock) => Ok(lock),
            Found::Holder(process, _) | Found::Silent(process) => Err(LockError::Held(process)),
        }
    }

    /// Takes the lock. If another process holds it, that process is asked to stop in control and to release it, and this
    /// call waits for that.
    ///
    /// # Errors
    /// [`TakeOverError`].
    pub fn take_over(role: Role, interface: &str) -> Result<Self, TakeOverError> {
        let (name, began) = (socket_name(role, interface), Instant::now());
        loop {
            let (holder, released) = match Self::attempt(&name)? {
                Found::Free(lock) => return Ok(lock),
                // Whoever says that it has released the lock and does not is not asked for ever.
                Found::Holder(holder, _) if began.elapsed() > RELEASE_PATIENCE => {
                    (holder, Err(ReleaseError::Unfinished))
                }
                Found::Holder(holder, stream) => (holder, ask_for_release(stream)?),
                Found::Silent(holder) => (holder, Err(ReleaseError::Unanswered)),
            };
            released.map_err(|error| TakeOverError::NotReleased { holder, error })?;
        }
    }

    fn attempt(name: &str) -> io::Result<Found> {
        let address = SocketAddr::from_abstract_name(name)?;
        let began = Instant::now();
        loop {
            match UnixListener::bind_addr(&address) {
                Ok(listener) => {
                    listener.set_nonblocking(true)?;
                    return Ok(Found::Free(Self { listener, unread: vec![], waiting: vec![] }));
                }
                Err(error) if error.kind() == ErrorKind::AddrInUse => {}
                Err(error) => return Err(error),
            }
            match connect_to(name) {
                Ok(stream) => return Ok(Found::Holder(peer(&stream)?, stream)),
                // The holder has bound the socket and does not listen yet, it has just released it, or too many connect.
                Err(error) if is_silence(&error) && began.elapsed() < CONNECT_PATIENCE => {}
                Err(error) if is_silence(&error) => {
                    return name_owner::owner_of(name)?.map(Found::Silent).ok_or_else(unknown_holder);
                }
                Err(error) => return Err(error),
            }
            thread::sleep(RETRY);
        }
    }

    /// Answers requests for release. Returns the process that may take over; the holder is then to stop in control and to
    /// drop the lock. Does not block.
    pub fn poll_release_request(&mut self) -> Option<Process> {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.unread.len() == UNREAD_CONNECTIONS {
                self.unread.remove(0);
            }
            if stream.set_nonblocking(true).is_ok() {
                self.unread.push(stream);
            }
        }
        let mut asking = None;
        for stream in std::mem::take(&mut self.unread) {
            match read_request(&stream) {
                Request::NotYet => self.unread.push(stream),
                // The other process only wanted to know the holder.
                Request::Other => {}
                Request::Release(process) => {
                    let is_entitled = process.user == 0 || process.user == geteuid().as_raw();
                    let answer = if is_entitled { AGREED } else { DENIED };
                    let is_told = (&stream).write_all(&[answer]).is_ok();
                    if is_entitled && is_told {
                        asking = Some(process);
                        self.waiting.push(stream);
                    }
                }
            }
        }
        asking
    }
}

/// Why a lock was not taken over.
#[derive(Debug)]
#[non_exhaustive]
pub enum TakeOverError {
    /// The process that has it does not give it up.
    NotReleased {
        /// The process.
        holder: Process,
        /// Why.
        error: ReleaseError,
    },
    /// The system refused.
    System(io::Error),
}

impl From<io::Error> for TakeOverError {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

enum Request {
    NotYet,
    Other,
    Release(Process),
}

fn read_request(mut stream: &UnixStream) -> Request {
    let mut bytes = [0; REQUEST.len()];
    match stream.read(&mut bytes) {
        Ok(read) if bytes.get(..read) == Some(REQUEST) => {
            peer(stream).map_or(Request::Other, Request::Release)
        }
        Err(error) if error.kind() == ErrorKind::WouldBlock => Request::NotYet,
        _ => Request::Other,
    }
}

fn peer(stream: &UnixStream) -> io::Result<Process> {
    let credentials = getsockopt(stream, PeerCredentials)?;
    Ok(Process { pid: credentials.pid(), user: credentials.uid() })
}

/// Connects, without waiting for room among the connections that have not been accepted.
fn connect_to(name: &str) -> io::Result<UnixStream> {
    let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
    let stream = socket(AddressFamily::Unix, SockType::Stream, flags, None)?;
    connect(stream.as_raw_fd(), &UnixAddr::new_abstract(name.as_bytes())?)?;
    let stream = UnixStream::from(stream);
    stream.set_nonblocking(false)?;
    Ok(stream)
}

/// Returns `true` if nobody listens at the name, or too many connections have not been accepted.
fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::WouldBlock)
}

fn unknown_holder() -> io::Error {
    io::Error::other("another process has its name and accepts no connection; only root can find which one")
}

/// Asks the holder and waits until it has released the lock.
fn ask_for_release(mut stream: UnixStream) -> io::Result<Result<(), ReleaseError>> {
    stream.set_read_timeout(Some(ANSWER_PATIENCE))?;
    let mut answer = [0];
    // If the holder has just ended, the connection is reset: that is a release, and no error.
    let answered = stream.write_all(REQUEST).and_then(|()| stream.read(&mut answer));
    match (answered, answer) {
        (Ok(1), [DENIED]) => return Ok(Err(ReleaseError::Denied)),
        (Ok(1), _) => {}
        (Err(error), _) if is_time_out(&error) => return Ok(Err(ReleaseError::Unanswered)),
        _ => return Ok(Ok(())),
    }
    stream.set_read_timeout(Some(RELEASE_PATIENCE))?;
    match stream.read(&mut answer) {
        Err(error) if is_time_out(&error) => Ok(Err(ReleaseError::Unfinished)),
        _ => Ok(Ok(())),
    }
}

fn is_time_out(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
