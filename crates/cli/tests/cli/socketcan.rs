//! The SocketCAN port on a kernel's own interfaces. Needs root and vcan: `tests/vm/all` runs this in an emulated
//! machine, `tests/vm/all --host` on this one.

use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use nix::errno::Errno;
use takt::config::{Config, Interface};
use takt::link::InterfaceError;
use takt::link::interface::prepare_interface;
use takt::link::socketcan::open_socketcan;
use takt::link::{InterfaceSettings, SocketCanOptions, interface_status};
use takt::{Controller, Outcome, Phase, Port, SessionOptions, Snapshot};
use takt_rt::linux::{MonotonicClock, SocketCanPort};
use takt_rt::{BusPort, BusState, Clock, Frame, Id, Outgoing, ReceiveBatch, Received};

/// A virtual interface of its own for each test, so that they can run side by side.
struct VirtualCan(&'static str);

impl VirtualCan {
    fn new(name: &'static str) -> Self {
        let _ = Command::new("ip").args(["link", "del", name]).output();
        run(&["ip", "link", "add", "dev", name, "type", "vcan"]);
        run(&["ip", "link", "set", name, "mtu", "72", "up"]);
        Self(name)
    }

    fn port(&self, identifiers: &[Id]) -> SocketCanPort {
        let identifiers = identifiers.to_vec();
        let data_bit_rate = Some(5_000_000);
        self.port_with(&SocketCanOptions { identifiers, data_bit_rate, ..SocketCanOptions::default() })
    }

    fn port_with(&self, options: &SocketCanOptions) -> SocketCanPort {
        open_socketcan(self.0, options).expect("the interface was just made")
    }
}

impl Drop for VirtualCan {
    fn drop(&mut self) {
        let _ = Command::new("ip").args(["link", "del", self.0]).output();
    }
}

fn run(command: &[&str]) {
    let output = Command::new(command[0]).args(&command[1..]).output().expect("the program exists");
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn id(number: u32) -> Id {
    Id::base(number).unwrap()
}

fn frame(number: u32) -> Frame {
    Frame::of(id(number), [1, 2, 3, 4])
}

fn received(port: &mut SocketCanPort) -> Vec<Received> {
    let mut all = vec![];
    loop {
        let mut batch = ReceiveBatch::new();
        port.receive(0, &mut batch);
        all.extend(batch.iter().copied());
        if batch.remaining_capacity() > 0 {
            return all;
        }
    }
}

fn frames(port: &mut SocketCanPort) -> Vec<Frame> {
    received(port).iter().map(|received| received.frame).collect()
}

/// Reads until `done`, for what another part of the kernel does in its own time. Generous: an emulated machine is
/// slow, and what does not happen fails however long one waits.
fn wait_for(port: &mut SocketCanPort, what: &str, mut done: impl FnMut(&mut SocketCanPort) -> bool) {
    for _ in 0..2_000 {
        frames(port);
        if done(port) {
            return;
        }
        sleep(Duration::from_millis(5));
    }
    panic!("waited in vain for {what}: {port:?}");
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn frames_of_all_kinds_cross_and_own_ones_only_confirm() {
    let bus = VirtualCan::new("takt-kinds");
    let (mut left, mut right) = (bus.port(&[]), bus.port(&[]));
    let long = Id::extended(0x1ABC_DEF0).unwrap();
    let sent = [
        frame(0x201),
        Frame::remote(long, 4).unwrap(),
        Frame::data(long, &[]).unwrap(),
        Frame::fd(id(0x7FF), &[9; 64], true).unwrap(),
        Frame::fd(long, &[9; 12], false).unwrap(),
    ];
    assert_eq!(left.send(0, &sent), sent.len());
    assert_eq!(frames(&mut right), sent);
    assert_eq!(frames(&mut left), []);
    assert_eq!(left.unconfirmed(0), 0);
    assert_eq!((left.health().tx_frames, left.health().rx_frames), (5, 0));
    assert_eq!((right.health().tx_frames, right.health().rx_frames), (0, 5));
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn drives_are_stopped_beside_a_loop_that_stands_still() {
    let bus = VirtualCan::new("takt-resort");
    let mut listener = bus.port(&[]);
    let mut config =
        Config::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/arm6-erob.toml").as_ref()).unwrap();
    config.buses[0].interface = Interface::SocketCan("takt-resort".to_owned());
    let told = takt::controller::stop_drives(&config);
    let of_bus = config.axes.iter().filter(|axis| axis.bus == 0);
    let stops: Vec<Frame> = of_bus.map(|axis| Frame::of(id(0), [0x02, axis.node])).collect();
    assert_eq!(frames(&mut listener), stops);
    assert_eq!(told[0], format!("NMT stop was sent to the drives of {}", config.buses[0].name));
    assert!(told[1].contains("simulated"), "{told:?}");
    run(&["ip", "link", "set", "takt-resort", "down"]);
    let told = takt::controller::stop_drives(&config);
    assert!(told[0].contains("could not be sent") && told[0].contains("was set down"), "{told:?}");
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn the_kernel_filters_what_is_not_ours() {
    let bus = VirtualCan::new("takt-filter");
    let (mut ours, mut other) = (bus.port(&[id(0x181), id(0x201)]), bus.port(&[]));
    let alike = Frame::of(Id::extended(0x181).unwrap(), [0]);
    assert_eq!(other.send(0, &[frame(0x180), frame(0x181), alike, frame(0x182)]), 4);
    assert_eq!(frames(&mut ours), [frame(0x181)]);
    assert_eq!(ours.health().rx_frames, 1);
    assert_eq!(ours.send(0, &[frame(0x201)]), 1);
    frames(&mut ours);
    assert_eq!(ours.unconfirmed(0), 0);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn a_batch_larger_than_one_call_crosses_whole() {
    let bus = VirtualCan::new("takt-batch");
    let (mut left, mut right) = (bus.port(&[]), bus.port(&[]));
    let sent: Vec<Frame> = (0..150).map(frame).collect();
    assert_eq!(left.send(0, &sent), sent.len());
    assert_eq!(frames(&mut right), sent);
    frames(&mut left);
    assert_eq!((left.unconfirmed(0), left.health().tx_frames), (0, 150));
}

/// Sends `frames[n]` on `ports[n]` together, and returns how many each took.
fn send_together<const N: usize>(ports: [&mut SocketCanPort; N], frames: [&[Frame]; N]) -> [usize; N] {
    let mut taken = [0; N];
    let entries = ports.into_iter().zip(frames).zip(&mut taken);
    let mut outgoing: Vec<_> =
        entries.map(|((port, frames), taken)| Outgoing { port, frames, taken }).collect();
    SocketCanPort::send_together(0, &mut outgoing);
    taken
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn frames_that_are_sent_together_reach_each_its_own_bus_and_come_back_as_confirmations() {
    let buses = ["takt-base", "takt-wrist", "takt-hand"].map(VirtualCan::new);
    let [mut base, mut wrist, mut hand] = [0, 1, 2].map(|bus: usize| buses[bus].port(&[]));
    let mut others = [0, 1, 2].map(|bus: usize| buses[bus].port(&[]));
    let long = Frame::fd(id(0x300), &[9; 64], true).unwrap();
    let sent = [&[frame(0x80), frame(0x201)][..], &[frame(0x80), long], &[frame(0x80)]];
    assert_eq!(send_together([&mut base, &mut wrist, &mut hand], sent), [2, 2, 1]);
    assert_eq!([base.unconfirmed(0), wrist.unconfirmed(0), hand.unconfirmed(0)], [2, 2, 1]);
    for (other, sent) in others.iter_mut().zip(sent) {
        assert_eq!(frames(other), sent);
    }
    for (port, count) in [(&mut base, 2), (&mut wrist, 2), (&mut hand, 1)] {
        assert_eq!(frames(port), []);
        assert_eq!((port.unconfirmed(0), port.health().tx_frames, port.health().rx_frames), (0, count, 0));
    }
    // SYNC leaves before the set-points of the slot before it have been read back.
    assert_eq!(send_together([&mut base, &mut wrist], [&[frame(0x201)]; 2]), [1; 2]);
    assert_eq!(send_together([&mut base, &mut wrist], [&[frame(0x80)]; 2]), [1; 2]);
    assert_eq!((frames(&mut base), frames(&mut wrist)), (vec![], vec![]));
    assert_eq!((base.unconfirmed(0), wrist.unconfirmed(0)), (0, 0));
    // Another process' SYNC is nobody's confirmation.
    others[1].send(0, &[frame(0x80)]);
    assert_eq!(frames(&mut wrist), [frame(0x80)]);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn of_buses_that_are_sent_to_together_one_that_is_down_holds_no_other_up() {
    let buses = ["takt-left", "takt-middle", "takt-right"].map(VirtualCan::new);
    for down in 0..3 {
        let [mut left, mut middle, mut right] = [0, 1, 2].map(|bus: usize| buses[bus].port(&[]));
        run(&["ip", "link", "set", buses[down].0, "down"]);
        for _ in 0..3 {
            let sent: &[Frame] = &[frame(0x80), frame(0x201)];
            let taken = send_together([&mut left, &mut middle, &mut right], [sent; 3]);
            for (bus, port) in [&mut left, &mut middle, &mut right].into_iter().enumerate() {
                let is_down = bus == down;
                assert_eq!(taken[bus], if is_down { 0 } else { 2 }, "bus {bus}, {down} is down");
                assert_eq!((frames(port), port.unconfirmed(0)), (vec![], 0), "bus {bus}, {down} is down");
                let state = if is_down { BusState::Down } else { BusState::ErrorActive };
                assert_eq!(port.health().state, state, "bus {bus}, {down} is down");
                assert_eq!(port.health().tx_overruns, 0);
            }
        }
        run(&["ip", "link", "set", buses[down].0, "up"]);
        let sent: &[Frame] = &[frame(0x80)];
        assert_eq!(send_together([&mut left, &mut middle, &mut right], [sent; 3]), [1; 3]);
        for port in [&mut left, &mut middle, &mut right] {
            assert_eq!((frames(port), port.unconfirmed(0)), (vec![], 0));
            assert_eq!(port.health().state, BusState::ErrorActive);
        }
    }
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn an_interface_that_goes_down_is_a_state_and_comes_back() {
    let bus = VirtualCan::new("takt-down");
    let (mut port, mut other) = (bus.port(&[]), bus.port(&[]));
    run(&["ip", "link", "set", bus.0, "down"]);
    frames(&mut port);
    assert_eq!(port.health().state, BusState::Down);
    assert_eq!(port.send(0, &[frame(1), frame(2)]), 0);
    assert_eq!((port.health().state, port.unconfirmed(0)), (BusState::Down, 0));
    assert_eq!(port.health().tx_overruns, 0);
    run(&["ip", "link", "set", bus.0, "up"]);
    assert_eq!(port.send(0, &[frame(3)]), 1);
    assert_eq!(port.health().state, BusState::ErrorActive);
    frames(&mut port);
    assert_eq!((port.unconfirmed(0), port.health().tx_frames), (0, 1));
    assert_eq!(frames(&mut other), []);
    assert_eq!(frames(&mut other), [frame(3)]);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn an_interface_that_is_removed_is_down() {
    let bus = VirtualCan::new("takt-gone");
    let mut port = bus.port(&[]);
    assert_eq!(port.send(0, &[frame(1)]), 1);
    run(&["ip", "link", "del", bus.0]);
    frames(&mut port);
    assert_eq!(port.health().state, BusState::Down);
    assert_eq!(port.send(0, &[frame(2)]), 0);
    assert_eq!((port.health().state, port.unconfirmed(0)), (BusState::Down, 0));
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn a_port_finds_the_interface_that_takes_the_place_of_a_removed_one() {
    let bus = VirtualCan::new("takt-anew");
    let mut port = bus.port(&[id(1), id(2)]);
    let attachment = port.attachment().unwrap();
    assert!(!attachment.is_removed());
    drop(bus);
    frames(&mut port);
    assert!(attachment.is_removed());
    assert_eq!(attachment.renew(i32::MAX), Err(Errno::ENODEV as i32));

    let bus = VirtualCan::new("takt-anew");
    let mut other = bus.port(&[]);
    assert_eq!((port.send(0, &[frame(1)]), port.health().state), (0, BusState::Down));
    attachment.renew(interface_index(bus.0)).unwrap();
    assert!(!attachment.is_removed());
    other.send(0, &[frame(2), frame(3)]);
    assert_eq!(frames(&mut port), [frame(2)], "the filters are those of before");
    // Not the index that the port began with.
    let beside = VirtualCan::new("takt-beside");
    let mut third = beside.port(&[]);
    port.unconfirmed(0);
    let sent: &[Frame] = &[frame(1)];
    let mut taken = [0; 2];
    let [first, second] = &mut taken;
    SocketCanPort::send_together(
        0,
        &mut [
            Outgoing { port: &mut port, frames: sent, taken: first },
            Outgoing { port: &mut third, frames: sent, taken: second },
        ],
    );
    assert_eq!(taken, [1, 1]);
    assert_eq!(
        (frames(&mut port), port.unconfirmed(0), port.health().state),
        (vec![], 0, BusState::ErrorActive)
    );
    assert_eq!(frames(&mut other).last(), Some(&frame(1)));
}

fn interface_index(name: &str) -> i32 {
    std::fs::read_to_string(format!("/sys/class/net/{name}/ifindex")).unwrap().trim().parse().unwrap()
}

/// The drive of configs/single-erob.toml, simulated by a program of its own.
struct Drive(Child);

impl Drive {
    fn on(bus: &VirtualCan) -> Self {
        // A drive is not kept waiting by programs.
        let mut program = Command::new("chrt");
        program.args([
            "--fifo",
            "70",
            env!("CARGO_BIN_EXE_takt"),
            "sim",
            SINGLE,
            "--bus",
            &format!("can={}", bus.0),
        ]);
        Self(program.stderr(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const SINGLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/single-erob.toml");

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn a_drive_recovers_and_moves_when_its_adapter_was_plugged_in_again() {
    const PATIENCE: Duration = Duration::from_secs(30);
    let bus = VirtualCan::new("takt-again");
    let drive = Drive::on(&bus);
    let mut config = Config::load(SINGLE.as_ref()).unwrap();
    config.override_interface("can", bus.0).unwrap();
    // The emulated machine is too slow for 1 ms.
    (config.cycle.period_ns, config.simulation.longest_gap_ns) = (10_000_000, 20_000_000);
    config.axes[0].missed_feedback_cycles = 50;
    let arm = Controller::start(config, SessionOptions::default()).unwrap();
    let moves_to = |target| {
        let motion = arm.move_to(&[target]).unwrap();
        assert_eq!(arm.wait(motion, PATIENCE), Ok(()));
        let is_there = |state: &Snapshot| (state.axes()[0].position - target).abs() < 0.01;
        arm.wait_until(PATIENCE, |state| is_there(state).then_some(())).unwrap();
    };
    moves_to(0.2);
    drop((drive, bus));
    arm.wait_until(PATIENCE, |state| (state.groups()[0].phase == Phase::Disabled).then_some(())).unwrap();
    assert_eq!(arm.state().buses()[0].state, BusState::Down);
    assert!(arm.fault().is_some());

    let bus = VirtualCan::new("takt-again");
    let _drive = Drive::on(&bus);
    arm.wait_until(PATIENCE, |state| (state.buses()[0].state == BusState::ErrorActive).then_some(()))
        .unwrap();
    arm.recover(PATIENCE).unwrap();
    moves_to(0.4);
    assert_eq!(arm.finish().unwrap().outcome, Outcome::Finished);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn received_frames_that_are_lost_are_counted() {
    let bus = VirtualCan::new("takt-flood");
    let options = SocketCanOptions { receive_frames: 16, ..SocketCanOptions::default() };
    let (mut reader, mut sender) = (bus.port_with(&options), bus.port(&[]));
    const SENT: u64 = 500;
    for _ in 0..SENT {
        assert_eq!(sender.send(0, &[frame(5)]), 1);
        frames(&mut sender);
    }
    assert!(!frames(&mut reader).is_empty());
    // The counter travels with the next frame that finds room.
    sender.send(0, &[frame(6)]);
    assert_eq!(frames(&mut reader), [frame(6)]);
    let health = reader.health();
    assert!(health.rx_overruns > 0);
    assert_eq!(health.rx_frames + health.rx_overruns, SENT + 1);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn lost_confirmations_hold_nothing_back() {
    let bus = VirtualCan::new("takt-lost");
    let options = SocketCanOptions { receive_frames: 16, ..SocketCanOptions::default() };
    let mut port = bus.port_with(&options);
    for _ in 0..100 {
        assert_eq!(port.send(0, &[frame(5)]), 1);
    }
    assert_eq!(port.unconfirmed(0), 100);
    frames(&mut port);
    port.send(0, &[frame(6)]);
    frames(&mut port);
    assert_eq!(port.unconfirmed(0), 0);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn arrivals_carry_the_kernels_time_on_the_monotonic_clock() {
    let bus = VirtualCan::new("takt-time");
    let (mut left, mut right) = (bus.port(&[]), bus.port(&[]));
    let mut clock = MonotonicClock::default();
    // Stamping begins a moment after the first socket of a machine asks for it.
    sleep(Duration::from_millis(100));
    let mut between = 0;
    for _ in 0..50 {
        let before_ns = clock.now_ns();
        left.send(0, &[frame(1)]);
        let sent_ns = clock.now_ns();
        // What lies between sending and reading must not be part of the time of arrival.
        sleep(Duration::from_millis(2));
        let arrival = received(&mut right);
        assert_eq!(arrival.len(), 1);
        // The two clocks are read one after the other; half the way between them is the error.
        let error_ns = 200_000;
        between += usize::from((before_ns - error_ns..sent_ns + error_ns).contains(&arrival[0].at_ns));
    }
    // A machine may stall between the two readings, not always.
    assert!(between > 25, "{between} of 50");
}

const SETTINGS: InterfaceSettings =
    InterfaceSettings { bit_rate: 1_000_000, data_bit_rate: None, restart_ms: 100 };

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn a_virtual_interface_is_brought_up_for_classic_and_for_fd_frames() {
    let bus = VirtualCan::new("takt-prepare");
    run(&["ip", "link", "set", bus.0, "down"]);
    run(&["ip", "link", "set", bus.0, "mtu", "16"]);
    assert_eq!(interface_status(bus.0).unwrap().state, BusState::Down);
    let status = prepare_interface(bus.0, &SETTINGS).unwrap();
    assert!(status.is_up && !status.has_fd && !status.has_controller);
    assert_eq!((status.timing, status.restart_ms), (None, None));
    let flexible = InterfaceSettings { data_bit_rate: Some(4_000_000), ..SETTINGS };
    assert!(matches!(prepare_interface(bus.0, &flexible), Err(InterfaceError::NoFd { .. })));
    run(&["ip", "link", "set", bus.0, "down"]);
    assert!(prepare_interface(bus.0, &flexible).unwrap().has_fd);
}

/// The two SJA1000 controllers of the emulated machine, `can0` and `can1`, on one bus. Another machine need not have
/// any, and if it has, they may be in use: there, what needs them is left out, and says so.
struct Controllers;

impl Controllers {
    fn up() -> Option<Self> {
        if std::env::var("TAKT_VM").is_ok_and(|vm| vm == "host") {
            eprintln!("needs the emulated machine's controllers, and is left out on this one");
            return None;
        }
        for name in ["can0", "can1"] {
            prepare_interface(name, &SETTINGS).unwrap();
        }
        Some(Self)
    }

    fn port(&self, name: &str) -> SocketCanPort {
        let options = SocketCanOptions { transmit_frames: 16, ..SocketCanOptions::default() };
        open_socketcan(name, &options).unwrap()
    }
}

impl Drop for Controllers {
    fn drop(&mut self) {
        for name in ["can0", "can1"] {
            let _ = Command::new("tc").args(["qdisc", "del", "dev", name, "root"]).output();
            let _ = Command::new("ip").args(["link", "set", name, "down"]).output();
        }
    }
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn controllers_are_configured_and_another_bit_rate_is_refused_while_they_run() {
    let Some(_controllers) = Controllers::up() else { return };
    for name in ["can0", "can1"] {
        let status = interface_status(name).unwrap();
        assert!(status.is_up && status.has_controller && !status.has_fd);
        assert_eq!(status.timing.unwrap().bit_rate, 1_000_000);
        assert_eq!(status.timing.unwrap().sample_point, 0.75);
        assert_eq!(status.restart_ms, Some(100));
        assert_eq!(status.state, BusState::ErrorActive);
    }
    let slower = InterfaceSettings { bit_rate: 500_000, ..SETTINGS };
    let refusal = prepare_interface("can0", &slower).unwrap_err();
    assert!(matches!(refusal, InterfaceError::BitRateDiffers { found: 1_000_000, wanted: 500_000, .. }));
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn the_configuration_says_when_a_controller_comes_back_from_bus_off() {
    let Some(_controllers) = Controllers::up() else { return };
    run(&["ip", "link", "set", "can0", "down"]);
    let reference = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/reference.toml");
    let mut config = Config::load(reference.as_ref()).unwrap();
    config.override_interface("left", "can0").unwrap();
    for restart_ms in [250, 0] {
        config.buses[0].restart_ms = restart_ms;
        drop(Port::open(&config, 0).unwrap());
        assert_eq!(interface_status("can0").unwrap().restart_ms, Some(restart_ms));
        run(&["ip", "link", "set", "can0", "down"]);
    }
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn controllers_exchange_frames_and_confirm_them() {
    let Some(controllers) = Controllers::up() else { return };
    let (mut left, mut right) = (controllers.port("can0"), controllers.port("can1"));
    let sent: Vec<Frame> = (0x201..0x209).map(frame).collect();
    assert_eq!(left.send(0, &sent), sent.len());
    let mut arrived = vec![];
    for _ in 0..2_000 {
        arrived.extend(frames(&mut right));
        frames(&mut left);
        if arrived.len() >= sent.len() && left.unconfirmed(0) == 0 {
            break;
        }
        sleep(Duration::from_millis(5));
    }
    assert_eq!(arrived, sent);
    assert_eq!((left.unconfirmed(0), left.health().tx_frames), (0, 8));
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn frames_that_wait_for_the_bus_are_unconfirmed_and_what_finds_no_room_is_counted() {
    let Some(controllers) = Controllers::up() else { return };
    // A bucket of a few frames that fills at 125 byte/s stands in for a bus on which nobody acknowledges.
    run(&[
        "tc", "qdisc", "add", "dev", "can0", "root", "tbf", "rate", "1kbit", "burst", "80", "limit",
        "1000000",
    ]);
    let mut port = controllers.port("can0");
    let burst: Vec<Frame> = (0..60).map(frame).collect();
    let taken = port.send(0, &burst);
    assert!((16..40).contains(&taken), "{taken} frames were taken with room for 16 to wait");
    assert_eq!(port.health().tx_overruns as usize, burst.len() - taken);
    frames(&mut port);
    assert!(port.unconfirmed(0) > 0);
    // A frame or two may have left meanwhile, and their places be taken; nobody waits for more.
    let taken = taken + port.send(0, &burst);
    assert!(taken < 50, "{taken}");
    assert_eq!(port.health().tx_overruns as usize, 2 * burst.len() - taken);
    assert_eq!(port.health().state, BusState::ErrorActive);
    wait_for(&mut port, "the queue to drain", |port| port.unconfirmed(0) == 0);
    assert_eq!(port.health().tx_frames as usize, taken);
}

#[test]
#[ignore = "needs root and a kernel with vcan: tests/vm/all"]
fn an_interface_that_goes_down_forgets_what_was_queued() {
    let Some(controllers) = Controllers::up() else { return };
    run(&[
        "tc", "qdisc", "add", "dev", "can0", "root", "tbf", "rate", "1kbit", "burst", "80", "limit",
        "1000000",
    ]);
    let mut port = controllers.port("can0");
    let burst: Vec<Frame> = (0..12).map(frame).collect();
    assert_eq!(port.send(0, &burst), burst.len());
    frames(&mut port);
    assert!(port.unconfirmed(0) > 0);
    run(&["ip", "link", "set", "can0", "down"]);
    frames(&mut port);
    assert_eq!((port.health().state, port.unconfirmed(0)), (BusState::Down, 0));
}
