//! The result of `takt check`.

use serde::Serialize;
use takt::config::{
    Axis, Compliance, Config, Control, FeedForward, Group, PositionUnit, Travel, UrdfLimits, mode_word,
};
use takt::family::refused_by_data_sheets;
use takt::schedule::{self, BusSchedule};
use takt_rt::ModeCondition;

use super::lines::LineCheck;
use super::supervision::SupervisionCheck;
use super::unattended::Unattended;

/// The result.
#[derive(Serialize)]
pub struct Check {
    pub name: String,
    pub fits: bool,
    pub cycle_ns: u64,
    pub command_phase_ns: u64,
    /// The value of `command_phase = "auto"`; `None` where no command phase suits every bus.
    pub automatic_command_phase_ns: Option<u64>,
    /// Until when set-points are held, so that they leave at the same moment of every slot; `None` where they leave as soon as they are made.
    pub send_phase_ns: Option<u64>,
    /// The groups; none where all axes are one.
    pub groups: Vec<GroupCheck>,
    pub axes: Vec<AxisCheck>,
    pub buses: Vec<BusSchedule>,
    /// Those of the buses that are serial lines.
    pub lines: Vec<LineCheck>,
    /// How bring-up fails with drives that are as their data sheets say.
    pub refused: Vec<String>,
    /// What is possible and implausible.
    pub warnings: Vec<String>,
    /// What axes have to do without, because their drives lack it.
    pub losses: Vec<String>,
}

/// A group of axes, by names.
#[derive(Clone, PartialEq, Serialize)]
pub struct GroupCheck {
    pub name: String,
    pub axes: Vec<String>,
    /// The groups whose stops stop this one, too.
    pub stops_with: Vec<String>,
}

impl GroupCheck {
    fn of(config: &Config, group: &Group) -> Self {
        let axes = group.axes.iter().filter_map(|axis| config.axes.get(*axis));
        let others = group.stops_with.iter().filter_map(|other| config.groups.get(*other));
        Self {
            name: group.name.clone(),
            axes: axes.map(|axis| axis.name.clone()).collect(),
            stops_with: others.map(|other| other.name.clone()).collect(),
        }
    }
}

/// Limits and units of an axis, in rad (m), seconds and N·m (N).
#[derive(Clone, PartialEq, Serialize)]
pub struct AxisCheck {
    pub name: String,
    pub bus: String,
    pub node: u8,
    /// Its number among the axes of its node.
    pub node_axis: u8,
    pub mode: &'static str,
    /// The modes that it may be changed to at run time.
    pub other_modes: Vec<&'static str>,
    /// When its drive takes another mode; `None` where it stays in its own.
    pub mode_change: Option<&'static str>,
    pub is_linear: bool,
    /// The unit of the text; JSON has SI units.
    #[serde(skip)]
    pub shown_in: PositionUnit,
    pub position_min: f64,
    pub position_max: f64,
    pub velocity: f64,
    pub acceleration: f64,
    pub deceleration: f64,
    /// `None` when it is not limited.
    pub jerk: Option<f64>,
    pub torque: f64,
    /// Which of its limits a robot description has; `None` without one.
    pub urdf: Option<UrdfLimits>,
    pub following_error: f64,
    pub following_error_time_ns: u64,
    /// What is sent beside the target.
    pub feed_forward: &'static str,
    /// What a stream may ask of the torque loop; `None` where it is not closed here.
    pub compliance: Option<ComplianceCheck>,
    /// How far off its target a program may leave it.
    pub target_tolerance: f64,
    /// How drive and controller see that the other one is there.
    pub supervision: SupervisionCheck,
    /// What it does when the controller is gone.
    pub without_controller: Unattended,
    pub counts_per_unit: f64,
    /// What one count is.
    pub resolution: f64,
    /// How far the axis goes in one cycle at its highest speed.
    pub counts_per_cycle: f64,
    /// The lowest and the highest count within the limits.
    pub counts_range: [f64; 2],
}

/// What a stream may ask of a torque loop that is closed here, in N·m (N), rad (m) and seconds.
#[derive(Clone, PartialEq, Serialize)]
pub struct ComplianceCheck {
    pub stiffness_max: f64,
    pub damping_max: f64,
    /// How fast the torque follows what is asked for.
    pub torque_rate: f64,
}

impl ComplianceCheck {
    fn of(axis: &Axis) -> Option<Self> {
        let Compliance { stiffness_max, damping_max, torque_rise_ns } = axis.compliance;
        let torque_rate = axis.limits.torque / (torque_rise_ns.max(1) as f64 / 1e9);
        axis.controls().any(|control| matches!(control, Control::Torque { .. })).then_some(Self {
            stiffness_max,
            damping_max,
            torque_rate,
        })
    }
}

impl Check {
    pub fn of(config: &Config) -> Self {
        let buses = schedule::analyse(config);
        let refused: Vec<String> = refused_by_data_sheets(config).iter().map(ToString::to_string).collect();
        Self {
            name: config.name.clone(),
            fits: buses.iter().all(BusSchedule::fits) && refused.is_empty(),
            cycle_ns: config.cycle.period_ns,
            command_phase_ns: config.cycle.command_phase_ns,
            automatic_command_phase_ns: schedule::automatic_command_phase(config).ok(),
            send_phase_ns: schedule::send_phase_ns(config),
            groups: config.groups.iter().map(|group| GroupCheck::of(config, group)).collect(),
            axes: config.axes.iter().map(|axis| AxisCheck::of(axis, config)).collect(),
            buses,
            lines: LineCheck::all(config),
            refused,
            warnings: config.warnings().iter().map(ToString::to_string).collect(),
            losses: config.losses(),
        }
    }
}

impl AxisCheck {
    fn of(axis: &Axis, config: &Config) -> Self {
        let counts_per_unit = axis.counts_per_turn * axis.gear_ratio / axis.travel.per_turn();
        let direction = if axis.reversed { -1.0 } else { 1.0 };
        let counts =
            |position: f64| (direction * position * counts_per_unit + f64::from(axis.zero_counts)).round();
        let (first, second) = (counts(axis.limits.position_min), counts(axis.limits.position_max));
        Self {
            name: axis.name.clone(),
            bus: config.buses.get(axis.bus).map(|bus| bus.name.clone()).unwrap_or_default(),
            node: axis.node,
            node_axis: axis.drive.node_axis,
            mode: mode_word(axis.control.operation_mode()),
            other_modes: axis.other_modes.iter().map(|control| mode_word(control.operation_mode())).collect(),
            mode_change: (!axis.other_modes.is_empty())
                .then(|| axis.drive.mode_changes.condition())
                .flatten()
                .map(|condition| match condition {
                    ModeCondition::Disabled => "while disabled",
                    ModeCondition::AtRest => "at rest",
                }),
            is_linear: axis.travel != Travel::Rotary,
            shown_in: axis.shown_in,
            position_min: axis.limits.position_min,
            position_max: axis.limits.position_max,
            velocity: axis.limits.velocity,
            acceleration: axis.limits.acceleration,
            deceleration: axis.limits.deceleration,
            jerk: Some(axis.limits.jerk).filter(|jerk| jerk.is_finite()),
            torque: axis.limits.torque,
            urdf: axis.urdf.clone(),
            following_error: axis.following_error.limit,
            following_error_time_ns: axis.following_error.time_ns,
            feed_forward: match axis.feed_forward {
                FeedForward::None => "none",
                FeedForward::Velocity => "velocity",
                FeedForward::Torque => "torque",
                FeedForward::VelocityAndTorque => "velocity-and-torque",
            },
            compliance: ComplianceCheck::of(axis),
            target_tolerance: axis.target_tolerance,
            supervision: SupervisionCheck::of(axis, config),
            without_controller: Unattended::of(axis, config),
            counts_per_unit,
            resolution: 1.0 / counts_per_unit,
            counts_per_cycle: axis.limits.velocity
                * counts_per_unit
                * config.bus_cycle(axis.bus).period_ns as f64
                / 1e9,
            counts_range: [first.min(second), first.max(second)],
        }
    }

    /// A position or one of its derivatives, from rad (m), in the unit that the file uses.
    pub fn shown(&self, value: f64) -> f64 {
        self.shown_in.from_si(value)
    }

    /// That unit.
    pub fn unit(&self) -> &'static str {
        self.shown_in.symbol()
    }

    /// Returns the number of decimals of a position.
    pub fn decimals(&self) -> usize {
        match self.shown_in {
            PositionUnit::Degree | PositionUnit::Millimetre => 2,
            _ => 4,
        }
    }
}
