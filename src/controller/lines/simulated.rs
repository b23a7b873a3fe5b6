//! A simulated line: master and drives in the thread and the time of whoever polls the life cycle.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use takt_rt::{Nanoseconds, OffCycleReport};

use super::status::LineStatus;
use crate::config::Config;
use crate::family::{self, OffCycleLine, OffCycleTarget};
use crate::faults::LineFaults;
use takt_sim::SimulatedLineDevices;

/// The master looks at its line so often, as the thread of a real line does.
const STEP_NS: Nanoseconds = 1_000_000;
/// Beyond this gap the master was not there, and the line was silent.
const LONGEST_GAP_NS: Nanoseconds = 100_000_000;

/// The devices of a simulated line, which its master speaks to, and into which faults are injected.
#[derive(Clone)]
pub struct SharedLine(Arc<Mutex<SimulatedLineDevices>>);

impl SharedLine {
    /// The devices, for as long as the guard lives.
    pub fn lock(&self) -> MutexGuard<'_, SimulatedLineDevices> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The master of a simulated line, with its drives.
pub(super) struct SimulatedEnd {
    line: Box<dyn OffCycleLine>,
    devices: SharedLine,
    faults: LineFaults,
    polled_ns: Option<Nanoseconds>,
}

impl SimulatedEnd {
    /// `None` if the family of its drives simulates none.
    pub fn new(line: Box<dyn OffCycleLine>, config: &Config, bus: usize, faults: LineFaults) -> Option<Self> {
        let devices = family::of_line(config, bus)?.simulated_axes_on_line(config, bus)?;
        let devices = SharedLine(Arc::new(Mutex::new(SimulatedLineDevices::new(devices))));
        Some(Self { line, devices, faults, polled_ns: None })
    }

    pub fn devices(&self) -> SharedLine {
        self.devices.clone()
    }

    pub fn is_settled(&self, place: usize) -> bool {
        self.line.is_settled(place)
    }

    /// Goes on to a time. Until then the last targets counted, as for a thread that has no newer ones.
    pub fn poll(
        &mut self,
        now_ns: Nanoseconds,
        last: &[OffCycleTarget],
        targets: &[OffCycleTarget],
        status: &LineStatus,
        report: &mut dyn FnMut(usize, OffCycleReport),
    ) {
        let earliest_ns = now_ns.saturating_sub(LONGEST_GAP_NS);
        let mut at_ns = self.polled_ns.unwrap_or(now_ns).max(earliest_ns).saturating_add(STEP_NS);
        while at_ns < now_ns {
            self.step(at_ns, last, report);
            at_ns += STEP_NS;
        }
        self.step(now_ns, targets, report);
        self.polled_ns = Some(now_ns);
        status.show(self.line.counts());
        status.set_taken_away(self.faults.is_gone());
    }

    fn step(
        &mut self,
        at_ns: Nanoseconds,
        targets: &[OffCycleTarget],
        report: &mut dyn FnMut(usize, OffCycleReport),
    ) {
        let mut devices = self.devices.lock();
        self.faults.advance(at_ns);
        self.line.receive(&self.faults.receive(at_ns, devices.receive(at_ns)));
        let request = self.line.poll(at_ns, targets, report);
        for bytes in self.faults.send(at_ns, request) {
            devices.send(at_ns, &bytes);
        }
    }
}
