//! A bus with simulated eRob joints and a master that the test controls, in virtual time.

use takt::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use takt::sim::homing_switches::ReferenceSwitches;
use takt::sim::plant::{Encoder, JointParameters};
use takt::sim::{Drive, Observation, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch, Received};
use takt_wire::quirks::Quirks;

pub const NODE: u8 = 5;
pub const MILLISECOND_NS: u64 = 1_000_000;
pub const COUNTS_PER_RADIAN: f64 = 524_288.0 / std::f64::consts::TAU;

/// A joint of size 80H-80, whose firmware has no interpolated position.
pub fn parameters(node: u8) -> Cia402Parameters {
    let file = |name| std::path::Path::new("../..").join(name);
    let quirks = takt::config::quirks::load(&file("drives/erob-canopen.toml")).unwrap();
    Cia402Parameters {
        sheet: takt_wire::canopen::eds::load(&file("configs/eds/erob-canopen.eds")).unwrap().dictionary,
        node,
        quirks: Quirks { undeclared_modes: vec![], ..quirks },
        axes: vec![axis()],
        power_up_ns: 5 * MILLISECOND_NS,
        feedback_delay_ns: 20_000,
        seed: 7,
    }
}

/// The joint of [`parameters`].
pub fn axis() -> Cia402AxisParameters {
    Cia402AxisParameters {
        joint: JointParameters {
            inertia: 0.4,
            viscous_friction: 1.5,
            coulomb_friction: 4.0,
            friction_shape: takt::config::FrictionShape::Constant,
            brake_torque: 110.0,
        },
        encoder: Encoder { counts_per_unit: COUNTS_PER_RADIAN, zero_counts: 0.0 },
        counts_per_turn: 524_288.0,
        initial_position: 0.0,
        rated_torque: 31.0,
        peak_torque: 56.0,
        highest_velocity: 4.0,
        switches: ReferenceSwitches::default(),
        end_stops: None,
    }
}

/// A drive with these parameters.
pub fn drive(parameters: Cia402Parameters) -> Cia402Drive {
    Cia402Drive::new(parameters).unwrap()
}

pub struct Bench {
    pub bus: SimulatedBus,
    pub now_ns: u64,
    /// All frames of the drives that the test has not taken yet.
    pub heard: Vec<Received>,
}

impl Bench {
    /// A bus with these modules after their boot-up messages, which are discarded.
    pub fn with(modules: Vec<Cia402Parameters>) -> Self {
        Self::of(modules.into_iter().map(|module| -> Box<dyn Drive> { Box::new(drive(module)) }).collect())
    }

    /// A bus with any drives that boot within 10 ms.
    pub fn of(drives: Vec<Box<dyn Drive>>) -> Self {
        let rates = WireBitRates { nominal: 1_000_000, data: Some(5_000_000) };
        let bus = SimulatedBus::with_drives(rates, u64::MAX, drives);
        let mut bench = Self { bus, now_ns: 0, heard: vec![] };
        bench.run_ns(0);
        bench.run_ms(10);
        bench.heard.clear();
        bench
    }

    /// A bus with the usual module.
    pub fn new() -> Self {
        Self::with(vec![parameters(NODE)])
    }

    /// Lets time pass and collects the received frames.
    pub fn run_ns(&mut self, duration_ns: u64) {
        self.now_ns += duration_ns;
        let mut batch = ReceiveBatch::new();
        loop {
            self.bus.receive(self.now_ns, &mut batch);
            if batch.is_empty() {
                return;
            }
            self.heard.extend(batch.drain(..));
        }
    }

    pub fn run_ms(&mut self, milliseconds: u64) {
        for _ in 0..milliseconds {
            self.run_ns(MILLISECOND_NS);
        }
    }

    pub fn send(&mut self, frame: Frame) {
        assert_eq!(self.bus.send(self.now_ns, &[frame]), 1);
    }

    /// Sends a data frame.
    pub fn send_data<const N: usize>(&mut self, id: u32, bytes: [u8; N]) {
        self.send(Frame::of(Id::base(id).unwrap(), bytes));
    }

    /// Returns the frames received under an identifier since the last call, in order.
    pub fn take(&mut self, id: u32) -> Vec<Vec<u8>> {
        let (mine, others): (Vec<_>, Vec<_>) =
            self.heard.drain(..).partition(|received| received.frame.id().value() == id);
        self.heard = others;
        mine.into_iter().map(|received| received.frame.payload().to_vec()).collect()
    }

    /// Sends one SDO request and returns its reply, which must arrive within 2 ms.
    pub fn sdo(&mut self, request: [u8; 8]) -> [u8; 8] {
        self.send_data(0x600 + u32::from(NODE), request);
        self.run_ms(2);
        let answers = self.take(0x580 + u32::from(NODE));
        assert_eq!(answers.len(), 1, "answers to {request:02X?}");
        answers[0].clone().try_into().unwrap()
    }

    /// Writes an object of this many bytes. The error is the abort code.
    pub fn write(&mut self, index: u16, subindex: u8, bytes: u8, value: i64) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d, ..] = value.to_le_bytes();
        let answer = self.sdo([0x23 | (4 - bytes) << 2, low, high, subindex, a, b, c, d]);
        match answer[0] {
            0x60 => Ok(()),
            0x80 => Err(u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]])),
            other => panic!("answer {other:02X}"),
        }
    }

    /// Reads an object. The error is the abort code.
    pub fn read(&mut self, index: u16, subindex: u8) -> Result<u32, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.sdo([0x40, low, high, subindex, 0, 0, 0, 0]);
        let value = u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]]);
        match answer[0] {
            0x80 => Err(value),
            command => {
                assert_eq!(command & 0xF3, 0x43);
                let unused = u32::from(command >> 2 & 3);
                Ok(value & u32::MAX >> (8 * unused))
            }
        }
    }

    pub fn nmt(&mut self, command: u8) {
        self.send_data(0x000, [command, NODE]);
        self.run_ms(2);
    }

    /// Maps RPDO1 to the controlword and `target` and TPDO1 to statusword and position, both sent at every SYNC.
    /// Then starts the node.
    pub fn start_process_data(&mut self, target: u32) {
        for (communication, mapping, id, objects) in [
            (0x1400, 0x1600, 0x200, [0x6040_0010, target]),
            (0x1800, 0x1A00, 0x180, [0x6041_0010, 0x6064_0020]),
        ] {
            let id = id + i64::from(NODE);
            self.write(communication, 1, 4, 0x8000_0000 | id).unwrap();
            self.write(mapping, 0, 1, 0).unwrap();
            for (object, subindex) in objects.into_iter().zip(1..) {
                self.write(mapping, subindex, 4, object.into()).unwrap();
            }
            self.write(mapping, 0, 1, 2).unwrap();
            self.write(communication, 2, 1, 1).unwrap();
            self.write(communication, 1, 4, id).unwrap();
        }
        self.write(0x1006, 0, 4, 1000).unwrap();
        self.nmt(0x01);
        self.heard.clear();
    }

    /// One cycle of 1 ms: SYNC, then the set-point at 60 %. Returns statusword and position from TPDO1.
    pub fn cycle(&mut self, controlword: u16, target: i32) -> (u16, i32) {
        self.send_data(0x080, []);
        self.run_ns(600_000);
        let [low, high] = controlword.to_le_bytes();
        let [a, b, c, d] = target.to_le_bytes();
        self.send_data(0x200 + u32::from(NODE), [low, high, a, b, c, d]);
        self.run_ns(400_000);
        let tpdo = self.take(0x180 + u32::from(NODE)).pop().expect("TPDO1 after SYNC");
        (u16::from_le_bytes([tpdo[0], tpdo[1]]), i32::from_le_bytes([tpdo[2], tpdo[3], tpdo[4], tpdo[5]]))
    }

    /// Sets a mode and enables the drive with `target` in every set-point. In a position mode it is the actual
    /// position.
    pub fn enable(&mut self, mode: i8, target_object: u32, target: i32) {
        self.write(0x6060, 0, 1, mode.into()).unwrap();
        assert_eq!(self.read(0x6061, 0), Ok(mode as u32));
        self.start_process_data(target_object);
        for controlword in [0x06, 0x07, 0x0F] {
            for _ in 0..3 {
                self.cycle(controlword, target);
            }
        }
        assert_eq!(self.observe().state, takt_rt::DriveState::OperationEnabled);
    }

    pub fn observe(&mut self) -> Observation {
        self.bus.observe(NODE).unwrap()
    }
}
