//! Reads messages by the schema in the recording alone, as another program does: the ROS 2 interface language, and CDR.

use std::collections::BTreeMap;

/// The fields of a message by name. Every number is an `f64`, and an array has its elements `name[0]` ….
pub type Fields = BTreeMap<String, Value>;

#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Number(f64),
    Text(String),
}

struct Cursor<'a> {
    body: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        self.at = self.at.next_multiple_of(N);
        let bytes = self.body[self.at..self.at + N].try_into().unwrap();
        self.at += N;
        bytes
    }

    fn value(&mut self, kind: &str) -> Value {
        Value::Number(match kind {
            "bool" | "uint8" => u8::from_le_bytes(self.take()).into(),
            "uint16" => u16::from_le_bytes(self.take()).into(),
            "int16" => i16::from_le_bytes(self.take()).into(),
            "uint32" => u32::from_le_bytes(self.take()).into(),
            "int32" => i32::from_le_bytes(self.take()).into(),
            "uint64" => u64::from_le_bytes(self.take()) as f64,
            "float32" => f32::from_le_bytes(self.take()).into(),
            "float64" => f64::from_le_bytes(self.take()),
            "string" => {
                let length = u32::from_le_bytes(self.take()) as usize;
                let text = std::str::from_utf8(&self.body[self.at..self.at + length - 1]).unwrap();
                assert_eq!(self.body[self.at + length - 1], 0);
                self.at += length;
                return Value::Text(text.to_owned());
            }
            other => panic!("no such type: {other}"),
        })
    }

    /// Reads the fields of a definition, with `prefix` before their names.
    fn fields(&mut self, definition: &str, prefix: &str, within: &[&str], fields: &mut Fields) {
        for line in definition.lines().map(str::trim) {
            let is_field = !line.is_empty() && !line.starts_with(['#', '=']) && !line.contains('=');
            let Some((kind, name)) = line.split_once(' ').filter(|_| is_field) else { continue };
            let name = format!("{prefix}{name}");
            let of_kind = |kind: &str| within.iter().find_map(|part| part.strip_prefix(kind));
            match kind.split_once('[') {
                Some((element, length)) => {
                    let count = match length.trim_end_matches(']') {
                        "" => u32::from_le_bytes(self.take()),
                        fixed => fixed.parse().unwrap(),
                    };
                    for index in 0..count {
                        fields.insert(format!("{name}[{index}]"), self.value(element));
                    }
                }
                None if kind.contains('/') => {
                    self.fields(of_kind(kind).unwrap(), &format!("{name}."), within, fields);
                }
                None => {
                    fields.insert(name, self.value(kind));
                }
            }
        }
    }
}

/// Decodes a message, to its last byte.
pub fn decode(definition: &str, message: &[u8]) -> Fields {
    assert_eq!(message[..4], [0, 1, 0, 0], "little-endian CDR");
    let mut cursor = Cursor { body: &message[4..], at: 0 };
    let mut fields = Fields::new();
    // The definitions of the types within follow that of the message.
    let parts: Vec<&str> = definition.split("====\nMSG: ").collect();
    cursor.fields(parts[0], "", &parts[1..], &mut fields);
    assert_eq!(cursor.at, cursor.body.len(), "bytes beyond the definition");
    fields
}

/// The messages of a topic with their times, from the bytes of a recording.
pub fn messages(recording: &[u8], topic: &str) -> Vec<(u64, Fields)> {
    let messages = mcap::MessageStream::new(recording).unwrap().map(Result::unwrap);
    messages
        .filter(|message| message.channel.topic == topic)
        .map(|message| {
            let schema = message.channel.schema.as_ref().unwrap();
            assert_eq!((&*schema.encoding, &*message.channel.message_encoding), ("ros2msg", "cdr"));
            let definition = std::str::from_utf8(&schema.data).unwrap();
            (message.log_time, decode(definition, &message.data))
        })
        .collect()
}
