//! The CRC of a block transfer (CiA 301, 7.2.4.3.16): polynomial x¹⁶ + x¹² + x⁵ + 1, start value 0.

/// The CRC of all data of a transfer.
pub(super) fn checksum(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte) << 8,
            |crc: u16, _| {
                if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crc_of_the_standards_check_string_is_right() {
        assert_eq!(checksum(b"123456789"), 0x31C3);
        assert_eq!(checksum(b""), 0);
    }
}
