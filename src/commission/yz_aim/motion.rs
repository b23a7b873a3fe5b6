//! Every motion of a YZ-AIM by SDO (manual 5.06.1, 5.06.2, 5.07.1): prepared, watched, and ended at rest.

use takt_rt::Nanoseconds;

use super::enabling::{self, mode};
use super::objects::ACCELERATION;
use super::reading;
use super::words::{self, control};
use crate::canopen::objects::*;
use crate::commission::conversation::Conversation;
use crate::commission::event::Reading;
use crate::commission::failure::Failure;
use crate::commission::guarded::{guarded, tell_end};
use crate::commission::looking;
use crate::commission::pace::{Pace, Profile};
use crate::commission::report::Report;
use crate::commission::request::Course;
use crate::commission::subject::{Amount, Subject};

/// Between two looks at an axis that moves.
const LOOK_NS: Nanoseconds = 20_000_000;
/// A set-point that nothing follows for so long was ignored, as the first one after enabling may be.
const IGNORED_NS: Nanoseconds = 500_000_000;
/// How often a set-point is repeated.
const REPETITIONS: u8 = 3;

/// Prepares the drive, does `work` with it, and leaves it at rest.
pub async fn with_torque(
    c: &Conversation,
    s: &Subject,
    keeps_enabled: bool,
    work: impl Future<Output = Result<Report, Failure>>,
) -> Result<Report, Failure> {
    enabling::greet(c, s).await?;
    let watch = c.read(&CONSUMER_HEARTBEAT_TIME).await?;
    let work = async {
        let report = work.await?;
        if keeps_enabled {
            // Nobody would feed the watch after the end of this program.
            enabling::release(c, watch).await?;
        }
        Ok(report)
    };
    let leave = enabling::leave(c, watch);
    let ended = guarded(c, keeps_enabled, work, leave, enabling::torque_off(c)).await;
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
        enabling::prepare(c, s, mode::POSITION, &Profile::default()).await?;
        let position = enabling::enable(c, s).await?;
        if !keeps_enabled {
            c.step("hold");
            tend(c, s, hold_ns, |_| Ok(())).await?;
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

/// `move absolute`, `move relative`, `move reciprocate`
pub async fn position(
    c: &Conversation,
    s: &Subject,
    course: Course,
    pace: Pace,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let profile = profile(s, &pace)?;
    looking::check_course(c, s, course).await?;
    let work = async {
        enabling::prepare(c, s, mode::POSITION, &profile).await?;
        let profile = complete(c, profile).await?;
        c.step("way");
        let here = c.read(&POSITION_ACTUAL_VALUE).await?;
        let (distance, target, stops, dwell_ns) = match course {
            Course::Absolute { to, .. } => (None, s.position_counts(to), 1, 0),
            Course::Relative(by) => {
                let distance = s.distance_counts(by);
                (Some(distance), here.saturating_add(distance), 1, 0)
            }
            Course::Reciprocate { to, times, dwell_ns } => (None, s.position_counts(to), 2 * times, dwell_ns),
            Course::Continuous { .. } => {
                return Err(Failure::Unsuitable("a continuous move has no target".to_owned()));
            }
        };
        s.check_position(target)?;
        let mut at = enabling::enable(c, s).await?;
        for stop in 0..stops {
            let next = if stop % 2 == 0 { target } else { here };
            let set_point = SetPoint { from: at, to: next, distance };
            set_point.go(c).await?;
            set_point.arrive(c, s, &profile).await?;
            at = next;
            c.pause(dwell_ns).await?;
        }
        c.step("hold");
        // Without bit 5 no later write of the target moves the axis.
        c.write(&CONTROLWORD, control::ENABLE).await?;
        let reached = c.read(&POSITION_ACTUAL_VALUE).await?;
        Ok(looking::move_report(s, here, target, stops, reached - at))
    };
    with_torque(c, s, keeps_enabled, work).await
}

/// One target: absolute and immediate (5.06.1), or a distance (5.06.2).
struct SetPoint {
    from: i64,
    to: i64,
    distance: Option<i64>,
}

impl SetPoint {
    async fn go(&self, c: &Conversation) -> Result<(), Failure> {
        c.step("set-point");
        match self.distance {
            None => {
                // The target is the actual position when bit 5 goes to 1, so that nothing moves by that.
                c.write(&CONTROLWORD, control::IMMEDIATE).await?;
                c.write(&TARGET_POSITION, self.to).await
            }
            Some(distance) => {
                c.write(&TARGET_POSITION, distance).await?;
                c.write(&CONTROLWORD, control::RELATIVE).await?;
                // Twice would be twice as far.
                c.write_once(&CONTROLWORD, control::RELATIVE_RUN).await
            }
        }
    }

    async fn arrive(&self, c: &Conversation, s: &Subject, profile: &Profile) -> Result<(), Failure> {
        c.step("move");
        let (velocity, acceleration) = (profile.velocity.unwrap_or(1), profile.acceleration.unwrap_or(1));
        let within_ns = s.longest_ns(self.to - self.from, velocity, acceleration);
        let near = (s.counts_per_turn / 100.0) as i64;
        let (began_ns, mut repeated, mut asked_ns) = (c.now_ns(), 0, c.now_ns());
        loop {
            let reading = reading::read_enabled(c, s).await?;
            let counts = reading.position_counts;
            if reading.statusword & words::TARGET_REACHED != 0 && (counts - self.to).abs() <= near {
                return Ok(());
            }
            let has_moved = (counts - self.from).abs() > near;
            let is_ignored = !has_moved && c.now_ns().saturating_sub(asked_ns) >= IGNORED_NS;
            if is_ignored && repeated < REPETITIONS {
                c.note("nothing follows the set-point: it is repeated");
                self.go(c).await?;
                c.step("move");
                (repeated, asked_ns) = (repeated + 1, c.now_ns());
            }
            let waited_ns = c.now_ns().saturating_sub(began_ns);
            if waited_ns >= within_ns {
                let object = POSITION_ACTUAL_VALUE;
                return Err(Failure::NotInTime { object, what: "the target", last: counts, waited_ns });
            }
            c.pause(LOOK_NS).await?;
        }
    }
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
    let profile = profile(s, &Pace { velocity: None, ..pace })?;
    with_torque(c, s, keeps_enabled, run_at(c, s, raw, profile, duration_ns)).await
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
    let profile = profile(s, &pace)?;
    let speed = profile.velocity.ok_or(Failure::Missing {
        what: "--velocity",
        why: "without a configuration nothing is known of the axis' limits",
    })?;
    let forward = s.velocity_raw(Amount::Joint(1.0)).signum() * if is_forward { 1 } else { -1 };
    with_torque(c, s, keeps_enabled, run_at(c, s, forward * speed, profile, duration_ns)).await
}

async fn run_at(
    c: &Conversation,
    s: &Subject,
    raw: i64,
    profile: Profile,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    let profile = Profile { velocity: None, ..profile };
    enabling::prepare(c, s, mode::VELOCITY, &profile).await?;
    let began = enabling::enable(c, s).await?;
    s.check_way(began, raw)?;
    let acceleration = c.read(&ACCELERATION).await?.max(1);
    c.step("run");
    c.write(&TARGET_VELOCITY, raw).await?;
    c.write(&CONTROLWORD, control::ENABLE).await?;
    let mut fastest = 0.0_f64;
    tend(c, s, duration_ns, |reading| {
        fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { fastest };
        s.check_room(reading, Some(acceleration))
    })
    .await?;
    c.step("ramp to standstill");
    c.write(&TARGET_VELOCITY, 0).await?;
    enabling::ramp_down(c).await?;
    let ended = c.read(&POSITION_ACTUAL_VALUE).await?;
    Ok(looking::run_report(s, raw, fastest, began, ended))
}

/// The drive has one acceleration for both directions: the lower one of those that were asked for.
fn profile(s: &Subject, pace: &Pace) -> Result<Profile, Failure> {
    let acceleration = pace.acceleration.or(pace.deceleration);
    let deceleration = pace.deceleration.or(pace.acceleration);
    let profile = s.profile(&Pace { velocity: pace.velocity, acceleration, deceleration })?;
    let slower = profile.acceleration.min(profile.deceleration);
    Ok(Profile { acceleration: slower, deceleration: None, ..profile })
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
    let acceleration = match profile.acceleration {
        Some(acceleration) => acceleration,
        None => c.read(&ACCELERATION).await?,
    };
    Ok(Profile { velocity: Some(velocity), acceleration: Some(acceleration.max(1)), deceleration: None })
}

/// Looks after an enabled axis for a time.
async fn tend(
    c: &Conversation,
    s: &Subject,
    duration_ns: Option<Nanoseconds>,
    look: impl FnMut(&Reading) -> Result<(), Failure>,
) -> Result<(), Failure> {
    looking::tend(c, LOOK_NS, duration_ns, async || reading::read_enabled(c, s).await, look).await
}
