//! Polls the readings of an axis, and reports its final position and its moves.

use takt_rt::Nanoseconds;
use takt_wire::canopen::objects::POSITION_ACTUAL_VALUE;

use super::contact;
use super::failure::Failure;
use super::report::Report;
use super::sdo_session::SdoSession;
use super::target::TargetDrive;
use super::task::MoveKind;
use crate::procedure::{AxisReading, ProcedureSession};

/// Shows a reading at each interval until the time is over, whatever the drive is spoken to by.
pub async fn watch<C>(
    c: &ProcedureSession<C>,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
    mut read: impl AsyncFnMut() -> Result<AxisReading, Failure>,
) -> Result<Report, Failure> {
    c.step("watch");
    let mut count = 0_u64;
    let counted = async || {
        count += 1;
        read().await
    };
    poll_until(c, every_ns, duration_ns, counted, |_| Ok(())).await?;
    let mut report = Report::new();
    report.add("readings", "readings", count, count.to_string());
    Ok(report)
}

/// Polls `read` at an interval until the time is over, and shows each reading; `check` can end it earlier with a failure.
pub async fn poll_until<C>(
    c: &ProcedureSession<C>,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
    mut read: impl AsyncFnMut() -> Result<AxisReading, Failure>,
    mut check: impl FnMut(&AxisReading) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let began_ns = c.now_ns();
    loop {
        let begun_ns = c.now_ns();
        let reading = read().await?;
        c.show(reading);
        check(&reading)?;
        let since = |then_ns: Nanoseconds| c.now_ns().saturating_sub(then_ns);
        let left_ns = duration_ns.map(|duration_ns| duration_ns.saturating_sub(since(began_ns)));
        if left_ns == Some(0) {
            return Ok(());
        }
        let pause_ns = every_ns.saturating_sub(since(begun_ns));
        c.pause(pause_ns.min(left_ns.unwrap_or(pause_ns))).await;
        if c.is_interrupted() {
            return Err(Failure::Interrupted);
        }
    }
}

/// Checks the target position before anything is changed in the drive.
pub async fn check_target(c: &SdoSession, s: &TargetDrive, kind: MoveKind) -> Result<(), Failure> {
    if let MoveKind::Absolute { to, .. } | MoveKind::Reciprocate { to, .. } = kind {
        s.check_position(s.position_counts(to))?;
    }
    contact::connect_family(c, s).await?;
    c.step("plan the move");
    let here = c.read(&POSITION_ACTUAL_VALUE).await?;
    match kind {
        MoveKind::Relative(by) => s.check_position(here.saturating_add(s.distance_counts(by))),
        MoveKind::Reciprocate { .. } => s.check_position(here),
        MoveKind::Absolute { .. } | MoveKind::Continuous { .. } => Ok(()),
    }
}

/// Final position and state of the axis.
pub fn summary(s: &TargetDrive, reading: &AxisReading) -> Report {
    let mut report = Report::new();
    report.add("position", "position", reading.position, s.position_quantity().show(reading.position));
    let counts = reading.position_counts;
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("state", "state", reading.state, reading.state);
    report
}

/// The result of a run at a velocity: drive units, and the positions before and after in counts.
pub fn run_report(s: &TargetDrive, commanded: i64, fastest: f64, began: i64, ended: i64) -> Report {
    let (commanded, way) = (s.velocity(commanded as f64), s.position(ended) - s.position(began));
    let (velocity, position) = (s.velocity_quantity(), s.position_quantity());
    let mut report = Report::new();
    report.add("commanded_velocity", "commanded velocity", commanded, velocity.show(commanded));
    report.add("highest_velocity", "highest velocity", fastest, velocity.show(fastest));
    report.add("travelled", "travelled", way, position.show(way));
    report
}

/// The result of moves to targets, in counts.
pub fn move_report(s: &TargetDrive, from: i64, target: i64, moves: u32, error: i64) -> Report {
    let (from, target, position) = (s.position(from), s.position(target), s.position_quantity());
    let mut report = Report::new();
    report.add("from", "from", from, position.show(from));
    report.add("target", "target", target, position.show(target));
    report.add("moves", "moves", moves, moves.to_string());
    report.add("error_counts", "error", error, format!("{error} counts"));
    report
}
