//! One system call for the frames of several buses.
//!
//! A raw CAN socket can send to any interface. So the socket of one bus can carry the frames of other buses in the same
//! call. These frames come back on the sockets of their own buses, where the [accounting](super::accounting) recognises
//! them by their content.

use arrayvec::ArrayVec;

use super::batch::{self, Destination, SEND_BATCH};
use super::port::SocketCanPort;
use crate::capacity::MAX_BUSES;
use crate::frame::Frame;
use crate::port::Outgoing;

/// Sends in one call for all buses that are not behind. A bus that is behind sends on its own socket: frames that wait for
/// the wire take room in the buffer of the socket that sent them, and must not take it from other buses.
pub(super) fn send(outgoing: &mut [Outgoing<'_, SocketCanPort>]) {
    let mut call = Call::default();
    for (number, entry) in outgoing.iter().enumerate() {
        call.join(number, entry);
    }
    let mut taken = match call.send() {
        Ok(taken) => taken,
        Err(Refused { carrier, errno }) => {
            // The error belongs to the first frame, which is the carrier's own, or to its socket. No frame is counted as
            // refused here: each port sends its own frames again below.
            if let Some(entry) = outgoing.get_mut(carrier) {
                entry.port.accounting.refused(0, errno);
            }
            0
        }
    };
    let members = call.members;
    for (number, entry) in outgoing.iter_mut().enumerate() {
        let mut done = 0;
        if let Some(place) = members.iter().position(|member| *member == number) {
            done = taken.min(entry.frames.len());
            taken -= done;
            let frames = entry.frames.get(..done).unwrap_or_default();
            if place == 0 {
                entry.port.accounting.taken(frames);
            } else {
                entry.port.accounting.taken_by_another(frames);
            }
        }
        let rest = entry.frames.get(done..).unwrap_or_default();
        // Where the call stopped, the port's own socket gives the reason.
        *entry.taken = if rest.is_empty() { done } else { done + entry.port.send_alone(rest) };
    }
}

/// A call that is being put together. The socket of its first member carries it.
#[derive(Default)]
struct Call<'a> {
    carrier: Option<libc::c_int>,
    /// The members, by their index among the ports that send.
    members: ArrayVec<usize, MAX_BUSES>,
    messages: ArrayVec<(Destination, &'a Frame), SEND_BATCH>,
}

/// A call from which the kernel took no frame.
struct Refused {
    /// The index of the port whose socket carried it.
    carrier: usize,
    /// The error number of the system.
    errno: i32,
}

impl<'a> Call<'a> {
    fn join(&mut self, number: usize, entry: &Outgoing<'a, SocketCanPort>) {
        let port = &entry.port;
        let Some(index) = port.link.index().filter(|_| !port.accounting.is_behind()) else { return };
        // The port itself refuses what its bus may not carry.
        if port.permitted(entry.frames).len() < entry.frames.len() {
            return;
        }
        if self.messages.remaining_capacity() < entry.frames.len() || self.members.try_push(number).is_err() {
            return;
        }
        self.carrier.get_or_insert(port.descriptor);
        self.messages.extend(entry.frames.iter().map(|frame| (Destination::Interface(index), frame)));
    }

    /// Returns how many messages the kernel took, the first ones first. For a single bus it makes no call: that bus sends on
    /// its own socket.
    fn send(&self) -> Result<usize, Refused> {
        match (self.carrier, self.members.as_slice()) {
            (Some(descriptor), [carrier, _, ..]) => batch::send(descriptor, self.messages.iter().copied())
                .map_err(|errno| Refused { carrier: *carrier, errno }),
            _ => Ok(0),
        }
    }
}
