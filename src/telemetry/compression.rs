//! The compression of recordings.

use std::io::Read;

use mcap::{Compression, WriteOptions};

/// The memory that a compressed chunk may ask for, as a power of two: more than any that takt writes.
const LONGEST_WINDOW_LOG: u32 = 24;

/// How a recording is written.
pub fn of_recordings(is_compressed: bool) -> WriteOptions {
    // No threads beside that of the logger.
    WriteOptions::new().compression(is_compressed.then_some(Compression::Zstd)).compression_threads(0)
}

/// Decompresses what zstd has compressed.
pub fn decoder(compressed: &[u8]) -> Option<impl Read> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(compressed).ok()?;
    decoder.window_log_max(LONGEST_WINDOW_LOG).ok()?;
    Some(decoder)
}
