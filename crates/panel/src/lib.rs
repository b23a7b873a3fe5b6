//! The panel: a page in the browser that shows and commands a running controller, or commissions drives without one.
//!
//! ```text
//! takt-panel          one thread: connections, states twenty times a second to every page, stops
//! takt-panel-event    waits for events
//! takt-panel-command  carries out commands, one after another
//! takt-panel-frames   tells what frames mean, while the monitor of a page is on
//! takt-panel-motion   renews what is held, and ends what its page has left
//! ```
//!
//! All of them are ordinary threads beside the real-time one, and call the controller as the own program's threads do, by
//! [`AnyHandle`](takt::AnyHandle). A stop is taken on the first thread and waits for nobody.
//!
//! In the order to read: `access` (who may ask), `pages` (who is there, who commands), `command`, `motions` and `motion` (what is asked and
//! how it ends), `view` (what is shown), `gate` (what both kinds of panel share), `server` (the routes), `connections` (sockets and their bounds).
//! Commissioning is `bench`: one thread more, `takt-bench`, which owns the buses.
//! `metrics` serves the numbers of a run to Prometheus, within the same bounds.
//! Without a server, `command`, `motions` and `view` serve a page of the simulated arm (the folder `browser`).
#![deny(unsafe_code)]
#![cfg_attr(not(feature = "server"), allow(dead_code, reason = "the pages of others need a server"))]
#![allow(
    missing_docs,
    unnameable_types,
    reason = "the program is made of it; programs of others stand on takt"
)]

#[cfg(feature = "server")]
mod access;
#[cfg(feature = "server")]
mod bench;
pub mod browser;
#[cfg(all(test, feature = "server"))]
mod chinese;
pub(crate) mod command;
#[cfg(feature = "server")]
mod connections;
#[cfg(feature = "server")]
mod frames;
#[cfg(feature = "server")]
mod gate;
#[cfg(feature = "server")]
mod listening;
#[cfg(feature = "server")]
mod lock;
#[cfg(feature = "server")]
mod metrics;
mod motion;
pub(crate) mod motions;
#[cfg(feature = "server")]
mod page;
mod pages;
#[cfg(feature = "server")]
mod server;
pub(crate) mod view;

#[cfg(feature = "server")]
pub use access::TOKEN_AT_LEAST;
#[cfg(feature = "server")]
pub use bench::{BenchBus, BenchDrive, BenchLink, Workplace};
#[cfg(feature = "server")]
pub use listening::{Listening, Panel, PanelError, PanelOptions, PanelToken, address};
#[cfg(feature = "server")]
pub use metrics::MetricsServer;
pub use motions::HELD_FOR;
pub use pages::{PAGES_AT_MOST, PRESENT_FOR};
#[cfg(feature = "server")]
pub use server::{FrameSource, TakeLease};
