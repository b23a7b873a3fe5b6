//! Profile position: every target with its handshake (607A, bit 4, status bit 12, bit 4 off, status bit 12 off).

use takt_rt::{Nanoseconds, OperationMode, controlword, statusword};

use super::{LOOK_NS, begin, with_torque};
use crate::canopen::objects::*;
use crate::commission::conversation::Conversation;
use crate::commission::erob_canopen::{enabling, reading};
use crate::commission::failure::Failure;
use crate::commission::looking;
use crate::commission::pace::{Pace, Profile};
use crate::commission::report::Report;
use crate::commission::request::Course;
use crate::commission::subject::Subject;

/// The drive acknowledges a set-point within this.
const ACKNOWLEDGE_NS: Nanoseconds = 1_000_000_000;

/// `move absolute`, `move relative`, `move reciprocate`
pub async fn run(
    c: &Conversation,
    s: &Subject,
    course: Course,
    pace: Pace,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let profile = s.profile(&pace)?;
    looking::check_course(c, s, course).await?;
    let is_immediate = matches!(course, Course::Absolute { is_immediate: true, .. });
    let work = async {
        let rated = begin(c, s, OperationMode::ProfilePosition, &profile).await?;
        let profile = complete(c, profile).await?;
        c.step("way");
        let here = c.read(&POSITION_ACTUAL_VALUE).await?;
        let (target, stops, dwell_ns) = match course {
            Course::Absolute { to, .. } => (s.position_counts(to), 1, 0),
            Course::Relative(by) => (here.saturating_add(s.distance_counts(by)), 1, 0),
            Course::Reciprocate { to, times, dwell_ns } => (s.position_counts(to), 2 * times, dwell_ns),
            Course::Continuous { .. } => {
                return Err(Failure::Unsuitable("a continuous move has no target".to_owned()));
            }
        };
        s.check_position(target)?;
        let mut at = enabling::enable(c, s).await?;
        for stop in 0..stops {
            let next = if stop % 2 == 0 { target } else { here };
            set_point(c, next, is_immediate).await?;
            arrive(c, s, rated, &profile, at, next).await?;
            at = next;
            c.pause(dwell_ns).await?;
        }
        if keeps_enabled {
            c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
        }
        let reached = c.read(&POSITION_ACTUAL_VALUE).await?;
        Ok(looking::move_report(s, here, target, stops, reached - at))
    };
    with_torque(c, s, keeps_enabled, work).await
}

/// What the profile leaves to the drive, as the drive has it.
async fn complete(c: &Conversation, profile: Profile) -> Result<Profile, Failure> {
    let velocity = match profile.velocity {
        Some(velocity) => velocity,
        None => c.read(&PROFILE_VELOCITY).await?,
    };
    if velocity <= 0 {
        return Err(Failure::Missing { what: "--velocity", why: "the drive's profile velocity (6081) is 0" });
    }
    let acceleration = match (profile.acceleration, profile.deceleration) {
        (Some(acceleration), Some(deceleration)) => acceleration.min(deceleration),
        _ => c.read(&PROFILE_ACCELERATION).await?.min(c.read(&PROFILE_DECELERATION).await?),
    };
    Ok(Profile { velocity: Some(velocity), acceleration: Some(acceleration.max(1)), ..profile })
}

async fn set_point(c: &Conversation, target: i64, is_immediate: bool) -> Result<(), Failure> {
    c.step("set-point");
    c.write(&TARGET_POSITION, target).await?;
    let is_acknowledged = |word: i64| word as u16 & statusword::BIT_12 != 0;
    let word = controlword::ENABLE_OPERATION;
    let change = if is_immediate { controlword::BIT_5 } else { 0 };
    c.write(&CONTROLWORD, (word | controlword::BIT_4 | change).into()).await?;
    c.wait_for(&STATUSWORD, "the acknowledgement of the set-point", ACKNOWLEDGE_NS, is_acknowledged).await?;
    c.write(&CONTROLWORD, word.into()).await?;
    let what = "the end of the acknowledgement";
    c.wait_for(&STATUSWORD, what, ACKNOWLEDGE_NS, |word| !is_acknowledged(word)).await.map(|_| ())
}

async fn arrive(
    c: &Conversation,
    s: &Subject,
    rated: Option<f64>,
    profile: &Profile,
    from: i64,
    to: i64,
) -> Result<(), Failure> {
    c.step("move");
    let (velocity, acceleration) = (profile.velocity.unwrap_or(1), profile.acceleration.unwrap_or(1));
    let within_ns = s.longest_ns(to - from, velocity, acceleration);
    let near = (s.counts_per_turn / 360.0) as i64;
    let began_ns = c.now_ns();
    loop {
        let reading = reading::read_enabled(c, s, rated).await?;
        let is_near = (reading.position_counts - to).abs() <= near;
        if reading.statusword & statusword::TARGET_REACHED != 0 && is_near {
            return Ok(());
        }
        let waited_ns = c.now_ns().saturating_sub(began_ns);
        if waited_ns >= within_ns {
            let (object, last) = (POSITION_ACTUAL_VALUE, reading.position_counts);
            return Err(Failure::NotInTime { object, what: "the target", last, waited_ns });
        }
        c.pause(LOOK_NS).await?;
    }
}
