//! What a program may know of an axis before it commands it.

use takt_rt::{AxisLimits, OperationMode};

use crate::config::Axis;

/// What the configuration says of an axis, wherever its controller runs. Its name and unit are in the [`Machine`](crate::telemetry::Machine).
#[derive(Clone, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
#[non_exhaustive]
pub struct AxisProperties {
    /// What may never be exceeded: rad (m), seconds and N·m (N).
    pub limits: AxisLimits,
    /// The node ID of its drive.
    pub node: u8,
    /// The highest stiffness of an impedance: N·m/rad (N/m).
    pub stiffness_max: f64,
    /// The highest damping of an impedance: N·m·s/rad (N·s/m).
    pub damping_max: f64,
    /// The modes of operation that it may be commanded in, with the one that it starts in first.
    pub modes: Vec<OperationMode>,
}

impl AxisProperties {
    /// Those of an axis of a configuration.
    #[doc(hidden)]
    pub fn of(axis: &Axis) -> Self {
        Self {
            limits: axis.limits,
            node: axis.node,
            stiffness_max: axis.compliance.stiffness_max,
            damping_max: axis.compliance.damping_max,
            modes: axis.controls().map(|control| control.operation_mode()).collect(),
        }
    }
}
