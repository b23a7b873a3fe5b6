//! What a port offers to those who break things behind it.

use takt_rt::{BusPort, Frame, Nanoseconds};

use crate::bus::trace::TracedPort;
use crate::sim::{AfflictError, Defect, DriveFault, SimulatedBus, UnknownNode};

/// What happens to a simulated drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveTrouble {
    /// It is cut off from the bus and lives on.
    Silent,
    /// Its supply is cut and returns at once.
    Reboot,
    /// A torque from outside is on its joint: N·m (N).
    LoadTorque(f64),
    /// It detects a cause of an alarm.
    Cause(DriveFault),
    /// It, or its joint, has a defect.
    Defect(Defect),
}

impl DriveTrouble {
    /// Whether this happens once and is over, and there is nothing to mend.
    pub const fn is_event(self) -> bool {
        match self {
            Self::Reboot | Self::Cause(_) => true,
            Self::Silent | Self::LoadTorque(_) => false,
            Self::Defect(defect) => defect.is_event(),
        }
    }
}

/// Why nothing could be broken.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CannotBreak {
    /// There are no simulated drives behind this port.
    #[error("only simulated drives can be broken")]
    NotSimulated,
    /// There is no such drive.
    #[error(transparent)]
    UnknownNode(#[from] UnknownNode),
    /// It is there and cannot have this.
    #[error(transparent)]
    Afflict(#[from] AfflictError),
}

/// Who hears what is said on the bus in another's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Everybody, this port too.
    ByAll,
    /// Everybody but this port, which sent it itself.
    ByOthers,
}

/// A port behind which things can be broken.
pub trait Breakable: BusPort {
    /// Says something on the bus that is not the controller's. A port without another station sends it itself.
    fn say(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Heard {
        self.send(now_ns, &[*frame]);
        Heard::ByOthers
    }

    /// Something happens to a drive (`is_present`), or is over.
    ///
    /// # Errors
    /// See [`CannotBreak`]; nothing has changed then.
    fn trouble(&mut self, node: u8, trouble: DriveTrouble, is_present: bool) -> Result<(), CannotBreak> {
        let _ = (node, trouble, is_present);
        Err(CannotBreak::NotSimulated)
    }
}

impl Breakable for SimulatedBus {
    fn say(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Heard {
        // A foreign station whose buffers are full loses what it has to say, like a real one.
        let _ = Self::say(self, now_ns, frame);
        Heard::ByAll
    }

    fn trouble(&mut self, node: u8, trouble: DriveTrouble, is_present: bool) -> Result<(), CannotBreak> {
        match trouble {
            DriveTrouble::Silent => self.silence(node, is_present)?,
            DriveTrouble::LoadTorque(torque) => {
                self.set_load_torque(node, if is_present { torque } else { 0.0 })?;
            }
            DriveTrouble::Reboot if is_present => self.power_cycle(node)?,
            DriveTrouble::Cause(fault) if is_present => self.inject(node, fault)?,
            DriveTrouble::Reboot | DriveTrouble::Cause(_) => {}
            DriveTrouble::Defect(defect) => self.afflict(node, defect, is_present)?,
        }
        Ok(())
    }
}

impl<P: Breakable> Breakable for TracedPort<P> {
    fn say(&mut self, now_ns: Nanoseconds, frame: &Frame) -> Heard {
        self.inner_mut().say(now_ns, frame)
    }

    fn trouble(&mut self, node: u8, trouble: DriveTrouble, is_present: bool) -> Result<(), CannotBreak> {
        self.inner_mut().trouble(node, trouble, is_present)
    }
}
