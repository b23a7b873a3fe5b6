//! From the bytes of an MCAP file to its records, as far as they go. A file that was cut off (`kill -9`, a power cut) is
//! read to its last whole record, also within a chunk; a chunk whose checksum is wrong is left out.

use std::io::{self, Read};

use mcap::MAGIC;
use mcap::records::op;

/// No record of takt is longer. A length beyond it is no length.
const LONGEST_RECORD: u64 = 1 << 28;

/// What a file is, at its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// Whether it was read to the end of its data.
    pub is_whole: bool,
    /// Chunks that were left out because they are damaged.
    pub damaged_chunks: u64,
}

/// Why nothing can be read.
#[derive(Debug, thiserror::Error)]
pub enum WalkError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// There is nothing in it.
    #[error("the file is empty")]
    Empty,
    /// It is something else.
    #[error("this is no MCAP file")]
    NotMcap,
    /// takt compresses nothing.
    #[error("its chunks are compressed ({0}); takt writes and reads uncompressed ones only")]
    Compressed(String),
}

/// Shows every record with its opcode to `visit`, in the order of the file.
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
                let is_sound = walk_chunk(&body, is_whole, &mut visit)?;
                condition.damaged_chunks += u64::from(!is_sound);
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

/// Returns whether the chunk is sound, as far as that can be told.
fn walk_chunk(body: &[u8], is_whole: bool, visit: &mut impl FnMut(u8, &[u8])) -> Result<bool, WalkError> {
    let Some(chunk) = Chunk::parse(body) else { return Ok(!is_whole) };
    if !chunk.compression.is_empty() {
        return Err(WalkError::Compressed(String::from_utf8_lossy(chunk.compression).into_owned()));
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
    /// Start and end time, uncompressed size and its CRC, the compression's name, the size, and the records, which may
    /// have been cut off.
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
