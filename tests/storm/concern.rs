//! Whom a fault concerns, from the cycle on in which it begins.

use takt::config::{Axis, Config};
use takt::family;
use takt::faults::{
    Direction, DriveEffect, Effect, FaultInjector, ForeignFrames, FrameEffect, FrameFunction,
    InterfaceEffect, Part, Selection, Trigger,
};
use takt::schedule::analyse;
use takt::sim::Defect;
use takt_wire::canopen::nmt::{NmtCommand, NmtTarget};

use crate::heartbeat::{Heartbeats, MissedHeartbeat};
use crate::off_cycle::is_beside_the_cycle;

/// What can no longer be expected of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Concern {
    /// A fault concerns this joint, its drive or its bus: it may not obey.
    pub is_present: bool,
    /// Its drive may have another state than the controller hears of.
    pub is_misreported: bool,
    /// A torque from outside acts on it, another master commands its drive, or its drive does by itself what it was not asked to.
    pub is_driven_by_others: bool,
    /// What is sent to its drive is corrupted with a right CRC: it does what it hears.
    pub is_misled: bool,
    /// The same, or nothing that stops its drive gets there, and that has no end. Where its drive has no watchdog, nothing stops it.
    pub is_beyond_reach: bool,
    /// Nothing, or no SDO request, gets to its drive while the fault lasts.
    pub is_cut_off: bool,
    /// Its drive waits for no heartbeat: another master has reset its communication, or it has heard none yet.
    pub is_unwatched: bool,
    /// Somebody else sends on its bus, and what its drive reports may have to wait for that.
    pub is_crowded: bool,
    /// The loop was away for some time.
    pub has_paused: bool,
    /// The loop has missed slots in the last cycles.
    pub is_late: bool,
    /// Its drive is spoken to outside of the cycle, by a thread that is late every time.
    pub is_neglected: bool,
    /// Something pushes the joint for as long as it lasts, also in the end.
    pub is_loaded: bool,
    /// Whether its drive has missed the heartbeat, and stops by itself.
    pub missed_heartbeat: MissedHeartbeat,
    /// Its drive has taken its power after it missed the heartbeat, and has not been enabled since.
    pub has_cut_itself: bool,
    /// Since when nothing that is sent to its drive gets there any more: ns.
    pub unreachable_since_ns: Option<u64>,
}

impl Concern {
    fn or(self, other: Self) -> Self {
        Self {
            is_present: self.is_present || other.is_present,
            is_misreported: self.is_misreported || other.is_misreported,
            is_driven_by_others: self.is_driven_by_others || other.is_driven_by_others,
            is_misled: self.is_misled || other.is_misled,
            is_beyond_reach: self.is_beyond_reach || other.is_beyond_reach,
            is_cut_off: self.is_cut_off || other.is_cut_off,
            is_unwatched: self.is_unwatched || other.is_unwatched,
            is_crowded: self.is_crowded || other.is_crowded,
            has_paused: self.has_paused || other.has_paused,
            is_late: self.is_late || other.is_late,
            is_neglected: self.is_neglected || other.is_neglected,
            is_loaded: self.is_loaded || other.is_loaded,
            missed_heartbeat: self.missed_heartbeat.max(other.missed_heartbeat),
            has_cut_itself: self.has_cut_itself || other.has_cut_itself,
            unreachable_since_ns: self.unreachable_since_ns.or(other.unreachable_since_ns),
        }
    }
}

/// Cycles after a missed slot in which a joint whose loop is closed here may still swing.
const LATE_CYCLES: u64 = 50;

/// The concerns of every axis, as far as the faults have begun.
pub struct Concerns {
    /// For each fault, an entry an axis.
    by_fault: Vec<Vec<Concern>>,
    has_begun: Vec<bool>,
    /// The bus of each fault.
    buses: Vec<usize>,
    pub by_axis: Vec<Concern>,
    /// True if any fault has begun on a bus, an entry a bus.
    pub by_bus: Vec<bool>,
    /// True if a bus cannot carry in time what is asked of it, an entry a bus: `takt run` refuses such a machine.
    pub is_overloaded: Vec<bool>,
    bus_of_axis: Vec<usize>,
    cycles_since_late: u64,
}

impl Concerns {
    pub fn new(config: &Config, fault_injector: &FaultInjector) -> Self {
        let of_fault = |fault: &takt::faults::ScenarioFault| -> Vec<Concern> {
            config.axes.iter().map(|axis| concern(axis, fault)).collect()
        };
        let by_fault: Vec<Vec<Concern>> =
            fault_injector.progress().map(|(fault, _)| of_fault(fault)).collect();
        Self {
            has_begun: vec![false; by_fault.len()],
            buses: fault_injector.progress().map(|(fault, _)| fault.bus).collect(),
            by_fault,
            by_axis: config.axes.iter().map(without_fault).collect(),
            by_bus: vec![false; config.buses.len()],
            is_overloaded: analyse(config).iter().map(|bus| !bus.fits()).collect(),
            bus_of_axis: config.axes.iter().map(|axis| axis.bus).collect(),
            cycles_since_late: u64::MAX,
        }
    }

    /// The loop is late: frames may meet those of the next cycle on any bus.
    pub fn crowd(&mut self) {
        self.by_bus.fill(true);
        for concern in &mut self.by_axis {
            concern.is_crowded = true;
        }
    }

    /// The life cycle looks only after so many cycles: the drives that are spoken to outside of the cycle wait for that.
    pub fn neglect(&mut self, config: &Config, cycles: u64) {
        // What a controller that is alive keeps to: see the budget of the family.
        const PUNCTUAL_CYCLES: u64 = 2;
        for (concern, axis) in self.by_axis.iter_mut().zip(&config.axes) {
            concern.is_neglected = cycles > PUNCTUAL_CYCLES && is_beside_the_cycle(axis);
        }
    }

    /// The loop is away for some time.
    pub fn pause(&mut self) {
        self.by_axis.iter_mut().for_each(|concern| concern.has_paused = true);
    }

    /// From now on the loop is too late in every slot.
    pub fn miss_every_slot(&mut self, now_ns: u64) {
        self.crowd();
        for concern in &mut self.by_axis {
            concern.is_present = true;
            concern.unreachable_since_ns.get_or_insert(now_ns);
        }
    }

    /// The queue of a bus does not drain: for a time, or from now on for ever.
    pub fn clog(&mut self, bus: usize, now_ns: u64, is_for_ever: bool) {
        self.by_bus[bus] = true;
        for (concern, _) in self.by_axis.iter_mut().zip(&self.bus_of_axis).filter(|(_, of)| **of == bus) {
            (concern.is_present, concern.is_crowded) = (true, true);
            concern.is_beyond_reach |= is_for_ever;
            if is_for_ever {
                concern.unreachable_since_ns.get_or_insert(now_ns);
            }
        }
    }

    /// Takes which drives have missed the heartbeat.
    pub fn note_missed_heartbeats(&mut self, heartbeats: &Heartbeats) {
        let shown = heartbeats.missed().zip(heartbeats.cut_themselves());
        for (concern, (missed, has_cut_itself)) in self.by_axis.iter_mut().zip(shown) {
            (concern.missed_heartbeat, concern.has_cut_itself) = (missed, has_cut_itself);
        }
    }

    /// Returns `true` if the last frames to an axis may have been corrupted: such a fault has not ended yet.
    pub fn is_misled_now(&self, fault_injector: &FaultInjector, axis: usize) -> bool {
        self.is_any_active(fault_injector, axis, |concern| concern.is_misled)
    }

    /// Returns `true` if a fault is active that keeps what is sent to a drive from it.
    pub fn is_cut_off_now(&self, fault_injector: &FaultInjector, axis: usize) -> bool {
        self.is_any_active(fault_injector, axis, |concern| concern.is_cut_off)
    }

    fn is_any_active(
        &self,
        fault_injector: &FaultInjector,
        axis: usize,
        is_such: impl Fn(&Concern) -> bool,
    ) -> bool {
        let mut faults = fault_injector.progress().zip(&self.by_fault);
        faults.any(|((_, progress), concerns)| {
            let is_active = progress.began_ns().is_some() && progress.ended_ns().is_none();
            is_active && is_such(&concerns[axis])
        })
    }

    /// Takes whether the loop has missed slots in a cycle.
    pub fn note_missed_slots(&mut self, has_missed: bool) {
        self.cycles_since_late = if has_missed { 0 } else { self.cycles_since_late.saturating_add(1) };
        let is_late = self.cycles_since_late < LATE_CYCLES;
        self.by_axis.iter_mut().for_each(|concern| concern.is_late = is_late);
    }

    /// Looks which faults have begun since the last look, and calls `begun` with the number of each.
    pub fn observe(&mut self, fault_injector: &FaultInjector, mut begun: impl FnMut(usize)) {
        for (number, (_, progress)) in fault_injector.progress().enumerate() {
            if !self.has_begun[number] && progress.began_ns().is_some() {
                self.has_begun[number] = true;
                self.by_bus[self.buses[number]] = true;
                for (present, new) in self.by_axis.iter_mut().zip(&self.by_fault[number]) {
                    *present = present.or(*new);
                }
                begun(number);
            }
        }
    }
}

/// What cannot be expected of a joint from the first.
fn without_fault(axis: &Axis) -> Concern {
    // A drive on a line has a communication time-out of its own.
    let is_watched = axis.drive.consumes_heartbeat || axis.drive.protocol.is_of_serial_line();
    Concern { is_unwatched: !is_watched, ..Concern::default() }
}

fn concern(axis: &Axis, fault: &takt::faults::ScenarioFault) -> Concern {
    if fault.bus != axis.bus {
        return Concern::default();
    }
    let is_own = fault.location == format!("axis {}", axis.name);
    let is_at_another_axis = fault.location.starts_with("axis ") && !is_own;
    let own = |id: u32| (id & 0x7F) == u32::from(axis.node);
    let is_present = match fault.effect {
        Effect::Drive { node, .. } => node == axis.node,
        Effect::Frames(FrameEffect::Corrupt { part: Part::Payload, .. } | FrameEffect::Drop) => {
            !is_at_another_axis
        }
        Effect::Foreign(ForeignFrames::SetPoints { id, .. }) => own(id.value()),
        _ => true,
    };
    let is_misled = match fault.effect {
        Effect::Frames(FrameEffect::Corrupt { part, .. }) => {
            let is_of_drives =
                matches!(fault.selection.function, Some(FrameFunction::Tpdo | FrameFunction::Emergency));
            let is_sent = fault.selection.direction != Direction::Received && !is_of_drives;
            // What is meant for another drive may come to this one.
            is_sent && (!is_at_another_axis || part == Part::Identifier)
        }
        _ => false,
    };
    let is_unwatched = match fault.effect {
        Effect::Foreign(ForeignFrames::Frame { frame, .. }) => matches!(
            NmtCommand::decode(&frame),
            Some((NmtCommand::ResetCommunication, target)) if [NmtTarget::All, NmtTarget::Node(axis.node)].contains(&target)
        ),
        // A drive waits for heartbeats from the first one on that it hears (CiA 301, 7.2.8.3.2.2). This one may have heard none.
        Effect::Frames(FrameEffect::Drop) => {
            fault.window.trigger == Trigger::Start
                && fault.selection.direction != Direction::Received
                && fault.selection.function == Some(FrameFunction::Heartbeat)
        }
        _ => false,
    };
    let is_cut_off = match fault.effect {
        Effect::Interface(effect) => effect != InterfaceEffect::ErrorPassive,
        Effect::Frames(FrameEffect::FullQueue) => true,
        // Every request to the drive, or everything that is sent to it.
        Effect::Frames(FrameEffect::Drop) => {
            let Selection { direction, function, node, probability, .. } = &fault.selection;
            *direction != Direction::Received
                && matches!(function, None | Some(FrameFunction::Sdo))
                && node.is_none_or(|node| node == axis.node)
                && *probability == 1.0
        }
        Effect::Drive { node, effect: DriveEffect::Silent } => {
            node == axis.node && !axis.drive.consumes_heartbeat
        }
        Effect::Drive { node, effect } => {
            node == axis.node && effect == DriveEffect::Defect(Defect::SilentSdoServer)
        }
        _ => false,
    };
    // A servo holds its shaft before anybody has commanded it, and follows an encoder that slips.
    let is_led_astray = fault.kind == "encoder-jump" && axis.drive == family::YZ_AIM;
    // Frames with the identifier of a motor are commands to it, and one that replies to them has no time for others.
    let is_flooded_by_commands = !axis.drive.consumes_heartbeat
        && matches!(fault.effect, Effect::Foreign(ForeignFrames::Frame { .. }));
    let has_no_end = fault.window.lasts_ns.is_none() && fault.selection.count.is_none();
    Concern {
        is_present,
        is_misreported: is_present && fault.kind != "disobedience",
        is_misled,
        // A flood leaves no room for anything else.
        is_beyond_reach: has_no_end && (is_misled || is_cut_off || is_flooded_by_commands),
        is_cut_off,
        is_unwatched,
        is_crowded: matches!(fault.effect, Effect::Foreign(_)),
        has_paused: false,
        is_late: false,
        is_neglected: false,
        is_driven_by_others: is_own
            && (matches!(fault.kind, "load" | "foreign-set-points" | "disobedience") || is_led_astray)
            || is_flooded_by_commands,
        is_loaded: is_own && fault.kind == "load",
        missed_heartbeat: MissedHeartbeat::No,
        has_cut_itself: false,
        unreachable_since_ns: None,
    }
}
