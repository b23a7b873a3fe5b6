//! A drive that answers too slowly for the cycle: it is spoken to beside it, as often as it can answer.

use takt_rt::{AxisSnapshot, Command, Frame, OffCycleReport, Phase};

/// What is wanted of a drive that is spoken to outside of the cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct OffCycleTarget {
    /// What its controlword says.
    pub wish: OffCycleWish,
    /// The set-point of the position: rad (m).
    pub position: f64,
    /// The set-point of the velocity: rad/s (m/s).
    pub velocity: f64,
    /// The torque that is fed forward, or commanded: N·m (N).
    pub torque: f64,
    /// The time of the cycle that wants it.
    pub at_ns: u64,
}

/// What is wanted of the power of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OffCycleWish {
    /// Its position is to be known; it is told nothing.
    #[default]
    Observe,
    /// It has no torque.
    Stop,
    /// Its group is being enabled: it is to get torque, and to follow the set-points.
    Enable,
    /// It follows the set-points. One that has no torque stays without.
    Follow,
    /// Its faults are cleared.
    ClearFaults,
}

impl OffCycleWish {
    /// Returns `true` if it may have torque.
    pub(crate) const fn grants_torque(self) -> bool {
        matches!(self, Self::Enable | Self::Follow)
    }
}

impl OffCycleTarget {
    /// What a cycle wants of an axis.
    pub fn of(axis: &AxisSnapshot, phase: Phase, at_ns: u64) -> Self {
        let wish = match Command::decode(axis.controlword) {
            _ if phase == Phase::Passive => OffCycleWish::Observe,
            _ if axis.controlword & takt_rt::controlword::FAULT_RESET != 0 => OffCycleWish::ClearFaults,
            Command::SwitchOn | Command::EnableOperation if phase == Phase::Enabling => OffCycleWish::Enable,
            Command::SwitchOn | Command::EnableOperation => OffCycleWish::Follow,
            Command::Shutdown | Command::DisableVoltage | Command::QuickStop => OffCycleWish::Stop,
        };
        let AxisSnapshot { position_set, velocity_set, torque_set, .. } = *axis;
        Self { wish, position: position_set, velocity: velocity_set, torque: torque_set, at_ns }
    }
}

/// What a drive that is spoken to outside of the cycle asks of its bus or line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OffCycleBudget {
    /// The most requests in a second.
    pub requests_per_s: f64,
    /// From one report of the drive to the next, at the longest.
    pub report_ns: u64,
    /// The share of the bus, 1 for all of it, with the most stuff bits that frames can have.
    pub bus_share: f64,
}

/// Speaks to one drive outside of the cycle, without waiting: it is called about once in a millisecond.
///
/// The drive follows set-points that may come late or not at all: the controller may be held up, or be gone. Whoever implements this
/// stops the drive when `at_ns` of the target stays behind the time for too long.
pub trait OffCycleDrive: Send {
    /// Takes a frame that has arrived on the bus of the axis and is no process data.
    fn receive(&mut self, now_ns: u64, frame: &Frame);

    /// Goes on. `send` sends a frame on the bus of the axis, as soon as that has room beside the process data. Returns what the drive
    /// has said since the last call.
    fn poll(
        &mut self,
        now_ns: u64,
        target: &OffCycleTarget,
        send: &mut dyn FnMut(Frame),
    ) -> Option<OffCycleReport>;
}

/// Speaks to the drives of one serial line outside of the cycle, without waiting: it is called about once in a millisecond, and as soon as
/// bytes have come. The drives are numbered by the order of their axes in the configuration.
///
/// As with [`OffCycleDrive`], whoever implements this stops a drive whose target is stale.
pub trait OffCycleLine: Send {
    /// Takes bytes that have come over the line.
    fn receive(&mut self, bytes: &[u8]);

    /// Goes on, with what is wanted of each drive, and tells what drives have said. Returns the bytes that are to be sent now.
    fn poll(
        &mut self,
        now_ns: u64,
        targets: &[OffCycleTarget],
        report: &mut dyn FnMut(usize, OffCycleReport),
    ) -> Option<Vec<u8>>;

    /// Returns `true` if a drive has no torque, and does not watch for its master, as far as this side knows.
    fn is_settled(&self, place: usize) -> bool;

    /// What has been sent and received since the beginning.
    fn counts(&self) -> LineCounts;
}

/// The traffic of a serial line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounts {
    /// Requests that were sent.
    pub requests: u64,
    /// Requests that were carried out.
    pub replies: u64,
    /// Requests without a sound reply, or that were refused.
    pub failures: u64,
    /// How long bytes were on the line, in both directions.
    pub busy_ns: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_controlword_of_an_active_group_says_what_is_wanted_of_a_drive() {
        let wish = |phase, controlword| {
            let axis = AxisSnapshot { controlword, position_set: 1.5, ..AxisSnapshot::default() };
            let target = OffCycleTarget::of(&axis, phase, 7);
            assert_eq!((target.position, target.at_ns), (1.5, 7));
            target.wish
        };
        let (stop, clear) = (OffCycleWish::Stop, OffCycleWish::ClearFaults);
        for (phase, on) in [(Phase::Enabling, OffCycleWish::Enable), (Phase::Holding, OffCycleWish::Follow)] {
            let wishes = [0x00, 0x02, 0x06, 0x07, 0x0F, 0x80].map(|word| wish(phase, word));
            assert_eq!(wishes, [stop, stop, stop, on, on, clear], "{phase:?}");
        }
        assert_eq!(wish(Phase::Passive, 0x0F), OffCycleWish::Observe);
    }
}
