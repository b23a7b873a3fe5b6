//! What is watched over time: slots that were missed, nodes that fall silent or start anew, duplicate node IDs.

/// How often the controller has missed slots lately.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum TimingLevel {
    /// Hardly ever.
    #[default]
    Normal = 0,
    /// Often enough for an event.
    Warning = 1,
    /// So often that no stream may begin: its owner relies on every slot.
    Degraded = 2,
    /// Too often to go on.
    Unfit = 3,
}

impl TimingLevel {
    /// Every level, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Normal, Self::Warning, Self::Degraded, Self::Unfit];
}

/// When missed slots are too many: a bucket that every missed slot fills by one, and that loses one after each
/// `leak_slots` slots that were used. The leak counts slots and not time: whoever misses every second slot fills the bucket,
/// whatever the period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TimingLadder {
    /// Missed slots in the bucket from which on there is an event.
    pub warning: u32,
    /// Slots from which on no stream is begun.
    pub degraded: u32,
    /// Slots from which on the group stops.
    pub unfit: u32,
    /// Slots that were used after which one missed slot is forgiven; 0 for never.
    pub leak_slots: u32,
}

/// The bucket of a [`TimingLadder`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct LeakyBucket {
    filled: u32,
    /// Slots since the last leak.
    slots: u32,
}

impl LeakyBucket {
    /// Takes one more slot, and the slots that were missed before it or with it: 0 as a rule. Gives what is in the bucket then.
    pub fn take(&mut self, missed: u64, leak_slots: u32) -> u32 {
        if leak_slots > 0 {
            self.slots = self.slots.saturating_add(1);
            if self.slots >= leak_slots {
                self.slots = 0;
                self.filled = self.filled.saturating_sub(1);
            }
        }
        self.filled = self.filled.saturating_add(u32::try_from(missed).unwrap_or(u32::MAX));
        self.filled
    }

    /// What is in it.
    pub const fn filled(&self) -> u32 {
        self.filled
    }

    /// Forgets what was.
    pub fn empty(&mut self) {
        *self = Self::default();
    }
}

impl TimingLadder {
    /// The level that so many slots in the bucket stand for.
    pub const fn level(&self, filled: u32) -> TimingLevel {
        if filled >= self.unfit {
            TimingLevel::Unfit
        } else if filled >= self.degraded {
            TimingLevel::Degraded
        } else if filled >= self.warning {
            TimingLevel::Warning
        } else {
            TimingLevel::Normal
        }
    }
}

/// A state of a node that its heartbeat shows (CiA 301, 7.2.8.3.2.2).
pub mod node_state {
    /// It has just started.
    pub const BOOT_UP: u8 = 0;
    /// Neither process data nor SDO is taken.
    pub const STOPPED: u8 = 4;
    /// Process data flows.
    pub const OPERATIONAL: u8 = 5;
    /// SDO is taken, process data is not.
    pub const PRE_OPERATIONAL: u8 = 0x7F;
}

/// Commands of an NMT master (CiA 301, 7.2.8.2.1).
pub mod nmt_command {
    /// Enter operational.
    pub const START: u8 = 0x01;
    /// Enter stopped.
    pub const STOP: u8 = 0x02;
    /// Enter pre-operational.
    pub const ENTER_PRE_OPERATIONAL: u8 = 0x80;
    /// Restart the application.
    pub const RESET_NODE: u8 = 0x81;
    /// Restart the communication.
    pub const RESET_COMMUNICATION: u8 = 0x82;
}

/// The NMT state that a node is believed to be in, by its heartbeats and by the NMT commands of other masters. It tells which
/// services reach the node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum NmtState {
    /// The node takes process data and SDO.
    #[default]
    Operational,
    /// The node takes SDO, but no process data.
    PreOperational,
    /// As [`NmtState::PreOperational`]. The node has also lost its PDO mappings and its heartbeat consumer, so that an NMT start
    /// alone does not bring process data back.
    PreOperationalAfterReset,
    /// The node takes NMT commands only.
    Stopped,
}

/// Cycles of its bus without feedback after which a node whose NMT state is not operational counts as unreachable. Its node
/// ID in an NMT command, or its heartbeat, may have been another node's.
const UNREACHABLE_CYCLES: u16 = 2;

/// The worst that a node's own error control messages have shown since it is watched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
enum ErrorControl {
    /// The node is operational, or has said nothing.
    #[default]
    Operational,
    /// The node is in another state than operational.
    NotOperational {
        /// Which.
        state: u8,
    },
    /// The node has started anew. That remains so.
    BootedUp,
}

/// What is known of a node by its error control messages and by the NMT commands of other masters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct NodeMonitor {
    silent_cycles: u32,
    error_control: ErrorControl,
    nmt_state: NmtState,
    /// True if the node has taken no process data at some time since it is watched.
    is_pdo_unreachable: bool,
}

/// What is wrong with a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeFault {
    /// It has started anew.
    BootUp,
    /// It is in another state than operational.
    NotOperational {
        /// Which.
        state: u8,
    },
    /// It has been silent for so many cycles.
    Silent {
        /// How many.
        cycles: u32,
    },
}

impl NodeMonitor {
    /// Takes the state in an error control message.
    pub fn receive(&mut self, state: u8) {
        self.silent_cycles = 0;
        // Bit 7 toggles in answers to node guarding.
        let shown = match (state, state & 0x7F) {
            (node_state::BOOT_UP, _) => {
                self.nmt_state = NmtState::PreOperationalAfterReset;
                ErrorControl::BootedUp
            }
            (_, node_state::OPERATIONAL) => {
                self.note_start();
                ErrorControl::Operational
            }
            (_, state) => {
                if state == node_state::PRE_OPERATIONAL {
                    self.note_pre_operational();
                }
                ErrorControl::NotOperational { state }
            }
        };
        if self.error_control != ErrorControl::BootedUp {
            self.error_control = shown;
        }
    }

    /// Takes an NMT command that another master has given to the node.
    pub fn receive_foreign_nmt(&mut self, command: u8) {
        match command {
            nmt_command::START => self.note_start(),
            nmt_command::STOP => self.nmt_state = NmtState::Stopped,
            nmt_command::ENTER_PRE_OPERATIONAL => self.note_pre_operational(),
            nmt_command::RESET_NODE | nmt_command::RESET_COMMUNICATION => {
                self.nmt_state = NmtState::PreOperationalAfterReset;
            }
            _ => {}
        }
    }

    fn note_start(&mut self) {
        if self.nmt_state != NmtState::PreOperationalAfterReset {
            self.nmt_state = NmtState::Operational;
        }
    }

    fn note_pre_operational(&mut self) {
        if self.nmt_state != NmtState::PreOperationalAfterReset {
            self.nmt_state = NmtState::PreOperational;
        }
    }

    /// The NMT state that the node is believed to be in.
    pub const fn nmt_state(&self) -> NmtState {
        self.nmt_state
    }

    /// Updates whether process data reach the node, whose feedback is so many cycles of its bus old.
    pub fn note_pdo_reachability(&mut self, feedback_age_cycles: u16) {
        self.is_pdo_unreachable |=
            self.nmt_state != NmtState::Operational && feedback_age_cycles >= UNREACHABLE_CYCLES;
    }

    /// Returns `true` if the node takes no process data any more. That remains so until the node is watched anew.
    pub const fn is_pdo_unreachable(&self) -> bool {
        self.is_pdo_unreachable
    }

    /// Lets a cycle pass.
    pub fn pass(&mut self) {
        self.silent_cycles = self.silent_cycles.saturating_add(1);
    }

    /// What is wrong, with the longest silence that is allowed; `None` where no heartbeat is expected.
    #[inline]
    pub fn fault(&self, timeout_cycles: Option<u32>) -> Option<NodeFault> {
        match self.error_control {
            ErrorControl::BootedUp => Some(NodeFault::BootUp),
            ErrorControl::NotOperational { state } => Some(NodeFault::NotOperational { state }),
            ErrorControl::Operational => {
                let cycles = self.silent_cycles;
                timeout_cycles.filter(|timeout| cycles > *timeout).map(|_| NodeFault::Silent { cycles })
            }
        }
    }

    /// Forgets what was: the node is about to be watched.
    pub fn begin(&mut self) {
        *self = Self::default();
    }
}

/// Two nodes with one node ID answer the same SYNC twice. Late feedback makes two in one cycle as well, so only a run of them
/// counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct DuplicateNodeDetector {
    filled: u16,
}

const DUPLICATE_LIMIT: u16 = 12;
const DUPLICATE_STEP: u16 = 3;

impl DuplicateNodeDetector {
    /// A feedback PDO has arrived for the second time in a cycle.
    pub fn note_repetition(&mut self) {
        self.filled = self.filled.saturating_add(DUPLICATE_STEP);
    }

    /// Lets a cycle pass.
    pub fn pass(&mut self) {
        self.filled = self.filled.saturating_sub(1);
    }

    /// Returns `true` if it has gone on for too long to be lateness.
    pub const fn is_found(&self) -> bool {
        self.filled >= DUPLICATE_LIMIT
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    const LADDER: TimingLadder = TimingLadder { warning: 3, degraded: 10, unfit: 30, leak_slots: 10 };

    #[test]
    fn a_missed_slot_now_and_then_leaks_away() {
        let mut bucket = LeakyBucket::default();
        for cycle in 0..10_000 {
            let filled = bucket.take(u64::from(cycle % 10 == 0), LADDER.leak_slots);
            assert_eq!(LADDER.level(filled), TimingLevel::Normal);
        }
    }

    #[test]
    fn missed_slots_that_come_faster_than_they_leak_climb_the_ladder_step_by_step() {
        let mut bucket = LeakyBucket::default();
        let levels: Vec<TimingLevel> =
            (0..100).map(|_| LADDER.level(bucket.take(1, LADDER.leak_slots))).collect();
        assert!(levels.is_sorted());
        for level in TimingLevel::ALL {
            assert!(levels.contains(&level), "{level:?}");
        }
        bucket.empty();
        assert_eq!(LADDER.level(bucket.take(0, LADDER.leak_slots)), TimingLevel::Normal);
    }

    #[test]
    fn whoever_misses_every_second_slot_becomes_unfit() {
        let mut bucket = LeakyBucket::default();
        let is_unfit =
            (0..100).any(|_| LADDER.level(bucket.take(1, LADDER.leak_slots)) == TimingLevel::Unfit);
        assert!(is_unfit);
    }

    #[test]
    fn a_bucket_that_never_leaks_takes_more_slots_than_a_counter_of_32_bits_holds() {
        let mut bucket = LeakyBucket { filled: 3, slots: u32::MAX };
        assert_eq!((bucket.take(0, 0), bucket.take(1, 0)), (3, 4));
        let mut bucket = LeakyBucket { filled: 3, slots: u32::MAX };
        assert_eq!(bucket.take(0, u32::MAX), 2);
    }

    #[test]
    fn a_long_pause_is_unfit_at_once() {
        assert_eq!(LADDER.level(LeakyBucket::default().take(u64::MAX, 10)), TimingLevel::Unfit);
    }

    #[test]
    fn a_node_that_boots_leaves_operational_or_falls_silent_is_noticed() {
        let mut watch = NodeMonitor::default();
        watch.receive(node_state::OPERATIONAL);
        assert_eq!(watch.fault(Some(3)), None);
        (0..4).for_each(|_| watch.pass());
        assert_eq!(watch.fault(None), None);
        assert_eq!(watch.fault(Some(3)), Some(NodeFault::Silent { cycles: 4 }));
        watch.receive(0x7F);
        assert_eq!(watch.fault(Some(3)), Some(NodeFault::NotOperational { state: 0x7F }));
        watch.receive(0x80 | node_state::OPERATIONAL);
        assert_eq!(watch.fault(Some(3)), None);
        watch.receive(node_state::BOOT_UP);
        assert_eq!(watch.fault(None), Some(NodeFault::BootUp));
        watch.begin();
        assert_eq!(watch.fault(None), None);
    }

    #[test]
    fn what_a_node_hears_follows_from_what_it_says_and_what_others_tell_it() {
        let heard = |messages: &[Result<u8, u8>]| {
            let mut watch = NodeMonitor::default();
            for message in messages {
                match *message {
                    Ok(state) => watch.receive(state),
                    Err(command) => watch.receive_foreign_nmt(command),
                }
            }
            watch.nmt_state()
        };
        let (started, pre_operational) =
            (Ok(node_state::OPERATIONAL), Ok(0x80 | node_state::PRE_OPERATIONAL));
        assert_eq!(heard(&[started]), NmtState::Operational);
        assert_eq!(heard(&[pre_operational]), NmtState::PreOperational);
        assert_eq!(heard(&[pre_operational, started]), NmtState::Operational);
        assert_eq!(heard(&[Err(nmt_command::STOP)]), NmtState::Stopped);
        assert_eq!(heard(&[Err(nmt_command::STOP), Err(nmt_command::START)]), NmtState::Operational);
        // One that has been reset has forgotten its process data, and a start does not give them back.
        for reset in
            [Ok(node_state::BOOT_UP), Err(nmt_command::RESET_NODE), Err(nmt_command::RESET_COMMUNICATION)]
        {
            for later in
                [started, pre_operational, Err(nmt_command::START), Err(nmt_command::ENTER_PRE_OPERATIONAL)]
            {
                assert_eq!(heard(&[reset, later]), NmtState::PreOperationalAfterReset);
            }
        }
    }

    #[test]
    fn feedback_that_comes_twice_in_every_cycle_is_a_second_node_and_twice_at_times_is_not() {
        let mut watch = DuplicateNodeDetector::default();
        for _ in 0..100 {
            watch.note_repetition();
            (0..DUPLICATE_STEP).for_each(|_| watch.pass());
            assert!(!watch.is_found());
        }
        let needed = (1..100).find(|_| {
            watch.note_repetition();
            watch.pass();
            watch.is_found()
        });
        assert!(needed.is_some_and(|cycles| cycles < 10));
    }
}
