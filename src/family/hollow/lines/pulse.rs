//! The stiffness of the motor behind the pulse module.

use takt_wire::hollow_lines::pulse_module::{FIRST_BYTE_OF_EXAMPLE, LoopGain, StiffnessSetting};

use super::client::{LineClient, LineSession};
use super::unsupported;
use crate::family::commission::{DriveTask, Failure, GainFactors, Report, Task};
use crate::procedure::Procedure;

/// Between two settings: the module has no answer by which to pace them.
const PAUSE_NS: u64 = 20_000_000;

/// A task with the module.
///
/// # Errors
/// The module cannot do it, or a gain is none.
pub fn begin(task: Task) -> Result<DriveTask<Vec<u8>>, Failure> {
    let Task::GainFactors(factors) = task else {
        return Err(unsupported(
            "the pulse module takes stiffness settings alone",
            "`gains --stiffness 16 --damping 16`, or a factor: `gains --velocity-kp 1.2`; its step angle is set by its switches",
        ));
    };
    let mut frames = vec![];
    for (name, setting) in settings(&factors) {
        let bytes =
            setting.encode(FIRST_BYTE_OF_EXAMPLE).map_err(|error| Failure::Unsuitable(error.to_string()))?;
        frames.push((name, setting, bytes));
    }
    let session = LineSession::new(LineClient::default());
    let c = session.clone();
    let procedure = Procedure::new(session, async move {
        c.step("stiffness");
        let mut report = Report::new();
        for (name, setting, bytes) in frames {
            c.say(bytes);
            c.sleep(PAUSE_NS).await;
            let text = match setting {
                StiffnessSetting::PositionLoop { p, d } => format!("P {p}, D {d}"),
                StiffnessSetting::Multiplier { factor, .. } => format!("the preset gain times {factor}"),
            };
            report.add(name, name, text.clone(), text);
        }
        c.note(
            "the module answers nothing, and the manual contradicts itself in the first byte of these frames: sent as in its example (01). \
             See at the motor whether it has taken them",
        );
        Ok(report)
    });
    Ok(DriveTask::new(procedure, |bytes: &Vec<u8>| {
        let setting = bytes.as_slice().try_into().ok().and_then(|bytes| StiffnessSetting::decode(bytes).ok());
        setting.map_or_else(String::new, |(_, setting)| format!("{setting:?}"))
    }))
}

fn settings(factors: &GainFactors) -> Vec<(&'static str, StiffnessSetting)> {
    let multiplier = |gain, factor: Option<f64>| {
        factor.map(|factor| StiffnessSetting::Multiplier { gain, factor: factor as f32 })
    };
    let position_loop = factors.position_loop.map(|(p, d)| StiffnessSetting::PositionLoop { p, d });
    let all = [
        ("position_loop", position_loop),
        ("velocity_loop_kp", multiplier(LoopGain::VelocityKp, factors.velocity_kp)),
        ("velocity_loop_ki", multiplier(LoopGain::VelocityKi, factors.velocity_ki)),
        ("current_loop_kp", multiplier(LoopGain::CurrentKp, factors.current_kp)),
        ("current_loop_ki", multiplier(LoopGain::CurrentKi, factors.current_ki)),
    ];
    all.into_iter().filter_map(|(name, setting)| Some((name, setting?))).collect()
}
