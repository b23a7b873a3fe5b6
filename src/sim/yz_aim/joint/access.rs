//! Access of the master to the object dictionary by SDO and RPDO.

use takt_rt::{Nanoseconds, controlword};

use super::YzAimJoint;
use crate::sim::sdo_reply::AbortCode;
use crate::sim::yz_aim::dictionary::decode;
use crate::sim::yz_aim::objects::{OBJECTS, YzAimObject, at, find};
use crate::sim::yz_aim::process_data::{PDO4, RPDO_MAPPING, YzAimProcessData};
use crate::sim::yz_aim::sdo::{Addressed, YzAimRequest};

/// Whether an entry accepts a value.
fn is_in_range(at: usize, value: i64) -> bool {
    let object = OBJECTS[at];
    (object.lowest..=object.highest).contains(&value)
        && match at {
            at::OPERATION_MODE => matches!(value, 1 | 3 | 6 | 7),
            at::MODBUS_ENABLE => matches!(value, 0 | 1 | 506),
            _ => true,
        }
}

impl YzAimJoint {
    /// Processes an SDO request. It is lost while another one is being processed.
    pub(super) fn take_request(&mut self, now_ns: Nanoseconds, payload: &[u8]) {
        if self.sdo.is_busy() {
            return;
        }
        let Some(addressed) = Addressed::decode(payload) else { return };
        let answer = match (addressed.request, find(addressed.index, addressed.subindex)) {
            (YzAimRequest::Abort, _) => return,
            (YzAimRequest::Other, _) => Some(addressed.refused(AbortCode::Command)),
            (_, None) => {
                let is_silent = self.parameters.quirks.is_silent_on_unknown_objects;
                (!is_silent).then(|| addressed.refused(AbortCode::NoObject))
            }
            (YzAimRequest::Read, Some(at)) => {
                self.measure();
                let (value, size) = self.dictionary.encode(at);
                Some(addressed.value(value, size))
            }
            (YzAimRequest::Write { data, size }, Some(at)) => {
                let written = self.write(now_ns, at, data, size);
                Some(written.map_or_else(|code| addressed.refused(code), |()| addressed.written()))
            }
        };
        self.sdo.put(now_ns, answer);
    }

    fn write(
        &mut self,
        now_ns: Nanoseconds,
        at: usize,
        data: [u8; 4],
        size: Option<usize>,
    ) -> Result<(), AbortCode> {
        let object = OBJECTS[at];
        if !self.is_writable(object) {
            return Err(AbortCode::ReadOnly);
        }
        if size.is_some_and(|size| size != object.bytes()) {
            return Err(AbortCode::Length);
        }
        let value = decode(at, data);
        if !is_in_range(at, value) {
            return Err(AbortCode::Value);
        }
        let before = self.dictionary.get(at);
        self.dictionary.set(at, value);
        self.written(at, before, now_ns);
        Ok(())
    }

    fn is_writable(&self, object: YzAimObject) -> bool {
        let is_pdo_parameter = matches!(object.index, 0x1400..=0x1403 | 0x1800..=0x1803);
        object.is_writable && (!is_pdo_parameter || self.parameters.quirks.has_settable_pdos)
    }

    /// Applies the data of an RPDO. The controlword takes effect last, except for a target that it activates at once.
    pub(super) fn apply(&mut self, now_ns: Nanoseconds, number: usize, data: [u8; 8]) {
        let mode = self.mode();
        let mut rest = &data[..];
        for at in RPDO_MAPPING[number] {
            let (field, after) = rest.split_at(OBJECTS[*at].bytes());
            rest = after;
            let mut bytes = [0; 4];
            bytes[..field.len()].copy_from_slice(field);
            let value = decode(*at, bytes);
            if is_in_range(*at, value) {
                self.dictionary.set(*at, value);
            }
        }
        let carries = |at| RPDO_MAPPING[number].contains(&at);
        if carries(at::OPERATION_MODE) {
            self.change_mode(mode);
        }
        let word = self.dictionary.get(at::CONTROLWORD) as u16;
        if carries(at::CONTROLWORD) {
            self.take_controlword(now_ns);
        }
        let has_started = carries(at::CONTROLWORD) && word & controlword::BIT_4 != 0;
        if number == PDO4 && YzAimProcessData::waits_for_sync(number, &self.dictionary) {
            self.interpolate();
        } else if carries(at::TARGET_POSITION) && !has_started {
            self.take_target();
        }
    }
}
