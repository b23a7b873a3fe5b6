//! What stands on a bus for a device that hears nothing of it: one on a serial line.

use takt_rt::{DriveState, Frame, Nanoseconds};

use super::defect::{Defect, Unsupported};
use super::drive::{Drive, DriveFault, NodeState, Observation};
use super::mailbox::Mailbox;
use super::plant::Gravity;

/// A device that neither hears nor says anything.
#[derive(Clone, Copy, Debug)]
pub struct SilentDrive {
    node: u8,
}

impl SilentDrive {
    /// With this node ID.
    pub const fn new(node: u8) -> Self {
        Self { node }
    }
}

impl Drive for SilentDrive {
    fn node(&self) -> u8 {
        self.node
    }

    fn receive(&mut self, _: Nanoseconds, _: &Frame, _: &mut Mailbox) {}

    fn advance(&mut self, _: Nanoseconds, _: &mut Mailbox) {}

    fn wake_ns(&self) -> Nanoseconds {
        Nanoseconds::MAX
    }

    fn observe(&mut self, _: Nanoseconds) -> Observation {
        Observation {
            position: 0.0,
            velocity: 0.0,
            torque: 0.0,
            position_counts: 0,
            state: DriveState::SwitchOnDisabled,
            statusword: 0,
            error_code: 0,
            operation_mode: 0,
            nmt: NodeState::Operational,
            is_braked: false,
        }
    }

    fn inject_fault(&mut self, _: DriveFault) {}

    fn power_cycle(&mut self, _: Nanoseconds, _: &mut Mailbox) {}

    fn set_gravity(&mut self, _: Gravity) {}

    fn set_load_torque(&mut self, _: f64) {}

    fn inject_defect(&mut self, _: Nanoseconds, defect: Defect, _: bool) -> Result<(), Unsupported> {
        Err(Unsupported { defect, reason: "the device is on a serial line, and not on the bus" })
    }
}
