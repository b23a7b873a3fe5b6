//! What must hold after every cycle, whatever came in.

use takt::config::{Config, Control};
use takt_rt::{
    Engine, Event, EventKind, GroupSnapshot, Phase, RejectReason, RequestError, RequestKind, Rule, Snapshot,
    StopReason,
};

/// Room for rounding, relative to a limit.
const ROOM: f64 = 2e-6;
/// A stop takes no longer than this many times the time from full speed to rest at the limits, and a second for drives
/// that make their own way.
const STOP_PATIENCE: f64 = 4.0;

/// What is known of an axis from the cycles before.
#[derive(Clone, Copy, Default)]
struct Past {
    /// Set-points of the last two cycles, newest first.
    set: [f64; 2],
    /// Cycles in a row in which it was enabled.
    enabled: u32,
}

/// What is known of a group from the cycles before.
#[derive(Clone, Default)]
struct PastGroup {
    phase: Phase,
    /// Cycles in which the set-points went on.
    steps: u64,
    /// The reason of the last stop, as its event gave it.
    reported: Option<StopReason>,
    stopping_cycles: u32,
}

pub struct Watch {
    config: &'static Config,
    axes: Vec<Past>,
    groups: Vec<PastGroup>,
    is_retired: bool,
    /// True if a torque or an impedance was ever wanted of a joint: it need not be on its set-point then.
    pub has_driven: bool,
    refused: u64,
    stopping_at_most: u32,
}

impl Watch {
    pub fn new(config: &'static Config) -> Self {
        let time_to_rest_s = |axis: &takt::config::Axis| {
            let limits = &axis.limits;
            let deceleration = limits.acceleration.min(limits.deceleration);
            limits.velocity / deceleration + 2.0 * deceleration / limits.jerk
        };
        let slowest_s = config.axes.iter().map(time_to_rest_s).fold(0.0, f64::max);
        let patience_s = STOP_PATIENCE * slowest_s + 1.0;
        Self {
            config,
            axes: vec![Past::default(); config.axes.len()],
            groups: vec![PastGroup::default(); config.groups.len().max(1)],
            is_retired: false,
            has_driven: false,
            refused: 0,
            stopping_at_most: (patience_s * 1e9 / config.cycle.period_ns as f64) as u32,
        }
    }

    /// Somebody has asked the engine to enable nothing any more.
    pub fn retire(&mut self) {
        self.is_retired = true;
    }

    /// Looks at a cycle. `has_acted` tells whether set-points could leave.
    pub fn look(&mut self, engine: &Engine, events: &[Event], snapshot: &Snapshot, has_acted: bool) {
        events.iter().for_each(|event| self.hear(event));
        assert_eq!(self.refused, snapshot.rejected, "a rejection without an event");
        for (number, shown) in snapshot.groups().iter().enumerate() {
            let phase = self.groups[number].phase;
            assert_eq!(phase, engine.phase(number as u8).unwrap_or_default(), "a phase without an event");
            assert_eq!(phase, shown.phase);
            self.look_at_stop(number, shown, has_acted);
            if shown.steps != std::mem::replace(&mut self.groups[number].steps, shown.steps) {
                self.look_at_set_points(number, engine);
            }
        }
    }

    fn hear(&mut self, event: &Event) {
        let is_retired = self.is_retired;
        let group = event.group.map(usize::from);
        let number = group.unwrap_or(0);
        assert!(
            group.is_some()
                || matches!(
                    event.kind,
                    EventKind::Rejected(_) | EventKind::MissedSlots { .. } | EventKind::Timing { .. }
                ),
            "{event:?}"
        );
        match event.kind {
            EventKind::PhaseChanged { from, to } => {
                let group = &mut self.groups[number];
                assert_eq!(from, group.phase, "the phase before {to:?}");
                let is_possible = match to {
                    Phase::Passive => from == Phase::Disabled && !is_retired,
                    Phase::Disabled => matches!(from, Phase::Passive | Phase::Disabling),
                    Phase::Enabling => from == Phase::Disabled && !is_retired,
                    Phase::Holding => matches!(from, Phase::Enabling | Phase::Moving | Phase::Stopping),
                    // A callback that is over comes to rest by a move.
                    Phase::Moving => matches!(from, Phase::Holding | Phase::Streaming),
                    Phase::Streaming => from == Phase::Holding,
                    // A joint of a group that holds may still be on its way to its set-point.
                    Phase::Stopping => matches!(from, Phase::Holding | Phase::Moving | Phase::Streaming),
                    Phase::Disabling => !matches!(from, Phase::Passive | Phase::Disabled),
                };
                assert!(is_possible, "{from:?} to {to:?}");
                (group.phase, group.stopping_cycles) = (to, 0);
            }
            EventKind::Stop(stop) => {
                let group = &mut self.groups[number];
                assert_eq!(stop.phase, group.phase, "{stop:?}");
                group.reported = Some(stop);
            }
            EventKind::Rejected(rejected) => self.hear_rejection(group, &rejected),
            _ => {}
        }
    }

    fn hear_rejection(&mut self, group: Option<usize>, rejected: &RequestError) {
        self.refused += 1;
        assert_eq!(rejected.phase, self.groups[group.unwrap_or(0)].phase, "{rejected:?}");
        assert!(rejected.axis.is_none_or(|axis| usize::from(axis) < self.axes.len()), "{rejected:?}");
        let never = [RequestKind::Sync, RequestKind::Stop, RequestKind::InhibitEnable, RequestKind::Shutdown];
        let is_of_nobody = matches!(rejected.reason, RejectReason::UnknownGroup { .. });
        assert!(!never.contains(&rejected.request) || is_of_nobody, "{rejected:?}");
        assert!(
            rejected.request != RequestKind::Position
                || matches!(rejected.reason, RejectReason::UnknownAxis { .. })
        );
    }

    fn look_at_stop(&mut self, number: usize, shown: &GroupSnapshot, has_acted: bool) {
        let group = &mut self.groups[number];
        let (phase, stop) = (group.phase, shown.stop);
        let is_latched = stop.is_some_and(|stop| stop.rule() != Rule::Requested);
        let is_on_way = matches!(phase, Phase::Enabling | Phase::Moving | Phase::Streaming);
        assert!(!(is_latched && is_on_way), "{phase:?} in spite of {stop:?}");
        if let Some(stop) = stop {
            let reported = group.reported.expect("a stop without an event");
            assert_eq!(
                (reported.rule(), reported.origin, reported.slot),
                (stop.rule(), stop.origin, stop.slot)
            );
            assert!(stop.category <= reported.category, "{stop:?} was {reported:?}");
        }
        if phase == Phase::Stopping {
            assert!(stop.is_some(), "a stop without a reason");
            group.stopping_cycles += u32::from(has_acted);
            assert!(group.stopping_cycles <= self.stopping_at_most, "the stop does not end: {stop:?}");
        }
    }

    fn look_at_set_points(&mut self, group: usize, engine: &Engine) {
        let period_s = self.config.cycle.period_ns as f64 * 1e-9;
        for axis in engine.axes() {
            let number = usize::from(axis.number());
            if self.config.group_of_axis(number) != group {
                continue;
            }
            let (past, named) = (&mut self.axes[number], &self.config.axes[number]);
            let (limits, now) = (&axis.parameters().limits, axis.set_point().position);
            let [last, before] = past.set;
            past.enabled = if axis.is_enabled() { past.enabled + 1 } else { 0 };
            past.set = [now, last];
            let (name, phase) = (&named.name, self.groups[group].phase);
            assert!(now.is_finite(), "{name}: {now}");
            // What is planned behind a torque or an impedance begins where the joint is.
            let may_be_off = self.has_driven && matches!(named.control, Control::Torque { .. });
            if axis.is_profile() || past.enabled < 2 || may_be_off {
                continue;
            }
            let room = ROOM * (limits.position_max - limits.position_min);
            let is_deeper =
                now > last.max(limits.position_max + room) || now < last.min(limits.position_min - room);
            assert!(!is_deeper, "{name}: set-point {last} to {now}, outside its limits, {phase:?}");
            let speed = (now - last) / period_s;
            assert!(speed.abs() <= limits.velocity * (1.0 + ROOM), "{name}: {speed} rad/s, {phase:?}");
            let is_guarded =
                matches!(phase, Phase::Holding | Phase::Moving | Phase::Streaming | Phase::Stopping);
            if is_guarded && past.enabled >= 3 {
                let acceleration = (speed - (last - before) / period_s) / period_s;
                let noise = 8.0 * f64::EPSILON * (1.0 + now.abs()) / (period_s * period_s);
                let most = limits.acceleration.max(limits.deceleration) * (1.0 + ROOM) + noise;
                assert!(acceleration.abs() <= most, "{name}: {acceleration} rad/s², {phase:?}");
            }
        }
    }
}
