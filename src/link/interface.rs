//! A CAN network interface of Linux: its state and bit timing, read and set over netlink.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use socketcan::nl::{CanBitTiming, CanCtrlModes, CanState, InterfaceDetails, Mtu};
use socketcan::{CanCtrlMode, CanInterface, InterfaceCanParams};
use takt_rt::BusState;
use thiserror::Error;

use crate::config::Bus;

/// The hardware type of CAN interfaces (`ARPHRD_CAN`), as `/sys/class/net/NAME/type` gives it.
const CAN_HARDWARE_TYPE: &str = "280";

/// The length to which the queue of an interface is to be set (`txqueuelen`): as many frames as takt hands to an interface at once, at most.
/// A shorter queue can be full on a healthy bus; from a much longer one, set-points leave late.
pub const QUEUE_FRAMES: u32 = 64;

/// The bit rates of a bus, and how its controller recovers from bus-off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InterfaceSettings {
    /// Bit/s of classic frames and of the arbitration phase.
    pub bit_rate: u32,
    /// Bit/s of the data phase of CAN FD frames; `None` for a classic bus.
    pub data_bit_rate: Option<u32>,
    /// The time in milliseconds after which the kernel restarts a controller that is bus-off; 0 means never.
    pub restart_ms: u32,
}

impl InterfaceSettings {
    /// Those of a bus of a configuration.
    pub const fn of(bus: &Bus) -> Self {
        Self { bit_rate: bus.bit_rate, data_bit_rate: bus.data_bit_rate, restart_ms: bus.restart_ms }
    }
}

/// The properties and the present state of an interface.
#[derive(Clone, Debug, PartialEq)]
pub struct InterfaceStatus {
    /// The name of the interface.
    pub name: String,
    /// True if it is up.
    pub is_up: bool,
    /// True if it carries CAN FD frames.
    pub has_fd: bool,
    /// The bit timing of its controller; `None` for a virtual interface, which has none, and for a controller
    /// that was never configured.
    pub timing: Option<ControllerTiming>,
    /// The bit timing of the data phase of CAN FD frames.
    pub data_timing: Option<ControllerTiming>,
    /// The time in milliseconds after which the kernel restarts the controller after bus-off; 0 means never. `None`
    /// for a virtual interface.
    pub restart_ms: Option<u32>,
    /// The controller's state.
    pub state: BusState,
    /// The controller's transmit and receive error counters, where the driver reports them.
    pub error_counters: Option<(u16, u16)>,
    /// True if the interface has a CAN controller; vcan, vxcan and slcan have none.
    pub has_controller: bool,
    /// The modes of its controller in which no drive can be commanded.
    pub unfit_modes: Vec<UnfitMode>,
}

/// A mode of a controller in which no drive can be commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnfitMode {
    /// Sends nothing, not even acknowledgements.
    ListenOnly,
    /// Receives its own frames, and need not send them.
    Loopback,
    /// Sends a frame once, even if it loses arbitration or is not acknowledged.
    OneShot,
}

impl UnfitMode {
    const ALL: [Self; 3] = [Self::ListenOnly, Self::Loopback, Self::OneShot];

    const fn mode(self) -> CanCtrlMode {
        match self {
            Self::ListenOnly => CanCtrlMode::ListenOnly,
            Self::Loopback => CanCtrlMode::Loopback,
            Self::OneShot => CanCtrlMode::OneShot,
        }
    }

    /// Its name in the commands of `ip link`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ListenOnly => "listen-only",
            Self::Loopback => "loopback",
            Self::OneShot => "one-shot",
        }
    }

    /// The reason why no drive can be commanded.
    const fn effect(self) -> &'static str {
        match self {
            Self::ListenOnly => "it sends nothing",
            Self::Loopback => "its frames need not reach the bus",
            Self::OneShot => "a frame that loses arbitration is not sent again",
        }
    }
}

/// The bit timing in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerTiming {
    /// Bit/s.
    pub bit_rate: u32,
    /// The sample point as a part of the bit time, 0 to 1.
    pub sample_point: f64,
}

/// Why an interface cannot be used. The message ends with the command that repairs it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum InterfaceError {
    /// No interface has this name.
    #[error(
        "there is no interface {name}; `ip -brief link` lists all interfaces (for a virtual one: sudo ip link add dev {name} type vcan)"
    )]
    Missing {
        /// The name asked for.
        name: String,
    },
    /// The interface belongs to another kind of network.
    #[error("{name} is not a CAN interface")]
    NotCan {
        /// The name asked for.
        name: String,
    },
    /// The interface is up at another bit rate. takt does not stop a bus that other programs may be using.
    #[error(
        "{name} runs at {found} bit/s and {wanted} are configured; to change it: sudo ip link set {name} down && {command}"
    )]
    BitRateDiffers {
        /// The interface.
        name: String,
        /// Bit/s in force.
        found: u32,
        /// Bit/s asked for.
        wanted: u32,
        /// The command that sets it up, once it is down.
        command: String,
    },
    /// The data phase of CAN FD frames is at another bit rate.
    #[error(
        "{name} runs at {found} bit/s in the data phase and {wanted} are configured; to change it: sudo ip link set {name} down && {command}"
    )]
    DataBitRateDiffers {
        /// The interface.
        name: String,
        /// Bit/s in force.
        found: u32,
        /// Bit/s asked for.
        wanted: u32,
        /// The command that sets it up, once it is down.
        command: String,
    },
    /// CAN FD frames are configured, and the interface does not carry them.
    #[error("{name} does not carry CAN FD frames; to change it: sudo ip link set {name} down && {command}")]
    NoFd {
        /// The interface.
        name: String,
        /// The command that sets it up, once it is down.
        command: String,
    },
    /// The controller is in a mode in which no drive can be commanded.
    #[error(
        "{name} is in {} mode: {}; to end it: sudo ip link set {name} down && {command}", mode.name(), mode.effect()
    )]
    UnfitMode {
        /// The interface.
        name: String,
        /// The mode.
        mode: UnfitMode,
        /// The command that sets it up, once it is down.
        command: String,
    },
    /// The controller is bus-off, and no automatic restart is configured.
    #[error(
        "{name} is bus-off and never restarts by itself; after the cause is found: sudo ip link set {name} type can restart"
    )]
    IsOff {
        /// The interface.
        name: String,
    },
    /// This process may not configure it.
    #[error("{name} is down and this process may not bring it up; to do so: {command}")]
    NotPermitted {
        /// The interface.
        name: String,
        /// The command that brings it up.
        command: String,
    },
    /// Nothing can be heard on it.
    #[error(
        "{name} is down: nothing can be heard on it; to bring it up: sudo ip link set {name} up type can bitrate 1000000"
    )]
    Down {
        /// The interface.
        name: String,
    },
    /// The kernel refused for another reason.
    #[error("{name}: {action}: {reason}")]
    System {
        /// The interface.
        name: String,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        reason: String,
    },
}

/// The index that the kernel has given to an interface. No other interface gets it, not even a later one.
pub(super) fn interface_index(name: &str) -> Result<u32, InterfaceError> {
    let folder = can_folder(name)?;
    let read = fs::read_to_string(folder.join("ifindex"));
    let index = read.and_then(|text| text.trim().parse().map_err(io::Error::other));
    index.map_err(|error| system(name, "reading its index", &error.into()))
}

/// How many frames the queue of an interface holds (`txqueuelen`); `None` where that cannot be read.
pub fn transmit_queue_length(name: &str) -> Option<u32> {
    let read = fs::read_to_string(can_folder(name).ok()?.join("tx_queue_len"));
    read.ok()?.trim().parse().ok()
}

/// Reads the properties and the state of an interface. Every user may do so.
pub fn interface_status(name: &str) -> Result<InterfaceStatus, InterfaceError> {
    let details = open(name)?.details().map_err(|error| system(name, "reading its state", &error))?;
    Ok(status_of(name, &details))
}

/// Brings an interface up with these settings and returns its state. An interface that is up already is only compared
/// with the settings: another program may be using it.
pub fn prepare_interface(
    name: &str,
    settings: &InterfaceSettings,
) -> Result<InterfaceStatus, InterfaceError> {
    let status = interface_status(name)?;
    if status.is_up {
        compare(&status, settings)?;
        return Ok(status);
    }
    let interface = open(name)?;
    let is_controller = status.has_controller;
    let may_configure = this_process_may_configure();
    let refused = |action, error: &socketcan::Error| {
        let command = command(&status, settings);
        refusal(name, action, command, error, may_configure)
    };
    if is_controller {
        interface
            .set_can_params(&parameters(settings, &status.unfit_modes))
            .map_err(|error| refused("setting the bit rate", &error))?;
    } else if settings.data_bit_rate.is_some() {
        interface.set_mtu(Mtu::Fd).map_err(|error| refused("allowing CAN FD frames", &error))?;
    }
    interface.bring_up().map_err(|error| refused("bringing it up", &error))?;
    let status = interface_status(name)?;
    compare(&status, settings)?;
    Ok(status)
}

fn open(name: &str) -> Result<CanInterface, InterfaceError> {
    can_folder(name)?;
    CanInterface::open(name).map_err(|error| system(name, "opening it", &error))
}

/// The folder in which the kernel describes a CAN interface.
fn can_folder(name: &str) -> Result<PathBuf, InterfaceError> {
    let folder = Path::new("/sys/class/net").join(name);
    // No interface has a slash in its name; with one, the path would lead to another folder.
    if name.is_empty() || name.contains('/') || !folder.exists() {
        return Err(InterfaceError::Missing { name: name.into() });
    }
    let kind = fs::read_to_string(folder.join("type")).unwrap_or_default();
    if kind.trim() != CAN_HARDWARE_TYPE {
        return Err(InterfaceError::NotCan { name: name.into() });
    }
    Ok(folder)
}

fn status_of(name: &str, details: &InterfaceDetails) -> InterfaceStatus {
    let can = &details.can;
    let has_controller = can.clock.is_some();
    let state = match can.state {
        _ if !details.is_up => BusState::Down,
        Some(CanState::ErrorPassive) => BusState::ErrorPassive,
        Some(CanState::BusOff) => BusState::BusOff,
        Some(CanState::Stopped | CanState::Sleeping) => BusState::Down,
        Some(CanState::ErrorActive | CanState::ErrorWarning) | None => BusState::ErrorActive,
    };
    InterfaceStatus {
        name: name.into(),
        is_up: details.is_up,
        has_fd: details.mtu == Some(Mtu::Fd),
        timing: can.bit_timing.and_then(timing_of),
        data_timing: can.data_bit_timing.and_then(timing_of),
        restart_ms: can.restart_ms.filter(|_| has_controller),
        state,
        error_counters: can.berr_counter.map(|counter| (counter.txerr, counter.rxerr)),
        has_controller,
        unfit_modes: UnfitMode::ALL
            .into_iter()
            .filter(|unfit| can.ctrl_mode.is_some_and(|modes| modes.has_mode(unfit.mode())))
            .collect(),
    }
}

/// A controller that was never configured has a bit rate of zero. The kernel gives the sample point in thousandths.
fn timing_of(timing: CanBitTiming) -> Option<ControllerTiming> {
    (timing.bitrate != 0).then(|| ControllerTiming {
        bit_rate: timing.bitrate,
        sample_point: f64::from(timing.sample_point) / 1_000.0,
    })
}

/// The kernel chooses the sample point as CiA recommends (75 % above 800 kbit/s, 80 % above 500 kbit/s, else 87.5 %),
/// or as near to it as the controller's clock allows. Modes are kept while an interface is down, unless they are set anew.
fn parameters(settings: &InterfaceSettings, unfit_modes: &[UnfitMode]) -> InterfaceCanParams {
    let fd = settings.data_bit_rate.map(|_| (CanCtrlMode::Fd, true));
    let changed = unfit_modes.iter().map(|unfit| (unfit.mode(), false)).chain(fd);
    let timing = |bitrate| CanBitTiming { bitrate, ..CanBitTiming::default() };
    InterfaceCanParams {
        bit_timing: Some(timing(settings.bit_rate)),
        data_bit_timing: settings.data_bit_rate.map(timing),
        ctrl_mode: changed.fold(None, |modes, (mode, is_on)| {
            let mut modes = modes.unwrap_or_default();
            CanCtrlModes::add(&mut modes, mode, is_on);
            Some(modes)
        }),
        restart_ms: Some(settings.restart_ms),
        ..InterfaceCanParams::default()
    }
}

/// The command after which the kernel restarts the controller of an interface as a bus of a configuration wants it; `None` if it does so,
/// or the interface is not up: takt brings it up with the setting.
pub fn restart_command(name: &str, bus: &Bus) -> Option<String> {
    missing_restart(&interface_status(name).ok()?, &InterfaceSettings::of(bus))
}

fn missing_restart(status: &InterfaceStatus, settings: &InterfaceSettings) -> Option<String> {
    let is_missing = status.is_up && status.restart_ms == Some(0) && settings.restart_ms > 0;
    // The kernel does not change the time of an interface that is up.
    is_missing.then(|| format!("sudo ip link set {} down && {}", status.name, command(status, settings)))
}

/// Compares an interface that is up with the settings. A virtual interface has no bit rate and accepts any.
fn compare(status: &InterfaceStatus, settings: &InterfaceSettings) -> Result<(), InterfaceError> {
    if status.state == BusState::BusOff && status.restart_ms == Some(0) {
        return Err(InterfaceError::IsOff { name: status.name.clone() });
    }
    if let Some(mode) = status.unfit_modes.first().copied() {
        let command = command(status, settings);
        return Err(InterfaceError::UnfitMode { name: status.name.clone(), mode, command });
    }
    let differs = |timing: Option<ControllerTiming>, wanted: Option<u32>| {
        Some((timing?.bit_rate, wanted?)).filter(|(found, wanted)| found != wanted)
    };
    let (name, command) = (|| status.name.clone(), || command(status, settings));
    if let Some((found, wanted)) = differs(status.timing, Some(settings.bit_rate)) {
        return Err(InterfaceError::BitRateDiffers { name: name(), found, wanted, command: command() });
    }
    if let Some((found, wanted)) = differs(status.data_timing, settings.data_bit_rate) {
        return Err(InterfaceError::DataBitRateDiffers { name: name(), found, wanted, command: command() });
    }
    if settings.data_bit_rate.is_some() && !status.has_fd {
        return Err(InterfaceError::NoFd { name: name(), command: command() });
    }
    Ok(())
}

/// The command that brings the interface up with these settings.
fn command(status: &InterfaceStatus, settings: &InterfaceSettings) -> String {
    let name = &status.name;
    match (status.has_controller, settings.data_bit_rate) {
        (false, None) => format!("sudo ip link set {name} up"),
        (false, Some(_)) => format!("sudo ip link set {name} mtu 72 up"),
        (true, data_bit_rate) => {
            let data = data_bit_rate.map(|rate| format!(" dbitrate {rate} fd on")).unwrap_or_default();
            let unfit = status.unfit_modes.iter();
            let modes: String = unfit.map(|mode| format!(" {} off", mode.name())).collect();
            let InterfaceSettings { bit_rate, restart_ms, .. } = settings;
            format!(
                "sudo ip link set {name} up type can bitrate {bit_rate}{data} restart-ms {restart_ms}{modes}"
            )
        }
    }
}

/// Why an interface was not brought up. The netlink library reports a refusal of the kernel as a missing acknowledgement,
/// without the reason. So the reason is taken from the capabilities of this process.
fn refusal(
    name: &str,
    action: &'static str,
    command: String,
    error: &socketcan::Error,
    may_configure: bool,
) -> InterfaceError {
    if permission_error(error) || !may_configure {
        return InterfaceError::NotPermitted { name: name.into(), command };
    }
    let reason = format!("{error}; to see the kernel's reason: {command}");
    InterfaceError::System { name: name.into(), action, reason }
}

/// CAP_NET_ADMIN, as a bit of the sets of capabilities.
const NET_ADMIN: u32 = 12;

/// Returns `true` if this process may configure interfaces.
pub(super) fn this_process_may_configure() -> bool {
    may_configure(&fs::read_to_string("/proc/self/status").unwrap_or_default())
}

/// Returns `true` if a process may configure interfaces, as the kernel's status of it says.
fn may_configure(status: &str) -> bool {
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let mask = effective.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> NET_ADMIN & 1 == 1)
}

fn permission_error(error: &socketcan::Error) -> bool {
    let kind = match error {
        socketcan::Error::Io(error) => Some(error.kind()),
        socketcan::Error::Nl(error) => error.io_kind(),
        socketcan::Error::Can(_) => None,
    };
    kind == Some(io::ErrorKind::PermissionDenied)
}

fn system(name: &str, action: &'static str, error: &socketcan::Error) -> InterfaceError {
    InterfaceError::System { name: name.into(), action, reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn up(timing: Option<u32>) -> InterfaceStatus {
        let timing = timing.map(|bit_rate| ControllerTiming { bit_rate, sample_point: 0.875 });
        InterfaceStatus {
            name: "can0".into(),
            is_up: true,
            has_fd: false,
            timing,
            data_timing: None,
            restart_ms: timing.map(|_| 100),
            state: BusState::ErrorActive,
            error_counters: None,
            has_controller: timing.is_some(),
            unfit_modes: vec![],
        }
    }

    #[test]
    fn a_controller_that_stays_off_the_bus_where_the_configuration_wants_a_restart_is_found() {
        let never = InterfaceStatus { restart_ms: Some(0), ..up(Some(1_000_000)) };
        let command =
            "sudo ip link set can0 down && sudo ip link set can0 up type can bitrate 1000000 restart-ms 100";
        assert_eq!(missing_restart(&never, &CLASSIC).as_deref(), Some(command));
        let as_configured = InterfaceSettings { restart_ms: 0, ..CLASSIC };
        assert_eq!(missing_restart(&never, &as_configured), None);
        for other in [
            InterfaceStatus { is_up: false, ..never.clone() },
            InterfaceStatus { restart_ms: Some(250), ..never.clone() },
            up(None),
        ] {
            assert_eq!(missing_restart(&other, &CLASSIC), None);
        }
    }

    const CLASSIC: InterfaceSettings =
        InterfaceSettings { bit_rate: 1_000_000, data_bit_rate: None, restart_ms: 100 };
    const FLEXIBLE: InterfaceSettings = InterfaceSettings { data_bit_rate: Some(5_000_000), ..CLASSIC };

    #[test]
    fn a_missing_interface_and_one_that_is_no_can_are_told_apart() {
        for name in ["takt-none", "", "..", "../lo"] {
            let error = interface_status(name).unwrap_err();
            assert!(
                matches!(error, InterfaceError::Missing { .. } | InterfaceError::NotCan { .. }),
                "{error}"
            );
        }
        assert!(matches!(interface_status("lo"), Err(InterfaceError::NotCan { .. })));
        let text = interface_status("vcan9").unwrap_err().to_string();
        assert!(text.contains("sudo ip link add dev vcan9 type vcan"), "{text}");
    }

    #[test]
    fn a_running_bus_at_another_bit_rate_is_refused_with_the_command_that_changes_it() {
        let text = compare(&up(Some(500_000)), &CLASSIC).unwrap_err().to_string();
        assert!(text.contains("runs at 500000 bit/s and 1000000 are configured"), "{text}");
        let command =
            "sudo ip link set can0 down && sudo ip link set can0 up type can bitrate 1000000 restart-ms 100";
        assert!(text.ends_with(command), "{text}");
        assert!(compare(&up(Some(1_000_000)), &CLASSIC).is_ok());
        let slow = Some(ControllerTiming { bit_rate: 2_000_000, sample_point: 0.75 });
        let data_phase = InterfaceStatus { has_fd: true, data_timing: slow, ..up(Some(1_000_000)) };
        let text = compare(&data_phase, &FLEXIBLE).unwrap_err().to_string();
        assert!(
            text.contains("runs at 2000000 bit/s in the data phase and 5000000 are configured"),
            "{text}"
        );
        assert!(text.contains("dbitrate 5000000 fd on"), "{text}");
    }

    #[test]
    fn a_controller_in_a_mode_in_which_it_commands_nothing_is_refused_with_the_command_that_ends_it() {
        let in_modes = |unfit_modes| InterfaceStatus { unfit_modes, ..up(Some(1_000_000)) };
        for (mode, words) in [
            (UnfitMode::ListenOnly, "can0 is in listen-only mode: it sends nothing; to end it: "),
            (UnfitMode::Loopback, "can0 is in loopback mode: its frames need not reach the bus; to end it: "),
            (
                UnfitMode::OneShot,
                "can0 is in one-shot mode: a frame that loses arbitration is not sent again; to end it: ",
            ),
        ] {
            let text = compare(&in_modes(vec![mode]), &CLASSIC).unwrap_err().to_string();
            let command = "sudo ip link set can0 down && sudo ip link set can0 up type can bitrate 1000000 restart-ms 100";
            assert_eq!(text, format!("{words}{command} {} off", mode.name()));
        }
        let both = in_modes(vec![UnfitMode::Loopback, UnfitMode::OneShot]);
        assert!(command(&both, &CLASSIC).ends_with("restart-ms 100 loopback off one-shot off"));
        // A bit rate that differs is set by the same command.
        let slow = InterfaceSettings { bit_rate: 500_000, ..CLASSIC };
        assert!(matches!(compare(&both, &slow), Err(InterfaceError::UnfitMode { .. })));
    }

    #[test]
    fn the_modes_of_a_controller_are_read_and_set_anew_when_it_is_brought_up() {
        let details = |flags| {
            let can =
                InterfaceCanParams { ctrl_mode: Some(CanCtrlModes::new(!0, flags)), ..Default::default() };
            InterfaceDetails { can, ..InterfaceDetails::default() }
        };
        let flags = |modes: &[CanCtrlMode]| modes.iter().fold(0, |flags, mode| flags | mode.mask());
        let read = |modes: &[CanCtrlMode]| status_of("can0", &details(flags(modes))).unfit_modes;
        assert_eq!(read(&[CanCtrlMode::Fd, CanCtrlMode::BerrReporting, CanCtrlMode::TripleSampling]), []);
        let unfit = read(&[CanCtrlMode::OneShot, CanCtrlMode::ListenOnly, CanCtrlMode::Loopback]);
        assert_eq!(unfit, UnfitMode::ALL);

        // The library does not show the mask otherwise.
        let set = |settings: &InterfaceSettings, unfit: &[UnfitMode]| {
            format!("{:?}", parameters(settings, unfit).ctrl_mode)
        };
        let of = |mask, flags| format!("{:?}", Some(CanCtrlModes::new(mask, flags)));
        let (fd, one_shot) = (CanCtrlMode::Fd.mask(), CanCtrlMode::OneShot.mask());
        assert_eq!(set(&CLASSIC, &[]), "None");
        assert_eq!(set(&FLEXIBLE, &[]), of(fd, fd));
        assert_eq!(set(&CLASSIC, &[UnfitMode::OneShot]), of(one_shot, 0));
        assert_eq!(set(&FLEXIBLE, &[UnfitMode::OneShot]), of(fd | one_shot, fd));
    }

    #[test]
    fn a_controller_that_is_off_the_bus_for_good_is_refused_with_the_command_that_restarts_it() {
        let off = InterfaceStatus { state: BusState::BusOff, restart_ms: Some(0), ..up(Some(1_000_000)) };
        let text = compare(&off, &CLASSIC).unwrap_err().to_string();
        assert!(text.ends_with("sudo ip link set can0 type can restart"), "{text}");
        assert!(compare(&InterfaceStatus { restart_ms: Some(100), ..off }, &CLASSIC).is_ok());
    }

    #[test]
    fn an_interface_that_is_down_is_answered_with_the_command_that_brings_it_up() {
        let down = InterfaceStatus { is_up: false, ..up(Some(1_000_000)) };
        let no_reason = socketcan::Error::Nl(socketcan::nl::NlError::NoAck);
        let text = |may_configure| {
            refusal("can0", "bringing it up", command(&down, &CLASSIC), &no_reason, may_configure).to_string()
        };
        let command = "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100";
        let ordinary = format!("can0 is down and this process may not bring it up; to do so: {command}");
        assert_eq!(text(false), ordinary);
        assert!(text(true).ends_with(&format!("to see the kernel's reason: {command}")), "{}", text(true));
    }

    #[test]
    fn the_right_to_configure_interfaces_is_seen_in_the_status_of_the_process() {
        assert!(may_configure("CapPrm:\t0000000000000000\nCapEff:\t0000000000001000\n"));
        assert!(may_configure("CapEff:\t000001ffffffffff\n"));
        assert!(!may_configure("CapPrm:\t0000000000001000\nCapEff:\t0000000000000000\n"));
        assert!(!may_configure(""));
    }

    #[test]
    fn a_virtual_interface_takes_any_bit_rate_and_needs_room_for_fd_frames() {
        assert!(compare(&up(None), &CLASSIC).is_ok());
        let text = compare(&up(None), &FLEXIBLE).unwrap_err().to_string();
        assert!(text.ends_with("sudo ip link set can0 mtu 72 up"), "{text}");
        assert!(compare(&InterfaceStatus { has_fd: true, ..up(None) }, &FLEXIBLE).is_ok());
    }

    #[test]
    fn the_command_for_a_flexible_bus_names_both_rates() {
        let text = command(&up(Some(1)), &FLEXIBLE);
        assert_eq!(
            text,
            "sudo ip link set can0 up type can bitrate 1000000 dbitrate 5000000 fd on restart-ms 100"
        );
    }
}
