//! What goes beside each message: its number, when it was sent, and who sent it.
//!
//! `rmw_zenoh` writes it by zenoh's own serializer: integers in little-endian order, and a sequence of bytes behind its length as a LEB128
//! number, which is one byte here.

use crate::names::Gid;

/// The length of an attachment in bytes.
const LENGTH: usize = 8 + 8 + 1 + 16;

/// The attachment of a message. `number` counts the messages of its publisher from 1; the time is in ns since 1970.
pub fn attachment(number: i64, sent_ns: i64, gid: Gid) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    let (numbers, rest) = bytes.split_at_mut(16);
    numbers[..8].copy_from_slice(&number.to_le_bytes());
    numbers[8..].copy_from_slice(&sent_ns.to_le_bytes());
    rest[0] = gid.len() as u8;
    rest[1..].copy_from_slice(&gid);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `zenoh.ext.z_serialize((Int64(5), Int64(7), b"0123456789abcdef"))` of eclipse-zenoh 1.10.2 for Python.
    #[test]
    fn an_attachment_is_what_the_serializer_of_zenoh_makes_of_it() {
        let expected = "050000000000000007000000000000001030313233343536373839616263646566";
        let made = attachment(5, 7, *b"0123456789abcdef");
        assert_eq!(made.map(|byte| format!("{byte:02x}")).concat(), expected);
    }
}
