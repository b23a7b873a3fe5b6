//! One master, and one simulator, for each CAN interface of a host.
//!
//! The lock is an abstract Unix socket that is named after the interface and listened on. The kernel lets go of it
//! with the process, whatever ends that (`kill -9`, too); it needs no folder, no rights and no cleaning up; it holds
//! between all users; and like the interface itself it belongs to one network namespace. Whoever connects is told by
//! the kernel which process holds the lock, and may ask that process to come to a controlled stop and release it.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::socket::{getsockopt, sockopt::PeerCredentials};
use nix::unistd::geteuid;

/// What is asked of the holder, and what the holder answers.
const REQUEST: &[u8] = b"release\n";
const AGREED: u8 = b'y';
const DENIED: u8 = b'n';

/// Between two attempts to take a lock that is just being taken or released.
const RETRY: Duration = Duration::from_millis(5);
/// A holder that lives has answered a request by then; it looks for one about once in a millisecond.
const ANSWER_PATIENCE: Duration = Duration::from_secs(2);
/// A holder that stops in control has released the lock by then.
const RELEASE_PATIENCE: Duration = Duration::from_secs(30);
/// Connections whose request has not arrived yet, at most. The oldest one is closed for a new one.
const UNREAD_CONNECTIONS: usize = 16;

/// What a process does on an interface. One of each may be on it.
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

/// A process at the other end of a lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Process {
    /// Its process ID; 0 for one in a container, whose processes cannot be seen from here.
    pub pid: i32,
    /// The user it belongs to.
    pub user: u32,
}

impl fmt::Display for Process {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.pid {
            0 => write!(f, "a process in a container (user {})", self.user),
            pid => write!(f, "process {pid} (user {})", self.user),
        }
    }
}

/// Why there is no lock.
#[derive(Debug)]
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
pub enum ReleaseError {
    /// It belongs to another user, and only root and the same user may ask.
    #[error("it belongs to another user; only that user and root may have it stopped")]
    Denied,
    /// It does not answer.
    #[error("it does not answer")]
    Unanswered,
    /// It has agreed, and has not come to an end.
    #[error("it has agreed to stop and has not come to an end in {} s", RELEASE_PATIENCE.as_secs())]
    Unfinished,
}

/// The right to be master or simulator on an interface. Dropping it releases it.
#[derive(Debug)]
pub struct InterfaceLock {
    // Dropped first: the name is free before those who wait for it are told.
    listener: UnixListener,
    /// Those whose request has not arrived yet.
    unread: Vec<UnixStream>,
    /// Those who wait for the release, which is the end of the connection.
    waiting: Vec<UnixStream>,
}

fn address(role: Role, interface: &str) -> io::Result<SocketAddr> {
    SocketAddr::from_abstract_name(format!("takt/{}/{interface}", role.name()))
}

impl InterfaceLock {
    /// Takes the lock. `interface` names the interface for as long as it exists.
    ///
    /// # Errors
    /// See [`LockError`].
    pub fn take(role: Role, interface: &str) -> Result<Self, LockError> {
        let address = address(role, interface)?;
        let began = Instant::now();
        loop {
            match UnixListener::bind_addr(&address) {
                Ok(listener) => {
                    listener.set_nonblocking(true)?;
                    return Ok(Self { listener, unread: vec![], waiting: vec![] });
                }
                Err(error) if error.kind() == ErrorKind::AddrInUse => {}
                Err(error) => return Err(error.into()),
            }
            match UnixStream::connect_addr(&address) {
                Ok(stream) => return Err(LockError::Held(peer(&stream)?)),
                // The holder has bound it and does not listen yet, or has just released it.
                Err(error)
                    if error.kind() == ErrorKind::ConnectionRefused && began.elapsed() < ANSWER_PATIENCE => {}
                Err(error) => return Err(error.into()),
            }
            thread::sleep(RETRY);
        }
    }

    /// As [`InterfaceLock::take`]; whoever has it is asked to come to a controlled stop and release it, and is waited
    /// for.
    ///
    /// # Errors
    /// [`TakeOverError`].
    pub fn take_over(role: Role, interface: &str) -> Result<Self, TakeOverError> {
        loop {
            let holder = match Self::take(role, interface) {
                Ok(lock) => return Ok(lock),
                Err(LockError::Held(holder)) => holder,
                Err(LockError::System(error)) => return Err(TakeOverError::System(error)),
            };
            ask_for_release(role, interface)
                .map_err(TakeOverError::System)?
                .map_err(|error| TakeOverError::NotReleased { holder, error })?;
        }
    }

    /// Whether somebody who may do so asks for the lock. Once it is told, the holder is to stop in control and to drop
    /// the lock. Does not block.
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
                // Only wanted to know who holds the lock.
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

/// Asks the holder and waits until it has released the lock.
fn ask_for_release(role: Role, interface: &str) -> io::Result<Result<(), ReleaseError>> {
    let mut stream = match UnixStream::connect_addr(&address(role, interface)?) {
        Ok(stream) => stream,
        // It has just been released.
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => return Ok(Ok(())),
        Err(error) => return Err(error),
    };
    stream.set_read_timeout(Some(ANSWER_PATIENCE))?;
    let mut answer = [0];
    // A holder that has just come to its end is no error: what it has not read is then reset.
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
