//! What a CANopen node tells of itself: device type (1000), identity (1018), names and versions (1008, 100A).

use takt_rt::Nanoseconds;
use takt_wire::canopen::nmt::NmtState;
use takt_wire::canopen::object::{DataType, ObjectAddress};
use takt_wire::canopen::objects::{
    DEVICE_NAME, DEVICE_TYPE, PRODUCT_CODE, REVISION_NUMBER, SOFTWARE_VERSION, VENDOR_ID,
};
use takt_wire::canopen::sdo::SdoError;
use takt_wire::printable::printable;

use super::device::{Answered, FoundDevice};
use super::heard::HeardNode;
use super::session::ScanSession;
use crate::config::Identity;
use crate::family::{self, Family};

/// A node of which nothing more is known.
pub const KIND: &str = "CANopen node";
/// The name of their protocol.
pub const PROTOCOL: &str = "CANopen";
/// The serial number (CiA 301, 7.5.2.19).
const SERIAL_NUMBER: ObjectAddress = ObjectAddress::new(0x1018, 4);
/// The shortest reply timeout while a node is read. The node has replied before, so that only a lost reply costs this time.
const SHORTEST_WAIT_NS: Nanoseconds = 500_000_000;

/// What a node says of itself, as far as it does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeIdentity {
    /// Object 1000.
    pub device_type: Option<u32>,
    /// Object 1018:1.
    pub vendor: Option<u32>,
    /// Object 1018:2.
    pub product: Option<u32>,
    /// Object 1018:3.
    pub revision: Option<u32>,
    /// Object 1018:4.
    pub serial: Option<u32>,
}

impl NodeIdentity {
    /// Returns `true` if the node is a drive with this vendor and product.
    pub fn is_of(&self, drive: &Identity) -> bool {
        drive.vendor.is_some() && drive.vendor == self.vendor && drive.product == self.product
    }
}

/// How surely a family takes a node for one of its drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Recognised {
    /// By its device profile alone.
    ByProfile,
    /// By vendor and product.
    ByIdentity,
}

/// The family that takes a node most surely for one of its drives.
fn family_of(identity: &NodeIdentity) -> Option<&'static dyn Family> {
    let sure = |family: &&'static dyn Family| family.recognises(identity);
    let families = family::all().into_iter().filter(|family| sure(family).is_some());
    // Of several that are equally sure, the first.
    families.rev().max_by_key(sure)
}

/// Reads what a node tells of itself, which has answered.
pub async fn read(session: &ScanSession, node: u8, wait_ns: Nanoseconds) -> FoundDevice {
    session.step("read the identity");
    let wait_ns = wait_ns.max(SHORTEST_WAIT_NS);
    let mut device = FoundDevice::new(Some(node), Answered::Sdo, KIND);
    let mut identity = NodeIdentity::default();
    match number(session, node, DEVICE_TYPE.address, wait_ns).await {
        Ok(device_type) => identity.device_type = Some(device_type),
        Err(error @ SdoError::NoReply { .. }) => {
            device.remark(format!("it answers SDO requests now and then: {error}"));
            return device;
        }
        Err(error) => device.remark(format!("its device type (1000) cannot be read: {error}")),
    }
    for (object, value) in [
        (VENDOR_ID.address, &mut identity.vendor),
        (PRODUCT_CODE.address, &mut identity.product),
        (REVISION_NUMBER.address, &mut identity.revision),
        (SERIAL_NUMBER, &mut identity.serial),
    ] {
        if session.is_interrupted() {
            break;
        }
        *value = number(session, node, object, wait_ns).await.ok();
    }
    let name = text(session, node, DEVICE_NAME, wait_ns).await;
    device.firmware = text(session, node, SOFTWARE_VERSION, wait_ns).await;
    describe(&mut device, &identity, name);
    device
}

/// Says in words what a node is that has this identity.
fn describe(device: &mut FoundDevice, identity: &NodeIdentity, name: Option<String>) {
    let hexadecimal = |number: u32| format!("0x{number:08X}");
    let family = family_of(identity);
    let type_words = identity.device_type.map(device_type_words);
    device.kind = type_words.unwrap_or_else(|| KIND.to_owned());
    device.vendor = family.and_then(Family::maker).map(str::to_owned).or(identity.vendor.map(hexadecimal));
    device.product = name.or_else(|| {
        let own = family.filter(|family| family.recognises(identity) == Some(Recognised::ByIdentity));
        own.and_then(Family::unconfigured).map(|drive| drive.name.to_owned())
    });
    device.product = device.product.take().or(identity.product.map(hexadecimal));
    device.serial = identity.serial.filter(|serial| *serial != 0).map(|serial| serial.to_string());
    device.drive = family.map(|family| family.word());
    device.identity = Some(*identity);
    if family.is_none() && identity.device_type.is_some() {
        device.remark("it is no CiA 402 drive: takt leaves it alone");
    }
}

async fn number(
    session: &ScanSession,
    node: u8,
    object: ObjectAddress,
    wait_ns: Nanoseconds,
) -> Result<u32, SdoError> {
    let uploaded = session.upload(node, object, wait_ns).await?;
    // Some devices leave out the size, or send fewer bytes than the object has.
    let number = uploaded.number(DataType::U32).and_then(|number| u32::try_from(number).ok());
    Ok(number.unwrap_or_else(|| {
        uploaded.bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
    }))
}

async fn text(
    session: &ScanSession,
    node: u8,
    object: ObjectAddress,
    wait_ns: Nanoseconds,
) -> Option<String> {
    if session.is_interrupted() {
        return None;
    }
    let uploaded = session.upload(node, object, wait_ns).await.ok()?;
    let text = printable(uploaded.text().trim()).trim().to_owned();
    (!text.is_empty()).then_some(text)
}

/// A device type (object 1000) in words: the lower half is the device profile (CiA 301, 7.5.2.1).
fn device_type_words(device_type: u32) -> String {
    let profile = match device_type & 0xFFFF {
        0 => return "device without a profile".to_owned(),
        401 => "inputs and outputs (CiA 401)",
        402 => return drive_words(device_type >> 16 & 0xFF),
        404 => "measuring device (CiA 404)",
        405 => "programmable controller (CiA 405)",
        406 => "encoder (CiA 406)",
        408 => "hydraulic drive (CiA 408)",
        410 => "inclinometer (CiA 410)",
        412 => "medical device (CiA 412)",
        413 => "truck gateway (CiA 413)",
        414 => "weaving machine (CiA 414)",
        415 => "road construction machine (CiA 415)",
        416 => "door (CiA 416)",
        417 => "lift (CiA 417)",
        418 => "battery (CiA 418)",
        419 => "battery charger (CiA 419)",
        profile => return format!("device of profile {profile}"),
    };
    profile.to_owned()
}

/// The type of a drive (CiA 402-2, object 1000, bits 16 to 23).
fn drive_words(kind: u32) -> String {
    let kind = match kind {
        0x01 => "frequency converter",
        0x02 => "servo drive",
        0x04 => "stepper drive",
        // Several kinds in one device, or several axes: bit 1 is the servo drive.
        kind if kind & 0x02 != 0 => "servo drive",
        _ => "drive",
    };
    format!("{kind} (CiA 402)")
}

/// What was heard of a node beside its answers.
pub fn remark_heard(device: &mut FoundDevice, heard: &HeardNode) {
    if let Some(emergency) = heard.emergency {
        let words = match device.drive.and_then(family::named) {
            Some(family) => family.error_words(emergency.code.0),
            None => family::standard_error(emergency.code.0),
        };
        device.remark(format!("it reports an error: {words}"));
    }
    if heard.boot_ups > 1 {
        device.remark(format!("it has restarted {} times meanwhile", heard.boot_ups));
    }
}

/// A node that was heard, and has not answered. A node with nothing but requests of ours is none.
pub fn heard_alone(node: u8, heard: &HeardNode) -> Option<FoundDevice> {
    let state = match heard.state {
        _ if heard.has_answered() => "answers SDO requests of another master",
        Some(NmtState::BootUp) => "boot-up message",
        Some(NmtState::Stopped) => "heartbeat: NMT stopped",
        Some(NmtState::Operational) => "heartbeat: operational",
        Some(NmtState::PreOperational) => "heartbeat: pre-operational",
        None if heard.emergency.is_some() => "emergency message",
        None if heard.has_process_data => "process data",
        None => return None,
    };
    let mut device = FoundDevice::new(Some(node), Answered::Heard(PROTOCOL), format!("{KIND} ({state})"));
    if heard.state == Some(NmtState::Stopped) {
        device.remark(
            "in the NMT state stopped it has no SDO server, so that it tells nothing of itself; a configuration with it starts it",
        );
    }
    remark_heard(&mut device, heard);
    Some(device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_type_is_said_in_words() {
        for (device_type, words) in [
            (0x0002_0192, "servo drive (CiA 402)"),
            (0x0042_0192, "servo drive (CiA 402)"),
            (0x0004_0192, "stepper drive (CiA 402)"),
            (0x0001_0192, "frequency converter (CiA 402)"),
            (0x0003_0191, "inputs and outputs (CiA 401)"),
            (0, "device without a profile"),
            (999, "device of profile 999"),
        ] {
            assert_eq!(device_type_words(device_type), words);
        }
    }

    #[test]
    fn the_family_that_knows_vendor_and_product_goes_before_the_one_that_knows_the_profile() {
        let drive = |vendor, product| NodeIdentity {
            device_type: Some(0x0002_0192),
            vendor: Some(vendor),
            product: Some(product),
            ..NodeIdentity::default()
        };
        let word = |identity: &NodeIdentity| family_of(identity).map(|family| family.word());
        assert_eq!(word(&drive(0x331, 1)), Some("yz-aim"));
        assert_eq!(word(&drive(0x331, 2)), Some("cia402"));
        assert_eq!(word(&NodeIdentity { device_type: Some(0x191), ..drive(0x331, 2) }), None);
        assert_eq!(word(&NodeIdentity::default()), None);
    }
}
