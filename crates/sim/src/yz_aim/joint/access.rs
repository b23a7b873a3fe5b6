//! Access of the master to the object dictionary by SDO and RPDO.

use takt_rt::{Nanoseconds, controlword};
use takt_wire::canopen::object::ObjectAddress;

use super::{YzAimJoint, mode};
use crate::object_dictionary::SimulatedDictionary;
use crate::pdo_engine::is_parameter;
use crate::sdo_reply::AbortCode;
use crate::sdo_server::ObjectAccess;
use crate::yz_aim::objects::at;
use crate::yz_aim::process_data::PDO4;

/// Writes an entry from an RPDO; a value out of range is ignored.
pub(super) fn write_field(dictionary: &mut SimulatedDictionary, place: usize, bits: u64) {
    if let Some(number) = dictionary.accepted(place, bits)
        && check_meaning(place, number).is_ok()
    {
        dictionary.set(place, number);
    }
}

/// Checks what the range of an entry cannot say.
fn check_meaning(place: usize, number: i64) -> Result<(), AbortCode> {
    let is_right = match place {
        at::OPERATION_MODE => mode::ALL.contains(&number),
        at::MODBUS_ENABLE => matches!(number, 0 | 1 | 506),
        _ => true,
    };
    if is_right { Ok(()) } else { Err(AbortCode::Value) }
}

/// The object dictionary as the SDO server accesses it. The manual names no abort codes.
pub(super) struct Objects<'a> {
    pub(super) unit: &'a mut YzAimJoint,
    pub(super) now_ns: Nanoseconds,
}

impl ObjectAccess for Objects<'_> {
    fn read(&mut self, address: ObjectAddress, value: &mut Vec<u8>) -> Result<(), AbortCode> {
        let place = self.unit.dictionary.find(address)?;
        self.unit.measure();
        self.unit.dictionary.append(place, value);
        Ok(())
    }

    fn check_write(&mut self, address: ObjectAddress) -> Result<Option<usize>, AbortCode> {
        let entry = self.unit.dictionary.entry(self.unit.dictionary.find(address)?);
        let is_fixed = is_parameter(address.index) && !self.unit.parameters.quirks.has_settable_pdos;
        if entry.is_writable && !is_fixed { Ok(Some(entry.length)) } else { Err(AbortCode::ReadOnly) }
    }

    fn write(&mut self, address: ObjectAddress, value: &[u8]) -> Result<(), AbortCode> {
        let dictionary = &mut self.unit.dictionary;
        let place = dictionary.find(address)?;
        let number = dictionary.decode(place, value)?;
        check_meaning(place, number)?;
        let before = dictionary.number(place);
        dictionary.set(place, number);
        self.unit.written(address, place, before, self.now_ns);
        Ok(())
    }

    fn refusal(&self, code: AbortCode) -> Option<AbortCode> {
        match code {
            AbortCode::NoObject | AbortCode::NoSubindex => {
                let is_silent = self.unit.parameters.quirks.is_silent_on_unknown_objects;
                (!is_silent).then_some(AbortCode::NoObject)
            }
            AbortCode::LengthTooHigh | AbortCode::LengthTooLow => Some(AbortCode::Length),
            AbortCode::ValueTooHigh | AbortCode::ValueTooLow => Some(AbortCode::Value),
            _ => Some(code),
        }
    }
}

impl YzAimJoint {
    /// Applies the effects of an RPDO, whose data stands in the dictionary; `mode` is the one before. The controlword takes
    /// effect last, except for a target that it activates at once.
    pub(super) fn apply(&mut self, now_ns: Nanoseconds, number: usize, mode: i64, is_by_sync: bool) {
        let word = self.dictionary.number(at::CONTROLWORD) as u16;
        if self.pdos.carries(number, at::OPERATION_MODE) {
            self.change_mode(mode);
        }
        let has_controlword = self.pdos.carries(number, at::CONTROLWORD);
        if has_controlword {
            self.take_controlword(now_ns);
        }
        let has_started = has_controlword && word & controlword::BIT_4 != 0;
        if number == PDO4 && is_by_sync {
            self.interpolate();
        } else if self.pdos.carries(number, at::TARGET_POSITION) && !has_started {
            self.take_target();
        }
    }
}
