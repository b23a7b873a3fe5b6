//! The set-points of an axis keep its limits: as they were planned, and on the wire in drive units.

use std::collections::VecDeque;

use takt::config::{Axis, Config, Control};
use takt_rt::{DriveState, Event, EventKind, OperationMode, Phase, Scale};

use super::Seen;
use crate::heartbeat::MissedHeartbeat;

/// A set-point that was sent.
#[derive(Clone, Copy, Debug)]
struct Point {
    /// As it was planned: rad (m).
    position: f64,
    /// As it went onto the wire; `None` where the wire carries no position.
    counts: Option<i32>,
    /// By how much the wire differs from what was planned for this time, in counts; `None` where it carries another set-point.
    rounding: Option<f64>,
    /// Since the set-point before: cycles in which the trajectory went on.
    cycles: u32,
}

/// Room for the rounding of floating-point sums, relative to a limit.
const ROUNDING: f64 = 1e-6;
/// When none has got to the drive for longer than this, it stands where the last one led.
const GAP_S: f64 = 0.004;

pub struct SetPoints {
    scale: Scale,
    period_s: f64,
    /// What was sent to the enabled drive, newest first.
    points: [Option<Point>; 3],
    /// Where the trajectory has led, newest first. What is on the wire is so many cycles old: an axis on a faster bus waits
    /// for those of its group that follow set-points on slower ones.
    planned: VecDeque<f64>,
    delay_cycles: usize,
    /// The last position on the wire while the drive really was enabled, and in which slot.
    on_wire: Option<(u64, i32)>,
    /// The speed of the joint when its drive was not enabled the last time it was looked at.
    coasting: f64,
    /// Cycles in which the trajectory went on since the last set-point.
    cycles: u32,
    /// Those of its group since the start.
    steps: u64,
    /// The slot of the last set-point.
    sent_slot: u64,
    /// What the last cycle was: the phase, and where the set-point was.
    last: Option<(Phase, f64)>,
}

/// The target position that an axis is sent, while that is what its drive follows: one that may be changed to other modes is sent the
/// targets of all of them.
fn position_on_wire(seen: &Seen<'_>, index: usize) -> Option<i32> {
    let follows_other = [OperationMode::CyclicSynchronousVelocity, OperationMode::CyclicSynchronousTorque];
    let mode = OperationMode::from_number(seen.snapshot.axes[index].mode_set);
    seen.sent[index].position.filter(|_| !mode.is_some_and(|mode| follows_other.contains(&mode)))
}

impl SetPoints {
    pub fn new(config: &Config, number: usize) -> Self {
        let divider = |axis: &Axis| config.buses[axis.bus].divider;
        let (axis, group) = (&config.axes[number], config.axes_of_group(config.group_of_axis(number)));
        let own = group.iter().map(|axis| &config.axes[*axis]);
        let follow = own.filter(|axis| !axis.control.is_profile());
        let slowest = follow.map(divider).max().unwrap_or(1).max(divider(axis));
        Self {
            scale: axis.scale().unwrap(),
            period_s: config.cycle.period_ns as f64 * 1e-9,
            points: [None; 3],
            planned: VecDeque::new(),
            delay_cycles: 2 * (slowest - divider(axis)) as usize,
            on_wire: None,
            coasting: 0.0,
            cycles: 0,
            steps: 0,
            sent_slot: 0,
            last: None,
        }
    }

    pub fn check(&mut self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let axis = &seen.config.axes[index];
        let all_steps = seen.group_of(index).steps;
        let steps = all_steps - std::mem::replace(&mut self.steps, all_steps);
        self.cycles += steps as u32;
        self.check_rates(seen, index)?;
        self.check_wire(seen, index)?;
        if axis.control.is_profile() {
            return Ok(());
        }
        let record = &seen.record.axes()[index];
        // The state as the controller knows it: for a drive that it takes for disabled it plans nothing.
        if record.drive_state != DriveState::OperationEnabled {
            self.points = [None; 3];
            self.planned.clear();
            self.last = None;
            return Ok(());
        }
        if steps > 0 {
            self.planned.push_front(record.position_set);
            self.planned.truncate(self.delay_cycles + 1);
        }
        let phase = seen.phase_of(index);
        if let Some((Phase::Holding, position)) = self.last
            && phase == Phase::Holding
            && position != record.position_set
            && !is_asked_to_move(seen.events_of(seen.groups[index]))
        {
            return Err(format!("holding, and from {position} to {}", record.position_set));
        }
        // What is planned behind a torque or an impedance begins where the joint is.
        let was_streaming = matches!(self.last, Some((Phase::Streaming, _)));
        let may_be_off = seen.are_torques_commanded && matches!(axis.control, Control::Torque { .. });
        // A stream may begin and be stopped in one cycle.
        let has_begun =
            |event: &Event| matches!(event.kind, EventKind::PhaseChanged { to: Phase::Streaming, .. });
        let has_streamed = was_streaming || seen.events_of(seen.groups[index]).any(has_begun);
        if may_be_off && (has_streamed || phase == Phase::Streaming) {
            self.points = [None; 3];
        }
        self.last = Some((phase, record.position_set));
        let sent = &seen.sent[index];
        if sent.position.or(sent.velocity).or(sent.torque).is_none() || !seen.record.is_commanded {
            return Ok(());
        }
        let nominal_s = self.period_s * f64::from(seen.config.buses[axis.bus].divider);
        let slot = seen.snapshot.slot;
        let silent_s = (slot - std::mem::replace(&mut self.sent_slot, slot)) as f64 * self.period_s;
        // An axis that is given up because its set-points do not get through stays where the last one led.
        let is_given_up = silent_s > nominal_s * (1.0 + ROUNDING)
            && self.points[0].is_some_and(|last| last.position == record.position_set);
        if is_given_up || silent_s > GAP_S.max(nominal_s) * (1.0 + ROUNDING) {
            self.points = [None; 3];
        }
        // What was sent before is sent again, until every bus has sent what was ready too late.
        let cycles = std::mem::take(&mut self.cycles);
        if cycles == 0 {
            return Ok(());
        }
        let due = self.planned.get(self.delay_cycles).copied();
        let meant = due.map(|due| self.meant_counts(axis, due));
        let on_wire = position_on_wire(seen, index);
        let rounding = match (due, meant) {
            (Some(due), Some(meant)) if on_wire == Some(meant) => {
                Some((self.scale.position_from_counts(meant) - due).abs() * self.scale.resolution())
            }
            (None, _) => Some(0.5),
            _ => None,
        };
        let point = Point { position: record.position_set, counts: on_wire, rounding, cycles };
        self.check_on_way(axis, &point, meant, nominal_s)?;
        self.check_point(axis, &point)?;
        self.points = [Some(point), self.points[0], self.points[1]];
        Ok(())
    }

    /// The nearest count, or the next one inwards where the nearest lies outside of a limit, and farther out than the set-point.
    fn meant_counts(&self, axis: &Axis, position: f64) -> i32 {
        let nearest = self.scale.position_to_counts(position);
        let at = self.scale.position_from_counts(nearest);
        // A limit that is a whole count is reached, whatever the last digits say.
        let room = 1e-6 / self.scale.resolution();
        let inwards = if at > axis.limits.position_max.max(position) + room {
            -1.0
        } else if at < axis.limits.position_min.min(position) - room {
            1.0
        } else {
            return nearest;
        };
        self.scale.position_to_counts(at + inwards / self.scale.resolution())
    }

    /// What is on the wire is the set-point that is meant. After some that could not leave, it is on the way there at the velocity
    /// limit: a drive does not get the way of several cycles in one.
    fn check_on_way(
        &self,
        axis: &Axis,
        next: &Point,
        meant: Option<i32>,
        cycle_s: f64,
    ) -> Result<(), String> {
        let before = self.points[0].and_then(|last| last.counts);
        let (Some(counts), Some(before), Some(meant)) = (next.counts, before, meant) else { return Ok(()) };
        let farthest = axis.limits.velocity * cycle_s * self.scale.resolution();
        let (way, whole) = (i64::from(counts) - i64::from(before), i64::from(meant) - i64::from(before));
        let is_on_way = way.signum() == whole.signum()
            && way.abs() < whole.abs()
            && way.unsigned_abs() as f64 >= farthest - 1.0;
        if counts == meant || counts == before || is_on_way {
            Ok(())
        } else {
            Err(format!("{counts} counts on the wire for {meant}"))
        }
    }

    /// The planned set-point, by differences of what was sent, and what is on the wire of it.
    fn check_point(&self, axis: &Axis, next: &Point) -> Result<(), String> {
        let Some(last) = self.points[0] else { return Ok(()) };
        let limits = &axis.limits;
        let noise = 8.0 * f64::EPSILON * (1.0 + next.position.abs());
        let step_s = |point: &Point| f64::from(point.cycles) * self.period_s;
        let (next_s, last_s) = (step_s(next), step_s(&last));
        let velocity = (next.position - last.position) / next_s;
        if velocity.abs() > limits.velocity * (1.0 + ROUNDING) + noise / next_s {
            return Err(format!("set-point at {velocity} beyond {}", limits.velocity));
        }
        let room = ROUNDING * (limits.position_max - limits.position_min);
        let is_further_out = next.position > limits.position_max + room && next.position > last.position
            || next.position < limits.position_min - room && next.position < last.position;
        if is_further_out {
            return Err(format!("set-point from {} to {}, out of the limits", last.position, next.position));
        }
        let Some(before) = self.points[1] else { return Ok(()) };
        let before_s = step_s(&before);
        let limit = limits.acceleration.max(limits.deceleration);
        let last_velocity = (last.position - before.position) / last_s;
        let span_s = (next_s + last_s) / 2.0;
        let acceleration = (velocity - last_velocity) / span_s;
        if acceleration.abs() > limit * (1.0 + ROUNDING) + 4.0 * noise / (span_s * next_s.min(last_s)) {
            return Err(format!("set-point with acceleration {acceleration} beyond {limit}"));
        }
        if next.cycles == last.cycles
            && let (Some(of_newest), Some(of_newer), Some(of_older)) =
                (next.rounding, last.rounding, before.rounding)
            && let (Some(newest), Some(newer), Some(older)) = (next.counts, last.counts, before.counts)
        {
            let second = i64::from(newest) - 2 * i64::from(newer) + i64::from(older);
            let rounding = of_newest + 2.0 * of_newer + of_older + ROUNDING;
            let allowed = limit * span_s * span_s * self.scale.resolution() * (1.0 + ROUNDING) + rounding;
            if second.unsigned_abs() as f64 > allowed {
                return Err(format!("second difference of {second} counts on the wire beyond {allowed}"));
            }
        }
        let Some(oldest) = self.points[2] else { return Ok(()) };
        let is_even = next.cycles == last.cycles && last.cycles == before.cycles;
        if is_even && limits.jerk.is_finite() {
            let oldest_velocity = (before.position - oldest.position) / before_s;
            let jerk = (acceleration - (last_velocity - oldest_velocity) / span_s) / span_s;
            if jerk.abs() > limits.jerk * (1.0 + ROUNDING) + 8.0 * noise / span_s.powi(3) {
                return Err(format!("set-point with jerk {jerk} beyond {}", limits.jerk));
            }
        }
        Ok(())
    }

    /// Velocities and torques on the wire keep their limits, in every state of the drive.
    fn check_rates(&self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let (limits, sent) = (&seen.config.axes[index].limits, &seen.sent[index]);
        let velocity = self.scale.velocity_to_drive(limits.velocity).abs() + 1;
        if let Some(sent) = sent.velocity.filter(|sent| sent.abs() > velocity) {
            return Err(format!("velocity {sent} on the wire beyond {velocity}"));
        }
        let torque = self.scale.torque_to_per_mille(limits.torque).abs() + 1;
        match sent.torque.filter(|sent| sent.abs() > torque) {
            Some(sent) => Err(format!("torque {sent} on the wire beyond {torque}")),
            None => Ok(()),
        }
    }

    /// Positions on the wire keep the limits while the drive is enabled in truth, whatever the controller takes it for.
    fn check_wire(&mut self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let (axis, concern, truth) = (&seen.config.axes[index], &seen.concerns[index], &seen.truth[index]);
        if truth.state != DriveState::OperationEnabled {
            self.on_wire = None;
            self.coasting = truth.velocity.abs();
            return Ok(());
        }
        let Some(counts) = position_on_wire(seen, index) else { return Ok(()) };
        let before = self.on_wire.replace((seen.snapshot.slot, counts));
        let position = self.scale.position_from_counts(counts);
        let count = 1.0 / self.scale.resolution();
        let limits = &axis.limits;
        let Some((slot, before)) = before else {
            // The drive is enabled on where it is. Whoever lies about that, or moves it, is a fault.
            let there = self.scale.position_from_counts(truth.position_counts);
            let reach = self.coasting.max(truth.velocity.abs()) * GAP_S + 4.0 * count;
            // A YZ-AIM whose alarm for a missed heartbeat has ended takes the command of before again.
            let has_paused_itself = concern.missed_heartbeat != MissedHeartbeat::No;
            let is_judged =
                !concern.is_present && !has_paused_itself && !seen.config.axes[index].control.is_profile();
            return match is_judged && (position - there).abs() > reach {
                true => Err(format!("enabled at {there}, and sent to {position}")),
                false => Ok(()),
            };
        };
        let last = self.scale.position_from_counts(before);
        // A set-point at a limit is rounded to the inside.
        let room = ROUNDING * (limits.position_max - limits.position_min + count);
        let is_further_out = |position: f64, last: f64| {
            position > limits.position_max + room && position > last.max(limits.position_max) + count
                || position < limits.position_min - room && position < last.min(limits.position_min) - count
        };
        // A drive in profile position is stopped where the joint comes to rest, which may be where it was when it last reported.
        let reference =
            if axis.control.is_profile() { truth.position - truth.velocity * GAP_S } else { last };
        if !concern.is_present && is_further_out(position, last) && is_further_out(position, reference) {
            return Err(format!("from {last} to {position} on the wire, out of the limits"));
        }
        let elapsed_s = (seen.snapshot.slot - slot) as f64 * seen.config.cycle.period_ns as f64 * 1e-9;
        let (step, limit) = ((position - last).abs(), limits.velocity * elapsed_s * (1.0 + ROUNDING) + count);
        if step > limit && !axis.control.is_profile() {
            return Err(format!("step of {step} on the wire beyond {limit}"));
        }
        Ok(())
    }
}

/// Returns `true` if a group with these events has left standstill in this cycle, if only for a move that ends in it.
fn is_asked_to_move<'a>(mut events: impl Iterator<Item = &'a Event>) -> bool {
    events.any(|event| matches!(event.kind, EventKind::PhaseChanged { from: Phase::Holding, .. }))
}
