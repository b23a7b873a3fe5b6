//! What holds after every cycle, whatever has been asked for and whatever has broken.

use takt::config::{Axis, Config, Control, DriveFamily};
use takt::controller::assemble;
use takt::drive::ProcessData;
use takt::faults::{Effect, ForeignFrames, FrameEffect, Part, Scenario};
use takt::sim::Observation;
use takt_rt::cia402::State;
use takt_rt::door::Snapshot;
use takt_rt::frame::Frame;
use takt_rt::record::{CycleRecord, Event, EventKind};
use takt_rt::stop::{Phase, Rule};
use takt_rt::units::Scale;

use crate::bounds;

const TARGET_POSITION: u16 = 0x607A;
const TARGET_VELOCITY: u16 = 0x60FF;
const TARGET_TORQUE: u16 = 0x6071;
const CONTROLWORD: u16 = 0x6040;
/// Slower than this is rest: rad/s (m/s).
pub const REST: f64 = 2e-3;

/// What is known of an axis.
struct Watched {
    scale: Scale,
    commands: ProcessData,
    /// A fault concerns this joint, its drive or its bus.
    is_concerned: bool,
    /// A torque from outside acts on the joint, or another master enables its drive between two looks.
    is_driven_by_others: bool,
    /// Frames that pass the CRC with a wrong content can tell of a drive that is disabled and somewhere else, two cycles in
    /// a row; its set-point then follows what they say. Nothing in the process data could show that they lie.
    is_lied_about: bool,
    /// The last position on the wire while the drive was enabled, and in which slot.
    last: Option<(u64, i32)>,
    truth: Option<Observation>,
    /// Where the joint was when the present stop began.
    stop_position: f64,
}

pub struct Invariants {
    axes: Vec<Watched>,
    phase: Phase,
    phase_cycles: u64,
    is_latched: bool,
    /// Cycles since the stop under way began.
    stopping: Option<u64>,
}

impl Invariants {
    pub fn new(config: &Config, scenario: &Scenario) -> Self {
        let watched = |axis: &Axis| Watched {
            scale: assemble::scale(axis).unwrap(),
            commands: ProcessData::of(axis),
            is_concerned: is_concerned(axis, scenario),
            is_driven_by_others: of_kind(axis, scenario, &["load", "foreign-set-points"]),
            is_lied_about: of_kind(axis, scenario, &["corrupt"]),
            last: None,
            truth: None,
            stop_position: 0.0,
        };
        Self {
            axes: config.axes.iter().map(watched).collect(),
            phase: Phase::Passive,
            phase_cycles: 0,
            is_latched: false,
            stopping: None,
        }
    }

    /// Looks at one cycle: what was sent (an entry a bus), what is true of the drives (an axis each), what was told.
    pub fn check(
        &mut self,
        config: &Config,
        snapshot: &Snapshot,
        sent: &[Vec<Frame>],
        truth: &[Observation],
        events: &[Event],
    ) -> Result<(), String> {
        self.check_wire(config, snapshot, sent, truth)?;
        self.check_powerless(config, truth)?;
        self.check_reasons(snapshot, events)?;
        self.check_phase(config, snapshot)?;
        self.check_stop(config, snapshot, truth)?;
        for (watched, truth) in self.axes.iter_mut().zip(truth) {
            watched.truth = Some(*truth);
        }
        Ok(())
    }

    /// The acceleration of what is planned stays within the limits.
    pub fn check_record(&self, config: &Config, record: &CycleRecord) -> Result<(), String> {
        if !matches!(record.phase, Phase::Moving | Phase::Stopping) {
            return Ok(());
        }
        for (axis, record) in config.axes.iter().zip(record.axes()) {
            let limit = axis.limits.acceleration.max(axis.limits.deceleration);
            let asked = f64::from(record.acceleration_set).abs();
            if asked > limit * (1.0 + 1e-5) {
                return Err(format!("{}: planned acceleration {asked} beyond {limit}", axis.name));
            }
        }
        Ok(())
    }

    fn check_wire(
        &mut self,
        config: &Config,
        snapshot: &Snapshot,
        sent: &[Vec<Frame>],
        truth: &[Observation],
    ) -> Result<(), String> {
        for ((axis, watched), truth) in config.axes.iter().zip(&mut self.axes).zip(truth) {
            let is_enabled = truth.state == State::OperationEnabled;
            if !is_enabled {
                watched.last = None;
            }
            for command in &watched.commands.commands {
                let Some(frame) = sent[axis.bus].iter().rev().find(|frame| frame.id() == command.id) else {
                    continue;
                };
                let value = |index: u16| value(&command.objects, frame, index);
                if let Some(word) = value(CONTROLWORD)
                    && axis.drive == DriveFamily::ErobCanopen
                    && snapshot.phase == Phase::Disabled
                    && word & 0xF == 0xF
                {
                    return Err(format!("{}: controlword {word:#06x} in a disabled group", axis.name));
                }
                if let Some(velocity) = value(TARGET_VELOCITY) {
                    let limit = watched.scale.velocity_to_drive(axis.limits.velocity).abs() + 1;
                    if velocity.abs() > limit {
                        return Err(format!("{}: velocity {velocity} on the wire beyond {limit}", axis.name));
                    }
                }
                if let Some(torque) = value(TARGET_TORQUE) {
                    let limit = watched.scale.torque_to_per_mille(axis.limits.torque).abs() + 1;
                    if torque.abs() > limit {
                        return Err(format!("{}: torque {torque} on the wire beyond {limit}", axis.name));
                    }
                }
                if let Some(counts) =
                    value(TARGET_POSITION).filter(|_| !axis.control.is_profile() && is_enabled)
                {
                    if let Some((slot, last)) = watched.last {
                        let elapsed_s = (snapshot.slot - slot) as f64 * config.cycle.period_ns as f64 * 1e-9;
                        let step = (f64::from(counts) - f64::from(last)).abs() / watched.scale.resolution();
                        let limit = axis.limits.velocity * elapsed_s * (1.0 + 1e-6)
                            + 1.0 / watched.scale.resolution();
                        if step > limit && !watched.is_lied_about {
                            return Err(format!("{}: step of {step} on the wire beyond {limit}", axis.name));
                        }
                    }
                    watched.last = Some((snapshot.slot, counts));
                }
            }
        }
        Ok(())
    }

    /// A joint without torque does not speed up, and one that is braked and stands stays.
    fn check_powerless(&self, config: &Config, truth: &[Observation]) -> Result<(), String> {
        for ((axis, watched), now) in config.axes.iter().zip(&self.axes).zip(truth) {
            let Some(before) = watched.truth.filter(|_| !watched.is_driven_by_others) else { continue };
            let was_powerless = !before.state.has_torque() && !now.state.has_torque();
            if was_powerless && now.torque == 0.0 && now.velocity.abs() > before.velocity.abs() + 1e-9 {
                return Err(format!("{}: without torque from {before:?} to {now:?}", axis.name));
            }
            let stood = was_powerless && before.is_braked && now.is_braked && before.velocity == 0.0;
            if stood && now.position != before.position {
                return Err(format!("{}: braked, but moves from {before:?} to {now:?}", axis.name));
            }
        }
        Ok(())
    }

    fn check_reasons(&mut self, snapshot: &Snapshot, events: &[Event]) -> Result<(), String> {
        for event in events {
            match event.kind {
                EventKind::Stop(reason) if reason.rule != Rule::Requested => {
                    if self.is_latched {
                        return Err(format!("a second reason: {reason:?}, shown {:?}", snapshot.stop));
                    }
                    self.is_latched = true;
                }
                _ => {}
            }
        }
        let shown = snapshot.stop.filter(|stop| stop.rule != Rule::Requested);
        if shown.is_some() != self.is_latched {
            return Err(format!("told of a stop: {}, shown {:?}", self.is_latched, snapshot.stop));
        }
        if snapshot.phase == Phase::Stopping && snapshot.stop.is_none() {
            return Err("it stops without a reason".to_owned());
        }
        Ok(())
    }

    fn check_phase(&mut self, config: &Config, snapshot: &Snapshot) -> Result<(), String> {
        if snapshot.phase == self.phase {
            self.phase_cycles += 1;
        } else {
            (self.phase, self.phase_cycles) = (snapshot.phase, 0);
        }
        let at_most_s = match self.phase {
            Phase::Passive | Phase::Disabled | Phase::Holding => return Ok(()),
            // A drive in profile position that is held fast may try for ever: nobody watches its following error.
            Phase::Moving if config.axes.iter().any(|axis| axis.control == Control::ProfilePosition) => {
                return Ok(());
            }
            Phase::Moving => 30.0,
            Phase::Streaming => 10.0,
            Phase::Enabling => 5.2,
            Phase::Stopping => 2.0 * bounds::to_rest_s(config) + 1.0,
            // A drive that never shows that it has obeyed is waited for once more when the stop becomes harder.
            Phase::Disabling => 2.0 * (5.2 + bounds::to_rest_s(config)),
        };
        if self.phase_cycles > bounds::cycles(config, at_most_s) {
            return Err(format!("{:?} for {} cycles: stuck", self.phase, self.phase_cycles));
        }
        Ok(())
    }

    /// Once a stop from motion has begun, joints that obey are at rest after the stated time, within the stated distance.
    fn check_stop(
        &mut self,
        config: &Config,
        snapshot: &Snapshot,
        truth: &[Observation],
    ) -> Result<(), String> {
        match (snapshot.phase, self.stopping) {
            (Phase::Moving | Phase::Streaming | Phase::Enabling, _) => self.stopping = None,
            (Phase::Stopping, None) => {
                self.stopping = Some(0);
                for (watched, truth) in self.axes.iter_mut().zip(truth) {
                    watched.stop_position = truth.position;
                }
            }
            (_, Some(cycles)) => self.stopping = Some(cycles + 1),
            _ => {}
        }
        let Some(cycles) = self.stopping else { return Ok(()) };
        let is_over = cycles > bounds::cycles(config, bounds::to_rest_s(config));
        for ((axis, watched), truth) in config.axes.iter().zip(&self.axes).zip(truth) {
            if watched.is_concerned {
                continue;
            }
            let (travelled, limit) =
                ((truth.position - watched.stop_position).abs(), bounds::to_rest_distance(config, axis));
            // Nothing bounds the speed of a joint in profile torque but friction.
            let is_bounded = !matches!(axis.control, Control::ProfileTorque);
            if is_bounded && travelled > limit {
                return Err(format!("{}: {travelled} since the stop began, beyond {limit}", axis.name));
            }
            if is_over && truth.velocity.abs() > REST.max(0.01 * axis.limits.velocity) {
                return Err(format!("{}: {} after the time to rest", axis.name, truth.velocity));
            }
        }
        Ok(())
    }
}

/// The value of an object in a frame, if it travels there.
fn value(objects: &[takt_rt::pdo::MappedObject], frame: &Frame, index: u16) -> Option<i32> {
    let mut shift = 0;
    for object in objects {
        if object.index == index {
            let word = frame.first_word() >> shift;
            return Some(if object.bits == 32 { word as i32 } else { i32::from(word as i16) });
        }
        shift += u32::from(object.bits);
    }
    None
}

/// Whether a fault concerns a joint: it is at the drive, among the frames of the node, or of the whole bus.
fn is_concerned(axis: &Axis, scenario: &Scenario) -> bool {
    let own = |id: u32| (id & 0x7F) == u32::from(axis.node);
    scenario.faults.iter().filter(|fault| fault.bus == axis.bus).any(|fault| match fault.effect {
        Effect::Drive { node, .. } => node == axis.node,
        Effect::Frames(FrameEffect::Corrupt { part: Part::Payload, .. } | FrameEffect::Drop) => {
            !fault.place.starts_with("axis ") || fault.place == format!("axis {}", axis.name)
        }
        Effect::Foreign(ForeignFrames::SetPoints { id, .. }) => own(id.value()),
        _ => true,
    })
}

/// Whether there is a fault of such a kind on the bus of an axis.
fn of_kind(axis: &Axis, scenario: &Scenario, kinds: &[&str]) -> bool {
    scenario.faults.iter().any(|fault| fault.bus == axis.bus && kinds.contains(&fault.kind))
}
