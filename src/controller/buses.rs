//! How the buses of a configuration are opened and claimed: their bit rates, the identifiers that pass, and the traffic by which
//! another master is recognised. The folder `link` knows interfaces alone; which drives are on a bus is decided here.

use takt_rt::Id;
use takt_wire::canopen::function_code;

use crate::config::Config;
use crate::config::identifiers::IdUse;
use crate::family::bring_up::ProcessData;
use crate::family::identifiers;
use crate::link::ownership::{BusClaim, ClaimError, CommandedDrive, IfOwned, MasterTraffic, Ownership};
use crate::link::{InterfaceSettings, RealInterface, SocketCanOptions};

/// The node IDs of CANopen.
const NODES: u8 = 127;
/// The most set-point frames of an axis in a cycle: a drive has four receive PDOs.
const COMMANDS_PER_AXIS: usize = 4;
/// The most SYNC and service frames of a bus in a cycle.
const SERVICE_FRAMES: usize = 8;

/// The options of the master on bus number `bus` of a configuration. They let pass every identifier that the drives on this
/// bus use, in both directions.
pub(super) fn socket_options(config: &Config, bus: usize) -> SocketCanOptions {
    let axes = config.axes.iter().filter(|axis| axis.bus == bus);
    // Axes of one node have most of theirs in common.
    let mut of_drives: Vec<Id> = vec![];
    for axis in axes {
        let data = ProcessData::of(axis, config);
        let ids = identifiers(&axis.drive, axis.node).into_iter().chain(data.all().map(|pdo| pdo.id));
        for id in ids {
            if !of_drives.contains(&id) {
                of_drives.push(id);
            }
        }
    }
    let broadcast = [function_code::NMT, function_code::SYNC, function_code::TIME];
    let broadcast = broadcast.map(|function| Id::canopen(function, 0));
    let own = Id::canopen(function_code::ERROR_CONTROL, config.master.node);
    let others = questions().filter(|id| !of_drives.contains(id));
    let settings = config.buses.get(bus);
    let usual = SocketCanOptions::default();
    SocketCanOptions {
        identifiers: of_drives.iter().copied().chain(broadcast).chain([own]).chain(others).collect(),
        bit_rate: settings.map_or(usual.bit_rate, |bus| bus.bit_rate),
        data_bit_rate: settings.and_then(|bus| bus.data_bit_rate),
        // The frames of all buses: the kernel may charge one socket with frames that others send in the same call, and
        // on a bus that is stuck they stay there.
        transmit_frames: config.axes.len() * COMMANDS_PER_AXIS + config.buses.len() * SERVICE_FRAMES,
        ..usual
    }
}

/// The identifiers of questions to devices that are none of the configuration's: what is sent must come back, or it does not count as
/// sent. Their replies are for those who ask.
fn questions() -> impl Iterator<Item = Id> {
    (1..=NODES).map(|node| Id::canopen(function_code::SDO_REQUEST, node))
}

impl MasterTraffic {
    /// Of bus number `bus` of a configuration.
    pub fn of(config: &Config, bus: usize) -> Self {
        let drives = config.axes.iter().filter(|axis| axis.bus == bus).map(|axis| {
            let data = ProcessData::of(axis, config);
            let own = axis.drive.frame_identifiers(axis.node);
            let of_use = |wanted| own.iter().filter(move |(_, used)| *used == wanted).map(|(id, _)| *id);
            let replies = data.feedback.iter().chain(&data.unused).map(|pdo| pdo.id);
            CommandedDrive {
                node: axis.node,
                commands: data.commands.iter().map(|pdo| pdo.id).chain(of_use(IdUse::Request)).collect(),
                feedback: replies.chain(of_use(IdUse::Reply)).collect(),
            }
        });
        let sync_period_ns = config.bus_cycle(bus).period_ns;
        Self::new(config.master.node, sync_period_ns, config.master.heartbeat_ns, &drives.collect::<Vec<_>>())
    }
}

impl BusClaim {
    /// Bus number `bus` of a configuration; `None` when it is a simulated one.
    pub fn of(config: &Config, bus: usize) -> Option<Self> {
        let settings = config.buses.get(bus)?;
        Some(Self {
            bus: settings.name.clone(),
            interface: RealInterface::of(&settings.interface)?,
            settings: InterfaceSettings::of(settings),
            traffic: MasterTraffic::of(config, bus),
        })
    }
}

impl Ownership {
    /// Of every real interface of a configuration.
    ///
    /// # Errors
    /// See [`ClaimError`].
    pub fn of(config: &Config, if_owned: IfOwned) -> Result<Self, ClaimError> {
        let claims = (0..config.buses.len()).filter_map(|bus| BusClaim::of(config, bus));
        Self::claim(claims.collect(), if_owned)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::Interface;

    fn arm() -> Config {
        Config::load(Path::new("configs/arm6-erob.toml")).unwrap()
    }

    #[test]
    fn a_master_receives_every_identifier_of_its_nodes_and_its_own() {
        let config = arm();
        let options = socket_options(&config, 0);
        let node = config.axes.iter().find(|axis| axis.bus == 0).map(|axis| axis.node).unwrap();
        for function in [0x080, 0x180, 0x200, 0x480, 0x500, 0x580, 0x600, 0x700] {
            assert!(options.identifiers.contains(&Id::canopen(function, node)), "{function:X}");
        }
        // The request and the reply of the probe for the vendor's own protocol.
        let other = [0x640, 0x5C0].map(|base| Id::base(base + u32::from(node)).unwrap());
        let own = Id::canopen(0x700, config.master.node);
        for id in [Id::canopen(0x000, 0), Id::canopen(0x080, 0), own].into_iter().chain(other) {
            assert!(options.identifiers.contains(&id), "{id:?}");
        }
        let elsewhere = config.axes.iter().find(|axis| axis.bus == 1).map(|axis| axis.node).unwrap();
        assert!(!options.identifiers.contains(&Id::canopen(0x180, elsewhere)));
        // A socket takes 512 filters (`CAN_RAW_FILTER_MAX`); with more it receives everything.
        assert!(options.identifiers.len() <= 512);
    }

    #[test]
    fn another_master_is_recognised_by_set_points_for_the_axes_of_the_bus_alone() {
        let config = arm();
        let set_points = |bus| takt_rt::Frame::of(Id::canopen(0x200, node_on(&config, bus)), [0; 6]);
        let traffic = MasterTraffic::of(&config, 0);
        assert!(traffic.judge(&set_points(0)).is_some());
        assert_eq!(traffic.judge(&set_points(1)), None);
    }

    fn node_on(config: &Config, bus: usize) -> u8 {
        config.axes.iter().find(|axis| axis.bus == bus).map(|axis| axis.node).unwrap()
    }

    #[test]
    fn simulated_buses_belong_to_nobody_and_take_no_time() {
        let config = arm();
        assert!((0..config.buses.len()).all(|bus| BusClaim::of(&config, bus).is_none()));
        Ownership::of(&config, IfOwned::Refuse).unwrap();
    }

    #[test]
    fn an_interface_that_does_not_exist_is_named_with_its_bus() {
        let mut config = arm();
        config.buses[1].interface = Interface::SocketCan("takt-none".to_owned());
        let error = Ownership::of(&config, IfOwned::TakeOver).unwrap_err().to_string();
        assert!(error.starts_with("bus `wrist`: there is no interface takt-none"), "{error}");
    }
}
