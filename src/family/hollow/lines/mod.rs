//! What is on a serial line of its own: the console of a motor, the hollow encoder, the pulse module.
//!
//! - `client`: bytes to the line and from it.
//! - `console`: the menus of a motor: parameters, mode, zero point; `menu`: what they show.
//! - `encoder`: the position of the hollow encoder.
//! - `pulse`: the stiffness of a motor behind the pulse module.

mod client;
mod console;
mod encoder;
mod menu;
mod pulse;

use takt_rt::Frame;
use takt_wire::hollow_lines::motor_data::COUNTS_PER_TURN;

use crate::config::{
    Axis, Config, ConfiguredFamily, DriveFacts, DriveFamily, ErrorControl, FamilyKeys, ModeChangeRule,
};
use crate::family::bring_up::{AxisSession, ProcessData};
use crate::family::commission::{DriveTask, Failure, TargetDrive, Task};
use crate::family::{Family, NamedEntry, SettingUp};
use takt_sim::{Drive, SilentDrive};

/// A device on a serial line.
#[derive(Clone, Copy, Debug)]
pub struct LineDevice {
    kind: Kind,
    facts: &'static DriveFacts,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Console,
    Encoder,
    Pulse,
}

const fn facts(word: &'static str, name: &'static str) -> DriveFacts {
    DriveFacts {
        counts_per_turn: Some(COUNTS_PER_TURN),
        mode_changes: ModeChangeRule::Never { because: "it is on a line for set-up" },
        has_fixed_process_data: true,
        reports_mode: false,
        error_control: ErrorControl::None,
        consumes_heartbeat: false,
        sends_emergencies: false,
        ..DriveFacts::standard(word, name)
    }
}

static CONSOLE_FACTS: DriveFacts = facts("hollow-console", "console of a hollow-shaft motor");
static ENCODER_FACTS: DriveFacts = facts("hollow-encoder", "hollow encoder");
static PULSE_FACTS: DriveFacts = facts("hollow-pulse", "pulse module of a hollow-shaft motor");

/// The serial console of a motor.
pub static CONSOLE: LineDevice = LineDevice { kind: Kind::Console, facts: &CONSOLE_FACTS };
/// The hollow encoder.
pub static ENCODER: LineDevice = LineDevice { kind: Kind::Encoder, facts: &ENCODER_FACTS };
/// The pulse module.
pub static PULSE: LineDevice = LineDevice { kind: Kind::Pulse, facts: &PULSE_FACTS };

impl ConfiguredFamily for LineDevice {
    fn word(&self) -> &'static str {
        self.facts.word
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        keys.refuse(
            "drive",
            format!("\"{}\"", self.facts.word),
            "a drive on a CAN bus; this is set up by `takt drive --bus serial:/dev/ttyUSB0`",
        );
        None
    }
}

impl Family for LineDevice {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(DriveFamily::of_family(self.facts))
    }

    fn has_statusword(&self) -> bool {
        false
    }

    /// It is alone on its line.
    fn usual_node(&self) -> Option<u8> {
        Some(1)
    }

    /// It has none.
    fn process_data(&self, _: &Axis) -> ProcessData {
        ProcessData::default()
    }

    /// No axis has it.
    fn configure<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    /// As [`Family::configure`].
    fn start<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    /// As [`Family::configure`].
    fn shut_down<'a>(&'a self, _: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(async { Ok(()) })
    }

    fn entries(&self, _: &DriveFamily) -> Vec<NamedEntry> {
        match self.kind {
            Kind::Console => console::entries(),
            Kind::Encoder | Kind::Pulse => vec![],
        }
    }

    fn commission(&self, _: TargetDrive, _: Task) -> Result<DriveTask<Frame>, Failure> {
        Err(Failure::Unsuitable(format!(
            "a {} is on a serial line: name it, for example --bus serial:/dev/ttyUSB0@19200",
            self.facts.name
        )))
    }

    fn commission_on_line(
        &self,
        target: TargetDrive,
        task: Task,
        bit_rate: u32,
    ) -> Option<Result<DriveTask<Vec<u8>>, Failure>> {
        Some(match self.kind {
            Kind::Console => console::begin(task, bit_rate),
            Kind::Encoder => encoder::begin(target, task),
            Kind::Pulse => pulse::begin(task),
        })
    }

    /// It hears nothing of a bus.
    fn simulated(&self, axis: &Axis, _: &Config) -> Box<dyn Drive> {
        Box::new(SilentDrive::new(axis.node))
    }
}

/// A task that this device does not do.
fn unsupported(what: &str, instead: &str) -> Failure {
    Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() }
}
