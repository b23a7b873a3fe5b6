//! Every motion of an eRob: prepared, watched, and ended at rest.

pub mod position;
pub mod torque;

use takt_rt::{Nanoseconds, OperationMode};

use super::{enabling, reading};
use crate::canopen::objects::*;
use crate::commission::conversation::Conversation;
use crate::commission::event::Reading;
use crate::commission::failure::Failure;
use crate::commission::guarded::{guarded, tell_end};
use crate::commission::looking;
use crate::commission::pace::{Pace, Profile};
use crate::commission::report::Report;
use crate::commission::subject::{Amount, Subject};

/// Between two looks at an axis that moves.
const LOOK_NS: Nanoseconds = 20_000_000;

/// Prepares the drive, does `work` with it, and leaves it at rest.
pub(super) async fn with_torque(
    c: &Conversation,
    s: &Subject,
    keeps_enabled: bool,
    work: impl Future<Output = Result<Report, Failure>>,
) -> Result<Report, Failure> {
    enabling::greet(c, s).await?;
    let ended = guarded(c, keeps_enabled, work, enabling::leave(c, s), enabling::torque_off(c)).await;
    tell_end(c, s, ended, reading::summary(c, s).await)
}

/// `enable`
pub async fn enable(
    c: &Conversation,
    s: &Subject,
    hold_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let work = async {
        let rated = begin(c, s, OperationMode::ProfilePosition, &Profile::default()).await?;
        let position = enabling::enable(c, s).await?;
        if keeps_enabled {
            // Nobody would feed the watch after the end of this program.
            c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
        } else {
            c.step("hold");
            tend(c, s, rated, hold_ns, LOOK_NS, |_| Ok(())).await?;
        }
        let mut report = Report::new();
        report.add(
            "held_at",
            "held at",
            s.position(position),
            s.position_quantity().show(s.position(position)),
        );
        Ok(report)
    };
    with_torque(c, s, keeps_enabled, work).await
}

/// `velocity`
pub async fn velocity(
    c: &Conversation,
    s: &Subject,
    velocity: Amount,
    pace: Pace,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let raw = s.velocity_raw(velocity);
    s.check_velocity(raw)?;
    let profile = s.profile(&Pace { velocity: None, ..pace })?;
    with_torque(c, s, keeps_enabled, run_at(c, s, raw, profile, duration_ns, keeps_enabled)).await
}

/// `move continuous`
pub async fn continuous(
    c: &Conversation,
    s: &Subject,
    is_forward: bool,
    pace: Pace,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let profile = s.profile(&pace)?;
    let speed = profile.velocity.ok_or(Failure::Missing {
        what: "--velocity",
        why: "without a configuration nothing is known of the axis' limits",
    })?;
    let forward = s.velocity_raw(Amount::Joint(1.0)).signum() * if is_forward { 1 } else { -1 };
    let run = run_at(c, s, forward * speed, profile, duration_ns, keeps_enabled);
    with_torque(c, s, keeps_enabled, run).await
}

async fn run_at(
    c: &Conversation,
    s: &Subject,
    raw: i64,
    profile: Profile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let rated = begin(c, s, OperationMode::ProfileVelocity, &profile).await?;
    let began = enabling::enable(c, s).await?;
    s.check_way(began, raw)?;
    c.step("run");
    c.write(&TARGET_VELOCITY, raw).await?;
    let mut fastest = 0.0_f64;
    tend(c, s, rated, duration_ns, LOOK_NS, |reading| {
        fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { fastest };
        s.check_room(reading, None)
    })
    .await?;
    c.step("ramp to standstill");
    c.write(&TARGET_VELOCITY, 0).await?;
    let deceleration = match profile.deceleration {
        Some(deceleration) => deceleration,
        None => c.read(&PROFILE_DECELERATION).await?,
    };
    let within_ns = s.stopping_ns(raw, deceleration.max(1));
    let slow = (raw.abs() / 100).max(200);
    c.wait_for(&VELOCITY_ACTUAL_VALUE, "standstill", within_ns, |velocity| velocity.abs() <= slow).await?;
    if keeps_enabled {
        c.write(&CONSUMER_HEARTBEAT_TIME, 0).await?;
    }
    let ended = c.read(&POSITION_ACTUAL_VALUE).await?;
    Ok(looking::run_report(s, raw, fastest, began, ended))
}

/// [`enabling::prepare`], and the rated torque.
async fn begin(
    c: &Conversation,
    s: &Subject,
    mode: OperationMode,
    profile: &Profile,
) -> Result<Option<f64>, Failure> {
    enabling::prepare(c, s, mode, profile).await?;
    reading::rated_torque(c).await
}

/// Looks after an enabled axis for a time.
async fn tend(
    c: &Conversation,
    s: &Subject,
    rated: Option<f64>,
    duration_ns: Option<Nanoseconds>,
    every_ns: Nanoseconds,
    look: impl FnMut(&Reading) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let read = async || reading::read_enabled(c, s, rated).await;
    looking::tend(c, every_ns, duration_ns, read, look).await
}
