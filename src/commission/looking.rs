//! Looking at an axis: once in the end, again and again while it moves, or for somebody who watches.

use takt_rt::Nanoseconds;

use super::contact;
use super::conversation::Conversation;
use super::event::Reading;
use super::failure::Failure;
use super::report::Report;
use super::request::Course;
use super::subject::Subject;
use crate::canopen::objects::POSITION_ACTUAL_VALUE;

/// Shows what `read` reads until it is time.
pub async fn watch(
    c: &Conversation,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
    mut read: impl AsyncFnMut() -> Result<Reading, Failure>,
) -> Result<Report, Failure> {
    c.step("watch");
    let mut looks = 0_u64;
    let show = async || {
        let reading = read().await?;
        c.show(reading);
        looks += 1;
        Ok(reading)
    };
    tend(c, every_ns, duration_ns, show, |_| Ok(())).await?;
    let mut report = Report::new();
    report.add("readings", "readings", looks, looks.to_string());
    Ok(report)
}

/// Looks at what `read` reads for a time, every so often; `look` may end it before.
pub async fn tend(
    c: &Conversation,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
    mut read: impl AsyncFnMut() -> Result<Reading, Failure>,
    mut look: impl FnMut(&Reading) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let began_ns = c.now_ns();
    loop {
        let begun_ns = c.now_ns();
        look(&read().await?)?;
        let since = |then_ns: Nanoseconds| c.now_ns().saturating_sub(then_ns);
        let left_ns = duration_ns.map(|duration_ns| duration_ns.saturating_sub(since(began_ns)));
        if left_ns == Some(0) {
            return Ok(());
        }
        let pause_ns = every_ns.saturating_sub(since(begun_ns));
        c.pause(pause_ns.min(left_ns.unwrap_or(pause_ns))).await?;
    }
}

/// Checks where a course leads before anything is changed: a drive that is not moved is left as it is.
pub async fn check_course(c: &Conversation, s: &Subject, course: Course) -> Result<(), Failure> {
    if let Course::Absolute { to, .. } | Course::Reciprocate { to, .. } = course {
        s.check_position(s.position_counts(to))?;
    }
    contact::reach_family(c, s).await?;
    c.step("way");
    let here = c.read(&POSITION_ACTUAL_VALUE).await?;
    match course {
        Course::Relative(by) => s.check_position(here.saturating_add(s.distance_counts(by))),
        Course::Reciprocate { .. } => s.check_position(here),
        Course::Absolute { .. } | Course::Continuous { .. } => Ok(()),
    }
}

/// Where the axis is in the end.
pub fn summary(s: &Subject, reading: &Reading) -> Report {
    let mut report = Report::new();
    report.add("position", "position", reading.position, s.position_quantity().show(reading.position));
    let counts = reading.position_counts;
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("state", "state", reading.state, reading.state);
    report
}

/// What came of a run at a velocity in drive units, from one count to another.
pub fn run_report(s: &Subject, commanded: i64, fastest: f64, began: i64, ended: i64) -> Report {
    let (commanded, way) = (s.velocity(commanded as f64), s.position(ended) - s.position(began));
    let (velocity, position) = (s.velocity_quantity(), s.position_quantity());
    let mut report = Report::new();
    report.add("commanded_velocity", "commanded velocity", commanded, velocity.show(commanded));
    report.add("highest_velocity", "highest velocity", fastest, velocity.show(fastest));
    report.add("travelled", "travelled", way, position.show(way));
    report
}

/// What came of moves to targets, in counts.
pub fn move_report(s: &Subject, from: i64, target: i64, moves: u32, error: i64) -> Report {
    let (from, target, position) = (s.position(from), s.position(target), s.position_quantity());
    let mut report = Report::new();
    report.add("from", "from", from, position.show(from));
    report.add("target", "target", target, position.show(target));
    report.add("moves", "moves", moves, moves.to_string());
    report.add("error_counts", "error", error, format!("{error} counts"));
    report
}
