//! Access of the master to the objects by SDO and RPDO, with the effects of each write.

use takt_rt::Nanoseconds;

use super::{Cia402Drive, SAVE_NS};
use crate::canopen::object::ObjectAddress;
use crate::sim::cia402::places::AXIS_OFFSET;
use crate::sim::object_dictionary::{ObjectKind, SimulatedDictionary};
use crate::sim::pdo_engine::check_parameter;
use crate::sim::sdo_reply::AbortCode;
use crate::sim::sdo_server::ObjectAccess;

/// The signatures for objects 1010 and 1011.
const SAVE_SIGNATURE: i64 = u32::from_le_bytes(*b"save") as i64;
const LOAD_SIGNATURE: i64 = u32::from_le_bytes(*b"load") as i64;

/// Writes an object from an RPDO; a value out of range is ignored.
pub(super) fn write_field(dictionary: &mut SimulatedDictionary, place: usize, bits: u64) {
    if dictionary.entry(place).is_writable && dictionary.accepts(place, bits) {
        dictionary.set(place, bits.cast_signed());
    }
}

/// Checks what the data sheet cannot say of a value.
fn check_meaning(address: ObjectAddress, value: i64) -> Result<(), AbortCode> {
    let is_right = match (address.index, address.subindex) {
        (0x1003, 0) => value == 0,
        // Bit 29: a 29-bit identifier.
        (0x1005, 0) => value & 0x2000_0000 == 0 && value & 0x7FF != 0,
        (0x1016, 1..) => value >> 16 <= 127,
        (0x1019, 0) => value == 0 || (2..=240).contains(&value),
        _ => true,
    };
    if is_right { Ok(()) } else { Err(AbortCode::Value) }
}

/// The object dictionary as the SDO server accesses it.
pub(super) struct Objects<'a> {
    pub(super) drive: &'a mut Cia402Drive,
    pub(super) now_ns: Nanoseconds,
}

impl ObjectAccess for Objects<'_> {
    fn read(&mut self, address: ObjectAddress, value: &mut Vec<u8>) -> Result<(), AbortCode> {
        let drive = &mut self.drive;
        let place = drive.dictionary.find(address)?;
        if !drive.dictionary.entry(place).is_readable {
            return Err(AbortCode::WriteOnly);
        }
        let history = drive.dictionary.number_at(drive.dictionary.place(0x1003, 0)).unwrap_or(0);
        if address.index == 0x1003 && i64::from(address.subindex) > history {
            return Err(AbortCode::NoData);
        }
        drive.measure();
        drive.dictionary.append(place, value);
        Ok(())
    }

    fn check_write(&self, address: ObjectAddress) -> Result<Option<usize>, AbortCode> {
        let entry = self.drive.dictionary.entry(self.drive.dictionary.find(address)?);
        match (entry.is_writable, entry.kind) {
            (false, _) => Err(AbortCode::ReadOnly),
            (true, ObjectKind::Bytes) => Ok(None),
            (true, _) => Ok(Some(entry.length)),
        }
    }

    fn write(&mut self, address: ObjectAddress, value: &[u8]) -> Result<(), AbortCode> {
        let Self { drive, now_ns } = self;
        let place = drive.dictionary.find(address)?;
        let number = match (address.index, address.subindex) {
            // The objects show what they can do, and take a signature, whatever their range is.
            (0x1010 | 0x1011, 1..) => return drive.take_signature(address.index, value, *now_ns),
            _ => drive.dictionary.decode(place, value)?,
        };
        check_meaning(address, number)?;
        check_parameter(&drive.dictionary, address, number)?;
        drive.dictionary.store(place, value)?;
        drive.written(address, *now_ns);
        Ok(())
    }
}

impl Cia402Drive {
    fn take_signature(&mut self, index: u16, value: &[u8], now_ns: Nanoseconds) -> Result<(), AbortCode> {
        let signature = <[u8; 4]>::try_from(value).map(u32::from_le_bytes).map(i64::from);
        match (index, signature) {
            (0x1010, Ok(SAVE_SIGNATURE)) => {
                self.save_ns = now_ns + self.quirks.delays.save_ns.unwrap_or(SAVE_NS);
                Ok(())
            }
            (0x1011, Ok(LOAD_SIGNATURE)) => {
                self.dictionary.forget();
                Ok(())
            }
            _ => Err(AbortCode::CannotStore),
        }
    }

    /// Applies the effects of a new value.
    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds) {
        match address.index {
            0x1005 | 0x1006 => self.network.schedule_sync(now_ns, &self.dictionary),
            0x100C | 0x100D => self.network.stop_life_guarding(),
            0x1016 => self.network.stop_master_monitor(),
            0x1017 => self.network.schedule_heartbeat(now_ns, &self.dictionary),
            0x1400..=0x1BFF => self.pdos.compile(&self.dictionary),
            0x6000..=0x9FFF => match 0x6000 + (address.index - 0x6000) % AXIS_OFFSET {
                0x6040 => self.evaluate(),
                0x6060 => self.follow_modes(now_ns),
                0x607A | 0x60C1 => self.latch(),
                0x607E | 0x608F | 0x6091 | 0x6092 | 0x6096 | 0x60A9 => {
                    for axis in &mut self.axes {
                        axis.set_units(&self.dictionary, &self.quirks);
                    }
                }
                _ => {}
            },
            _ => {}
        }
    }
}
