//! Setting a drive up: its zero, its faults, the factors of its gains, its mode.

use takt_rt::{
    CommandValue as CommandField, CommandValues, FieldMode, Frame, LifeCycle, LifeState, LifeWish, Setting,
};
use takt_wire::bit_fields::{DescribedLifeCycle, FieldDevice, Setting as DriveSetting};

use super::reading::{self, mode_word};
use super::{FieldTask, PERIODS_FOR_A_STEP};
use crate::family::commission::{Failure, GainFactors, Report, Task};

/// Refuses what this drive lacks.
pub fn refuse(device: &FieldDevice, task: &Task) -> Result<(), Failure> {
    let unsupported = |what: &str, instead: &str| {
        Err(Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() })
    };
    let (has_zero, has_clear) = match &device.description.life_cycle {
        DescribedLifeCycle::ByFields(_) => {
            (device.description.command.field(CommandField::Zero).is_some(), false)
        }
        DescribedLifeCycle::ByFrames(frames) => (frames.zero.is_some(), frames.clear.is_some()),
    };
    match task {
        Task::Zero { .. } if !has_zero => unsupported(
            "the protocol has no frame that sets the zero",
            "set `zero_counts` in the configuration",
        ),
        Task::Zero { is_confirmed: false } => Err(Failure::NeedsConsent {
            consequence: "the present position becomes the motor's zero, and its COUNT OF TURNS IS CLEARED: every position of a \
                          configuration is counted from there, until the motor's power is off, when the old zero is back",
            option: "--yes",
        }),
        Task::ClearFault { .. } if !has_clear => unsupported(
            "the protocol has no frame that clears a fault",
            "remove its cause, then power-cycle the motor",
        ),
        Task::GainFactors(GainFactors { position_loop: Some(_), .. }) => unsupported(
            "the gains of the position loop go with each command",
            "give them in the configuration: `kp` and `kd`",
        ),
        Task::GainFactors(factors) => {
            for (setting, factor) in settings(factors) {
                if !(factor.is_finite() && (1e-6..=1e6).contains(&factor)) {
                    return Err(Failure::Unsuitable(format!(
                        "a gain cannot be multiplied by {factor}: a number from 1e-6 to 1e6"
                    )));
                }
                if device.setup_of(1, setting, factor).is_none() {
                    return unsupported(
                        &format!("the protocol has no frame for the factor `{}`", setting.key()),
                        "set the gains of its loops with its vendor's tool",
                    );
                }
            }
            Ok(())
        }
        Task::Mode(mode) if !device.description.modes.contains(mode) => {
            let modes: Vec<&str> = device.description.modes.iter().map(|mode| mode_word(*mode)).collect();
            unsupported(
                &format!("the motor has no {} mode in this protocol", mode_word(*mode)),
                &format!("it has: {}", modes.join(", ")),
            )
        }
        Task::Mode(_) if device.description.modes.len() == 1 || device.has_impedance() => {
            unsupported("the protocol does not tell the motor a mode", "its commands say what it follows")
        }
        _ => Ok(()),
    }
}

/// The factors that are given, each with its setting.
fn settings(factors: &GainFactors) -> Vec<(DriveSetting, f64)> {
    let all = [
        (DriveSetting::VelocityLoopKp, factors.velocity_kp),
        (DriveSetting::VelocityLoopKi, factors.velocity_ki),
        (DriveSetting::CurrentLoopKp, factors.current_kp),
        (DriveSetting::CurrentLoopKi, factors.current_ki),
    ];
    all.into_iter().filter_map(|(setting, factor)| Some((setting, factor?))).collect()
}

/// `zero`
pub async fn zero(task: &FieldTask) -> Result<Report, Failure> {
    task.connect().await?;
    task.c.step("standstill");
    let before = reading::reading(task);
    if before.velocity.abs() > task.standing() {
        return Err(Failure::Request {
            what: format!(
                "the axis moves at {}: its zero is set only at standstill",
                task.s.velocity_quantity().show(before.velocity)
            ),
            cure: Some("wait until it stands, then try again"),
        });
    }
    task.c.step("zero");
    tell_once(task, LifeWish::Zero, Setting::Zero).await?;
    let after = reading::reading(task);
    if after.position_counts.abs() > task.s.near_counts() {
        return Err(Failure::Contradicted(format!(
            "the motor was told to take its position as zero, and still reports {} counts",
            after.position_counts
        )));
    }
    task.c.note("the motor forgets this zero with its power");
    let mut report = Report::new();
    let (before, after) = (before.position_counts, after.position_counts);
    report.add("before_counts", "position counts before", before, before.to_string());
    report.add("after_counts", "position counts now", after, after.to_string());
    Ok(report)
}

/// `clear-fault`
pub async fn clear_fault(task: &FieldTask) -> Result<Report, Failure> {
    task.connect().await?;
    task.c.step("clear");
    tell_once(task, LifeWish::Clear, Setting::Clear).await?;
    match task.check_error() {
        Err(Failure::Faulted { what, advice }) => Err(Failure::FaultPersists { what, advice }),
        checked => {
            checked?;
            let mut report = Report::new();
            report.add("cleared", "cleared", true, "the motor shows no error");
            Ok(report)
        }
    }
}

/// Has the motor told once, and waits for its replies to the commands behind that.
async fn tell_once(task: &FieldTask, wish: LifeWish, setting: Setting) -> Result<(), Failure> {
    task.c.client_mut().lead(wish);
    await_state(task, |state| state == LifeState::Told(setting)).await?;
    task.c.client_mut().lead(LifeWish::Stop);
    await_replies(task, 3).await
}

async fn await_state(task: &FieldTask, is_it: impl Fn(LifeState) -> bool) -> Result<(), Failure> {
    let period_ns = task.c.client().period_ns();
    let end_ns = task.c.now_ns().saturating_add(PERIODS_FOR_A_STEP * period_ns);
    while !is_it(task.c.client().state()) {
        task.check_silence()?;
        if task.c.now_ns() >= end_ns {
            return Err(Failure::Request {
                what: "the motor does not reply to what it was told".to_owned(),
                cure: Some("try again; if it stays, power-cycle the motor"),
            });
        }
        task.c.pause(period_ns).await;
        if task.c.is_interrupted() {
            return Err(Failure::Interrupted);
        }
    }
    Ok(())
}

async fn await_replies(task: &FieldTask, count: u64) -> Result<(), Failure> {
    let wanted = task.c.client().replies() + count;
    await_state(task, |_| task.c.client().replies() >= wanted && !task.c.client().has_frames_first()).await
}

/// `gains`
pub async fn gain_factors(task: &FieldTask, factors: &GainFactors) -> Result<Report, Failure> {
    task.connect().await?;
    task.c.step("gains");
    let mut report = Report::new();
    for (setting, factor) in settings(factors) {
        if let Some(frame) = task.device.setup_of(task.s.node, setting, factor) {
            task.c.client_mut().send_first(Frame::of(frame.id, frame.payload));
        }
        let text = format!("the preset gain times {factor}");
        report.add(setting.key(), setting.key(), factor, text);
    }
    // Whether a frame with a gain changes the mode, too, is not said in the manual.
    for frame in task.device.setup_without_numbers(task.s.node) {
        task.c.client_mut().send_first(Frame::of(frame.id, frame.payload));
    }
    await_replies(task, 3).await?;
    task.c.note(
        "the motor does not tell its gains, and forgets these with its power: the keys of the same names in the configuration have takt \
         send them at each bring-up",
    );
    Ok(report)
}

/// `mode`
pub async fn set_mode(task: &FieldTask, mode: FieldMode) -> Result<Report, Failure> {
    task.connect().await?;
    task.c.step("mode");
    let frame = {
        let client = task.c.client();
        match &client.parameters().life_cycle {
            LifeCycle::ByFrames(frames) => {
                let own = match mode {
                    FieldMode::Torque => frames.torque,
                    FieldMode::Velocity => frames.velocity,
                    FieldMode::Position => frames.position,
                };
                own.map(|own| Frame::of(own.id, own.payload))
            }
            LifeCycle::ByFields { modes } => {
                let code = match mode {
                    FieldMode::Torque => modes.torque,
                    FieldMode::Velocity => modes.velocity,
                    FieldMode::Position => modes.position,
                };
                let mut values = CommandValues::default();
                values.set(CommandField::Position, client.position().unwrap_or(0.0));
                values.set(CommandField::Mode, code.into());
                Some(client.parameters().command.frame(&values))
            }
        }
    };
    let shows_mode = matches!(task.device.description.life_cycle, DescribedLifeCycle::ByFields(_));
    let Some(frame) = frame else { return Err(Failure::Interrupted) };
    let replies = task.c.client().replies();
    // The command of the next period names a mode of its own: this one is the last that is sent.
    task.c.client_mut().send_first(frame);
    task.c.client_mut().fall_silent_after_first();
    await_state(task, |_| task.c.client().replies() > replies && !task.c.client().has_frames_first()).await?;
    let pause_ns = 2 * task.c.client().period_ns();
    task.c.pause(pause_ns).await;
    if shows_mode && !reading::shows(task, mode) {
        return Err(Failure::Contradicted(format!(
            "the motor was told the {} mode, and shows another one",
            mode_word(mode)
        )));
    }
    if !shows_mode {
        task.c.note("the motor does not show its mode: that it replies is all that is known");
    }
    let mut report = Report::new();
    report.add("mode", "mode", mode_word(mode), mode_word(mode));
    Ok(report)
}
