//! What the simulation costs inside the real-time loop: one cycle of 1 ms on one bus, with SYNC, a set-point for every
//! drive, and everything the drives answer.
#![allow(missing_docs, reason = "made by the macros of the framework")]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use takt::config::quirks;
use takt::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use takt::sim::homing_switches::ReferenceSwitches;
use takt::sim::plant::{Encoder, JointParameters};
use takt::sim::{Drive, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
use takt_wire::canopen::eds;
use takt_wire::wire_length::WireLength;

fn drive(node: u8) -> Box<dyn Drive> {
    let axis = Cia402AxisParameters {
        joint: JointParameters {
            inertia: 0.4,
            viscous_friction: 1.5,
            coulomb_friction: 4.0,
            friction_shape: takt::config::FrictionShape::Constant,
            brake_torque: 110.0,
        },
        encoder: Encoder { counts_per_unit: 83_443.0, zero_counts: 0.0 },
        counts_per_turn: 524_288.0,
        initial_position: 0.0,
        rated_torque: 31.0,
        peak_torque: 56.0,
        highest_velocity: 4.0,
        switches: ReferenceSwitches::default(),
        end_stops: None,
    };
    let parameters = Cia402Parameters {
        sheet: eds::load("configs/eds/erob-canopen.eds".as_ref()).unwrap().dictionary,
        node,
        quirks: quirks::load("drives/erob-canopen.toml".as_ref()).unwrap(),
        axes: vec![axis],
        power_up_ns: 0,
        feedback_delay_ns: 20_000,
        seed: 7,
    };
    Box::new(Cia402Drive::new(parameters).unwrap())
}

/// A bus at 1 Mbit/s whose drives follow CSP set-points of six bytes.
struct Running {
    bus: SimulatedBus,
    drives: u8,
    cycle: u64,
}

impl Running {
    fn new(drives: u8) -> Self {
        let rates = WireBitRates { nominal: 1_000_000, data: None };
        let bus = SimulatedBus::with_drives(rates, u64::MAX, (1..=drives).map(drive).collect());
        let mut running = Self { bus, drives, cycle: 0 };
        for node in 1..=drives {
            for request in [
                [0x2F, 0x60, 0x60, 0, 8, 0, 0, 0],
                [0x23, 0x00, 0x14, 1, node, 0x02, 0, 0x80],
                [0x2F, 0x00, 0x16, 0, 0, 0, 0, 0],
                [0x23, 0x00, 0x16, 2, 0x20, 0, 0x7A, 0x60],
                [0x2F, 0x00, 0x16, 0, 2, 0, 0, 0],
                [0x2F, 0x00, 0x14, 2, 1, 0, 0, 0],
                [0x23, 0x00, 0x14, 1, node, 0x02, 0, 0],
                [0x23, 0x00, 0x18, 1, 0x80 + node, 0x01, 0, 0x80],
                [0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0],
                [0x23, 0x00, 0x1A, 2, 0x20, 0, 0x64, 0x60],
                [0x2F, 0x00, 0x1A, 0, 2, 0, 0, 0],
                [0x2F, 0x00, 0x18, 2, 1, 0, 0, 0],
                [0x23, 0x00, 0x18, 1, 0x80 + node, 0x01, 0, 0],
                [0x23, 0x06, 0x10, 0, 0xE8, 0x03, 0, 0],
            ] {
                running.pass(&[Frame::of(Id::canopen(0x600, node), request)], 2);
            }
        }
        running.pass(&[Frame::of(Id::canopen(0x000, 0), [1, 0])], 2);
        for controlword in [0x06, 0x07, 0x0F] {
            for _ in 0..5 {
                running.run_cycle(controlword);
            }
        }
        for node in 1..=drives {
            assert_eq!(running.bus.observe(node).map(|seen| seen.state as u8), Ok(4));
        }
        running
    }

    fn pass(&mut self, frames: &[Frame], milliseconds: u64) {
        self.bus.send(self.cycle * 1_000_000, frames);
        self.cycle += milliseconds;
        self.bus.receive(self.cycle * 1_000_000, &mut ReceiveBatch::new());
    }

    fn run_cycle(&mut self, controlword: u8) -> usize {
        let start_ns = self.cycle * 1_000_000;
        self.bus.send(start_ns, &[Frame::of(Id::canopen(0x080, 0), [])]);
        let mut batch = ReceiveBatch::new();
        self.bus.receive(start_ns + 550_000, &mut batch);
        let [a, b, c, d] = (60 * self.cycle as u32).to_le_bytes();
        for node in 1..=self.drives {
            let set_point = Frame::of(Id::canopen(0x200, node), [controlword, 0, a, b, c, d]);
            self.bus.send(start_ns + 555_000, &[set_point]);
        }
        self.cycle += 1;
        batch.len()
    }
}

fn cycle(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("simulated bus, 1 ms");
    for drives in [1, 3, 4] {
        let mut running = Running::new(drives);
        group.bench_function(BenchmarkId::from_parameter(format!("{drives} drives")), |bencher| {
            bencher.iter(|| running.run_cycle(0x0F));
        });
    }
    group.finish();
}

fn wire(criterion: &mut Criterion) {
    let frame = Frame::of(Id::canopen(0x200, 5), [0x0F, 0x00, 0x12, 0x34, 0x05, 0x00]);
    criterion.bench_function("bits of a frame of six bytes", |bencher| {
        bencher.iter(|| WireLength::of(std::hint::black_box(&frame)));
    });
}

criterion_group!(benches, cycle, wire);
criterion_main!(benches);
