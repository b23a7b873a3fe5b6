//! The CiA 402 state machine: controlword, state, statusword, the ramps of some transitions, and the fault reaction.

use takt_rt::{Command, DriveState, Nanoseconds, controlword, statusword};

use super::objects::at;
use crate::defect::Disobedience;
use crate::object_dictionary::SimulatedDictionary;

/// Minimum time for which controlword bit 7 must stay set to reset a fault (field experience: several cycles).
const FAULT_RESET_NS: Nanoseconds = 3_000_000;
/// Statusword bit 4: voltage on the power stage.
const VOLTAGE_ENABLED: u16 = 0x10;

/// A deceleration before a state change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// In counts/s².
    pub deceleration: f64,
    /// The state after it.
    pub then: DriveState,
}

/// What a state change means for the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// Torque is on: the motion starts at the actual position.
    Enabled,
    /// A fault was reset.
    FaultReset,
}

/// The state machine.
#[derive(Clone, Copy, Debug)]
pub struct ErobDevice {
    state: DriveState,
    controlword: u16,
    reset_since_ns: Option<Nanoseconds>,
    stop: Option<Stop>,
    /// A state and a controlword that leaves the drive in it.
    settled: Option<(DriveState, u16)>,
    has_warning: bool,
    disobedience: Option<Disobedience>,
}

impl ErobDevice {
    /// A drive that is booting. The warning bit differs from unit to unit.
    pub fn starting(has_warning: bool) -> Self {
        Self {
            state: DriveState::NotReadyToSwitchOn,
            controlword: 0,
            reset_since_ns: None,
            stop: None,
            settled: None,
            has_warning,
            disobedience: None,
        }
    }

    /// The same unit after a restart.
    pub fn restarted(&self) -> Self {
        Self { disobedience: self.disobedience, ..Self::starting(self.has_warning) }
    }

    /// The state.
    pub fn state(&self) -> DriveState {
        self.state
    }

    /// The last evaluated controlword.
    pub fn controlword(&self) -> u16 {
        self.controlword
    }

    /// The current deceleration.
    pub fn stop(&self) -> Option<Stop> {
        self.stop
    }

    /// From now on it does not obey its controlword in this way, or obeys it again.
    pub fn disobey(&mut self, disobedience: Option<Disobedience>) {
        (self.disobedience, self.settled) = (disobedience, None);
    }

    /// Ends the initialisation (transition 1).
    pub fn started(&mut self) {
        if self.state == DriveState::NotReadyToSwitchOn {
            self.state = DriveState::SwitchOnDisabled;
        }
    }

    /// Evaluates the controlword. The drive does this in every step of its loop and after every write of 6040.
    /// `is_cleared`: the cause of a fault is gone.
    pub fn evaluate(
        &mut self,
        now_ns: Nanoseconds,
        dictionary: &SimulatedDictionary,
        is_cleared: bool,
    ) -> Change {
        let word = dictionary.number(at::CONTROLWORD) as u16;
        let rising = word & !self.controlword;
        self.controlword = word;
        if self.state == DriveState::Fault {
            return self.evaluate_reset(now_ns, word, rising, is_cleared);
        }
        self.reset_since_ns = None;
        if self.state == DriveState::FaultReactionActive {
            return Change::None;
        }
        match self.disobedience {
            None => {}
            Some(Disobedience::EnablesItself) if self.state != DriveState::NotReadyToSwitchOn => {
                let had_torque = self.state.has_torque();
                (self.state, self.stop) = (DriveState::OperationEnabled, None);
                return if had_torque { Change::None } else { Change::Enabled };
            }
            Some(_) => return Change::None,
        }
        // Almost every step finds the word of the step before.
        if self.settled == Some((self.state, word)) {
            return Change::None;
        }
        self.evaluate_command(Command::decode(word), dictionary)
    }

    fn evaluate_reset(&mut self, now_ns: Nanoseconds, word: u16, rising: u16, is_cleared: bool) -> Change {
        if rising & controlword::FAULT_RESET != 0 {
            self.reset_since_ns = Some(now_ns);
        } else if word & controlword::FAULT_RESET == 0 {
            self.reset_since_ns = None;
        }
        let is_held =
            self.reset_since_ns.is_some_and(|since_ns| now_ns.saturating_sub(since_ns) >= FAULT_RESET_NS);
        if !is_held || !is_cleared {
            return Change::None;
        }
        self.reset_since_ns = None;
        self.state = self.state.after(Command::DisableVoltage, true);
        Change::FaultReset
    }

    fn evaluate_command(&mut self, command: Command, dictionary: &SimulatedDictionary) -> Change {
        if self.stop.is_some() && command != Command::DisableVoltage {
            return Change::None;
        }
        let next = self.state.after(command, false);
        let had_torque = self.state.has_torque();
        if self.state == DriveState::OperationEnabled
            && next == DriveState::ReadyToSwitchOn
            && dictionary.number(at::SHUTDOWN_OPTION) == 1
        {
            let deceleration = dictionary.real(at::PROFILE_DECELERATION);
            self.stop = Some(Stop { deceleration, then: next });
            return Change::None;
        }
        self.stop = None;
        if next == DriveState::QuickStopActive && self.state != next {
            // The drive has no object 605A; it acts like its default 2: disable after the quick stop ramp.
            let deceleration = dictionary.real(at::QUICK_STOP_DECELERATION);
            self.stop = Some(Stop { deceleration, then: DriveState::SwitchOnDisabled });
        }
        if next == self.state {
            self.settled = Some((next, self.controlword));
        }
        self.state = next;
        if next == DriveState::OperationEnabled && !had_torque { Change::Enabled } else { Change::None }
    }

    /// Ends the deceleration at standstill.
    pub fn stopped(&mut self) {
        if let Some(stop) = self.stop.take() {
            self.state = stop.then;
        }
    }

    /// Removes the torque without a fault, like safe torque off.
    pub fn lose_torque(&mut self) {
        if self.state.has_torque() && !self.state.is_faulted() {
            self.state = DriveState::SwitchOnDisabled;
            self.stop = None;
        }
    }

    /// Enters the fault state. Without torque, or when power must be cut, this happens at once. Otherwise the drive
    /// decelerates first, by object 605E.
    pub fn fault(&mut self, cuts_power: bool, dictionary: &SimulatedDictionary) {
        if self.state.is_faulted() && !(cuts_power && self.state == DriveState::FaultReactionActive) {
            return;
        }
        let deceleration = match dictionary.number(at::FAULT_REACTION_OPTION) {
            _ if cuts_power || !self.state.has_torque() => None,
            1 => Some(dictionary.real(at::PROFILE_DECELERATION)),
            2 => Some(dictionary.real(at::QUICK_STOP_DECELERATION)),
            _ => None,
        };
        self.stop = deceleration.map(|deceleration| Stop { deceleration, then: DriveState::Fault });
        self.state = if self.stop.is_some() { DriveState::FaultReactionActive } else { DriveState::Fault };
    }

    /// The statusword as real units set it: bit 9 unless it is local, bit 4 unless there is a fault, bit 7 on some units, bit 12
    /// except in enabled profile position mode. `mode_bits` are bits 10 to 13, which the mode sets in an enabled drive.
    pub fn statusword(&self, mode_bits: u16) -> u16 {
        let bits = match self.state {
            DriveState::OperationEnabled => mode_bits,
            _ => statusword::BIT_12,
        };
        let voltage = if self.state.is_faulted() { 0 } else { VOLTAGE_ENABLED };
        let warning = if self.has_warning { statusword::WARNING } else { 0 };
        let remote = match self.disobedience {
            Some(Disobedience::IsLocal) => 0,
            _ => statusword::REMOTE,
        };
        // Bit 5 means "no quick stop" only in states that the standard distinguishes by it.
        self.state.statusword_bits() | remote | voltage | warning | bits
    }
}
