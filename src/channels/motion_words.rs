//! The layout of the reports of motions in 64-bit words.

use takt_rt::{MotionReport, MotionReports, MotionState, RequestId};

use super::latest::Words;
use super::stop_words::{put_stop, take_stop};

/// Words of the reports at most. A stop takes four.
pub const MOTION_WORDS: usize = MotionReports::CAPACITY * (2 + 4);

/// The lowest byte of the first word of a report; 0 stands for the end.
const IN_PROGRESS: u64 = 1;
const FINISHED: u64 = 2;
const STOPPED: u64 = 3;
const REPLACED: u64 = 4;

pub fn put_motions(motions: &MotionReports, words: &mut Words<'_>) {
    for report in motions.iter() {
        let axis = report.axis.map_or(0, |axis| u64::from(axis) << 8 | 1 << 16);
        let group = u64::from(report.group) << 24;
        let state = match report.state {
            MotionState::InProgress => IN_PROGRESS,
            MotionState::Finished => FINISHED,
            MotionState::Stopped(_) => STOPPED,
            MotionState::Replaced { .. } => REPLACED,
        };
        words.put(state | axis | group);
        words.put(report.request.0);
        match report.state {
            MotionState::InProgress | MotionState::Finished => {}
            MotionState::Stopped(stop) => put_stop(&stop, words),
            MotionState::Replaced { by } => words.put(by.0),
        }
    }
    if motions.reports.last().is_none_or(Option::is_none) {
        words.put(0);
    }
}

pub fn take_motions(words: &mut Words<'_>, motions: &mut MotionReports) {
    fill(&mut motions.reports, || {
        let packed = words.take();
        if packed == 0 {
            return None;
        }
        let request = RequestId(words.take());
        let state = match packed & 0xFF {
            IN_PROGRESS => MotionState::InProgress,
            FINISHED => MotionState::Finished,
            STOPPED => MotionState::Stopped(take_stop(words)),
            _ => MotionState::Replaced { by: RequestId(words.take()) },
        };
        let axis = (packed >> 16 & 1 == 1).then_some((packed >> 8) as u8);
        Some(MotionReport { request, group: (packed >> 24) as u8, axis, state })
    });
}

/// Writes the places of a list that ends with its first `None`.
pub fn fill<T>(places: &mut [Option<T>], mut next: impl FnMut() -> Option<T>) {
    let mut has_ended = false;
    for place in places {
        let value = if has_ended { None } else { next() };
        if has_ended && place.is_none() {
            return;
        }
        has_ended = value.is_none();
        *place = value;
    }
}
