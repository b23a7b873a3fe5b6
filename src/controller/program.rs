//! The motion program: which move is next, and when.

use takt_rt::door::{Move, Snapshot};
use takt_rt::record::MAX_AXES;
use takt_rt::stop::Phase;

use crate::config::{Program, ProgramMove};

/// Runs through the moves of a configuration, one at a time.
#[derive(Clone, Debug)]
pub struct ProgramRunner {
    moves: Vec<ProgramMove>,
    /// Times that the list is run; `None` for ever.
    repeat: Option<u64>,
    /// Moves begun so far.
    begun: u64,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Next,
    Moving { refused_before: u64 },
    Dwelling { until_ns: u64 },
    Finished,
}

/// What the program wants now.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Nothing but time.
    Wait,
    /// This move.
    Begin(Box<Move>),
    /// The real-time thread has refused the move with this number, counted from 1.
    Refused(u64),
    /// Everything has been done.
    Finished,
}

impl ProgramRunner {
    /// A program from its beginning; `endless` repeats it until somebody stops it.
    pub fn new(program: &Program, endless: bool) -> Self {
        let repeat = (!endless).then(|| u64::from(program.repeat.max(1)));
        let state = if program.moves.is_empty() { State::Finished } else { State::Next };
        Self { moves: program.moves.clone(), repeat, begun: 0, state }
    }

    /// Takes the state of the group and says what is to happen.
    pub fn poll(&mut self, now_ns: u64, snapshot: &Snapshot) -> Step {
        match self.state {
            State::Finished => Step::Finished,
            State::Next if self.repeat.is_some_and(|times| self.begun >= times * self.moves.len() as u64) => {
                self.state = State::Finished;
                Step::Finished
            }
            State::Next => {
                self.state = State::Moving { refused_before: snapshot.refused };
                self.begun += 1;
                Step::Begin(Box::new(self.present_move()))
            }
            State::Moving { refused_before } if snapshot.refused > refused_before => {
                self.state = State::Finished;
                Step::Refused(self.begun)
            }
            State::Moving { .. } => {
                let is_done = snapshot.finished_move == self.present_id() && snapshot.phase == Phase::Holding;
                if is_done {
                    let dwell_s = self.present().map_or(0.0, |present| present.dwell_s);
                    self.state = State::Dwelling { until_ns: now_ns + (dwell_s * 1e9) as u64 };
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

    fn present(&self) -> Option<&ProgramMove> {
        let count = self.moves.len() as u64;
        self.moves.get((self.begun.saturating_sub(1) % count.max(1)) as usize)
    }

    fn present_id(&self) -> u32 {
        // Never 0, which stands for "none yet".
        (self.begun % u64::from(u32::MAX)) as u32 + 1
    }

    fn present_move(&self) -> Move {
        let mut target = [0.0; MAX_AXES];
        let (mut velocity_scale, mut acceleration_scale, mut minimum_duration_s) = (1.0, 1.0, 0.0);
        if let Some(present) = self.present() {
            target.iter_mut().zip(&present.target).for_each(|(to, from)| *to = *from);
            velocity_scale = present.velocity_scale;
            acceleration_scale = present.acceleration_scale;
            minimum_duration_s = present.minimum_duration_s;
        }
        Move {
            id: self.present_id(),
            target,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale,
            acceleration_scale,
            minimum_duration_s,
        }
    }

    /// Where the present move leads (rad or m), an axis each; `None` before the first.
    pub fn target(&self) -> Option<&[f64]> {
        if self.begun == 0 { None } else { self.present().map(|present| present.target.as_slice()) }
    }

    /// Moves begun, and how many there are in all if that is known.
    pub fn progress(&self) -> (u64, Option<u64>) {
        (self.begun, self.repeat.map(|times| times * self.moves.len() as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(repeat: u32) -> Program {
        let to = |target: f64| ProgramMove {
            target: vec![target],
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

    fn begin(runner: &mut ProgramRunner, now_ns: u64, snapshot: &Snapshot) -> Option<Box<Move>> {
        match runner.poll(now_ns, snapshot) {
            Step::Begin(begun) => Some(begun),
            _ => None,
        }
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
