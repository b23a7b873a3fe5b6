//! What became of the last requests.

use crate::rejection::RequestError;
use crate::request::RequestId;

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// It has not been taken up, or so long ago that it is forgotten.
    None,
    /// It was granted.
    Granted,
    /// It was rejected; the reason is forgotten after [`Answers::EXPLAINED`] later rejections.
    Rejected(Option<RequestError>),
}

/// What became of the last requests: of the newest one, and of those with the [`Answers::REMEMBERED`] numbers before it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Answers {
    /// The newest request that was taken up.
    pub newest: RequestId,
    /// Bit n stands for the request whose number is by n less than the newest: whether it has been taken up.
    pub taken_up: u128,
    /// And whether it was rejected.
    pub rejected: u128,
    /// The last rejections, the newest first.
    pub rejections: [Option<(RequestId, RequestError)>; Self::EXPLAINED],
}

impl Answers {
    /// How far back is remembered.
    pub const REMEMBERED: u64 = 127;
    /// Of how many rejections it is remembered why.
    pub const EXPLAINED: usize = 8;

    /// Takes note of a request, which was rejected if there is a rejection.
    pub fn note(&mut self, id: RequestId, rejection: Option<RequestError>) {
        let ahead = id.0.saturating_sub(self.newest.0);
        if ahead > 0 {
            let moved = |bits: u128| if ahead > Self::REMEMBERED { 0 } else { bits << ahead };
            (self.taken_up, self.rejected) = (moved(self.taken_up), moved(self.rejected));
            self.newest = id;
        }
        if let Some(behind) = self.behind(id) {
            self.taken_up |= 1 << behind;
            self.rejected |= u128::from(rejection.is_some()) << behind;
        }
        if let Some(rejection) = rejection {
            self.rejections.rotate_right(1);
            if let Some(newest) = self.rejections.first_mut() {
                *newest = Some((id, rejection));
            }
        }
    }

    /// What became of a request, as far as that is remembered.
    pub fn of(&self, id: RequestId) -> Answer {
        let is_set = |bits: u128| self.behind(id).is_some_and(|behind| bits >> behind & 1 == 1);
        if is_set(self.rejected) {
            let mut explained = self.rejections.iter().flatten();
            Answer::Rejected(explained.find(|(rejected, _)| *rejected == id).map(|(_, rejection)| *rejection))
        } else if is_set(self.taken_up) {
            Answer::Granted
        } else {
            Answer::None
        }
    }

    /// Returns `true` if a request was so long ago that nothing is known of it any more.
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
    use crate::phase::Phase;
    use crate::rejection::RejectReason;
    use crate::request::RequestKind;
    use std::vec::Vec;

    fn rejection(value: u64) -> RequestError {
        RequestError {
            request: RequestKind::Move,
            reason: RejectReason::PositionLimit { position: value as f64, limit: 3.0 },
            axis: Some(2),
            phase: Phase::Holding,
        }
    }

    fn noted(requests: &[(u64, bool)]) -> Answers {
        let mut answers = Answers::default();
        for (id, is_rejected) in requests {
            answers.note(RequestId(*id), is_rejected.then(|| rejection(*id)));
        }
        answers
    }

    fn rejected(requests: &[(u64, bool)]) -> Vec<u64> {
        let answers = noted(requests);
        (0..1000).filter(|id| matches!(answers.of(RequestId(*id)), Answer::Rejected(_))).collect()
    }

    #[test]
    fn each_request_is_found_by_its_number_in_whatever_order_they_came() {
        assert_eq!(rejected(&[(1, false), (2, true), (3, false), (4, true)]), [2, 4]);
        assert_eq!(rejected(&[(7, true), (5, true), (6, false), (9, false), (8, true)]), [5, 7, 8]);
    }

    #[test]
    fn a_request_that_has_not_been_taken_up_has_no_answer_though_a_later_one_has() {
        let answers = noted(&[(3, false), (5, true)]);
        let of = |id| answers.of(RequestId(id));
        assert_eq!((of(3), of(4), of(6)), (Answer::Granted, Answer::None, Answer::None));
        assert_eq!(of(5), Answer::Rejected(Some(rejection(5))));
        assert!([3, 4, 5, 6].iter().all(|id| !answers.have_forgotten(RequestId(*id))));
    }

    #[test]
    fn what_is_too_long_ago_is_forgotten_and_never_taken_for_another() {
        assert_eq!(rejected(&[(1, true), (128, false)]), [1]);
        assert_eq!(rejected(&[(1, true), (129, false)]), [0; 0]);
        assert_eq!(rejected(&[(1, true), (600, true), (2, true)]), [600]);
        assert!(noted(&[(1, true), (600, true)]).have_forgotten(RequestId(1)));
    }

    #[test]
    fn why_is_told_of_the_last_rejections_and_that_they_were_refused_of_those_before() {
        let requests: Vec<(u64, bool)> = (1..=20).map(|id| (id, true)).collect();
        let answers = noted(&requests);
        let explained: Vec<u64> =
            (1..=20).filter(|id| matches!(answers.of(RequestId(*id)), Answer::Rejected(Some(_)))).collect();
        assert_eq!(explained, (13..=20).collect::<Vec<_>>());
        assert_eq!(answers.of(RequestId(12)), Answer::Rejected(None));
    }
}
