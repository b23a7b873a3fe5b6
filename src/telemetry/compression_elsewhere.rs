//! The compression of recordings, without a library in C: they are read compressed, and written as they are.

use std::io::Read;

use mcap::WriteOptions;
use ruzstd::decoding::StreamingDecoder;

/// How a recording is written.
pub fn of_recordings(_is_compressed: bool) -> WriteOptions {
    WriteOptions::new().compression(None)
}

/// Decompresses what zstd has compressed.
pub fn decoder(compressed: &[u8]) -> Option<impl Read> {
    StreamingDecoder::new(compressed).ok()
}
