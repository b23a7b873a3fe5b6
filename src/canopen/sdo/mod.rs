//! Service data objects (CiA 301, 7.2.4): reading and writing objects of one node, expedited and segmented.
//!
//! The frames are [`Request`] and [`Response`], which can only be valid ones; both sides of the conversation can be
//! written with them. [`Client`] is the master's side.

mod abort;
mod client;
mod request;
mod response;
mod wire;

pub use abort::AbortCode;
pub use client::{Busy, Client, Completed, MAX_UPLOAD_BYTES, SdoError, Timing, Transfer, Uploaded};
pub use request::Request;
pub use response::Response;
pub use wire::{Expedited, Segment};
