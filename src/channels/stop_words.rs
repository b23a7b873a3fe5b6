//! The layout of the reason of a stop, and of its parts, in 64-bit words.

use takt_rt::{Origin, Phase, Rule, StopCategory, StopCause, StopReason};

use super::latest::Words;

pub fn put_stop(stop: &StopReason, words: &mut Words<'_>) {
    let (kind, number) = match stop.origin {
        Origin::Group => (0, 0),
        Origin::Axis(axis) => (1, axis),
        Origin::Bus(bus) => (2, bus),
    };
    let origin = u64::from(number) << 32;
    words.put(pack([stop.category as u8, stop.rule() as u8, stop.phase as u8, kind]) | origin);
    let (seen, allowed) = stop.cause.numbers();
    words.put_f64(seen);
    words.put_f64(allowed);
    words.put(stop.slot);
}

pub fn take_stop(words: &mut Words<'_>) -> StopReason {
    let packed = words.take();
    let [category, rule, phase, origin] = unpack(packed);
    let (seen, allowed) = (words.take_f64(), words.take_f64());
    let rule = Rule::ALL.get(usize::from(rule)).copied().unwrap_or(Rule::Requested);
    StopReason {
        category: match category {
            0 => StopCategory::Zero,
            1 => StopCategory::One,
            _ => StopCategory::Two,
        },
        cause: StopCause::from_numbers(rule, seen, allowed).unwrap_or(StopCause::Requested),
        origin: match origin {
            0 => Origin::Group,
            1 => Origin::Axis((packed >> 32) as u8),
            _ => Origin::Bus((packed >> 32) as u8),
        },
        slot: words.take(),
        phase: phase_of(phase),
    }
}

pub fn phase_of(number: u8) -> Phase {
    Phase::ALL.get(usize::from(number)).copied().unwrap_or_default()
}

pub fn pack([a, b, c, d]: [u8; 4]) -> u64 {
    u32::from_le_bytes([a, b, c, d]).into()
}

pub fn unpack(word: u64) -> [u8; 4] {
    (word as u32).to_le_bytes()
}
