//! The complete module: it receives frames and time, moves its joint, and replies.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::erob_can::error_code::ErrorCode;
use takt_wire::erob_can::frame::{ReceivedRequest, Reply, reply_id};

use super::settings::{CAN_ADDRESS, OPERATING_MODE, OPERATING_MODES, Settings, Writable};
use crate::commanded_module::{CommandedModule, ModuleParameters, NotEnabled, NotStarted};
use crate::defect::{Defect, Unsupported};
use crate::drive::{Drive, DriveFault, Observation};
use crate::mailbox::Mailbox;
use crate::plant::Gravity;

/// What a simulated module is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobCanParameters {
    /// Node ID, 1 to 64.
    pub node: u8,
    /// The module without its protocol.
    pub module: ModuleParameters,
    /// From a request to its reply: up to 1 ms by the manual's captures.
    pub reply_ns: Nanoseconds,
    /// True if it controls a brake.
    pub has_brake: bool,
    /// How it ends a reply that tells of an error.
    pub error_form: ErrorForm,
    /// True if 0x0204 may be written while the motor is enabled, as a program of the vendor expects.
    pub has_free_velocity_limit: bool,
}

/// How a module ends a reply with an error code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ErrorForm {
    /// With 3E, as the manual prints it.
    #[default]
    Printed,
    /// With 80, as programs of the vendor expect it.
    Observed,
}

/// A simulated module.
#[derive(Clone, Debug)]
pub struct ErobCanDrive {
    parameters: ErobCanParameters,
    /// The node ID that it listens to: a new one counts after the next power-on.
    node: u8,
    settings: Settings,
    module: CommandedModule,
    reply: Option<(Nanoseconds, Frame)>,
}

impl ErobCanDrive {
    /// A module whose supply is switched on at time 0.
    pub fn new(parameters: ErobCanParameters) -> Self {
        let settings = Settings::new(parameters.node, parameters.has_free_velocity_limit);
        let module = CommandedModule::new(parameters.module, settings.of_module());
        Self { parameters, node: parameters.node, settings, module, reply: None }
    }

    /// Carries out a request.
    fn carry_out(&mut self, now_ns: Nanoseconds, request: &ReceivedRequest) -> Reply {
        let outcome = match (request.address.index, request.address.sub_index, request.value) {
            (0x0083, None, None) => self.module.start().map_err(|error| {
                Some(match error {
                    NotStarted::Disabled => ErrorCode::DISABLED,
                    NotStarted::Mode => ErrorCode::NO_MOTION_MODE,
                })
            }),
            (0x0084, None, None) => {
                self.module.stop();
                Ok(())
            }
            (0x00E8, None, None) => {
                self.module.save(now_ns);
                Ok(())
            }
            (0x014F, None, None) if self.parameters.has_brake => {
                self.module.release_brake();
                Ok(())
            }
            (0x014F, None, None) => Err(Some(ErrorCode::NO_BRAKE)),
            (0x0083 | 0x0084 | 0x00E8 | 0x014F, None, Some(_)) => Err(Some(ErrorCode::ARGUMENT_NOT_TAKEN)),
            (0x0100 | 0x0114, None, None) => Err(Some(ErrorCode::ARGUMENT_MISSING)),
            (0x0100, None, Some(value)) => self.set_enabled(now_ns, value),
            (0x0114, None, Some(1)) => {
                self.module.reset_encoder();
                Ok(())
            }
            (index, sub, None) => {
                return self.shown(index, sub).map_or(Reply::Failed(None), Reply::Value);
            }
            (index, None, Some(value)) => self.write(index, value),
            _ => Err(None),
        };
        match outcome {
            Ok(()) => Reply::Done,
            Err(code) => Reply::Failed(code),
        }
    }

    fn set_enabled(&mut self, now_ns: Nanoseconds, value: i32) -> Result<(), Option<ErrorCode>> {
        match value {
            0 => {
                self.module.disable();
                // A fault whose cause is gone ends with the command to disable.
                self.module.clear_fault();
                Ok(())
            }
            1 => self.module.enable(now_ns).map_err(|error| match error {
                NotEnabled::Starting => Some(ErrorCode::NO_COMMUTATION),
                NotEnabled::Faulted => None,
            }),
            _ => Err(None),
        }
    }

    fn write(&mut self, index: u16, value: i32) -> Result<(), Option<ErrorCode>> {
        match self.settings.writable(index) {
            None => return Err(None),
            Some(Writable::Disabled) if self.module.is_enabled() => return Err(Some(ErrorCode::ENABLED)),
            Some(Writable::AtRest) if self.module.is_moving() => return Err(Some(ErrorCode::MOVING)),
            // It has no other modes; the manual lists no code for that.
            Some(_) if index == OPERATING_MODE && !OPERATING_MODES.contains(&value) => return Err(None),
            Some(Writable::Always | Writable::AtRest | Writable::Disabled) => {}
        }
        self.settings.set(index, value);
        self.module.take_settings(self.settings.of_module());
        Ok(())
    }

    /// What a read brings.
    fn shown(&self, index: u16, sub_index: Option<u16>) -> Option<i32> {
        let module = &self.module;
        let milliamperes = module.milliamperes();
        Some(match (index, sub_index) {
            (0x0001, Some(3)) => 1005,
            (0x0001, Some(4)) => 520_212_171,
            (0x0002, None) => module.counts(),
            (0x0005, Some(1)) => module.velocity().round() as i32,
            (0x0008, None) => milliamperes.round() as i32,
            (0x0009 | 0x000A | 0x00FE, None) => (milliamperes / 3.0).round() as i32,
            (0x000D..=0x000F, None) if module.is_enabled() => 24_000,
            (0x000D..=0x000F, None) => 0,
            (0x001F, None) => module.fault().into(),
            (0x0020, None) => self.running_state(),
            (0x0022 | 0x0023, None) => 0,
            (0x0024, None) => 48_000,
            (0x0026, None) => 35,
            (0x0033, None) => 6_300,
            (0x0034, None) => 12_600,
            (0x0035, None) => 1_000,
            (0x0044, None) => 1_000_000,
            (0x009C, None) => module.counts().wrapping_mul(100),
            (0x009F, None) => module.counts_within_turn() as i32,
            (0x010C, None) => module.reached_status().into(),
            // The difference of the two encoders; in no table of the manual (a program of the vendor reads it).
            (0x0119, None) => module.twist(),
            // A module without a torque sensor.
            (0x020D, None) => return None,
            (0x0232, Some(1)) => i32::from(self.node) + 1_000,
            (0x0232, Some(2)) => 0x0002_4000,
            (0x0232, Some(5)) => 0x0122_0212,
            (0x0232, Some(6)) => 1,
            (0x0232, Some(7)) => 1,
            (0x0232, Some(8)) => 0x005D_3B12,
            (index, None) => return self.settings.value(index),
            _ => return None,
        })
    }

    /// 0x0020.
    fn running_state(&self) -> i32 {
        match self.module.motion() {
            Some(motion) if motion.is_stopping_reciprocation() => 3,
            _ => self.module.is_moving().into(),
        }
    }

    /// The reply as this module ends it.
    fn reply_frame(&self, reply: Reply) -> Frame {
        match (reply, self.parameters.error_form) {
            (Reply::Failed(Some(ErrorCode(code))), ErrorForm::Observed) => {
                let [high, low] = code.to_be_bytes();
                Frame::of(reply_id(self.node), [high, low, 0x80])
            }
            _ => reply.frame(self.node),
        }
    }

    fn run_until(&mut self, now_ns: Nanoseconds) {
        self.module.run_until(now_ns);
        if self.module.has_saved(now_ns) {
            self.settings.save();
        }
    }
}

impl Drive for ErobCanDrive {
    fn node(&self) -> u8 {
        self.node
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, _: &mut Mailbox) {
        let request = ReceivedRequest::decode(frame).filter(|request| request.node == self.node);
        // What a module does with a second request before its reply is not published. Here it is lost: a master that does not wait
        // notices.
        let (Some(request), None) = (request, self.reply) else { return };
        self.run_until(now_ns);
        let reply = self.carry_out(now_ns, &request);
        if !self.module.is_silent() {
            self.reply =
                Some((now_ns.saturating_add(self.parameters.reply_ns.max(1)), self.reply_frame(reply)));
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        if let Some((due_ns, frame)) = self.reply
            && due_ns <= now_ns
        {
            mailbox.push(frame);
            self.reply = None;
        }
    }

    fn wake_ns(&self) -> Nanoseconds {
        let step_ns = self.module.wake_ns();
        self.reply.map_or(step_ns, |(due_ns, _)| due_ns.min(step_ns))
    }

    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.run_until(now_ns);
        self.module.observe()
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.module.inject_fault(fault);
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_until(now_ns);
        mailbox.clear();
        self.settings.restore();
        self.node =
            self.settings.value(CAN_ADDRESS).and_then(|node| u8::try_from(node).ok()).unwrap_or(self.node);
        self.reply = None;
        self.module.power_cycle(now_ns, self.settings.of_module());
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.module.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.module.set_load_torque(torque);
    }

    fn inject_defect(&mut self, _: Nanoseconds, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        self.module.inject_defect(defect, is_present)
    }
}
