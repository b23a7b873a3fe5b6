//! The scan of buses and lines in virtual time, against the simulated drives of every family.

use takt::family::scan::{
    Answered, BusScan, FoundDevice, LineScan, PlaceOfScan, Scanned, scan_line, starting_configuration,
};
use takt::rt::{BusHealth, BusPort, BusState, Clock, Frame, Id, ReceiveBatch, Received};
use takt::sim::lss::{LssBus, LssDevice};
use takt::sim::{DevicesOnLine, SimulatedBus};
use takt::{Config, VirtualClock};
use takt_tools::commission::bus_scan;
use takt_tools::commission::bus_session::SessionEvent;
use takt_wire::canopen::sdo::{SdoRequest, SdoResponse};

const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;

const BUS: &str = "name = \"test\"\n[cycle]\nperiod = \"2 ms\"\n[[bus]]\nname = \"can\"\n[defaults.axis]\nbus = \"can\"\nlimits = { position = [\"-170 deg\", \
                   \"170 deg\"], velocity = \"60 deg/s\", acceleration = \"120 deg/s^2\", torque = \"1 Nm\" }\n";

/// A bus with an axis for each of these lines.
fn bus(axes: &[&str]) -> SimulatedBus {
    let axes = axes.iter().enumerate();
    let axes =
        axes.map(|(at, keys)| format!("[[axis]]\nname = \"joint{at}\"\n{}\n", keys.replace("; ", "\n")));
    let text = format!("{BUS}{}", axes.collect::<String>());
    let path = format!("{}/tests/scan.toml", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let config = Config::parse(&path, &text).unwrap_or_else(|error| panic!("{error:?}"));
    takt::simulated_bus(&config, 0)
}

fn usual() -> BusScan {
    BusScan {
        nodes: 1..=64,
        wait_ns: 100 * MS,
        listening_ns: 1_200 * MS,
        only_listens: false,
        may_take_torque: false,
        has_fd: false,
        of_controller: None,
    }
}

/// What was found, and the frames that were sent.
struct Outcome {
    found: Scanned,
    sent: Vec<Frame>,
    duration_ns: u64,
}

impl Outcome {
    #[track_caller]
    fn node(&self, node: u8) -> &FoundDevice {
        let mut own = self.found.devices.iter().filter(|device| device.node == Some(node));
        let device = own.next().unwrap_or_else(|| panic!("no node {node}: {:#?}", self.found));
        assert_eq!(own.next(), None, "node {node} is found once");
        device
    }

    fn nodes(&self) -> Vec<Option<u8>> {
        self.found.devices.iter().map(|device| device.node).collect()
    }
}

fn scan(what: &BusScan, port: &mut impl BusPort) -> Outcome {
    scan_until(what, port, |_| false)
}

/// `is_interrupted` is asked with the time.
fn scan_until(what: &BusScan, port: &mut impl BusPort, is_interrupted: impl Fn(u64) -> bool) -> Outcome {
    let mut clock = VirtualClock::default();
    // Every drive has booted by then.
    for tick in 0..6_000 {
        clock.wait_until(tick * MS / 2);
        port.receive(tick * MS / 2, &mut ReceiveBatch::new());
    }
    scan_at(what, port, &mut clock, is_interrupted)
}

fn scan_at(
    what: &BusScan,
    port: &mut impl BusPort,
    clock: &mut VirtualClock,
    is_interrupted: impl Fn(u64) -> bool,
) -> Outcome {
    let mut sent = vec![];
    let time_ns = std::cell::Cell::new(0);
    let mut is_told = false;
    let mut interrupted = || {
        let is_now = !is_told && is_interrupted(time_ns.get());
        is_told |= is_now;
        time_ns.set(time_ns.get() + MS / 2);
        is_now
    };
    let mut duration_ns = 0;
    let found = bus_scan::scan(what, true, port, clock, &mut interrupted, &mut |at_ns, event| {
        duration_ns = duration_ns.max(at_ns);
        if let SessionEvent::Sent(frame) = event {
            sent.push(frame);
        }
    });
    Outcome { found, sent, duration_ns }
}

/// No NMT command, no SDO download, no process data, no SYNC, no stop command: nothing but reads, and LSS.
#[track_caller]
fn only_reads(sent: &[Frame]) {
    for frame in sent {
        let id = frame.id().value();
        let is_sdo_upload = matches!(
            SdoRequest::decode(frame),
            Some((
                _,
                SdoRequest::Upload { .. } | SdoRequest::UploadSegment { .. } | SdoRequest::Abort { .. }
            ))
        );
        let is_own_read = (0x641..=0x67F).contains(&id) && [2, 4].contains(&frame.payload().len());
        let is_register_read = id == 0x7FF && frame.payload().get(1..3) == Some(&[0, 0x33]);
        assert!(is_sdo_upload || is_own_read || is_register_read || id == 0x7E5, "{frame:?}");
    }
}

/// Passes everything on, and changes it on the way.
struct Through<P, F> {
    bus: P,
    change: F,
    health: Option<BusHealth>,
}

impl<P: BusPort, F: FnMut(u64, &mut ReceiveBatch)> BusPort for Through<P, F> {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.bus.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.bus.receive(now_ns, batch);
        (self.change)(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.bus.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.health.unwrap_or_else(|| self.bus.health())
    }
}

/// Buses that are one for their master.
struct Joined(Vec<SimulatedBus>);

impl BusPort for Joined {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.0.iter_mut().map(|bus| bus.send(now_ns, frames)).min().unwrap_or(0)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.0.iter_mut().for_each(|bus| bus.receive(now_ns, batch));
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.0.iter_mut().map(|bus| bus.unconfirmed(now_ns)).max().unwrap_or(0)
    }

    fn health(&mut self) -> BusHealth {
        self.0[0].health()
    }
}

/// Devices that the test plays: what they answer to a frame.
struct Played<F> {
    answer: F,
    waiting: Vec<Frame>,
}

fn played<F: FnMut(&Frame) -> Vec<Frame>>(answer: F) -> Played<F> {
    Played { answer, waiting: vec![] }
}

impl<F: FnMut(&Frame) -> Vec<Frame>> BusPort for Played<F> {
    fn send(&mut self, _: u64, frames: &[Frame]) -> usize {
        for frame in frames {
            self.waiting.extend((self.answer)(frame));
        }
        frames.len()
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        for frame in self.waiting.drain(..) {
            let _ = batch.try_push(Received { frame, at_ns: now_ns });
        }
    }

    fn unconfirmed(&mut self, _: u64) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        BusHealth { tx_frames: 1, ..BusHealth::default() }
    }
}

const EROB: &str = "node = 1; drive = \"erob-canopen\"";
const YZ_AIM: &str = "node = 7; drive = \"yz-aim\"";
const BY_SHEET: &str =
    "node = 12; drive = \"cia402\"; eds = \"eds/vendors/maxon-epos4.eds\"; counts_per_turn = 65536";
const OWN: &str = "node = 20; drive = \"erob-can\"";

/// Drives of four families. No configuration has them on one bus: their cycles differ.
fn mixed() -> Joined {
    Joined([EROB, YZ_AIM, BY_SHEET, OWN].map(|axis| bus(&[axis])).into())
}

#[test]
fn a_mixed_bus_is_told_apart_with_reads_alone() {
    let mut bus = mixed();
    let outcome = scan(&usual(), &mut bus);
    only_reads(&outcome.sent);
    assert_eq!(outcome.nodes(), [1, 7, 12, 20].map(Some), "{:#?}", outcome.found);
    assert!(!outcome.found.is_interrupted && outcome.found.remarks.is_empty(), "{:#?}", outcome.found);
    let erob = outcome.node(1);
    assert_eq!((erob.answered, erob.drive), (Answered::Sdo, Some("erob-canopen")));
    assert_eq!((erob.kind.as_str(), erob.vendor.as_deref()), ("servo drive (CiA 402)", Some("ZeroErr")));
    let yz_aim = outcome.node(7);
    assert_eq!((yz_aim.answered, yz_aim.drive), (Answered::Sdo, Some("yz-aim")));
    let by_sheet = outcome.node(12);
    assert_eq!((by_sheet.answered, by_sheet.drive), (Answered::Sdo, Some("cia402")));
    assert_eq!(by_sheet.identity.unwrap().vendor, Some(0xFB));
    let own = outcome.node(20);
    assert_eq!((own.answered, own.drive), (Answered::Own("eRob's own protocol"), Some("erob-can")));
    assert!(own.firmware.is_some() && own.product.as_deref().unwrap().starts_with("eRob"), "{own:#?}");
    assert!(own.serial.is_some() && own.remarks.is_empty(), "{own:#?}");
    assert!(outcome.duration_ns < 4 * SECOND, "{} ms", outcome.duration_ns / MS);
}

#[test]
fn two_devices_with_the_same_node_id_are_told_in_both_protocols() {
    let mut twins = Joined([EROB, EROB, OWN, OWN, YZ_AIM].map(|axis| bus(&[axis])).into());
    let outcome = scan(&usual(), &mut twins);
    let is_double = |node| outcome.node(node).remarks.iter().any(|remark| remark.contains("two devices"));
    assert_eq!([1, 7, 20].map(is_double), [true, false, true], "{:#?}", outcome.found);
}

#[test]
fn a_silent_bus_has_nothing_and_a_scan_of_it_ends() {
    let outcome = scan(&usual(), &mut played(|_| vec![]));
    assert!(outcome.found.devices.is_empty() && outcome.found.remarks.is_empty(), "{:#?}", outcome.found);
    assert!(outcome.duration_ns < 2_500 * MS, "{} ms", outcome.duration_ns / MS);
    only_reads(&outcome.sent);
}

#[test]
fn an_interface_that_is_off_the_bus_or_acknowledged_by_nobody_is_said() {
    for (state, words) in [
        (BusState::BusOff, "off the bus"),
        (BusState::ErrorPassive, "nobody acknowledges"),
        (BusState::Down, "went down"),
    ] {
        let health = Some(BusHealth { state, ..BusHealth::default() });
        let mut port = Through { bus: played(|_| vec![]), change: |_, _: &mut ReceiveBatch| {}, health };
        let outcome = scan(&usual(), &mut port);
        assert!(outcome.found.remarks.iter().any(|remark| remark.contains(words)), "{:?}", outcome.found);
        assert_eq!(outcome.found.bus_state, state);
        assert!(outcome.sent.iter().all(|frame| frame.id().value() != 0x7E5), "no search on a dead bus");
    }
}

#[test]
fn a_device_that_floods_the_bus_is_named_and_the_others_are_found_all_the_same() {
    let babble = Frame::of(Id::base(0x0A3).unwrap(), [0xAA; 3]);
    let change = |now_ns, batch: &mut ReceiveBatch| {
        for _ in 0..5 {
            let _ = batch.try_push(Received { frame: babble, at_ns: now_ns });
        }
    };
    let mut port = Through { bus: mixed(), change, health: None };
    let outcome = scan(&usual(), &mut port);
    let remarks = outcome.found.remarks.join("; ");
    assert!(remarks.contains("flooded") && remarks.contains("0A3"), "{remarks}");
    assert_eq!(outcome.nodes(), [1, 7, 12, 20].map(Some), "{:#?}", outcome.found);
}

#[test]
fn a_node_whose_sdo_server_aborts_everything_is_there() {
    let refuse = |frame: &Frame| match SdoRequest::decode(frame) {
        Some((5, SdoRequest::Upload { object })) => {
            let abort = takt_wire::canopen::sdo::AbortCode::from_number(0x0800_0000);
            vec![SdoResponse::Abort { object, code: abort }.frame(5)]
        }
        _ => vec![],
    };
    let outcome = scan(&usual(), &mut played(refuse));
    let device = outcome.node(5);
    assert_eq!((device.answered, device.drive), (Answered::Sdo, None));
    assert!(device.remarks[0].contains("1000") && device.remarks[0].contains("abort"), "{device:#?}");
    assert_eq!(outcome.nodes(), [Some(5)]);
}

#[test]
fn a_node_that_only_sends_is_heard_with_its_state_also_beyond_the_range() {
    let mut at_ns = 0;
    let change = |now_ns: u64, batch: &mut ReceiveBatch| {
        if now_ns >= at_ns {
            at_ns = now_ns + 500 * MS;
            for (id, byte) in [(0x709, 0x04), (0x770, 0x05), (0x703, 0x00)] {
                let frame = Frame::of(Id::base(id).unwrap(), [byte]);
                let _ = batch.try_push(Received { frame, at_ns: now_ns });
            }
            let alarm = Frame::of(Id::base(0x083).unwrap(), [0x10, 0x43, 9, 0, 0, 0, 0, 0]);
            let _ = batch.try_push(Received { frame: alarm, at_ns: now_ns });
        }
    };
    let mut port = Through { bus: played(|_| vec![]), change, health: None };
    let outcome = scan(&usual(), &mut port);
    assert_eq!(outcome.nodes(), [3, 9, 0x70].map(Some));
    assert!(outcome.node(9).kind.contains("stopped") && outcome.node(9).remarks[0].contains("no SDO server"));
    assert!(outcome.node(0x70).kind.contains("operational"));
    let booting = outcome.node(3);
    assert!(booting.kind.contains("boot-up"), "{booting:#?}");
    assert!(booting.remarks.iter().any(|remark| remark.contains("restarted")), "{booting:#?}");
    assert!(booting.remarks.iter().any(|remark| remark.contains("temperature")), "{booting:#?}");
}

#[test]
fn whoever_only_listens_sends_nothing_and_hears_who_speaks() {
    let heartbeat = Frame::of(Id::base(0x702).unwrap(), [0x05]);
    let sync = Frame::of(Id::base(0x080).unwrap(), []);
    let change = |now_ns, batch: &mut ReceiveBatch| {
        for frame in [sync, heartbeat] {
            let _ = batch.try_push(Received { frame, at_ns: now_ns });
        }
    };
    let mut port = Through { bus: mixed(), change, health: None };
    let what = BusScan { only_listens: true, listening_ns: 3 * SECOND, ..usual() };
    let outcome = scan_at(&what, &mut port, &mut VirtualClock::default(), |_| false);
    assert!(outcome.sent.is_empty(), "{:?}", outcome.sent);
    // The drives were switched on when the scan began: they send boot-up messages.
    assert!(outcome.nodes().contains(&Some(2)) && outcome.nodes().contains(&Some(1)), "{:#?}", outcome.found);
    let remarks = outcome.found.remarks.join("; ");
    assert!(remarks.contains("a master is active"), "{remarks}");
}

#[test]
fn drives_that_boot_while_they_are_looked_for_are_found_all_the_same() {
    let what = BusScan { listening_ns: 3 * SECOND, ..usual() };
    let outcome = scan_at(&what, &mut mixed(), &mut VirtualClock::default(), |_| false);
    assert_eq!(outcome.nodes(), [1, 7, 12, 20].map(Some), "{:#?}", outcome.found);
    assert!(outcome.found.devices.iter().all(|device| device.drive.is_some()), "{:#?}", outcome.found);
}

#[test]
fn an_interrupted_scan_shows_what_it_had_found() {
    for end_ns in [20 * MS, 250 * MS, 400 * MS, 500 * MS] {
        let outcome = scan_until(&usual(), &mut mixed(), |now_ns| now_ns >= end_ns);
        assert!(outcome.found.is_interrupted, "{end_ns}");
        assert!(outcome.duration_ns < end_ns + 300 * MS, "{} ms", outcome.duration_ns / MS);
        only_reads(&outcome.sent);
        if end_ns == 500 * MS {
            assert!(outcome.nodes().contains(&Some(1)), "{:#?}", outcome.found);
        }
    }
}

#[test]
fn devices_without_a_node_id_are_found_by_lss() {
    let identities = [[0x331, 1, 0x100, 7], [0x331, 1, 0x100, 8]];
    let devices = identities
        .map(|values| LssDevice::new(takt_wire::canopen::lss::LssAddress::from_values(values), None));
    let mut bus = LssBus::new(devices);
    let outcome = scan(&usual(), &mut bus);
    let serials: Vec<_> = outcome.found.devices.iter().map(|device| device.serial.as_deref()).collect();
    assert_eq!(serials, [Some("7"), Some("8")], "{:#?}", outcome.found);
    assert!(outcome.found.devices[0].remarks[0].contains("0x331:0x1:0x100:0x7"), "{:#?}", outcome.found);
}

#[test]
fn a_drive_in_its_own_protocol_is_not_asked_under_the_sdo_identifiers_that_are_its_own_too() {
    let own = "node = 5; drive = \"erob-can\"";
    let far = "node = 70; drive = \"erob-canopen\"";
    let mut bus = Joined([own, far].map(|axis| bus(&[axis])).into());
    let outcome = scan(&BusScan { nodes: 1..=127, ..usual() }, &mut bus);
    assert_eq!(outcome.nodes(), [5, 70].map(Some), "{:#?}", outcome.found);
    let to_the_twin = outcome.sent.iter().filter(|frame| frame.id().value() == 0x645);
    assert!(
        to_the_twin.clone().all(|frame| frame.payload().len() < 8),
        "{:?}",
        to_the_twin.collect::<Vec<_>>()
    );
}

const MOTOR: &str = "node = 3; master_id = 0x65; drive = \"hollow-can\"; velocity_full_scale = \"58.6 rad/s\"; \
                     current_full_scale = 10; torque_constant = 0.23; position_full_scale = \"1 turn\"; kp = 2000; kd = 500";

#[test]
fn motors_that_answer_commands_alone_are_asked_only_with_consent_and_by_what_stops_them() {
    let outcome = scan(&usual(), &mut bus(&[MOTOR]));
    assert!(outcome.found.devices.is_empty(), "{:#?}", outcome.found);
    only_reads(&outcome.sent);
    let outcome = scan(&BusScan { may_take_torque: true, ..usual() }, &mut bus(&[MOTOR]));
    let motor = outcome.node(3);
    assert_eq!((motor.answered, motor.drive), (Answered::Own("motor commands on CAN"), Some("hollow-can")));
    assert!(motor.remarks.iter().any(|remark| remark.contains("0x065")), "{motor:#?}");
    for frame in outcome.sent.iter().filter(|frame| frame.id().value() < 0x80) {
        assert_eq!(
            frame.payload(),
            [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD],
            "stop, and nothing else"
        );
    }
}

#[test]
fn motors_on_can_fd_are_asked_only_where_the_bus_carries_it() {
    let fd_bus = || {
        let text = BUS.replace("name = \"can\"\n", "name = \"can\"\ndata_bit_rate = \"5 Mbit/s\"\n")
            + "[[axis]]\nname = \"leg\"\nnode = 4\nmaster_id = 0x66\ndrive = \"hollow-can-fd\"\npole_pairs = 14\nkp = 100\nkd = 20\n\
               torque_constant = 0.23\n";
        let config = Config::parse("fd.toml", &text).unwrap_or_else(|error| panic!("{error:?}"));
        takt::simulated_bus(&config, 0)
    };
    let with_consent = BusScan { may_take_torque: true, ..usual() };
    let outcome = scan(&with_consent, &mut fd_bus());
    assert!(outcome.found.devices.is_empty() && outcome.sent.iter().all(|frame| !frame.is_fd()));
    let outcome = scan(&BusScan { has_fd: true, ..with_consent }, &mut fd_bus());
    assert_eq!(outcome.node(4).drive, Some("hollow-can-fd"), "{:#?}", outcome.found);
}

fn damiao(node: u8, master_id: u16, mode: &str, keys: &str) -> String {
    format!(
        "node = {node}; master_id = {master_id}; drive = \"bit-fields\"; description = \"damiao-dm-{mode}\"; position_full_scale = 12.5; \
         velocity_full_scale = 30; torque_full_scale = 10{keys}"
    )
}

/// A Damiao motor of each mode.
fn three_modes() -> SimulatedBus {
    let mit = damiao(1, 0x11, "mit", "; kp = 60; kd = 1.5");
    let position = damiao(2, 0x7A, "position-velocity", "");
    let velocity = damiao(20, 0x314, "velocity", "");
    bus(&[&mit, &position, &velocity])
}

/// Returns `true` if a frame asks motors by the identifier that every one of them hears.
fn reads_registers(frame: &Frame) -> bool {
    frame.id().value() == 0x7FF
}

#[test]
fn motors_with_registers_tell_their_mode_their_master_id_and_their_full_scales() {
    let outcome = scan(&usual(), &mut three_modes());
    only_reads(&outcome.sent);
    assert_eq!(outcome.nodes(), [1, 2, 20].map(Some), "{:#?}", outcome.found);
    assert!(outcome.found.remarks.is_empty(), "{:?}", outcome.found.remarks);
    for (node, mode, master_id) in
        [(1, "mit", "0x011"), (2, "position-velocity", "0x07A"), (20, "velocity", "0x314")]
    {
        let motor = outcome.node(node);
        assert_eq!((motor.answered, motor.drive), (Answered::Own("Damiao registers"), Some("bit-fields")));
        assert_eq!((motor.vendor.as_deref(), motor.firmware.as_deref()), (Some("Damiao"), Some("1")));
        let keys = motor.axis_keys.join("\n");
        let description = format!("description = \"damiao-dm-{mode}\"");
        let master_id = format!("master_id = {master_id}");
        let scales = ["\"12.5 rad\"", "\"30 rad/s\"", "\"10 Nm\""];
        for words in [description.as_str(), master_id.as_str()].into_iter().chain(scales) {
            assert!(keys.contains(words), "{words}: {keys}");
        }
        let is_odd = |remark: &&String| remark.contains("two devices") || remark.contains("CANopen");
        assert_eq!(motor.remarks.iter().find(is_odd), None);
    }
}

#[test]
fn a_motor_with_registers_is_found_beside_drives_of_other_protocols() {
    let motor = damiao(5, 0x15, "mit", "; kp = 60; kd = 1.5");
    let buses = [EROB, OWN, &motor].map(|axis| bus(&[axis]));
    let outcome = scan(&usual(), &mut Joined(buses.into()));
    only_reads(&outcome.sent);
    let found: Vec<_> = outcome.found.devices.iter().map(|device| (device.node, device.drive)).collect();
    let drives = ["erob-canopen", "bit-fields", "erob-can"].map(Some);
    assert_eq!(found, [1, 5, 20].map(Some).into_iter().zip(drives).collect::<Vec<_>>());
}

#[test]
fn two_motors_with_the_same_motor_id_are_told() {
    let twin = |master_id| bus(&[&damiao(3, master_id, "velocity", "")]);
    let outcome = scan(&usual(), &mut Joined(vec![twin(0x13), twin(0x14)]));
    let motor = outcome.node(3);
    assert!(motor.remarks.iter().any(|remark| remark.contains("two devices")), "{motor:#?}");
}

#[test]
fn a_motor_that_replies_by_an_identifier_of_canopen_is_told_of_it() {
    let read = |frame: &Frame| match frame.payload() {
        &[1, 0, 0x33, register, ..] if reads_registers(frame) => {
            let value = if register == 10 { 1 } else { 0 };
            vec![Frame::of(Id::base(0).unwrap(), [1, 0, 0x33, register, value, 0, 0, 0])]
        }
        _ => vec![],
    };
    let outcome = scan(&usual(), &mut played(read));
    let motor = outcome.node(1);
    assert!(motor.remarks.iter().any(|remark| remark.contains("CANopen nodes take")), "{motor:#?}");
    let scales = motor.remarks.iter().filter(|remark| remark.contains("does not tell its"));
    assert_eq!(scales.count(), 3, "no full scale is 0: {motor:#?}");
}

#[test]
fn a_motor_in_a_mode_without_a_description_is_told_without_an_axis() {
    let read = |frame: &Frame| match frame.payload() {
        &[9, 0, 0x33, register, ..] if reads_registers(frame) => {
            let value = if register == 10 { 4 } else { 0x19 };
            vec![Frame::of(Id::base(0x19).unwrap(), [9, 0, 0x33, register, value, 0, 0, 0])]
        }
        _ => vec![],
    };
    let outcome = scan(&usual(), &mut played(read));
    let motor = outcome.node(9);
    assert_eq!(motor.drive, None);
    assert!(motor.remarks.iter().any(|remark| remark.contains("its mode (4)")), "{motor:#?}");
}

#[test]
fn whoever_has_answered_a_read_is_not_asked_by_a_command_that_stops_it() {
    let outcome = scan(&BusScan { may_take_torque: true, ..usual() }, &mut three_modes());
    let stopped = |node: u32| outcome.sent.iter().any(|frame| frame.id().value() == node);
    assert_eq!([1, 3, 4].map(stopped), [false, true, true]);
    let is_in_mit_mode = outcome.node(1).axis_keys[0].contains("damiao-dm-mit");
    assert!(is_in_mit_mode, "{:#?}", outcome.found);
}

/// An ODrive, by its node ID.
fn odrive(node: u8) -> SimulatedBus {
    bus(&[&format!("node = {node}; drive = \"bit-fields\"; description = \"odrive-can-simple\"")])
}

#[test]
fn a_drive_that_sends_heartbeats_is_heard_and_nobody_is_asked_by_an_identifier_that_is_a_command_to_it() {
    // By the identifiers of nobody in CANopen, of emergency messages and of process data.
    for node in [1, 4, 12] {
        let motor = bus(&[&damiao(33, 0x31, "velocity", "")]);
        let outcome = scan(&usual(), &mut Joined(vec![odrive(node), motor]));
        assert_eq!(outcome.nodes(), [Some(node)], "{:#?}", outcome.found);
        let drive = outcome.node(node);
        assert_eq!((drive.answered, drive.drive), (Answered::Heard("ODrive CAN Simple"), Some("bit-fields")));
        assert!(!outcome.sent.iter().any(reads_registers), "it would wait for new firmware");
        let remarks = outcome.found.remarks.join("; ");
        assert!(remarks.contains("Damiao registers") && !remarks.contains("nothing known"), "{remarks}");
        let own = u32::from(node) * 32;
        let is_to_it = |frame: &Frame| (own..own + 32).contains(&frame.id().value());
        assert!(!outcome.sent.iter().any(is_to_it), "{:#?}", outcome.sent);
    }
}

#[test]
fn a_question_that_has_an_identifier_of_a_drive_that_is_heard_is_not_sent() {
    let outcome = scan(&usual(), &mut odrive(48));
    assert_eq!(outcome.nodes(), [Some(48)], "{:#?}", outcome.found);
    let asked = |node: u32| outcome.sent.iter().any(|frame| frame.id().value() == 0x600 + node);
    assert_eq!([1, 12, 31, 32, 64].map(asked), [false, false, false, true, true]);
    let remarks = outcome.found.remarks.join("; ");
    for protocol in ["CANopen", "Damiao registers"] {
        assert!(remarks.contains(&format!("not every node was asked by {protocol}: ")), "{remarks}");
    }
}

#[test]
fn a_node_whose_emergency_messages_have_the_identifier_of_a_heartbeat_is_no_drive_that_sends_them() {
    let mut at_ns = 0;
    let change = |now_ns: u64, batch: &mut ReceiveBatch| {
        if now_ns >= at_ns {
            at_ns = now_ns + 100 * MS;
            for (id, payload) in [(0x081, [0, 0, 0, 0, 1, 0, 0, 0]), (0x0A1, [0x10, 0x43, 9, 0, 0, 0, 0, 0])]
            {
                let frame = Frame::of(Id::base(id).unwrap(), payload);
                let _ = batch.try_push(Received { frame, at_ns: now_ns });
            }
        }
    };
    let mut port = Through { bus: bus(&[EROB]), change, health: None };
    let outcome = scan(&usual(), &mut port);
    assert_eq!(outcome.node(1).answered, Answered::Sdo, "{:#?}", outcome.found);
    assert_eq!(outcome.node(33).answered, Answered::Heard("CANopen"));
    assert_eq!(outcome.nodes(), [1, 33].map(Some), "{:#?}", outcome.found);
}

/// Scans a line, and returns the requests, too.
fn scan_slaves(
    what: LineScan,
    line: &mut dyn DevicesOnLine,
    mut hear: impl FnMut(&mut Vec<u8>),
) -> (Scanned, Vec<Vec<u8>>) {
    let mut procedure = scan_line(what);
    let mut requests = vec![];
    for tick in 0..120_000_u64 {
        let now_ns = tick * MS / 2;
        let mut bytes = line.receive(now_ns);
        hear(&mut bytes);
        procedure.receive(&bytes);
        let mut sending = vec![];
        procedure.poll(now_ns, &mut |bytes: Vec<u8>| sending.push(bytes));
        for bytes in sending {
            line.send(now_ns, &bytes);
            requests.push(bytes);
        }
        if let Some(outcome) = procedure.outcome() {
            return (outcome.clone().unwrap(), requests);
        }
    }
    panic!("the scan of a line does not end");
}

fn slaves(bit_rate: u32) -> LineScan {
    LineScan { nodes: 1..=20, bit_rate, wait_ns: 60 * MS }
}

fn modbus_drives(addresses: &[u8]) -> Box<dyn DevicesOnLine> {
    let family = takt::family::all().into_iter().find(|family| family.word() == "erob-modbus").unwrap();
    family.simulated_line(addresses).unwrap().unwrap()
}

#[test]
fn slaves_on_a_line_are_found_by_reads_alone() {
    let (found, requests) = scan_slaves(slaves(115_200), modbus_drives(&[3, 17]).as_mut(), |_| {});
    let nodes: Vec<_> = found.devices.iter().map(|device| (device.node, device.drive)).collect();
    assert_eq!(nodes, [(Some(3), Some("erob-modbus")), (Some(17), Some("erob-modbus"))], "{found:#?}");
    assert_eq!(found.devices[0].answered, Answered::Modbus { bit_rate: 115_200 });
    assert!(requests.iter().all(|request| request[1] == 3), "function 03 reads");
    assert!(found.remarks.is_empty() && !found.is_interrupted);
}

#[test]
fn a_reply_that_cannot_be_read_is_said() {
    let (found, _) = scan_slaves(slaves(115_200), modbus_drives(&[3]).as_mut(), |bytes| {
        if let Some(byte) = bytes.last_mut() {
            *byte ^= 1;
        }
    });
    assert!(found.devices.is_empty(), "{found:#?}");
    assert!(found.remarks[0].contains("something answered address 3"), "{:?}", found.remarks);
}

#[test]
fn the_configuration_of_what_was_found_is_whole_but_for_what_only_the_owner_knows() {
    let place = |interface: &str| PlaceOfScan {
        interface: interface.to_owned(),
        bit_rate: 1_000_000,
        data_bit_rate: None,
    };
    for axis in [EROB, YZ_AIM, OWN] {
        let found = scan(&usual(), &mut bus(&[axis])).found.devices;
        let text = starting_configuration(&[(place("sim"), found)], None);
        let config = Config::parse("found.toml", &text).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
        config.validate().unwrap_or_else(|error| panic!("{error:?}\n{text}"));
        assert!(text.contains("# YOURS"), "{text}");
    }
    for mut bus in [three_modes(), odrive(3)] {
        let found = scan(&usual(), &mut bus).found.devices;
        let text = starting_configuration(&[(place("sim"), found)], None);
        let config = Config::parse("found.toml", &text).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
        config.validate().unwrap_or_else(|error| panic!("{error:?}\n{text}"));
    }
    let motors = scan(&BusScan { may_take_torque: true, ..usual() }, &mut bus(&[MOTOR])).found.devices;
    let text = starting_configuration(&[(place("sim"), motors)], None);
    Config::parse("found.toml", &text)
        .unwrap_or_else(|error| panic!("{error:?}\n{text}"))
        .validate()
        .unwrap();
    let (found, _) = scan_slaves(slaves(115_200), modbus_drives(&[3]).as_mut(), |_| {});
    let line = PlaceOfScan { bit_rate: 115_200, ..place("serial:/dev/ttyUSB0") };
    let text = starting_configuration(&[(line, found.devices)], None);
    Config::parse("found.toml", &text)
        .unwrap_or_else(|error| panic!("{error:?}\n{text}"))
        .validate()
        .unwrap();
    // Its data sheet is the owner's: one line is wrong until it is there.
    let found = scan(&usual(), &mut bus(&[BY_SHEET])).found.devices;
    let text = starting_configuration(&[(place("sim"), found)], None);
    let error = format!("{:?}", Config::parse("found.toml", &text).unwrap_err());
    assert!(
        text.contains("eds = \"node-12.eds\"  # YOURS") && error.contains("node-12.eds"),
        "{error}\n{text}"
    );
}

#[test]
fn the_drives_of_a_controller_that_sends_the_questions_are_not_asked_and_that_it_is_active_is_no_news() {
    let sync = Frame::of(Id::base(0x080).unwrap(), []);
    let reply_to_the_controller =
        Frame::of(Id::base(0x581).unwrap(), [0x4B, 0x41, 0x60, 0, 0x37, 0x12, 0, 0]);
    let change = |now_ns, batch: &mut ReceiveBatch| {
        for frame in [sync, reply_to_the_controller] {
            let _ = batch.try_push(Received { frame, at_ns: now_ns });
        }
    };
    let mut port = Through { bus: mixed(), change, health: None };
    let what = BusScan { of_controller: Some(vec![1, 12]), ..usual() };
    let outcome = scan(&what, &mut port);
    let asks = |node: u32| move |frame: &&Frame| [0x600 + node, 0x640 + node].contains(&frame.id().value());
    for (node, is_asked) in [(1, false), (12, false), (7, true), (20, true)] {
        assert_eq!(outcome.sent.iter().any(|frame| asks(node)(&frame)), is_asked, "node {node}");
    }
    assert!(outcome.node(7).drive.is_some(), "{:#?}", outcome.found);
    let heard = Answered::Heard("CANopen");
    assert_eq!(outcome.node(1).answered, heard, "{:#?}", outcome.found);
    let is_double = |device: &FoundDevice| device.remarks.iter().any(|remark| remark.contains("two devices"));
    assert!(!outcome.found.devices.iter().any(is_double), "{:#?}", outcome.found);
    assert!(
        !outcome.found.remarks.iter().any(|remark| remark.contains("master")),
        "{:?}",
        outcome.found.remarks
    );
}
