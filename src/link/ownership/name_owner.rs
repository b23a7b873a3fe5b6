//! The owner of an abstract Unix socket name, as the kernel knows it.
//!
//! Anybody in the network namespace can bind the name of a lock and answer no connection. `sock_diag(7)` names the user of every socket since
//! Linux 5.3. The process is found by its descriptors, which only root and the same user can see.

use std::fs;
use std::io;
use std::os::fd::AsRawFd;
use std::path::Path;

use nix::sys::socket::sockopt::ReceiveTimeout;
use nix::sys::socket::{
    AddressFamily, MsgFlags, SockFlag, SockProtocol, SockType, recv, send, setsockopt, socket,
};
use nix::sys::time::{TimeVal, TimeValLike};

use crate::link::process::Process;

/// `<linux/sock_diag.h>`
const SOCK_DIAG_BY_FAMILY: u16 = 20;
/// `<linux/unix_diag.h>`: what the answer has, and the attributes in which it has it.
const SHOW_NAME_AND_USER: u32 = 0x01 | 0x40;
const NAME: u16 = 0;
const USER: u16 = 7;
/// A state of `<net/tcp_states.h>`, which Unix sockets have, too: connected.
const ESTABLISHED: u8 = 1;

const MESSAGE_HEADER: usize = 16;
const ATTRIBUTE_HEADER: usize = 4;
/// `struct unix_diag_msg`
const SOCKET_HEADER: usize = 16;

/// Returns the process that has a stream socket with this abstract name; `None` if the user is not known. The process ID is 0 if it cannot be
/// seen.
pub fn owner_of(name: &str) -> io::Result<Option<Process>> {
    let Some(NamedSocket { inode, user, .. }) = find(name)? else { return Ok(None) };
    let process = process_with(inode);
    let user = user.or_else(|| process.map(|(_, user)| user));
    Ok(user.map(|user| Process { pid: process.map_or(0, |(pid, _)| pid), user }))
}

/// A socket that has the name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct NamedSocket {
    is_connected: bool,
    inode: u32,
    /// `None` before Linux 5.3.
    user: Option<u32>,
}

fn find(name: &str) -> io::Result<Option<NamedSocket>> {
    let flags = SockFlag::SOCK_CLOEXEC;
    let kernel = socket(AddressFamily::Netlink, SockType::Raw, flags, SockProtocol::NetlinkSockDiag)?;
    setsockopt(&kernel, ReceiveTimeout, &TimeVal::seconds(1))?;
    send(kernel.as_raw_fd(), &request(), MsgFlags::empty())?;
    let mut found: Option<NamedSocket> = None;
    let mut datagram = vec![0; 1 << 16];
    loop {
        let length = recv(kernel.as_raw_fd(), &mut datagram, MsgFlags::empty())?;
        for message in parts(datagram.get(..length).unwrap_or_default(), Header::of_message) {
            let Header { kind, body } = message;
            if kind != SOCK_DIAG_BY_FAMILY {
                // The end, or an error.
                return Ok(found);
            }
            let named = named(body, name);
            // A connected one with the name was accepted by its owner. It counts where the owner itself is connected elsewhere.
            found = named.filter(|_| found.is_none_or(|found| found.is_connected)).or(found);
        }
    }
}

/// The request for all Unix sockets: `struct nlmsghdr` and `struct unix_diag_req`.
fn request() -> Vec<u8> {
    const LENGTH: u32 = 40;
    let flags = (libc::NLM_F_REQUEST | libc::NLM_F_DUMP) as u16;
    let family = [libc::AF_UNIX as u8, 0, 0, 0];
    let mut bytes = LENGTH.to_ne_bytes().to_vec();
    bytes.extend([SOCK_DIAG_BY_FAMILY.to_ne_bytes(), flags.to_ne_bytes()].concat());
    // Number and sender.
    bytes.extend([0; 8]);
    bytes.extend(family);
    let [all_states, any_inode, any_cookie] = [u32::MAX, 0, u32::MAX];
    let words = [all_states, any_inode, SHOW_NAME_AND_USER, any_cookie, any_cookie];
    bytes.extend(words.iter().flat_map(|word| word.to_ne_bytes()));
    bytes
}

/// The socket of a message, if it is a stream socket that has the name.
fn named(body: &[u8], name: &str) -> Option<NamedSocket> {
    let (socket, attributes) = body.split_at_checked(SOCKET_HEADER)?;
    let &[_, kind, state, _, ..] = socket else { return None };
    let inode = u32::from_ne_bytes(socket.get(4..8)?.try_into().ok()?);
    let attribute = |wanted: u16| {
        parts(attributes, Header::of_attribute)
            .find(|attribute| attribute.kind == wanted)
            .map(|found| found.body)
    };
    let has_name = attribute(NAME)?.strip_prefix(&[0]) == Some(name.as_bytes());
    // A connection that its owner has not accepted has no inode yet, and not its user.
    let is_wanted = i32::from(kind) == libc::SOCK_STREAM && has_name && inode != 0;
    let user = attribute(USER).and_then(|user| user.try_into().ok()).map(u32::from_ne_bytes);
    is_wanted.then_some(NamedSocket { is_connected: state == ESTABLISHED, inode, user })
}

/// A message or an attribute of netlink.
struct Header<'a> {
    kind: u16,
    body: &'a [u8],
}

/// The first part of some bytes, and its length.
type Read<'a> = fn(&'a [u8]) -> Option<(Header<'a>, usize)>;

impl<'a> Header<'a> {
    /// `struct nlmsghdr`
    fn of_message(bytes: &'a [u8]) -> Option<(Self, usize)> {
        let length = u32::from_ne_bytes(bytes.get(..4)?.try_into().ok()?) as usize;
        let kind = u16::from_ne_bytes(bytes.get(4..6)?.try_into().ok()?);
        Some((Self { kind, body: bytes.get(MESSAGE_HEADER..length)? }, length))
    }

    /// `struct nlattr`
    fn of_attribute(bytes: &'a [u8]) -> Option<(Self, usize)> {
        let length = usize::from(u16::from_ne_bytes(bytes.get(..2)?.try_into().ok()?));
        let kind = u16::from_ne_bytes(bytes.get(2..4)?.try_into().ok()?);
        Some((Self { kind, body: bytes.get(ATTRIBUTE_HEADER..length)? }, length))
    }
}

/// The parts of a datagram or of a message. Each begins at a multiple of four bytes.
fn parts<'a>(mut bytes: &'a [u8], read: Read<'a>) -> impl Iterator<Item = Header<'a>> {
    std::iter::from_fn(move || {
        let (part, length) = read(bytes)?;
        bytes = bytes.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some(part)
    })
}

/// The process that has a socket open, and its user.
fn process_with(inode: u32) -> Option<(i32, u32)> {
    use std::os::unix::fs::MetadataExt;
    let link = format!("socket:[{inode}]");
    let has_it = |process: &Path| {
        let descriptors = fs::read_dir(process.join("fd")).into_iter().flatten().flatten();
        descriptors
            .into_iter()
            .any(|entry| fs::read_link(entry.path()).is_ok_and(|to| to == Path::new(&link)))
    };
    let processes = fs::read_dir("/proc").ok()?.flatten().filter_map(|entry| {
        let pid = entry.file_name().to_str()?.parse().ok()?;
        Some((pid, entry.path()))
    });
    let (pid, path) = processes.into_iter().find(|(_, path)| has_it(path))?;
    Some((pid, fs::metadata(path).ok()?.uid()))
}

#[cfg(test)]
mod tests {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};

    use nix::unistd::geteuid;

    use super::*;

    #[test]
    fn the_owner_of_a_name_is_found_among_those_that_are_connected_to_it() {
        let name = format!("takt/test/owner-{}", std::process::id());
        assert_eq!(owner_of(&name).unwrap(), None);
        let address = SocketAddr::from_abstract_name(&name).unwrap();
        let listener = UnixListener::bind_addr(&address).unwrap();
        let _waiting = UnixStream::connect_addr(&address).unwrap();
        let _accepted = listener.accept().unwrap();
        let _not_accepted = UnixStream::connect_addr(&address).unwrap();
        let own = Process { pid: std::process::id() as i32, user: geteuid().as_raw() };
        assert_eq!(owner_of(&name).unwrap(), Some(own));
        assert_eq!(owner_of(&name[..name.len() - 1]).unwrap(), None);
    }

    #[test]
    fn a_message_that_is_cut_short_is_none() {
        let request = request();
        let whole = parts(&request, Header::of_message).count();
        assert_eq!((whole, request.len()), (1, 40));
        for length in 0..request.len() {
            assert_eq!(parts(&request[..length], Header::of_message).count(), 0, "{length} bytes");
            assert_eq!(named(&request[..length], "takt"), None);
        }
        assert_eq!(parts(&[0; 64], Header::of_message).count(), 0, "a length of 0 does not repeat for ever");
    }
}
