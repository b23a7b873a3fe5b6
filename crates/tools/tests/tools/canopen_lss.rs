//! The LSS master against several simulated devices at once.

use proptest::prelude::*;
use takt::VirtualClock;
use takt::sim::lss::{LssBus, LssDevice, LssStack};
use takt_rt::{BusHealth, BusPort, Frame, Nanoseconds, ReceiveBatch};
use takt_tools::commission::layer_settings::{ImplausibleIdentity, LayerSettingFailure, LayerSettings};
use takt_wire::canopen::lss::{
    BitTiming, Inquiry, LssAddress, LssBusy, LssError, LssMaster, LssMode, LssOutcome, LssResult, LssTask,
    LssTiming,
};

const MILLISECOND_NS: u64 = 1_000_000;

struct Bus {
    now_ns: u64,
    master: LssMaster,
    devices: Vec<LssDevice>,
    /// The frames of the devices besides LSS replies: boot-up messages.
    boot_ups: Vec<Frame>,
}

impl Bus {
    fn new(devices: impl IntoIterator<Item = LssDevice>) -> Self {
        Self {
            now_ns: 7_000_000_000,
            master: LssMaster::new(LssTiming::default()),
            devices: devices.into_iter().collect(),
            boot_ups: vec![],
        }
    }

    fn run(&mut self, task: LssTask) -> Result<LssOutcome, LssError> {
        self.master.start(task).unwrap();
        for _ in 0..20_000 {
            while let Some(frame) = self.master.poll(self.now_ns) {
                for device in &mut self.devices {
                    let Some(answer) = device.receive(&frame) else { continue };
                    if answer.id().value() != 0x7E4 {
                        self.boot_ups.push(answer);
                    } else {
                        self.master.receive(&answer);
                    }
                }
            }
            if let Some(outcome) = self.master.take_outcome() {
                return outcome;
            }
            self.now_ns += MILLISECOND_NS;
        }
        panic!("no end after 20 s");
    }
}

fn address(serial: u32) -> LssAddress {
    LssAddress { vendor: 0x331, product: 1, revision: 0x100, serial }
}

fn unconfigured(serials: &[u32]) -> Bus {
    Bus::new(serials.iter().map(|serial| LssDevice::new(address(*serial), None)))
}

#[test]
fn a_device_is_selected_by_identity_configured_stored_and_boots() {
    let mut bus = unconfigured(&[10, 11]);
    assert_eq!(bus.run(LssTask::SwitchSelective(address(11))), Ok(LssOutcome::Done));
    assert_eq!(bus.run(LssTask::InquireAddress), Ok(LssOutcome::Device(address(11))));
    assert_eq!(bus.run(LssTask::Inquire(Inquiry::Node)), Ok(LssOutcome::Value(255)));
    assert_eq!(bus.run(LssTask::ConfigureNode(5)), Ok(LssOutcome::Done));
    assert_eq!(bus.run(LssTask::ConfigureBitTiming(BitTiming::Kilobits500)), Ok(LssOutcome::Done));
    assert_eq!(bus.run(LssTask::Store), Ok(LssOutcome::Done));
    assert_eq!(bus.run(LssTask::ActivateBitTiming { delay_ms: 100 }), Ok(LssOutcome::Done));
    assert!(bus.boot_ups.is_empty(), "it is silent until it is switched");
    assert_eq!(bus.run(LssTask::SwitchGlobal(LssMode::Waiting)), Ok(LssOutcome::Done));
    assert_eq!(format!("{:?}", bus.boot_ups), "[705#00]");
    assert_eq!((bus.devices[0].node(), bus.devices[1].node()), (None, Some(5)));
    assert_eq!(bus.devices[1].bit_timing(), BitTiming::Kilobits500);
    let boot_up = bus.devices[1].power_cycle();
    assert_eq!(format!("{boot_up:?}"), "Some(705#00)");
}

#[test]
fn a_refused_or_unanswered_request_is_an_error() {
    let mut bus = unconfigured(&[10]);
    let silence = Err(LssError::NoReply { reply_timeout_ns: 500 * MILLISECOND_NS });
    assert_eq!(bus.run(LssTask::SwitchSelective(address(9))), silence);
    assert_eq!(bus.run(LssTask::ConfigureNode(5)), silence, "it is not in configuration");
    assert_eq!(bus.run(LssTask::SwitchGlobal(LssMode::Configuration)), Ok(LssOutcome::Done));
    let refused = Err(LssError::Refused { result: LssResult::REFUSED });
    assert_eq!(bus.run(LssTask::ConfigureNode(128)), refused);
    assert_eq!(bus.run(LssTask::ConfigureBitTiming(BitTiming::Automatic)), refused);
    bus.devices[0].can_store = false;
    assert_eq!(bus.run(LssTask::Store), refused);
    bus.master.start(LssTask::Store).unwrap();
    assert_eq!(bus.master.start(LssTask::Store), Err(LssBusy));
}

#[test]
fn devices_are_found_by_an_identity_range_and_by_having_no_node_id() {
    let mut bus = unconfigured(&[10]);
    bus.devices.push(LssDevice::new(address(20), Some(3)));
    let mut exists = |low, high| {
        bus.run(LssTask::IdentifyRemote { lowest: address(low), highest: address(high) }).unwrap()
    };
    assert_eq!(exists(5, 15), LssOutcome::Exists(true));
    assert_eq!(exists(11, 19), LssOutcome::Exists(false));
    assert_eq!(exists(20, 20), LssOutcome::Exists(true));
    assert_eq!(bus.run(LssTask::IdentifyUnconfigured), Ok(LssOutcome::Exists(true)));
    bus.devices.remove(0);
    assert_eq!(bus.run(LssTask::IdentifyUnconfigured), Ok(LssOutcome::Exists(false)));
    assert_eq!(bus.run(LssTask::FastScan([None; 4])), Ok(LssOutcome::NotFound));
}

#[test]
fn fast_scan_finds_each_device_in_turn_and_assigns_a_node_id() {
    let mut bus = unconfigured(&[0xDEAD_BEEF, 3, 0xFFFF_FFFF, 0x8000_0000, 0]);
    let mut found = vec![];
    for node in 1.. {
        match bus.run(LssTask::FastScan([None; 4])).unwrap() {
            LssOutcome::Device(address) => found.push(address.serial),
            outcome => {
                assert_eq!(outcome, LssOutcome::NotFound);
                break;
            }
        }
        assert_eq!(bus.run(LssTask::ConfigureNode(node)), Ok(LssOutcome::Done));
        assert_eq!(bus.run(LssTask::SwitchGlobal(LssMode::Waiting)), Ok(LssOutcome::Done));
    }
    assert_eq!(found, [0, 3, 0x8000_0000, 0xDEAD_BEEF, 0xFFFF_FFFF], "the lowest identity first");
    assert_eq!(bus.boot_ups.len(), 5);
}

#[test]
fn known_parts_of_the_identity_are_confirmed_in_one_request() {
    let known = [Some(0x331), Some(1), Some(0x100), None];
    let mut bus = unconfigured(&[42]);
    let began_ns = bus.now_ns;
    assert_eq!(bus.run(LssTask::FastScan(known)), Ok(LssOutcome::Device(address(42))));
    let questions = (bus.now_ns - began_ns) / LssTiming::default().scan_timeout_ns;
    assert_eq!(questions, 1 + 3 + 32 + 1);
    assert_eq!(bus.devices[0].mode(), LssMode::Configuration);
    let other = [Some(0x332), None, None, None];
    assert_eq!(unconfigured(&[42]).run(LssTask::FastScan(other)), Ok(LssOutcome::NotFound));
}

#[test]
fn an_identity_assembled_from_lost_replies_is_rejected() {
    let mut bus = unconfigured(&[42]);
    // The reply to the first request arrives, and a later one is lost.
    bus.master.start(LssTask::FastScan([None; 4])).unwrap();
    let mut asked = 0;
    let outcome = loop {
        if let Some(frame) = bus.master.poll(bus.now_ns) {
            asked += 1;
            match bus.devices[0].receive(&frame) {
                Some(answer) if asked != 2 => bus.master.receive(&answer),
                _ => {}
            }
        }
        if let Some(outcome) = bus.master.take_outcome() {
            break outcome;
        }
        bus.now_ns += MILLISECOND_NS;
    };
    assert_eq!(outcome, Err(LssError::ScanLost));
}

/// The identities that a scan finds, each one after the last.
fn found_in_turn(bus: &mut Bus) -> Vec<LssAddress> {
    let mut found: Vec<LssAddress> = vec![];
    loop {
        let task = found.last().map_or(LssTask::FastScan([None; 4]), |last| LssTask::FastScanAfter(*last));
        match bus.run(task).unwrap() {
            LssOutcome::Device(address) => found.push(address),
            _ => return found,
        }
        assert_eq!(bus.run(LssTask::SwitchGlobal(LssMode::Waiting)), Ok(LssOutcome::Done));
    }
}

#[test]
fn a_found_device_is_excluded_by_its_identity_though_it_gets_no_node_id() {
    for stack in [LssStack::Standard, LssStack::CanOpenNode] {
        let mut bus = unconfigured(&[7, 8, 0xFFFF_FFFF]);
        bus.devices.push(LssDevice::new(LssAddress { vendor: 0xFFFF_FFFF, ..address(0) }, None));
        bus.devices.push(LssDevice::new(LssAddress { revision: 0x101, ..address(0) }, None));
        for device in &mut bus.devices {
            device.stack = stack;
        }
        let serials: Vec<_> = found_in_turn(&mut bus)
            .iter()
            .map(|found| (found.vendor, found.revision, found.serial))
            .collect();
        let expected = [(0x331, 0x100, 7), (0x331, 0x100, 8), (0x331, 0x100, 0xFFFF_FFFF), (0x331, 0x101, 0)];
        assert_eq!(serials[..4], expected, "{stack:?}");
        assert_eq!(serials[4..], [(0xFFFF_FFFF, 0x100, 0)], "{stack:?}");
        assert!(bus.boot_ups.is_empty());
    }
}

#[test]
fn a_canopennode_device_in_configuration_state_replies_to_every_scan_request() {
    let mut bus = unconfigured(&[7]);
    bus.devices[0].stack = LssStack::CanOpenNode;
    assert_eq!(bus.run(LssTask::FastScan([None; 4])), Ok(LssOutcome::Device(address(7))));
    let phantom = LssAddress::default();
    assert_eq!(bus.run(LssTask::FastScan([None; 4])), Ok(LssOutcome::Device(phantom)));
}

/// Runs this on simulated devices.
fn with_settings<P: BusPort, T>(
    port: &mut P,
    work: impl FnOnce(&mut LayerSettings<'_, P, VirtualClock>) -> T,
) -> T {
    let mut clock = VirtualClock::default();
    let (mut is_interrupted, mut see) = (|| false, |_, _| {});
    work(&mut LayerSettings::new(port, &mut clock, &mut is_interrupted, &mut see))
}

#[test]
fn a_node_id_that_two_devices_took_is_taken_back() {
    let mut bus = LssBus::new([1, 2].map(|serial| LssDevice::new(address(serial), None)));
    let outcome = with_settings(&mut bus, |settings| {
        settings.perform(LssTask::SwitchGlobal(LssMode::Configuration)).unwrap();
        let outcome = settings.configure_node(5, None);
        settings.release(None).unwrap();
        outcome
    });
    assert_eq!(outcome, Err(LayerSettingFailure::SeveralDevices { replies: 2, is_undone: true }));
    assert!(bus.devices().iter().all(|device| device.node().is_none()));
}

/// A bus on which the command to leave configuration state is lost.
struct Stuck(LssBus);

impl BusPort for Stuck {
    fn send(&mut self, now_ns: Nanoseconds, frames: &[Frame]) -> usize {
        let kept: Vec<Frame> =
            frames.iter().filter(|frame| frame.payload()[..2] != [4, 0]).copied().collect();
        self.0.send(now_ns, &kept);
        frames.len()
    }

    fn receive(&mut self, now_ns: Nanoseconds, batch: &mut ReceiveBatch) {
        self.0.receive(now_ns, batch);
    }

    fn unconfirmed(&mut self, now_ns: Nanoseconds) -> usize {
        self.0.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.0.health()
    }
}

#[test]
fn a_device_that_stays_in_configuration_state_is_not_found_twice() {
    let mut device = LssDevice::new(address(7), None);
    device.stack = LssStack::CanOpenNode;
    let mut bus = Stuck(LssBus::new([device]));
    with_settings(&mut bus, |settings| {
        assert_eq!(settings.scan(None), Ok(Some(address(7))));
        let repeated = LayerSettingFailure::Implausible(ImplausibleIdentity::Repeated);
        assert_eq!(settings.scan(Some(address(7))), Err(repeated));
        let unconfirmed = LayerSettingFailure::Implausible(ImplausibleIdentity::Unconfirmed);
        assert_eq!(settings.scan(Some(address(8))), Err(unconfirmed));
    });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn fast_scan_finds_the_lowest_of_any_identities(
        identities in prop::collection::btree_set(any::<[u32; 4]>(), 1..5),
    ) {
        let devices = identities.iter().map(|values| LssDevice::new(LssAddress::from_values(*values), None));
        let mut bus = Bus::new(devices);
        let lowest = identities.first().copied().map(LssAddress::from_values).unwrap();
        prop_assert_eq!(bus.run(LssTask::FastScan([None; 4])), Ok(LssOutcome::Device(lowest)));
        let obeying = bus.devices.iter().filter(|device| device.mode() == LssMode::Configuration).count();
        prop_assert_eq!(obeying, 1);
    }

    #[test]
    fn scans_after_each_found_device_find_all_of_any_identities_in_order(
        identities in prop::collection::btree_set(any::<[u32; 4]>(), 1..5),
        is_canopen_node: bool,
    ) {
        let devices = identities.iter().map(|values| {
            let mut device = LssDevice::new(LssAddress::from_values(*values), None);
            device.stack = if is_canopen_node { LssStack::CanOpenNode } else { LssStack::Standard };
            device
        });
        let mut bus = Bus::new(devices);
        let expected: Vec<_> = identities.iter().copied().map(LssAddress::from_values).collect();
        prop_assert_eq!(found_in_turn(&mut bus), expected);
    }
}
