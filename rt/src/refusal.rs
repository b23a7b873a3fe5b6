//! Why a request was refused, and what became of the last ones.

use crate::host::RequestId;
use crate::stop::Phase;

/// What was asked for, without its parameters: [`Request::kind`](crate::host::Request::kind).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum RequestKind {
    /// SYNC, or none any more.
    Sync = 0,
    /// The time of day.
    TimeOfDay = 1,
    /// The rated torque of a drive.
    RatedTorque = 2,
    /// The process data of a drive.
    ProcessData = 3,
    /// Where a drive is.
    Position = 4,
    /// To begin to send set-points.
    Activate = 5,
    /// To enable.
    Enable = 6,
    /// A move.
    Move = 7,
    /// A target for a drive in a profile mode.
    SetProfileTarget = 8,
    /// To follow a stream.
    Stream = 9,
    /// A stop.
    Stop = 10,
    /// To disable.
    Disable = 11,
    /// To clear faults.
    ResetFaults = 12,
    /// To enable nothing any more.
    InhibitEnable = 13,
    /// To end.
    Shutdown = 14,
}

impl RequestKind {
    /// Every kind, in the order of their numbers.
    pub const ALL: [Self; 15] = [
        Self::Sync,
        Self::TimeOfDay,
        Self::RatedTorque,
        Self::ProcessData,
        Self::Position,
        Self::Activate,
        Self::Enable,
        Self::Move,
        Self::SetProfileTarget,
        Self::Stream,
        Self::Stop,
        Self::Disable,
        Self::ResetFaults,
        Self::InhibitEnable,
        Self::Shutdown,
    ];
}

/// What stands against a request. [`Refusal::value`] and [`Refusal::limit`] are what was asked for and what is allowed, in
/// rad (m), rad/s (m/s), N·m (N), or as it says here; 0 where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum RejectReason {
    /// It is not possible in the phase that the group is in.
    Phase = 0,
    /// A fault has stopped the group and has not been reset. The value is the number of the [`Rule`](crate::stop::Rule).
    StopLatched = 1,
    /// The run is on its way out: nothing is enabled any more.
    EnableInhibited = 2,
    /// Slots are missed too often for a stream. The value is how many have been of late.
    MissedSlots = 3,
    /// There is no such axis. The value is the number that was asked for, the limit how many there are.
    UnknownAxis = 4,
    /// The axis is in a mode that takes no such target. The value is the mode (object 6060).
    WrongMode = 5,
    /// A number is infinite or none at all.
    NotFinite = 6,
    /// A target lies outside the position limits.
    PositionLimit = 7,
    /// A velocity is beyond the limit.
    VelocityLimit = 8,
    /// A torque is beyond the limit.
    TorqueLimit = 9,
    /// A target is passed at a speed from which the axis comes to rest only at the value, outside the position limits.
    NoRoomToStop = 10,
    /// The fraction of the velocity limits is not above 0 and up to 1.
    VelocityScale = 11,
    /// The fraction of the acceleration limits is not above 0 and up to 1.
    AccelerationScale = 12,
    /// The shortest duration (s) is negative, or of no size that can be reckoned with.
    MinimumDuration = 13,
    /// No trajectory within the limits leads there.
    NoTrajectory = 14,
    /// A rated torque is not a positive number.
    RatedTorque = 15,
    /// No process data would be left in one direction.
    NoProcessData = 16,
    /// An object cannot be mapped, or there are too many. The value is the object as a mapping parameter has it, or 0.
    Mapping = 17,
    /// An identifier is in use. The value is the identifier.
    IdTaken = 18,
    /// The drives are not told the time of day.
    NoTime = 19,
}

impl RejectReason {
    /// Every one, in the order of their numbers.
    pub const ALL: [Self; 20] = [
        Self::Phase,
        Self::StopLatched,
        Self::EnableInhibited,
        Self::MissedSlots,
        Self::UnknownAxis,
        Self::WrongMode,
        Self::NotFinite,
        Self::PositionLimit,
        Self::VelocityLimit,
        Self::TorqueLimit,
        Self::NoRoomToStop,
        Self::VelocityScale,
        Self::AccelerationScale,
        Self::MinimumDuration,
        Self::NoTrajectory,
        Self::RatedTorque,
        Self::NoProcessData,
        Self::Mapping,
        Self::IdTaken,
        Self::NoTime,
    ];
}

/// A request that was refused and changed nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refusal {
    /// What was asked for.
    pub request: RequestKind,
    /// What stands against it.
    pub objection: RejectReason,
    /// The axis at fault; `None` when it is not one axis.
    pub axis: Option<u8>,
    /// What was asked for, see [`RejectReason`].
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
    /// What the group was doing.
    pub phase: Phase,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// It has not been taken up, or so long ago that it is forgotten.
    None,
    /// It was granted.
    Granted,
    /// It was refused; why is forgotten after [`Answers::EXPLAINED`] later refusals.
    Refused(Option<Refusal>),
}

/// What became of the last requests: of the newest one, and of those with the [`Answers::REMEMBERED`] numbers before it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Answers {
    /// The newest request that was taken up.
    pub newest: RequestId,
    /// Bit n stands for the request whose number is by n less than the newest: whether it has been taken up.
    pub taken_up: u128,
    /// And whether it was refused.
    pub refused: u128,
    /// The last refusals, the newest first.
    pub refusals: [Option<(RequestId, Refusal)>; Self::EXPLAINED],
}

impl Answers {
    /// How far back is remembered.
    pub const REMEMBERED: u64 = 127;
    /// Of how many refusals it is remembered why.
    pub const EXPLAINED: usize = 8;

    /// Takes note of a request, which was refused if there is a refusal.
    pub fn note(&mut self, id: RequestId, refusal: Option<Refusal>) {
        let ahead = id.0.saturating_sub(self.newest.0);
        if ahead > 0 {
            let moved = |bits: u128| if ahead > Self::REMEMBERED { 0 } else { bits << ahead };
            (self.taken_up, self.refused) = (moved(self.taken_up), moved(self.refused));
            self.newest = id;
        }
        if let Some(behind) = self.behind(id) {
            self.taken_up |= 1 << behind;
            self.refused |= u128::from(refusal.is_some()) << behind;
        }
        if let Some(refusal) = refusal {
            self.refusals.rotate_right(1);
            if let Some(newest) = self.refusals.first_mut() {
                *newest = Some((id, refusal));
            }
        }
    }

    /// What became of a request, as far as that is remembered.
    pub fn of(&self, id: RequestId) -> Answer {
        let is_set = |bits: u128| self.behind(id).is_some_and(|behind| bits >> behind & 1 == 1);
        if is_set(self.refused) {
            let mut explained = self.refusals.iter().flatten();
            Answer::Refused(explained.find(|(refused, _)| *refused == id).map(|(_, refusal)| *refusal))
        } else if is_set(self.taken_up) {
            Answer::Granted
        } else {
            Answer::None
        }
    }

    /// Whether a request was so long ago that nothing is known of it any more.
    pub fn have_forgotten(&self, id: RequestId) -> bool {
        self.newest > id && self.behind(id).is_none()
    }

    fn behind(&self, id: RequestId) -> Option<u64> {
        self.newest.0.checked_sub(id.0).filter(|behind| *behind <= Self::REMEMBERED)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    fn refusal(value: u64) -> Refusal {
        Refusal {
            request: RequestKind::Move,
            objection: RejectReason::PositionLimit,
            axis: Some(2),
            value: value as f64,
            limit: 3.0,
            phase: Phase::Holding,
        }
    }

    fn noted(requests: &[(u64, bool)]) -> Answers {
        let mut answers = Answers::default();
        for (id, is_refused) in requests {
            answers.note(RequestId(*id), is_refused.then(|| refusal(*id)));
        }
        answers
    }

    fn refused(requests: &[(u64, bool)]) -> Vec<u64> {
        let answers = noted(requests);
        (0..1000).filter(|id| matches!(answers.of(RequestId(*id)), Answer::Refused(_))).collect()
    }

    #[test]
    fn each_request_is_found_by_its_number_in_whatever_order_they_came() {
        assert_eq!(refused(&[(1, false), (2, true), (3, false), (4, true)]), [2, 4]);
        assert_eq!(refused(&[(7, true), (5, true), (6, false), (9, false), (8, true)]), [5, 7, 8]);
    }

    #[test]
    fn a_request_that_has_not_been_taken_up_has_no_answer_though_a_later_one_has() {
        let answers = noted(&[(3, false), (5, true)]);
        let of = |id| answers.of(RequestId(id));
        assert_eq!((of(3), of(4), of(6)), (Answer::Granted, Answer::None, Answer::None));
        assert_eq!(of(5), Answer::Refused(Some(refusal(5))));
        assert!([3, 4, 5, 6].iter().all(|id| !answers.have_forgotten(RequestId(*id))));
    }

    #[test]
    fn what_is_too_long_ago_is_forgotten_and_never_taken_for_another() {
        assert_eq!(refused(&[(1, true), (128, false)]), [1]);
        assert_eq!(refused(&[(1, true), (129, false)]), [0; 0]);
        assert_eq!(refused(&[(1, true), (600, true), (2, true)]), [600]);
        assert!(noted(&[(1, true), (600, true)]).have_forgotten(RequestId(1)));
    }

    #[test]
    fn why_is_told_of_the_last_refusals_and_that_they_were_refused_of_those_before() {
        let requests: Vec<(u64, bool)> = (1..=20).map(|id| (id, true)).collect();
        let answers = noted(&requests);
        let explained: Vec<u64> =
            (1..=20).filter(|id| matches!(answers.of(RequestId(*id)), Answer::Refused(Some(_)))).collect();
        assert_eq!(explained, (13..=20).collect::<Vec<_>>());
        assert_eq!(answers.of(RequestId(12)), Answer::Refused(None));
    }
}
