//! Protocols without I/O: codecs, clients and the reader of electronic data sheets.

mod canopen_sdo_block;
mod canopen_sdo_client;
mod canopen_vectors;
mod eds;
mod erob_can_vectors;
mod hollow_line_vectors;
#[path = "../../../../tests/vectors/rows.rs"]
mod rows;
