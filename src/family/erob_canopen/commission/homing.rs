//! Homing of an eRob. The known firmware has no homing mode; firmware that declares one can use methods 35 and 37.

use takt_rt::{Nanoseconds, OperationMode};
use takt_wire::canopen::objects::*;

use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::profile::homing::{self, PRESENT_POSITION};
use crate::family::commission::profile::motion::with_torque;
use crate::family::commission::profile::objects::{HOME_OFFSET, HOMING_METHOD};
use crate::family::commission::profile::words::modes_words;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

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
    with_torque(c, s, false, homing::run(c, s, method, Some((HOME_OFFSET, 0)), within_ns)).await
}
