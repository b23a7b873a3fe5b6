//! Service data objects (CiA 301, 7.2.4): read and write objects of one node, expedited, segmented and in blocks.
//!
//! A [`Transfer`] is what is asked for, and [`Completed`] what came of it. [`SdoRequest`] and [`SdoResponse`] are the messages; only
//! valid ones can be built, and both sides can be written with them. [`SdoClient`] is the SDO client.
//!
//! ```text
//! client ── sending, repeating, timeouts
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
mod exchange_step;
mod request;
mod response;
mod transfer;
mod wire;

pub use abort::AbortCode;
pub use client::{SdoBusy, SdoClient, SdoTiming};
pub use request::SdoRequest;
pub use response::SdoResponse;
pub use transfer::{Completed, MAX_UPLOAD_BYTES, SdoError, Transfer, Uploaded};
pub use wire::{BlockSegment, BlockSize, Expedited, Segment};
