//! Service data objects (CiA 301, 7.2.4): reading and writing objects of one node, expedited, segmented and in blocks.
//!
//! The frames are [`Request`] and [`Response`], which can only be valid ones; both sides of the conversation can be
//! written with them. [`Client`] is the master's side.
//!
//! ```text
//! client ── when to send, to repeat, to give up
//!   │
//! exchange ── one transfer: initiation and segments
//!   ├── block_upload, block_download ── crc
//!   │
//! request, response ── wire, abort
//! ```

mod abort;
mod block_download;
mod block_upload;
mod client;
mod crc;
mod exchange;
mod request;
mod response;
mod transfer;
mod wire;

pub use abort::AbortCode;
pub use client::{Busy, Client, Timing};
pub use request::Request;
pub use response::Response;
pub use transfer::{Completed, MAX_UPLOAD_BYTES, SdoError, Transfer, Uploaded};
pub use wire::{BlockSegment, BlockSize, Expedited, Segment};
