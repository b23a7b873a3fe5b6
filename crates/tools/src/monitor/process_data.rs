//! PDOs in words, by the mapping that is in force.

use takt_rt::{DriveState, Frame, MappedObject};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;

use super::decoded::DecodedValue;
use takt::family::bring_up::{PdoPlan, ProcessData};
use takt::family::commission::{TargetDrive, meaning};

const STATUSWORD: u16 = 0x6041;

/// The PDOs of an axis by its configuration.
pub fn configured(data: &ProcessData) -> Vec<PdoConfiguration> {
    let each = |direction, plans: &[PdoPlan]| -> Vec<PdoConfiguration> {
        let plans = plans.iter().map(|plan| PdoConfiguration {
            direction,
            number: plan.number,
            id: Some(plan.id),
            is_valid: true,
            transmission_type: Some(plan.transmission_type),
            inhibit_time_100us: None,
            event_timer_ms: None,
            objects: plan.objects.clone(),
        });
        plans.collect()
    };
    let mut all = each(PdoDirection::Receive, &data.commands);
    all.extend(each(PdoDirection::Transmit, &data.feedback));
    all.extend(each(PdoDirection::Transmit, &data.unused));
    all
}

/// The values of a PDO of a drive; `None` where the frame is shorter than the mapping, or nothing is mapped.
pub fn values(target: &TargetDrive, pdo: &PdoConfiguration, frame: &Frame) -> Option<Vec<DecodedValue>> {
    let mapped = pdo.values(frame)?.into_iter().filter(|(object, _)| !object.is_dummy() && object.index != 0);
    let values: Vec<DecodedValue> = mapped.map(|(object, bits)| value(target, object, bits)).collect();
    (!values.is_empty()).then_some(values)
}

fn value(target: &TargetDrive, object: MappedObject, bits: u64) -> DecodedValue {
    let address = ObjectAddress::new(object.index, object.subindex);
    let bytes = bits.to_le_bytes();
    let bytes = bytes.get(..usize::from(object.bits).div_ceil(8).min(8)).unwrap_or(&bytes);
    let numbers = meaning::numbers(target, address, bytes);
    DecodedValue {
        name: meaning::name(target, address).unwrap_or_else(|| address.to_string()),
        object: Some(address),
        raw: numbers.map(|(raw, _)| raw),
        value: numbers.and_then(|(_, value)| value),
        text: meaning::value(target, address, bytes),
    }
}

/// Returns `true` if the values of a TPDO show a drive with torque.
pub fn shows_torque(target: &TargetDrive, values: &[DecodedValue]) -> Option<bool> {
    let statusword = values.iter().find(|value| {
        value.object.is_some_and(|object| {
            let own = MappedObject::new(object.index, object.subindex, 0);
            own.as_of_first_axis(target.drive.node_axis).index == STATUSWORD
        })
    });
    let word = u16::try_from(statusword?.raw?).ok()?;
    Some(DriveState::decode(word).has_torque())
}

/// Values in one line.
pub fn words(values: &[DecodedValue]) -> String {
    let each = values.iter().map(|value| format!("{} {}", value.name, value.text));
    each.collect::<Vec<_>>().join("; ")
}
