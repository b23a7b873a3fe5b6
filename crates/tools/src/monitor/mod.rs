//! The meaning of every frame on a bus, without input and output: frames and times go in, words and values come out. Nothing here
//! sends a frame.
//!
//! - [`BusDecoder`]: what a frame means. It knows the drives that a configuration names, and learns from what it hears: the mapping of PDOs
//!   that are written or read by SDO, and the transfer that a segment belongs to.
//! - [`Decoded`]: the service, who is concerned, words, values.
//! - [`FrameFilter`]: which frames are of interest.
//! - [`BusStatistics`]: rates of each identifier, and the load of the bus.
//!
//! ```text
//! decoder ── one frame to its meaning
//!    ├── members ── the drives by their node IDs and identifiers
//!    ├── process_data ── PDOs by the mapping in force
//!    ├── sdo_traffic ── transfers of one node, and the mapping that they write
//!    └── field_frames ── drives of bit fields
//! ```

mod decoded;
mod decoder;
mod field_frames;
mod filter;
mod members;
mod process_data;
mod sdo_traffic;
mod statistics;

pub use decoded::{Decoded, DecodedValue, Service, ServiceKind};
pub use decoder::BusDecoder;
pub use filter::{FrameFilter, IdFilter, IdFilterError};
pub use members::NamedDrive;
pub use statistics::{BusStatistics, IdStatistics};
