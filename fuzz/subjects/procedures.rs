//! Procedures with devices that may send any reply: bring-up and shutdown of drives, and LSS.

use std::sync::OnceLock;

use takt::config::Config;
use takt::family::bring_up::BringUpTiming;
use takt::family::bring_up::stages::{BringUp, Shutdown};
use takt::sim::SimulatedBus;
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
use takt_wire::canopen::lss::{
    BitTiming, Inquiry, LssAddress, LssMaster, LssMode, LssRequest, LssTask, LssTiming,
};
use takt_wire::canopen::sdo;

use super::input::Input;

/// The LSS master ends with any task and any replies.
pub fn layer_settings(mut input: Input<'_>) {
    let mut address = || LssAddress::from_values([(); 4].map(|()| input.word()));
    let (first, second) = (address(), address());
    let task = match input.byte() % 12 {
        0 => LssTask::SwitchGlobal(LssMode::Configuration),
        1 => LssTask::SwitchSelective(first),
        2 => LssTask::ConfigureNode(input.byte()),
        3 => LssTask::ConfigureBitTiming(BitTiming::Kilobits500),
        4 => LssTask::ActivateBitTiming { delay_ms: input.short() },
        5 => LssTask::Store,
        6 => LssTask::Inquire(Inquiry::ALL[usize::from(input.byte()) % Inquiry::ALL.len()]),
        7 => LssTask::InquireAddress,
        8 => LssTask::IdentifyRemote { lowest: first, highest: second },
        9 => LssTask::IdentifyUnconfigured,
        known => LssTask::FastScan(first.values().map(|value| (known == 10).then_some(value))),
    };
    let timing = LssTiming { reply_timeout_ns: 10_000_000, scan_timeout_ns: 1_000_000 };
    let mut master = LssMaster::new(timing);
    assert!(master.start(task).is_ok() && master.start(task).is_err());
    let mut now_ns = 0;
    for _ in 0..MAX_REQUESTS {
        while let Some(frame) = master.poll(now_ns) {
            assert!(LssRequest::decode(&frame).is_some(), "{frame:?}");
        }
        if master.take_outcome().is_some() {
            assert!(!master.is_busy());
            return;
        }
        now_ns += 500_000;
        match input.byte() {
            0..128 => {}
            length => {
                let id = Id::base(0x7E4).expect("an identifier of eleven bits");
                let answer = Frame::data(id, &input.bytes::<8>()[..usize::from(length) % 9]);
                master.receive(&answer.expect("up to eight bytes"));
            }
        }
    }
    panic!("{task:?} does not end");
}

/// A fast scan sends about 130 requests.
const MAX_REQUESTS: usize = 1_000;

fn configurations() -> &'static [Config; 3] {
    static CONFIGURATIONS: OnceLock<[Config; 3]> = OnceLock::new();
    CONFIGURATIONS.get_or_init(|| {
        let erob = include_str!("../../configs/single-erob.toml");
        let stored = erob.replace("[[axis]]", "[[axis]]\nmapping = \"as-stored\"");
        [erob, &stored, include_str!("../../configs/gantry-yz-aim.toml")].map(|text| {
            let mut config = Config::parse("example", text).expect("the example is valid");
            config.axes.truncate(1);
            config.axes[0].power_up_ns = 1_000_000;
            config
        })
    })
}

const TIMING: BringUpTiming = BringUpTiming {
    boot_up_timeout_ns: 100_000_000,
    reset_repeat_ns: 30_000_000,
    confirm_timeout_ns: 50_000_000,
    sdo: sdo::SdoTiming { reply_timeout_ns: 5_000_000, retries: 1 },
};
const STEP_NS: u64 = 500_000;
/// Every step of the longest list may time out, and one restart is possible.
const MAX_STEPS: usize = 100_000;

/// A drive is brought up and shut down while frames are lost, duplicated or changed. Both procedures end, and a failure
/// has a reason.
pub fn bring_up(mut input: Input<'_>) {
    let config = &configurations()[usize::from(input.byte()) % 3];
    let mut bus = UnreliableBus { bus: takt::simulated_bus(config, 0), now_ns: 0, input, unchanged: 0 };
    let mut bring_up = BringUp::with_timing(config, TIMING);
    let mut is_started = false;
    for _ in 0..MAX_STEPS {
        bus.step(|now_ns, mut send| bring_up.poll(now_ns, &mut send))
            .iter()
            .for_each(|frame| bring_up.receive(0, frame));
        match bring_up.outcome() {
            None => {}
            Some(Ok(facts)) if !is_started => {
                assert_eq!(facts.len(), config.axes.len());
                bring_up.start().expect("the first stage has succeeded");
                is_started = true;
            }
            Some(Ok(_)) => return shut_down(config, bus),
            Some(Err(error)) => {
                assert!(!error.failures.is_empty() && !error.to_string().is_empty());
                return shut_down(config, bus);
            }
        }
    }
    panic!("the bring-up does not end: {:?}", bring_up.progress());
}

fn shut_down(config: &Config, mut bus: UnreliableBus<'_>) {
    let mut shutdown = Shutdown::new(config);
    for _ in 0..MAX_STEPS {
        bus.step(|now_ns, mut send| shutdown.poll(now_ns, &mut send))
            .iter()
            .for_each(|frame| shutdown.receive(0, frame));
        match shutdown.outcome() {
            None => {}
            Some(Ok(_)) => return,
            Some(Err(error)) => return assert!(!error.to_string().is_empty()),
        }
    }
    panic!("the shutdown does not end");
}

/// A bus that loses, duplicates and changes frames.
struct UnreliableBus<'a> {
    bus: SimulatedBus,
    now_ns: u64,
    input: Input<'a>,
    /// The number of frames that pass unchanged.
    unchanged: u32,
}

impl UnreliableBus<'_> {
    /// Sends the due frames and returns the received ones.
    fn step(&mut self, poll: impl FnOnce(u64, &mut dyn FnMut(usize, Frame))) -> Vec<Frame> {
        self.now_ns += STEP_NS;
        let (bus, now_ns) = (&mut self.bus, self.now_ns);
        poll(now_ns, &mut |_, frame| {
            bus.send(now_ns, &[frame]);
        });
        let mut batch = ReceiveBatch::new();
        self.bus.receive(now_ns, &mut batch);
        batch.iter().flat_map(|received| self.change(received.frame)).collect()
    }

    fn change(&mut self, frame: Frame) -> Vec<Frame> {
        if self.input.is_empty() || self.unchanged > 0 {
            self.unchanged = self.unchanged.saturating_sub(1);
            return vec![frame];
        }
        let other = |at: usize, byte: u8| {
            let mut bytes = frame.payload().to_vec();
            if let Some(target) = bytes.get_mut(at) {
                *target = byte;
            }
            Frame::data(frame.id(), &bytes).expect("as long as before")
        };
        match self.input.byte() {
            count @ 0..200 => {
                self.unchanged = count.into();
                vec![frame]
            }
            200..210 => vec![],
            210..220 => vec![frame; 2],
            220..240 => vec![other(usize::from(self.input.byte()) % 8, self.input.byte())],
            240..248 => vec![Frame::of(frame.id(), self.input.bytes::<8>())],
            _ => vec![self.input.frame(), frame],
        }
    }
}
