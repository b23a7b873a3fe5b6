//! Concise DCF (CiA 302-3, object 1F22): a count of 32 bits, then index, sub-index, length (32 bits) and data of each
//! write, all little-endian.

use super::Download;
use crate::canopen::object::ObjectAddress;

/// Bytes before the data of an entry.
const ENTRY_HEADER_BYTES: usize = 7;

/// Why bytes are not a concise DCF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConciseError {
    /// The bytes end early.
    #[error("the bytes end within entry {entry} of {count}")]
    Truncated {
        /// The entry, counted from 1; 0 for the count itself.
        entry: u32,
        /// The announced number of entries.
        count: u32,
    },
    /// Bytes follow the last entry.
    #[error("{bytes} bytes follow the last entry")]
    Trailing {
        /// Number of bytes.
        bytes: usize,
    },
}

/// Encodes a list of writes.
pub fn encode(downloads: &[Download]) -> Vec<u8> {
    let mut bytes = (downloads.len() as u32).to_le_bytes().to_vec();
    for Download { object, data } in downloads {
        bytes.extend(object.index.to_le_bytes());
        bytes.push(object.subindex);
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
    }
    bytes
}

/// Decodes a list of writes.
pub fn decode(bytes: &[u8]) -> Result<Vec<Download>, ConciseError> {
    let truncated = |entry, count| ConciseError::Truncated { entry, count };
    let (count, mut rest) = bytes.split_first_chunk().ok_or(truncated(0, 0))?;
    let count = u32::from_le_bytes(*count);
    let mut downloads = Vec::with_capacity((count as usize).min(rest.len() / ENTRY_HEADER_BYTES));
    for entry in 1..=count {
        let (header, tail) = rest.split_first_chunk::<ENTRY_HEADER_BYTES>().ok_or(truncated(entry, count))?;
        let [low, high, subindex, length @ ..] = *header;
        let length = u32::from_le_bytes(length) as usize;
        let (data, tail) = tail.split_at_checked(length).ok_or(truncated(entry, count))?;
        let object = ObjectAddress::new(u16::from_le_bytes([low, high]), subindex);
        downloads.push(Download { object, data: data.to_vec() });
        rest = tail;
    }
    match rest.len() {
        0 => Ok(downloads),
        bytes => Err(ConciseError::Trailing { bytes }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_encoding_is_that_of_object_1f22() {
        let downloads = [
            Download { object: ObjectAddress::new(0x1017, 0), data: vec![0x64, 0] },
            Download { object: ObjectAddress::new(0x1800, 2), data: vec![1] },
        ];
        let bytes = [2, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 0x64, 0, 0x00, 0x18, 2, 1, 0, 0, 0, 1];
        assert_eq!(encode(&downloads), bytes);
        assert_eq!(decode(&bytes), Ok(downloads.to_vec()));
        assert_eq!(decode(&bytes[..20]), Err(ConciseError::Truncated { entry: 2, count: 2 }));
        assert_eq!(decode(b"[FileInfo]"), Err(ConciseError::Truncated { entry: 1, count: 0x6C69_465B }));
        assert_eq!(decode(&[0, 0, 0, 0, 9]), Err(ConciseError::Trailing { bytes: 1 }));
    }

    proptest! {
        #[test]
        fn a_decoded_list_is_encoded_to_the_same_bytes(bytes in prop::collection::vec(0..3_u8, 0..40)) {
            if let Ok(downloads) = decode(&bytes) {
                prop_assert_eq!(encode(&downloads), bytes);
            }
        }
    }
}
