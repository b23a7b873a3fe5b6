//! One system call for the frames of several buses.
//!
//! A raw CAN socket sends to any interface that it is told, so that the socket of one bus can carry the frames of
//! others in the same call. They come back on the sockets of their own buses, where the [account](super::account) knows
//! them again.

use arrayvec::ArrayVec;

use super::batch::{self, Destination, SEND_BATCH};
use super::port::SocketCanPort;
use crate::frame::Frame;
use crate::port::{BusPort, Outgoing};
use crate::record::MAX_BUSES;
use crate::time::Nanoseconds;

/// Sends in one call for all buses that are not behind. The others send by themselves: what a bus cannot get rid of takes
/// room in the buffer of the socket that has sent it, and must not go on taking it from other buses.
pub(super) fn send(now_ns: Nanoseconds, outgoing: &mut [Outgoing<'_, SocketCanPort>]) {
    let mut call = Call::default();
    for (number, entry) in outgoing.iter().enumerate() {
        call.join(number, entry);
    }
    let mut taken = match call.send() {
        Ok(taken) => taken,
        Err(Refused { carrier, errno }) => {
            // It concerns the first frame, which is the carrier's own, or its socket. None is counted as refused: all
            // are sent again below.
            if let Some(entry) = outgoing.get_mut(carrier) {
                entry.port.account.refused(0, errno);
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
                entry.port.account.taken(frames);
            } else {
                entry.port.account.taken_by_another(frames);
            }
        }
        let rest = entry.frames.get(done..).unwrap_or_default();
        // Where the call stopped, the port's own socket says why.
        *entry.taken = if rest.is_empty() { done } else { done + entry.port.send(now_ns, rest) };
    }
}

/// A call in the making. The socket of its first member carries it.
#[derive(Default)]
struct Call<'a> {
    carrier: Option<libc::c_int>,
    /// By their numbers among the ports that send.
    members: ArrayVec<usize, MAX_BUSES>,
    messages: ArrayVec<(Destination, &'a Frame), SEND_BATCH>,
}

/// A call of which the kernel took nothing.
struct Refused {
    /// The number of the port whose socket carried it.
    carrier: usize,
    /// The system's number.
    errno: i32,
}

impl<'a> Call<'a> {
    fn join(&mut self, number: usize, entry: &Outgoing<'a, SocketCanPort>) {
        let port = &entry.port;
        let Some(index) = port.link.index().filter(|_| !port.account.is_behind()) else { return };
        if self.messages.remaining_capacity() < entry.frames.len() || self.members.try_push(number).is_err() {
            return;
        }
        self.carrier.get_or_insert(port.descriptor);
        self.messages.extend(entry.frames.iter().map(|frame| (Destination::Interface(index), frame)));
    }

    /// Returns how many messages the kernel took, the first ones first. A call for one bus alone is none to make here.
    fn send(&self) -> Result<usize, Refused> {
        match (self.carrier, self.members.as_slice()) {
            (Some(descriptor), [carrier, _, ..]) => batch::send(descriptor, self.messages.iter().copied())
                .map_err(|errno| Refused { carrier: *carrier, errno }),
            _ => Ok(0),
        }
    }
}
