//! Splits an MCAP file into its records. A file that was cut off (`kill -9`, a power cut) is read to its last whole record,
//! also within a chunk. A chunk with a wrong checksum is skipped. Chunks may be compressed by zstd.

use std::io::{self, Read};

use mcap::MAGIC;
use mcap::records::op;
use takt_wire::printable::printable;

use crate::telemetry::compression;

/// No record of takt is longer, nor what comes out of a compressed chunk. A longer one means that the file is damaged.
const LONGEST_RECORD: u64 = 1 << 28;
/// The name of the compression that takt writes.
const ZSTD: &[u8] = b"zstd";

/// The condition of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// True if it was read to the end of its data.
    pub is_whole: bool,
    /// The number of damaged chunks, which were skipped.
    pub damaged_chunks: u64,
}

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WalkError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file is empty.
    #[error("the file is empty: nothing was recorded")]
    Empty,
    /// It is not an MCAP file.
    #[error("this is not an MCAP file; name a recording or a black box of `takt run`")]
    NotMcap,
    /// Its chunks are compressed by something else.
    #[error("its chunks are compressed ({0}); takt reads zstd and uncompressed ones")]
    Compressed(String),
}

/// Passes every record with its opcode to `visit`, in the order of the file.
pub fn walk(mut file: impl Read, mut visit: impl FnMut(u8, &[u8])) -> Result<Condition, WalkError> {
    let mut condition = Condition::default();
    let (mut body, mut decompressed) = (Vec::new(), Vec::new());
    read_up_to(&mut file, MAGIC.len() as u64, &mut body)?;
    if body.is_empty() {
        return Err(WalkError::Empty);
    } else if body != MAGIC {
        return Err(WalkError::NotMcap);
    }
    loop {
        read_up_to(&mut file, PREFIX_BYTES as u64, &mut body)?;
        let Some((opcode, length, _)) = prefix(&body) else { return Ok(condition) };
        if length > LONGEST_RECORD {
            return Ok(condition);
        }
        read_up_to(&mut file, length, &mut body)?;
        let is_whole = body.len() as u64 == length;
        match opcode {
            op::DATA_END | op::FOOTER => return Ok(Condition { is_whole: true, ..condition }),
            op::CHUNK => {
                let is_undamaged = walk_chunk(&body, is_whole, &mut decompressed, &mut visit)?;
                condition.damaged_chunks += u64::from(!is_undamaged);
            }
            _ if is_whole => visit(opcode, &body),
            _ => {}
        }
        if !is_whole {
            return Ok(condition);
        }
    }
}

/// Opcode and length.
const PREFIX_BYTES: usize = 1 + 8;

fn prefix(bytes: &[u8]) -> Option<(u8, u64, &[u8])> {
    let (opcode, rest) = bytes.split_first()?;
    let (length, rest) = rest.split_first_chunk::<8>()?;
    Some((*opcode, u64::from_le_bytes(*length), rest))
}

fn read_up_to(file: &mut impl Read, length: u64, into: &mut Vec<u8>) -> io::Result<()> {
    into.clear();
    file.take(length).read_to_end(into)?;
    Ok(())
}

/// Returns whether the chunk is undamaged. The checksum of a chunk that was cut off cannot be checked.
fn walk_chunk(
    body: &[u8],
    is_whole: bool,
    decompressed: &mut Vec<u8>,
    visit: &mut impl FnMut(u8, &[u8]),
) -> Result<bool, WalkError> {
    let Some(chunk) = Chunk::parse(body) else { return Ok(!is_whole) };
    let records = match chunk.compression {
        b"" => chunk.records,
        ZSTD if decompress(&chunk, decompressed) || !is_whole => decompressed.as_slice(),
        ZSTD => return Ok(false),
        other => return Err(WalkError::Compressed(printable(&String::from_utf8_lossy(other)))),
    };
    if is_whole && chunk.crc != 0 && crc32fast::hash(records) != chunk.crc {
        return Ok(false);
    }
    let mut rest = records;
    while let Some((opcode, length, behind)) = prefix(rest) {
        let Some((body, next)) =
            usize::try_from(length).ok().and_then(|length| behind.split_at_checked(length))
        else {
            break;
        };
        visit(opcode, body);
        rest = next;
    }
    Ok(true)
}

/// Decompresses as much as there is. Returns whether that is all.
fn decompress(chunk: &Chunk<'_>, into: &mut Vec<u8>) -> bool {
    into.clear();
    let Some(decoder) = compression::decoder(chunk.records) else { return false };
    // What came before an error is kept: the chunk may have been cut off.
    decoder.take(chunk.length.min(LONGEST_RECORD)).read_to_end(into).is_ok()
}

struct Chunk<'a> {
    /// The number of bytes of its records, uncompressed.
    length: u64,
    crc: u32,
    compression: &'a [u8],
    records: &'a [u8],
}

impl<'a> Chunk<'a> {
    /// Reads start time, end time, uncompressed size, CRC, name of the compression, size, and records. The records may have
    /// been cut off.
    fn parse(body: &'a [u8]) -> Option<Self> {
        let (_, rest) = body.split_at_checked(8 + 8)?;
        let (length, rest) = rest.split_first_chunk::<8>()?;
        let (crc, rest) = rest.split_first_chunk::<4>()?;
        let (name, rest) = rest.split_first_chunk::<4>()?;
        let (compression, rest) = rest.split_at_checked(u32::from_le_bytes(*name) as usize)?;
        let (size, rest) = rest.split_first_chunk::<8>()?;
        let size = usize::try_from(u64::from_le_bytes(*size)).ok()?;
        let records = rest.get(..size).unwrap_or(rest);
        Some(Self {
            length: u64::from_le_bytes(*length),
            crc: u32::from_le_bytes(*crc),
            compression,
            records,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
    }

    fn chunk(compression: &str, crc: u32, records: &[u8]) -> Vec<u8> {
        chunk_of(compression, crc, records.len(), records)
    }

    /// A chunk whose records have this length when they are decompressed.
    fn chunk_of(compression: &str, crc: u32, length: usize, records: &[u8]) -> Vec<u8> {
        let [length, size] = [length, records.len()].map(|size| (size as u64).to_le_bytes());
        let name = (compression.len() as u32).to_le_bytes();
        let head = [&[0; 16][..], &length, &crc.to_le_bytes(), &name, compression.as_bytes(), &size].concat();
        record(op::CHUNK, &[&head[..], records].concat())
    }

    fn file(parts: &[&[u8]]) -> Vec<u8> {
        [MAGIC, &parts.concat()].concat()
    }

    /// The bodies of the records that are seen, and the condition.
    fn seen(file: &[u8]) -> Result<(Vec<Vec<u8>>, Condition), WalkError> {
        let mut bodies = vec![];
        let condition = walk(file, |_, body| bodies.push(body.to_vec()))?;
        Ok((bodies, condition))
    }

    #[test]
    fn records_are_read_inside_and_between_chunks_up_to_the_end_of_the_data() {
        let inner = [record(op::MESSAGE, b"b"), record(op::MESSAGE, b"c")].concat();
        let chunk = chunk("", crc32fast::hash(&inner), &inner);
        let end = record(op::DATA_END, &[0; 4]);
        let file = file(&[&record(op::HEADER, b"a"), &chunk, &end, &record(op::STATISTICS, b"d")]);
        let (bodies, condition) = seen(&file).unwrap();
        assert_eq!(bodies, [b"a", b"b", b"c"]);
        assert_eq!(condition, Condition { is_whole: true, damaged_chunks: 0 });
    }

    #[test]
    fn a_cut_off_chunk_gives_its_whole_records_and_a_damaged_chunk_gives_none() {
        let inner = [record(op::MESSAGE, b"one"), record(op::MESSAGE, b"two")].concat();
        let sound = chunk("", crc32fast::hash(&inner), &inner);
        let (bodies, condition) = seen(&file(&[&sound[..sound.len() - 1]])).unwrap();
        assert_eq!((bodies, condition.is_whole), (vec![b"one".to_vec()], false));
        let damaged = chunk("", 1, &inner);
        let (bodies, condition) = seen(&file(&[&damaged, &sound])).unwrap();
        assert_eq!((bodies.len(), condition.damaged_chunks), (2, 1));
    }

    #[test]
    fn a_compressed_chunk_gives_the_same_records_and_a_damaged_one_none() {
        let inner = [record(op::MESSAGE, b"one"), record(op::MESSAGE, b"two")].concat();
        let packed = zstd::encode_all(&inner[..], 0).unwrap();
        let sound = chunk_of("zstd", crc32fast::hash(&inner), inner.len(), &packed);
        let (bodies, condition) = seen(&file(&[&sound])).unwrap();
        assert_eq!((bodies, condition.damaged_chunks), (vec![b"one".to_vec(), b"two".to_vec()], 0));
        for (what, damaged) in [
            ("a wrong checksum", chunk_of("zstd", 1, inner.len(), &packed)),
            ("bytes that are no zstd", chunk_of("zstd", 0, inner.len(), b"no zstd")),
            ("half of the bytes", chunk_of("zstd", 0, inner.len(), &packed[..packed.len() / 2])),
        ] {
            let (bodies, condition) = seen(&file(&[&damaged, &sound])).unwrap();
            assert_eq!((bodies.len(), condition.damaged_chunks), (2, 1), "{what}");
        }
    }

    #[test]
    fn a_compressed_chunk_that_was_cut_off_gives_the_records_of_its_whole_blocks() {
        // Numbers that follow no pattern, so that the chunk has several blocks of compressed bytes.
        let mut seed = 1_u32;
        let mut body = || {
            (0..1000)
                .map(|_| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (seed >> 24) as u8
                })
                .collect::<Vec<u8>>()
        };
        let bodies: Vec<Vec<u8>> = (0..1000).map(|_| body()).collect();
        let inner = bodies.iter().map(|body| record(op::MESSAGE, body)).collect::<Vec<_>>().concat();
        let packed = zstd::encode_all(&inner[..], 0).unwrap();
        let whole = chunk_of("zstd", crc32fast::hash(&inner), inner.len(), &packed);
        let (read, condition) = seen(&file(&[&whole[..whole.len() / 2]])).unwrap();
        assert!(!condition.is_whole && (300..=500).contains(&read.len()), "{} records", read.len());
        assert_eq!(read, bodies[..read.len()]);
    }

    #[test]
    fn a_chunk_that_decompresses_to_more_than_it_says_gives_no_more_than_that() {
        let bomb = zstd::encode_all(&vec![0; 1 << 24][..], 0).unwrap();
        let (bodies, condition) = seen(&file(&[&chunk_of("zstd", 7, 1 << 10, &bomb)])).unwrap();
        assert_eq!((bodies.len(), condition.damaged_chunks), (0, 1));
    }

    #[test]
    fn another_compression_and_other_files_are_refused() {
        let compressed = seen(&file(&[&chunk("lz4", 0, b"...")]));
        assert!(matches!(compressed, Err(WalkError::Compressed(name)) if name == "lz4"));
        assert!(matches!(seen(b""), Err(WalkError::Empty)));
        assert!(matches!(seen(b"\x89MCAP1\r\n"), Err(WalkError::NotMcap)));
    }

    proptest! {
        #[test]
        fn no_input_makes_it_panic(
            parts in prop::collection::vec((0u8..0x12, prop::collection::vec(any::<u8>(), 0..80)), 0..6),
            cut in 0usize..400,
            at in 0usize..400,
            with in any::<u8>(),
        ) {
            let parts: Vec<Vec<u8>> = parts.iter().map(|(opcode, body)| record(*opcode, body)).collect();
            let mut bytes = file(&parts.iter().map(Vec::as_slice).collect::<Vec<_>>());
            if let Some(byte) = bytes.get_mut(MAGIC.len() + at) {
                *byte ^= with;
            }
            bytes.truncate(bytes.len().saturating_sub(cut).max(MAGIC.len()));
            let longest = bytes.len();
            if let Ok((bodies, _)) = seen(&bytes) {
                prop_assert!(bodies.iter().all(|body| body.len() < longest));
            }
        }
    }
}
