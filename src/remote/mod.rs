//! A controller of another process: what it shows, what it is asked, and the [`Client`] that does both.
//!
//! ```text
//! process of the controller                                          other processes
//! serve: state, events ── sealed memory, which only it can write ──▶ any number of observers
//!        requests      ◀─ packets of words on a local socket ─────── clients, one of which commands (the lease)
//!        stops         ◀─ packets on a socket of their own ───────── any client
//! ```
//!
//! The memory is handed over by a socket, and has no name. So it is gone with its processes, however they end, and file permissions of
//! the two sockets say who observes and who commands. A client has no memory that the controller reads: what it asks comes in packets,
//! which the kernel hands over whole or not at all. The end of a process closes its sockets, so that each side learns of the other's
//! death at once.
//!
//! `iceoryx2` (0.10) was weighed against this, and does not win: it brings a tree of crates for one writer and its readers; a killed process
//! leaves files that others must clean up, which has ended those (its issues 1578, 1584, 1880); and what a participant may write is shared
//! by all of them. This folder needs no crate that takt had not before, and its bindings to C and Python are those of a handle.
//!
//! - `memory`: the sealed memory, its mapping and waiting for it: all that is `unsafe`.
//! - `layout`: what is where in it.
//! - `shown`: the state and the events in it, for their writer and their readers.
//! - `socket`: the sockets, their names and rights.
//! - `commands`, `replies`: what the packets say.
//! - `connect`, `asking`: how a client comes to a controller, and asks it.
//! - `client`, `commanding`, `group`, `stream`, `events`: the public face; `running_controller`: the same as a trait.

#[cfg(doctest)]
#[doc = include_str!("../../docs/another-process.md")]
mod guide {}

mod asking;
mod client;
mod commanding;
mod commands;
mod connect;
mod error;
mod events;
mod group;
mod layout;
mod memory;
mod replies;
mod running_controller;
mod shown;
mod socket;
mod stream;

pub use client::Client;
pub use connect::connect;
pub use error::ConnectError;
pub use events::ClientEvents;
pub use group::ClientGroup;
pub use stream::ClientStream;

pub use crate::packet::Malformed;
pub(crate) use commands::words_of_point;
pub use commands::{Command, Demand, StopRequest};
pub(crate) use layout::{Description, LeaseShown, STOP_WORDS};
pub(crate) use memory::Memory;
pub use replies::{Answer, Reply};
#[doc(hidden)]
pub use shown::{ShownWriter, now_ns};
#[doc(hidden)]
pub use socket::{Claimed, Listener, NameError, Names, SocketError, accept};
pub use socket::{PACKET_WORDS, Packets, Received, Role};
