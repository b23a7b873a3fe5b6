//! A drive with torque that follows set-points: planned here, and sent one by one.
//!
//! Every motion begins at the actual position (the life cycle of the codec sees to that), and ends at rest without torque. The drive has no
//! watchdog: a motion that is cut short leaves it with its last command.

use takt_rt::plan::{self, Problem, Profile, State};
use takt_rt::{FieldMode, FieldTargets, LifeState, LifeWish, Nanoseconds};

use super::reading;
use super::{FieldTask, PERIODS_FOR_A_STEP};
use crate::config::Limits;
use crate::family::commission::{Failure, Report};
use crate::procedure::AxisReading;

/// Between two readings of a moving axis.
const SHOWN_NS: Nanoseconds = 20_000_000;
/// How long the joint may take to arrive behind the last set-point, or to come to rest without torque.
const SETTLING_NS: Nanoseconds = 2_000_000_000;

/// The limits of the axis, without which nothing moves.
pub fn limits(task: &FieldTask) -> Result<Limits, Failure> {
    task.s.limits.ok_or(Failure::Missing {
        what: "the limits of the axis, in a configuration or by `--set limits.velocity=\"2 rad/s\"` and the like",
        why: "takt plans the motion of such a motor, and sends its limits with each command",
    })
}

/// Velocity and accelerations of a motion, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    pub velocity: f64,
    pub acceleration: f64,
    pub deceleration: f64,
    pub jerk: f64,
}

/// A drive with torque, and the set-point that it follows.
pub struct Motion<'t> {
    task: &'t FieldTask,
    mode: FieldMode,
    /// The set-point; its position counts in position mode alone.
    pub state: State,
    /// N·m (N), in torque mode.
    pub torque: f64,
    /// The fastest that the joint was: rad/s (m/s).
    pub fastest: f64,
    shown_ns: Nanoseconds,
    /// Since when the joint is further from its set-point than it may be.
    behind_ns: Option<Nanoseconds>,
}

impl Motion<'_> {
    fn targets(&self) -> FieldTargets {
        let (stiffness, damping) = self.task.impedance();
        let State { position, velocity, .. } = self.state;
        FieldTargets { position, velocity, torque: self.torque, stiffness, damping }
    }

    /// Brings the set-point to the drive and looks at its last reply.
    fn tick(&mut self) -> Result<AxisReading, Failure> {
        self.task.c.client_mut().follow(self.targets());
        self.task.check_silence()?;
        self.task.check_error()?;
        let state = self.task.c.client().state();
        if !matches!(state, LifeState::Running(_)) {
            return Err(Failure::Request {
                what: "the motor has taken its torque away by itself".to_owned(),
                cure: Some("check its supply and its load; `info` shows what it says of itself"),
            });
        }
        let reading = reading::reading(self.task);
        if reading.velocity.abs() > self.fastest.abs() {
            self.fastest = reading.velocity;
        }
        let now_ns = self.task.c.now_ns();
        if now_ns.saturating_sub(self.shown_ns) >= SHOWN_NS {
            self.shown_ns = now_ns;
            self.task.c.show(reading);
        }
        self.check_following(&reading)?;
        Ok(reading)
    }

    /// The joint is blocked, or slips: it must not go on as if it followed.
    fn check_following(&mut self, reading: &AxisReading) -> Result<(), Failure> {
        let permitted = self.task.axis.following_error;
        let error = (self.state.position - reading.position).abs();
        if self.mode != FieldMode::Position || error <= permitted.limit {
            self.behind_ns = None;
            return Ok(());
        }
        let now_ns = self.task.c.now_ns();
        let since_ns = *self.behind_ns.get_or_insert(now_ns);
        // Replies come no more often than commands.
        let time_ns = permitted.time_ns.max(4 * self.task.c.client().period_ns());
        if now_ns.saturating_sub(since_ns) <= time_ns {
            return Ok(());
        }
        let quantity = self.task.s.position_quantity();
        Err(Failure::Request {
            what: format!(
                "the joint is {} away from its set-point, where {} is permitted",
                quantity.show(error),
                quantity.show(permitted.limit)
            ),
            cure: Some("see whether something blocks it; then check `kp`, `kd` and `following_error`"),
        })
    }

    /// Torque on, at the actual position.
    async fn enable(&mut self) -> Result<(), Failure> {
        let (task, mode) = (self.task, self.mode);
        task.c.step("enable");
        let before = task.c.client().position().unwrap_or(0.0);
        task.c.client_mut().lead(LifeWish::Run(mode));
        let end_ns = task.c.now_ns() + PERIODS_FOR_A_STEP * task.c.client().period_ns();
        let enabled = task.c.until(|| {
            let position = task.c.client().position().unwrap_or(before);
            self.state = State::rest(position);
            task.c.client_mut().follow(self.targets());
            if let Err(failure) = task.check_silence().and_then(|()| task.check_error()) {
                return Some(Err(failure));
            }
            if task.c.is_interrupted() {
                return Some(Err(Failure::Interrupted));
            }
            match task.c.client().state() {
                LifeState::Running(_) => Some(Ok(())),
                _ if task.c.now_ns() >= end_ns => Some(Err(Failure::Request {
                    what: "the motor does not start".to_owned(),
                    cure: Some("check its supply; `info` shows what it says of itself"),
                })),
                _ => None,
            }
        });
        enabled.await?;
        let moved = self.state.position - before;
        let counts = (moved * task.s.scale.resolution()).round() as i64;
        let near = task.s.near_counts();
        if counts.abs() > near { Err(Failure::Jumped { counts }) } else { Ok(()) }
    }

    /// Follows a profile to `end_s`, which may be infinite. `check` sees each reading.
    pub async fn follow(
        &mut self,
        profile: &Profile,
        end_s: f64,
        mut check: impl FnMut(&AxisReading) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let task = self.task;
        let began_ns = task.c.now_ns();
        let followed = task.c.until(|| {
            let since_s = task.c.now_ns().saturating_sub(began_ns) as f64 * 1e-9;
            self.state = profile.sample(since_s);
            if self.mode != FieldMode::Position {
                // Nobody looks at it, and it would run away.
                self.state.position = 0.0;
            }
            match self.tick().and_then(|reading| check(&reading)) {
                Err(failure) => Some(Err(failure)),
                Ok(()) if task.c.is_interrupted() => Some(Err(Failure::Interrupted)),
                Ok(()) => (since_s >= end_s).then_some(Ok(())),
            }
        });
        followed.await
    }

    /// Goes to a position and waits until the joint is there.
    pub async fn go_to(&mut self, target: f64, pace: &Pace) -> Result<f64, Failure> {
        self.task.c.step("move");
        let is_forward = target >= self.state.position;
        let (up, down) = match is_forward {
            true => (pace.acceleration, pace.deceleration),
            false => (pace.deceleration, pace.acceleration),
        };
        let limits = plan::Limits::asymmetric(pace.velocity, -pace.velocity, up, -down, pace.jerk);
        let problem = Problem { start: self.state, target: State::rest(target), limits };
        let profile = plan::position(&problem).map_err(|error| Failure::Unsuitable(error.to_string()))?;
        self.follow(&profile, profile.duration_s(), |_| Ok(())).await?;
        let near = self.task.s.near_counts() as f64 / self.task.s.scale.resolution().abs();
        let (task, end_ns) = (self.task, self.task.c.now_ns() + SETTLING_NS);
        let settled = task.c.until(|| {
            let reading = match self.tick() {
                Ok(reading) => reading,
                Err(failure) => return Some(Err(failure)),
            };
            let error = reading.position - target;
            let is_there = error.abs() <= near && reading.velocity.abs() <= task.standing();
            match () {
                () if is_there => Some(Ok(error)),
                () if task.c.is_interrupted() => Some(Err(Failure::Interrupted)),
                () if task.c.now_ns() >= end_ns => Some(Err(Failure::Request {
                    what: format!(
                        "the joint is at {} and does not reach {}",
                        task.s.position_quantity().show(reading.position),
                        task.s.position_quantity().show(target)
                    ),
                    cure: Some("the motor's position loop has no integral part: a load needs a higher `kp`"),
                })),
                () => None,
            }
        });
        settled.await
    }

    /// Runs at a velocity for a time, or until it is interrupted, and comes to rest.
    pub async fn run_at(
        &mut self,
        velocity: f64,
        pace: &Pace,
        duration_ns: Option<Nanoseconds>,
    ) -> Result<(), Failure> {
        let task = self.task;
        task.c.step("run");
        let problem = Problem {
            start: self.state,
            target: State { position: 0.0, velocity, acceleration: 0.0 },
            limits: limits_of(pace, velocity.abs().max(self.state.velocity.abs())),
        };
        let profile = plan::velocity(&problem).map_err(|error| Failure::Unsuitable(error.to_string()))?;
        let end_s = duration_ns.map_or(f64::INFINITY, |duration_ns| duration_ns as f64 * 1e-9);
        self.follow(&profile, end_s, |reading| task.s.check_stopping_distance(reading, None)).await?;
        task.c.step("ramp to standstill");
        self.brake(pace).await
    }

    /// Brings the set-point to rest.
    async fn brake(&mut self, pace: &Pace) -> Result<(), Failure> {
        let fastest = pace.velocity.max(self.state.velocity.abs());
        let problem =
            Problem { start: self.state, target: State::rest(0.0), limits: limits_of(pace, fastest) };
        let profile = plan::velocity(&problem).map_err(|error| Failure::Unsuitable(error.to_string()))?;
        self.follow(&profile, profile.duration_s(), |_| Ok(())).await?;
        self.stand().await
    }

    /// Waits until the joint stands.
    async fn stand(&mut self) -> Result<(), Failure> {
        let (task, end_ns) = (self.task, self.task.c.now_ns() + SETTLING_NS);
        let stood = task.c.until(|| match self.tick() {
            Ok(reading) if reading.velocity.abs() <= task.standing() => Some(Ok(())),
            Ok(_) if task.c.is_interrupted() => Some(Err(Failure::Interrupted)),
            Ok(_) => (task.c.now_ns() >= end_ns).then_some(Ok(())),
            Err(failure) => Some(Err(failure)),
        });
        stood.await
    }

    /// The controlled stop behind every motion, as far as the drive still follows.
    async fn come_to_rest(&mut self) -> Result<(), Failure> {
        if !matches!(self.task.c.client().state(), LifeState::Running(_)) {
            return Ok(());
        }
        self.task.c.step("stop");
        if self.mode == FieldMode::Torque {
            self.torque = 0.0;
            return self.stand().await;
        }
        // The stop uses all that the limits allow.
        let limits = limits(self.task)?;
        let pace = Pace {
            velocity: limits.velocity,
            acceleration: limits.acceleration,
            deceleration: limits.deceleration,
            jerk: limits.jerk,
        };
        self.brake(&pace).await
    }
}

/// The limits of a run at a velocity.
fn limits_of(pace: &Pace, velocity: f64) -> plan::Limits {
    let velocity = velocity.max(f64::MIN_POSITIVE.sqrt().max(1e-9));
    // Speeding up and slowing down have one limit here, so that either direction keeps both.
    let acceleration = pace.acceleration.min(pace.deceleration);
    plan::Limits::symmetric(velocity, acceleration, pace.jerk)
}

/// Runs `work` with torque, and brings the joint to rest and takes the torque away behind it, whatever comes of it.
pub async fn with_torque(
    task: &FieldTask,
    mode: FieldMode,
    keeps_enabled: bool,
    work: impl AsyncFnOnce(&mut Motion<'_>) -> Result<Report, Failure>,
) -> Result<Report, Failure> {
    task.connect().await?;
    task.check_error()?;
    let state = State::rest(task.c.client().position().unwrap_or(0.0));
    let mut motion = Motion { task, mode, state, torque: 0.0, fastest: 0.0, shown_ns: 0, behind_ns: None };
    let done = match motion.enable().await {
        Ok(()) => work(&mut motion).await,
        Err(failure) => Err(failure),
    };
    if done.is_err() {
        task.c.keep_failing_step();
    }
    task.c.ignore_interruptions();
    if keeps_enabled && let Ok(mut report) = done {
        task.c.note("the motor keeps its torque and holds its last command: it has no watchdog");
        report.append(summary(task));
        return Ok(report);
    }
    let rested = motion.come_to_rest().await;
    if rested == Err(Failure::Interrupted) {
        task.c.ignore_interruptions();
    }
    task.c.step("torque off");
    let off = torque_off(task).await;
    let is_at_rest = rested.is_ok() || rested == Err(Failure::Interrupted);
    match (done, off) {
        (Ok(mut report), Ok(())) if is_at_rest => {
            report.append(summary(task));
            Ok(report)
        }
        (Ok(_), Ok(())) => rested.map(|()| Report::new()),
        (Ok(_), Err(failure)) => Err(failure),
        (Err(failure), Ok(())) => {
            let reading = reading::reading(task);
            let position = task.s.position_quantity().show(reading.position);
            task.c.note(format!("the axis is at {position}, {}", reading.state));
            Err(failure)
        }
        (Err(failure), Err(stop_failure)) => {
            task.c.note(format!("the axis may still be moving: {stop_failure}; use the emergency stop"));
            Err(failure)
        }
    }
}

async fn torque_off(task: &FieldTask) -> Result<(), Failure> {
    task.c.client_mut().lead(LifeWish::Stop);
    let end_ns = task.c.now_ns() + PERIODS_FOR_A_STEP * task.c.client().period_ns();
    let stopped = task.c.until(|| match task.c.client().state() {
        LifeState::Stopped => Some(Ok(())),
        _ if task.c.now_ns() >= end_ns => {
            Some(Err(task.check_silence().err().unwrap_or_else(|| task.unheard())))
        }
        _ => None,
    });
    stopped.await
}

/// Where the axis is in the end.
pub fn summary(task: &FieldTask) -> Report {
    let reading = reading::reading(task);
    let mut report = Report::new();
    let position = task.s.position_quantity().show(reading.position);
    report.add("position", "position", reading.position, position);
    let counts = reading.position_counts;
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("state", "state", reading.state, reading.state);
    report
}
