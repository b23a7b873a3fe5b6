//! The CiA 402 state machine of the drive: controlword in, statusword out, with the ramps that some transitions
//! take and the reaction to faults.

use takt_rt::{Command, DriveState, Nanoseconds, controlword, statusword};

use super::dictionary::{Dictionary, at};

/// For how long bit 7 must stay high to reset a fault (real units want it "held for several cycles").
const FAULT_RESET_NS: Nanoseconds = 3_000_000;
/// Statusword bit 4: voltage on the power stage.
const VOLTAGE_ENABLED: u16 = 0x10;

/// A deceleration on the way from one state to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// In counts/s².
    pub deceleration: f64,
    /// The state at its end.
    pub then: DriveState,
}

/// What a change of state means to the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// Torque is on from now: the motion starts from where the joint is.
    Enabled,
    /// A fault was reset.
    FaultReset,
}

/// The state machine.
#[derive(Clone, Copy, Debug)]
pub struct Device {
    state: DriveState,
    controlword: u16,
    reset_since_ns: Option<Nanoseconds>,
    stop: Option<Stop>,
    has_warning: bool,
}

impl Device {
    /// A drive that is starting. The warning bit is as the unit happens to have it.
    pub fn starting(has_warning: bool) -> Self {
        Self {
            state: DriveState::NotReadyToSwitchOn,
            controlword: 0,
            reset_since_ns: None,
            stop: None,
            has_warning,
        }
    }

    /// The same unit after a restart.
    pub fn restarted(&self) -> Self {
        Self::starting(self.has_warning)
    }

    /// The state.
    pub fn state(&self) -> DriveState {
        self.state
    }

    /// The controlword that was evaluated last.
    pub fn controlword(&self) -> u16 {
        self.controlword
    }

    /// The deceleration under way.
    pub fn stop(&self) -> Option<Stop> {
        self.stop
    }

    /// Initialisation is over (transition 1).
    pub fn started(&mut self) {
        if self.state == DriveState::NotReadyToSwitchOn {
            self.state = DriveState::SwitchOnDisabled;
        }
    }

    /// Evaluates the controlword, which the drive does in every step of its loop and whenever it is written.
    /// `is_cleared` tells that the cause of a fault is gone.
    pub fn evaluate(&mut self, now_ns: Nanoseconds, dictionary: &Dictionary, is_cleared: bool) -> Change {
        let word = dictionary.get(at::CONTROLWORD) as u16;
        let rising = word & !self.controlword;
        self.controlword = word;
        if self.state == DriveState::Fault {
            return self.evaluate_reset(now_ns, word, rising, is_cleared);
        }
        self.reset_since_ns = None;
        if self.state == DriveState::FaultReactionActive {
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

    fn evaluate_command(&mut self, command: Command, dictionary: &Dictionary) -> Change {
        if self.stop.is_some() && command != Command::DisableVoltage {
            return Change::None;
        }
        let next = self.state.after(command, false);
        let had_torque = self.state.has_torque();
        if self.state == DriveState::OperationEnabled
            && next == DriveState::ReadyToSwitchOn
            && dictionary.signed(at::SHUTDOWN_OPTION) == 1
        {
            let deceleration = dictionary.real(at::PROFILE_DECELERATION);
            self.stop = Some(Stop { deceleration, then: next });
            return Change::None;
        }
        self.stop = None;
        if next == DriveState::QuickStopActive && self.state != next {
            // Without object 605A the quick stop ends as its default 2 says: power off after the ramp.
            let deceleration = dictionary.real(at::QUICK_STOP_DECELERATION);
            self.stop = Some(Stop { deceleration, then: DriveState::SwitchOnDisabled });
        }
        self.state = next;
        if next == DriveState::OperationEnabled && !had_torque { Change::Enabled } else { Change::None }
    }

    /// The deceleration has come to rest.
    pub fn stopped(&mut self) {
        if let Some(stop) = self.stop.take() {
            self.state = stop.then;
        }
    }

    /// The torque is gone without a fault, as after safe torque off.
    pub fn lose_torque(&mut self) {
        if self.state.has_torque() && !self.state.is_faulted() {
            self.state = DriveState::SwitchOnDisabled;
            self.stop = None;
        }
    }

    /// A fault has been noticed. Without torque, or when power must be cut, the reaction is over at once; otherwise
    /// the drive decelerates as object 605E says first.
    pub fn fault(&mut self, cuts_power: bool, dictionary: &Dictionary) {
        if self.state.is_faulted() && !(cuts_power && self.state == DriveState::FaultReactionActive) {
            return;
        }
        let deceleration = match dictionary.signed(at::FAULT_REACTION_OPTION) {
            _ if cuts_power || !self.state.has_torque() => None,
            1 => Some(dictionary.real(at::PROFILE_DECELERATION)),
            2 => Some(dictionary.real(at::QUICK_STOP_DECELERATION)),
            _ => None,
        };
        self.stop = deceleration.map(|deceleration| Stop { deceleration, then: DriveState::Fault });
        self.state = if self.stop.is_some() { DriveState::FaultReactionActive } else { DriveState::Fault };
    }

    /// The statusword as real units set it: bit 9 always, bit 4 as long as there is no
    /// fault, bit 7 on some units, bit 12 always but in an enabled profile position mode. `mode_bits` are bits 10 to
    /// 13 as the mode of an enabled drive sets them.
    pub fn statusword(&self, mode_bits: u16) -> u16 {
        let bits = match self.state {
            DriveState::OperationEnabled => mode_bits,
            _ => statusword::BIT_12,
        };
        let voltage = if self.state.is_faulted() { 0 } else { VOLTAGE_ENABLED };
        let warning = if self.has_warning { statusword::WARNING } else { 0 };
        // Bit 5 shows "no quick stop" only where the standard tells states apart by it.
        self.state.statusword_bits() | statusword::REMOTE | voltage | warning | bits
    }
}
