//! Homing by object 6098, with every method of the standard and those of the manufacturer.

use takt_rt::{Nanoseconds, OperationMode, controlword, statusword};
use takt_wire::canopen::object::{DataType, Object};
use takt_wire::canopen::objects::*;

use super::access::read_if_there;
use super::motion::{POLL_NS, with_torque};
use super::objects::{HOME_OFFSET, HOMING_METHOD, HOMING_SPEED_SWITCH, HOMING_SPEED_ZERO};
use super::words::modes_words;
use super::{enabling, reading};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::DriveProfile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// 60E3: the methods that the drive has.
const SUPPORTED_METHODS: u16 = 0x60E3;

/// Homing methods on the present position, without motion. 37 replaces 35 in newer versions of CiA 402.
pub const PRESENT_POSITION: [i8; 2] = [35, 37];

/// Returns `true` if the standard defines the method: switches and index pulses (1 to 14, 17 to 30, 33, 34), the present position (35, 37).
fn is_standard(method: i8) -> bool {
    matches!(method, 1..=14 | 17..=30 | 33..=35 | 37)
}

/// `home`. Without a method, the one that the drive holds (6098) is run.
pub async fn home(
    c: &SdoSession,
    s: &TargetDrive,
    method: Option<i8>,
    within_ns: Nanoseconds,
    is_forced: bool,
) -> Result<Report, Failure> {
    if let Some(method) = method.filter(|method| !is_standard(*method) && !is_forced) {
        return Err(Failure::Unsuitable(format!(
            "CiA 402 defines no homing method {method}; add --force for a method of the manufacturer"
        )));
    }
    if !s.has(HOMING_METHOD.address) {
        return Err(Failure::Unsupported {
            what: "this drive has no homing (6098)".to_owned(),
            instead: "set `zero_counts` in the configuration, if its encoder is absolute".to_owned(),
        });
    }
    let method = method.or(s.lacks_switches().then_some(PRESENT_POSITION[0]));
    if let Some(method) = method.filter(|method| s.lacks_switches() && !PRESENT_POSITION.contains(method)) {
        return Err(Failure::Unsupported {
            what: format!("homing method {method} needs switches, which this drive does not have"),
            instead: "method 35 or 37 takes the present position as zero".to_owned(),
        });
    }
    contact::connect_family(c, s).await?;
    check_declares_homing(c, s).await?;
    c.step("homing method");
    let method = match method {
        Some(method) => method,
        None => own_method(c).await?,
    };
    if !is_forced {
        check_has_method(c, s, method).await?;
    }
    if !PRESENT_POSITION.contains(&method) {
        check_speeds(c, s).await?;
    }
    let offset = s.lacks_switches().then_some((HOME_OFFSET, 0));
    with_torque(c, s, false, run(c, s, method, offset, within_ns)).await
}

/// Refuses homing where the drive names its modes (6502), and homing is not one of them.
async fn check_declares_homing(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    c.step("supported modes");
    let supported = read_if_there(c, s, &SUPPORTED_DRIVE_MODES).await?.unwrap_or(0) as u32;
    let homing = OperationMode::Homing;
    if supported == 0 || supported & homing.supported_bit() != 0 || s.adds_mode(homing) {
        return Ok(());
    }
    Err(Failure::Unsupported {
        what: format!("this drive does not declare homing: 6502 names {}", modes_words(supported)),
        instead: "set `zero_counts` in the configuration, if its encoder is absolute".to_owned(),
    })
}

/// Prepares the drive, and runs the method. With an offset, the home position gets this value (607C).
pub async fn run(
    c: &SdoSession,
    s: &TargetDrive,
    method: i8,
    offset: Option<(Object, i64)>,
    within_ns: Nanoseconds,
) -> Result<Report, Failure> {
    let rated = reading::rated_torque(c, s).await?;
    enabling::prepare(c, s, OperationMode::Homing, &DriveProfile::default()).await?;
    c.step("homing method");
    c.write_and_check(&HOMING_METHOD, method.into()).await?;
    if let Some((object, value)) = offset {
        c.write_optional(&object, value).await?;
    }
    enabling::enable(c, s).await?;
    c.step("homing");
    let word = controlword::ENABLE_OPERATION;
    c.write(&CONTROLWORD, (word | controlword::BIT_4).into()).await?;
    let ended = wait_for_end(c, s, rated, within_ns).await;
    c.write(&CONTROLWORD, (word | controlword::HALT).into()).await?;
    ended?;
    let position = c.read(&POSITION_ACTUAL_VALUE).await?;
    let mut report = Report::new();
    report.add("method", "method", method, method.to_string());
    report.add("home_counts", "position after homing", position, format!("{position} counts"));
    Ok(report)
}

/// Waits for statusword bit 12 (homing attained) or bit 13 (homing error).
async fn wait_for_end(
    c: &SdoSession,
    s: &TargetDrive,
    rated: Option<f64>,
    within_ns: Nanoseconds,
) -> Result<(), Failure> {
    let began_ns = c.now_ns();
    loop {
        let word = reading::read_enabled(c, s, rated).await?.status_bits();
        if word & statusword::BIT_13 != 0 {
            return Err(Failure::Homing("the drive reports a homing error (statusword bit 13)"));
        }
        if word & statusword::BIT_12 != 0 {
            return Ok(());
        }
        let waited_ns = c.now_ns().saturating_sub(began_ns);
        if waited_ns >= within_ns {
            let (object, last) = (STATUSWORD, word.into());
            return Err(Failure::NotInTime { object, what: "the end of homing", last, waited_ns });
        }
        c.pause(POLL_NS).await?;
    }
}

/// The method that the drive holds.
async fn own_method(c: &SdoSession) -> Result<i8, Failure> {
    let held = i8::try_from(c.read(&HOMING_METHOD).await?).unwrap_or(0);
    match held {
        0 => Err(Failure::Missing { what: "--method", why: "the drive holds no homing method (6098 is 0)" }),
        held => Ok(held),
    }
}

/// Refuses a method that the drive does not list (60E3), where it lists any.
async fn check_has_method(c: &SdoSession, s: &TargetDrive, method: i8) -> Result<(), Failure> {
    let count = Object::new(SUPPORTED_METHODS, 0, DataType::U8, "number of homing methods");
    let count = read_if_there(c, s, &count).await?.unwrap_or(0);
    let mut listed = vec![];
    for entry in 1..=u8::try_from(count).unwrap_or(0) {
        let object = Object::new(SUPPORTED_METHODS, entry, DataType::I8, "homing method");
        // Older drives list them as 16 bits.
        let known = read_if_there(c, s, &object).await?.filter(|known| *known != 0);
        listed.extend(known.and_then(|known| i8::try_from(known).ok()));
    }
    if listed.is_empty() || listed.contains(&method) {
        return Ok(());
    }
    let listed = listed.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    Err(Failure::Unsupported {
        what: format!("this drive does not list homing method {method}"),
        instead: format!("60E3 names {listed}"),
    })
}

/// Checks the speeds that the drive holds for homing (6099) against the velocity limit of the axis.
async fn check_speeds(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    c.step("homing speeds");
    for object in [HOMING_SPEED_SWITCH, HOMING_SPEED_ZERO] {
        if let Some(speed) = read_if_there(c, s, &object).await? {
            s.check_velocity(s.velocity_raw_of_profile(speed))?;
        }
    }
    Ok(())
}
