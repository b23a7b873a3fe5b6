//! Homing (manual 5.09). Setting the mode starts it; statusword bit 12 reports its end, bit 13 an error.

use takt_rt::Nanoseconds;
use takt_wire::canopen::objects::*;

use super::enabling::{self, mode};
use super::motion::with_torque;
use super::objects::HOMING_METHOD;
use super::reading;
use super::words::{self, control};
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::DriveProfile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// The methods that the manual describes.
const DESCRIBED: [i8; 4] = [17, 18, 19, 21];
/// The methods that the manual names but does not describe.
const NAMED: [i8; 2] = [20, 22];
/// Time until the statusword bits of an earlier homing are gone.
const BEGIN_NS: Nanoseconds = 50_000_000;
/// Interval between two readings.
const POLL_NS: Nanoseconds = 20_000_000;
/// Time without motion after which the start sequence of CiA 402 is tried.
const START_NS: Nanoseconds = 1_000_000_000;

/// `home`
pub async fn home(
    c: &SdoSession,
    s: &TargetDrive,
    method: Option<i8>,
    within_ns: Nanoseconds,
    is_forced: bool,
) -> Result<Report, Failure> {
    let method = check(method, is_forced)?;
    let work = async {
        enabling::prepare(c, s, mode::POSITION, &DriveProfile::default()).await?;
        c.step("homing method");
        c.write_and_check(&HOMING_METHOD, method.into()).await?;
        let began = c.read(&POSITION_ACTUAL_VALUE).await?;
        c.step("homing");
        c.write(&MODES_OF_OPERATION, mode::HOMING).await?;
        c.pause(BEGIN_NS).await?;
        let ended = wait(c, s, began, within_ns).await?;
        let mut report = Report::new();
        report.add("method", "method", method, method.to_string());
        report.add("home_counts", "position after homing", ended, format!("{ended} counts"));
        Ok(report)
    };
    with_torque(c, s, false, work).await
}

fn check(method: Option<i8>, is_forced: bool) -> Result<i8, Failure> {
    let method = method.ok_or(Failure::Missing {
        what: "--method",
        why: "it says which input the switch is on: 17 negative limit on DIR, 18 positive limit on PU, 19 and 21 home \
              switch on DIR",
    })?;
    if DESCRIBED.contains(&method) || (NAMED.contains(&method) && is_forced) {
        return Ok(method);
    }
    if NAMED.contains(&method) {
        return Err(Failure::NeedsConsent {
            consequence: "the manual names this method but does not describe it: the direction is not known",
            option: "--force",
        });
    }
    Err(Failure::Unsupported {
        what: format!("this drive has no homing method {method}"),
        instead: "it has 17, 18, 19 and 21".to_owned(),
    })
}

async fn wait(c: &SdoSession, s: &TargetDrive, began: i64, within_ns: Nanoseconds) -> Result<i64, Failure> {
    let began_ns = c.now_ns();
    let near = (s.counts_per_turn / 100.0) as i64;
    let mut is_started = false;
    loop {
        let reading = reading::read(c, s).await?;
        c.show(reading);
        let word = reading.status_bits();
        if word & words::ALARM != 0 {
            return Err(reading::faulted(reading::alarm(c).await?));
        }
        if word & words::HOMING_ERROR != 0 {
            return Err(Failure::Homing("the drive reports a homing error (statusword bit 13)"));
        }
        if word & words::HOMING_COMPLETE != 0 {
            // The position in `reading` may be older than the new zero.
            return c.read(&POSITION_ACTUAL_VALUE).await;
        }
        let waited_ns = c.now_ns().saturating_sub(began_ns);
        if waited_ns >= within_ns {
            c.write(&CONTROLWORD, control::HALT).await?;
            return Err(Failure::Homing("the home position was not found in time; the axis was halted"));
        }
        let has_moved = is_started || (reading.position_counts - began).abs() > near;
        is_started = has_moved;
        if !has_moved && waited_ns >= START_NS {
            c.note("no motion in homing mode: starting it with controlword 000Fh and 001Fh");
            c.write(&CONTROLWORD, control::ENABLE).await?;
            c.pause(POLL_NS).await?;
            c.write(&CONTROLWORD, control::RUN).await?;
            is_started = true;
        }
        c.pause(POLL_NS).await?;
    }
}
