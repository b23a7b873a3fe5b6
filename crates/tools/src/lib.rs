//! Tools around a controller: for one drive, for this machine, and for recordings.
//!
//! ```text
//! doctor                  is the machine fit
//! commission play replay  one drive apart from any run; motion from a file; a run again
//! jitter monitor          how evenly this machine paces the loop; the meaning of every frame on a bus
//! ```
//!
//! A controller does not know of them. The program `takt` is made of them, and of the panel.
#![deny(unsafe_code)]
#![allow(
    missing_docs,
    unnameable_types,
    reason = "the program is made of it; programs of others stand on takt"
)]

#[cfg(target_os = "linux")]
pub mod commission;
#[cfg(target_os = "linux")]
pub mod doctor;
#[cfg(target_os = "linux")]
pub mod jitter;
pub mod monitor;
#[cfg(target_os = "linux")]
pub mod play;
pub mod replay;
