//! The MCAP records that a recording consists of. Every length is checked against the bytes that are there, before
//! anything of that length is allocated: a file may contain any number.

use std::collections::BTreeMap;

use mcap::records::op;

/// What is read of a record.
#[derive(Debug, PartialEq)]
pub enum Record<'a> {
    /// The beginning of the file.
    Header {
        /// The program that wrote it.
        library: String,
    },
    /// The type of the messages of some channels.
    Schema {
        /// Its number.
        id: u16,
        /// The name of the type.
        name: String,
        /// The fields of the type.
        definition: &'a [u8],
    },
    /// A channel.
    Channel {
        /// Its number.
        id: u16,
        /// The type of its messages.
        schema: u16,
        /// The description of the channel by its writer.
        metadata: BTreeMap<String, String>,
    },
    /// A message.
    Message {
        /// Its channel.
        channel: u16,
        /// The time of the message.
        log_time_ns: u64,
        /// Its fields.
        data: &'a [u8],
    },
    /// A description of the file by its writer.
    Metadata {
        /// Its name.
        name: String,
        /// Its keys and texts.
        entries: BTreeMap<String, String>,
    },
}

/// A record that is not what its opcode says.
#[derive(Debug, PartialEq)]
pub struct Malformed;

/// Reads the body of a record. `None` is a kind of record that no recording needs.
pub fn parse(opcode: u8, body: &[u8]) -> Option<Result<Record<'_>, Malformed>> {
    let mut fields = Fields(body);
    let record = match opcode {
        op::HEADER => header(&mut fields),
        op::SCHEMA => schema(&mut fields),
        op::CHANNEL => channel(&mut fields),
        op::MESSAGE => message(&mut fields),
        op::METADATA => metadata(&mut fields),
        _ => return None,
    };
    Some(record.ok_or(Malformed))
}

fn header<'a>(fields: &mut Fields<'a>) -> Option<Record<'a>> {
    let _profile = fields.text()?;
    Some(Record::Header { library: fields.text()? })
}

fn schema<'a>(fields: &mut Fields<'a>) -> Option<Record<'a>> {
    let (id, name, _encoding) = (fields.u16()?, fields.text()?, fields.text()?);
    Some(Record::Schema { id, name, definition: fields.bytes()? })
}

fn channel<'a>(fields: &mut Fields<'a>) -> Option<Record<'a>> {
    let (id, schema, _topic, _encoding) = (fields.u16()?, fields.u16()?, fields.text()?, fields.text()?);
    Some(Record::Channel { id, schema, metadata: fields.map()? })
}

fn message<'a>(fields: &mut Fields<'a>) -> Option<Record<'a>> {
    let (channel, _sequence, log_time_ns, _publish_time_ns) =
        (fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?);
    Some(Record::Message { channel, log_time_ns, data: fields.0 })
}

fn metadata<'a>(fields: &mut Fields<'a>) -> Option<Record<'a>> {
    Some(Record::Metadata { name: fields.text()?, entries: fields.map()? })
}

/// What is left of a body.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take<const LENGTH: usize>(&mut self) -> Option<[u8; LENGTH]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    /// Bytes behind their number.
    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.u32()?).ok()?;
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    fn text(&mut self) -> Option<String> {
        str::from_utf8(self.bytes()?).ok().map(str::to_owned)
    }

    /// Pairs of texts behind their length in bytes.
    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut pairs = Fields(self.bytes()?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            map.insert(pairs.text()?, pairs.text()?);
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(content: &str) -> Vec<u8> {
        [&(content.len() as u32).to_le_bytes()[..], content.as_bytes()].concat()
    }

    fn metadata_record(name: &str, pairs: &[(&str, &str)]) -> Vec<u8> {
        let pairs: Vec<u8> =
            pairs.iter().flat_map(|(key, value)| [text(key), text(value)].concat()).collect();
        [text(name), (pairs.len() as u32).to_le_bytes().to_vec(), pairs].concat()
    }

    #[test]
    fn names_and_pairs_are_read_and_other_kinds_of_records_left_alone() {
        let body = metadata_record("takt", &[("machine", "arm"), ("version", "1")]);
        let entries =
            [("machine", "arm"), ("version", "1")].map(|(key, value)| (key.to_owned(), value.to_owned()));
        let expected = Record::Metadata { name: "takt".to_owned(), entries: entries.into() };
        assert_eq!(parse(op::METADATA, &body), Some(Ok(expected)));
        let body = [text("ros2"), text("takt 0.1")].concat();
        assert_eq!(parse(op::HEADER, &body), Some(Ok(Record::Header { library: "takt 0.1".to_owned() })));
        assert_eq!(parse(op::ATTACHMENT, &body), None);
    }

    #[test]
    fn a_length_beyond_the_end_of_the_record_makes_it_malformed() {
        let body = metadata_record("takt", &[("machine", "arm")]);
        for at in [0, 8, 12, 23] {
            let mut false_length = body.clone();
            false_length[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            assert_eq!(parse(op::METADATA, &false_length), Some(Err(Malformed)), "the length at byte {at}");
        }
    }

    proptest! {
        #[test]
        fn no_input_makes_it_panic(opcode in 0u8..0x12, body in prop::collection::vec(any::<u8>(), 0..100)) {
            let _ = parse(opcode, &body);
        }
    }
}
