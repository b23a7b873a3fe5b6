//! What the drive says of itself.

use takt_rt::{FieldMode, LifeState, Nanoseconds, ReplyValue};
use takt_wire::bit_fields::ReplyMoment;

use super::FieldTask;
use crate::family::commission::polling;
use crate::family::commission::{Failure, Report};
use crate::procedure::AxisReading;

/// The state of the drive in a word.
pub fn state(task: &FieldTask) -> &'static str {
    let client = task.c.client();
    let has_error = client.drive().reported(client.parameters(), ReplyValue::Error);
    match client.state() {
        _ if has_error.is_some_and(|error| error != 0.0) => "fault",
        LifeState::Stopping => "stopping",
        LifeState::Stopped | LifeState::Telling(_) | LifeState::Told(_) => "stopped",
        LifeState::Choosing(_) | LifeState::Aligning(_) | LifeState::Starting(_) => "starting",
        LifeState::Running(_) | LifeState::Changing { .. } => "running",
    }
}

/// The last reply as a reading of the axis.
pub fn reading(task: &FieldTask) -> AxisReading {
    let client = task.c.client();
    let reported = |value| client.drive().reported(client.parameters(), value);
    let position = client.position().unwrap_or(0.0);
    AxisReading {
        at_ns: task.c.now_ns(),
        position,
        position_counts: counts(task, position),
        velocity: reported(ReplyValue::Velocity).unwrap_or(0.0),
        torque: reported(ReplyValue::Torque),
        current_a: None,
        temperature_c: reported(ReplyValue::Temperature),
        statusword: None,
        state: state(task),
    }
}

/// Counts of the shaft, beyond the 32 bits that other drives have.
pub fn counts(task: &FieldTask, position: f64) -> i64 {
    let zero = task.s.position(0);
    ((position - zero) * task.s.scale.resolution()).round() as i64
}

/// The word for a mode.
pub const fn mode_word(mode: FieldMode) -> &'static str {
    match mode {
        FieldMode::Torque => "torque",
        FieldMode::Velocity => "velocity",
        FieldMode::Position => "position",
    }
}

/// `info`
pub async fn info(task: &FieldTask) -> Result<Report, Failure> {
    listen(task).await?;
    let (s, description) = (&task.s, &task.device.description);
    let mut report = Report::new();
    let drive = &description.drive;
    let protocol = format!("{}, {}", drive.vendor, drive.product);
    report.add("protocol", "protocol", protocol.clone(), protocol);
    report.add("motor_id", "motor ID", s.node, s.node.to_string());
    let reply_id = task.c.client().parameters().reply.id();
    report.add("reply_id", "reply identifier", reply_id.value(), format!("0x{:03X}", reply_id.value()));
    let reading = reading(task);
    report.add("state", "state", reading.state, reading.state);
    report.add("position", "position", reading.position, s.position_quantity().show(reading.position));
    let counts = reading.position_counts;
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("velocity", "velocity", reading.velocity, s.velocity_quantity().show(reading.velocity));
    if let Some(torque) = reading.torque {
        report.add("torque", "torque", torque, s.effort_quantity().show(torque));
    }
    let client = task.c.client();
    let reported = |value| client.drive().reported(client.parameters(), value);
    if let Some(temperature) = reported(ReplyValue::Temperature) {
        report.add("temperature_c", "temperature", temperature, format!("{temperature} °C"));
    }
    if let (Some(code), takt_rt::LifeCycle::ByFields { modes }) =
        (reported(ReplyValue::Mode), &client.parameters().life_cycle)
    {
        let mode = match modes.mode(code) {
            Some(mode) => mode_word(mode),
            None => "unknown",
        };
        report.add("mode", "mode", mode, mode);
    }
    let error = reported(ReplyValue::Error);
    drop(client);
    if let Some(error) = error {
        let code = error as u16;
        let words = if code == 0 { "none".into() } else { s.error_words(code) };
        report.add("error_code", "error", code, words);
        if code != 0 {
            task.c.note(s.error_cure(code));
        }
    }
    if task.tells_to_ask() {
        task.c.note(
            "this protocol has no request that only reads: the motor has been told to have no torque, and has replied to that",
        );
    }
    Ok(report)
}

/// `watch`
pub async fn watch(
    task: &FieldTask,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    listen(task).await?;
    let read = async || {
        task.check_silence()?;
        Ok(reading(task))
    };
    polling::watch(&task.c, every_ns, duration_ns, read).await
}

/// Waits for replies: of a drive that reports by itself without a word to it.
async fn listen(task: &FieldTask) -> Result<(), Failure> {
    match task.device.description.reply_moment {
        ReplyMoment::AfterCommand { .. } => task.connect().await,
        ReplyMoment::Cyclic { .. } => task.hear().await,
    }
}

/// Returns `true` if the last reply shows this mode.
pub fn shows(task: &FieldTask, mode: FieldMode) -> bool {
    let client = task.c.client();
    let takt_rt::LifeCycle::ByFields { modes } = client.parameters().life_cycle else { return false };
    let shown = client.drive().reported(client.parameters(), ReplyValue::Mode);
    shown.and_then(|code| modes.mode(code)) == Some(mode)
}
