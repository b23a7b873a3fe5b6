//! The motion program: which move is next, and when.

use takt_rt::{
    Answer, MAX_AXES, MotionState, Move, Phase, ProfileMove, ProfileTarget, Request, RequestEnvelope,
    RequestError, RequestId, Snapshot,
};

use super::channels::RequestNumbers;
use crate::config::{Program, ProgramMove, ProgramTarget};

/// Runs through the moves of a configuration, one at a time.
#[derive(Clone, Debug)]
pub struct ProgramRunner {
    moves: Vec<ProgramMove>,
    /// Times that the list is run; `None` for ever.
    repeat: Option<u64>,
    /// Moves begun so far.
    begun: u64,
    /// The numbers of the requests that ask for it.
    asked: Vec<RequestId>,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Next,
    Moving,
    /// Drives go at a speed, or push with a torque.
    Driving {
        until_ns: u64,
    },
    Stopping,
    Dwelling {
        until_ns: u64,
    },
    Finished,
}

/// What the program wants now.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Nothing but time.
    Wait,
    /// This, in this order.
    Begin(Vec<RequestEnvelope>),
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

/// How much longer than asked for a speed or a torque is valid: it ends by being set to zero, and if nobody does that
/// by expiring.
const EXPIRY_NS: u64 = 1_000_000_000;
/// How long the drives may take to reach a speed or a torque.
const REACHING_NS: u64 = 10_000_000_000;

impl ProgramRunner {
    /// A program from its beginning; `endless` repeats it until somebody stops it.
    pub fn new(program: &Program, endless: bool) -> Self {
        let repeat = (!endless).then(|| u64::from(program.repeat.max(1)));
        let state = if program.moves.is_empty() { State::Finished } else { State::Next };
        Self { moves: program.moves.clone(), repeat, begun: 0, asked: vec![], state }
    }

    /// Takes the state of the group and says what is to happen. The requests of a step bear `numbers`, so that nobody
    /// else's refusal is taken for theirs.
    pub fn poll(&mut self, now_ns: u64, snapshot: &Snapshot, numbers: &RequestNumbers) -> Step {
        let is_reached = self.is_reached(snapshot);
        let is_done = is_reached && snapshot.phase == Phase::Holding;
        if let (State::Moving | State::Stopping, Some(refusal)) = (self.state, self.refusal(snapshot)) {
            self.state = State::Finished;
            return Step::Refused { number: self.begun, refusal };
        }
        match self.state {
            State::Finished => Step::Finished,
            State::Next if self.repeat.is_some_and(|times| self.begun >= times * self.moves.len() as u64) => {
                self.state = State::Finished;
                Step::Finished
            }
            State::Next => {
                self.begun += 1;
                self.state = State::Moving;
                Step::Begin(self.present_requests(now_ns, 1.0, numbers))
            }
            State::Moving => {
                match self.present_duration_ns() {
                    Some(duration_ns) if is_reached => {
                        self.state = State::Driving { until_ns: now_ns + duration_ns };
                    }
                    None if is_done => self.dwell(now_ns),
                    _ => {}
                }
                Step::Wait
            }
            State::Driving { until_ns } if now_ns >= until_ns => {
                self.state = State::Stopping;
                Step::Begin(self.present_requests(now_ns, 0.0, numbers))
            }
            State::Driving { .. } => Step::Wait,
            State::Stopping => {
                if is_done {
                    self.dwell(now_ns);
                }
                Step::Wait
            }
            State::Dwelling { until_ns } => {
                if now_ns >= until_ns {
                    self.state = State::Next;
                }
                Step::Wait
            }
        }
    }

    /// Whether every motion of the present requests has reached its target.
    fn is_reached(&self, snapshot: &Snapshot) -> bool {
        let is_finished = |asked: &RequestId| snapshot.motions.of(*asked) == Some(MotionState::Finished);
        !self.asked.is_empty() && self.asked.iter().all(is_finished)
    }

    /// Why one of the present requests was refused, if one was and that is still known.
    fn refusal(&self, snapshot: &Snapshot) -> Option<Option<RequestError>> {
        self.asked.iter().find_map(|asked| match snapshot.answers.of(*asked) {
            Answer::Rejected(refusal) => Some(refusal),
            Answer::None | Answer::Granted => None,
        })
    }

    fn dwell(&mut self, now_ns: u64) {
        let dwell_s = self.present().map_or(0.0, |present| present.dwell_s);
        self.state = State::Dwelling { until_ns: now_ns + (dwell_s * 1e9) as u64 };
    }

    fn present(&self) -> Option<&ProgramMove> {
        let count = self.moves.len() as u64;
        self.moves.get((self.begun.saturating_sub(1) % count.max(1)) as usize)
    }

    /// How long drives go on at what the present move wants; `None` for one that ends where it leads.
    fn present_duration_ns(&self) -> Option<u64> {
        match self.present()?.target {
            ProgramTarget::Position(_) => None,
            ProgramTarget::Velocity { duration_s, .. } | ProgramTarget::Torque { duration_s, .. } => {
                Some((duration_s * 1e9) as u64)
            }
        }
    }

    /// The requests of the present move, its speeds and torques times `factor`. All of them are one move with a number of
    /// its own.
    fn present_requests(
        &mut self,
        now_ns: u64,
        factor: f64,
        numbers: &RequestNumbers,
    ) -> Vec<RequestEnvelope> {
        let valid_until_ns = now_ns + self.present_duration_ns().unwrap_or(0) + REACHING_NS + EXPIRY_NS;
        let Some(present) = self.present() else { return vec![] };
        let drive = |values: &[f64], target: fn(f64) -> ProfileTarget| -> Vec<Request> {
            let axes = (0..).zip(values).filter(|(_, value)| **value != 0.0);
            axes.map(|(axis, value)| {
                let target = target(value * factor);
                Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns })
            })
            .collect()
        };
        let requests = match &present.target {
            ProgramTarget::Position(position) => vec![Request::Move(move_of(present, position))],
            ProgramTarget::Velocity { velocity, .. } => drive(velocity, ProfileTarget::Velocity),
            ProgramTarget::Torque { torque, .. } => drive(torque, ProfileTarget::Torque),
        };
        self.asked = requests.iter().map(|_| numbers.next()).collect();
        self.asked.iter().zip(requests).map(|(id, request)| RequestEnvelope { id: *id, request }).collect()
    }

    /// Where the present move leads (rad or m), an axis each; `None` before the first, and where it leads nowhere.
    pub fn target(&self) -> Option<&[f64]> {
        match self.present().filter(|_| self.begun > 0).map(|present| &present.target)? {
            ProgramTarget::Position(position) => Some(position),
            ProgramTarget::Velocity { .. } | ProgramTarget::Torque { .. } => None,
        }
    }

    /// Moves begun, and how many there are in all if that is known.
    pub fn progress(&self) -> (u64, Option<u64>) {
        (self.begun, self.repeat.map(|times| times * self.moves.len() as u64))
    }
}

fn move_of(present: &ProgramMove, position: &[f64]) -> Move {
    let mut target = [0.0; MAX_AXES];
    target.iter_mut().zip(position).for_each(|(to, from)| *to = *from);
    Move {
        target,
        target_velocity: [0.0; MAX_AXES],
        velocity_scale: present.velocity_scale,
        acceleration_scale: present.acceleration_scale,
        minimum_duration_s: present.minimum_duration_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{RejectReason, RequestKind};

    fn program(repeat: u32) -> Program {
        let to = |target: f64| ProgramMove {
            target: ProgramTarget::Position(vec![target]),
            velocity_scale: 0.5,
            acceleration_scale: 0.25,
            minimum_duration_s: 0.0,
            dwell_s: 0.1,
        };
        Program { repeat, moves: vec![to(1.0), to(2.0)] }
    }

    /// The group holds after the motions of these requests have reached their targets.
    fn done(motions: &[RequestId]) -> Snapshot {
        let mut snapshot = Snapshot { phase: Phase::Holding, ..Snapshot::default() };
        for (axis, request) in (0..).zip(motions) {
            snapshot.motions.begin(*request, Some(axis), |_| false);
        }
        snapshot.motions.end_all(MotionState::Finished, |_| {});
        snapshot
    }

    const REJECTED: RequestError = RequestError {
        request: RequestKind::Move,
        reason: RejectReason::PositionLimit { position: 2.0, limit: 1.5 },
        axis: Some(0),
        phase: Phase::Holding,
    };

    fn rejecting(ids: &[RequestId]) -> Snapshot {
        let mut snapshot = done(&[]);
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
            Self(ProgramRunner::new(program, false), RequestNumbers::default())
        }

        fn poll(&mut self, now_ns: u64, snapshot: &Snapshot) -> Step {
            self.0.poll(now_ns, snapshot, &self.1)
        }

        fn begin(&mut self, now_ns: u64, snapshot: &Snapshot) -> Option<(RequestId, Move)> {
            match self.poll(now_ns, snapshot) {
                Step::Begin(requests) => match requests[..] {
                    [RequestEnvelope { id, request: Request::Move(begun) }] => Some((id, begun)),
                    _ => panic!("{requests:?}"),
                },
                _ => None,
            }
        }
    }

    #[test]
    fn a_speed_is_held_for_its_time_and_then_set_to_zero() {
        let target = ProgramTarget::Velocity { velocity: vec![0.3, 0.5], duration_s: 2.0 };
        let spin = ProgramMove { target, ..program(1).moves[0].clone() };
        let mut runner = Running::new(&Program { repeat: 1, moves: vec![spin] });
        let asked = |step| match step {
            Step::Begin(requests) => match requests[..] {
                [
                    RequestEnvelope { id: one, request: Request::SetProfileTarget(first) },
                    RequestEnvelope { id: other, request: Request::SetProfileTarget(second) },
                ] => {
                    assert_eq!((first.axis, second.axis), (0, 1));
                    ([one, other], first.target, second.target)
                }
                _ => panic!("{requests:?}"),
            },
            step => panic!("{step:?}"),
        };
        let speeds = |first, second| (ProfileTarget::Velocity(first), ProfileTarget::Velocity(second));
        let (spin, first, second) = asked(runner.poll(0, &done(&[])));
        assert_eq!((first, second), speeds(0.3, 0.5));
        let driving = Snapshot { phase: Phase::Moving, ..done(&spin) };
        assert_eq!(runner.poll(500_000_000, &driving), Step::Wait);
        assert_eq!(runner.poll(2_499_000_000, &driving), Step::Wait);
        let (rest, first, second) = asked(runner.poll(2_500_000_000, &driving));
        assert_eq!((first, second), speeds(0.0, 0.0));
        assert_eq!(runner.poll(2_600_000_000, &driving), Step::Wait);
        assert_eq!(runner.poll(3_000_000_000, &done(&rest)), Step::Wait);
        assert_eq!((runner.poll(3_100_000_000, &done(&rest)), runner.0.target()), (Step::Wait, None));
        assert_eq!(runner.poll(3_100_000_000, &done(&rest)), Step::Finished);
    }

    #[test]
    fn moves_follow_one_another_after_their_dwell_as_often_as_asked() {
        let mut runner = Running::new(&program(2));
        let mut targets = vec![];
        let mut snapshot = done(&[]);
        for now_ms in 0..2_000 {
            if let Some((motion, begun)) = runner.begin(now_ms * 1_000_000, &snapshot) {
                targets.push((now_ms, begun.target[0]));
                snapshot = done(&[motion]);
            }
        }
        let only: Vec<f64> = targets.iter().map(|(_, target)| *target).collect();
        assert_eq!(only, [1.0, 2.0, 1.0, 2.0]);
        assert!(targets.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 100), "{targets:?}");
        assert_eq!(runner.poll(3_000_000_000, &snapshot), Step::Finished);
    }

    #[test]
    fn the_next_move_waits_for_the_present_one() {
        let mut runner = Running::new(&program(1));
        let (_, first) = runner.begin(0, &done(&[])).unwrap();
        assert_eq!((first.velocity_scale, first.acceleration_scale), (0.5, 0.25));
        let moving = Snapshot { phase: Phase::Moving, ..done(&[]) };
        for now_s in 0..100 {
            assert_eq!(runner.poll(now_s * 1_000_000_000, &moving), Step::Wait);
        }
    }

    #[test]
    fn a_refused_move_ends_the_program_with_its_number_and_why() {
        let mut runner = Running::new(&program(1));
        let (asked, _) = runner.begin(0, &done(&[])).unwrap();
        assert_eq!(
            runner.poll(1, &rejecting(&[asked])),
            Step::Refused { number: 1, refusal: Some(REJECTED) }
        );
        assert_eq!(runner.poll(2, &rejecting(&[asked])), Step::Finished);
    }

    #[test]
    fn what_is_refused_to_somebody_else_is_not_the_program_s() {
        let mut runner = Running::new(&program(1));
        let before = runner.1.next();
        let (asked, _) = runner.begin(0, &done(&[])).unwrap();
        let others = [before, runner.1.next(), runner.1.next()];
        assert_eq!(runner.poll(1, &rejecting(&others)), Step::Wait);
        let finished = Snapshot { motions: done(&[asked]).motions, ..rejecting(&others) };
        assert_eq!(runner.poll(2, &finished), Step::Wait);
        assert!(runner.begin(200_000_000, &finished).is_none());
        assert!(runner.begin(200_000_001, &finished).is_some_and(|(next, _)| next > asked));
    }

    #[test]
    fn a_program_without_moves_is_finished_at_once() {
        assert_eq!(Running::new(&Program::default()).poll(0, &done(&[])), Step::Finished);
    }
}
