//! The serial lines of a controller, whose drives are spoken to outside of the cycle.
//!
//! - `thread`: a line of this machine, with its own ordinary thread. It is never the real-time thread.
//! - `simulated`: a simulated line. It has no thread: it goes on when the life cycle is polled, in real and in virtual time.
//! - `port`: what the cycle sees of a line, which carries no frame of its own: its state and its counters.

#[cfg(target_os = "linux")]
mod opening;
mod port;
mod simulated;
mod status;
#[cfg_attr(not(target_os = "linux"), path = "no_thread.rs")]
mod thread;

use std::sync::Arc;

use takt_rt::{OffCycleReport, Snapshot};

use crate::channels::HostSide;
use crate::config::Config;
use crate::family::{self, OffCycleLine, OffCycleTarget};
use crate::faults::{FaultInjector, LineFaults};
pub use port::LinePort;
pub use simulated::SharedLine;
use simulated::SimulatedEnd;
use status::LineStatus;
use thread::ThreadEnd;

/// Every serial line of a configuration.
#[derive(Default)]
pub struct Lines {
    lines: Vec<Line>,
}

struct Line {
    bus: usize,
    /// Its axes with their groups, in the order of the configuration.
    axes: Vec<(usize, usize)>,
    targets: Vec<OffCycleTarget>,
    status: Arc<LineStatus>,
    end: LineEnd,
}

/// Where the master of a line lives.
enum LineEnd {
    Simulated(SimulatedEnd),
    Thread(ThreadEnd),
}

impl Lines {
    /// Every line with simulated drives, whatever it is connected to, and with injected faults.
    pub fn simulated(config: &Config, injector: Option<&FaultInjector>) -> Self {
        let lines = (0..config.buses.len()).filter_map(|bus| {
            let faults = faults_of(injector, bus);
            let end = |line, _: &Arc<LineStatus>| {
                Some(LineEnd::Simulated(SimulatedEnd::new(line, config, bus, faults)?))
            };
            Line::new(config, bus, end)
        });
        Self { lines: lines.collect() }
    }

    /// The port of a line for the cycle; `None` if the bus is none.
    pub fn port(&self, bus: usize) -> Option<LinePort> {
        let line = self.lines.iter().find(|line| line.bus == bus)?;
        Some(LinePort::new(Arc::clone(&line.status), self.devices(bus)))
    }

    /// The simulated devices of a line; `None` if it is not simulated.
    pub fn devices(&self, bus: usize) -> Option<SharedLine> {
        match &self.lines.iter().find(|line| line.bus == bus)?.end {
            LineEnd::Simulated(end) => Some(end.devices()),
            LineEnd::Thread(_) => None,
        }
    }

    /// Goes on with every line.
    pub(super) fn poll(&mut self, now_ns: u64, snapshot: &Snapshot, host: &mut HostSide) {
        for Line { axes, targets, status, end, .. } in &mut self.lines {
            let wanted: Vec<_> = axes.iter().map(|(axis, group)| target(*axis, *group, snapshot)).collect();
            let mut report = |place: usize, report: OffCycleReport| {
                let axis = axes.get(place).and_then(|(axis, _)| u8::try_from(*axis).ok());
                if let Some(axis) = axis {
                    host.report_off_cycle(axis, report);
                }
            };
            match end {
                LineEnd::Simulated(end) => end.poll(now_ns, targets, &wanted, status, &mut report),
                LineEnd::Thread(end) => end.poll(&wanted, &mut report),
            }
            *targets = wanted;
        }
    }

    /// The axes whose drives may have torque, or watch for a controller that is gone, as far as is known.
    pub(super) fn unsettled(&self) -> Vec<usize> {
        let of_line = |line: &Line| {
            let is_unsettled = |place: usize| match &line.end {
                LineEnd::Simulated(end) => !end.is_settled(place),
                LineEnd::Thread(end) => !end.is_settled(place),
            };
            let axes = line.axes.iter().enumerate();
            axes.filter(|(place, _)| is_unsettled(*place)).map(|(_, (axis, _))| *axis).collect::<Vec<_>>()
        };
        self.lines.iter().flat_map(of_line).collect()
    }
}

impl Line {
    /// The line with this index; `None` if the bus is none, or has no end.
    fn new(
        config: &Config,
        bus: usize,
        end: impl FnOnce(Box<dyn OffCycleLine>, &Arc<LineStatus>) -> Option<LineEnd>,
    ) -> Option<Self> {
        let line = family::of_line(config, bus)?.off_cycle_line(config, bus)?;
        let axes = config.axes.iter().enumerate().filter(|(_, axis)| axis.bus == bus);
        let axes: Vec<_> = axes.map(|(axis, _)| (axis, config.group_of_axis(axis))).collect();
        let status = Arc::<LineStatus>::default();
        let end = end(line, &status)?;
        Some(Self { bus, targets: vec![OffCycleTarget::default(); axes.len()], axes, status, end })
    }
}

/// The faults that are injected into a line.
fn faults_of(injector: Option<&FaultInjector>, bus: usize) -> LineFaults {
    injector.map(|injector| injector.of_line(bus)).unwrap_or_default()
}

/// What the newest cycle wants of an axis.
fn target(axis: usize, group: usize, snapshot: &Snapshot) -> OffCycleTarget {
    let Some(shown) = snapshot.axes.get(axis) else { return OffCycleTarget::default() };
    let phase = snapshot.groups().get(group).map(|group| group.phase).unwrap_or_default();
    OffCycleTarget::of(shown, phase, snapshot.at_ns)
}
