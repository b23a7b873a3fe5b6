//! What is sent to drives that are spoken to outside of the cycle.

use takt::config::{Axis, Config};
use takt_rt::Frame;
use takt_wire::erob_can::entries;
use takt_wire::erob_can::frame::ReceivedRequest;

/// Returns `true` if the drive of an axis is spoken to outside of the cycle.
pub fn is_beside_the_cycle(axis: &Axis) -> bool {
    let protocol = axis.drive.protocol;
    protocol.own_identifiers().is_some() || protocol.is_of_serial_line()
}

/// Every such drive on a CAN bus: its bus, its node, and the highest velocity that it may be told, in counts/s.
pub struct OffCycle {
    drives: Vec<(usize, u8, f64)>,
}

impl OffCycle {
    pub fn new(config: &Config) -> Self {
        let of_own_protocol =
            config.axes.iter().filter(|axis| axis.drive.protocol.own_identifiers().is_some());
        let drives = of_own_protocol.map(|axis| {
            let count = axis.scale().map_or(0.0, |scale| scale.velocity_from_drive(1).abs());
            (axis.bus, axis.node, axis.limits.velocity / count)
        });
        Self { drives: drives.collect() }
    }

    /// Looks at what was sent in a cycle, an entry a bus: no velocity is beyond its limit.
    pub fn check(&self, sent: &[Vec<Frame>]) -> Result<(), String> {
        for (bus, node, highest) in &self.drives {
            for request in sent[*bus].iter().filter_map(ReceivedRequest::decode) {
                let velocity = request.value.filter(|_| request.address == entries::SET_POINT.address);
                let is_own = request.node == *node;
                if let Some(velocity) = velocity.filter(|_| is_own)
                    && f64::from(velocity).abs() > highest + 1.0
                {
                    return Err(format!("node {node} is told {velocity} counts/s, beyond {highest}"));
                }
            }
        }
        Ok(())
    }
}
