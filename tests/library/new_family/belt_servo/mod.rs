//! The whole of a family: facts, a key of its own, bring-up, error words, the simulated drive.

use takt::canopen::object::{DataType, Object};
use takt::canopen::objects::PdoDirection;
use takt::canopen::objects::{CONTROLWORD, MODES_OF_OPERATION, STATUSWORD};
use takt::canopen::{
    eds,
    nmt::{NmtCommand, NmtState},
};
use takt::config::{Axis, Config, ConfiguredFamily, DriveFacts, DriveFamily, FamilyKeys};
use takt::family::bring_up::{
    AxisSession, Check, ProcessData, RESTART_STEP, StepResult, actual_position, heartbeat, identity,
    pdo_mapping,
};
use takt::family::commission::{DriveTask, Failure, TargetDrive, Task};
use takt::family::{Family, SettingUp, standard_error};
use takt::rt::{Frame, controlword};
use takt::sim::Drive;
use takt::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use takt::sim::plant::{Encoder, JointParameters};
use takt::words;
use takt::words::Words;

/// The family.
#[derive(Debug)]
pub struct BeltServo;

fn facts(counts_per_turn: f64) -> DriveFacts {
    DriveFacts { counts_per_turn: Some(counts_per_turn), ..DriveFacts::standard("belt-servo", "belt servo") }
}

impl ConfiguredFamily for BeltServo {
    fn word(&self) -> &'static str {
        "belt-servo"
    }

    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily> {
        match keys.text("pulley").as_deref() {
            Some("small") | None => Some(DriveFamily::of_drive(facts(4096.0), ())),
            Some("large") => Some(DriveFamily::of_drive(facts(8192.0), ())),
            Some(other) => {
                keys.refuse("pulley", format!("{other:?}"), "\"small\" or \"large\"");
                None
            }
        }
    }
}

/// An object that the standard does not know: the controller may command the drive.
const RELEASE: Object = Object::new(0x6007, 0, DataType::I16, "abort connection option code");

async fn configure(c: &AxisSession<'_>) -> StepResult {
    c.step(RESTART_STEP, "check that the drive is powered, and its wiring");
    c.restart_communication().await?;
    identity::compare(c, identity::PROFILE_CIA402).await?;
    c.write(CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    c.step("process data", "this drive has two PDOs of each kind");
    let data = ProcessData::of(c.axis, c.config);
    pdo_mapping::write(c, PdoDirection::Receive, &data.commands, 2).await?;
    pdo_mapping::write(c, PdoDirection::Transmit, &data.feedback, 2).await?;
    c.write(MODES_OF_OPERATION, c.axis.control.operation_mode() as i64).await?;
    c.write_optional(RELEASE, 1).await?;
    actual_position::make_target(c).await?;
    heartbeat::watch_master(c).await
}

async fn start(c: &AxisSession<'_>) -> StepResult {
    c.step("start", "check that no other master commands this node");
    c.command(NmtCommand::Start, NmtState::Operational).await?;
    c.read(STATUSWORD, Check::Any, |facts, value| facts.statusword = value as u16).await?;
    actual_position::read(c).await
}

async fn shut_down(c: &AxisSession<'_>) -> StepResult {
    c.step("shut down", "power-cycle the drive");
    c.command(NmtCommand::EnterPreOperational, NmtState::PreOperational).await?;
    c.write(CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    heartbeat::end_watch(c, "power-cycle the drive").await
}

impl Family for BeltServo {
    fn unconfigured(&self) -> Option<DriveFamily> {
        Some(DriveFamily::of_drive(facts(4096.0), ()))
    }

    fn configure<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(configure(c))
    }

    fn start<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(start(c))
    }

    fn shut_down<'a>(&'a self, c: &'a AxisSession<'a>) -> SettingUp<'a> {
        Box::pin(shut_down(c))
    }

    fn error_words(&self, code: u16) -> Words {
        let name = Words::bilingual(("belt torn", "皮带断裂"));
        if code == 0xFF01 { words!("0xFF01 ({name})", name) } else { standard_error(code) }
    }

    fn error_cure(&self, code: u16) -> Option<&'static str> {
        (code == 0xFF01).then_some("put a new belt on")
    }

    fn commission(&self, _: TargetDrive, _: Task) -> Result<DriveTask<Frame>, Failure> {
        let (what, instead) =
            ("a belt servo has no commissioning".to_owned(), "move it by `takt run`".to_owned());
        Err(Failure::Unsupported { what, instead })
    }

    /// A CiA 402 drive with the objects of a data sheet that is at hand.
    fn simulated(&self, axis: &Axis, config: &Config) -> Box<dyn Drive> {
        let sheet = include_bytes!("../../../../tests/eds/vendors/eyou-euservo.eds");
        let parameters = Cia402Parameters {
            sheet: eds::parse("eyou-euservo.eds", sheet).unwrap().dictionary,
            node: axis.node,
            quirks: Default::default(),
            axes: vec![Cia402AxisParameters {
                joint: JointParameters {
                    inertia: 1.0,
                    viscous_friction: 1.0,
                    coulomb_friction: 0.5,
                    friction_shape: takt::config::FrictionShape::Constant,
                    brake_torque: 100.0,
                },
                encoder: Encoder {
                    counts_per_unit: axis.counts_per_turn / axis.travel.per_turn(),
                    zero_counts: 0.0,
                },
                counts_per_turn: axis.counts_per_turn,
                initial_position: axis.simulated.initial_position,
                rated_torque: 100.0,
                peak_torque: 300.0,
                highest_velocity: 1.5 * axis.limits.velocity,
                switches: Default::default(),
                end_stops: None,
            }],
            power_up_ns: axis.power_up_ns,
            feedback_delay_ns: axis.feedback_delay_ns,
            seed: config.simulation.seed,
        };
        Box::new(Cia402Drive::new(parameters).unwrap())
    }
}
