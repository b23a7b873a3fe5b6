//! The write of one value.

use crate::canopen::object::ObjectAddress;
use crate::canopen::sdo::Uploaded;

/// One value to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Download {
    /// The object.
    pub object: ObjectAddress,
    /// The little-endian data.
    pub data: Vec<u8>,
}

impl Download {
    /// Returns `true` if the value read back matches the written one. Devices may force bit 30 (no RTR) of a PDO's COB-ID.
    pub fn is_held_by(&self, received: &Uploaded) -> bool {
        const NO_RTR: u32 = 1 << 30;
        let Self { object, data } = self;
        let counted = if received.is_size_known { received.bytes.len() } else { data.len() };
        let Some(bytes) = received.bytes.get(..counted) else { return false };
        let is_cob_id = matches!(object.index, 0x1400..=0x15FF | 0x1800..=0x19FF) && object.subindex == 1;
        match (<[u8; 4]>::try_from(data.as_slice()), <[u8; 4]>::try_from(bytes)) {
            (Ok(written), Ok(bytes)) if is_cob_id => {
                (u32::from_le_bytes(written) ^ u32::from_le_bytes(bytes)) & !NO_RTR == 0
            }
            _ => data == bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_read_back_may_differ_in_the_bit_that_devices_force() {
        let download =
            |index, data: [u8; 4]| Download { object: ObjectAddress::new(index, 1), data: data.into() };
        let read = |bytes: &[u8], is_size_known| Uploaded { bytes: bytes.into(), is_size_known };
        let cob_id = download(0x1800, [0x82, 1, 0, 0]);
        assert!(cob_id.is_held_by(&read(&[0x82, 1, 0, 0x40], true)));
        assert!(!cob_id.is_held_by(&read(&[0x82, 1, 0, 0x80], true)), "it is not valid");
        assert!(!download(0x2000, [0x82, 1, 0, 0]).is_held_by(&read(&[0x82, 1, 0, 0x40], true)));
        let short = Download { object: ObjectAddress::new(0x2000, 1), data: vec![7] };
        assert!(short.is_held_by(&read(&[7, 0, 0, 0], false)), "its size was not indicated");
        assert!(!short.is_held_by(&read(&[7, 0, 0, 0], true)));
    }
}
