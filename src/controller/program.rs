//! The motion program: decides which move is next, and when.

use takt_rt::{
    Answer, MAX_AXES, MotionState, Move, ProfileMove, ProfileTarget, Request, RequestEnvelope, RequestError,
    RequestId, RequestTarget, Snapshot,
};

use crate::channels::RequestNumbers;
use crate::config::{Program, ProgramMove, ProgramTarget};

/// Runs through the moves of one group of a configuration, one at a time.
#[derive(Clone, Debug)]
pub struct ProgramRunner {
    group: u8,
    /// The axes of the group, by their numbers.
    axes: Vec<usize>,
    moves: Vec<ProgramMove>,
    /// Times that the list is run; `None` for ever.
    repeat: Option<u64>,
    /// Moves begun so far.
    begun: u64,
    /// The requests for the present motion.
    requests: Vec<RequestId>,
    /// The set-points of the axes when the present move began: rad (m).
    from: Vec<f64>,
    /// How much of the present move is done, from 0 to 1.
    done: f64,
    progress: MoveProgress,
}

/// How far the present move of the program is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MoveProgress {
    /// The next move is due.
    Next,
    /// The axes move to their targets, or drives reach a velocity or a torque.
    Moving,
    /// Drives keep a velocity or a torque.
    Driving { until_ns: u64 },
    /// Drives end a velocity or a torque.
    ComingToRest,
    /// The move is over, and its dwell time passes.
    Dwelling { until_ns: u64 },
    /// The program is over.
    Finished,
}

/// What the program wants now.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramStep {
    /// Nothing but time.
    Wait,
    /// These requests, in this order.
    Begin(Vec<RequestEnvelope>),
    /// A motion of another client has replaced the move with this number, counted from 1.
    Replaced {
        /// The move.
        number: u64,
    },
    /// The real-time thread has refused the move with this number, counted from 1.
    Refused {
        /// The move.
        number: u64,
        /// Why, if that is still known.
        refusal: Option<RequestError>,
    },
    /// Everything has been done.
    Finished,
}

/// How much longer than asked for a velocity or a torque is valid. It ends by being set to zero; if that fails, it
/// expires.
const EXPIRY_NS: u64 = 1_000_000_000;
/// How long the drives may take to reach a velocity or a torque.
const REACHING_NS: u64 = 10_000_000_000;

/// What has become of the motion that a program has asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MotionResult {
    Open,
    Finished,
    Refused(Option<RequestError>),
    Replaced,
}

impl ProgramRunner {
    /// The moves of a group, whose axes have these numbers, from the beginning; `endless` repeats them until the group is stopped.
    pub fn new(program: &Program, group: usize, axes: Vec<usize>, endless: bool) -> Self {
        let repeat = (!endless).then(|| u64::from(program.repeat.max(1)));
        let moves: Vec<_> = program.moves.iter().filter(|own| own.group == group).cloned().collect();
        let progress = if moves.is_empty() { MoveProgress::Finished } else { MoveProgress::Next };
        // A checked configuration has no group whose number does not fit.
        let group = u8::try_from(group).unwrap_or(u8::MAX);
        Self { group, axes, moves, repeat, begun: 0, requests: vec![], from: vec![], done: 0.0, progress }
    }

    /// Takes the state of the group and says what is to happen. The requests of a step have ids from `numbers`, so that the
    /// program knows the answers to its own requests.
    pub fn poll(&mut self, now_ns: u64, snapshot: &Snapshot, numbers: &RequestNumbers) -> ProgramStep {
        self.done = self.part_done(snapshot);
        let is_count_reached = self.repeat.is_some_and(|times| self.begun >= times * self.moves.len() as u64);
        match self.progress {
            MoveProgress::Finished => ProgramStep::Finished,
            MoveProgress::Next if is_count_reached => self.finish(ProgramStep::Finished),
            MoveProgress::Next => {
                self.begun += 1;
                self.progress = MoveProgress::Moving;
                self.from = self.axes.iter().map(|axis| set_point(snapshot, *axis)).collect();
                self.done = 0.0;
                ProgramStep::Begin(self.present_requests(now_ns, 1.0, numbers))
            }
            MoveProgress::Moving | MoveProgress::ComingToRest => match self.motion_result(snapshot) {
                MotionResult::Open => ProgramStep::Wait,
                MotionResult::Finished => {
                    self.go_on(now_ns);
                    ProgramStep::Wait
                }
                MotionResult::Refused(refusal) => {
                    self.finish(ProgramStep::Refused { number: self.begun, refusal })
                }
                MotionResult::Replaced => self.finish(ProgramStep::Replaced { number: self.begun }),
            },
            MoveProgress::Driving { until_ns } if now_ns >= until_ns => {
                self.progress = MoveProgress::ComingToRest;
                ProgramStep::Begin(self.present_requests(now_ns, 0.0, numbers))
            }
            MoveProgress::Driving { .. } => ProgramStep::Wait,
            MoveProgress::Dwelling { until_ns } => {
                if now_ns >= until_ns {
                    self.progress = MoveProgress::Next;
                }
                ProgramStep::Wait
            }
        }
    }

    fn finish(&mut self, last: ProgramStep) -> ProgramStep {
        self.progress = MoveProgress::Finished;
        last
    }

    /// What has become of the present motion.
    fn motion_result(&self, snapshot: &Snapshot) -> MotionResult {
        let refusal = self.requests.iter().find_map(|request| match snapshot.answers.of(*request) {
            Answer::Rejected(refusal) => Some(refusal),
            Answer::None | Answer::Granted => None,
        });
        if let Some(refusal) = refusal {
            return MotionResult::Refused(refusal);
        }
        let states = self.requests.iter().map(|request| match snapshot.motions.of(*request) {
            Some(MotionState::Finished) => MotionResult::Finished,
            Some(MotionState::Replaced { .. }) => MotionResult::Replaced,
            Some(MotionState::InProgress | MotionState::Stopped(_)) => MotionResult::Open,
            // Many motions have followed it, and none of them is the program's.
            None if snapshot.answers.of(*request) == Answer::Granted => MotionResult::Replaced,
            None => MotionResult::Open,
        });
        // All of them are finished, or the first that is not tells.
        states.into_iter().find(|state| *state != MotionResult::Finished).unwrap_or(MotionResult::Finished)
    }

    /// The present motion has reached its targets.
    fn go_on(&mut self, now_ns: u64) {
        match (self.progress, self.present_duration_ns()) {
            (MoveProgress::Moving, Some(duration_ns)) => {
                self.progress = MoveProgress::Driving { until_ns: now_ns + duration_ns };
            }
            _ => self.dwell(now_ns),
        }
    }

    fn dwell(&mut self, now_ns: u64) {
        let dwell_s = self.present().map_or(0.0, |present| present.dwell_s);
        self.progress = MoveProgress::Dwelling { until_ns: now_ns + (dwell_s * 1e9) as u64 };
    }

    fn present(&self) -> Option<&ProgramMove> {
        let count = self.moves.len() as u64;
        self.moves.get((self.begun.saturating_sub(1) % count.max(1)) as usize)
    }

    /// How long drives keep the velocity or torque of the present move; `None` for a move to a position.
    fn present_duration_ns(&self) -> Option<u64> {
        match self.present()?.target {
            ProgramTarget::Position(_) => None,
            ProgramTarget::Velocity { duration_s, .. } | ProgramTarget::Torque { duration_s, .. } => {
                Some((duration_s * 1e9) as u64)
            }
        }
    }

    /// The requests of the present move, its velocities and torques times `factor`.
    fn present_requests(
        &mut self,
        now_ns: u64,
        factor: f64,
        numbers: &RequestNumbers,
    ) -> Vec<RequestEnvelope> {
        let valid_until_ns = now_ns + self.present_duration_ns().unwrap_or(0) + REACHING_NS + EXPIRY_NS;
        let Some(present) = self.present() else { return vec![] };
        let drive = |values: &[f64], target: fn(f64) -> ProfileTarget| -> Vec<Request> {
            let axes = self.axes.iter().zip(values).filter(|(_, value)| **value != 0.0);
            axes.filter_map(|(axis, value)| Some((u8::try_from(*axis).ok()?, value)))
                .map(|(axis, value)| {
                    let target = target(value * factor);
                    Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns })
                })
                .collect()
        };
        let requests = match &present.target {
            ProgramTarget::Position(position) => vec![Request::Move(self.move_of(present, position))],
            ProgramTarget::Velocity { velocity, .. } => drive(velocity, ProfileTarget::Velocity),
            ProgramTarget::Torque { torque, .. } => drive(torque, ProfileTarget::Torque),
        };
        self.requests = requests.iter().map(|_| numbers.next()).collect();
        self.requests
            .iter()
            .zip(requests)
            .map(|(id, request)| RequestEnvelope {
                id: *id,
                target: RequestTarget::Group(self.group),
                request,
            })
            .collect()
    }

    /// The targets of the present move (rad or m), each with the number of its axis. None before the first move, and for a move
    /// that has no target position.
    pub fn targets(&self) -> impl Iterator<Item = (usize, f64)> {
        let position = match self.present().filter(|_| self.begun > 0).map(|present| &present.target) {
            Some(ProgramTarget::Position(position)) => position.as_slice(),
            Some(ProgramTarget::Velocity { .. } | ProgramTarget::Torque { .. }) | None => &[],
        };
        self.axes.iter().copied().zip(position.iter().copied())
    }

    fn move_of(&self, present: &ProgramMove, position: &[f64]) -> Move {
        let mut target = [0.0; MAX_AXES];
        for (axis, position) in self.axes.iter().zip(position) {
            if let Some(target) = target.get_mut(*axis) {
                *target = *position;
            }
        }
        Move {
            target,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: present.velocity_scale,
            acceleration_scale: present.acceleration_scale,
            minimum_duration_s: present.minimum_duration_s,
        }
    }

    /// How much of its way the slowest axis of the present move has behind it, from 0 to 1: all of it when nothing moves.
    fn part_done(&self, snapshot: &Snapshot) -> f64 {
        let parts = self.targets().zip(&self.from).filter_map(|((axis, target), from)| {
            let (whole, left) = ((target - from).abs(), (target - set_point(snapshot, axis)).abs());
            (whole > 0.0).then_some((1.0 - left / whole).clamp(0.0, 1.0))
        });
        parts.fold(1.0, f64::min)
    }

    /// How far the program is.
    pub fn progress(&self) -> ProgramProgress {
        let all = self.repeat.map(|times| times * self.moves.len() as u64);
        ProgramProgress { begun: self.begun, all, done: self.begun.saturating_sub(1) as f64 + self.done }
    }
}

/// How far a program is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProgramProgress {
    /// Moves begun.
    pub begun: u64,
    /// How many there are, if that is known.
    pub all: Option<u64>,
    /// How many are done, the present one in part.
    pub done: f64,
}

fn set_point(snapshot: &Snapshot, axis: usize) -> f64 {
    snapshot.axes.get(axis).map_or(0.0, |axis| axis.position_set)
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{Phase, RejectReason, RequestKind};

    fn program(repeat: u32) -> Program {
        let to = |target: f64| ProgramMove {
            group: 0,
            target: ProgramTarget::Position(vec![target]),
            velocity_scale: 0.5,
            acceleration_scale: 0.25,
            minimum_duration_s: 0.0,
            dwell_s: 0.1,
        };
        Program { repeat, moves: vec![to(1.0), to(2.0)] }
    }

    /// The state after these requests have begun motions that reached their targets.
    fn finished(requests: &[RequestId]) -> Snapshot {
        let mut snapshot = Snapshot::default();
        for request in requests {
            snapshot.answers.note(*request, None);
            snapshot.motions.begin(*request, 0, None, |_| false);
        }
        snapshot.motions.end_all(0, MotionState::Finished, |_| {});
        snapshot
    }

    const REJECTED: RequestError = RequestError {
        request: RequestKind::Move,
        reason: RejectReason::PositionLimit { position: 2.0, limit: 1.5 },
        axis: Some(0),
        phase: Phase::Holding,
    };

    fn refusing(ids: &[RequestId]) -> Snapshot {
        let mut snapshot = finished(&[]);
        for id in ids {
            snapshot.rejected += 1;
            snapshot.answers.note(*id, Some(REJECTED));
        }
        snapshot
    }

    /// A program, and where it takes the numbers of its requests from.
    struct Running(ProgramRunner, RequestNumbers);

    impl Running {
        fn new(program: &Program) -> Self {
            Self(ProgramRunner::new(program, 0, vec![0, 1], false), RequestNumbers::default())
        }

        fn poll(&mut self, now_ns: u64, snapshot: &Snapshot) -> ProgramStep {
            self.0.poll(now_ns, snapshot, &self.1)
        }

        fn begin(&mut self, now_ns: u64, snapshot: &Snapshot) -> Option<(RequestId, Move)> {
            match self.poll(now_ns, snapshot) {
                ProgramStep::Begin(requests) => match requests[..] {
                    [RequestEnvelope { id, request: Request::Move(begun), .. }] => Some((id, begun)),
                    _ => panic!("{requests:?}"),
                },
                _ => None,
            }
        }
    }

    #[test]
    fn a_velocity_is_kept_for_its_time_and_then_set_to_zero() {
        let target = ProgramTarget::Velocity { velocity: vec![0.3, 0.5], duration_s: 2.0 };
        let spin = ProgramMove { target, ..program(1).moves[0].clone() };
        let mut runner = Running::new(&Program { repeat: 1, moves: vec![spin] });
        let asked = |step| match step {
            ProgramStep::Begin(requests) => match requests[..] {
                [
                    RequestEnvelope { id, request: Request::SetProfileTarget(first), .. },
                    RequestEnvelope { id: next_id, request: Request::SetProfileTarget(second), .. },
                ] => {
                    assert_eq!((first.axis, second.axis), (0, 1));
                    ([id, next_id], first.target, second.target)
                }
                _ => panic!("{requests:?}"),
            },
            step => panic!("{step:?}"),
        };
        let speeds = |first, second| (ProfileTarget::Velocity(first), ProfileTarget::Velocity(second));
        let (spin, first, second) = asked(runner.poll(0, &finished(&[])));
        assert_eq!((first, second), speeds(0.3, 0.5));
        let one_of_two = finished(&spin[..1]);
        assert_eq!(runner.poll(400_000_000, &one_of_two), ProgramStep::Wait);
        let driving = finished(&spin);
        assert_eq!(runner.poll(500_000_000, &driving), ProgramStep::Wait);
        assert_eq!(runner.poll(2_499_000_000, &driving), ProgramStep::Wait);
        let (rest, first, second) = asked(runner.poll(2_500_000_000, &driving));
        assert_eq!((first, second), speeds(0.0, 0.0));
        assert_eq!(runner.poll(2_600_000_000, &driving), ProgramStep::Wait);
        let at_rest = finished(&rest);
        assert_eq!(runner.poll(3_000_000_000, &at_rest), ProgramStep::Wait);
        assert_eq!(
            (runner.poll(3_100_000_000, &at_rest), runner.0.targets().count()),
            (ProgramStep::Wait, 0)
        );
        assert_eq!(runner.poll(3_100_000_000, &at_rest), ProgramStep::Finished);
    }

    #[test]
    fn moves_follow_one_another_after_their_dwell_as_often_as_asked() {
        let mut runner = Running::new(&program(2));
        let mut targets = vec![];
        let mut snapshot = finished(&[]);
        for now_ms in 0..2_000 {
            if let Some((request, begun)) = runner.begin(now_ms * 1_000_000, &snapshot) {
                targets.push((now_ms, begun.target[0]));
                snapshot = finished(&[request]);
            }
        }
        let only: Vec<f64> = targets.iter().map(|(_, target)| *target).collect();
        assert_eq!(only, [1.0, 2.0, 1.0, 2.0]);
        assert!(targets.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 100), "{targets:?}");
        assert_eq!(runner.poll(3_000_000_000, &snapshot), ProgramStep::Finished);
    }

    #[test]
    fn progress_goes_on_within_a_move_with_the_slowest_axis() {
        let to = ProgramTarget::Position(vec![1.0, -2.0]);
        let moves = vec![ProgramMove { target: to, ..program(1).moves[0].clone() }];
        let mut runner = Running::new(&Program { repeat: 2, moves });
        let (request, _) = runner.begin(0, &finished(&[])).unwrap();
        let mut moving = finished(&[]);
        moving.motions.begin(request, 0, None, |_| true);
        let mut done_at = |first, second| {
            (moving.axes[0].position_set, moving.axes[1].position_set) = (first, second);
            runner.poll(1, &moving);
            runner.0.progress().done
        };
        assert_eq!(done_at(0.0, 0.0), 0.0);
        assert_eq!(done_at(0.5, -0.5), 0.25);
        assert_eq!(done_at(1.0, -2.0), 1.0);
        assert_eq!((runner.0.progress().begun, runner.0.progress().all), (1, Some(2)));
    }

    #[test]
    fn the_next_move_waits_for_the_present_one() {
        let mut runner = Running::new(&program(1));
        let (request, first) = runner.begin(0, &finished(&[])).unwrap();
        assert_eq!((first.velocity_scale, first.acceleration_scale), (0.5, 0.25));
        let mut moving = finished(&[]);
        moving.motions.begin(request, 0, None, |_| true);
        for now_s in 0..100 {
            assert_eq!(runner.poll(now_s * 1_000_000_000, &moving), ProgramStep::Wait);
        }
    }

    #[test]
    fn a_refused_move_ends_the_program_with_its_number_and_why() {
        let mut runner = Running::new(&program(1));
        let (request, _) = runner.begin(0, &finished(&[])).unwrap();
        let refused = ProgramStep::Refused { number: 1, refusal: Some(REJECTED) };
        assert_eq!(runner.poll(1, &refusing(&[request])), refused);
        assert_eq!(runner.poll(2, &refusing(&[request])), ProgramStep::Finished);
    }

    #[test]
    fn a_move_that_another_client_replaces_ends_the_program_with_its_number() {
        let mut runner = Running::new(&program(1));
        let (request, _) = runner.begin(0, &finished(&[])).unwrap();
        let mut snapshot = finished(&[]);
        snapshot.motions.begin(request, 0, None, |_| true);
        snapshot.motions.begin(runner.1.next(), 0, None, |_| true);
        assert_eq!(runner.poll(1, &snapshot), ProgramStep::Replaced { number: 1 });
        assert_eq!(runner.poll(2, &snapshot), ProgramStep::Finished);
    }

    #[test]
    fn a_request_of_another_client_that_is_refused_does_not_end_the_program() {
        let mut runner = Running::new(&program(1));
        let before = runner.1.next();
        let (request, _) = runner.begin(0, &finished(&[])).unwrap();
        let others = [before, runner.1.next(), runner.1.next()];
        assert_eq!(runner.poll(1, &refusing(&others)), ProgramStep::Wait);
        let arrived = Snapshot { motions: finished(&[request]).motions, ..refusing(&others) };
        assert_eq!(runner.poll(2, &arrived), ProgramStep::Wait);
        assert!(runner.begin(200_000_000, &arrived).is_none());
        assert!(runner.begin(200_000_001, &arrived).is_some_and(|(next, _)| next > request));
    }

    #[test]
    fn a_program_without_moves_is_finished_at_once() {
        assert_eq!(Running::new(&Program::default()).poll(0, &finished(&[])), ProgramStep::Finished);
    }
}
