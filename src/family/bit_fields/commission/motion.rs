//! The motions of `takt drive`, in the units and within the limits of the axis.

use takt_rt::plan::Profile;
use takt_rt::{FieldMode, Nanoseconds};

use super::FieldTask;
use super::reading::{self, mode_word};
use super::set_points::{Pace, limits, summary, with_torque};
use crate::family::commission::{CommandValue, Failure, MotionProfile, MoveKind, Report, Task};
use crate::procedure::AxisReading;

/// The velocity at which a joint under torque is stopped, as a share of its limit.
const PERMITTED: f64 = 0.25;

/// Refuses what can be refused before the first frame.
pub fn check(task: &FieldTask, work: &Task) -> Result<(), Failure> {
    match work {
        Task::Enable { .. } => holding_mode(task).map(|_| ()),
        Task::Move { kind, profile, .. } => {
            pace(task, profile)?;
            match kind {
                MoveKind::Continuous { .. } => running_mode(task).map(|_| ()),
                MoveKind::Absolute { to, .. } | MoveKind::Reciprocate { to, .. } => {
                    check_position(task, position(task, *to))?;
                    position_mode(task)
                }
                MoveKind::Relative(_) => position_mode(task),
            }
        }
        Task::Velocity { velocity, profile, .. } => {
            task.s.check_velocity(task.s.velocity_raw(*velocity))?;
            pace(task, profile)?;
            running_mode(task).map(|_| ())
        }
        Task::Torque { torque, velocity_limit, .. } => {
            if !task.has(FieldMode::Torque) || task.device.has_impedance() && task.holds_positions() {
                return Err(lacks(task, "torque"));
            }
            torque_of(*torque)?;
            limits(task)?;
            if let CommandValue::Joint(torque) = torque {
                task.s.check_torque(*torque)?;
            }
            velocity_limit.map_or(Ok(()), |limit| task.s.check_velocity(task.s.velocity_raw(limit)))
        }
        _ => Ok(()),
    }
}

fn lacks(task: &FieldTask, what: &str) -> Failure {
    let modes: Vec<&str> = task.device.description.modes.iter().map(|mode| mode_word(*mode)).collect();
    Failure::Unsupported {
        what: format!(
            "a {} does not follow a {what} with these settings",
            task.device.description.drive.product
        ),
        instead: format!("its modes are: {}", modes.join(", ")),
    }
}

fn position_mode(task: &FieldTask) -> Result<(), Failure> {
    match () {
        () if task.holds_positions() => Ok(()),
        () if task.has(FieldMode::Position) => Err(Failure::Missing {
            what: "`kp` and `kd` of the axis",
            why: "the gains of the motor's position loop go with each command, and are 0",
        }),
        () => Err(lacks(task, "position")),
    }
}

/// The mode in which the drive stands still.
fn holding_mode(task: &FieldTask) -> Result<FieldMode, Failure> {
    limits(task)?;
    if task.holds_positions() { Ok(FieldMode::Position) } else { running_mode(task) }
}

/// The mode in which the drive runs at a velocity. A drive with an impedance is led there by positions: without a spring it would fall
/// behind.
fn running_mode(task: &FieldTask) -> Result<FieldMode, Failure> {
    limits(task)?;
    if task.has(FieldMode::Velocity) && !task.device.has_impedance() {
        return Ok(FieldMode::Velocity);
    }
    position_mode(task).map(|()| FieldMode::Position)
}

fn pace(task: &FieldTask, profile: &MotionProfile) -> Result<Pace, Failure> {
    let limits = limits(task)?;
    let given = task.s.drive_profile(profile)?;
    let velocity = given.velocity.map_or(limits.velocity, |raw| task.s.velocity(raw as f64).abs());
    let acceleration = given.acceleration.map_or(limits.acceleration, |raw| task.s.acceleration(raw as f64));
    let deceleration = given.deceleration.map_or(limits.deceleration, |raw| task.s.acceleration(raw as f64));
    let share = (acceleration.max(deceleration) / limits.acceleration.max(limits.deceleration)).min(1.0);
    Ok(Pace { velocity, acceleration, deceleration, jerk: limits.jerk * share })
}

fn position(task: &FieldTask, value: CommandValue) -> f64 {
    match value {
        CommandValue::Joint(position) => position,
        CommandValue::Drive(counts) => task.s.position(0) + counts as f64 / task.s.scale.resolution(),
    }
}

fn distance(task: &FieldTask, value: CommandValue) -> f64 {
    match value {
        CommandValue::Joint(distance) => distance,
        CommandValue::Drive(counts) => counts as f64 / task.s.scale.resolution(),
    }
}

fn torque_of(value: CommandValue) -> Result<f64, Failure> {
    match value {
        CommandValue::Joint(torque) => Ok(torque),
        CommandValue::Drive(_) => Err(Failure::Unsuitable(
            "the torque of such a motor has a unit: write for example \"0.5 Nm\"".to_owned(),
        )),
    }
}

fn check_position(task: &FieldTask, position: f64) -> Result<(), Failure> {
    let limits = limits(task)?;
    let slack = 0.5 / task.s.scale.resolution().abs();
    let (low, high) = (limits.position_min, limits.position_max);
    if (low - slack..=high + slack).contains(&position) {
        return Ok(());
    }
    Err(Failure::OutsideLimits { quantity: task.s.position_quantity(), value: position, low, high })
}

/// `enable`
pub async fn enable(
    task: &FieldTask,
    hold_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let mode = holding_mode(task)?;
    with_torque(task, mode, keeps_enabled, async |motion| {
        let held = motion.state.position;
        if !keeps_enabled {
            task.c.step("hold");
            let end_s = hold_ns.map_or(f64::INFINITY, |hold_ns| hold_ns as f64 * 1e-9);
            let profile = Profile::hold(held);
            motion.follow(&profile, end_s, |_| Ok(())).await?;
        }
        let mut report = Report::new();
        report.add("held_at", "held at", held, task.s.position_quantity().show(held));
        Ok(report)
    })
    .await
}

/// `disable`
pub async fn disable(task: &FieldTask) -> Result<Report, Failure> {
    task.connect().await?;
    Ok(summary(task))
}

/// `move`
pub async fn run_move(
    task: &FieldTask,
    kind: MoveKind,
    profile: MotionProfile,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let pace = pace(task, &profile)?;
    if let MoveKind::Continuous { is_forward, duration_ns } = kind {
        let velocity = if is_forward { pace.velocity } else { -pace.velocity };
        return run(task, velocity, pace, duration_ns, keeps_enabled).await;
    }
    task.connect().await?;
    task.c.step("plan the move");
    let from = task.c.client().position().unwrap_or(0.0);
    let (target, moves, dwell_ns) = match kind {
        MoveKind::Absolute { to, .. } => (position(task, to), 1, 0),
        MoveKind::Relative(by) => (from + distance(task, by), 1, 0),
        MoveKind::Reciprocate { to, times, dwell_ns } => {
            check_position(task, from)?;
            (position(task, to), times.map_or(u32::MAX, |times| times.saturating_mul(2)), dwell_ns)
        }
        MoveKind::Continuous { .. } => (from, 0, 0),
    };
    check_position(task, target)?;
    with_torque(task, FieldMode::Position, keeps_enabled, async |motion| {
        let mut error = 0.0;
        for number in 0..moves {
            let next = if number % 2 == 0 { target } else { from };
            error = motion.go_to(next, &pace).await?;
            if dwell_ns > 0 {
                let profile = Profile::hold(next);
                motion.follow(&profile, dwell_ns as f64 * 1e-9, |_| Ok(())).await?;
            }
        }
        let quantity = task.s.position_quantity();
        let mut report = Report::new();
        report.add("from", "from", from, quantity.show(from));
        report.add("target", "target", target, quantity.show(target));
        report.add("moves", "moves", moves, moves.to_string());
        let counts = (error * task.s.scale.resolution()).round() as i64;
        report.add("error_counts", "error", counts, format!("{counts} counts"));
        Ok(report)
    })
    .await
}

/// `velocity`
pub async fn velocity(
    task: &FieldTask,
    velocity: CommandValue,
    profile: MotionProfile,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let pace = pace(task, &profile)?;
    let velocity = match velocity {
        CommandValue::Joint(velocity) => velocity,
        CommandValue::Drive(raw) => task.s.velocity(raw as f64),
    };
    run(task, velocity, pace, duration_ns, keeps_enabled).await
}

/// A motion without a target.
async fn run(
    task: &FieldTask,
    velocity: f64,
    pace: Pace,
    duration_ns: Option<Nanoseconds>,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let mode = running_mode(task)?;
    with_torque(task, mode, keeps_enabled, async |motion| {
        let began = reading::reading(task);
        let hardly = AxisReading { velocity: velocity.signum() * f64::MIN_POSITIVE, ..began };
        task.s.check_stopping_distance(&hardly, None)?;
        motion.run_at(velocity, &pace, duration_ns).await?;
        let way = reading::reading(task).position - began.position;
        let (quantity, fastest) = (task.s.velocity_quantity(), motion.fastest);
        let mut report = Report::new();
        report.add("commanded_velocity", "commanded velocity", velocity, quantity.show(velocity));
        report.add("highest_velocity", "highest velocity", fastest, quantity.show(fastest));
        report.add("travelled", "travelled", way, task.s.position_quantity().show(way));
        Ok(report)
    })
    .await
}

/// `torque`
pub async fn torque(
    task: &FieldTask,
    torque: CommandValue,
    velocity_limit: Option<CommandValue>,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    let limits = limits(task)?;
    let torque = torque_of(torque)?;
    let limit = velocity_limit.map_or(PERMITTED * limits.velocity, |limit| {
        task.s.velocity(task.s.velocity_raw(limit) as f64).abs()
    });
    with_torque(task, FieldMode::Torque, false, async |motion| {
        task.c.step("torque");
        let began = reading::reading(task).position;
        motion.torque = torque;
        let end_s = duration_ns.map_or(f64::INFINITY, |duration_ns| duration_ns as f64 * 1e-9);
        let profile = Profile::hold(0.0);
        let followed = motion.follow(&profile, end_s, |reading| {
            if reading.velocity.abs() > limit {
                let (quantity, value) = (task.s.velocity_quantity(), reading.velocity);
                return Err(Failure::AtLimit { quantity, value, low: -limit, high: limit });
            }
            task.s.check_stopping_distance(reading, None)
        });
        followed.await?;
        let way = reading::reading(task).position - began;
        let fastest = motion.fastest;
        let mut report = Report::new();
        report.add("torque", "torque", torque, task.s.effort_quantity().show(torque));
        report.add("highest_velocity", "highest velocity", fastest, task.s.velocity_quantity().show(fastest));
        report.add("travelled", "travelled", way, task.s.position_quantity().show(way));
        Ok(report)
    })
    .await
}
