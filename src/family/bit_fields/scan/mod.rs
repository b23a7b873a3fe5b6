//! How drives of bit fields are found on a bus: by what their descriptions say of it. A drive of which a description says nothing has no
//! request that leaves it alone.
//!
//! - `registers`: drives whose registers can be read.
//! - `heartbeat`: drives that send heartbeats by themselves.

mod heartbeat;
mod registers;

use std::sync::LazyLock;

use takt_rt::{CommandValue, FieldMode};

use super::{DESCRIPTIONS, FROM_FILE, shipped};
use crate::family::scan::{FoundDevice, OwnProtocol, StartingKeys};
use heartbeat::HeartbeatDrives;
use registers::RegisterDrives;
use takt_wire::bit_fields::{DescribedScan, Description, FieldDevice, Settings};

/// A description that comes with takt.
#[derive(Debug)]
struct Make {
    name: &'static str,
    /// A drive of this make, without what a configuration says of one.
    device: FieldDevice,
}

impl Make {
    const fn description(&self) -> &Description {
        &self.device.description
    }

    /// The line of an axis that names the description.
    fn line(&self) -> String {
        format!("description = {:?}", self.name)
    }

    /// The lines of an axis with the gains of the spring and the damper in the drive, where it has them.
    fn gains(&self) -> Vec<String> {
        let has = |value| self.description().command.field(value).is_some();
        if !self.description().modes.contains(&FieldMode::Position) {
            return vec![];
        }
        let gains = [
            (CommandValue::Stiffness, "kp = 60  # YOURS: the gain of the drive's position loop"),
            (CommandValue::Damping, "kd = 1.5  # YOURS: the damping of the drive's position loop"),
        ];
        gains.into_iter().filter(|(value, _)| has(*value)).map(|(_, line)| line.to_owned()).collect()
    }

    /// Says of a device that it is of this make.
    fn name(&self, device: &mut FoundDevice) {
        device.vendor = Some(self.description().drive.vendor.clone());
        device.product = Some(self.description().drive.product.clone());
        device.drive = Some(FROM_FILE.word);
        device.remark(format!("its description is {:?}", self.name));
    }
}

/// The protocols by which drives with a description that comes with takt are found.
pub fn protocols() -> &'static [&'static dyn OwnProtocol] {
    static PROTOCOLS: LazyLock<Vec<&'static dyn OwnProtocol>> = LazyLock::new(|| {
        let registers = registers().iter().map(|drives| -> &'static dyn OwnProtocol { drives });
        let heartbeats = heartbeats().iter().map(|drives| -> &'static dyn OwnProtocol { drives });
        registers.chain(heartbeats).collect()
    });
    &PROTOCOLS
}

/// The makes whose description says how they are found.
fn makes() -> impl Iterator<Item = (Make, DescribedScan)> {
    DESCRIPTIONS.into_iter().filter_map(|(name, text)| {
        let mut description = shipped(name, text);
        let scan = description.scan.take()?;
        Some((Make { name, device: FieldDevice { description, settings: Settings::default() } }, scan))
    })
}

/// One entry for all descriptions whose registers are read alike.
fn registers() -> &'static [RegisterDrives] {
    static DRIVES: LazyLock<Vec<RegisterDrives>> = LazyLock::new(|| {
        let mut drives: Vec<RegisterDrives> = vec![];
        for (make, scan) in makes() {
            let DescribedScan::Registers(scan) = scan else { continue };
            match drives.iter_mut().find(|drives| drives.is_read_by(&scan.protocol)) {
                Some(drives) => drives.add(scan.mode_is, make),
                None => drives.push(RegisterDrives::new(scan, make)),
            }
        }
        drives
    });
    &DRIVES
}

/// One entry for all descriptions of drives with the same heartbeats.
fn heartbeats() -> &'static [HeartbeatDrives] {
    static DRIVES: LazyLock<Vec<HeartbeatDrives>> = LazyLock::new(|| {
        let mut drives: Vec<HeartbeatDrives> = vec![];
        for (make, scan) in makes() {
            let DescribedScan::Heartbeat(scan) = scan else { continue };
            match drives.iter_mut().find(|drives| drives.is_known_by(&scan)) {
                Some(drives) => drives.add(make),
                None => drives.extend(HeartbeatDrives::new(scan, make)),
            }
        }
        drives
    });
    &DRIVES
}

/// The keys of an axis: what the drive has told, and what its description has.
pub fn starting_keys(found: &FoundDevice) -> Option<StartingKeys> {
    let axis = found.axis_keys.clone();
    (!axis.is_empty()).then(|| StartingKeys { axis, ..StartingKeys::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::scan::Likeness;
    use takt_rt::{Frame, Id};

    fn protocol(name: &str) -> &'static dyn OwnProtocol {
        *protocols().iter().find(|protocol| protocol.name() == name).unwrap()
    }

    fn frame(id: u32, bytes: [u8; 8]) -> Frame {
        Frame::of(Id::base(id).unwrap(), bytes)
    }

    #[test]
    fn drives_of_three_descriptions_are_found_by_one_question_that_reads() {
        let damiao = protocol("Damiao registers");
        let question = damiao.question(5).unwrap();
        assert_eq!(question, frame(0x7FF, [5, 0, 0x33, 7, 0, 0, 0, 0]));
        assert_eq!(damiao.consequence(), None);
        assert_eq!(
            damiao.reply_to_reading(&question),
            None,
            "nobody knows the identifier of the reply before"
        );
        assert_eq!(registers().len(), 1, "{:#?}", registers());
    }

    #[test]
    fn a_reply_has_the_identifier_that_it_tells() {
        let damiao = protocol("Damiao registers");
        let reply = |id, bytes| damiao.replying(&frame(id, bytes));
        assert_eq!(reply(0x15, [5, 0, 0x33, 7, 0x15, 0, 0, 0]), Some(5));
        assert_eq!(reply(0x315, [5, 0, 0x33, 7, 0x15, 3, 0, 0]), Some(5));
        assert_eq!(reply(0x16, [5, 0, 0x33, 7, 0x15, 0, 0, 0]), None, "another identifier");
        assert_eq!(reply(0x15, [5, 0, 0x33, 10, 1, 0, 0, 0]), Some(5), "a further register");
        assert_eq!(reply(0x15, [5, 0, 0x33, 99, 1, 0, 0, 0]), None, "no register that is read");
        assert_eq!(reply(0x15, [5, 0, 0x55, 7, 0x15, 0, 0, 0]), None, "it was written");
        assert_eq!(reply(0x15, [0, 0, 0x33, 7, 0x15, 0, 0, 0]), None, "no motor ID");
        assert_eq!(damiao.replying(&damiao.question(5).unwrap()), None);
        let short = Frame::of(Id::base(0x15).unwrap(), [5, 0, 0x33, 7]);
        assert_eq!(damiao.replying(&short), None);
    }

    #[test]
    fn a_heartbeat_is_told_from_other_frames_by_its_bytes() {
        let odrive = protocol("ODrive CAN Simple");
        let likeness = |id, bytes| odrive.heartbeat(&frame(id, bytes));
        assert_eq!(likeness(0x021, [0, 0, 0, 0, 1, 0, 0, 0]), Some((1, Likeness::Alike)));
        assert_eq!(likeness(0x181, [0, 2, 0, 0, 8, 3, 1, 0]), Some((12, Likeness::Alike)));
        assert_eq!(likeness(0x081, [0, 0, 0, 0, 0, 0, 0, 0]), Some((4, Likeness::Different)), "no state");
        assert_eq!(likeness(0x181, [0x37, 2, 0, 0, 0x50, 9, 0, 0]), Some((12, Likeness::Different)));
        assert_eq!(likeness(0x022, [0, 0, 0, 0, 1, 0, 0, 0]), None);
        let short = Frame::of(Id::base(0x021).unwrap(), [5]);
        assert_eq!(odrive.heartbeat(&short), Some((1, Likeness::Different)));
        assert_eq!(odrive.question(1), None, "it is not asked");
        assert!(odrive.has_identifier(1, Id::base(0x03F).unwrap()));
        assert!(!odrive.has_identifier(1, Id::base(0x040).unwrap()));
        assert!(odrive.is_harmed_by(protocol("Damiao registers").question(1).unwrap().id()));
    }
}
