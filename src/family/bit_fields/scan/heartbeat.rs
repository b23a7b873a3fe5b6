//! Drives that are known by the heartbeats that they send. They are not asked.

use std::ops::RangeInclusive;

use takt_rt::{Frame, FrameKind, Id};
use takt_wire::bit_fields::{HeartbeatScan, IdExpression};

use super::Make;
use crate::family::scan::{Answered, FoundDevice, Likeness, OwnProtocol, Reading, ScanSession};

/// Drives with the same heartbeats.
#[derive(Debug)]
pub struct HeartbeatDrives {
    name: &'static str,
    scan: HeartbeatScan,
    /// The identifier of a heartbeat.
    id: IdExpression,
    /// The description that an axis gets.
    first: Make,
    /// Others of the same drives.
    further: Vec<Make>,
}

impl HeartbeatDrives {
    /// Those of a description. `None` if it has no heartbeat, of which its reader complains.
    pub fn new(scan: HeartbeatScan, make: Make) -> Option<Self> {
        let id = make.description().heartbeat?.id;
        // There are as many as descriptions, once in the life of the process.
        Some(Self { name: scan.name.clone().leak(), scan, id, first: make, further: vec![] })
    }

    /// Returns `true` if they are known by this.
    pub fn is_known_by(&self, scan: &HeartbeatScan) -> bool {
        self.scan == *scan
    }

    /// Adds another description of the same drives.
    pub fn add(&mut self, make: Make) {
        self.further.push(make);
    }
}

impl OwnProtocol for HeartbeatDrives {
    fn name(&self) -> &'static str {
        self.name
    }

    fn nodes(&self) -> RangeInclusive<u8> {
        self.first.description().motor_ids.clone()
    }

    fn question(&self, _: u8) -> Option<Frame> {
        None
    }

    /// Nothing is asked, and so nobody replies.
    fn replying(&self, _: &Frame) -> Option<u8> {
        None
    }

    fn heartbeat(&self, frame: &Frame) -> Option<(u8, Likeness)> {
        let node = self.nodes().find(|node| self.id.id(*node, 0) == Some(frame.id()))?;
        let (payload, bytes) = (frame.payload(), &self.scan.bytes);
        let is_alike = frame.kind() == FrameKind::Data
            && payload.len() == bytes.len()
            && bytes.iter().zip(payload).all(|(range, byte)| range.contains(byte));
        Some((node, if is_alike { Likeness::Alike } else { Likeness::Different }))
    }

    fn has_identifier(&self, node: u8, id: Id) -> bool {
        let [lowest, highest] = self.scan.identifiers.map(|id| id.id(node, 0).map(Id::value));
        let is_within = lowest.is_some_and(|lowest| id.value() >= lowest)
            && highest.is_some_and(|highest| id.value() <= highest);
        is_within && !id.is_extended()
    }

    fn is_harmed_by(&self, id: Id) -> bool {
        self.scan.harmed_by.contains(&id)
    }

    fn read<'a>(&'a self, _: &'a ScanSession, node: u8, _: Frame) -> Reading<'a> {
        Box::pin(async move { self.overheard(node) })
    }

    fn overheard(&self, node: u8) -> FoundDevice {
        let mut device =
            FoundDevice::new(Some(node), Answered::Heard(self.name), "drive that sends heartbeats");
        self.first.name(&mut device);
        let line = self.first.line();
        let others: Vec<String> = self.further.iter().map(|make| format!("{:?}", make.name)).collect();
        let line = match others.is_empty() {
            true => line,
            false => format!("{line}  # YOURS: or {}", others.join(", ")),
        };
        device.axis_keys = vec![line];
        device.axis_keys.extend(self.first.gains());
        device
    }
}
