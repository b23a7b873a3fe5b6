//! Access of the master to the object dictionary by SDO and RPDO, with the effects of each write.

use takt_rt::{DriveState, Nanoseconds};

use super::ErobJoint;
use crate::sim::erob::dictionary::{ErobDictionary, at};
use crate::sim::erob::objects::OBJECTS;
use crate::sim::erob::{process_data, sdo};
use crate::sim::sdo_reply::AbortCode;

/// The signature for object 1010:1.
const SAVE_SIGNATURE: u32 = u32::from_le_bytes(*b"save");
/// Time from "save" until it takes effect: the manual requires a wait of 3 s before the supply is cut.
const SAVE_NS: Nanoseconds = 3_000_000_000;

/// Writes an entry from an RPDO. An enabled drive keeps its mode; a value out of range is ignored.
pub(super) fn write_field(dictionary: &mut ErobDictionary, at: usize, value: u32) {
    let is_enabled = DriveState::decode(dictionary.get(at::STATUSWORD) as u16).has_torque();
    if at == at::OPERATION_MODE && is_enabled {
        return;
    }
    if check_range(at, value).is_ok() {
        dictionary.set(at, value);
    }
}

/// Checks the range of an entry.
fn check_range(at: usize, value: u32) -> Result<(), AbortCode> {
    let is_in_range = match at {
        at::ERROR_HISTORY => value == 0,
        // Bit 29: it has no 29-bit identifiers.
        at::SYNC_ID => value & 0x2000_0000 == 0 && value & 0x7FF != 0,
        at::CONSUMER_HEARTBEAT => value >> 16 <= 127,
        at::ERROR_BEHAVIOUR => value <= 2,
        at::OPERATION_MODE => value <= 10,
        at::TORQUE_OFFSET => (-3000..=3000).contains(&i32::from(value as u16 as i16)),
        _ => true,
    };
    if is_in_range { Ok(()) } else { Err(AbortCode::Value) }
}

/// The object dictionary as the SDO server accesses it.
pub(super) struct Objects<'a> {
    pub(super) module: &'a mut ErobJoint,
    pub(super) now_ns: Nanoseconds,
}

impl sdo::ErobObjectAccess for Objects<'_> {
    fn read(&mut self, index: u16, subindex: u8) -> Result<([u8; 4], usize), AbortCode> {
        let at = ErobDictionary::for_reading(index, subindex)?;
        let history = self.module.dictionary.get(at::ERROR_HISTORY);
        if OBJECTS[at].index == 0x1003 && u32::from(subindex) > history {
            return Err(AbortCode::NoData);
        }
        self.module.measure();
        Ok((self.module.dictionary.get(at).to_le_bytes(), OBJECTS[at].data_type.bytes()))
    }

    fn check_write(&self, index: u16, subindex: u8) -> Result<usize, AbortCode> {
        let at = ErobDictionary::for_writing(index, subindex)?;
        if at == at::OPERATION_MODE && self.module.device.state().has_torque() {
            return Err(AbortCode::DeviceState);
        }
        Ok(OBJECTS[at].data_type.bytes())
    }

    fn write(&mut self, index: u16, subindex: u8, value: [u8; 4]) -> Result<(), AbortCode> {
        let at = ErobDictionary::for_writing(index, subindex)?;
        let size = OBJECTS[at].data_type.bytes();
        let value = u32::from_le_bytes(value) & (u32::MAX >> (32 - 8 * size));
        check_range(at, value)?;
        let Self { module, now_ns } = self;
        match index {
            0x1010 => {
                if value != SAVE_SIGNATURE {
                    return Err(AbortCode::CannotStore);
                }
                module.save_ns = *now_ns + SAVE_NS;
                return Ok(());
            }
            0x1400..=0x1403 | 0x1600..=0x1603 | 0x1800..=0x1803 | 0x1A00..=0x1A03 => {
                process_data::check_parameter(&module.dictionary, at, value)?;
            }
            _ => {}
        }
        module.dictionary.set(at, value);
        module.written(at, *now_ns);
        Ok(())
    }
}

impl ErobJoint {
    /// Applies the effects of a new value.
    fn written(&mut self, at: usize, now_ns: Nanoseconds) {
        match at {
            at::CONTROLWORD => self.evaluate(now_ns),
            at::TARGET_POSITION => self.motion.latch(&self.dictionary),
            at::OPERATION_MODE => self.follow_mode(),
            at::PRODUCER_HEARTBEAT => self.network.schedule_heartbeat(now_ns, &self.dictionary),
            at::SYNC_ID | at::CYCLE_PERIOD => self.network.schedule_sync(now_ns, &self.dictionary),
            at::CONSUMER_HEARTBEAT => self.network.stop_master_monitor(),
            at::BATTERY_RESET if self.dictionary.get(at) == 1 => {
                self.has_battery_fault = false;
                self.lose_turns();
            }
            _ if matches!(OBJECTS[at].index, 0x1400..=0x1A03) => self.process_data.compile(&self.dictionary),
            _ => {}
        }
    }
}
