//! Process data by the mapping that the drive reports: which of its PDOs carry the objects that the axis needs, or why
//! they do not.

use takt_rt::{CommandSlot, Id, MappedObject, TransmissionType};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;

use super::process_data::{PdoPlan, ProcessData, Reply, pdo_id};
use crate::config::{Axis, Config};
use crate::family::{self, MappingMatch};

/// Why the PDOs that the drive reports do not suit the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MappingProblem {
    /// No valid PDO carries the object.
    #[error("no valid {} carries {}, which the axis needs", direction.word(), named(*object))]
    NotMapped {
        /// The direction.
        direction: PdoDirection,
        /// The object.
        object: MappedObject,
    },
    /// An object is mapped with another length than required.
    #[error("{} {number} carries {} with {} bits, expected {expected_bits}", direction.word(), named(*object), object.bits)]
    Length {
        /// The direction.
        direction: PdoDirection,
        /// The PDO, counted from 1.
        number: u16,
        /// The object as it is mapped.
        object: MappedObject,
        /// The required length in bits.
        expected_bits: u8,
    },
    /// An object is mapped with a length other than one, two or four bytes.
    #[error("{} {number} carries {} with {} bits: only 8, 16 and 32 bits are supported", direction.word(), named(*object), object.bits)]
    Width {
        /// The direction.
        direction: PdoDirection,
        /// The PDO, counted from 1.
        number: u16,
        /// The object as it is mapped.
        object: MappedObject,
    },
    /// An RPDO that must be sent carries an object for which there is no value.
    #[error("RPDO {number} also carries {}, for which there is no value to send", named(*object))]
    NothingToSend {
        /// The PDO, counted from 1.
        number: u16,
        /// The object.
        object: MappedObject,
    },
    /// A PDO has another identifier than in the pre-defined connection set.
    #[error("{} {number} has the identifier {}, expected 0x{:03X}", direction.word(), shown(*reported), expected.value())]
    Identifier {
        /// The direction.
        direction: PdoDirection,
        /// The PDO, counted from 1.
        number: u16,
        /// The identifier that the drive reports.
        reported: Option<Id>,
        /// The identifier in the pre-defined connection set.
        expected: Id,
    },
    /// A PDO has another transmission type than configured.
    #[error("{} {number} has the transmission type {}, expected {expected}", direction.word(), type_shown(*reported))]
    TransmissionType {
        /// The direction.
        direction: PdoDirection,
        /// The PDO, counted from 1.
        number: u16,
        /// The transmission type that the drive reports.
        reported: Option<u8>,
        /// The configured transmission type.
        expected: u8,
    },
    /// There are more PDOs than the check of the bus load has counted.
    #[error("the drive exchanges {found} {}s, but the bus load was checked with {counted}", direction.word())]
    TooMany {
        /// The direction.
        direction: PdoDirection,
        /// Number of PDOs.
        found: usize,
        /// Number of counted PDOs.
        counted: usize,
    },
    /// A PDO is longer than the check of the bus load has counted.
    #[error("{} {number} has {bits} bits, but the bus load was checked with {counted_bits}", direction.word())]
    TooLong {
        /// The direction.
        direction: PdoDirection,
        /// The PDO, counted from 1.
        number: u16,
        /// Its length in bits.
        bits: usize,
        /// The counted length in bits.
        counted_bits: usize,
    },
}

impl MappingProblem {
    /// The remedy.
    pub const fn advice(self) -> &'static str {
        match self {
            Self::NotMapped { .. }
            | Self::Length { .. }
            | Self::Width { .. }
            | Self::NothingToSend { .. } => {
                "change the mapping that is stored in the drive (with the vendor's tool or by `dcf`), or let the \
                 controller write it where the drive allows that: mapping = \"written\""
            }
            Self::Identifier { .. } => {
                "give the PDO the identifier of the pre-defined connection set, or make it invalid (bit 31 of its COB-ID)"
            }
            Self::TransmissionType { .. } => {
                "set `transmission_type` of the axis to that of the drive, or that of the drive to the axis'"
            }
            Self::TooMany { .. } | Self::TooLong { .. } => {
                "make the PDOs that are not needed invalid (bit 31 of their COB-ID), or name the objects that they carry \
                 in `feedback`, so that they are counted"
            }
        }
    }
}

fn shown(id: Option<Id>) -> String {
    id.map_or("none".to_owned(), |id| format!("0x{:03X}", id.value()))
}

fn type_shown(transmission_type: Option<u8>) -> String {
    transmission_type.map_or("unknown".to_owned(), |value| value.to_string())
}

fn named(object: MappedObject) -> String {
    let address = ObjectAddress::new(object.index, object.subindex);
    let name = match (object.index, object.subindex) {
        (0x6040, 0) => "controlword",
        (0x6041, 0) => "statusword",
        (0x603F, 0) => "error code",
        (0x6060, 0) => "mode of operation",
        (0x6061, 0) => "mode of operation display",
        (0x6064, 0) => "position",
        (0x606C, 0) => "velocity",
        (0x6071, 0) => "target torque",
        (0x6077, 0) => "torque",
        (0x6078, 0) => "current",
        (0x607A, 0) => "target position",
        (0x6081, 0) => "profile velocity",
        (0x60FF, 0) => "target velocity",
        _ => return address.to_string(),
    };
    format!("{address} ({name})")
}

impl ProcessData {
    /// The process data of an axis by the drive's report. With free mapping, any PDOs with the needed objects will do.
    /// Where each PDO has its purpose by its number, one that the drive does not report is as in the manual.
    ///
    /// # Errors
    /// The first reason for which the axis cannot work with it, or the bus load is not covered by the check.
    pub fn as_reported(
        axis: &Axis,
        config: &Config,
        reported: &[PdoConfiguration],
    ) -> Result<Self, MappingProblem> {
        let counted = Self::of(axis, config);
        match family::of(&axis.drive).mapping_match() {
            MappingMatch::ByContent => by_content(axis, &counted, reported),
            MappingMatch::ByNumber => by_number(axis, counted, reported),
        }
    }
}

impl ProcessData {
    /// Returns `true` if a PDO that a drive reports carries an object that its axis needs.
    pub(super) fn is_needed(axis: &Axis, pdo: &PdoConfiguration) -> bool {
        let needed = match pdo.direction {
            PdoDirection::Receive => Self::needed_commands(axis),
            PdoDirection::Transmit => Self::needed_feedback(axis),
        };
        needed.into_iter().any(|object| carried(pdo, object).is_some())
    }
}

fn by_content(
    axis: &Axis,
    counted: &ProcessData,
    reported: &[PdoConfiguration],
) -> Result<ProcessData, MappingProblem> {
    let switched_on = |direction| {
        let of_direction = reported.iter().filter(move |pdo| pdo.direction == direction && pdo.is_valid);
        of_direction.collect::<Vec<_>>()
    };
    let receive = switched_on(PdoDirection::Receive);
    let transmit = switched_on(PdoDirection::Transmit);
    let commands = carriers(&receive, PdoDirection::Receive, &ProcessData::needed_commands(axis))?;
    let feedback = carriers(&transmit, PdoDirection::Transmit, &ProcessData::needed_feedback(axis))?;
    let unused: Vec<_> = transmit.iter().copied().filter(|pdo| !feedback.contains(pdo)).collect();
    for (direction, found, counted) in [
        (PdoDirection::Receive, commands.len(), counted.commands.len()),
        (PdoDirection::Transmit, transmit.len(), counted.feedback.len()),
    ] {
        if found > counted {
            return Err(MappingProblem::TooMany { direction, found, counted });
        }
    }
    let plan = |pdo: &&PdoConfiguration| -> Result<PdoPlan, MappingProblem> {
        let PdoConfiguration { direction, number, transmission_type: reported, .. } = **pdo;
        let expected = axis.transmission_type;
        if reported != Some(expected) {
            return Err(MappingProblem::TransmissionType { direction, number, reported, expected });
        }
        plan_of(pdo, axis, counted, TransmissionType::EveryCycle)
    };
    for pdo in &commands {
        check_values(pdo, axis.drive.node_axis, &ProcessData::needed_commands(axis))?;
    }
    Ok(ProcessData {
        commands: commands.iter().map(plan).collect::<Result<_, _>>()?,
        feedback: feedback.iter().map(plan).collect::<Result<_, _>>()?,
        unused: unused.iter().map(plan).collect::<Result<_, _>>()?,
    })
}

/// The PDOs that carry the needed objects, in order, each once.
fn carriers<'a>(
    pdos: &[&'a PdoConfiguration],
    direction: PdoDirection,
    needed: &[MappedObject],
) -> Result<Vec<&'a PdoConfiguration>, MappingProblem> {
    let mut chosen = vec![];
    for object in needed {
        let carrier = pdos.iter().find_map(|pdo| Some((*pdo, carried(pdo, *object)?)));
        let (pdo, mapped) = carrier.ok_or(MappingProblem::NotMapped { direction, object: *object })?;
        check_length(pdo, mapped, *object)?;
        if !chosen.contains(&pdo) {
            chosen.push(pdo);
        }
    }
    chosen.sort_by_key(|pdo| pdo.number);
    Ok(chosen)
}

/// The object as this PDO maps it.
fn carried(pdo: &PdoConfiguration, object: MappedObject) -> Option<MappedObject> {
    let is_it = |mapped: &&MappedObject| (mapped.index, mapped.subindex) == (object.index, object.subindex);
    pdo.objects.iter().find(is_it).copied()
}

fn check_length(
    pdo: &PdoConfiguration,
    mapped: MappedObject,
    needed: MappedObject,
) -> Result<(), MappingProblem> {
    let PdoConfiguration { direction, number, .. } = *pdo;
    if mapped.bits == needed.bits {
        return Ok(());
    }
    Err(MappingProblem::Length { direction, number, object: mapped, expected_bits: needed.bits })
}

/// Checks that every object of an RPDO has a value: dummy entries, needed objects, and targets or offsets of other
/// modes, which are sent as zero.
fn check_values(
    pdo: &PdoConfiguration,
    node_axis: u8,
    needed: &[MappedObject],
) -> Result<(), MappingProblem> {
    let has_value = |object: &MappedObject| {
        object.is_dummy()
            || needed.contains(object)
            || matches!(
                CommandSlot::of(object.as_of_first_axis(node_axis)),
                CommandSlot::OperationMode
                    | CommandSlot::TargetVelocity
                    | CommandSlot::TargetTorque
                    | CommandSlot::VelocityOffset
                    | CommandSlot::TorqueOffset
            )
    };
    match pdo.objects.iter().find(|object| !has_value(object)) {
        Some(object) => Err(MappingProblem::NothingToSend { number: pdo.number, object: *object }),
        None => Ok(()),
    }
}

fn plan_of(
    pdo: &PdoConfiguration,
    axis: &Axis,
    counted: &ProcessData,
    transmission: TransmissionType,
) -> Result<PdoPlan, MappingProblem> {
    let PdoConfiguration { direction, number, id: reported, transmission_type, .. } = *pdo;
    let planned = match direction {
        PdoDirection::Receive => counted.commands.iter().find(|plan| plan.number == number),
        PdoDirection::Transmit => counted.feedback.iter().find(|plan| plan.number == number),
    };
    // The PDOs of further axes of a node have none in the pre-defined connection set.
    let planned = planned.filter(|_| axis.drive.node_axis > 1);
    let expected = planned.map_or_else(|| pdo_id(direction, number as u8, axis.node), |plan| plan.id);
    if reported != Some(expected) {
        return Err(MappingProblem::Identifier { direction, number, reported, expected });
    }
    if let Some(object) = pdo.objects.iter().find(|object| !matches!(object.bits, 8 | 16 | 32)) {
        return Err(MappingProblem::Width { direction, number, object: *object });
    }
    Ok(PdoPlan {
        number,
        id: expected,
        transmission_type: transmission_type.unwrap_or(axis.transmission_type),
        objects: pdo.objects.clone(),
        axes: 1,
        transmission,
        reply: Reply::No,
    })
}

fn by_number(
    axis: &Axis,
    counted: ProcessData,
    reported: &[PdoConfiguration],
) -> Result<ProcessData, MappingProblem> {
    let numbered = counted.clone();
    let resolve = |direction, plan: PdoPlan| -> Result<PdoPlan, MappingProblem> {
        let is_it = |pdo: &&PdoConfiguration| (pdo.direction, pdo.number) == (direction, plan.number);
        let Some(pdo) = reported.iter().find(is_it) else { return Ok(plan) };
        for object in &plan.objects {
            let mapped = carried(pdo, *object).filter(|_| pdo.is_valid);
            check_length(
                pdo,
                mapped.ok_or(MappingProblem::NotMapped { direction, object: *object })?,
                *object,
            )?;
        }
        if direction == PdoDirection::Receive {
            check_values(pdo, axis.drive.node_axis, &plan.objects)?;
        }
        let (bits, counted_bits) = (pdo.bits(), 8 * plan.length());
        if bits > counted_bits {
            return Err(MappingProblem::TooLong { direction, number: pdo.number, bits, counted_bits });
        }
        let PdoPlan { transmission_type, reply, .. } = plan;
        Ok(PdoPlan { transmission_type, reply, ..plan_of(pdo, axis, &numbered, plan.transmission)? })
    };
    let all = |direction, plans: Vec<PdoPlan>| -> Result<Vec<PdoPlan>, MappingProblem> {
        plans.into_iter().map(|plan| resolve(direction, plan)).collect()
    };
    Ok(ProcessData {
        commands: all(PdoDirection::Receive, counted.commands)?,
        feedback: all(PdoDirection::Transmit, counted.feedback)?,
        unused: counted.unused,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A configuration with a YZ-AIM.
    fn yz_aim() -> Config {
        let text = "name = \"n\"\n[[bus]]\nname = \"b\"\nperiod = \"2 ms\"\n[[axis]]\nname = \"x\"\nbus = \"b\"\nnode = 5\n\
                    drive = \"yz-aim\"\nmode = \"ip\"\n[axis.limits]\nposition = [-1, 1]\nvelocity = 1\nacceleration = 1\n\
                    torque = 1\n";
        Config::parse("n.toml", text).unwrap()
    }

    fn reported(direction: PdoDirection, number: u8, objects: &[u32]) -> PdoConfiguration {
        PdoConfiguration {
            direction,
            number: number.into(),
            id: Some(pdo_id(direction, number, 5)),
            is_valid: true,
            transmission_type: Some(1),
            inhibit_time_100us: None,
            event_timer_ms: None,
            objects: objects.iter().copied().map(MappedObject::from_parameter).collect(),
        }
    }

    fn as_reported(pdo: PdoConfiguration) -> Result<ProcessData, MappingProblem> {
        let config = yz_aim();
        ProcessData::as_reported(&config.axes[0], &config, &[pdo])
    }

    #[test]
    fn a_pdo_that_a_yz_aim_does_not_report_is_as_in_the_manual() {
        let config = yz_aim();
        let axis = &config.axes[0];
        assert_eq!(ProcessData::as_reported(axis, &config, &[]), Ok(ProcessData::of(axis, &config)));
    }

    #[test]
    fn a_yz_aim_may_map_its_objects_in_any_order() {
        let data = as_reported(reported(PdoDirection::Transmit, 2, &[0x6041_0010, 0x6064_0020])).unwrap();
        let objects: Vec<u16> = data.feedback[0].objects.iter().map(|object| object.index).collect();
        assert_eq!(objects, [0x6041, 0x6064]);
        let config = yz_aim();
        assert_eq!(data.commands, ProcessData::of(&config.axes[0], &config).commands);
    }

    #[test]
    fn a_yz_aim_with_another_mapping_is_refused_with_pdo_and_object() {
        let (receive, transmit) = (PdoDirection::Receive, PdoDirection::Transmit);
        let off = PdoConfiguration { is_valid: false, ..reported(receive, 4, &[0x607A_0020]) };
        let elsewhere = PdoConfiguration { id: None, ..reported(receive, 4, &[0x607A_0020]) };
        for (pdo, text) in [
            (
                reported(transmit, 2, &[0x6064_0020, 0x606C_0020]),
                "no valid TPDO carries 6041:00 (statusword), which the axis needs",
            ),
            (
                reported(transmit, 2, &[0x6064_0010, 0x6041_0010]),
                "TPDO 2 carries 6064:00 (position) with 16 bits, expected 32",
            ),
            (
                reported(transmit, 2, &[0x6064_0020, 0x6041_0010, 0x260E_0010]),
                "TPDO 2 has 64 bits, but the bus load was checked with 48",
            ),
            (
                reported(receive, 4, &[0x607A_0020, 0x6081_0020]),
                "RPDO 4 also carries 6081:00 (profile velocity), for which there is no value to send",
            ),
            (off, "no valid RPDO carries 607A:00 (target position), which the axis needs"),
            (elsewhere, "RPDO 4 has the identifier none, expected 0x505"),
        ] {
            assert_eq!(as_reported(pdo).unwrap_err().to_string(), text);
        }
    }
}
