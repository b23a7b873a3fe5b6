//! Profile torque mode. The velocity is monitored here, because the drive does not limit it in this mode.

use takt_rt::{Nanoseconds, OperationMode};
use takt_wire::canopen::objects::*;

use super::{begin, check_velocity_is_shown, poll_until, with_torque};
use crate::family::commission::failure::Failure;
use crate::family::commission::motion_profile::DriveProfile;
use crate::family::commission::profile::{enabling, reading};
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::{CommandValue, TargetDrive};

/// Interval between two readings; short, because an unloaded joint accelerates quickly.
const POLL_NS: Nanoseconds = 2_000_000;
/// Default velocity limit as a share of the axis' limit.
const PERMITTED: f64 = 0.25;

/// `torque`
pub async fn run(
    c: &SdoSession,
    s: &TargetDrive,
    torque: CommandValue,
    velocity_limit: Option<CommandValue>,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    if let CommandValue::Joint(torque) = torque {
        s.check_torque(torque)?;
    }
    let permitted = s.limits.map(|limits| CommandValue::Joint(PERMITTED * limits.velocity));
    let limit = velocity_limit.or(permitted).map(|limit| s.velocity_raw(limit));
    let limit = limit.ok_or(Failure::Missing {
        what: "--max-velocity",
        why: "a torque command does not limit the velocity, and without a configuration the axis has no known limits",
    })?;
    s.check_velocity(limit)?;
    let limit = s.velocity(limit as f64).abs();
    check_velocity_is_shown(s)?;
    let work = async {
        let rated = begin(c, s, OperationMode::ProfileTorque, &DriveProfile::default()).await?;
        let Some(rated) = rated else {
            return Err(Failure::Unsupported {
                what: "the drive does not report its rated torque (6076)".to_owned(),
                instead: "say it in the configuration: [axis.joint] rated_torque".to_owned(),
            });
        };
        let per_mille = per_mille(s, torque, rated)?;
        let real = reading::torque(s, Some(rated), per_mille).unwrap_or(0.0);
        s.check_torque(real)?;
        let began = enabling::enable(c, s).await?;
        c.step("torque");
        c.write(&TARGET_TORQUE, per_mille).await?;
        let mut fastest = 0.0_f64;
        poll_until(c, s, Some(rated), duration_ns, POLL_NS, |reading| {
            fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { fastest };
            s.check_stopping_distance(reading, None)?;
            if reading.velocity.abs() <= limit {
                return Ok(());
            }
            let quantity = s.velocity_quantity();
            Err(Failure::AtLimit { quantity, value: reading.velocity, low: -limit, high: limit })
        })
        .await?;
        c.step("torque 0");
        c.write(&TARGET_TORQUE, 0).await?;
        let ended = c.read(&POSITION_ACTUAL_VALUE).await?;
        let way = s.position(ended) - s.position(began);
        let mut report = Report::new();
        report.add("torque", "torque", real, s.effort_quantity().show(real));
        report.add(
            "torque_per_mille",
            "of the rated torque",
            per_mille,
            format!("{} %", per_mille as f64 / 10.0),
        );
        report.add("rated_torque", "rated torque", rated, s.effort_quantity().show(rated));
        report.add("highest_velocity", "highest velocity", fastest, s.velocity_quantity().show(fastest));
        report.add("travelled", "travelled", way, s.position_quantity().show(way));
        Ok(report)
    };
    with_torque(c, s, false, work).await
}

/// Converts a torque to per mille of the rated torque, the unit of object 6071 (16 bits).
fn per_mille(s: &TargetDrive, torque: CommandValue, rated: f64) -> Result<i64, Failure> {
    match torque {
        CommandValue::Drive(per_mille) => Ok(per_mille),
        CommandValue::Joint(torque) => {
            let scale = s.scale.with_rated_torque(rated);
            let scale = scale.map_err(|error| Failure::Contradicted(format!("rated torque: {error:?}")))?;
            Ok(scale.torque_to_per_mille(torque).into())
        }
    }
}
