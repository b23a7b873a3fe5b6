//! How an axis moves, rotary or linear, and how its drive counts that.

use takt_rt::PositionCounter;

use super::section::Section;
use crate::config::drive_family::DriveFacts;
use crate::config::keys::axis::{COUNTS_PER_TURN, GEAR_RATIO, LEAD, REVERSED, TRAVEL, ZERO_COUNTS};
use crate::config::model::Travel;
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::{Counting, Quantities};
use crate::config::rules;

/// The travel. The lead of a rotary axis is checked and not used, so that the travel can be changed in one line.
pub fn travel(section: &mut Section<'_>) -> Option<Travel> {
    let lead = section.keyed(&LEAD).map(|entry| entry.quantity(Quantities::LINEAR));
    let is_linear = match section.get(TRAVEL.name) {
        None => false,
        Some(entry) => entry.choice(&[("rotary", false), ("linear", true)])?,
    };
    if !is_linear {
        return Some(Travel::Rotary);
    }
    let Some(lead) = lead else {
        section.require("lead", "what a linear axis moves in one turn: lead = \"5 mm\"");
        return None;
    };
    lead.map(|lead_m| Travel::Linear { lead_m })
}

/// How positions are counted; `None` where something about it is wrong.
pub fn counting(
    section: &mut Section<'_>,
    drive: Option<&DriveFacts>,
    travel: Option<Travel>,
) -> Option<Counting> {
    let counts_per_turn = section.keyed(&COUNTS_PER_TURN).map(|entry| entry.number());
    if counts_per_turn.is_none() && drive.is_some_and(|drive| drive.counts_per_turn.is_none()) {
        let says =
            "counts of one turn of the position that the drive reports, which its data sheet does not say";
        section.require("counts_per_turn", says);
    }
    let gear_ratio = section.keyed(&GEAR_RATIO).map(|entry| entry.number());
    let zero_counts = section.keyed(&ZERO_COUNTS).map(|entry| entry.integer());
    let reversed = section.boolean(&REVERSED);
    let position_at_zero_counts = section.get("position_at_zero_counts");
    let counting = Counting {
        travel: travel?,
        counts_per_turn: counts_per_turn.unwrap_or_else(|| drive.and_then(|drive| drive.counts_per_turn))?,
        gear_ratio: gear_ratio.unwrap_or(Some(const { GEAR_RATIO.default_number() }))?,
        reversed,
        zero_counts: zero_counts.unwrap_or(Some(0))?,
        counter: drive.map_or(PositionCounter::BITS_32, |drive| drive.counter),
    };
    let Some(entry) = position_at_zero_counts else { return Some(counting) };
    if zero_counts.is_some() {
        let (key, belongs) = (entry.spot.key.clone(), "both say where the joint is at 0: keep one of them");
        entry.report(ProblemKind::Ignored { key, beside: "zero_counts", belongs });
        return None;
    }
    let position = entry.unbounded(Quantities::of(counting.travel).position)?;
    let zero_counts = rules::limits::zero_counts(&entry.spot, position, &counting)?;
    Some(Counting { zero_counts, ..counting })
}
