//! The state machine of a group: it never stays where it must pass, and every stop has one reason.

use takt::config::{Axis, Config, Control};
use takt_rt::{EventKind, GroupSnapshot, Phase, Rule};

use super::Seen;
use crate::bounds;

pub struct Phases {
    group: usize,
    axes: Vec<Axis>,
    phase: Phase,
    cycles: u64,
    is_latched: bool,
}

impl Phases {
    pub fn new(config: &Config, group: usize) -> Self {
        let axes = config.axes_of_group(group).iter().map(|axis| config.axes[*axis].clone()).collect();
        Self { group, axes, phase: Phase::default(), cycles: 0, is_latched: false }
    }

    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        self.check_reasons(seen)?;
        let GroupSnapshot { phase, needs_bring_up, .. } = seen.snapshot.groups()[self.group];
        if needs_bring_up && !matches!(phase, Phase::Passive | Phase::Disabled) {
            return Err(format!("group {}: {phase:?} without a bring-up that has succeeded", self.group));
        }
        if phase == self.phase {
            self.cycles += 1;
        } else {
            (self.phase, self.cycles) = (phase, 0);
        }
        // Every group waits as long as the drive that needs the longest time after power-on.
        let enabled_from_ns = seen.config.axes.iter().map(|axis| axis.drive.enabled_from_ns).max();
        let enabled_from_s = enabled_from_ns.unwrap_or(0) as f64 * 1e-9;
        match longest_s(phase, &self.axes, enabled_from_s) {
            Some(longest_s) if self.cycles > bounds::cycles(seen.config, longest_s) => {
                Err(format!("group {}: {phase:?} for {} cycles: stuck", self.group, self.cycles))
            }
            _ => Ok(()),
        }
    }

    fn check_reasons(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        let (group, asked) = (&seen.snapshot.groups()[self.group], &seen.asked[self.group]);
        let shown = group.stop.filter(|stop| stop.rule() != Rule::Requested);
        let was_latched = self.is_latched;
        for event in seen.events_of(self.group) {
            match event.kind {
                // A drive that has torque when it should have none takes the place of any other reason.
                EventKind::Stop(reason)
                    if matches!(reason.rule(), Rule::NotDisabled | Rule::DriveEnabled) =>
                {
                    self.is_latched = true;
                }
                EventKind::Stop(reason) if reason.rule() != Rule::Requested => {
                    if self.is_latched && !asked.has_reset_lately {
                        return Err(format!("a second reason: {reason:?}, shown {:?}", group.stop));
                    }
                    self.is_latched = true;
                }
                EventKind::PhaseChanged { to: Phase::Enabling, .. }
                    if was_latched && !asked.has_reset_lately =>
                {
                    return Err("enabling while a fault is latched".to_owned());
                }
                _ => {}
            }
        }
        if self.is_latched && shown.is_none() {
            if !asked.has_reset_lately {
                return Err("the reason of a stop is gone without a reset".to_owned());
            }
            self.is_latched = false;
        }
        if shown.is_some() && !self.is_latched {
            return Err(format!("no event has reported {shown:?}"));
        }
        let must_have_reason = group.phase == Phase::Stopping;
        match must_have_reason && group.stop.is_none() {
            true => Err("it stops without a reason".to_owned()),
            false => Ok(()),
        }
    }
}

/// How long a phase that must pass by itself may last.
fn longest_s(phase: Phase, axes: &[Axis], enabled_from_s: f64) -> Option<f64> {
    match phase {
        Phase::Passive | Phase::Disabled | Phase::Holding => None,
        // A velocity or a torque may be asked for again and again.
        Phase::Moving if axes.iter().any(|axis| axis.control.is_profile()) => None,
        Phase::Moving => Some(30.0),
        Phase::Streaming => Some(10.0),
        Phase::Enabling => Some(5.2 + enabled_from_s),
        Phase::Stopping => Some(2.0 * bounds::to_rest_s(axes) + 1.0),
        Phase::Disabling => Some(5.2 + enabled_from_s + bounds::to_rest_s(axes)),
    }
}

/// Returns `true` if nothing bounds the speed of a joint but friction.
pub fn is_unbounded(control: &Control) -> bool {
    matches!(control, Control::ProfileTorque)
}
