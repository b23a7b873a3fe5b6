//! The PDO mapping of a drive: written and read back, or taken as the drive reports it.

use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::{PDO_IDENTITY, PDO_INVALID, PdoDirection, PdoParameters};
use takt_wire::canopen::pdo_configuration::PdoConfiguration;
use takt_wire::canopen::pdo_reader::PdoReader;

use super::axis_session::{AxisSession, StepResult};
use super::check::Check;
use super::failure::FailureCause;
use super::process_data::{PdoPlan, ProcessData, first_pdo, pdo_id};

/// Writes the mapping of the planned PDOs of one direction, and switches the others of the axis off, up to `count` of them.
pub async fn write(c: &AxisSession<'_>, direction: PdoDirection, plans: &[PdoPlan], count: u8) -> StepResult {
    let name = match direction {
        PdoDirection::Receive => "RPDO mapping",
        PdoDirection::Transmit => "TPDO mapping",
    };
    c.step(name, "the drive cannot carry these objects in this PDO: choose other feedback or another mode");
    let node_axis = c.axis.drive.node_axis;
    for place in 1..=count {
        let number = first_pdo(node_axis) + u16::from(place) - 1;
        match plans.iter().find(|plan| plan.number == number) {
            Some(plan) => map(c, direction, plan).await?,
            None if node_axis == 1 => {
                let id = unused_id(direction, place, c.axis.node);
                write_cob_id(c, PdoParameters::of(direction, place), id).await?;
            }
            None => switch_off(c, direction, number).await?,
        }
    }
    Ok(())
}

/// Switches a PDO off that keeps its identifier.
async fn switch_off(c: &AxisSession<'_>, direction: PdoDirection, number: u16) -> StepResult {
    let parameters = PdoParameters::at(direction, number);
    let mut present = 0;
    c.read(parameters.cob_id(), Check::Any, |_, value| present = value as u32).await?;
    if present & PDO_INVALID == 0 {
        write_cob_id(c, parameters, present | PDO_INVALID).await?;
    }
    Ok(())
}

/// Switches the PDOs of one direction off that belong to an axis of the node which nobody commands, up to `count` of them.
pub async fn switch_all_off(
    c: &AxisSession<'_>,
    direction: PdoDirection,
    node_axis: u8,
    count: u8,
) -> StepResult {
    c.step(
        "PDOs of other axes",
        "switch the PDOs of the axes off that are not used (bit 31 of their COB-ID)",
    );
    for place in 0..count {
        switch_off(c, direction, first_pdo(node_axis) + u16::from(place)).await?;
    }
    Ok(())
}

/// Writes a PDO mapping. It may only change while the PDO is invalid and the count is zero (CiA 301, 7.5.2.36).
async fn map(c: &AxisSession<'_>, direction: PdoDirection, plan: &PdoPlan) -> StepResult {
    let parameters = PdoParameters::at(direction, plan.number);
    write_cob_id(c, parameters, plan.id.value() | PDO_INVALID).await?;
    c.write_and_read_back(parameters.transmission_type(), plan.transmission_type.into()).await?;
    if direction == PdoDirection::Transmit {
        c.write_optional(parameters.inhibit_time(), 0).await?;
    }
    c.write_optional(parameters.event_timer(), 0).await?;
    c.write(parameters.mapped_count(), 0).await?;
    for (position, object) in (1..).zip(&plan.objects) {
        c.write_and_read_back(parameters.mapped_object(position), object.parameter().into()).await?;
    }
    c.write_and_read_back(parameters.mapped_count(), plan.objects.len() as i64).await?;
    write_cob_id(c, parameters, plan.id.value()).await
}

async fn write_cob_id(c: &AxisSession<'_>, parameters: PdoParameters, id: u32) -> StepResult {
    let expected = Check::Masked { value: id.into(), mask: PDO_IDENTITY };
    c.write_and_compare(parameters.cob_id(), id.into(), expected).await
}

/// The COB-ID of the pre-defined connection set with bit 31 (invalid) set.
fn unused_id(direction: PdoDirection, number: u8, node: u8) -> u32 {
    PDO_INVALID | pdo_id(direction, number, node).value()
}

/// Reads the drive's PDO configuration, and takes the process data from it.
pub(crate) async fn take_reported(c: &AxisSession<'_>) -> StepResult {
    c.step("PDO mapping", "the drive's own mapping does not suit this axis");
    let taken = if c.is_dry_run() { Ok(()) } else { read_reported(c).await };
    c.settled(taken)
}

/// Gives the PDOs with a fixed mapping that the axis needs the identifiers of the pre-defined connection set and its transmission type, and
/// switches the other TPDOs off, as far as the drive lets these be written.
pub(crate) async fn adapt_communication(
    c: &AxisSession<'_>,
    is_writable: impl Fn(ObjectAddress) -> bool,
) -> StepResult {
    // Further axes of a node have no identifiers in that set.
    if c.is_dry_run() || c.axis.drive.node_axis > 1 {
        return Ok(());
    }
    c.step("PDO communication", "the drive does not let its PDOs be set as this axis needs them");
    let reported = reported(c).await;
    let reported = c.settled(reported)?;
    for pdo in reported.iter().filter(|pdo| pdo.is_valid) {
        let PdoConfiguration { direction, number, id: Some(id), transmission_type, .. } = *pdo else {
            continue;
        };
        let (parameters, place) = (PdoParameters::at(direction, number), number.clamp(1, 4) as u8);
        let is_needed = ProcessData::is_needed(c.axis, pdo);
        let planned = pdo_id(direction, place, c.axis.node);
        let sets_type = transmission_type != Some(c.axis.transmission_type)
            && is_writable(parameters.transmission_type().address);
        if !is_writable(parameters.cob_id().address) {
            continue;
        } else if !is_needed && direction == PdoDirection::Transmit {
            write_cob_id(c, parameters, id.value() | PDO_INVALID).await?;
        } else if is_needed && (id != planned || sets_type) {
            write_cob_id(c, parameters, planned.value() | PDO_INVALID).await?;
            if sets_type {
                c.write_and_read_back(parameters.transmission_type(), c.axis.transmission_type.into())
                    .await?;
            }
            write_cob_id(c, parameters, planned.value()).await?;
        }
    }
    Ok(())
}

async fn read_reported(c: &AxisSession<'_>) -> StepResult {
    let reported = reported(c).await?;
    let data = ProcessData::as_reported(c.axis, c.config, &reported).map_err(FailureCause::Mapping)?;
    c.keep(|facts| facts.process_data = Some(data));
    Ok(())
}

/// Reads the first four PDOs of the axis in each direction.
async fn reported(c: &AxisSession<'_>) -> StepResult<Vec<PdoConfiguration>> {
    let mut reader = PdoReader::of_four(first_pdo(c.axis.drive.node_axis));
    while let Some(object) = reader.question() {
        let answer = c.bus.read_bytes(object).await;
        reader.answer(answer);
    }
    match reader.outcome() {
        Some(Ok(reported)) => Ok(reported),
        Some(Err(failure)) if c.bus.quirks().means_absent(failure.error) => {
            c.note_absent(failure.object);
            Ok(vec![])
        }
        Some(Err(failure)) => Err(FailureCause::PdoRead(failure)),
        None => Ok(vec![]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unused_pdo_keeps_its_identifier_and_is_invalid() {
        assert_eq!(unused_id(PdoDirection::Receive, 4, 2), 0x8000_0502);
        assert_eq!(unused_id(PdoDirection::Transmit, 2, 2), 0x8000_0282);
    }
}
