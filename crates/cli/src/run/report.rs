//! What a run prints in the end.

use serde::Serialize;

use takt::config::Config;
use takt::controller::realtime_thread::StartError;
use takt::controller::session::{Session, SessionError};
use takt::controller::{Outcome, unreleased_stop};
use takt::family;
use takt::telemetry::{RealtimeReport, RunEnd, RunOutcome, RunReport};
use takt_rt::{Fault, Phase, StopReason};

use crate::exit::Exit;
use crate::usage_error::UsageError;
use crate::{full_queue, ownership, print};

/// The report, with what is known beside it.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    report: &'a RunReport,
    /// Why the run ended, in words, where it was neither its end, nor Ctrl-C, nor a stop of the group.
    failure: Option<String>,
    /// The axes whose drives did not confirm in the end that they have no torque.
    unreached: Vec<&'a str>,
    /// The errors that drives showed in the end.
    drive_errors: Vec<DriveError>,
}

/// The error that a drive shows.
#[derive(Serialize)]
struct DriveError {
    axis: String,
    error: String,
    cure: &'static str,
}

/// Real-time set-up that was required and refused, as an object.
#[derive(Serialize)]
struct PrintedRefusal<'a> {
    error: String,
    problems: [(); 0],
    realtime: &'a RealtimeReport,
}

/// Prints why nothing was begun.
pub(super) fn refuse(error: &SessionError, is_json: bool) -> Exit {
    let report = match error {
        SessionError::Start(StartError::Refused(report)) => report,
        SessionError::Claim(error) => return ownership::usage_error(error).print(is_json),
        error => return UsageError::from(error.to_string()).print(is_json),
    };
    let realtime = RealtimeReport::new(report, 0, 0);
    if is_json {
        let printed = PrintedRefusal { error: error.to_string(), problems: [], realtime: &realtime };
        return print::indented_json(&printed, Exit::RealtimeRefused);
    }
    say!("takt: {error}");
    realtime.refused.iter().for_each(|refused| say!("  refused: {refused}"));
    realtime.grant_with.iter().for_each(|command| say!("  grant it with: {command}"));
    Exit::RealtimeRefused
}

/// Prints how it went.
pub(super) fn tell(config: &Config, session: &Session, as_json: bool) -> Exit {
    let faults = session.ended.map_or(0, |ended| ended.page_faults.minor + ended.page_faults.major);
    let spin_guard_ns = session.ended.map_or(0, |ended| ended.spin_guard_ns);
    let (ended, exit) = match session.outcome {
        Outcome::Finished => (RunEnd::Finished, Exit::Done),
        Outcome::Interrupted => (RunEnd::Interrupted, Exit::Interrupted),
        Outcome::TakenOver { .. } => (RunEnd::TakenOver, Exit::Interrupted),
        Outcome::Stopped(_) => (RunEnd::Stopped, Exit::Stopped),
        _ => (RunEnd::Failed, Exit::Stopped),
    };
    let outcome = RunOutcome {
        ended,
        realtime: RealtimeReport::new(&session.begun.report, spin_guard_ns, faults),
        last: session.snapshot,
        buses_open_ns: session.open_ns,
        targets: session.targets.clone(),
        stop: stop_of(session),
        is_power_off: is_power_off(session),
    };
    let report = RunReport::new(&session.log, &outcome);
    let unreached: Vec<&str> = session
        .unreached
        .iter()
        .filter_map(|axis| config.axes.get(*axis))
        .map(|axis| axis.name.as_str())
        .collect();
    family::unreached_words(config, &session.unreached).iter().for_each(|words| say!("takt: {words}"));
    let drive_errors = drive_errors(session);
    drive_errors.iter().for_each(|DriveError { axis, error, cure }| {
        say!("takt: {axis}: the drive shows {error}; try: {cure}");
    });
    let failure = failure(config, session);
    let exit = if report.telemetry.not_written.is_empty() { exit } else { exit.and_failed() };
    if as_json {
        return print::json(&Printed { report: &report, failure, unreached, drive_errors }, exit);
    }
    match failure {
        Some(failure) if ended == RunEnd::TakenOver => {
            say!("takt: {failure}");
            print::text(&report.render(print::emphasis()), exit)
        }
        Some(failure) => {
            say!("takt: {failure}");
            report.telemetry.black_boxes.iter().for_each(|path| say!("black box: {}", path.display()));
            exit
        }
        None => print::text(&report.render(print::emphasis()), exit),
    }
}

/// Drives that have never been active have confirmed nothing, and one whose reports contradict one another has not either.
fn is_power_off(session: &Session) -> bool {
    session.unreached.is_empty()
        && unreleased_stop(&session.snapshot).is_none()
        && session.snapshot.groups().iter().all(|group| group.phase == Phase::Disabled)
}

/// The errors of the drives that the stop does not tell already.
fn drive_errors(session: &Session) -> Vec<DriveError> {
    let machine = &session.log.machine;
    let told = stop_of(session).and_then(|stop| Some((stop.axis()?, stop.cause.fault().copied()?)));
    let is_told = |axis, code| told == Some((axis, Fault::DriveFault { error_code: code }));
    let errors =
        session.drive_errors.iter().filter_map(|(axis, code)| Some((u8::try_from(*axis).ok()?, *code)));
    let errors = errors.filter(|(axis, code)| !is_told(*axis, *code));
    let error = |(axis, code)| DriveError {
        axis: machine.axis_name(axis),
        error: machine.drive_error(axis, code).to_string(),
        cure: machine.drive_cure(axis, code),
    };
    errors.map(error).collect()
}

fn stop_of(session: &Session) -> Option<StopReason> {
    match session.outcome {
        Outcome::Stopped(stop) => Some(stop),
        Outcome::Interrupted | Outcome::TakenOver { .. } => session.snapshot.first_stop(),
        _ => None,
    }
}

/// Why the run ended, where the report does not say it.
fn failure(config: &Config, session: &Session) -> Option<String> {
    let words = session.outcome.words(&session.log.machine);
    match session.outcome {
        Outcome::Finished | Outcome::Interrupted | Outcome::Stopped(_) => None,
        Outcome::BringUpFailed(_) | Outcome::NotHeard { .. } | Outcome::Stuck { .. } => {
            // A drive cannot answer a frame that it was not sent.
            Some(
                full_queue::cause(config, &session.snapshot)
                    .map_or(words.clone(), |cause| format!("{words}; {cause}")),
            )
        }
        _ => Some(words),
    }
}
