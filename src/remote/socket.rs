//! The local sockets by which processes meet: one for observers, who get the memory, and one for clients, who send packets.
//!
//! A packet is a sequence of 64-bit words. The kernel hands it over whole or not at all (`SOCK_SEQPACKET`). To connect to a socket a process
//! needs write permission for its file: so the permissions of the two files say who observes and who commands.

use std::fs::{self, File, Permissions, TryLockError};
use std::io::{self, IoSlice, IoSliceMut};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{
    AddressFamily, Backlog, ControlMessage, ControlMessageOwned, MsgFlags, SockFlag, SockType, UnixAddr,
    accept4, bind, connect, getsockopt, listen, recv, recvmsg, send, sendmsg, setsockopt, socket, sockopt,
};
use nix::sys::time::TimeVal;

use super::layout::{MAGIC, VERSION};
use super::memory::{Memory, owned};
use crate::link::ownership::Process;

/// The words of the longest packet.
pub const PACKET_WORDS: usize = 8192;
/// Connections that wait to be accepted.
const BACKLOG: i32 = 64;
/// The longest path of a socket (`sun_path`, without its last zero).
const PATH_BYTES: usize = 107;
/// A process that serves accepts a connection, and hands its memory over, within this time each.
pub const CONNECTED_WITHIN: Duration = Duration::from_secs(5);

/// What a connection of a client is for: the first word that it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Commands, each of which has a reply.
    Commands = 1,
    /// Stops, which have none.
    Stops = 2,
}

impl Role {
    /// The first packet of a connection.
    pub const fn words(self) -> [u64; 3] {
        [MAGIC, VERSION, self as u64]
    }

    /// The role of the first packet of a connection.
    pub fn of(words: &[u64]) -> Option<Self> {
        match words {
            [MAGIC, VERSION, 1] => Some(Self::Commands),
            [MAGIC, VERSION, 2] => Some(Self::Stops),
            _ => None,
        }
    }
}

/// The files of a name.
#[derive(Clone, Debug)]
pub struct Names {
    /// As it was given.
    pub name: String,
    observe: PathBuf,
    command: PathBuf,
    lock: PathBuf,
}

/// Why a name cannot be one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name:?} is not a name to serve by: letters, digits, '.', '-' and '_', or the beginning of a path, of at most {} bytes",
    PATH_BYTES - ".command.new".len()
)]
#[cfg_attr(
    not(feature = "internals"),
    allow(unnameable_types, reason = "it becomes a ConnectError or a ServeError at once")
)]
pub struct NameError {
    name: String,
}

impl Names {
    /// The files of a name: in /dev/shm, or, for a name with a slash, where that path leads.
    pub fn new(name: &str) -> Result<Self, NameError> {
        let is_plain = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-' | '_');
        let base = match name.contains('/') {
            true => name.to_owned(),
            false => format!("/dev/shm/takt-{name}"),
        };
        let is_name =
            !name.is_empty() && !name.ends_with('/') && (name.contains('/') || name.chars().all(is_plain));
        let is_short = base.len() + ".command.new".len() <= PATH_BYTES;
        if !is_name || !is_short || name.contains('\0') {
            return Err(NameError { name: name.to_owned() });
        }
        let file = |end: &str| PathBuf::from(format!("{base}.{end}"));
        Ok(Self {
            name: name.to_owned(),
            observe: file("observe"),
            command: file("command"),
            lock: file("lock"),
        })
    }

    /// The socket for observers.
    pub fn observe(&self) -> &Path {
        &self.observe
    }

    /// The socket for clients that command.
    pub fn command(&self) -> &Path {
        &self.command
    }
}

/// Why a process cannot listen, or cannot connect.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// Another process has the name.
    #[error("another process serves by this name")]
    InUse,
    /// A file cannot be used.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

fn at(path: &Path) -> impl Fn(io::Error) -> SocketError {
    |error| SocketError::File { path: path.to_owned(), error }
}

/// The sockets of a process that serves. Their files are gone when this is dropped.
pub struct Listener {
    names: Names,
    /// For observers.
    pub observers: OwnedFd,
    /// For clients that command.
    pub clients: OwnedFd,
    /// Held by a lock as long as this process lives.
    _lock: File,
}

impl Listener {
    /// Listens by a name. Of `mode` the read bits say who observes, the write bits who commands.
    pub fn new(names: Names, mode: u32) -> Result<Self, SocketError> {
        let lock_failed = at(&names.lock);
        // A file of another user is not created, but opened: Linux refuses the former in a folder that all may write.
        let lock = File::open(&names.lock).or_else(|error| match error.kind() {
            io::ErrorKind::NotFound => File::options().create(true).append(true).open(&names.lock),
            _ => Err(error),
        });
        let lock = lock.map_err(&lock_failed)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(SocketError::InUse),
            Err(TryLockError::Error(error)) => return Err(lock_failed(error)),
        }
        drop(lock_failed);
        let listening = |path: &Path, classes: u32| listening(path, classes * 0o6).map_err(at(path));
        // One bit for each class of users, by its read and by its write bit.
        let observers = listening(&names.observe, (mode >> 2) & 0o111)?;
        let clients = listening(&names.command, (mode >> 1) & 0o111)?;
        Ok(Self { names, observers, clients, _lock: lock })
    }
}

impl Listener {
    /// The names in /dev/shm that a process serves by at present, in their order.
    #[cfg(feature = "cli")]
    pub fn names_in_use() -> Vec<String> {
        let entries = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        let name = |file: &str| Some(file.strip_prefix("takt-")?.strip_suffix(".observe")?.to_owned());
        let names = entries.filter_map(|entry| name(entry.file_name().to_str()?));
        let is_served = |name: &String| Names::new(name).is_ok_and(|names| Self::is_in_use(&names));
        let mut names: Vec<String> = names.filter(is_served).collect();
        names.sort();
        names
    }

    /// Whether another process has a name.
    #[cfg(feature = "cli")]
    pub fn is_in_use(names: &Names) -> bool {
        let lock = File::open(&names.lock);
        lock.is_ok_and(|lock| matches!(lock.try_lock(), Err(TryLockError::WouldBlock)))
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        // Nobody else has the name while the lock is held. The file of the lock stays, so that no two processes hold a lock each.
        for path in [&self.names.observe, &self.names.command] {
            let _ = fs::remove_file(path);
        }
    }
}

/// A socket at this path, in place of one that a process has left there that is no more. It is there with its permissions, and listens.
fn listening(path: &Path, permissions: u32) -> io::Result<OwnedFd> {
    let mut new = path.as_os_str().to_owned();
    new.push(".new");
    let new = PathBuf::from(new);
    match fs::remove_file(&new) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let own = new_socket(SockFlag::SOCK_NONBLOCK)?;
    bind(own.as_raw_fd(), &UnixAddr::new(&new)?)?;
    fs::set_permissions(&new, Permissions::from_mode(permissions))?;
    listen(&own, Backlog::new(BACKLOG)?)?;
    fs::rename(&new, path)?;
    Ok(own)
}

fn new_socket(flags: SockFlag) -> io::Result<OwnedFd> {
    Ok(socket(AddressFamily::Unix, SockType::SeqPacket, flags | SockFlag::SOCK_CLOEXEC, None)?)
}

fn time_value(time: Duration) -> TimeVal {
    TimeVal::new(time.as_secs().try_into().unwrap_or(i64::MAX), time.subsec_micros().into())
}

/// A new connection, if there is one.
pub fn accept(listening: BorrowedFd<'_>) -> io::Result<Option<Packets>> {
    match accept4(listening.as_raw_fd(), SockFlag::SOCK_CLOEXEC) {
        Ok(descriptor) => Ok(Some(Packets(owned(descriptor)))),
        Err(Errno::EAGAIN | Errno::ECONNABORTED | Errno::EINTR) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// What was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A packet of so many words.
    Words(usize),
    /// Nothing, in time.
    Nothing,
    /// The other side is gone, or has sent what is no packet.
    Closed,
}

/// One end of a connection.
#[derive(Debug)]
pub struct Packets(OwnedFd);

impl Packets {
    /// Connects to a socket.
    pub fn connect(path: &Path) -> io::Result<Self> {
        let own = new_socket(SockFlag::empty())?;
        // Of a process that is paused, connections wait in a queue, and then for room in it.
        setsockopt(&own, sockopt::SendTimeout, &time_value(CONNECTED_WITHIN))?;
        connect(own.as_raw_fd(), &UnixAddr::new(path)?)?;
        Ok(Self(own))
    }

    /// Connects to a socket in a role.
    pub fn connect_as(path: &Path, role: Role) -> io::Result<Self> {
        let own = Self::connect(path)?;
        own.send(&role.words())?;
        Ok(own)
    }

    /// Sends a packet. Does not wait: what finds no room is an error.
    pub fn send(&self, words: &[u64]) -> io::Result<()> {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        self.send_bytes(&bytes)
    }

    /// The same without allocating.
    pub fn send_bytes(&self, bytes: &[u8]) -> io::Result<()> {
        send(self.0.as_raw_fd(), bytes, MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL)?;
        Ok(())
    }

    /// Receives a packet into `words`; waits for it as [`Packets::wait_at_most`] says.
    pub fn receive(&self, words: &mut [u64; PACKET_WORDS], is_waited_for: bool) -> Received {
        let mut bytes = [0; PACKET_WORDS * size_of::<u64>()];
        let flags = if is_waited_for { MsgFlags::empty() } else { MsgFlags::MSG_DONTWAIT };
        // The true length of a packet that is too long is not taken for one that fits.
        match recv(self.0.as_raw_fd(), &mut bytes, flags | MsgFlags::MSG_TRUNC) {
            Ok(length) if length > 0 && length <= bytes.len() && length % size_of::<u64>() == 0 => {
                let (whole, _) = bytes.split_at(length).0.as_chunks::<{ size_of::<u64>() }>();
                words.iter_mut().zip(whole).for_each(|(to, from)| *to = u64::from_ne_bytes(*from));
                Received::Words(length / size_of::<u64>())
            }
            Err(Errno::EAGAIN | Errno::EINTR) => Received::Nothing,
            Ok(_) | Err(_) => Received::Closed,
        }
    }

    /// A packet of one word, if one has come. Does not wait, and needs little memory.
    pub fn receive_word(&self) -> Option<u64> {
        let mut bytes = [0; size_of::<u64>()];
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_TRUNC;
        let length = recv(self.0.as_raw_fd(), &mut bytes, flags).ok()?;
        (length == bytes.len()).then(|| u64::from_ne_bytes(bytes))
    }

    /// Waits until a packet has come, or for so long.
    pub fn await_packet(&self, at_most: Duration) {
        let mut watched = [PollFd::new(self.0.as_fd(), PollFlags::POLLIN)];
        // Whoever waits looks again in any case.
        let _ = poll(&mut watched, PollTimeout::try_from(at_most).unwrap_or(PollTimeout::MAX));
    }

    /// How long [`Packets::receive`] waits.
    pub fn wait_at_most(&self, time: Duration) -> io::Result<()> {
        Ok(setsockopt(&self.0, sockopt::ReceiveTimeout, &time_value(time))?)
    }

    /// Whether the other side is gone.
    pub fn is_closed(&self) -> bool {
        let mut watched = [PollFd::new(self.0.as_fd(), PollFlags::empty())];
        poll(&mut watched, PollTimeout::ZERO).is_ok_and(|count| count > 0)
    }

    /// The process at the other side, as the kernel knows it (`SO_PEERCRED`).
    pub fn peer(&self) -> Process {
        let unknown = Process { pid: 0, user: u32::MAX };
        let peer = getsockopt(&self.0, sockopt::PeerCredentials);
        peer.map_or(unknown, |peer| Process { pid: peer.pid(), user: peer.uid() })
    }

    /// Ends the connection, for whoever waits at this side, too.
    pub fn shut_down(&self) {
        // It fails if the other side is gone: then it has ended.
        let _ = nix::sys::socket::shutdown(self.0.as_raw_fd(), nix::sys::socket::Shutdown::Both);
    }

    /// The descriptor, to poll.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }

    /// Another descriptor of the same end.
    pub fn try_clone(&self) -> io::Result<Self> {
        Ok(Self(self.0.try_clone()?))
    }

    /// Hands memory over.
    pub fn send_memory(&self, memory: &Memory) -> io::Result<()> {
        let words: Vec<u8> = [MAGIC, VERSION].iter().flat_map(|word| word.to_ne_bytes()).collect();
        let descriptors = [memory.file().as_raw_fd()];
        let message = [ControlMessage::ScmRights(&descriptors)];
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
        sendmsg::<()>(self.0.as_raw_fd(), &[IoSlice::new(&words)], &message, flags, None)?;
        Ok(())
    }

    /// Receives the memory that the other side hands over, with its version; `None` if it has closed the connection without a word.
    pub fn receive_memory(&self) -> io::Result<Option<(u64, OwnedFd)>> {
        self.wait_at_most(CONNECTED_WITHIN)?;
        let mut bytes = [0; 2 * size_of::<u64>()];
        let mut parts = [IoSliceMut::new(&mut bytes)];
        let mut space = nix::cmsg_space!(RawFd);
        let message =
            recvmsg::<()>(self.0.as_raw_fd(), &mut parts, Some(&mut space), MsgFlags::MSG_CMSG_CLOEXEC)?;
        let length = message.bytes;
        let descriptor = message.cmsgs()?.find_map(|message| match message {
            ControlMessageOwned::ScmRights(descriptors) => descriptors.first().copied(),
            _ => None,
        });
        let file = descriptor.map(owned);
        if length == 0 {
            return Ok(None);
        }
        let (words, _) = bytes.as_chunks::<{ size_of::<u64>() }>();
        match (words.first().map(|word| u64::from_ne_bytes(*word)), words.get(1), file) {
            (Some(MAGIC), Some(version), Some(file)) => Ok(Some((u64::from_ne_bytes(*version), file))),
            _ => Err(io::ErrorKind::InvalidData.into()),
        }
    }
}
