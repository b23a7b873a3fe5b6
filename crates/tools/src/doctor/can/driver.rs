//! What stands behind an interface: a controller of this machine, an adapter on USB or on a serial line, or nothing.

use super::link::Link;
use crate::doctor::finding::{Check, Finding, Group};
use crate::doctor::source::Source;

const DRIVER: Check = Check {
    key: "can_driver",
    group: Group::Can,
    title: "driver",
    source: "/sys/class/net/*/device",
    why: "frames to a controller of this machine leave within microseconds; an adapter on USB gathers them for up to a millisecond, and one on a serial line for many",
};

/// How an interface is connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// A controller on a bus of the processor.
    Native,
    /// A controller behind SPI.
    Spi,
    /// An adapter on USB.
    Usb,
    /// An adapter on a serial line.
    SerialLine,
    /// No controller: vcan, vxcan.
    Virtual,
}

/// The device behind an interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    pub class: Class,
    /// The name of its driver.
    pub driver: String,
    /// The address of its device on its bus, `0000:03:00.0` or `spi0.0`, by which some drivers name their interrupt.
    pub address: Option<String>,
}

impl Device {
    pub fn of(source: &Source, name: &str, link: Option<&Link>) -> Self {
        let folder = format!("/sys/class/net/{name}");
        let kind = link.and_then(|link| link.kind.clone());
        let controller = link.and_then(|link| link.controller.clone());
        let driver = source.link_name(&format!("{folder}/device/driver"));
        let bus = source.link_name(&format!("{folder}/device/subsystem"));
        let is_virtual = source.link(&folder).is_some_and(|link| link.contains("/virtual/"));
        let class = match (bus.as_deref(), controller.as_deref(), kind.as_deref()) {
            (_, Some("slcan"), _) | (Some("tty" | "serial"), ..) => Class::SerialLine,
            _ if name.starts_with("slcan") => Class::SerialLine,
            (.., Some("vcan" | "vxcan")) => Class::Virtual,
            (Some("usb"), ..) => Class::Usb,
            (Some("spi"), ..) => Class::Spi,
            _ if is_virtual => Class::Virtual,
            _ => Class::Native,
        };
        let own_name = match class {
            Class::SerialLine => "slcan".to_owned(),
            _ => kind.filter(|kind| kind != "can").unwrap_or_else(|| "unknown driver".to_owned()),
        };
        Self {
            class,
            driver: driver.or(controller).unwrap_or(own_name),
            address: source.link_name(&format!("{folder}/device")),
        }
    }

    /// Returns `true` if there is a bit rate that can be set and read.
    pub fn has_bit_timing(&self) -> bool {
        self.class != Class::Virtual
    }

    /// Returns `true` if it has an interrupt of its own.
    pub fn has_interrupt(&self) -> bool {
        matches!(self.class, Class::Native | Class::Spi | Class::Usb)
    }
}

pub fn finding(device: &Device) -> Finding {
    let driver = &device.driver;
    match device.class {
        Class::Virtual => DRIVER.good(format!("{driver}: virtual, there is no wire")),
        Class::Native => DRIVER.good(format!("{driver}: a controller of this machine")),
        // Two buffers, filled and emptied over SPI frame by frame: it loses frames at 1 Mbit/s.
        Class::Spi if driver == "mcp251x" => DRIVER
            .could_be_better(format!("{driver}: behind SPI, with room for two frames"))
            .mend("lspci | grep -i can   # a controller on PCI Express, or an MCP2518FD, can do what this one cannot"),
        Class::Spi => DRIVER.good(format!("{driver}: a controller behind SPI, some 100 µs away")),
        Class::Usb => DRIVER
            .could_be_better(format!("{driver}: an adapter on USB"))
            .mend("lsusb -t   # at least a port and a host controller of its own; better a controller on PCI Express"),
        Class::SerialLine => DRIVER
            .forbids(format!("{driver}: an adapter on a serial line"))
            .mend("lsusb   # many of them run the firmware candleLight and are then gs_usb adapters; better a controller on PCI Express"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;
    use std::collections::BTreeMap;
    use std::fs;
    use std::os::unix::fs::symlink;
    use std::path::Path;

    /// A machine with one interface, whose device is on this bus with this driver.
    fn machine(root: &Path, name: &str, bus: &str, driver: &str) -> Source {
        let device = root.join("sys/devices/thing/1-4:1.0");
        fs::create_dir_all(device.join("net").join(name)).unwrap();
        fs::create_dir_all(root.join("sys/class/net")).unwrap();
        symlink(format!("../../devices/thing/1-4:1.0/net/{name}"), root.join("sys/class/net").join(name))
            .unwrap();
        symlink("../../../1-4:1.0", device.join("net").join(name).join("device")).unwrap();
        symlink(format!("../../../bus/{bus}"), device.join("subsystem")).unwrap();
        symlink(format!("../../../bus/{bus}/drivers/{driver}"), device.join("driver")).unwrap();
        Source::recorded(root, BTreeMap::new())
    }

    #[test]
    fn a_device_is_known_by_the_bus_that_it_is_on() {
        for (name, bus, driver, class, verdict) in [
            ("can0", "pci", "kvaser_pci", Class::Native, Verdict::Good),
            ("can0", "platform", "m_can_platform", Class::Native, Verdict::Good),
            ("can0", "usb", "gs_usb", Class::Usb, Verdict::CouldBeBetter),
            ("can0", "spi", "mcp251xfd", Class::Spi, Verdict::Good),
            ("can0", "spi", "mcp251x", Class::Spi, Verdict::CouldBeBetter),
            ("slcan0", "tty", "slcan", Class::SerialLine, Verdict::ForbidsRealTime),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let device = Device::of(&machine(folder.path(), name, bus, driver), name, None);
            assert_eq!((device.class, device.driver.as_str()), (class, driver), "{driver}");
            assert_eq!(device.address.as_deref(), Some("1-4:1.0"));
            assert_eq!(finding(&device).verdict, verdict, "{driver}");
        }
    }

    #[test]
    fn what_is_virtual_is_known_with_and_without_ip() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("sys/class/net")).unwrap();
        symlink("../../devices/virtual/net/vcan0", folder.path().join("sys/class/net/vcan0")).unwrap();
        let source = Source::recorded(folder.path(), BTreeMap::new());
        assert_eq!(Device::of(&source, "vcan0", None).class, Class::Virtual);
        let link = Link { name: "vcan0".to_owned(), kind: Some("vcan".to_owned()), ..Link::default() };
        let device = Device::of(&source, "vcan0", Some(&link));
        assert_eq!((device.class, device.driver.as_str()), (Class::Virtual, "vcan"));
        let controller = Link { controller: Some("slcan".to_owned()), ..link };
        assert_eq!(Device::of(&source, "can7", Some(&controller)).class, Class::SerialLine);
    }
}
