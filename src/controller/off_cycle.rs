//! The drives of a controller that are spoken to outside of the cycle.

use takt_rt::{Frame, Snapshot};

use super::lines::Lines;
use crate::channels::HostSide;
use crate::config::Config;
use crate::family::{self, OffCycleDrive, OffCycleTarget};

/// Those drives, each with its axis.
pub(super) struct OffCycleDrives {
    drives: Vec<OfAxis>,
    lines: Lines,
}

struct OfAxis {
    axis: usize,
    group: usize,
    bus: usize,
    drive: Box<dyn OffCycleDrive>,
}

impl OfAxis {
    /// That of an axis; `None` if its drive is not spoken to outside of the cycle.
    fn of(config: &Config, axis: usize) -> Option<Self> {
        let own = config.axes.get(axis)?;
        let drive = family::of(&own.drive).off_cycle(own, config)?;
        Some(Self { axis, group: config.group_of_axis(axis), bus: own.bus, drive })
    }
}

impl OffCycleDrives {
    pub(super) fn new(config: &Config) -> Self {
        let drives = (0..config.axes.len()).filter_map(|axis| OfAxis::of(config, axis));
        Self { drives: drives.collect(), lines: Lines::simulated(config, None) }
    }

    /// Forgets what the drives of these axes have said: they are brought up again.
    pub(super) fn begin_again(&mut self, config: &Config, axes: &[usize]) {
        for own in self.drives.iter_mut().filter(|own| axes.contains(&own.axis)) {
            if let Some(new) = OfAxis::of(config, own.axis) {
                *own = new;
            }
        }
    }

    /// With these lines.
    pub(super) fn set_lines(&mut self, lines: Lines) {
        self.lines = lines;
    }

    /// The serial lines.
    pub(super) const fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Takes a frame that is no process data.
    pub(super) fn receive(&mut self, now_ns: u64, bus: usize, frame: &Frame) {
        for own in self.drives.iter_mut().filter(|own| own.bus == bus) {
            own.drive.receive(now_ns, frame);
        }
    }

    /// Goes on with every drive that is not being brought up.
    pub(super) fn poll(
        &mut self,
        now_ns: u64,
        snapshot: &Snapshot,
        host: &mut HostSide,
        is_brought_up: impl Fn(usize) -> bool,
    ) {
        for OfAxis { axis, group, bus, drive } in &mut self.drives {
            if is_brought_up(*axis) {
                continue;
            }
            let Some(shown) = snapshot.axes.get(*axis) else { continue };
            let phase = snapshot.groups().get(*group).map(|group| group.phase).unwrap_or_default();
            let target = OffCycleTarget::of(shown, phase, snapshot.at_ns);
            // A frame that finds no room is lost, as on a disturbed bus.
            let report = drive.poll(now_ns, &target, &mut |frame| {
                let _ = host.send_service(*bus, frame);
            });
            if let (Some(report), Ok(axis)) = (report, u8::try_from(*axis)) {
                host.report_off_cycle(axis, report);
            }
        }
        self.lines.poll(now_ns, snapshot, host);
    }
}
