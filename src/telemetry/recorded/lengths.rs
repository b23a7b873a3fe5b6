//! Whether the lengths that an MCAP record states fit the bytes that it has. The package `mcap` reserves memory for a text
//! before it reads it: without this check a crafted file of a few bytes makes it ask for 4 GiB.

use mcap::records::op;

/// Whether every text, list and map of a record ends within its body. Records of other kinds hold none.
pub fn fit(opcode: u8, body: &[u8]) -> bool {
    let mut body = Body(body);
    let fits = match opcode {
        op::HEADER => body.header(),
        op::SCHEMA => body.schema(),
        op::CHANNEL => body.channel(),
        op::METADATA => body.metadata(),
        _ => Some(()),
    };
    fits.is_some()
}

/// What is left of the body of a record. Each step takes its bytes, or `None` when there are fewer.
struct Body<'a>(&'a [u8]);

impl Body<'_> {
    /// Profile and library.
    fn header(&mut self) -> Option<()> {
        self.counted()?;
        self.counted()
    }

    /// Its number; name, encoding, definition.
    fn schema(&mut self) -> Option<()> {
        self.skip(2)?;
        self.counted()?;
        self.counted()?;
        self.counted()
    }

    /// The numbers of channel and schema; topic, encoding, metadata.
    fn channel(&mut self) -> Option<()> {
        self.skip(2 + 2)?;
        self.counted()?;
        self.counted()?;
        self.map()
    }

    /// Name and contents.
    fn metadata(&mut self) -> Option<()> {
        self.counted()?;
        self.map()
    }

    /// Pairs of texts, behind the number of their bytes.
    fn map(&mut self) -> Option<()> {
        let bytes = self.length()?;
        let before = self.0.len();
        while before - self.0.len() < bytes {
            self.counted()?;
            self.counted()?;
        }
        Some(())
    }

    /// Bytes behind their number.
    fn counted(&mut self) -> Option<()> {
        let bytes = self.length()?;
        self.skip(bytes)
    }

    fn length(&mut self) -> Option<usize> {
        let (length, rest) = self.0.split_first_chunk::<4>()?;
        self.0 = rest;
        usize::try_from(u32::from_le_bytes(*length)).ok()
    }

    fn skip(&mut self, bytes: usize) -> Option<()> {
        self.0 = self.0.get(bytes..)?;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(bytes: &[u8]) -> Vec<u8> {
        [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat()
    }

    /// A record of each kind that holds lengths, and where the lengths stand in it.
    fn sound() -> Vec<(u8, Vec<u8>, Vec<usize>)> {
        let map = [text(b"key"), text(b"value")].concat();
        vec![
            (op::HEADER, [text(b"ros2"), text(b"takt")].concat(), vec![0, 8]),
            (
                op::SCHEMA,
                [&[1, 0][..], &text(b"name"), &text(b"x"), &text(b"data")].concat(),
                vec![2, 10, 15],
            ),
            (
                op::CHANNEL,
                [&[1, 0, 1, 0][..], &text(b"/a"), &text(b"cdr"), &text(&map)].concat(),
                vec![4, 10, 17, 21, 28],
            ),
            (op::METADATA, [text(b"takt"), text(&map)].concat(), vec![0, 8, 12, 19]),
        ]
    }

    #[test]
    fn a_length_beyond_the_end_of_its_record_is_found_wherever_it_stands() {
        for (opcode, body, lengths) in sound() {
            assert!(fit(opcode, &body), "{opcode}");
            for at in lengths {
                let mut crafted = body.clone();
                crafted[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
                assert!(!fit(opcode, &crafted), "{opcode}, byte {at}");
            }
        }
    }

    proptest! {
        #[test]
        fn whatever_takt_writes_fits_and_one_byte_less_does_not(
            name in any::<String>(),
            pairs in prop::collection::vec(any::<(String, String)>(), 0..4),
        ) {
            let pairs = pairs.iter().flat_map(|(key, value)| [text(key.as_bytes()), text(value.as_bytes())]);
            let map = text(&pairs.collect::<Vec<_>>().concat());
            for (opcode, body) in [
                (op::HEADER, [text(name.as_bytes()), text(b"takt")].concat()),
                (op::SCHEMA, [vec![0, 0], text(name.as_bytes()), text(b"x"), text(&map)].concat()),
                (op::CHANNEL, [vec![0; 4], text(name.as_bytes()), text(b"cdr"), map.clone()].concat()),
                (op::METADATA, [text(name.as_bytes()), map].concat()),
            ] {
                prop_assert!(fit(opcode, &body));
                prop_assert!(!fit(opcode, &body[..body.len() - 1]));
            }
        }

        #[test]
        fn no_bytes_bring_it_down(opcode in any::<u8>(), body in prop::collection::vec(any::<u8>(), 0..60)) {
            fit(opcode, &body);
        }
    }
}
