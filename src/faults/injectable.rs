//! ScenarioFault injection into a port and the simulated drives behind it.

use takt_rt::{BusPort, Frame, Nanoseconds};

use crate::link::trace::TracedPort;
use takt_sim::{Defect, DriveFault, InjectDefectError, SimulatedBus, SimulatedLineDevices, UnknownNode};

/// An effect on a simulated drive.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum DriveEffect {
    /// The drive is disconnected from the bus but keeps running.
    Silent,
    /// Its supply is cut and returns at once.
    Reboot,
    /// An external load torque on its joint: N·m (N).
    LoadTorque(f64),
    /// The drive detects a cause of a fault.
    Cause(DriveFault),
    /// The drive or its joint has a defect.
    Defect(Defect),
}

impl DriveEffect {
    /// Returns `true` if this is a momentary event, so that nothing has to be undone later.
    pub(crate) const fn is_event(self) -> bool {
        match self {
            Self::Reboot | Self::Cause(_) => true,
            Self::Silent | Self::LoadTorque(_) => false,
            Self::Defect(defect) => defect.is_event(),
        }
    }
}

/// Why a fault could not be injected.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InjectError {
    /// The port has no simulated drives.
    #[error("faults can only be injected into simulated drives")]
    NotSimulated,
    /// The bus has no such drive.
    #[error(transparent)]
    UnknownNode(#[from] UnknownNode),
    /// The drive cannot have this defect.
    #[error(transparent)]
    InjectDefect(#[from] InjectDefectError),
}

/// Who receives a foreign frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Every node, and this port too.
    ToAll,
    /// Every node except this port, which sent the frame itself.
    ToOthers,
}

/// A port into which faults can be injected.
pub trait Injectable: BusPort {
    /// Sends a frame in the name of another station. A port without another station sends it itself.
    fn send_foreign(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Delivery {
        self.send(now_ns, &[*frame]);
        Delivery::ToOthers
    }

    /// Applies an effect to a drive (`is_present`), or ends it.
    ///
    /// # Errors
    /// See [`InjectError`]; nothing has changed then.
    fn inject(&mut self, node: u8, effect: DriveEffect, is_present: bool) -> Result<(), InjectError> {
        let _ = (node, effect, is_present);
        Err(InjectError::NotSimulated)
    }
}

impl Injectable for SimulatedBus {
    fn send_foreign(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Delivery {
        // A foreign station with full buffers loses its frame, like a real one.
        let _ = Self::send_foreign(self, now_ns, frame);
        Delivery::ToAll
    }

    fn inject(&mut self, node: u8, effect: DriveEffect, is_present: bool) -> Result<(), InjectError> {
        match effect {
            DriveEffect::Silent => self.silence(node, is_present)?,
            DriveEffect::LoadTorque(torque) => {
                self.set_load_torque(node, if is_present { torque } else { 0.0 })?;
            }
            DriveEffect::Reboot if is_present => self.power_cycle(node)?,
            DriveEffect::Cause(fault) if is_present => self.inject_fault(node, fault)?,
            DriveEffect::Reboot | DriveEffect::Cause(_) => {}
            DriveEffect::Defect(defect) => self.inject_defect(node, defect, is_present)?,
        }
        Ok(())
    }
}

/// As [`Injectable::inject`], on a serial line.
pub(crate) fn inject_on_line(
    line: &mut SimulatedLineDevices,
    node: u8,
    effect: DriveEffect,
    is_present: bool,
) -> Result<(), InjectError> {
    match effect {
        DriveEffect::Silent => line.silence(node, is_present)?,
        DriveEffect::LoadTorque(torque) => {
            line.set_load_torque(node, if is_present { torque } else { 0.0 })?;
        }
        DriveEffect::Reboot if is_present => line.power_cycle(node)?,
        DriveEffect::Cause(fault) if is_present => line.inject_fault(node, fault)?,
        DriveEffect::Reboot | DriveEffect::Cause(_) => {}
        DriveEffect::Defect(defect) => line.inject_defect(node, defect, is_present)?,
    }
    Ok(())
}

impl<P: Injectable> Injectable for TracedPort<P> {
    fn send_foreign(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Delivery {
        self.inner_mut().send_foreign(now_ns, frame)
    }

    fn inject(&mut self, node: u8, effect: DriveEffect, is_present: bool) -> Result<(), InjectError> {
        self.inner_mut().inject(node, effect, is_present)
    }
}
