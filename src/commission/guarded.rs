//! Whatever happens to a motion, its axis is brought to rest and disabled.

use serde_json::Value;

use super::conversation::Conversation;
use super::failure::Failure;
use super::report::Report;
use super::subject::Subject;

/// Does `work`; then, unless that succeeded and torque is to stay on, does `rest`. A second request to end cuts `rest`
/// short and does `cut` at once.
pub async fn guarded(
    c: &Conversation,
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
        (Err(failure), Err(trouble)) => {
            c.note(format!("the axis may not be at rest: {trouble}; use the emergency stop"));
            Err(failure)
        }
        (Err(failure), Ok(())) => Err(failure),
        (Ok(_), Err(trouble)) => Err(trouble),
        (Ok(report), Ok(())) => Ok(report),
    }
}

/// Adds where the axis has ended: to the report, or as a note to what went wrong.
pub fn tell_end(
    c: &Conversation,
    subject: &Subject,
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
            c.note(format!("the axis is at {}, {state}", subject.position_quantity().show(position)));
            Err(failure)
        }
        (Err(failure), Err(_)) => Err(failure),
    }
}
