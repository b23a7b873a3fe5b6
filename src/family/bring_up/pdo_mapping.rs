//! The PDO mapping of a drive: written and read back, or taken as the drive reports it.

use super::axis_session::{AxisSession, StepResult};
use super::check::Check;
use super::failure::FailureCause;
use super::process_data::{PdoPlan, ProcessData, pdo_id};
use crate::canopen::objects::{PDO_IDENTITY, PDO_INVALID, PdoDirection, PdoParameters};
use crate::canopen::pdo_reader::PdoReader;

/// Writes the mapping of the planned PDOs of one direction, and switches the others off, up to PDO `count`.
pub async fn write(c: &AxisSession<'_>, direction: PdoDirection, plans: &[PdoPlan], count: u8) -> StepResult {
    let name = match direction {
        PdoDirection::Receive => "RPDO mapping",
        PdoDirection::Transmit => "TPDO mapping",
    };
    c.step(name, "the drive cannot carry these objects in this PDO: choose other feedback or another mode");
    for number in 1..=count {
        match plans.iter().find(|plan| plan.number == number) {
            Some(plan) => map(c, direction, plan).await?,
            None => {
                let id = unused_id(direction, number, c.axis.node);
                write_cob_id(c, PdoParameters::of(direction, number), id).await?;
            }
        }
    }
    Ok(())
}

/// Writes a PDO mapping. It may only change while the PDO is invalid and the count is zero (CiA 301, 7.5.2.36).
async fn map(c: &AxisSession<'_>, direction: PdoDirection, plan: &PdoPlan) -> StepResult {
    let parameters = PdoParameters::of(direction, plan.number);
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

async fn read_reported(c: &AxisSession<'_>) -> StepResult {
    let mut reader = PdoReader::of_first_four();
    while let Some(object) = reader.question() {
        let answer = c.bus.read_bytes(object).await;
        reader.answer(answer);
    }
    let reported = match reader.outcome() {
        Some(Ok(reported)) => reported,
        Some(Err(failure)) if c.bus.quirks().means_absent(failure.error) => {
            c.note_absent(failure.object);
            vec![]
        }
        Some(Err(failure)) => return Err(FailureCause::PdoRead(failure)),
        None => vec![],
    };
    let data = ProcessData::as_reported(c.axis, &reported).map_err(FailureCause::Mapping)?;
    c.keep(|facts| facts.process_data = Some(data));
    Ok(())
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
