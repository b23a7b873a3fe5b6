//! The life of a drive that is spoken to by bit fields: how it is started without a jump, changed, and stopped.
//!
//! Such a drive has no state machine that it would show: at most whether it has torque. So each step is taken when the drive has replied
//! to the one before.
//!
//! | state | what is sent | next state, by a reply |
//! | --- | --- | --- |
//! | Stopping | stop | Stopped, unless the drive shows torque |
//! | Stopped | a command without torque, at the actual position; stop, where that is a frame of its own | |
//! | Choosing | the mode: in a command as in Stopped, or in a frame of its own | Aligning, with or without a reply |
//! | Aligning | a command without torque, at the actual position | Starting |
//! | Starting | start, at the actual position | Running, unless the drive shows no torque |
//! | Running | the set-points | Stopping, if the drive shows no torque |
//! | Changing | a command that does no harm in the next mode either; the frame of that mode follows | Stopping, if the drive shows no torque |
//! | Telling | zero, or clear | Told |
//! | Told | as in Stopped, until something else is wanted | |
//!
//! A reply may be late and answer a frame before, or be corrupted. A drive has stopped when eight replies in a row have not shown torque
//! while it was told to stop.
//!
//! Where anything but running is wanted, a drive is stopped first. In every cycle exactly one frame is sent.
//!
//! A running drive that is told its mode by a frame of its own takes it with the numbers of its last command, which mean something else in
//! that mode: the most velocity that it may use for a position becomes a velocity to go at. Hence the state Changing.

use crate::frame::{Frame, Id};

/// How a drive is told to start, to stop, and so on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum LifeCycle {
    /// By the fields `Run`, `Mode` and `Zero` of its command.
    ByFields {
        /// The codes of the modes.
        modes: ModeCodes,
    },
    /// By frames of their own, each in the place of a cycle's command.
    ByFrames(OwnFrames),
}

/// The codes of the modes in the field `Mode` of a command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct ModeCodes {
    /// Torque.
    pub torque: u8,
    /// Velocity.
    pub velocity: u8,
    /// Position.
    pub position: u8,
}

impl LifeCycle {
    /// Returns `true` if the drive is told its mode.
    pub(crate) fn has_modes(&self) -> bool {
        match self {
            Self::ByFields { modes } => modes.torque != modes.position || modes.velocity != modes.position,
            Self::ByFrames(OwnFrames { torque, velocity, position, .. }) => {
                [torque, velocity, position].into_iter().flatten().count() > 1
            }
        }
    }
}

impl ModeCodes {
    /// The mode with this code.
    pub fn mode(&self, code: f64) -> Option<FieldMode> {
        let Self { torque, velocity, position } = *self;
        let modes =
            [(position, FieldMode::Position), (velocity, FieldMode::Velocity), (torque, FieldMode::Torque)];
        modes.into_iter().find(|(own, _)| f64::from(*own) == code).map(|(_, mode)| mode)
    }
}

/// A frame that is always the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct OwnFrame {
    /// The identifier.
    pub id: Id,
    /// The payload: eight bytes of a classic frame.
    pub payload: [u8; 8],
}

/// The frames of [`LifeCycle::ByFrames`]. A drive without one of the optional ones has no such function, or needs no frame for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct OwnFrames {
    /// The drive gets torque, and follows the last command.
    pub start: OwnFrame,
    /// The drive has no torque.
    pub stop: OwnFrame,
    /// The present position becomes zero.
    pub zero: Option<OwnFrame>,
    /// Faults are cleared.
    pub clear: Option<OwnFrame>,
    /// Torque mode.
    pub torque: Option<OwnFrame>,
    /// Velocity mode.
    pub velocity: Option<OwnFrame>,
    /// Position mode.
    pub position: Option<OwnFrame>,
}

/// What a running drive follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum FieldMode {
    /// The torque.
    Torque,
    /// The velocity.
    Velocity,
    /// The position.
    Position,
}

/// Where a drive is to be led.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifeWish {
    /// It has no torque.
    Stop,
    /// It follows set-points in this mode. A running drive takes another mode at once: the caller sees to it that the joint stands.
    Run(FieldMode),
    /// The present position becomes zero, once; without torque.
    Zero,
    /// Faults are cleared, once; without torque.
    Clear,
}

/// What is told to a drive once, without torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Setting {
    /// The present position becomes zero.
    Zero,
    /// Faults are cleared.
    Clear,
}

/// How far a drive is. The module documentation has the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum LifeState {
    /// It is told to stop: whether it has torque is not known.
    #[default]
    Stopping,
    /// It has no torque.
    Stopped,
    /// It is told this mode.
    Choosing(FieldMode),
    /// Its target is brought to the actual position, in this mode.
    Aligning(FieldMode),
    /// It is told to start in this mode.
    Starting(FieldMode),
    /// It follows set-points in this mode.
    Running(FieldMode),
    /// It runs in a mode, and is about to be told another one by a frame of its own.
    Changing {
        /// The mode that it runs in.
        from: FieldMode,
        /// The mode that it is told next.
        to: FieldMode,
    },
    /// It is told this.
    Telling(Setting),
    /// It has been told this.
    Told(Setting),
}

/// The one frame that a drive is sent in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifeStep {
    /// The command with these fields.
    Command {
        /// The field `Run`.
        run: bool,
        /// The field `Zero`.
        zero: bool,
        /// The field `Mode`.
        mode: u8,
        /// What its targets are.
        targets: CommandTargets,
    },
    /// A frame of its own.
    Own(Frame),
}

/// The targets of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandTargets {
    /// Rest at the actual position.
    Rest,
    /// The set-points.
    SetPoints,
    /// The set-points at standstill, with numbers that do no harm in this mode either.
    Before(FieldMode),
}

/// The life of one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Life {
    state: LifeState,
    /// Replies in a row that do not show torque, while it is told to stop.
    stop_replies: u8,
}

/// Replies to a stop of which the last cannot be that to a frame before it: more than can wait for a bus. One that is behind for longer
/// gets no more frames.
const STOP_REPLIES: u8 = 8;

impl Life {
    /// How far the drive is.
    pub const fn state(&self) -> LifeState {
        self.state
    }

    /// Takes a reply to the frame of the last cycle. `has_torque` where the drive shows it.
    pub fn receive(&mut self, has_torque: Option<bool>) {
        self.state = match (self.state, has_torque) {
            // One reply may be corrupted, or be that to an older frame.
            (LifeState::Stopping, Some(false) | None) => {
                self.stop_replies = self.stop_replies.saturating_add(1);
                if self.stop_replies < STOP_REPLIES { LifeState::Stopping } else { LifeState::Stopped }
            }
            (LifeState::Aligning(mode), Some(false) | None) => LifeState::Starting(mode),
            (LifeState::Starting(mode), Some(true) | None) => LifeState::Running(mode),
            // It has taken its torque away by itself.
            (LifeState::Running(_) | LifeState::Changing { .. }, Some(false)) => LifeState::Stopping,
            (LifeState::Stopping, Some(true)) => {
                self.stop_replies = 0;
                LifeState::Stopping
            }
            (state @ (LifeState::Starting(_) | LifeState::Running(_) | LifeState::Changing { .. }), _) => {
                state
            }
            // It has torque though it is to have none.
            (_, Some(true)) => LifeState::Stopping,
            (LifeState::Telling(setting), _) => LifeState::Told(setting),
            (state, _) => state,
        };
    }

    /// What the drive is sent in this cycle.
    pub fn step(&mut self, wish: LifeWish, by: &LifeCycle) -> LifeStep {
        let before = self.state;
        self.state = match by {
            LifeCycle::ByFields { .. } => next(before, wish),
            LifeCycle::ByFrames(_) => before_frame_of_mode(before, next(before, wish)),
        };
        if before != LifeState::Stopping {
            self.stop_replies = 0;
        }
        match by {
            LifeCycle::ByFields { modes } => step_by_fields(self.state, modes),
            LifeCycle::ByFrames(frames) => step_by_frames(before, self.state, frames),
        }
    }
}

/// What a wish makes of a state.
fn next(state: LifeState, wish: LifeWish) -> LifeState {
    match (state, wish) {
        (LifeState::Stopping, _) => state,
        (LifeState::Choosing(mode), LifeWish::Run(wanted)) if mode == wanted => LifeState::Aligning(mode),
        (LifeState::Aligning(mode), LifeWish::Run(wanted)) if mode == wanted => state,
        (LifeState::Starting(_), LifeWish::Run(_)) => state,
        (LifeState::Running(_) | LifeState::Changing { .. }, LifeWish::Run(mode)) => LifeState::Running(mode),
        (LifeState::Starting(_) | LifeState::Running(_) | LifeState::Changing { .. }, _) => {
            LifeState::Stopping
        }
        (LifeState::Telling(Setting::Zero), LifeWish::Zero) => state,
        (LifeState::Telling(Setting::Clear), LifeWish::Clear) => state,
        (LifeState::Told(Setting::Zero), LifeWish::Zero) => state,
        (LifeState::Told(Setting::Clear), LifeWish::Clear) => state,
        (_, LifeWish::Stop) => LifeState::Stopped,
        (_, LifeWish::Run(mode)) => LifeState::Choosing(mode),
        (_, LifeWish::Zero) => LifeState::Telling(Setting::Zero),
        (_, LifeWish::Clear) => LifeState::Telling(Setting::Clear),
    }
}

/// The state before a running drive is told another mode by a frame of its own. The torque of torque mode is one to hold the joint with in
/// each mode.
fn before_frame_of_mode(before: LifeState, next: LifeState) -> LifeState {
    match (before, next) {
        (LifeState::Running(from), LifeState::Running(to)) if from != to && from != FieldMode::Torque => {
            LifeState::Changing { from, to }
        }
        (LifeState::Changing { from, to }, LifeState::Running(wanted)) if wanted != to && wanted != from => {
            LifeState::Changing { from, to: wanted }
        }
        _ => next,
    }
}

const fn step_by_fields(state: LifeState, modes: &ModeCodes) -> LifeStep {
    let (mode, run) = match state {
        LifeState::Choosing(mode) | LifeState::Aligning(mode) => (mode, false),
        LifeState::Starting(mode) | LifeState::Running(mode) => (mode, true),
        _ => (FieldMode::Position, false),
    };
    let code = match mode {
        FieldMode::Torque => modes.torque,
        FieldMode::Velocity => modes.velocity,
        FieldMode::Position => modes.position,
    };
    LifeStep::Command {
        run,
        zero: matches!(state, LifeState::Telling(Setting::Zero)),
        mode: code,
        targets: targets(state),
    }
}

/// The targets of a command in a state.
const fn targets(state: LifeState) -> CommandTargets {
    match state {
        LifeState::Running(_) => CommandTargets::SetPoints,
        LifeState::Changing { to, .. } => CommandTargets::Before(to),
        _ => CommandTargets::Rest,
    }
}

fn step_by_frames(before: LifeState, state: LifeState, frames: &OwnFrames) -> LifeStep {
    let new_mode = match (before, state) {
        (_, LifeState::Choosing(mode)) => Some(mode),
        (LifeState::Running(old) | LifeState::Changing { from: old, .. }, LifeState::Running(mode))
            if old != mode =>
        {
            Some(mode)
        }
        _ => None,
    };
    let own = match (state, new_mode) {
        // Again and again: such a drive does not show that it has obeyed.
        (LifeState::Stopping | LifeState::Stopped | LifeState::Told(_), _) => Some(frames.stop),
        (LifeState::Starting(_), _) => Some(frames.start),
        (LifeState::Telling(Setting::Zero), _) => frames.zero,
        (LifeState::Telling(Setting::Clear), _) => frames.clear,
        (_, Some(FieldMode::Torque)) => frames.torque,
        (_, Some(FieldMode::Velocity)) => frames.velocity,
        (_, Some(FieldMode::Position)) => frames.position,
        _ => None,
    };
    let targets = targets(state);
    let command = LifeStep::Command { run: targets != CommandTargets::Rest, zero: false, mode: 0, targets };
    own.map_or(command, |own| LifeStep::Own(Frame::of(own.id, own.payload)))
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const BY_FIELDS: LifeCycle =
        LifeCycle::ByFields { modes: ModeCodes { torque: 0, velocity: 1, position: 2 } };
    const RUN: LifeWish = LifeWish::Run(FieldMode::Position);

    fn own(last: u8) -> OwnFrame {
        OwnFrame { id: Id::canopen(0, 1), payload: [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] }
    }

    fn by_frames() -> LifeCycle {
        LifeCycle::ByFrames(OwnFrames {
            start: own(0xFC),
            stop: own(0xFD),
            zero: Some(own(0xFE)),
            clear: None,
            torque: Some(own(0xF9)),
            velocity: Some(own(0xFA)),
            position: Some(own(0xFB)),
        })
    }

    /// Each step in a few letters: the last byte of a frame of its own, or the fields of a command.
    fn letters(step: LifeStep) -> std::string::String {
        match step {
            LifeStep::Own(frame) => std::format!("{:02X}", frame.payload()[7]),
            LifeStep::Command { run, zero, mode, targets } => {
                let (run, zero) = (u8::from(run), u8::from(zero));
                let targets = match targets {
                    CommandTargets::Rest => "rest",
                    CommandTargets::SetPoints => "set",
                    CommandTargets::Before(FieldMode::Torque) => "before F9",
                    CommandTargets::Before(FieldMode::Velocity) => "before FA",
                    CommandTargets::Before(FieldMode::Position) => "before FB",
                };
                std::format!("run={run} zero={zero} mode={mode} {targets}")
            }
        }
    }

    /// The steps of a life in which each is answered at once, by a drive that shows its state or does not.
    fn answered(
        life: &mut Life,
        by: &LifeCycle,
        shows: bool,
        wishes: &[LifeWish],
    ) -> Vec<std::string::String> {
        let steps = wishes.iter().map(|wish| {
            let step = life.step(*wish, by);
            let has_torque = matches!(step, LifeStep::Command { run: true, .. });
            life.receive(shows.then_some(has_torque));
            letters(step)
        });
        steps.collect()
    }

    #[test]
    fn a_drive_is_started_by_its_fields_only_with_its_target_at_its_position() {
        let mut life = Life::default();
        let steps = answered(&mut life, &BY_FIELDS, true, &[RUN; 13]);
        let rest = "run=0 zero=0 mode=2 rest";
        assert_eq!(steps[..10], [rest; 10]);
        let (start, set) = ("run=1 zero=0 mode=2 rest", "run=1 zero=0 mode=2 set");
        assert_eq!(steps[10..], [start, set, set]);
        let stopped = answered(&mut life, &BY_FIELDS, true, &[LifeWish::Stop; 9]);
        assert_eq!((stopped, life.state()), ([rest; 9].map(Into::into).to_vec(), LifeState::Stopped));
    }

    #[test]
    fn a_drive_is_started_by_frames_of_its_own_after_a_command_at_its_position() {
        let mut life = Life::default();
        let steps = answered(&mut life, &by_frames(), false, &[RUN; 13]);
        let (rest, set) = ("run=0 zero=0 mode=0 rest", "run=1 zero=0 mode=0 set");
        assert_eq!(steps[..8], ["FD"; 8]);
        assert_eq!(steps[8..], ["FB", rest, "FC", set, set]);
        assert_eq!(answered(&mut life, &by_frames(), false, &[LifeWish::Stop; 12]), ["FD"; 12]);
        assert_eq!(life.state(), LifeState::Stopped);
    }

    #[test]
    fn a_running_drive_is_told_another_mode_by_a_frame_after_a_command_that_does_no_harm_in_it() {
        let [torque, velocity] = [FieldMode::Torque, FieldMode::Velocity].map(LifeWish::Run);
        let set = "run=1 zero=0 mode=0 set";
        let mut life = Life::default();
        answered(&mut life, &by_frames(), false, &[RUN; 13]);
        let mut told = |wishes: &[LifeWish]| answered(&mut life, &by_frames(), false, wishes);
        assert_eq!(told(&[velocity; 3]), ["run=1 zero=0 mode=0 before FA", "FA", set]);
        // The wish changes, or is taken back, before the frame has left.
        let (before_torque, before_position) =
            ("run=1 zero=0 mode=0 before F9", "run=1 zero=0 mode=0 before FB");
        assert_eq!(told(&[RUN, torque, torque, torque]), [before_position, before_torque, "F9", set]);
        // What is told in torque mode does no harm in any other.
        assert_eq!(told(&[velocity; 2]), ["FA", set]);
        assert_eq!(told(&[torque, velocity]), [before_torque, set]);
        assert_eq!(told(&[torque, LifeWish::Stop]), [before_torque, "FD"]);
        assert_eq!(life.state(), LifeState::Stopping);
    }

    #[test]
    fn a_drive_that_is_told_its_mode_in_each_command_changes_it_at_once() {
        let mut life = Life::default();
        answered(&mut life, &BY_FIELDS, true, &[RUN; 13]);
        let velocity = LifeWish::Run(FieldMode::Velocity);
        assert_eq!(answered(&mut life, &BY_FIELDS, true, &[velocity]), ["run=1 zero=0 mode=1 set"]);
    }

    #[test]
    fn a_drive_counts_as_stopped_only_when_replies_in_a_row_have_not_shown_torque() {
        let mut life = Life::default();
        for torque in [false, false, true, false, false, false, false, false, false, false] {
            life.step(LifeWish::Stop, &BY_FIELDS);
            life.receive(Some(torque));
            assert_eq!(life.state(), LifeState::Stopping);
        }
        life.step(LifeWish::Stop, &BY_FIELDS);
        life.receive(Some(false));
        assert_eq!(life.state(), LifeState::Stopped);
    }

    #[test]
    fn a_drive_that_does_not_reply_is_told_to_stop_for_ever() {
        for by in [BY_FIELDS, by_frames()] {
            let mut life = Life::default();
            for _ in 0..100 {
                assert!(!matches!(life.step(RUN, &by), LifeStep::Command { run: true, .. }));
                assert_eq!(life.state(), LifeState::Stopping);
            }
        }
    }

    #[test]
    fn a_drive_that_takes_its_torque_away_by_itself_gets_no_further_set_point() {
        let mut life = Life::default();
        answered(&mut life, &BY_FIELDS, true, &[RUN; 13]);
        assert_eq!(life.state(), LifeState::Running(FieldMode::Position));
        life.step(RUN, &BY_FIELDS);
        life.receive(Some(false));
        assert_eq!(letters(life.step(RUN, &BY_FIELDS)), "run=0 zero=0 mode=2 rest");
    }

    #[test]
    fn zero_is_told_once_and_taken_back_and_only_to_a_drive_that_has_stopped() {
        let mut life = Life::default();
        answered(&mut life, &BY_FIELDS, true, &[RUN; 13]);
        let steps = answered(&mut life, &BY_FIELDS, true, &[LifeWish::Zero; 12]);
        let rest = "run=0 zero=0 mode=2 rest";
        let zeroed = steps.iter().position(|step| step == "run=0 zero=1 mode=2 rest");
        assert_eq!((zeroed, steps.iter().filter(|step| *step == rest).count()), (Some(8), 11));
        // It is told again where the first time is not answered.
        let mut life = Life::default();
        answered(&mut life, &by_frames(), false, &[LifeWish::Stop; 9]);
        let told = [0; 3].map(|_| letters(life.step(LifeWish::Zero, &by_frames())));
        assert_eq!(told, ["FE"; 3]);
    }

    proptest! {
        #[test]
        fn whatever_is_wanted_and_replied_torque_follows_a_command_at_rest_and_set_points_follow_torque(
            cycles in prop::collection::vec((0..6u8, prop::option::of(prop::option::of(any::<bool>()))), 1..200),
            has_own_frames in any::<bool>(),
        ) {
            let by = if has_own_frames { by_frames() } else { BY_FIELDS };
            let (mut life, mut is_aligned, mut may_have_torque) = (Life::default(), false, false);
            for (wish, reply) in cycles {
                let wish = match wish {
                    0 => LifeWish::Stop,
                    1 => LifeWish::Zero,
                    2 => LifeWish::Clear,
                    3 => LifeWish::Run(FieldMode::Torque),
                    _ => RUN,
                };
                let step = letters(life.step(wish, &by));
                let starts = step == "FC" || step.starts_with("run=1") && step.ends_with("rest");
                if starts {
                    prop_assert!(is_aligned && matches!(wish, LifeWish::Run(_)), "{}", step);
                    may_have_torque = true;
                }
                if step.ends_with("set") {
                    prop_assert!(may_have_torque && matches!(wish, LifeWish::Run(_)), "{}", step);
                }
                if step == "FE" || step.contains("zero=1") {
                    prop_assert!(!may_have_torque && wish == LifeWish::Zero);
                }
                // By fields, a command without run takes the torque away.
                let is_stopped = if has_own_frames { step == "FD" } else { step.starts_with("run=0") };
                may_have_torque &= !is_stopped;
                is_aligned = starts || step.starts_with("run=0") && step.ends_with("rest");
                if let Some(has_torque) = reply {
                    life.receive(has_torque);
                }
            }
        }
    }
}
