//! A CAN bus that a running controller owns: the controller sends the questions through its service channel, and the scan listens.

use takt_rt::linux::MonotonicClock;
use takt_rt::{BusHealth, BusPort, Frame, Nanoseconds, ReceiveBatch};

use super::interruption::Interruption;
use super::output::Watcher;
use takt::command::CommandError;
use takt::family;
use takt::family::scan::{Answered, BusScan, FoundDevice, PlaceOfScan, Scanned};
use takt::link::{LinkPort, RealInterface};
use takt_remote::{Client, connect, names_in_use};
use takt_tools::commission::bus_scan;

/// So long a question may wait behind others in the controller.
const PASSED_ON_NS: Nanoseconds = 150_000_000;

/// A controller that owns an interface and sends questions there.
pub struct Owner {
    name: String,
    client: Client,
    bus: usize,
}

impl Owner {
    /// The controller that is served on this computer and has this interface, if there is one that answers here.
    pub fn of(interface: &RealInterface) -> Option<Self> {
        let interface = interface.to_string();
        names_in_use().into_iter().find_map(|name| {
            let client = connect(&name).ok()?;
            let bus = client.machine().buses.iter().position(|bus| bus.interface == interface)?;
            Some(Self { name, client, bus })
        })
    }

    /// Whether questions may be sent: a process that may only observe the controller may not.
    ///
    /// # Errors
    /// Why not, for a person.
    pub fn verify(&self) -> Result<(), String> {
        // No controller takes this for a question, so that nothing is sent.
        match self.client.ask_device(self.bus, Frame::of(takt_rt::Id::canopen(0, 0), [])) {
            Ok(()) | Err(CommandError::Question(_)) => Ok(()),
            Err(error) => Err(format!("the controller `{}` sends no questions: {error}", self.name)),
        }
    }

    /// Scans its bus, on which `port` listens.
    pub fn scan(
        &self,
        what: BusScan,
        interface: &RealInterface,
        port: LinkPort,
        interruption: &Interruption,
        watcher: &Watcher,
    ) -> (PlaceOfScan, Scanned) {
        let drives = self.drives();
        let nodes = drives.iter().filter_map(|drive| drive.node).collect();
        let what = BusScan {
            wait_ns: what.wait_ns.saturating_add(PASSED_ON_NS),
            of_controller: Some(nodes),
            ..what
        };
        let mut port = PortBeside { listening: port, owner: self };
        let mut is_told = false;
        let mut is_interrupted = || {
            let is_over = interruption.has_come() || self.client.has_ended();
            let is_new = is_over && !is_told;
            is_told |= is_over;
            is_new
        };
        let mut found = bus_scan::scan(
            &what,
            false,
            &mut port,
            &mut MonotonicClock::default(),
            &mut is_interrupted,
            &mut |at_ns, event| watcher.see(at_ns, &event),
        );
        self.name_drives(drives, &mut found);
        let bus = self.client.machine().buses.get(self.bus);
        let bit_rate = bus.and_then(|bus| bus.bit_rate).unwrap_or(1_000_000);
        let data_bit_rate = bus.and_then(|bus| bus.data_bit_rate);
        (PlaceOfScan { interface: interface.to_string(), bit_rate, data_bit_rate }, found)
    }

    /// The drives of the controller on this bus. Two axes of one node are one.
    fn drives(&self) -> Vec<FoundDevice> {
        let machine = self.client.machine();
        let bus = machine.buses.get(self.bus).map(|bus| bus.name.as_str());
        let mut drives: Vec<FoundDevice> = vec![];
        for (number, axis) in machine.axes.iter().enumerate() {
            let node = self.client.axis_properties(number).map(|axis| axis.node);
            if axis.bus.as_deref() != bus || node.is_none() {
                continue;
            }
            if let Some(drive) = drives.iter_mut().find(|drive| drive.node == node) {
                drive.kind = format!("{}, {}", drive.kind, axis.name);
                continue;
            }
            let mut drive = FoundDevice::new(node, Answered::OfController, format!("axis {}", axis.name));
            let family = axis.family.as_deref().and_then(family::named);
            drive.drive = family.map(|family| family.word());
            drive.vendor = family.and_then(|family| family.maker()).map(str::to_owned);
            drives.push(drive);
        }
        drives
    }

    /// Puts the drives of the controller in the place of what was heard of them.
    fn name_drives(&self, drives: Vec<FoundDevice>, found: &mut Scanned) {
        found.devices.retain(|device| {
            let is_of_controller = drives.iter().any(|drive| drive.node == device.node);
            !(is_of_controller && matches!(device.answered, Answered::Heard(_)))
        });
        found.devices.extend(drives);
        found.devices.sort_by_key(|device| (device.node.is_none(), device.node));
        let name = &self.name;
        found.remarks.insert(
            0,
            format!(
                "the controller `{name}` runs on this bus and has sent the questions: its own drives were not asked, and devices without a \
                 node ID were not looked for"
            ),
        );
        if self.client.has_ended() {
            found.is_interrupted = true;
            found.remarks.push(format!("the controller `{name}` has ended meanwhile: scan again"));
        }
    }
}

/// Listens on the interface. What is sent, the controller sends.
struct PortBeside<'a> {
    listening: LinkPort,
    owner: &'a Owner,
}

impl BusPort for PortBeside<'_> {
    fn send(&mut self, _now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        let Owner { client, bus, .. } = self.owner;
        let sent = frames.iter().take_while(|frame| {
            // A question that would reach one of its drives is not sent. Where the controller has ended, the scan ends.
            !matches!(client.ask_device(*bus, **frame), Err(CommandError::Full { .. }))
        });
        sent.count()
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.listening.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, _now_ns: Nanoseconds) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        self.listening.health()
    }
}
