//! The configuration of a PDO, from a device by SDO or from a file.

use takt_rt::{Frame, Id, MappedObject};

use super::object::ObjectAddress;
use super::objects::{PDO_INVALID, PdoDirection, PdoParameters};

/// Bit of a COB-ID for a 29-bit identifier.
const EXTENDED: u32 = 1 << 29;
/// Numbers of mapped objects from this one on mean multiplexed PDOs, which have no mapping of their own (CiA 301,
/// 7.5.2.36).
const MULTIPLEXED: u32 = 0xFE;

/// The configuration of one PDO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoConfiguration {
    /// The direction, seen from the device.
    pub direction: PdoDirection,
    /// Its number, counted from 1.
    pub number: u16,
    /// Its identifier; `None` if it is not known.
    pub id: Option<Id>,
    /// True if the PDO is valid.
    pub is_valid: bool,
    /// Its transmission type (CiA 301, 7.5.2.36); `None` if it is not known.
    pub transmission_type: Option<u8>,
    /// The inhibit time in 100 µs, if it has one.
    pub inhibit_time_100us: Option<u16>,
    /// The event timer in ms, if it has one; for an RPDO the reception timeout.
    pub event_timer_ms: Option<u16>,
    /// The mapped objects, in order.
    pub objects: Vec<MappedObject>,
}

impl PdoConfiguration {
    /// Reads a configuration from any source of object values; `None` when neither COB-ID nor mapping is known.
    pub fn read(
        direction: PdoDirection,
        number: u16,
        parameters: PdoParameters,
        read: impl Fn(ObjectAddress) -> Option<u32>,
    ) -> Option<Self> {
        let cob_id = read(parameters.cob_id().address);
        let count = read(parameters.mapped_count().address);
        if cob_id.is_none() && count.is_none() {
            return None;
        }
        let count = count.filter(|count| *count < MULTIPLEXED).unwrap_or(0);
        let mapped = (1..=count as u8).map_while(|place| read(parameters.mapped_object(place).address));
        let short = |address| read(address).and_then(|value| u16::try_from(value).ok());
        Some(Self {
            direction,
            number,
            id: cob_id.and_then(identifier),
            is_valid: cob_id.is_some_and(|cob_id| cob_id & PDO_INVALID == 0),
            transmission_type: read(parameters.transmission_type().address)
                .and_then(|value| u8::try_from(value).ok()),
            inhibit_time_100us: short(parameters.inhibit_time().address),
            event_timer_ms: short(parameters.event_timer().address),
            objects: mapped.map(MappedObject::from_parameter).collect(),
        })
    }

    /// The length of its payload in bits.
    pub fn bits(&self) -> usize {
        self.objects.iter().map(|object| usize::from(object.bits)).sum()
    }

    /// The length of its payload in bytes.
    pub fn length(&self) -> usize {
        self.bits().div_ceil(8)
    }

    /// The values of the mapped objects in a frame of this PDO, as unsigned bits; the lowest 64 bits of longer objects.
    /// `None` for other frames and for frames shorter than the mapping.
    pub fn values(&self, frame: &Frame) -> Option<Vec<(MappedObject, u64)>> {
        let payload = frame.payload();
        if !self.is_valid || Some(frame.id()) != self.id || payload.len() < self.length() {
            return None;
        }
        let bit = |at: usize| payload.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 != 0);
        let mut at = 0;
        let values = self.objects.iter().map(|object| {
            let length = usize::from(object.bits);
            let value =
                (0..length.min(64)).fold(0, |value, place| value | u64::from(bit(at + place)) << place);
            at += length;
            (*object, value)
        });
        Some(values.collect())
    }
}

fn identifier(cob_id: u32) -> Option<Id> {
    if cob_id & EXTENDED != 0 {
        Id::extended(cob_id & 0x1FFF_FFFF).ok()
    } else {
        Id::base(cob_id & 0x7FF).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// TPDO 1: position, statusword, four bits of another object, and a gap of four bits.
    fn configuration(cob_id: u32) -> PdoConfiguration {
        let parameters = PdoParameters::at(PdoDirection::Transmit, 1);
        let read = |ObjectAddress { index, subindex }| {
            Some(match (index, subindex) {
                (0x1800, 1) => cob_id,
                (0x1800, 2) => 255,
                (0x1800, 5) => 100,
                (0x1A00, 0) => 4,
                (0x1A00, 1) => 0x6064_0020,
                (0x1A00, 2) => 0x6041_0010,
                (0x1A00, 3) => 0x2000_0104,
                (0x1A00, 4) => 0x0005_0004,
                _ => return None,
            })
        };
        PdoConfiguration::read(PdoDirection::Transmit, 1, parameters, read).unwrap()
    }

    #[test]
    fn a_frame_is_decoded_by_the_mapping() {
        let pdo = configuration(0x4000_0182);
        assert_eq!((pdo.length(), pdo.transmission_type, pdo.event_timer_ms), (7, Some(255), Some(100)));
        assert_eq!(pdo.inhibit_time_100us, None);
        let frame = Frame::of(Id::canopen(0x180, 2), [1, 2, 3, 4, 0x37, 0x12, 0xFA]);
        let values: Vec<u64> = pdo.values(&frame).unwrap().into_iter().map(|(_, value)| value).collect();
        assert_eq!(values, [0x0403_0201, 0x1237, 0xA, 0xF]);
    }

    #[test]
    fn other_frames_and_short_frames_are_not_decoded() {
        let pdo = configuration(0x182);
        assert_eq!(pdo.values(&Frame::of(Id::canopen(0x180, 3), [0; 7])), None);
        assert_eq!(pdo.values(&Frame::of(Id::canopen(0x180, 2), [0; 6])), None);
        assert_eq!(configuration(0x8000_0182).values(&Frame::of(Id::canopen(0x180, 2), [0; 7])), None);
    }
}
