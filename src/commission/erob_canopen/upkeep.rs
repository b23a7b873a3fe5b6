//! Zero and store.

use takt_rt::Nanoseconds;

use super::enabling::state;
use super::objects::{MULTI_TURN_RESET, STORE};
use super::state::SAVE_SIGNATURE;
use crate::canopen::object::{DataType, Object};
use crate::canopen::objects::*;
use crate::canopen::sdo::{AbortCode, SdoError};
use crate::commission::contact;
use crate::commission::conversation::Conversation;
use crate::commission::failure::Failure;
use crate::commission::report::Report;
use crate::commission::subject::Subject;

/// The supply must stay on for so long after the command to store.
const STORING_NS: Nanoseconds = 3_000_000_000;
/// The count of turns is gone this long after the command, at the latest.
const ZEROING_NS: Nanoseconds = 500_000_000;

/// `zero`: clears the multi-turn count (2242 = 1). What is left is the position within one turn.
pub async fn zero(c: &Conversation, s: &Subject, is_agreed: bool) -> Result<Report, Failure> {
    if !is_agreed {
        return Err(Failure::NeedsConsent {
            consequence: "this clears the drive's count of turns (2242 = 1): the position becomes the one within a \
                          turn, and the joint's zero must be set again",
            option: "--yes",
        });
    }
    contact::reach_family(c, s).await?;
    c.step("state");
    if state(c).await?.has_torque() {
        return Err(Failure::Enabled);
    }
    let before = c.read(&POSITION_ACTUAL_VALUE).await?;
    c.step("clear the count of turns");
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

/// 2242 = 1. Its type is not published: what is told to be too long or too short is tried in another length.
pub async fn clear_turns(c: &Conversation) -> Result<(), Failure> {
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

/// `save`: 1010:1 = "save", and three seconds of patience.
pub async fn save(c: &Conversation, s: &Subject) -> Result<Report, Failure> {
    contact::reach_family(c, s).await?;
    c.step("state");
    if state(c).await?.has_torque() {
        return Err(Failure::Enabled);
    }
    c.step("store");
    c.write_once(&STORE, SAVE_SIGNATURE).await?;
    c.note("do not cut the supply for 3 s");
    let paused = c.pause(STORING_NS).await;
    if paused.is_err() {
        c.note("the parameters are being stored all the same: do not cut the supply yet");
    }
    paused?;
    let mut report = Report::new();
    report.add("stored", "stored", true, "the parameters that can be stored");
    Ok(report)
}
