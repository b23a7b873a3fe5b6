//! What a panel without a controller works on: buses and drives.

use super::super::told::{BusView, DriveView, Told, Torque};
use takt::controller::port::Port;
use takt::family;
use takt::link::modbus_line::ModbusLine;
use takt::link::ownership::Ownership;
use takt_tools::commission::TargetDrive;
use takt_tools::monitor::BusDecoder;

/// What a bus is reached by.
pub enum BenchLink {
    /// A CAN bus.
    Bus(Box<Port>),
    /// A serial line of this bit rate.
    Line(ModbusLine, u32),
}

/// An open bus.
pub struct BenchBus {
    /// Its name for people.
    pub name: String,
    /// Its interface.
    pub interface: String,
    /// What it is reached by.
    pub link: BenchLink,
    /// What its frames mean.
    pub decoder: BusDecoder,
    /// True if it carries CAN FD frames.
    pub has_fd: bool,
}

/// A drive and its bus.
#[derive(Clone, Debug)]
pub struct BenchDrive {
    /// The number of the bus.
    pub bus: usize,
    /// The drive; `None` where no family here moves it.
    pub target: Option<TargetDrive>,
}

/// Buses that this process owns, with their drives.
pub struct Workplace {
    /// The name for people.
    pub name: String,
    /// The buses.
    pub buses: Vec<BenchBus>,
    /// The drives that are known from the beginning.
    pub drives: Vec<BenchDrive>,
    /// The right to command the buses.
    pub ownership: Ownership,
}

impl Workplace {
    /// What pages are told of it at first.
    pub fn told(&self) -> Told {
        let buses = self.buses.iter().map(|bus| BusView {
            name: bus.name.clone(),
            interface: bus.interface.clone(),
            is_line: matches!(bus.link, BenchLink::Line(..)),
        });
        let drives =
            self.drives.iter().filter_map(|drive| Some(DriveView::of(drive.target.as_ref()?, drive.bus)));
        let families = family::all().into_iter().filter(|family| family.unconfigured().is_some());
        Told {
            name: self.name.clone(),
            families: families.map(|family| family.word()).collect(),
            buses: buses.collect(),
            drives: drives.collect(),
            torque: vec![Torque::Off; self.drives.len()],
            health: vec![None; self.buses.len()],
            running: None,
            watched: None,
            reading: None,
            version: 1,
        }
    }
}
