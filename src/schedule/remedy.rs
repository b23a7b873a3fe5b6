//! Changes that would make a bus fit. Each is tried by analysing the changed configuration.
//!
//! Feedback in every second SYNC (`transmission_type = 2`) is not among these changes. A drive counts the SYNCs from when
//! its PDO became valid. Only the counter in SYNC (object 1019) with a start value in each drive (1800:6) would keep
//! half of the drives to the odd slots and half to the even ones, and few drives have both. So all of them may answer
//! the same SYNC, and the worst slot stays as it is; only the load becomes less.

use super::analysis::analyse_bus;
use super::bus_schedule::{BusSchedule, Remedy};
use super::command_phase;
use crate::config::{Axis, CommandFrames, Config, Feedback, PhaseChoice};

/// Multiples of the period that are tried.
const LONGER_PERIODS: [u64; 4] = [2, 4, 5, 10];

/// What would make a bus fit at the command phase that the configuration says.
pub(super) fn remedies(config: &Config, bus: usize) -> Vec<Remedy> {
    let mut found: Vec<Remedy> = other_command_phase(config, bus).into_iter().collect();
    found.extend(Trial { config, bus, is_at_any_phase: false }.remedies());
    found
}

/// What would give a bus a command phase.
pub(super) fn remedies_at_any_phase(config: &Config, bus: usize) -> Vec<Remedy> {
    Trial { config, bus, is_at_any_phase: true }.remedies()
}

fn other_command_phase(config: &Config, bus: usize) -> Option<Remedy> {
    let (earliest_ns, latest_ns) = analyse_bus(config, bus).slot.command_phases_ns?;
    analyse_at_own_phase(config, bus)?.fits().then_some(Remedy::CommandPhase { earliest_ns, latest_ns })
}

/// The analysis at the command phase that suits this bus, if there is one.
fn analyse_at_own_phase(config: &Config, bus: usize) -> Option<BusSchedule> {
    let (earliest_ns, latest_ns) = analyse_bus(config, bus).slot.command_phases_ns?;
    let mut config = config.clone();
    let period_ns = config.bus_cycle(bus).period_ns;
    config.cycle.command_phase_ns = command_phase::divide(period_ns, earliest_ns, latest_ns)?;
    Some(analyse_bus(&config, bus))
}

/// Returns `true` if a bus carries its traffic only if its axes share command frames.
pub(super) fn needs_shared_frames(config: &Config, bus: usize, phase: PhaseChoice) -> bool {
    let trial = Trial { config, bus, is_at_any_phase: phase == PhaseChoice::Any };
    !trial.fits_with(|_| ()) && trial.shared_command_frames().is_some()
}

/// A configuration and the bus in it that does not fit.
#[derive(Clone, Copy)]
struct Trial<'a> {
    config: &'a Config,
    bus: usize,
    is_at_any_phase: bool,
}

impl Trial<'_> {
    fn remedies(self) -> Vec<Remedy> {
        let ways = [
            self.service_frames(),
            self.sdo_while_disabled(),
            self.time_off(),
            self.drive_heartbeats_off(),
            self.shared_command_frames(),
            self.no_answers_to_sync(),
            self.smaller_feedback(),
            self.master_heartbeat_off(),
            self.more_buses(),
            self.longer_period(),
        ];
        ways.into_iter().flatten().collect()
    }

    fn fits_with(self, change: impl FnOnce(&mut Config)) -> bool {
        let mut config = self.config.clone();
        change(&mut config);
        if self.is_at_any_phase {
            analyse_at_own_phase(&config, self.bus).is_some_and(|schedule| schedule.fits())
        } else {
            analyse_bus(&config, self.bus).fits()
        }
    }

    fn axes(&self) -> impl Iterator<Item = &Axis> {
        self.config.axes.iter().filter(|axis| axis.bus == self.bus)
    }

    fn service_frames(self) -> Option<Remedy> {
        let now = self.config.buses.get(self.bus)?.service_frames_per_cycle;
        let fits = |frames: usize| {
            self.fits_with(|config| {
                config.buses.iter_mut().for_each(|bus| bus.service_frames_per_cycle = frames);
            })
        };
        (1..now).rev().find(|frames| fits(*frames)).map(|frames| Remedy::ServiceFrames { frames })
    }

    fn sdo_while_disabled(self) -> Option<Remedy> {
        let is_enabled = self.config.buses.get(self.bus)?.sdo_while_enabled;
        let fits =
            || self.fits_with(|config| config.buses.iter_mut().for_each(|bus| bus.sdo_while_enabled = false));
        (is_enabled && fits()).then_some(Remedy::SdoWhileDisabled)
    }

    fn time_off(self) -> Option<Remedy> {
        self.config.master.time_ns?;
        self.fits_with(|config| config.master.time_ns = None).then_some(Remedy::TimeOff)
    }

    fn drive_heartbeats_off(self) -> Option<Remedy> {
        let has_any = self.axes().any(|axis| axis.heartbeat_ns.is_some());
        let fits =
            || self.fits_with(|config| config.axes.iter_mut().for_each(|axis| axis.heartbeat_ns = None));
        (has_any && fits()).then_some(Remedy::DriveHeartbeatsOff)
    }

    fn shared_command_frames(self) -> Option<Remedy> {
        let is_own = self.config.buses.get(self.bus)?.command_frames == CommandFrames::OnePerAxis;
        let share = |config: &mut Config| {
            if let Some(bus) = config.buses.get_mut(self.bus) {
                bus.command_frames = CommandFrames::Shared;
            }
        };
        (is_own && self.fits_with(share)).then_some(Remedy::SharedCommandFrames)
    }

    fn no_answers_to_sync(self) -> Option<Remedy> {
        let has_any = self.axes().any(|axis| axis.drive.may_ignore_sync && axis.answers_sync);
        let fits =
            || self.fits_with(|config| config.axes.iter_mut().for_each(|axis| axis.answers_sync = false));
        (has_any && fits()).then_some(Remedy::NoAnswersToSync)
    }

    /// Every choice of what the axes report, the smallest first; there are five objects at the most.
    fn smaller_feedback(self) -> Option<Remedy> {
        let mut objects: Vec<Feedback> = vec![];
        for object in self.axes().flat_map(|axis| &axis.feedback) {
            if !objects.contains(object) {
                objects.push(*object);
            }
        }
        let mut choices: Vec<Vec<Feedback>> = (1..1usize << objects.len().min(8))
            .map(|choice| {
                let is_chosen = |at: usize| choice >> at & 1 == 1;
                (0..).zip(&objects).filter(|(at, _)| is_chosen(*at)).map(|(_, object)| *object).collect()
            })
            .collect();
        choices.sort_by_key(|choice| (choice.len(), choice.iter().map(|o| o.bytes()).sum::<usize>()));
        choices
            .into_iter()
            .find(|without| {
                self.fits_with(|config| {
                    for axis in &mut config.axes {
                        axis.feedback.retain(|object| !without.contains(object));
                    }
                })
            })
            .map(|without| Remedy::SmallerFeedback { without })
    }

    fn master_heartbeat_off(self) -> Option<Remedy> {
        self.config.master.heartbeat_ns?;
        self.fits_with(|config| config.master.heartbeat_ns = None).then_some(Remedy::MasterHeartbeatOff)
    }

    /// The axes in their order, as many to a bus as fit.
    fn more_buses(self) -> Option<Remedy> {
        let count = self.axes().count();
        let (mut first, mut buses, mut axes_per_bus) = (0, 0, 0);
        while first < count {
            let most = (1..=count - first).rev().find(|axes| self.fits_of_axes(first, *axes))?;
            axes_per_bus = axes_per_bus.max(most);
            first += most;
            buses += 1;
        }
        (buses > 1).then_some(Remedy::MoreBuses { axes_per_bus, buses })
    }

    /// Returns `true` if so many of the axes of the bus, from this one on, fit it.
    fn fits_of_axes(self, first: usize, axes: usize) -> bool {
        self.fits_with(|config| {
            let mut seen = 0..;
            config.axes.retain(|axis| {
                axis.bus != self.bus || seen.next().is_some_and(|at| (first..first + axes).contains(&at))
            });
        })
    }

    fn longer_period(self) -> Option<Remedy> {
        let period_ns = self.config.cycle.period_ns;
        let fits = |factor: u64| {
            self.fits_with(|config| {
                config.cycle.period_ns *= factor;
                config.cycle.command_phase_ns *= factor;
            })
        };
        let factor = LONGER_PERIODS.into_iter().find(|factor| fits(*factor))?;
        Some(Remedy::LongerPeriod { period_ns: period_ns * factor })
    }
}
