//! Homing of an eRob. The known firmware has no homing mode; firmware that declares one can use methods 35 and 37.

use takt_rt::{Nanoseconds, OperationMode, controlword, statusword};

use super::motion::with_torque;
use super::objects::{HOME_OFFSET, HOMING_METHOD};
use super::state::modes_words;
use super::{enabling, reading};
use crate::canopen::objects::*;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::DriveProfile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// Homing methods on the current position, without motion. 37 replaces 35 in newer versions of CiA 402.
const PRESENT_POSITION: [i8; 2] = [35, 37];

/// `home`
pub async fn home(
    c: &SdoSession,
    s: &TargetDrive,
    method: Option<i8>,
    within_ns: Nanoseconds,
) -> Result<Report, Failure> {
    let method = method.unwrap_or(PRESENT_POSITION[0]);
    if !PRESENT_POSITION.contains(&method) {
        return Err(Failure::Unsupported {
            what: format!("homing method {method} needs switches, which an eRob joint does not have"),
            instead: "method 35 or 37 takes the present position as zero".to_owned(),
        });
    }
    contact::connect_family(c, s).await?;
    c.step("supported modes");
    let supported = c.read(&SUPPORTED_DRIVE_MODES).await? as u32;
    let has_method = c.read_optional(&HOMING_METHOD).await?.is_some();
    if supported & OperationMode::Homing.supported_bit() == 0 || !has_method {
        return Err(Failure::Unsupported {
            what: format!("this drive does not declare homing: 6502 names {}", modes_words(supported)),
            instead: "its encoder is absolute: set `zero_counts` in the configuration, or use `zero`"
                .to_owned(),
        });
    }
    let work = async {
        enabling::prepare(c, s, OperationMode::Homing, &DriveProfile::default()).await?;
        c.step("homing method");
        c.write_and_check(&HOMING_METHOD, method.into()).await?;
        c.write_optional(&HOME_OFFSET, 0).await?;
        enabling::enable(c, s).await?;
        c.step("homing");
        let word = controlword::ENABLE_OPERATION;
        c.write(&CONTROLWORD, (word | controlword::BIT_4).into()).await?;
        let is_over = |word: i64| word as u16 & (statusword::BIT_12 | statusword::BIT_13) != 0;
        let ended = c.wait_for(&STATUSWORD, "the end of homing", within_ns, is_over).await;
        c.write(&CONTROLWORD, (word | controlword::HALT).into()).await?;
        if ended? as u16 & statusword::BIT_13 != 0 {
            return Err(Failure::Homing("the drive reports a homing error (statusword bit 13)"));
        }
        let position = c.read(&POSITION_ACTUAL_VALUE).await?;
        let mut report = Report::new();
        report.add("method", "method", method, method.to_string());
        report.add("home_counts", "position after homing", position, format!("{position} counts"));
        Ok(report)
    };
    let mut report = with_torque(c, s, false, work).await?;
    report.append(reading::summary(c, s).await?);
    Ok(report)
}
