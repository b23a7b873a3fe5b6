//! Whom a fault concerns, from the cycle on in which it begins.

use takt::config::{Axis, Config};
use takt::faults::{Effect, ForeignFrames, FrameEffect, Part, Rehearsal};

/// What can no longer be expected of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Concern {
    /// A fault concerns this joint, its drive or its bus: it may not obey.
    pub is_present: bool,
    /// A torque from outside acts on it, or another master commands its drive between two looks.
    pub is_driven_by_others: bool,
    /// Another master has changed the state of its node. If that has reset its communication, the drive is deaf to process
    /// data and has forgotten its watchdog: only a farewell by SDO disables it, and a run that is broken off has none.
    pub is_deaf: bool,
    /// Something pushes the joint for as long as it lasts, also in the end.
    pub is_loaded: bool,
}

impl Concern {
    fn or(self, other: Self) -> Self {
        Self {
            is_present: self.is_present || other.is_present,
            is_driven_by_others: self.is_driven_by_others || other.is_driven_by_others,
            is_deaf: self.is_deaf || other.is_deaf,
            is_loaded: self.is_loaded || other.is_loaded,
        }
    }
}

/// The concerns of every axis, as far as the faults have begun.
pub struct Concerns {
    /// For each fault, an entry an axis.
    by_fault: Vec<Vec<Concern>>,
    has_begun: Vec<bool>,
    pub by_axis: Vec<Concern>,
}

impl Concerns {
    pub fn new(config: &Config, rehearsal: &Rehearsal) -> Self {
        let of_fault = |fault: &takt::faults::Fault| -> Vec<Concern> {
            config.axes.iter().map(|axis| concern(axis, fault)).collect()
        };
        let by_fault: Vec<Vec<Concern>> = rehearsal.courses().map(|(fault, _)| of_fault(fault)).collect();
        Self {
            has_begun: vec![false; by_fault.len()],
            by_fault,
            by_axis: vec![Concern::default(); config.axes.len()],
        }
    }

    /// Looks which faults have begun since the last look, and calls `begun` with the number of each.
    pub fn observe(&mut self, rehearsal: &Rehearsal, mut begun: impl FnMut(usize)) {
        for (number, (_, course)) in rehearsal.courses().enumerate() {
            if !self.has_begun[number] && course.began_ns().is_some() {
                self.has_begun[number] = true;
                for (present, new) in self.by_axis.iter_mut().zip(&self.by_fault[number]) {
                    *present = present.or(*new);
                }
                begun(number);
            }
        }
    }
}

fn concern(axis: &Axis, fault: &takt::faults::Fault) -> Concern {
    if fault.bus != axis.bus {
        return Concern::default();
    }
    let is_own = fault.place == format!("axis {}", axis.name);
    let is_at_another_axis = fault.place.starts_with("axis ") && !is_own;
    let own = |id: u32| (id & 0x7F) == u32::from(axis.node);
    let is_present = match fault.effect {
        Effect::Drive { node, .. } => node == axis.node,
        Effect::Frames(FrameEffect::Corrupt { part: Part::Payload, .. } | FrameEffect::Drop) => {
            !is_at_another_axis
        }
        Effect::Foreign(ForeignFrames::SetPoints { id, .. }) => own(id.value()),
        _ => true,
    };
    Concern {
        is_present,
        is_driven_by_others: is_own && matches!(fault.kind, "load" | "foreign-set-points"),
        is_deaf: !is_at_another_axis && fault.kind == "foreign-nmt",
        is_loaded: is_own && fault.kind == "load",
    }
}
