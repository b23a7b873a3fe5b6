//! What a configuration may say and hardly means: values that are possible, and that a person has most likely mistaken or
//! would miss.

use std::f64::consts::TAU;
use std::fmt;

use takt_rt::{Rule, StopCategory};
use takt_wire::canopen::object::ObjectAddress;

use crate::config::quantities::{Counting, Quantities};
use crate::config::quantity::Short;
use crate::config::{Axis, Bus, Config, Control, Interface, Plausible, ProgramTarget, Quantity, Travel};
use crate::family::{
    SignOfLife, Unwatched, adapter_warning, bring_up, registry, report_cycles, stops_by_itself_after,
};
#[cfg(target_os = "linux")]
use crate::link::restart_command;

/// A rotary axis that goes round more often than this is unusual.
const USUAL_TURNS: f64 = 2.0;
/// A lost reply costs a serial line about three rounds, and a drive must not miss its master for it.
const LOST_ROUNDS: u64 = 4;
/// Share of the range of positions that a joint may be pushed beyond its limits by: so far from them its drive's count is not to wrap.
const PUSHED: f64 = 0.1;
/// A drive that rounds a velocity by less than this share runs as commanded.
const ROUNDING: f64 = 0.01;

/// A value that is possible, and implausible or of consequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// What it is about.
    pub subject: WarningSubject,
    /// What is implausible or of consequence.
    pub kind: WarningKind,
}

/// What a warning is about, by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WarningSubject {
    /// An axis.
    Axis(String),
    /// A bus.
    Bus(String),
    /// The section `[stops]`.
    Stops,
}

impl fmt::Display for WarningSubject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Axis(name) => write!(f, "axis `{name}`"),
            Self::Bus(name) => write!(f, "bus `{name}`"),
            Self::Stops => f.write_str("`[stops]`"),
        }
    }
}

/// What is implausible or of consequence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum WarningKind {
    /// At its velocity limit the drive turns faster than drives of its family do.
    DriveSpeed {
        /// Turns per second of the position that the drive reports.
        turns_per_s: f64,
        /// The fastest that drives of its family turn.
        fastest: f64,
        /// `gear_ratio`
        gear_ratio: f64,
        /// True if the drive reports turns of its output, behind its own gear.
        counts_output: bool,
    },
    /// A gear ratio as of the gear inside the drive, whose counts are behind that gear already.
    GearInDrive {
        /// `gear_ratio`
        gear_ratio: f64,
    },
    /// The range of positions is more than two turns.
    Range {
        /// Turns of the joint.
        turns: f64,
        /// The limits, where they look like degrees.
        degrees: Option<[f64; 2]>,
    },
    /// The position counter of the drive wraps near a position limit.
    NearWrap {
        /// The limit, with its unit.
        limit: String,
        /// Where it wraps, with its unit.
        wrap: String,
    },
    /// A velocity limit in rad/s that looks like one in deg/s.
    VelocityInDegrees {
        /// The limit.
        velocity: f64,
    },
    /// A drive that is spoken to outside of the cycle reports too seldom for the cycle of its bus.
    SlowReports {
        /// From one report to the next, at the longest.
        report_ns: u64,
        /// For so long feedback may be missing.
        allowed_ns: u64,
    },
    /// The adapter of a serial line holds received bytes back.
    AdapterLatency {
        /// For so long at most.
        latency_ns: u64,
        /// The command that makes it shorter.
        mend: String,
    },
    /// A drive on a serial line would miss its master although that speaks to it in time.
    ShortTimeout {
        /// How long the drive waits.
        timeout_ns: u64,
        /// From one request to it to the next, at the longest, if one round is lost.
        needed_ns: u64,
    },
    /// A value of the configuration file that bring-up overwrites, because the controller needs another one.
    Overwritten {
        /// The object.
        object: ObjectAddress,
    },
    /// The drive goes on with its last command when no more come.
    NoWatchdog {
        /// Why nothing stops it.
        because: Unwatched,
    },
    /// A velocity of a program that the drive cannot have exactly.
    RoundedVelocity {
        /// What is commanded, with its unit.
        commanded: String,
        /// What the drive gets, with its unit.
        rounded: String,
    },
    /// The kernel does not restart the controller of an interface after bus-off, and the configuration wants it.
    NoRestart {
        /// The interface.
        interface: String,
        /// The time that the configuration wants, in ms.
        wanted_ms: u32,
        /// The command that sets it.
        mend: String,
    },
    /// A value that is not renewed in time ends without torque.
    CoastsWhenStale,
    /// The bus is behind an SLCAN adapter.
    Adapter {
        /// The interface.
        interface: String,
    },
    /// The serial line to an adapter does not carry the frames of a cycle.
    SlowLine {
        /// The device.
        device: String,
        /// Baud of the line.
        baud_rate: u32,
        /// How long the frames of a cycle are on it.
        line_ns: u64,
        /// The period of the cycle.
        period_ns: u64,
        /// The baud rate that would be enough.
        needed: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subject, self.kind)
    }
}

impl fmt::Display for WarningKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DriveSpeed { turns_per_s, fastest, gear_ratio, counts_output } => {
                write!(
                    f,
                    "at `limits.velocity` the drive would turn {} times a second; no drive of its family turns \
                     faster than {} times a second: check `limits.velocity`",
                    Short(*turns_per_s),
                    Short(*fastest)
                )?;
                match counts_output {
                    true if *gear_ratio > 1.0 => write!(
                        f,
                        " and `gear_ratio = {}`: the drive counts turns of its output, so that the gear inside it \
                         does not count",
                        Short(*gear_ratio)
                    ),
                    _ => write!(f, ", `gear_ratio` and `counts_per_turn`"),
                }
            }
            Self::GearInDrive { gear_ratio } => write!(
                f,
                "`gear_ratio = {}` is as of the gear inside the drive, but the drive counts turns of its output: leave \
                 `gear_ratio` at 1 unless there is a second transmission behind the drive",
                Short(*gear_ratio)
            ),
            Self::Range { turns, degrees: None } => {
                write!(f, "`limits.position` is a range of {} turns: check its unit", Short(*turns))
            }
            Self::Range { turns, degrees: Some([low, high]) } => write!(
                f,
                "`limits.position` is a range of {} turns, and looks like degrees: a number without a unit is in rad; \
                 write [\"{low} deg\", \"{high} deg\"]",
                Short(*turns)
            ),
            Self::NearWrap { limit, wrap } => write!(
                f,
                "the count of its drive wraps at {wrap}, near the limit of {limit} in `limits.position`: a joint that is pushed beyond it \
                 is not enabled before it is back; set the zero of the drive elsewhere, so that its counts end far \
                 from the limits"
            ),
            Self::VelocityInDegrees { velocity } => write!(
                f,
                "`limits.velocity` looks like degrees: a number without a unit is in rad/s; write \"{velocity} deg/s\""
            ),
            Self::Overwritten { object } => write!(
                f,
                "bring-up overwrites the value that `dcf` has for {object}, because the controller needs another one"
            ),
            Self::NoWatchdog { because } => write!(
                f,
                "{because}: if this program or its computer dies, the motor goes on with its last command, in velocity and torque \
                 mode for ever; {}",
                because.cure()
            ),
            Self::SlowReports { report_ns, allowed_ns } => {
                let show = |ns: u64| Quantity::DURATION.show(ns as f64 / 1e9);
                write!(
                    f,
                    "its drive is spoken to beside the cycle, and reports every {} at the longest; after {} without a report \
                     the group stops, so that one lost frame may be enough: give it a bus with a longer `period` (10 ms), or \
                     more `missed_feedback_cycles`",
                    show(*report_ns),
                    show(*allowed_ns)
                )
            }
            Self::AdapterLatency { latency_ns, mend } => write!(
                f,
                "its adapter holds every reply back for up to {}, so that each drive is spoken to less often: {mend} \
                 (`takt doctor` has the rule that lasts)",
                Quantity::DURATION.show(*latency_ns as f64 / 1e9)
            ),
            Self::ShortTimeout { timeout_ns, needed_ns } => write!(
                f,
                "`communication_timeout` is {}, and on this line two requests to the drive may be {} apart when replies are lost: \
                 give it at least that, a faster line, or fewer drives on it",
                Quantity::DURATION.show(*timeout_ns as f64 / 1e9),
                Quantity::DURATION.show(*needed_ns as f64 / 1e9)
            ),
            Self::RoundedVelocity { commanded, rounded } => write!(
                f,
                "its drive takes whole numbers of r/min only: the program's velocity of {commanded} becomes {rounded}"
            ),
            Self::NoRestart { interface, wanted_ms, mend } => write!(
                f,
                "{interface} has restart-ms 0, and `restart_ms` is {wanted_ms}: after a bus-off it stays off the bus until somebody \
                 restarts it: {mend}"
            ),
            Self::CoastsWhenStale => f.write_str(
                "`stale_command = 0` removes the power at once when a stream or a velocity expires: a moving axis coasts until \
                 friction or its brake stops it; use 2 (decelerate and hold) or 1 (decelerate and disable)",
            ),
            Self::Adapter { interface } => write!(
                f,
                "its adapter is on USB, and USB is not hard real time: SYNC and set-points may be late by milliseconds, and \
                 no frame is confirmed by the bus. `takt jitter --bus {interface}` shows what your machine does; a CAN \
                 interface of Linux has neither weakness"
            ),
            Self::SlowLine { device, baud_rate, line_ns, period_ns, needed } => write!(
                f,
                "the frames of a cycle are {} on a serial line of {baud_rate} baud, and a cycle has {}. A chip for a \
                 serial line needs {needed} baud or more: interface = \"slcan:{device}@{}\"; or choose a longer period",
                Quantity::DURATION.show(*line_ns as f64 / 1e9),
                Quantity::DURATION.show(*period_ns as f64 / 1e9),
                needed.next_multiple_of(1_000_000)
            ),
        }
    }
}

impl Config {
    /// What is possible and implausible: `takt check` and `takt run` say it, and go on.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = vec![];
        for (index, axis) in self.axes.iter().enumerate() {
            let unwatched = stops_by_itself_after(axis, self).err();
            let mut kinds: Vec<_> =
                unwatched.map(|because| WarningKind::NoWatchdog { because }).into_iter().collect();
            kinds.extend(of_axis(axis));
            kinds.extend(self.rounded_velocities(index, axis));
            kinds.extend(self.slow_reports(axis));
            kinds.extend(self.short_timeout(axis));
            let overwritten = bring_up::overwritten(self, axis);
            kinds.extend(overwritten.into_iter().map(|object| WarningKind::Overwritten { object }));
            let subject = WarningSubject::Axis(axis.name.clone());
            warnings.extend(kinds.into_iter().map(|kind| Warning { subject: subject.clone(), kind }));
        }
        for (index, bus) in self.buses.iter().enumerate() {
            let subject = WarningSubject::Bus(bus.name.clone());
            let kinds =
                adapter_warning::of_bus(self, index).into_iter().chain(adapter_warning::of_line(self, index));
            let kinds = kinds.chain(never_restarts(bus));
            warnings.extend(kinds.map(|kind| Warning { subject: subject.clone(), kind }));
        }
        if self.stops.of(Rule::StaleCommand) == StopCategory::Zero {
            warnings.push(Warning { subject: WarningSubject::Stops, kind: WarningKind::CoastsWhenStale });
        }
        warnings
    }

    /// What each axis has to do without, because its drive lacks something: sentences with the name of the axis. `takt check` says
    /// them.
    pub fn losses(&self) -> Vec<String> {
        let of_axis = |axis: &Axis| {
            let family = registry::of(&axis.drive);
            let beside_the_cycle = family.off_cycle_budget(axis, self).map(|budget| {
                format!(
                    "it is spoken to beside the cycle: at most {} requests in a second, {} of its bus; a report every {} at the \
                     longest",
                    budget.requests_per_s.round(),
                    // No budget is known to more digits than these.
                    Quantity::FRACTION.show((budget.bus_share * 100.0).round() / 100.0),
                    Quantity::DURATION.show((budget.report_ns as f64 / 1e5).round() / 1e4)
                )
            });
            let losses = family.remarks(axis).into_iter().map(str::to_owned).chain(beside_the_cycle);
            losses.map(|loss| format!("axis `{}`: {loss}", axis.name)).collect::<Vec<_>>()
        };
        self.axes.iter().flat_map(of_axis).collect()
    }

    /// A lost frame costs a drive that is spoken to beside the cycle about as much time as a report.
    fn slow_reports(&self, axis: &Axis) -> Option<WarningKind> {
        let report_ns = registry::of(&axis.drive).off_cycle_budget(axis, self)?.report_ns;
        let expected_ns = self.bus_cycle(axis.bus).period_ns * u64::from(report_cycles(axis, self));
        let allowed_ns = expected_ns * u64::from(axis.missed_feedback_cycles);
        (allowed_ns < 2 * report_ns).then_some(WarningKind::SlowReports { report_ns, allowed_ns })
    }

    /// A drive on a serial line waits for its master longer than some lost rounds take.
    fn short_timeout(&self, axis: &Axis) -> Option<WarningKind> {
        let budget = registry::of(&axis.drive).off_cycle_budget(axis, self)?;
        let watchdog = stops_by_itself_after(axis, self).ok()?;
        let timeout_ns = watchdog.timeout_ns.filter(|_| watchdog.sign == SignOfLife::Request)?;
        let needed_ns = LOST_ROUNDS * budget.report_ns;
        (timeout_ns < needed_ns).then_some(WarningKind::ShortTimeout { timeout_ns, needed_ns })
    }

    /// The velocities of the program that the drive of an axis cannot have, each once.
    fn rounded_velocities(&self, index: usize, axis: &Axis) -> Vec<WarningKind> {
        let mut kinds = vec![];
        if axis.control != Control::ProfileVelocity {
            return kinds;
        }
        for planned in &self.program.moves {
            let ProgramTarget::Velocity { velocity, .. } = &planned.target else { continue };
            let place = match self.groups.get(planned.group) {
                Some(group) => group.axes.iter().position(|axis| *axis == index),
                None => Some(index),
            };
            let Some(&commanded) = place.and_then(|place| velocity.get(place)) else { continue };
            let per_turn = axis.drive.velocity_units_per_turn(axis.counts_per_turn);
            let units = commanded * Counting::of(axis).turns_per_unit() * per_turn;
            let rounded = commanded * units.round() / units;
            if commanded != 0.0 && is_rounded(commanded, rounded) {
                let quantity = Quantities::of(axis.travel).velocity;
                let (commanded, rounded) = (quantity.show(commanded), quantity.show(rounded));
                let kind = WarningKind::RoundedVelocity { commanded, rounded };
                if !kinds.contains(&kind) {
                    kinds.push(kind);
                }
            }
        }
        kinds
    }
}

/// Returns `true` if a drive that gets `rounded` runs otherwise than commanded.
pub(crate) fn is_rounded(commanded: f64, rounded: f64) -> bool {
    (commanded - rounded).abs() > ROUNDING * commanded.abs()
}

/// The position limit near which the count of the drive wraps.
fn near_wrap(axis: &Axis) -> Option<WarningKind> {
    let (counting, limits) = (Counting::of(axis), &axis.limits);
    let show = |position: f64| Quantities::of(axis.travel).position.show(position);
    let margin = PUSHED * (limits.position_max - limits.position_min);
    let ends = [counting.counter.lowest(), counting.counter.highest()].map(|count| counting.joint(count));
    [(limits.position_min, -margin), (limits.position_max, margin)].into_iter().find_map(|(limit, beyond)| {
        let wrap = ends.into_iter().find(|wrap| (0.0..=1.0).contains(&((wrap - limit) / beyond)))?;
        Some(WarningKind::NearWrap { limit: show(limit), wrap: show(wrap) })
    })
}

fn of_axis(axis: &Axis) -> Vec<WarningKind> {
    let Axis { drive, limits, gear_ratio, travel, .. } = axis;
    let mut kinds = vec![];
    let turns_per_s = limits.velocity * Counting::of(axis).turns_per_unit();
    let Plausible { fastest_turns_per_s: fastest, usual_velocity, inner_gear_from } = drive.plausible;
    if turns_per_s > fastest {
        let (gear_ratio, counts_output) = (*gear_ratio, inner_gear_from.is_some());
        kinds.push(WarningKind::DriveSpeed { turns_per_s, fastest, gear_ratio, counts_output });
    } else if inner_gear_from.is_some_and(|from| *gear_ratio >= from) {
        kinds.push(WarningKind::GearInDrive { gear_ratio: *gear_ratio });
    }
    kinds.extend(near_wrap(axis));
    if *travel != Travel::Rotary {
        return kinds;
    }
    let turns = (limits.position_max - limits.position_min) / TAU;
    if turns > USUAL_TURNS {
        let both = [limits.position_min, limits.position_max];
        let degrees = (turns <= 360.0 && both.iter().all(|limit| limit.fract() == 0.0)).then_some(both);
        kinds.push(WarningKind::Range { turns, degrees });
    }
    if limits.velocity > usual_velocity && limits.velocity.fract() == 0.0 {
        kinds.push(WarningKind::VelocityInDegrees { velocity: limits.velocity });
    }
    kinds
}

/// The warning about an interface of this machine that is up, if its controller is not restarted as the configuration wants it.
#[cfg(target_os = "linux")]
fn never_restarts(bus: &Bus) -> Option<WarningKind> {
    let Interface::SocketCan(interface) = &bus.interface else { return None };
    let mend = restart_command(interface, bus)?;
    Some(WarningKind::NoRestart { interface: interface.clone(), wanted_ms: bus.restart_ms, mend })
}

#[cfg(not(target_os = "linux"))]
fn never_restarts(_: &Bus) -> Option<WarningKind> {
    None
}
