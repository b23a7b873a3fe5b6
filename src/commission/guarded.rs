//! Whatever happens to a motion, its axis is brought to rest and disabled.

use super::conversation::Conversation;
use super::failure::Failure;
use super::report::Report;

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
