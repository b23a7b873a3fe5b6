//! Commissioning of a drive of bit fields: the tasks of `takt drive`.
//!
//! The drive is led by the codec of the cycle (`takt_rt::FieldDrive`), at a slow period and from an ordinary thread: so it is started and
//! stopped in the same order, and each frame is the one that a run would send.
//!
//! - `client`: the command of each period and its reply.
//! - `reading`: what the drive says of itself.
//! - `motion`: the motions, in the units and within the limits of the axis.
//! - `set_points`: a drive that follows set-points.
//! - `upkeep`: zero, faults, the factors of gains, the mode.

mod client;
mod motion;
mod reading;
mod set_points;
mod upkeep;

use takt_rt::{
    CommandValue as CommandField, FieldGains, FieldMode, Frame, LifeState, LifeWish, Nanoseconds, ReplyError,
};

use super::SETUP_PAUSE_NS;
use crate::config::{Axis, Control, bit_fields};
use crate::family::commission::{DriveTask, Failure, Report, TargetDrive, Task};
use crate::procedure::Procedure;
use client::{FieldClient, FieldSession};
use takt_wire::bit_fields::{FieldDevice, ReplyMoment};

/// From one command to the next on a CAN bus. The bus carries ten times as many, and an ordinary thread keeps to it.
pub const CAN_PERIOD_NS: Nanoseconds = 5_000_000;
/// A drive that has not replied for this long counts as gone.
const SILENCE_NS: Nanoseconds = 500_000_000;
/// A joint that is no faster than this stands, where the drive's steps are finer: rad/s (m/s).
const STANDING: f64 = 0.02;
/// Periods in which a drive takes a step of its life, or has failed.
const PERIODS_FOR_A_STEP: u64 = 100;

/// A task with one drive, and everything that it needs.
struct FieldTask {
    c: FieldSession,
    s: TargetDrive,
    axis: Axis,
    device: FieldDevice,
}

/// A task with a drive, to which a frame may go in each period.
///
/// # Errors
/// Such a drive cannot do it, or a value is wrong.
pub fn begin(target: TargetDrive, task: Task, period_ns: Nanoseconds) -> Result<DriveTask<Frame>, Failure> {
    let unnamed = || {
        Failure::Unsuitable(
            "nothing is known of such a drive without its scales: name an axis of a configuration, or give them by --set"
                .to_owned(),
        )
    };
    let axis = target.axis.as_deref().cloned().ok_or_else(unnamed)?;
    // A drive that is addressed by another ID than the configuration says.
    let axis = Axis { node: target.node, ..axis };
    let device: FieldDevice = axis.drive.description().cloned().ok_or_else(unnamed)?;
    let parameters =
        bit_fields::compile(&device, &axis).map_err(|error| Failure::Unsuitable(error.to_string()))?;
    refuse(&target, &device, &task)?;
    let session = FieldSession::new(FieldClient::new(parameters, period_ns));
    let words = words(&device, target.node);
    let task_of = FieldTask { c: session.clone(), s: target, axis, device };
    motion::check(&task_of, &task)?;
    let procedure = Procedure::new(session, async move { carry_out(&task_of, task).await });
    Ok(DriveTask::new(procedure, words))
}

/// Frames in words.
fn words(device: &FieldDevice, motor: u8) -> impl FnMut(&Frame) -> String + 'static {
    let (command, reply) = (device.id(&device.description.command.id, motor), device.reply_id(motor));
    let setup: Vec<_> = device.setup_ids(motor);
    let own: Vec<_> = match &device.description.life_cycle {
        takt_wire::bit_fields::DescribedLifeCycle::ByFields(_) => vec![],
        takt_wire::bit_fields::DescribedLifeCycle::ByFrames(frames) => {
            frames.all().map(|(name, frame)| (name, device.fixed(frame, motor))).collect()
        }
    };
    move |frame| {
        let is_own = |own: &takt_rt::OwnFrame| own.id == frame.id() && own.payload == frame.payload();
        if let Some((name, _)) = own.iter().find(|(_, own)| is_own(own)) {
            return format!("motor {motor}: {name}");
        }
        match frame.id() {
            id if id == command => format!("motor {motor}: command"),
            id if id == reply => format!("motor {motor}: reply"),
            id if setup.contains(&id) => format!("motor {motor}: set-up"),
            _ => String::new(),
        }
    }
}

async fn carry_out(task: &FieldTask, work: Task) -> Result<Report, Failure> {
    match work {
        Task::Info => reading::info(task).await,
        Task::Watch { every_ns, duration_ns } => reading::watch(task, every_ns, duration_ns).await,
        Task::Enable { hold_ns, keeps_enabled } => motion::enable(task, hold_ns, keeps_enabled).await,
        Task::Disable => motion::disable(task).await,
        Task::Move { kind, profile, keeps_enabled } => {
            motion::run_move(task, kind, profile, keeps_enabled).await
        }
        Task::Velocity { velocity, profile, duration_ns, keeps_enabled } => {
            motion::velocity(task, velocity, profile, duration_ns, keeps_enabled).await
        }
        Task::Torque { torque, velocity_limit, duration_ns } => {
            motion::torque(task, torque, velocity_limit, duration_ns).await
        }
        Task::Zero { .. } => upkeep::zero(task).await,
        Task::ClearFault { .. } => upkeep::clear_fault(task).await,
        Task::GainFactors(factors) => upkeep::gain_factors(task, &factors).await,
        Task::Mode(mode) => upkeep::set_mode(task, mode).await,
        task => Err(unsupported(&task).unwrap_or(Failure::Interrupted)),
    }
}

/// Refuses what the protocol of this drive lacks, by its name.
fn refuse(s: &TargetDrive, device: &FieldDevice, task: &Task) -> Result<(), Failure> {
    if !device.description.motor_ids.contains(&s.node) {
        let (lowest, highest) = (device.description.motor_ids.start(), device.description.motor_ids.end());
        return Err(Failure::Unsuitable(format!(
            "such a motor has an ID from {lowest} to {highest}, not {}",
            s.node
        )));
    }
    if let Some(failure) = unsupported(task) {
        return Err(failure);
    }
    upkeep::refuse(device, task)
}

impl FieldTask {
    /// Returns `true` if the drive says nothing unless it is told something.
    fn tells_to_ask(&self) -> bool {
        matches!(self.device.description.reply_moment, ReplyMoment::AfterCommand { .. })
    }

    /// Sets the drive up, takes its torque away, and waits until it has replied to that often enough.
    async fn connect(&self) -> Result<(), Failure> {
        self.c.step("contact");
        self.c.client_mut().lead(LifeWish::Stop);
        self.c.client_mut().speak();
        let end_ns = self.c.now_ns().saturating_add(self.s.patience_ns);
        let mut sets_up_again_ns = 0;
        loop {
            // The drive may have been switched on just now, and nothing shows when it listens.
            if self.c.now_ns() >= sets_up_again_ns {
                self.set_up();
                sets_up_again_ns = self.c.now_ns().saturating_add(SILENCE_NS);
            }
            let period_ns = self.c.client().period_ns();
            self.c.pause(period_ns).await;
            let (state, is_set_up) = (self.c.client().state(), !self.c.client().has_frames_first());
            if state == LifeState::Stopped && is_set_up && self.c.client().unreadable().is_none() {
                return Ok(());
            }
            if self.c.is_interrupted() {
                return Err(Failure::Interrupted);
            }
            let is_heard = self.c.client().replies() > 0;
            // Its eight replies to a stop take time on a slow line.
            let patience_ns = if is_heard { PERIODS_FOR_A_STEP * period_ns } else { 0 };
            if self.c.now_ns() >= end_ns.saturating_add(patience_ns) {
                return Err(self.unheard());
            }
        }
    }

    /// Waits for a report of a drive that reports by itself.
    async fn hear(&self) -> Result<(), Failure> {
        self.c.step("listen");
        let end_ns = self.c.now_ns().saturating_add(self.s.patience_ns);
        while self.c.client().replies() == 0 {
            if self.c.now_ns() >= end_ns {
                return Err(self.unheard());
            }
            self.c.pause(CAN_PERIOD_NS).await;
            if self.c.is_interrupted() {
                return Err(Failure::Interrupted);
            }
        }
        Ok(())
    }

    /// Has the frames sent that set the drive up.
    fn set_up(&self) {
        let mut client = self.c.client_mut();
        // A drive needs its time for each of them; the period of the commands is longer.
        debug_assert!(client.period_ns() >= SETUP_PAUSE_NS);
        for frame in self.device.setup(self.s.node) {
            client.send_first(Frame::of(frame.id, frame.payload));
        }
    }

    /// Why the drive is not in contact.
    fn unheard(&self) -> Failure {
        let client = self.c.client();
        match client.unreadable() {
            Some(error) => self.unreadable(error),
            None if client.replies() > 0 => Failure::Request {
                what: "the drive replies, but shows torque though it has been told to have none".to_owned(),
                cure: Some("cut its supply"),
            },
            None => Failure::Silent { node: self.s.node, reported: None, other_protocol: None },
        }
    }

    fn unreadable(&self, error: ReplyError) -> Failure {
        let before_setup = self.device.description.bytes_before_setup;
        match error {
            ReplyError::Length { received, .. } if before_setup == Some(received) => Failure::Request {
                what: format!(
                    "{error}: the drive replies as it does before it is set up, so it has lost its supply meanwhile"
                ),
                cure: Some("check its supply; the next command sets it up again"),
            },
            error => Failure::Request {
                what: error.to_string(),
                cure: Some(
                    "the drive speaks another protocol or mode: check `drive` and what is configured of it",
                ),
            },
        }
    }

    /// Fails when the drive has been silent for too long, or has an error.
    fn check_silence(&self) -> Result<(), Failure> {
        let client = self.c.client();
        if let Some(error) = client.unreadable() {
            return Err(self.unreadable(error));
        }
        // On a slow line a few periods are more than that.
        let longest_ns = SILENCE_NS.max(4 * client.period_ns());
        if client.replies() > 0 && client.silent_ns() > longest_ns {
            return Err(Failure::Request {
                what: format!("the drive has not replied for {} ms", client.silent_ns() / 1_000_000),
                cure: Some("it has no watchdog and may still follow its last command: cut its supply"),
            });
        }
        Ok(())
    }

    /// Fails when the drive shows an error.
    fn check_error(&self) -> Result<(), Failure> {
        let client = self.c.client();
        let error = client.drive().reported(client.parameters(), takt_rt::ReplyValue::Error);
        match error.map(|error| error as u16).filter(|code| *code != 0) {
            None => Ok(()),
            Some(code) => Err(Failure::Faulted {
                what: self.s.error_words(code),
                advice: Some(self.s.error_cure(code)),
            }),
        }
    }

    /// A joint that is no faster than this stands: rad/s (m/s). The last code of a velocity goes to and fro at rest.
    fn standing(&self) -> f64 {
        let step = bit_fields::step(&self.device, takt_rt::ReplyValue::Velocity, &self.axis).unwrap_or(0.0);
        STANDING.max(1.5 * step)
    }

    /// Returns `true` if the drive has this mode.
    fn has(&self, mode: FieldMode) -> bool {
        self.device.description.modes.contains(&mode)
    }

    /// Returns `true` if the drive holds a position: it has the mode, and its loop has a gain.
    fn holds_positions(&self) -> bool {
        let has_gain_field = self.device.description.command.field(CommandField::Stiffness).is_some();
        let has_gain = match self.c.client().parameters().gains {
            FieldGains::Fixed { stiffness, .. } => stiffness > 0.0,
            FieldGains::Commanded => self.impedance().0 > 0.0,
        };
        self.has(FieldMode::Position) && (!has_gain_field || has_gain)
    }

    /// Stiffness and damping of an axis that is led by torques.
    fn impedance(&self) -> (f64, f64) {
        match self.axis.control {
            Control::Torque { stiffness, damping, .. } => (stiffness, damping),
            _ => (0.0, 0.0),
        }
    }
}

/// Why no drive of bit fields can do a task; `None` where some can.
fn unsupported(task: &Task) -> Option<Failure> {
    let (what, instead) = match task {
        Task::Scan => (
            "a scan would take the torque of every motor on the bus away: the protocol has no request that only reads",
            "`info --node N` asks one motor",
        ),
        Task::Read { .. } | Task::Write { .. } => (
            "the protocol has no entries that are read or written",
            "`info` shows everything that a reply has; `gains` and `mode` set what can be set",
        ),
        Task::Home { .. } => (
            "the protocol has no homing",
            "`zero` makes the present position the zero, until the motor's power is off; `zero_counts` in the configuration lasts",
        ),
        Task::Save => (
            "the motor keeps nothing that is set over this protocol without power",
            "give it in the configuration: takt sends it at each bring-up",
        ),
        Task::Restore { .. } => (
            "the protocol has no command that restores parameters",
            "what was set over it is forgotten with the motor's power",
        ),
        Task::SetId { .. } | Task::SetBitRate { .. } => (
            "the protocol sets neither ID nor bit rate",
            "set them on the motor's own console or with its vendor's tool",
        ),
        Task::ReleaseBrake { .. } => ("the protocol knows no brake", "`disable` leaves the motor free"),
        Task::Gains { .. } => (
            "the gains of the position loop go with each command",
            "give them in the configuration: `kp` and `kd`; `gains --velocity-kp 1.2` multiplies one of the inner loops where the motor \
             takes that",
        ),
        Task::Gear { .. } => (
            "the motor has no electronic gear",
            "`gear_ratio` in the configuration is for a transmission behind it",
        ),
        Task::AutoHome { .. } => ("the motor does not move by itself at power-up", "move it with `move`"),
        Task::Interpolation => {
            ("there is nothing to set up for interpolation", "takt sends the motor a set-point in each cycle")
        }
        _ => return None,
    };
    Some(Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() })
}
