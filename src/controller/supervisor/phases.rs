//! What the phases of the groups say.

use takt_rt::{Phase, Rule, Snapshot, StopReason};

/// The first stop for a fault, of any group.
pub fn fault_stop(snapshot: &Snapshot) -> Option<StopReason> {
    let stops = snapshot.groups().iter().filter_map(|group| group.stop);
    stops.filter(|stop| stop.rule() != Rule::Requested).min_by_key(|stop| stop.slot)
}

/// The stop of a group with a drive that has torque although it should have none, or may have it.
pub fn unreleased_stop(snapshot: &Snapshot) -> Option<StopReason> {
    let mut stops = snapshot.groups().iter().filter_map(|group| group.stop);
    stops.find(|stop| matches!(stop.rule(), Rule::NotDisabled | Rule::DriveEnabled))
}

/// Returns `true` if a group is in such a phase.
pub fn is_any(snapshot: &Snapshot, is_such: impl Fn(Phase) -> bool) -> bool {
    snapshot.groups().iter().any(|group| is_such(group.phase))
}

pub fn is_off(phase: Phase) -> bool {
    matches!(phase, Phase::Disabled | Phase::Passive)
}

pub fn is_in_operation(phase: Phase) -> bool {
    matches!(phase, Phase::Holding | Phase::Moving | Phase::Streaming | Phase::Stopping)
}

pub fn is_every_group_off(snapshot: &Snapshot) -> bool {
    !is_any(snapshot, |phase| !is_off(phase))
}

/// The phase of the first group that is in one which it should have left.
pub fn stuck_phase(snapshot: &Snapshot, should_be_left: impl Fn(Phase) -> bool) -> Phase {
    let mut groups = snapshot.groups().iter().map(|group| group.phase);
    groups.find(|phase| should_be_left(*phase)).unwrap_or_default()
}
