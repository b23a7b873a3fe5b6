//! How an axis moves, rotary or linear, and how its drive counts that.

use takt_rt::PositionCounter;

use super::machine::boolean;
use super::section::Section;
use crate::config::defaults;
use crate::config::drive_family::DriveFacts;
use crate::config::model::Travel;
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::{Counting, Quantities};
use crate::config::quantity::Quantity;
use crate::config::ranges;
use crate::config::rules;

/// The travel. The lead of a rotary axis is checked and not used, so that the travel can be changed in one line.
pub fn travel(section: &mut Section<'_>) -> Option<Travel> {
    let lead = section.get("lead").map(|entry| entry.quantity(Quantity::LENGTH, ranges::LEAD));
    let is_linear = match section.get("travel") {
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
    let counts_per_turn = section.get("counts_per_turn").map(|entry| entry.number(ranges::COUNTS_PER_TURN));
    if counts_per_turn.is_none() && drive.is_some_and(|drive| drive.counts_per_turn.is_none()) {
        let says =
            "counts of one turn of the position that the drive reports, which its data sheet does not say";
        section.require("counts_per_turn", says);
    }
    let gear_ratio = section.get("gear_ratio").map(|entry| entry.number(ranges::GEAR_RATIO));
    let zero_counts =
        section.get("zero_counts").map(|entry| entry.integer(i32::MIN.into()..1 + i64::from(i32::MAX)));
    let reversed = boolean(section, "reversed", false);
    let position_at_zero_counts = section.get("position_at_zero_counts");
    let counting = Counting {
        travel: travel?,
        counts_per_turn: counts_per_turn.unwrap_or_else(|| drive.and_then(|drive| drive.counts_per_turn))?,
        gear_ratio: gear_ratio.unwrap_or(Some(defaults::GEAR_RATIO))?,
        reversed,
        zero_counts: i32::try_from(zero_counts.unwrap_or(Some(0))?).ok()?,
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
