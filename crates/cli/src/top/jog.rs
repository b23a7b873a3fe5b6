//! The dead-man of a jog: an axis moves while a key is held, as far as a terminal tells that.
//!
//! A terminal tells of no release, only of repeats. So a first press moves nothing, the first repeat begins the motion, and the motion ends when
//! no repeat has come for [`HELD_NS`]. A key that is struck by mistake moves nothing.

use takt_rt::Nanoseconds;

/// The motion ends so long after the last repeat of its key. Keyboards repeat every 20 to 100 ms.
pub const HELD_NS: Nanoseconds = 200_000_000;
/// A repeat comes within this time of the press: keyboards wait for 250 to 660 ms.
const FIRST_REPEAT_NS: Nanoseconds = 1_000_000_000;
/// From one velocity to the next one.
const INTERVAL_NS: Nanoseconds = 40_000_000;
/// For so long the controller is told to be at rest after the end.
const REST_NS: Nanoseconds = 200_000_000;

/// Which axis, and to which side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wish {
    /// The axis.
    pub axis: usize,
    /// To larger positions, or to smaller ones.
    pub is_positive: bool,
}

/// What the jog wants of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JogStep {
    /// The axis is about to be moved.
    Begin(Wish),
    /// The axis is to move, for one interval more.
    Move(Wish),
    /// The axis is to come to rest.
    Rest(Wish),
}

/// How far the jog is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Jog {
    /// No key is held.
    #[default]
    Off,
    /// A key was pressed, and may be held.
    Pressed {
        /// What it is for.
        wish: Wish,
        /// When.
        at_ns: Nanoseconds,
    },
    /// The key is held.
    Moving {
        /// What it is for.
        wish: Wish,
        /// When it was last repeated.
        key_ns: Nanoseconds,
        /// When the next velocity is due.
        next_ns: Nanoseconds,
    },
    /// The key is no longer held, and the axis comes to rest.
    Resting {
        /// What it was for.
        wish: Wish,
        /// Until when the controller is told so.
        until_ns: Nanoseconds,
        /// When it is told next.
        next_ns: Nanoseconds,
    },
}

impl Jog {
    /// What is being moved.
    pub const fn moving(&self) -> Option<Wish> {
        match self {
            Self::Moving { wish, .. } => Some(*wish),
            _ => None,
        }
    }

    /// A key of the jog comes, for the first time or again.
    pub fn key(&mut self, now_ns: Nanoseconds, wish: Wish) -> Vec<JogStep> {
        match *self {
            Self::Pressed { wish: pressed, at_ns }
                if pressed == wish && now_ns - at_ns <= FIRST_REPEAT_NS =>
            {
                *self = Self::Moving { wish, key_ns: now_ns, next_ns: now_ns + INTERVAL_NS };
                vec![JogStep::Begin(wish), JogStep::Move(wish)]
            }
            Self::Moving { wish: moving, next_ns, .. } if moving == wish => {
                *self = Self::Moving { wish, key_ns: now_ns, next_ns };
                vec![]
            }
            _ => {
                let steps = self.end(now_ns);
                *self = Self::Pressed { wish, at_ns: now_ns };
                steps
            }
        }
    }

    /// Ends the motion, because of another key, a stop, or a lost lease.
    pub fn end(&mut self, now_ns: Nanoseconds) -> Vec<JogStep> {
        match *self {
            Self::Moving { wish, .. } => {
                *self = Self::Resting { wish, until_ns: now_ns + REST_NS, next_ns: now_ns + INTERVAL_NS };
                vec![JogStep::Rest(wish)]
            }
            Self::Pressed { .. } => {
                *self = Self::Off;
                vec![]
            }
            Self::Off | Self::Resting { .. } => vec![],
        }
    }

    /// Ends it without a word to the controller, which has been told something stronger, or is gone.
    pub fn forget(&mut self) {
        *self = Self::Off;
    }

    /// Time passes.
    pub fn pass(&mut self, now_ns: Nanoseconds) -> Vec<JogStep> {
        match *self {
            Self::Moving { key_ns, .. } if now_ns.saturating_sub(key_ns) > HELD_NS => self.end(now_ns),
            Self::Moving { wish, key_ns, next_ns } if now_ns >= next_ns => {
                *self = Self::Moving { wish, key_ns, next_ns: now_ns + INTERVAL_NS };
                vec![JogStep::Move(wish)]
            }
            Self::Resting { until_ns, .. } if now_ns >= until_ns => {
                *self = Self::Off;
                vec![]
            }
            Self::Resting { wish, until_ns, next_ns } if now_ns >= next_ns => {
                *self = Self::Resting { wish, until_ns, next_ns: now_ns + INTERVAL_NS };
                vec![JogStep::Rest(wish)]
            }
            Self::Pressed { at_ns, .. } if now_ns.saturating_sub(at_ns) > FIRST_REPEAT_NS => {
                *self = Self::Off;
                vec![]
            }
            _ => vec![],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const UP: Wish = Wish { axis: 1, is_positive: true };
    const DOWN: Wish = Wish { axis: 1, is_positive: false };

    /// The steps of a jog in virtual time: keys at these times, a look every 10 ms.
    fn steps(keys: &[(u64, Wish)], until_ms: u64) -> Vec<(u64, JogStep)> {
        let (mut jog, mut steps) = (Jog::default(), vec![]);
        for ms in (0..=until_ms).step_by(10) {
            let mut now = vec![];
            for (_, wish) in keys.iter().filter(|(at, _)| *at == ms) {
                now.extend(jog.key(ms * MS, *wish));
            }
            now.extend(jog.pass(ms * MS));
            steps.extend(now.into_iter().map(|step| (ms, step)));
        }
        steps
    }

    #[test]
    fn a_single_press_moves_nothing() {
        assert_eq!(steps(&[(0, UP)], 3_000), []);
        assert_eq!(steps(&[(0, UP), (1_500, UP)], 3_000), [], "two presses far apart are not a held key");
    }

    #[test]
    fn a_held_key_moves_from_its_first_repeat_until_200_ms_after_its_last_one() {
        let keys: Vec<_> = [0, 500, 530, 560, 590, 620].map(|ms| (ms, UP)).into();
        let steps = steps(&keys, 3_000);
        assert_eq!(steps[..2], [(500, JogStep::Begin(UP)), (500, JogStep::Move(UP))]);
        let moves: Vec<u64> =
            steps.iter().filter(|(_, step)| *step == JogStep::Move(UP)).map(|(ms, _)| *ms).collect();
        assert!(moves.windows(2).all(|pair| pair[1] - pair[0] == 40), "{moves:?}");
        assert!(moves.last().is_some_and(|last| (780..=820).contains(last)), "{moves:?}");
        let rests: Vec<u64> =
            steps.iter().filter(|(_, step)| *step == JogStep::Rest(UP)).map(|(ms, _)| *ms).collect();
        assert_eq!((rests[0], rests.len()), (830, 5), "{rests:?}");
    }

    #[test]
    fn the_other_direction_ends_the_motion_first_and_begins_with_its_own_repeat() {
        let steps = steps(&[(0, UP), (100, UP), (150, DOWN), (200, DOWN)], 220);
        assert_eq!(
            steps,
            [
                (100, JogStep::Begin(UP)),
                (100, JogStep::Move(UP)),
                (140, JogStep::Move(UP)),
                (150, JogStep::Rest(UP)),
                (200, JogStep::Begin(DOWN)),
                (200, JogStep::Move(DOWN)),
            ]
        );
    }

    #[test]
    fn what_was_told_to_rest_is_not_moved_by_a_single_later_key() {
        let mut jog = Jog::default();
        jog.key(0, UP);
        jog.key(50 * MS, UP);
        assert_eq!(jog.end(60 * MS), [JogStep::Rest(UP)]);
        assert_eq!(jog.end(61 * MS), [], "it is told only once that it ends");
        assert_eq!(jog.key(70 * MS, UP), [], "a press after the end is a first one");
        assert_eq!(jog.moving(), None);
    }
}
