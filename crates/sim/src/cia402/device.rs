//! The CiA 402 state machine of one axis: controlword, state, statusword, the ramps of some transitions, the option codes
//! 605A to 605E, and the fault reaction. Where the data sheet lacks an option code, the default of the standard applies.

use takt_rt::{Command, DriveState, Nanoseconds, controlword, statusword};

use crate::defect::Disobedience;
use crate::object_dictionary::SimulatedDictionary;

use super::places::Places;

/// Statusword bit 4: voltage on the power stage.
const VOLTAGE_ENABLED: u16 = 0x10;

/// How the axis decelerates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// The profile deceleration 6084.
    SlowDown,
    /// The quick-stop deceleration 6085.
    QuickStop,
    /// As fast as current and voltage allow.
    AtLimit,
}

/// A deceleration before a state change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop {
    /// How it decelerates.
    pub ramp: Ramp,
    /// The state after it; the axis holds when it is the present one.
    pub then: DriveState,
}

/// What a state change means for the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// The axis follows set-points from now on: the motion starts at the actual position.
    Enabled,
    /// A fault was reset.
    FaultReset,
}

/// What an axis does when a fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultReaction {
    /// Power is cut at once.
    CutPower,
    /// As object 605E says.
    ByOption,
}

/// The state machine.
#[derive(Clone, Copy, Debug)]
pub struct Device {
    state: DriveState,
    controlword: u16,
    stop: Option<Stop>,
    disobedience: Option<Disobedience>,
    /// How long bit 7 of the controlword must stay set to reset a fault, and since when it has been set in this one.
    fault_reset_ns: Nanoseconds,
    reset_since_ns: Option<Nanoseconds>,
}

impl Device {
    /// An axis that is booting.
    pub const fn starting(fault_reset_ns: Nanoseconds) -> Self {
        Self {
            state: DriveState::NotReadyToSwitchOn,
            controlword: 0,
            stop: None,
            disobedience: None,
            fault_reset_ns,
            reset_since_ns: None,
        }
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

    /// The same axis after a restart.
    pub const fn restarted(&self) -> Self {
        Self { disobedience: self.disobedience, ..Self::starting(self.fault_reset_ns) }
    }

    /// From now on it does not obey its controlword in this way, or obeys it again.
    pub fn disobey(&mut self, disobedience: Option<Disobedience>) {
        self.disobedience = disobedience;
    }

    /// Ends the initialisation (transition 1).
    pub fn started(&mut self) {
        if self.state == DriveState::NotReadyToSwitchOn {
            self.state = DriveState::SwitchOnDisabled;
        }
    }

    /// Evaluates the controlword. `is_cleared`: the cause of a fault is gone.
    pub fn evaluate(
        &mut self,
        now_ns: Nanoseconds,
        word: u16,
        places: &Places,
        dictionary: &SimulatedDictionary,
        is_cleared: bool,
    ) -> Change {
        let rising = word & !self.controlword;
        self.controlword = word;
        if self.state != DriveState::Fault || word & controlword::FAULT_RESET == 0 {
            self.reset_since_ns = None;
        } else if rising & controlword::FAULT_RESET != 0 {
            self.reset_since_ns = Some(now_ns);
        }
        let is_held = |since_ns| now_ns.saturating_sub(since_ns) >= self.fault_reset_ns;
        match self.state {
            DriveState::Fault if is_cleared && self.reset_since_ns.is_some_and(is_held) => {
                self.reset_since_ns = None;
                self.state = self.state.after(Command::DisableVoltage, true);
                Change::FaultReset
            }
            DriveState::Fault | DriveState::FaultReactionActive => Change::None,
            DriveState::NotReadyToSwitchOn if self.disobedience.is_some() => Change::None,
            state if self.disobedience == Some(Disobedience::EnablesItself) => {
                (self.state, self.stop) = (DriveState::OperationEnabled, None);
                if state.has_torque() { Change::None } else { Change::Enabled }
            }
            _ if self.disobedience.is_some() => Change::None,
            _ => self.evaluate_command(Command::decode(word), places, dictionary),
        }
    }

    fn evaluate_command(
        &mut self,
        command: Command,
        places: &Places,
        dictionary: &SimulatedDictionary,
    ) -> Change {
        let is_leaving = self.stop.is_some_and(|stop| stop.then != self.state);
        // A quick stop interrupts another deceleration; only "disable voltage" interrupts the quick stop.
        let is_quick_stop = command == Command::QuickStop && self.state == DriveState::OperationEnabled;
        let next = self.state.after(command, false);
        if next == self.state || is_leaving && command != Command::DisableVoltage && !is_quick_stop {
            return Change::None;
        }
        let option = |place, default| dictionary.number_at(place).unwrap_or(default);
        let slows_down = match (self.state, next) {
            (DriveState::OperationEnabled, DriveState::QuickStopActive) => {
                self.quick_stop(option(places.quick_stop_option, 2));
                return Change::None;
            }
            (DriveState::OperationEnabled, DriveState::ReadyToSwitchOn) => {
                option(places.shutdown_option, 0) == 1
            }
            (DriveState::OperationEnabled, DriveState::SwitchedOn) => option(places.disable_option, 1) == 1,
            _ => false,
        };
        if slows_down {
            self.stop = Some(Stop { ramp: Ramp::SlowDown, then: next });
            return Change::None;
        }
        (self.state, self.stop) = (next, None);
        if next == DriveState::OperationEnabled { Change::Enabled } else { Change::None }
    }

    /// A quick stop of an enabled axis, by object 605A.
    pub fn quick_stop(&mut self, option: i64) {
        let ramp = match option {
            0 => {
                (self.state, self.stop) = (DriveState::SwitchOnDisabled, None);
                return;
            }
            1 | 5 => Ramp::SlowDown,
            3 | 4 | 7 | 8 => Ramp::AtLimit,
            _ => Ramp::QuickStop,
        };
        let holds = (5..=8).contains(&option);
        self.state = DriveState::QuickStopActive;
        let then = if holds { DriveState::QuickStopActive } else { DriveState::SwitchOnDisabled };
        self.stop = Some(Stop { ramp, then });
    }

    /// Ends the deceleration at standstill. One that ends in the present state goes on holding the axis.
    pub fn stopped(&mut self) {
        if let Some(stop) = self.stop.filter(|stop| stop.then != self.state) {
            (self.state, self.stop) = (stop.then, None);
        }
    }

    /// Removes the torque without a fault, like safe torque off.
    pub fn lose_torque(&mut self) {
        if self.state.has_torque() && !self.state.is_faulted() {
            (self.state, self.stop) = (DriveState::SwitchOnDisabled, None);
        }
    }

    /// Enters the fault state. Without torque, or when power must be cut, this happens at once. Otherwise the axis
    /// decelerates first, by object 605E.
    pub fn fault(&mut self, reaction: FaultReaction, places: &Places, dictionary: &SimulatedDictionary) {
        let cuts_power = reaction == FaultReaction::CutPower;
        if self.state == DriveState::Fault || self.state == DriveState::FaultReactionActive && !cuts_power {
            return;
        }
        let ramp = match dictionary.number_at(places.fault_reaction_option).unwrap_or(2) {
            _ if cuts_power || !self.state.has_torque() => None,
            1 => Some(Ramp::SlowDown),
            2 => Some(Ramp::QuickStop),
            3 | 4 => Some(Ramp::AtLimit),
            _ => None,
        };
        self.stop = ramp.map(|ramp| Stop { ramp, then: DriveState::Fault });
        self.state = if self.stop.is_some() { DriveState::FaultReactionActive } else { DriveState::Fault };
    }

    /// The statusword. `mode_bits` are bits 10 to 13, which the mode sets.
    pub fn statusword(&self, mode_bits: u16) -> u16 {
        let voltage = match self.state {
            DriveState::NotReadyToSwitchOn | DriveState::Fault => 0,
            _ => VOLTAGE_ENABLED,
        };
        let remote = match self.disobedience {
            Some(Disobedience::IsLocal) => 0,
            _ => statusword::REMOTE,
        };
        self.state.statusword_bits() | remote | voltage | mode_bits
    }
}
