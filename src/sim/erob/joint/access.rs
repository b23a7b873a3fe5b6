//! Access of the master to the object dictionary by SDO and RPDO, with the effects of each write.

use takt_rt::Nanoseconds;

use super::ErobJoint;
use crate::canopen::object::ObjectAddress;
use crate::sim::erob::objects::at;
use crate::sim::object_dictionary::SimulatedDictionary;
use crate::sim::pdo_engine::{check_parameter, is_parameter};
use crate::sim::sdo_reply::AbortCode;
use crate::sim::sdo_server::ObjectAccess;

/// The signature for object 1010:1.
const SAVE_SIGNATURE: i64 = u32::from_le_bytes(*b"save") as i64;
/// Time from "save" until it takes effect: the manual requires a wait of 3 s before the supply is cut.
const SAVE_NS: Nanoseconds = 3_000_000_000;

/// Writes an entry from an RPDO. An enabled drive keeps its mode; a value out of range is ignored.
pub(super) fn write_field(is_enabled: bool) -> impl FnMut(&mut SimulatedDictionary, usize, u64) {
    move |dictionary, place, bits| {
        if let Some(number) = dictionary.accepted(place, bits)
            && check_range(place, number).is_ok()
            && !(is_enabled && place == at::OPERATION_MODE)
        {
            dictionary.set(place, number);
        }
    }
}

/// Checks the range of an entry. The module has one abort code for every wrong value.
fn check_range(place: usize, number: i64) -> Result<(), AbortCode> {
    let is_in_range = match place {
        at::ERROR_HISTORY => number == 0,
        // Bit 29: it has no 29-bit identifiers.
        at::SYNC_ID => number & 0x2000_0000 == 0 && number & 0x7FF != 0,
        at::CONSUMER_HEARTBEAT => number >> 16 <= 127,
        at::ERROR_BEHAVIOUR => number <= 2,
        at::OPERATION_MODE => (0..=10).contains(&number),
        at::TORQUE_OFFSET => (-3000..=3000).contains(&number),
        _ => true,
    };
    if is_in_range { Ok(()) } else { Err(AbortCode::Value) }
}

/// The object dictionary as the SDO server accesses it.
pub(super) struct Objects<'a> {
    pub(super) module: &'a mut ErobJoint,
    pub(super) now_ns: Nanoseconds,
}

impl ObjectAccess for Objects<'_> {
    fn read(&mut self, address: ObjectAddress, value: &mut Vec<u8>) -> Result<(), AbortCode> {
        let module = &mut self.module;
        let place = module.dictionary.find(address)?;
        if !module.dictionary.entry(place).is_readable {
            return Err(AbortCode::WriteOnly);
        }
        let history = module.dictionary.number(at::ERROR_HISTORY);
        if address.index == 0x1003 && i64::from(address.subindex) > history {
            return Err(AbortCode::NoData);
        }
        module.measure();
        module.dictionary.append(place, value);
        Ok(())
    }

    fn check_write(&self, address: ObjectAddress) -> Result<Option<usize>, AbortCode> {
        let place = self.module.dictionary.find(address)?;
        let entry = self.module.dictionary.entry(place);
        if !entry.is_writable {
            return Err(AbortCode::ReadOnly);
        }
        if place == at::OPERATION_MODE && self.module.device.state().has_torque() {
            return Err(AbortCode::DeviceState);
        }
        Ok(Some(entry.length))
    }

    fn write(&mut self, address: ObjectAddress, value: &[u8]) -> Result<(), AbortCode> {
        let Self { module, now_ns } = self;
        let place = module.dictionary.find(address)?;
        let number = module.dictionary.decode(place, value)?;
        check_range(place, number)?;
        match (address.index, address.subindex) {
            (0x1010, _) => {
                if number != SAVE_SIGNATURE {
                    return Err(AbortCode::CannotStore);
                }
                module.save_ns = *now_ns + SAVE_NS;
                return Ok(());
            }
            // It has no PDOs on remote request only.
            (0x1800..=0x1803, 2) if matches!(number, 252 | 253) => return Err(AbortCode::Value),
            _ => check_parameter(&module.dictionary, address, number)?,
        }
        module.dictionary.set(place, number);
        module.written(address, *now_ns);
        Ok(())
    }
}

impl ErobJoint {
    /// Applies the effects of a new value.
    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds) {
        match address.index {
            0x1005 | 0x1006 => self.network.schedule_sync(now_ns, &self.dictionary),
            0x1016 => self.network.stop_master_monitor(),
            0x1017 => self.network.schedule_heartbeat(now_ns, &self.dictionary),
            0x2242 if self.dictionary.number(at::BATTERY_RESET) == 1 => {
                self.has_battery_fault = false;
                self.lose_turns();
            }
            0x6040 => self.evaluate(now_ns),
            0x6060 => self.follow_mode(),
            0x607A => self.motion.latch(&self.dictionary),
            index if is_parameter(index) => self.pdos.compile(&self.dictionary),
            _ => {}
        }
    }
}
