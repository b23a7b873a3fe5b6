//! The scan of a CAN bus: the procedure of the families, then devices without a node ID (LSS fastscan, CiA 305), then what the controller
//! of the interface tells.

use takt_rt::{BusHealth, BusPort, BusState, Clock, Nanoseconds};
use takt_wire::canopen::lss::{LssAddress, LssError};

use super::bus_session::{self, SessionEvent};
use super::layer_settings::{LayerSettingFailure, LayerSettings};
use takt::family::scan::{Answered, BusScan, FoundDevice, NodeIdentity, Scanned, scan_bus};

/// How long each reply of a fastscan is awaited at the second attempt, for slow adapters. Without replies that come late, the usual time
/// makes a scan five times faster.
const PATIENT_NS: Nanoseconds = 100_000_000;

/// Scans a bus. `is_interrupted` is called at each poll; `see` gets every event with the time since the beginning.
pub fn scan(
    what: &BusScan,
    finds_unconfigured: bool,
    port: &mut impl BusPort,
    clock: &mut impl Clock,
    is_interrupted: &mut dyn FnMut() -> bool,
    see: &mut dyn FnMut(Nanoseconds, SessionEvent),
) -> Scanned {
    let procedure = Box::new(scan_bus(what.clone()));
    let scanned = bus_session::run(procedure, port, clock, &mut *is_interrupted, &mut *see);
    let mut found = scanned.unwrap_or_else(|error| Scanned {
        remarks: vec![error.to_string()],
        is_interrupted: true,
        ..Scanned::default()
    });
    let is_usable = matches!(port.health().state, BusState::ErrorActive);
    if finds_unconfigured && is_usable && !what.only_listens && !found.is_interrupted {
        find_unconfigured(port, clock, is_interrupted, see, &mut found);
    }
    found.bus_state = port.health().state;
    found.remarks.extend(health_remarks(&port.health(), port.unconfirmed(clock.now_ns()), what.only_listens));
    found
}

fn find_unconfigured(
    port: &mut impl BusPort,
    clock: &mut impl Clock,
    is_interrupted: &mut dyn FnMut() -> bool,
    see: &mut dyn FnMut(Nanoseconds, SessionEvent),
    found: &mut Scanned,
) {
    let mut settings = LayerSettings::new(port, clock, is_interrupted, see);
    let mut addresses = vec![];
    let mut outcome = settings.scan_all(&mut addresses);
    if let Err(LayerSettingFailure::Task(LssError::ScanLost)) = outcome {
        settings = settings.with_scan_timeout(PATIENT_NS);
        outcome = settings.scan_all(&mut addresses);
    }
    let released = settings.release(None);
    found.devices.extend(addresses.into_iter().map(unconfigured));
    match outcome.and_then(|implausible| released.map(|_| implausible)) {
        Ok(None) => {}
        Ok(Some(implausible)) => {
            found
                .remarks
                .push(format!("the search for devices without a node ID ended early: {implausible}"));
        }
        Err(LayerSettingFailure::Interrupted) => found.is_interrupted = true,
        Err(failure) => {
            found.remarks.push(format!("the search for devices without a node ID failed: {failure}"));
        }
    }
}

fn unconfigured(address: LssAddress) -> FoundDevice {
    let LssAddress { vendor, product, revision, serial } = address;
    let mut device = FoundDevice::new(None, Answered::Lss, "device without a node ID");
    device.vendor = Some(format!("0x{vendor:08X}"));
    device.product = Some(format!("0x{product:08X}"));
    device.serial = Some(serial.to_string());
    device.identity = Some(NodeIdentity {
        device_type: None,
        vendor: Some(vendor),
        product: Some(product),
        revision: Some(revision),
        serial: Some(serial),
    });
    device.remark(format!(
        "give it one: takt lss --bus … --device 0x{vendor:X}:0x{product:X}:0x{revision:X}:0x{serial:X} set-id N"
    ));
    device
}

/// What the controller of the interface tells of the bus: sentences for people.
fn health_remarks(health: &BusHealth, waiting: usize, only_listens: bool) -> Vec<String> {
    let mut remarks = vec![];
    match health.state {
        BusState::Down => remarks.push("the interface went down: nothing more could be sent or heard".to_owned()),
        BusState::BusOff => remarks.push(
            "the interface is off the bus (bus-off): check wiring, termination and bit rate, then scan again".to_owned(),
        ),
        BusState::ErrorPassive => remarks.push(
            "nobody acknowledges a frame: is it plugged in and terminated, is the power of the drives on, is the bit rate right?"
                .to_owned(),
        ),
        BusState::ErrorActive if waiting > 0 && !only_listens => remarks.push(format!(
            "{waiting} requests still wait for the bus: it is too busy, or nobody acknowledges a frame (power, wiring, bit rate)"
        )),
        BusState::ErrorActive => {}
    }
    if health.rx_overruns > 0 {
        remarks.push(format!("{} frames were lost before they were read: scan again", health.rx_overruns));
    }
    remarks
}
