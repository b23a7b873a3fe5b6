//! Clears the turn count of the multi-turn encoder.

use takt_rt::Nanoseconds;
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;
use takt_wire::canopen::sdo::{AbortCode, SdoError};

use super::objects::MULTI_TURN_RESET;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::profile::enabling::state;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::erob_canopen::MULTI_TURN_BATTERY;

/// Longest time until the turn count is cleared.
const ZEROING_NS: Nanoseconds = 500_000_000;

/// `zero`: clears the turn count (2242 = 1). The position within one turn remains.
pub async fn zero(c: &SdoSession, s: &TargetDrive, is_confirmed: bool) -> Result<Report, Failure> {
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this clears the drive's turn count (2242 = 1): the position becomes the one within a \
                          turn, and the joint's zero must be set again",
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
    clear_turns(c).await?;
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

/// Before the fault reset: a multi-turn battery fault needs object 2242, which clears the turn count.
pub async fn before_fault_reset(c: &SdoSession, code: ErrorCode, is_confirmed: bool) -> Result<(), Failure> {
    if code != MULTI_TURN_BATTERY {
        return Ok(());
    }
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "the battery of the multi-turn encoder is empty or was disconnected; clearing this fault \
                          (2242 = 1) clears the count of turns too, and the joint's zero must be set again",
            option: "--yes",
        });
    }
    c.step("clear the count of turns");
    clear_turns(c).await
}

/// Writes 2242 = 1. The object's type is not published, so a length error leads to another attempt with another length.
async fn clear_turns(c: &SdoSession) -> Result<(), Failure> {
    let mut outcome = c.write(&MULTI_TURN_RESET, 1).await;
    for data_type in [DataType::U8, DataType::U32] {
        if !matches!(
            outcome,
            Err(Failure::Transfer {
                error: SdoError::Aborted(
                    AbortCode::LengthMismatch | AbortCode::LengthTooHigh | AbortCode::LengthTooLow
                ),
                ..
            })
        ) {
            break;
        }
        outcome = c.write(&Object { data_type, ..MULTI_TURN_RESET }, 1).await;
    }
    outcome
}
