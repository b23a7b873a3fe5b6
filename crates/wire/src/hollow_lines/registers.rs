//! The RS-485 module as a Modbus slave: 16 holding registers from address 0, one for each byte (section 7.2 of the manual).
//!
//! Writing all of them sends the command. Reading all of them returns the last reply. The slave address is the identifier of
//! the motor. The line has 19200 baud: a write and a read take about 50 ms.

use thiserror::Error;

use super::motor_data::DATA_BYTES;

/// The baud rate of the line, which cannot be changed.
pub const BAUD_RATE: u32 = 19_200;
/// The address of the first register (40001).
pub const FIRST_ADDRESS: u16 = 0;

/// A register whose upper byte is not zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("register 0x{address:04X} is 0x{value:04X}: only its low byte may be set")]
pub struct UpperByte {
    /// The address.
    pub address: u16,
    /// The value.
    pub value: u16,
}

/// The registers of these bytes.
pub fn to_registers(data: &[u8; DATA_BYTES]) -> [u16; DATA_BYTES] {
    data.map(u16::from)
}

/// The bytes of these registers.
///
/// # Errors
/// [`UpperByte`]: the first register that is more than a byte.
pub fn from_registers(registers: &[u16; DATA_BYTES]) -> Result<[u8; DATA_BYTES], UpperByte> {
    let mut data = [0; DATA_BYTES];
    for ((byte, value), address) in data.iter_mut().zip(registers).zip(FIRST_ADDRESS..) {
        *byte = u8::try_from(*value).map_err(|_| UpperByte { address, value: *value })?;
    }
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_byte_is_a_register_and_a_register_is_no_more_than_a_byte() {
        let data = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 0xFF];
        let mut registers = to_registers(&data);
        assert_eq!(from_registers(&registers), Ok(data));
        registers[10] = 0x0100;
        let refused = from_registers(&registers).unwrap_err();
        assert_eq!(refused, UpperByte { address: 0x000A, value: 0x0100 });
        assert_eq!(refused.to_string(), "register 0x000A is 0x0100: only its low byte may be set");
    }
}
