//! Brings an axis to standstill and disables it after every motion, whatever the result.

use serde_json::Value;

use super::failure::Failure;
use super::report::Report;
use super::sdo_session::SdoSession;
use super::target::TargetDrive;

/// Runs `work`, then `rest`. `rest` is left out when `work` succeeded and the axis stays enabled. A further
/// interruption cuts `rest` short and runs `cut`, which takes the torque off at once.
pub async fn guarded(
    c: &SdoSession,
    keeps_enabled: bool,
    work: impl Future<Output = Result<Report, Failure>>,
    rest: impl Future<Output = Result<(), Failure>>,
    cut: impl Future<Output = Result<(), Failure>>,
) -> Result<Report, Failure> {
    let done = work.await;
    if done.is_err() {
        c.keep_failing_step();
    }
    c.ignore_interruptions();
    if done.is_ok() && keeps_enabled {
        c.note("the axis stays enabled");
        return done;
    }
    let rested = match rest.await {
        Err(Failure::Interrupted) => {
            c.ignore_interruptions();
            c.step("torque off at once");
            cut.await
        }
        rested => rested,
    };
    match (done, rested) {
        (Err(failure), Err(stop_failure)) => {
            c.note(format!("the axis may still be moving: {stop_failure}; use the emergency stop"));
            Err(failure)
        }
        (Err(failure), Ok(())) => Err(failure),
        (Ok(_), Err(stop_failure)) => Err(stop_failure),
        (Ok(report), Ok(())) => Ok(report),
    }
}

/// Adds the final position to the report, or notes it when the procedure failed.
pub fn add_final_position(
    c: &SdoSession,
    target: &TargetDrive,
    ended: Result<Report, Failure>,
    summary: Result<Report, Failure>,
) -> Result<Report, Failure> {
    match (ended, summary) {
        (Ok(mut report), Ok(summary)) => {
            report.append(summary);
            Ok(report)
        }
        (Ok(_), Err(failure)) => Err(failure),
        (Err(failure), Ok(summary)) => {
            let position = summary.get("position").and_then(Value::as_f64).unwrap_or_default();
            let state = summary.get("state").and_then(Value::as_str).unwrap_or_default();
            c.note(format!("the axis is at {}, {state}", target.position_quantity().show(position)));
            Err(failure)
        }
        (Err(failure), Err(_)) => Err(failure),
    }
}
