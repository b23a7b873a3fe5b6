//! A machine that has too little time, and no other fault, makes no joint faster than its limit, and a drive that it cannot
//! reach any more has no torque in the time that is stated.

use takt::config::Control;
use takt::controller::assemble::slot_plan;
use takt_rt::controlword;

use super::Seen;
use crate::bounds;
use crate::wire::SentValues;

/// How far a drive's own loop may overshoot the velocity limit. Where slots are missed its set-points stand still, and go on at full speed: the
/// drive catches up with its highest torque, up to its own highest velocity. That of the simulated ones is 1.5 times the limit, and
/// their loops overshoot it a little: 1.501 has been seen.
const OVERSHOOT: f64 = 1.55;

pub fn check(seen: &Seen<'_>) -> Result<(), String> {
    check_deadline(seen)?;
    if seen.has_faults {
        return Ok(());
    }
    for (index, axis) in seen.config.axes.iter().enumerate() {
        let (truth, concern) = (&seen.truth[index], &seen.concerns[index]);
        // Nothing but the loop that takt closes bounds the speed of a joint that is given torque.
        let is_given_torque = |law: &Control| matches!(law, Control::ProfileTorque | Control::Torque { .. });
        let has_own_velocity_loop = !axis.controls().any(is_given_torque);
        let most = OVERSHOOT * axis.limits.velocity;
        if has_own_velocity_loop && truth.state.has_torque() && truth.velocity.abs() > most {
            return Err(format!("{}: at {} beyond {most}: {truth:?}", axis.name, truth.velocity));
        }
        // Nothing stops a drive without a watchdog that no frame reaches.
        if concern.is_unwatched && concern.is_beyond_reach {
            continue;
        }
        let unreached_s = concern.unreachable_since_ns.map(|ns| (seen.snapshot.at_ns - ns) as f64 * 1e-9);
        let stated_s = bounds::unreached_s(seen.config);
        if let Some(unreached_s) = unreached_s.filter(|s| *s > stated_s && truth.state.has_torque()) {
            return Err(format!("{}: torque after {unreached_s} s: {truth:?}", axis.name));
        }
    }
    Ok(())
}

/// After the deadline of the set-points nothing leaves except what stops the drives: no controlword that has one operate.
fn check_deadline(seen: &Seen<'_>) -> Result<(), String> {
    let (sent_ns, latest_ns) = (seen.record.timing.sent_ns, slot_plan(seen.config).latest_set_points_ns);
    if sent_ns <= latest_ns {
        return Ok(());
    }
    let operates = |sent: &SentValues| {
        let is_halted = |word: u16| word & controlword::HALT != 0;
        sent.controlword.is_some_and(|word| word & 0xF == controlword::ENABLE_OPERATION && !is_halted(word))
    };
    match seen.sent.iter().position(operates) {
        Some(axis) => {
            let name = &seen.config.axes[axis].name;
            Err(format!("{name}: set-points {sent_ns} ns after the slot began, later than {latest_ns} ns"))
        }
        None => Ok(()),
    }
}
