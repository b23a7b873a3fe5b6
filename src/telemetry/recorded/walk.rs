//! Splits an MCAP file into its records. A file that was cut off (`kill -9`, a power cut) is read to its last whole record,
//! also within a chunk. A chunk with a wrong checksum is skipped.

use std::io::{self, Read};

use mcap::MAGIC;
use mcap::records::op;

use crate::printable::printable;

/// No record of takt is longer. A longer record means that the file is damaged.
const LONGEST_RECORD: u64 = 1 << 28;

/// The condition of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// Whether it was read to the end of its data.
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
    /// takt does not compress chunks.
    #[error("its chunks are compressed ({0}); takt writes and reads uncompressed ones only")]
    Compressed(String),
}

/// Passes every record with its opcode to `visit`, in the order of the file.
pub fn walk(mut file: impl Read, mut visit: impl FnMut(u8, &[u8])) -> Result<Condition, WalkError> {
    let mut condition = Condition::default();
    let mut body = Vec::new();
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
                let is_undamaged = walk_chunk(&body, is_whole, &mut visit)?;
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
fn walk_chunk(body: &[u8], is_whole: bool, visit: &mut impl FnMut(u8, &[u8])) -> Result<bool, WalkError> {
    let Some(chunk) = Chunk::parse(body) else { return Ok(!is_whole) };
    if !chunk.compression.is_empty() {
        return Err(WalkError::Compressed(printable(&String::from_utf8_lossy(chunk.compression))));
    }
    if is_whole && chunk.crc != 0 && crc32fast::hash(chunk.records) != chunk.crc {
        return Ok(false);
    }
    let mut rest = chunk.records;
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

struct Chunk<'a> {
    crc: u32,
    compression: &'a [u8],
    records: &'a [u8],
}

impl<'a> Chunk<'a> {
    /// Reads start time, end time, uncompressed size, CRC, name of the compression, size, and records. The records may have
    /// been cut off.
    fn parse(body: &'a [u8]) -> Option<Self> {
        let (_, rest) = body.split_at_checked(8 + 8 + 8)?;
        let (crc, rest) = rest.split_first_chunk::<4>()?;
        let (name, rest) = rest.split_first_chunk::<4>()?;
        let (compression, rest) = rest.split_at_checked(u32::from_le_bytes(*name) as usize)?;
        let (size, rest) = rest.split_first_chunk::<8>()?;
        let size = usize::try_from(u64::from_le_bytes(*size)).ok()?;
        let records = rest.get(..size).unwrap_or(rest);
        Some(Self { crc: u32::from_le_bytes(*crc), compression, records })
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
        let size = (records.len() as u64).to_le_bytes();
        let name = (compression.len() as u32).to_le_bytes();
        let head = [&[0; 16][..], &size, &crc.to_le_bytes(), &name, compression.as_bytes(), &size].concat();
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
    fn compressed_chunks_and_other_files_are_refused() {
        let compressed = seen(&file(&[&chunk("zstd", 0, b"...")]));
        assert!(matches!(compressed, Err(WalkError::Compressed(name)) if name == "zstd"));
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
