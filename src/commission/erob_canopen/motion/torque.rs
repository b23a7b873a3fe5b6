//! Profile torque, with an eye on the velocity: nothing else limits it in this mode.

use takt_rt::{Nanoseconds, OperationMode};

use super::{begin, tend, with_torque};
use crate::canopen::objects::*;
use crate::commission::conversation::Conversation;
use crate::commission::erob_canopen::enabling;
use crate::commission::failure::Failure;
use crate::commission::pace::Profile;
use crate::commission::report::Report;
use crate::commission::subject::{Amount, Subject};

/// Between two looks: an unloaded joint gains speed quickly.
const LOOK_NS: Nanoseconds = 2_000_000;
/// The part of the axis' velocity limit that is permitted when nothing else is asked for.
const PERMITTED: f64 = 0.25;

/// `torque`
pub async fn run(
    c: &Conversation,
    s: &Subject,
    torque: Amount,
    velocity_limit: Option<Amount>,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    if let Amount::Joint(torque) = torque {
        s.check_torque(torque)?;
    }
    let permitted = s.limits.map(|limits| Amount::Joint(PERMITTED * limits.velocity));
    let limit = velocity_limit.or(permitted).map(|limit| s.velocity_raw(limit));
    let limit = limit.ok_or(Failure::Missing {
        what: "--max-velocity",
        why: "a torque alone limits no speed, and without a configuration nothing is known of the axis' limits",
    })?;
    s.check_velocity(limit)?;
    let limit = s.velocity(limit as f64).abs();
    let work = async {
        let rated = begin(c, s, OperationMode::ProfileTorque, &Profile::default()).await?;
        let Some(rated) = rated else {
            return Err(Failure::Unsupported {
                what: "the drive does not tell its rated torque (6076)".to_owned(),
                instead: "torque cannot be commanded without it".to_owned(),
            });
        };
        let per_mille = per_mille(s, torque, rated)?;
        let real = super::reading::torque(s, Some(rated), per_mille).unwrap_or(0.0);
        s.check_torque(real)?;
        let began = enabling::enable(c, s).await?;
        c.step("torque");
        c.write(&TARGET_TORQUE, per_mille).await?;
        let mut fastest = 0.0_f64;
        tend(c, s, Some(rated), duration_ns, LOOK_NS, |reading| {
            fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { fastest };
            s.check_room(reading, None)?;
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

/// Torque to per mille of the rated torque: 6071 is 16 bits in per mille, whatever the vendor's screens say.
fn per_mille(s: &Subject, torque: Amount, rated: f64) -> Result<i64, Failure> {
    match torque {
        Amount::Drive(per_mille) => Ok(per_mille),
        Amount::Joint(torque) => {
            let scale = s.scale.with_rated_torque(rated);
            let scale = scale.map_err(|error| Failure::Contradicted(format!("rated torque: {error:?}")))?;
            Ok(scale.torque_to_per_mille(torque).into())
        }
    }
}
