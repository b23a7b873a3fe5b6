//! Names and units of the parts of the machine. Records and events have only their numbers.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use takt_rt::ControlLaw;

use crate::config::{Axis, Config, Travel};
use crate::family;
use crate::words;
use crate::words::Words;

/// Names and units of a controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, bitcode::Encode, bitcode::Decode)]
pub struct Machine {
    /// The name of the machine.
    pub name: String,
    /// Period of the cycle.
    pub cycle_ns: u64,
    /// The axes in the order of the configuration.
    pub axes: Vec<AxisDescription>,
    /// The buses in the order of the configuration.
    pub buses: Vec<BusDescription>,
    /// The names of the groups in the order of the configuration; none where all axes are one group.
    pub groups: Vec<String>,
}

/// Name, unit and resolution of an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, bitcode::Encode, bitcode::Decode)]
pub struct AxisDescription {
    /// Its name in the configuration.
    pub name: String,
    /// The name of its bus; `None` in a recording of an earlier version without this name.
    pub bus: Option<String>,
    /// The number of its group; 0 where all axes are one group.
    pub group: usize,
    /// The family of its drive, which its error codes belong to; `None` in a recording of an earlier version.
    pub family: Option<String>,
    /// The error codes that its drive has its own words for, beside those of its family.
    pub own_errors: Vec<(u16, String)>,
    /// The unit of its position.
    pub unit: Unit,
    /// True if its drive plans its own profile to a target (a profile mode), instead of following set-points.
    pub plans_own_profile: bool,
    /// Counts per rad (m) of the position that the drive reports.
    pub counts_per_unit: f64,
    /// The limits of its set-points.
    pub limits: SetPointMagnitudes,
}

/// Magnitudes, or limits, of the derivatives of a set-point, in rad (m) and seconds.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, bitcode::Encode, bitcode::Decode,
)]
pub struct SetPointMagnitudes {
    /// rad/s (m/s)
    pub velocity: f64,
    /// rad/s² (m/s²)
    pub acceleration: f64,
    /// rad/s³ (m/s³); infinite where it is not limited.
    pub jerk: f64,
}

/// Names of a bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, bitcode::Encode, bitcode::Decode)]
pub struct BusDescription {
    /// Its name in the configuration.
    pub name: String,
    /// `sim`, or the name of its network interface.
    pub interface: String,
    /// Its bit rate, in bit/s; `None` in a recording.
    pub bit_rate: Option<u32>,
    /// The bit rate of the data phase of CAN FD, in bit/s.
    pub data_bit_rate: Option<u32>,
}

/// The unit of an axis' position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, bitcode::Encode, bitcode::Decode)]
pub enum Unit {
    /// rad, and N·m
    #[serde(rename = "rad")]
    Radian,
    /// m, and N
    #[serde(rename = "m")]
    Metre,
}

impl Unit {
    /// `rad` or `m`.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Metre => "m",
        }
    }

    /// `Nm` or `N`.
    pub(crate) const fn effort_symbol(self) -> &'static str {
        match self {
            Self::Radian => "Nm",
            Self::Metre => "N",
        }
    }

    /// `mrad` or `mm`.
    pub const fn milli_symbol(self) -> &'static str {
        match self {
            Self::Radian => "mrad",
            Self::Metre => "mm",
        }
    }
}

impl Machine {
    /// The names in a configuration.
    pub fn of(config: &Config) -> Self {
        let bus = |bus: &crate::config::Bus| BusDescription {
            name: bus.name.clone(),
            interface: bus.interface.to_string(),
            bit_rate: Some(bus.bit_rate),
            data_bit_rate: bus.data_bit_rate,
        };
        Self {
            name: config.name.clone(),
            cycle_ns: config.cycle.period_ns,
            axes: (0..)
                .zip(&config.axes)
                .map(|(number, axis)| AxisDescription::of(number, axis, config))
                .collect(),
            buses: config.buses.iter().map(bus).collect(),
            groups: config.groups.iter().map(|group| group.name.clone()).collect(),
        }
    }

    /// The name of an axis; its number if it is unknown.
    pub fn axis_name(&self, axis: u8) -> String {
        self.axes.get(usize::from(axis)).map_or_else(|| format!("axis {axis}"), |axis| axis.name.clone())
    }

    /// The name of a bus; its number if it is unknown.
    pub(crate) fn bus_name(&self, bus: u8) -> String {
        self.buses.get(usize::from(bus)).map_or_else(|| format!("bus {bus}"), |bus| bus.name.clone())
    }

    /// The name of a group; its number if it is unknown.
    pub fn group_name(&self, group: u8) -> String {
        self.groups.get(usize::from(group)).map_or_else(|| format!("group {group}"), Clone::clone)
    }

    /// The number of the group of each axis.
    pub(crate) fn groups_of_axes(&self) -> Vec<usize> {
        self.axes.iter().map(|axis| axis.group).collect()
    }

    /// Returns `true` if the drive of an axis plans its own profile, instead of following set-points.
    pub fn plans_own_profile(&self, axis: u8) -> bool {
        self.axes.get(usize::from(axis)).is_some_and(|axis| axis.plans_own_profile)
    }

    /// An error code of the drive of an axis, in words.
    pub fn drive_error(&self, axis: u8, code: u16) -> Words {
        let own = self.axes.get(usize::from(axis)).map_or(&[][..], |axis| &axis.own_errors);
        family::own_error_words(own, code).unwrap_or_else(|| family::error_words(self.family(axis), code))
    }

    /// The cure of an error of the drive of an axis.
    pub fn drive_cure(&self, axis: u8, code: u16) -> &'static str {
        family::error_cure(self.family(axis), code)
    }

    /// The statusword of an axis in words, with a space before it; nothing where its drive has none: takt makes one of what the drive says.
    pub(crate) fn statusword(&self, axis: Option<u8>, statusword: u16) -> Words {
        let family = axis.and_then(|axis| self.family(axis)).and_then(family::named);
        match family.is_none_or(|family| family.has_statusword()) {
            true => words!(" (statusword {word})", word = format!("0x{statusword:04X}")),
            false => "".into(),
        }
    }

    fn family(&self, axis: u8) -> Option<&str> {
        self.axes.get(usize::from(axis)).and_then(|axis| axis.family.as_deref())
    }

    /// The unit of an axis.
    pub fn axis_unit(&self, axis: u8) -> Unit {
        self.axes.get(usize::from(axis)).map_or(Unit::Radian, |axis| axis.unit)
    }
}

impl AxisDescription {
    /// The description of an axis of a configuration.
    pub fn of(number: usize, axis: &Axis, config: &Config) -> Self {
        let (unit, travel_per_turn) = match axis.travel {
            Travel::Rotary => (Unit::Radian, TAU),
            Travel::Linear { lead_m } => (Unit::Metre, lead_m),
        };
        Self {
            name: axis.name.clone(),
            bus: config.buses.get(axis.bus).map(|bus| bus.name.clone()),
            group: config.group_of_axis(number),
            family: Some(axis.drive.word.to_owned()),
            own_errors: family::own_errors(&axis.drive).to_vec(),
            unit,
            plans_own_profile: matches!(
                axis.control,
                ControlLaw::ProfilePosition | ControlLaw::ProfileVelocity | ControlLaw::ProfileTorque
            ),
            counts_per_unit: axis.counts_per_turn * axis.gear_ratio / travel_per_turn,
            limits: SetPointMagnitudes {
                velocity: axis.limits.velocity,
                acceleration: axis.limits.acceleration.max(axis.limits.deceleration),
                jerk: axis.limits.jerk,
            },
        }
    }
}
