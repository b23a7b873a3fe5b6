//! Clears the turn count of a multi-turn encoder, by the object that the quirk file of the drive names.

use takt_rt::Nanoseconds;
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;
use takt_wire::canopen::sdo::{AbortCode, SdoError};
use takt_wire::quirks::TurnCount;

use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::profile::enabling::state;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// Longest time until the turn count is cleared.
const ZEROING_NS: Nanoseconds = 500_000_000;

/// `zero`: clears the turn count. The position within one turn remains.
pub async fn zero(
    c: &SdoSession,
    s: &TargetDrive,
    turns: TurnCount,
    is_confirmed: bool,
) -> Result<Report, Failure> {
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this clears the drive's turn count: the position becomes the one within a turn, and the \
                          joint's zero must be set again",
            option: "--yes",
        });
    }
    contact::connect_family(c, s).await?;
    c.step("state");
    if state(c).await?.has_torque() {
        return Err(Failure::Enabled);
    }
    let before = c.read(&POSITION_ACTUAL_VALUE).await?;
    c.step("clear the turn count");
    clear(c, s, turns).await?;
    let turn = s.counts_per_turn as i64;
    let within = |counts: i64| (0..turn).contains(&counts);
    let after = c.wait_for(&POSITION_ACTUAL_VALUE, "a position within one turn", ZEROING_NS, within).await?;
    let mut report = Report::new();
    report.add("before_counts", "before", before, format!("{before} counts"));
    report.add("after_counts", "after", after, format!("{after} counts"));
    report.add("position", "position", s.position(after), s.position_quantity().show(s.position(after)));
    c.note(format!(
        "to make this position the joint's zero, set `zero_counts = {after}` in the configuration"
    ));
    Ok(report)
}

/// Before the fault reset: the fault of an encoder that has lost its turn count needs the count cleared.
pub async fn before_fault_reset(
    c: &SdoSession,
    s: &TargetDrive,
    turns: TurnCount,
    code: ErrorCode,
    is_confirmed: bool,
) -> Result<(), Failure> {
    if turns.lost != Some(code.0) {
        return Ok(());
    }
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "the battery of the multi-turn encoder is empty or was disconnected; clearing this fault \
                          clears the count of turns too, and the joint's zero must be set again",
            option: "--yes",
        });
    }
    c.step("clear the count of turns");
    clear(c, s, turns).await
}

/// Writes 1 to the object, by the type that the data sheet gives it. Not every data sheet is right, so a length error leads to another
/// attempt with another length.
async fn clear(c: &SdoSession, s: &TargetDrive, turns: TurnCount) -> Result<(), Failure> {
    let by_sheet = s.data_type(turns.clear).unwrap_or(DataType::U16);
    let object = Object { address: turns.clear, data_type: by_sheet, name: "reset of the turn count" };
    let mut outcome = c.write(&object, 1).await;
    for data_type in [DataType::U8, DataType::U16, DataType::U32] {
        let is_length_error = matches!(
            outcome,
            Err(Failure::Transfer {
                error: SdoError::Aborted(
                    AbortCode::LengthMismatch | AbortCode::LengthTooHigh | AbortCode::LengthTooLow
                ),
                ..
            })
        );
        if is_length_error && data_type != by_sheet {
            outcome = c.write(&Object { data_type, ..object }, 1).await;
        }
    }
    outcome
}
