//! The motion program: which move is next, and when.

use takt_rt::door::{Move, ProfileMove, Request, Snapshot};
use takt_rt::profile::ProfileTarget;
use takt_rt::record::MAX_AXES;
use takt_rt::stop::Phase;

use crate::config::{Program, ProgramMove, ProgramTarget};

/// Runs through the moves of a configuration, one at a time.
#[derive(Clone, Debug)]
pub struct ProgramRunner {
    moves: Vec<ProgramMove>,
    /// Times that the list is run; `None` for ever.
    repeat: Option<u64>,
    /// Moves begun so far.
    begun: u64,
    /// The number of the last request.
    last_id: u32,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Next,
    Moving {
        refused_before: u64,
    },
    /// Drives go at a speed, or push with a torque.
    Driving {
        until_ns: u64,
    },
    Stopping {
        refused_before: u64,
    },
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
    Begin(Vec<Request>),
    /// The real-time thread has refused the move with this number, counted from 1.
    Refused(u64),
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
        Self { moves: program.moves.clone(), repeat, begun: 0, last_id: 0, state }
    }

    /// Takes the state of the group and says what is to happen.
    pub fn poll(&mut self, now_ns: u64, snapshot: &Snapshot) -> Step {
        let is_reached = snapshot.finished_move == self.last_id;
        let is_done = is_reached && snapshot.phase == Phase::Holding;
        match self.state {
            State::Finished => Step::Finished,
            State::Next if self.repeat.is_some_and(|times| self.begun >= times * self.moves.len() as u64) => {
                self.state = State::Finished;
                Step::Finished
            }
            State::Next => {
                self.begun += 1;
                self.state = State::Moving { refused_before: snapshot.refused };
                Step::Begin(self.present_requests(now_ns, 1.0))
            }
            State::Moving { refused_before } | State::Stopping { refused_before }
                if snapshot.refused > refused_before =>
            {
                self.state = State::Finished;
                Step::Refused(self.begun)
            }
            State::Moving { .. } => {
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
                self.state = State::Stopping { refused_before: snapshot.refused };
                Step::Begin(self.present_requests(now_ns, 0.0))
            }
            State::Driving { .. } => Step::Wait,
            State::Stopping { .. } => {
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

    /// The requests of the present move, its speeds and torques times `factor`, under a number of their own.
    fn present_requests(&mut self, now_ns: u64, factor: f64) -> Vec<Request> {
        // Never 0, which stands for "none yet".
        self.last_id = self.last_id.checked_add(1).unwrap_or(1);
        let (id, duration_ns) = (self.last_id, self.present_duration_ns().unwrap_or(0));
        let valid_until_ns = now_ns + duration_ns + REACHING_NS + EXPIRY_NS;
        let Some(present) = self.present() else { return vec![] };
        let drive = |values: &[f64], target: fn(f64) -> ProfileTarget| {
            let axes = (0..).zip(values).filter(|(_, value)| **value != 0.0);
            axes.map(|(axis, value)| {
                let target = target(value * factor);
                Request::SetProfileTarget(ProfileMove { id, axis, target, valid_until_ns })
            })
            .collect()
        };
        match &present.target {
            ProgramTarget::Position(position) => vec![Request::Move(move_of(id, present, position))],
            ProgramTarget::Velocity { velocity, .. } => drive(velocity, ProfileTarget::Velocity),
            ProgramTarget::Torque { torque, .. } => drive(torque, ProfileTarget::Torque),
        }
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

fn move_of(id: u32, present: &ProgramMove, position: &[f64]) -> Move {
    let mut target = [0.0; MAX_AXES];
    target.iter_mut().zip(position).for_each(|(to, from)| *to = *from);
    Move {
        id,
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

    fn done(id: u32) -> Snapshot {
        Snapshot { phase: Phase::Holding, finished_move: id, ..Snapshot::default() }
    }

    fn begin(runner: &mut ProgramRunner, now_ns: u64, snapshot: &Snapshot) -> Option<Move> {
        match runner.poll(now_ns, snapshot) {
            Step::Begin(requests) => match requests[..] {
                [Request::Move(begun)] => Some(begun),
                _ => panic!("{requests:?}"),
            },
            _ => None,
        }
    }

    #[test]
    fn a_speed_is_held_for_its_time_and_then_set_to_zero() {
        let target = ProgramTarget::Velocity { velocity: vec![0.0, 0.5], duration_s: 2.0 };
        let spin = ProgramMove { target, ..program(1).moves[0].clone() };
        let mut runner = ProgramRunner::new(&Program { repeat: 1, moves: vec![spin] }, false);
        let asked = |step| match step {
            Step::Begin(requests) => match requests[..] {
                [Request::SetProfileTarget(wanted)] => (wanted.id, wanted.axis, wanted.target),
                _ => panic!("{requests:?}"),
            },
            step => panic!("{step:?}"),
        };
        assert_eq!(asked(runner.poll(0, &done(0))), (1, 1, ProfileTarget::Velocity(0.5)));
        let driving = Snapshot { phase: Phase::Moving, ..done(1) };
        assert_eq!(runner.poll(500_000_000, &driving), Step::Wait);
        assert_eq!(runner.poll(2_499_000_000, &driving), Step::Wait);
        assert_eq!(asked(runner.poll(2_500_000_000, &driving)), (2, 1, ProfileTarget::Velocity(0.0)));
        assert_eq!(runner.poll(2_600_000_000, &driving), Step::Wait);
        assert_eq!(runner.poll(3_000_000_000, &done(2)), Step::Wait);
        assert_eq!((runner.poll(3_100_000_000, &done(2)), runner.target()), (Step::Wait, None));
        assert_eq!(runner.poll(3_100_000_000, &done(2)), Step::Finished);
    }

    #[test]
    fn moves_follow_one_another_after_their_dwell_as_often_as_asked() {
        let mut runner = ProgramRunner::new(&program(2), false);
        let mut targets = vec![];
        let mut snapshot = done(0);
        for now_ms in 0..2_000 {
            if let Some(begun) = begin(&mut runner, now_ms * 1_000_000, &snapshot) {
                targets.push((now_ms, begun.target[0]));
                snapshot = done(begun.id);
            }
        }
        let only: Vec<f64> = targets.iter().map(|(_, target)| *target).collect();
        assert_eq!(only, [1.0, 2.0, 1.0, 2.0]);
        assert!(targets.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 100), "{targets:?}");
        assert_eq!(runner.poll(3_000_000_000, &snapshot), Step::Finished);
    }

    #[test]
    fn the_next_move_waits_for_the_present_one() {
        let mut runner = ProgramRunner::new(&program(1), false);
        let first = begin(&mut runner, 0, &done(0)).unwrap();
        assert_eq!((first.velocity_scale, first.acceleration_scale), (0.5, 0.25));
        let moving = Snapshot { phase: Phase::Moving, ..done(0) };
        for now_s in 0..100 {
            assert_eq!(runner.poll(now_s * 1_000_000_000, &moving), Step::Wait);
        }
    }

    #[test]
    fn a_refused_move_ends_the_program_with_its_number() {
        let mut runner = ProgramRunner::new(&program(1), false);
        begin(&mut runner, 0, &done(0)).unwrap();
        let refused = Snapshot { refused: 1, ..done(0) };
        assert_eq!(runner.poll(1, &refused), Step::Refused(1));
        assert_eq!(runner.poll(2, &refused), Step::Finished);
    }

    #[test]
    fn a_program_without_moves_is_finished_at_once() {
        assert_eq!(ProgramRunner::new(&Program::default(), true).poll(0, &done(0)), Step::Finished);
    }
}
