//! Access of the master to the objects by SDO, with the effects of each write on the communication.

use takt_rt::Nanoseconds;
use takt_wire::canopen::object::ObjectAddress;

use super::node::{CanopenDevice, CanopenNode};
use crate::drive::NodeState;
use crate::object_dictionary::ObjectKind;
use crate::pdo_engine::{check_parameter, is_parameter};
use crate::sdo_reply::AbortCode;
use crate::sdo_server::ObjectAccess;

/// The signatures for objects 1010 and 1011.
const SAVE_SIGNATURE: u32 = u32::from_le_bytes(*b"save");
const LOAD_SIGNATURE: u32 = u32::from_le_bytes(*b"load");

/// The objects as the SDO server accesses them.
pub(super) struct Objects<'a, D> {
    pub(super) device: &'a mut D,
    pub(super) now_ns: Nanoseconds,
    pub(super) is_silent_if_absent: bool,
}

impl<D: CanopenDevice> ObjectAccess for Objects<'_, D> {
    fn read(&mut self, address: ObjectAddress, value: &mut Vec<u8>) -> Result<(), AbortCode> {
        let dictionary = &self.device.canopen().dictionary;
        let place = dictionary.find(address)?;
        if !dictionary.entry(place).is_readable {
            return Err(AbortCode::WriteOnly);
        }
        let history = || dictionary.number_at(dictionary.place(0x1003, 0)).unwrap_or(0);
        if address.index == 0x1003 && i64::from(address.subindex) > history() {
            return Err(AbortCode::NoData);
        }
        self.device.measure();
        self.device.canopen().dictionary.append(place, value);
        Ok(())
    }

    fn check_write(&mut self, address: ObjectAddress) -> Result<Option<usize>, AbortCode> {
        let dictionary = &self.device.canopen().dictionary;
        let place = dictionary.find(address)?;
        let entry = dictionary.entry(place);
        if !entry.is_writable {
            return Err(AbortCode::ReadOnly);
        }
        let length = (entry.kind != ObjectKind::Bytes).then_some(entry.length);
        self.device.check_write(place)?;
        Ok(length)
    }

    fn write(&mut self, address: ObjectAddress, value: &[u8]) -> Result<(), AbortCode> {
        let Self { device, now_ns, .. } = self;
        let has_one_code = device.canopen().quirks.simulated.has_one_abort_code;
        let node = device.canopen();
        let place = node.dictionary.find(address)?;
        let number = match (address.index, address.subindex) {
            // The objects show what they can do, and take a signature, whatever their range is.
            (0x1010 | 0x1011, 1..) => return node.take_signature(address.index, value, *now_ns),
            _ => node.dictionary.decode(place, value).map_err(|code| match code {
                AbortCode::ValueTooHigh | AbortCode::ValueTooLow if has_one_code => AbortCode::Value,
                code => code,
            })?,
        };
        check_communication(address, number)?;
        device.check_value(address, number)?;
        let node = device.canopen();
        check_parameter(&node.dictionary, address, number)?;
        node.dictionary.store(place, value)?;
        node.written(address.index, *now_ns);
        device.written(address, *now_ns);
        Ok(())
    }

    fn refusal(&self, code: AbortCode) -> Option<AbortCode> {
        let is_absent = matches!(code, AbortCode::NoObject | AbortCode::NoSubindex);
        (!is_absent || !self.is_silent_if_absent).then_some(code)
    }
}

impl CanopenNode {
    fn take_signature(&mut self, index: u16, value: &[u8], now_ns: Nanoseconds) -> Result<(), AbortCode> {
        match (index, <[u8; 4]>::try_from(value).map(u32::from_le_bytes)) {
            (0x1010, Ok(SAVE_SIGNATURE)) => {
                self.begin_save(now_ns);
                Ok(())
            }
            (0x1011, Ok(LOAD_SIGNATURE)) => {
                self.dictionary.forget();
                Ok(())
            }
            _ => Err(AbortCode::CannotStore),
        }
    }

    /// Applies the effects of a new value of a communication object.
    fn written(&mut self, index: u16, now_ns: Nanoseconds) {
        match index {
            0x1005 | 0x1006 => self.network.schedule_sync(now_ns, &self.dictionary),
            0x100C | 0x100D => self.network.stop_life_guarding(),
            0x1016 => self.network.stop_master_monitor(),
            0x1017 => self.network.schedule_heartbeat(now_ns, &self.dictionary),
            _ if is_parameter(index) => {
                self.pdos.compile(&self.dictionary);
                if self.network.state() == NodeState::Operational {
                    self.pdos.start(now_ns);
                }
            }
            _ => {}
        }
    }
}

/// Checks the values of communication objects that CiA 301 does not allow, whatever a data sheet says.
fn check_communication(address: ObjectAddress, value: i64) -> Result<(), AbortCode> {
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
