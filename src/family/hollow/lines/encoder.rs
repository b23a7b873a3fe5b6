//! The hollow encoder: its position, read once or at intervals.

use takt_rt::Nanoseconds;
use takt_rt::transparent::{FrameReader, TransparentFrame};
use takt_wire::hollow_lines::encoder::{EncoderReading, REQUEST};

use super::client::{LineClient, LineSession};
use super::unsupported;
use crate::family::commission::polling;
use crate::family::commission::{DriveTask, Failure, Report, TargetDrive, Task};
use crate::procedure::{AxisReading, Procedure};

/// How long the encoder has for its reply. The manual does not say.
const REPLY_NS: Nanoseconds = 100_000_000;
/// A disturbed reply is no reply: how often it is asked.
const TRIES: usize = 5;

/// A task with the encoder.
///
/// # Errors
/// An encoder cannot do it.
pub fn begin(target: TargetDrive, task: Task) -> Result<DriveTask<Vec<u8>>, Failure> {
    if !matches!(task, Task::Info | Task::Watch { .. }) {
        return Err(unsupported("an encoder is only read", "`info` and `watch` show its position"));
    }
    let session = LineSession::new(LineClient::default());
    let c = session.clone();
    let procedure = Procedure::new(session, async move {
        match task {
            Task::Watch { every_ns, duration_ns } => watch(&c, &target, every_ns, duration_ns).await,
            _ => info(&c, &target).await,
        }
    });
    Ok(DriveTask::new(procedure, |bytes: &Vec<u8>| {
        let frame = bytes.as_slice().try_into().ok().and_then(TransparentFrame::decode);
        frame.map_or_else(String::new, |frame| match frame {
            REQUEST => "request for the position".to_owned(),
            reply => format!("{} counts", EncoderReading::of(&reply).position),
        })
    }))
}

async fn read(c: &LineSession) -> Result<EncoderReading, Failure> {
    for _ in 0..TRIES {
        c.say(REQUEST.encode());
        let (mut reader, mut is_returned) = (FrameReader::default(), false);
        let reply = c.until(|| {
            while let Some(byte) = c.hear() {
                match reader.push(byte) {
                    Some(reply) if reply != REQUEST => return Some(reply),
                    // A line that returns what is sent to it returns the request. So does an encoder that stands at zero.
                    Some(_) => is_returned = true,
                    None => {}
                }
            }
            None
        });
        let end_ns = c.now_ns().saturating_add(REPLY_NS);
        let reply = c.unless_over(|| c.now_ns() >= end_ns || c.is_interrupted(), reply).await;
        if c.is_interrupted() {
            return Err(Failure::Interrupted);
        }
        if let Some(reply) = reply.or_else(|| is_returned.then_some(REQUEST)) {
            return Ok(EncoderReading::of(&reply));
        }
    }
    Err(Failure::Request {
        what: "the encoder does not answer".to_owned(),
        cure: Some(
            "check the wiring (A and B), its supply, and the bit rate: the manual does not state it, so try 1000000 and 19200 \
             (serial:/dev/ttyUSB0@1000000)",
        ),
    })
}

fn show(c: &LineSession, s: &TargetDrive, encoder: EncoderReading) -> AxisReading {
    AxisReading {
        at_ns: c.now_ns(),
        position: s.position(encoder.position),
        position_counts: encoder.position,
        state: "read",
        ..AxisReading::default()
    }
}

async fn info(c: &LineSession, s: &TargetDrive) -> Result<Report, Failure> {
    c.step("read");
    let encoder = read(c).await?;
    let mut report = Report::new();
    let (counts, angle) = (encoder.position, encoder.angle());
    report.add("position_counts", "position", counts, format!("{counts} counts"));
    report.add("angle", "angle in its turn", angle, s.position_quantity().show(angle));
    if counts == 0 {
        c.note("the answer is the same as the request: the encoder stands at zero, or the line returns what is sent to it");
    }
    c.note("the manual does not state the counts of a turn: 1048576 are assumed, as the motors have them");
    Ok(report)
}

async fn watch(
    c: &LineSession,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    polling::watch(c, every_ns, duration_ns, async || Ok(show(c, s, read(c).await?))).await
}
