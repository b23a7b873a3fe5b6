//! A controller of another process: [`serve()`] offers a running controller of takt to other processes, and [`connect()`] gives its
//! [`Client`], which has the calls of a [`Handle`](takt::Handle).
//!
//! ```no_run
//! use std::time::Duration;
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let arm = takt_remote::connect("arm")?;
//!     let motion = arm.move_to(&[0.3, -0.2, 0.1, -0.5, 0.0, 0.4])?;
//!     arm.wait(motion, Duration::from_secs(10))?;
//!     Ok(())
//! }
//! ```
//!
//! Angles are in rad, lengths in m, torques in N·m, forces in N and durations in seconds, as everywhere in takt. Commands are refused by
//! the errors of a handle, [`CommandError`](takt::CommandError) and [`StreamError`](takt::StreamError). A client has three of them more:
//! `Lease` where another client commands, `NoReply` where the other process does not answer, and `Ended` where it has ended.
//! [`ServeError`] and [`ConnectError`] say why a controller cannot be served, or connected to.
//!
//! # How it works
//!
//! ```text
//! process of the controller                                          other processes
//! serve: state, events ── sealed memory, which only it can write ──▶ any number of observers
//!        requests      ◀─ packets on a local socket ──────────────── clients, one of which commands (the lease)
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
//! by all of them. This crate needs none that takt has not anyway, and its bindings to C and Python are those of a handle.
//!
//! # To read it
//! Each file uses only what stands below it (`tests/repository/arrows.rs` proves it):
//!
//! ```text
//! serve                             a running controller, offered to other processes
//! connect error                     how a client comes to a controller, and why it does not
//! client                            who commands and observes from here
//! backend events                    what its handle stands on
//! connection stops no_answer        asking the other process, and its answers
//! replies commands                  what the packets say
//! shown                             the state and the events in the memory, for their writer and their readers
//! socket                            the sockets, their names and rights
//! memory                            the sealed memory, its mapping and waiting for it: all that is `unsafe`
//! layout                            what is where in it
//! ```
#![deny(unsafe_code)]

mod backend;
mod client;
mod commands;
mod connect;
mod connection;
mod error;
mod events;
mod layout;
mod memory;
mod no_answer;
mod replies;
mod serve;
mod shown;
mod socket;
mod stops;

pub use client::Client;
pub use connect::connect;
pub use connection::Connection;
pub use error::ConnectError;
pub use serve::{Claim, ServeError, ServeOptions, Server, serve};
pub use shown::now_ns;
pub use socket::names_in_use;

/// What goes between the processes, for tests and fuzzers. It may change in any release.
#[doc(hidden)]
pub mod packets {
    pub use crate::commands::{Asked, Demand, StopRequest};
    pub use crate::replies::{Answer, Replied};
    pub use crate::socket::{PACKET_BYTES, Packets, Received, Role};
}

#[cfg(doctest)]
#[doc = include_str!("../../../docs/another-process.md")]
mod guide {}
