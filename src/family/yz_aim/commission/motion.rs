//! Motion of a YZ-AIM by SDO (manual 5.06.1, 5.06.2, 5.07.1): every motion is prepared, monitored and ended at
//! standstill.

use takt_rt::Nanoseconds;
use takt_wire::canopen::objects::*;

use super::enabling::{self, mode};
use super::objects::ACCELERATION;
use super::reading;
use super::words::{self, control};
use crate::family::commission::failure::Failure;
use crate::family::commission::guarded::{add_final_position, guarded};
use crate::family::commission::motion_profile::{DriveProfile, MotionProfile};
use crate::family::commission::polling;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::{CommandValue, TargetDrive};
use crate::family::commission::task::MoveKind;
use crate::procedure::AxisReading;

/// Interval between two readings of a moving axis.
const POLL_NS: Nanoseconds = 20_000_000;
/// Time without motion after which a set-point counts as ignored. The first one after enabling may be ignored.
const IGNORED_NS: Nanoseconds = 500_000_000;
/// Repetitions of a set-point.
const REPETITIONS: u8 = 3;

/// Checks the drive, runs `work`, and disables the drive at standstill afterwards.
pub async fn with_torque(
    c: &SdoSession,
    s: &TargetDrive,
    keeps_enabled: bool,
    work: impl Future<Output = Result<Report, Failure>>,
) -> Result<Report, Failure> {
    enabling::check_ready(c, s).await?;
    let consumer_heartbeat = c.read(&CONSUMER_HEARTBEAT_TIME).await?;
    let work = async {
        let report = work.await?;
        if keeps_enabled {
            // The watchdog is disarmed, because the heartbeat ends with this program.
            enabling::restore_watchdog(c, consumer_heartbeat).await?;
        }
        Ok(report)
    };
    let shut_down = enabling::shut_down(c, consumer_heartbeat);
    let ended = guarded(c, keeps_enabled, work, shut_down, enabling::torque_off(c)).await;
    add_final_position(c, s, ended, reading::summary(c, s).await)
}

/// `enable`
pub async fn enable(
    c: &SdoSession,
    s: &TargetDrive,
    hold_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let work = async {
        enabling::prepare(c, s, mode::POSITION, &DriveProfile::default()).await?;
        let position = enabling::enable(c, s).await?;
        if !keeps_enabled {
            c.step("hold");
            poll_until(c, s, hold_ns, |_| Ok(())).await?;
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
    c: &SdoSession,
    s: &TargetDrive,
    kind: MoveKind,
    profile: MotionProfile,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    note_rounding(c, s, profile.velocity);
    let profile = drive_profile(s, &profile)?;
    polling::check_target(c, s, kind).await?;
    let work = async {
        enabling::prepare(c, s, mode::POSITION, &profile).await?;
        let profile = complete(c, profile).await?;
        c.step("plan the move");
        let here = c.read(&POSITION_ACTUAL_VALUE).await?;
        let (distance, target, stops, dwell_ns) = match kind {
            MoveKind::Absolute { to, .. } => (None, s.position_counts(to), 1, 0),
            MoveKind::Relative(by) => {
                let distance = s.distance_counts(by);
                (Some(distance), here.saturating_add(distance), 1, 0)
            }
            MoveKind::Reciprocate { to, times, dwell_ns } => {
                (None, s.position_counts(to), ends(times), dwell_ns)
            }
            MoveKind::Continuous { .. } => {
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
        // Clear bit 5, so that later writes of the target do not move the axis.
        c.write(&CONTROLWORD, control::ENABLE).await?;
        let reached = c.read(&POSITION_ACTUAL_VALUE).await?;
        Ok(polling::move_report(s, here, target, stops, reached - at))
    };
    with_torque(c, s, keeps_enabled, work).await
}

/// One target: absolute and immediate (5.06.1), or a relative distance (5.06.2).
struct SetPoint {
    from: i64,
    to: i64,
    distance: Option<i64>,
}

impl SetPoint {
    async fn go(&self, c: &SdoSession) -> Result<(), Failure> {
        c.step("set-point");
        match self.distance {
            None => {
                // The target is the actual position when bit 5 is set, so that this alone moves nothing.
                c.write(&CONTROLWORD, control::IMMEDIATE).await?;
                c.write(&TARGET_POSITION, self.to).await
            }
            Some(distance) => {
                c.write(&TARGET_POSITION, distance).await?;
                c.write(&CONTROLWORD, control::RELATIVE).await?;
                // A retry would move the distance twice.
                c.write_once(&CONTROLWORD, control::RELATIVE_RUN).await
            }
        }
    }

    async fn arrive(&self, c: &SdoSession, s: &TargetDrive, profile: &DriveProfile) -> Result<(), Failure> {
        c.step("move");
        let (velocity, acceleration) = (profile.velocity.unwrap_or(1), profile.acceleration.unwrap_or(1));
        let within_ns = s.longest_ns(self.to - self.from, velocity, acceleration);
        let near = (s.counts_per_turn / 100.0) as i64;
        let (began_ns, mut repeated, mut asked_ns) = (c.now_ns(), 0, c.now_ns());
        loop {
            let reading = reading::read_enabled(c, s).await?;
            let counts = reading.position_counts;
            if reading.status_bits() & words::TARGET_REACHED != 0 && (counts - self.to).abs() <= near {
                return Ok(());
            }
            let has_moved = (counts - self.from).abs() > near;
            let is_ignored = !has_moved && c.now_ns().saturating_sub(asked_ns) >= IGNORED_NS;
            if is_ignored && repeated < REPETITIONS {
                c.note("no motion after the set-point: it is repeated");
                self.go(c).await?;
                c.step("move");
                (repeated, asked_ns) = (repeated + 1, c.now_ns());
            }
            let waited_ns = c.now_ns().saturating_sub(began_ns);
            if waited_ns >= within_ns {
                let object = POSITION_ACTUAL_VALUE;
                return Err(Failure::NotInTime { object, what: "the target", last: counts, waited_ns });
            }
            c.pause(POLL_NS).await?;
        }
    }
}

/// `velocity`
pub async fn velocity(
    c: &SdoSession,
    s: &TargetDrive,
    velocity: CommandValue,
    profile: MotionProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let raw = s.velocity_raw(velocity);
    s.check_velocity(raw)?;
    note_rounding(c, s, Some(velocity));
    let profile = drive_profile(s, &MotionProfile { velocity: None, ..profile })?;
    with_torque(c, s, keeps_enabled, run_at(c, s, raw, profile, duration_ns)).await
}

/// `move continuous`
pub async fn continuous(
    c: &SdoSession,
    s: &TargetDrive,
    is_forward: bool,
    profile: MotionProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    note_rounding(c, s, profile.velocity);
    let profile = drive_profile(s, &profile)?;
    let speed = profile.velocity.ok_or(Failure::Missing {
        what: "--velocity",
        why: "without a configuration nothing is known of the axis' limits",
    })?;
    let forward = s.velocity_raw(CommandValue::Joint(1.0)).signum() * if is_forward { 1 } else { -1 };
    with_torque(c, s, keeps_enabled, run_at(c, s, forward * speed, profile, duration_ns)).await
}

async fn run_at(
    c: &SdoSession,
    s: &TargetDrive,
    raw: i64,
    profile: DriveProfile,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    let profile = DriveProfile { velocity: None, ..profile };
    enabling::prepare(c, s, mode::VELOCITY, &profile).await?;
    let began = enabling::enable(c, s).await?;
    s.check_direction(began, raw)?;
    let acceleration = c.read(&ACCELERATION).await?.max(1);
    c.step("run");
    c.write(&TARGET_VELOCITY, raw).await?;
    c.write(&CONTROLWORD, control::ENABLE).await?;
    let mut fastest = 0.0_f64;
    poll_until(c, s, duration_ns, |reading| {
        fastest = if reading.velocity.abs() > fastest.abs() { reading.velocity } else { fastest };
        s.check_stopping_distance(reading, Some(acceleration))
    })
    .await?;
    c.step("ramp to standstill");
    c.write(&TARGET_VELOCITY, 0).await?;
    enabling::ramp_down(c).await?;
    let ended = c.read(&POSITION_ACTUAL_VALUE).await?;
    Ok(polling::run_report(s, raw, fastest, began, ended))
}

/// Says that the drive cannot have a commanded velocity exactly.
fn note_rounding(c: &SdoSession, s: &TargetDrive, velocity: Option<CommandValue>) {
    if let Some(remark) = velocity.and_then(|velocity| s.rounding(velocity)) {
        c.note(remark);
    }
}

/// The drive has one acceleration for both directions: the lower of the two is used.
fn drive_profile(s: &TargetDrive, profile: &MotionProfile) -> Result<DriveProfile, Failure> {
    let acceleration = profile.acceleration.or(profile.deceleration);
    let deceleration = profile.deceleration.or(profile.acceleration);
    let profile =
        s.drive_profile(&MotionProfile { velocity: profile.velocity, acceleration, deceleration })?;
    let slower = profile.acceleration.min(profile.deceleration);
    Ok(DriveProfile { acceleration: slower, deceleration: None, ..profile })
}

/// So many ends a reciprocating move has; without a number of repetitions it goes on until it is interrupted.
fn ends(times: Option<u32>) -> u32 {
    times.map_or(u32::MAX, |times| times.saturating_mul(2))
}

/// Reads from the drive what the profile leaves open.
async fn complete(c: &SdoSession, profile: DriveProfile) -> Result<DriveProfile, Failure> {
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
    Ok(DriveProfile { velocity: Some(velocity), acceleration: Some(acceleration.max(1)), deceleration: None })
}

/// Polls an enabled axis for a time.
async fn poll_until(
    c: &SdoSession,
    s: &TargetDrive,
    duration_ns: Option<Nanoseconds>,
    check: impl FnMut(&AxisReading) -> Result<(), Failure>,
) -> Result<(), Failure> {
    polling::poll_until(c, POLL_NS, duration_ns, async || reading::read_enabled(c, s).await, check).await
}
