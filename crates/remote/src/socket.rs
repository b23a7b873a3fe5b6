//! The local sockets by which processes meet: one for observers, who get the memory, and one for clients, who send packets.
//!
//! The kernel hands a packet over whole or not at all (`SOCK_SEQPACKET`). To connect to a socket a process
//! needs write permission for its file: so the permissions of the two files say who observes and who commands.
//!
//! The files of a plain name are in a folder where no stranger can make or remove one: see [`Names`].

use std::env;
use std::fs::{self, DirBuilder, File, Permissions, TryLockError};
use std::io::{self, IoSlice, IoSliceMut};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{
    AddressFamily, Backlog, ControlMessage, ControlMessageOwned, MsgFlags, SockFlag, SockType, UnixAddr,
    accept4, bind, connect, getsockopt, listen, recv, recvmsg, send, sendmsg, setsockopt, socket, sockopt,
};
use nix::sys::time::TimeVal;
use nix::unistd::geteuid;
use takt::link::Process;

use crate::layout::{MAGIC, VERSION};
use crate::memory::{Memory, owned};

/// The longest packet.
pub const PACKET_BYTES: usize = 1 << 16;
/// Connections that wait to be accepted.
const BACKLOG: i32 = 64;
/// The longest path of a socket (`sun_path`, without its last zero).
const PATH_BYTES: usize = 107;
/// A process that serves accepts a connection, and hands its memory over, within this time each.
pub const CONNECTED_WITHIN: Duration = Duration::from_secs(5);

/// What a connection of a client is for: the first packet that it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Commands, each of which has a reply.
    Commands = 1,
    /// Stops, which have none.
    Stops = 2,
}

impl Role {
    /// The first packet of a connection.
    pub fn packet(self) -> Vec<u8> {
        bytes_of(&[MAGIC, VERSION, self as u64])
    }

    /// The role of the first packet of a connection.
    pub fn of(packet: &[u8]) -> Option<Self> {
        [Self::Commands, Self::Stops].into_iter().find(|role| role.packet() == packet)
    }
}

fn bytes_of(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_ne_bytes()).collect()
}

/// The folder of services, and of names by which others may observe or command. The systemd unit makes it; root makes it where it is missing.
const SHARED_FOLDER: &str = "/run/takt";

/// The folder of the names that are for their user alone: `$XDG_RUNTIME_DIR/takt`. `None` outside of a session, as in a service.
fn own_folder() -> Option<PathBuf> {
    let runtime = env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|runtime| runtime.is_absolute());
    runtime.map(|runtime| runtime.join("takt"))
}

/// The files of a name.
#[derive(Clone, Debug)]
pub struct Names {
    /// As it was given.
    pub name: String,
    folder: PathBuf,
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
pub(crate) struct NameError {
    name: String,
}

impl Names {
    /// The files of the controller that is served by a name: where they are of the own folder and the shared one. Those of a name with a
    /// slash are where that path leads.
    pub fn new(name: &str) -> Result<Self, NameError> {
        let own = own_folder().map(|own| Self::in_folder(name, own)).transpose()?;
        match own.filter(|own| own.observe.exists()) {
            Some(own) => Ok(own),
            None => Self::in_folder(name, SHARED_FOLDER.into()),
        }
    }

    /// The files to serve a controller by a name with these permissions.
    pub fn to_serve(name: &str, mode: u32) -> Result<Self, NameError> {
        let is_own = mode & 0o066 == 0;
        Self::in_folder(name, own_folder().filter(|_| is_own).unwrap_or_else(|| SHARED_FOLDER.into()))
    }

    fn in_folder(name: &str, folder: PathBuf) -> Result<Self, NameError> {
        let is_plain = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-' | '_');
        let is_path = name.contains('/');
        let is_name = !name.is_empty() && !name.ends_with('/') && (is_path || name.chars().all(is_plain));
        let base = if is_path { PathBuf::from(name) } else { folder.join(name) };
        let is_short = base.as_os_str().len() + ".command.new".len() <= PATH_BYTES;
        if !is_name || !is_short || name.contains('\0') {
            return Err(NameError { name: name.to_owned() });
        }
        let file = |end: &str| {
            let mut file = base.as_os_str().to_owned();
            file.push(end);
            PathBuf::from(file)
        };
        let folder = base.parent().filter(|parent| !parent.as_os_str().is_empty());
        Ok(Self {
            name: name.to_owned(),
            folder: folder.unwrap_or(Path::new(".")).to_owned(),
            observe: file(".observe"),
            command: file(".command"),
            lock: file(".lock"),
        })
    }

    /// Returns `true` if a controller of `user` is believed to be the one of this name: if it is of this user or of root, or if its folder
    /// is not one where everybody may make files.
    pub fn is_believed(&self, user: u32) -> bool {
        let folder = fs::metadata(&self.folder);
        let is_guarded = folder.is_ok_and(|folder| folder.mode() & 0o002 == 0);
        is_guarded || user == 0 || user == geteuid().as_raw()
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
pub(crate) enum SocketError {
    /// Another process has the name.
    #[error("another process serves by this name")]
    InUse,
    /// Another user has it.
    #[error("{} belongs to user {user}: choose another name, or remove the file if nobody serves by it", path.display())]
    OfAnother {
        /// The file.
        path: PathBuf,
        /// The user.
        user: u32,
    },
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

/// A name that no other process can serve by, as long as this lives.
pub struct Claimed {
    names: Names,
    /// Held by a lock as long as this process lives.
    lock: File,
}

impl Claimed {
    /// Claims a name. Afterwards it is known that its sockets can be made.
    pub fn new(names: Names) -> Result<Self, SocketError> {
        if !names.name.contains('/') {
            make_folder(&names.folder).map_err(at(&names.folder))?;
        }
        let lock = open_lock(&names.lock)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(SocketError::InUse),
            Err(TryLockError::Error(error)) => return Err(at(&names.lock)(error)),
        }
        for path in [&names.observe, &names.command] {
            for stale in [path.clone(), new_path(path)] {
                remove(&stale).map_err(at(&stale))?;
            }
        }
        Ok(Self { names, lock })
    }

    /// Listens by the name. Of `mode` the read bits say who observes, the write bits who commands.
    pub fn listen(self, mode: u32) -> Result<Listener, SocketError> {
        let Self { names, lock } = self;
        let listening = |path: &Path, classes: u32| listening(path, classes * 0o6).map_err(at(path));
        // One bit for each class of users, by its read and by its write bit.
        let observers = listening(&names.observe, (mode >> 2) & 0o111)?;
        let clients = listening(&names.command, (mode >> 1) & 0o111)?;
        Ok(Listener { names, observers, clients, _lock: lock })
    }
}

/// Makes the folder of plain names where it is missing: `$XDG_RUNTIME_DIR/takt` for its user alone, `/run/takt` for all to look into.
fn make_folder(folder: &Path) -> io::Result<()> {
    let mode = if folder == Path::new(SHARED_FOLDER) { 0o755 } else { 0o700 };
    match DirBuilder::new().mode(mode).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(error),
        _ => Ok(()),
    }
}

/// Opens the file of a lock, which its user alone can open: no other one can hold a lock on it.
fn open_lock(path: &Path) -> Result<File, SocketError> {
    let own = geteuid().as_raw();
    let user = match fs::symlink_metadata(path) {
        Ok(file) => file.uid(),
        Err(_) => own,
    };
    if user != own {
        return Err(SocketError::OfAnother { path: path.to_owned(), user });
    }
    let mut options = File::options();
    options.create(true).append(true).mode(0o600).custom_flags(libc::O_NOFOLLOW);
    options.open(path).map_err(at(path))
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Where a socket is made before it has its name.
fn new_path(path: &Path) -> PathBuf {
    let mut new = path.as_os_str().to_owned();
    new.push(".new");
    PathBuf::from(new)
}

/// The sockets of a process that serves. Their files are gone when this is dropped.
pub struct Listener {
    names: Names,
    /// For observers.
    pub observers: OwnedFd,
    /// For clients that command.
    pub clients: OwnedFd,
    _lock: File,
}

/// The plain names by which controllers are served that this process may observe, in their order.
pub fn names_in_use() -> Vec<String> {
    let folders = own_folder().into_iter().chain([PathBuf::from(SHARED_FOLDER)]);
    let entries = folders.filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let name = |entry: fs::DirEntry| Some(entry.file_name().to_str()?.strip_suffix(".observe")?.to_owned());
    let is_served = |name: &String| {
        Names::new(name).is_ok_and(|names| match Packets::connect(&names.observe) {
            Ok(observer) => names.is_believed(observer.peer().user),
            // It is paused, and has a queue.
            Err(error) => error.kind() == io::ErrorKind::WouldBlock,
        })
    };
    let mut names: Vec<String> = entries.filter_map(name).filter(is_served).collect();
    names.sort();
    names.dedup();
    names
}

impl Drop for Listener {
    fn drop(&mut self) {
        // Nobody else has the name while the lock is held. The file of the lock stays, so that no two processes hold a lock each.
        for path in [&self.names.observe, &self.names.command] {
            let _ = fs::remove_file(path);
        }
    }
}

/// A socket at this path. It is there with its permissions, and listens.
fn listening(path: &Path, permissions: u32) -> io::Result<OwnedFd> {
    let new = new_path(path);
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
    /// A packet of so many bytes.
    Bytes(usize),
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
        own.send(&role.packet())?;
        Ok(own)
    }

    /// Sends a packet. Neither waits nor allocates: what finds no room is an error.
    pub fn send(&self, packet: &[u8]) -> io::Result<()> {
        send(self.0.as_raw_fd(), packet, MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL)?;
        Ok(())
    }

    /// Receives a packet; waits for it as [`Packets::wait_at_most`] says.
    pub fn receive(&self, packet: &mut [u8; PACKET_BYTES], is_waited_for: bool) -> Received {
        let flags = if is_waited_for { MsgFlags::empty() } else { MsgFlags::MSG_DONTWAIT };
        // The true length of a packet that is too long is not taken for one that fits.
        match recv(self.0.as_raw_fd(), packet, flags | MsgFlags::MSG_TRUNC) {
            Ok(length) if (1..=PACKET_BYTES).contains(&length) => Received::Bytes(length),
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

    /// Returns `true` if the other side is gone.
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
    pub(crate) fn send_memory(&self, memory: &Memory) -> io::Result<()> {
        let words = bytes_of(&[MAGIC, VERSION]);
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
