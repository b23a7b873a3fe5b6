//! Hands cycle records to the logger's ring, publishes snapshots, passes the frames of a cycle through a traced
//! port and a plain one, and runs whole cycles with a journal and without, for counting instructions; see `benches/instructions`.
//!
//! The first argument names the work (`push-AXES`, `publish-AXES`, `traced-AXES`, `untraced-AXES`, `run-6`, `journaled-6`), the second
//! one the number of repetitions. The difference between two repetition counts does not include the start-up. Records are also
//! taken out again. Frames and the journal are not, since that is the work of the logger: their rings hold those of all repetitions,
//! 1300 cycles at most of the journal.

use std::hint::black_box;
use std::path::Path;

use takt::channels::{ChannelSizes, GroupStream, channels};
use takt::controller::AfterBringUp;
use takt::link::trace::{Trace, traced};
use takt::{Config, Phase, VirtualRun};
use takt_rt::{BusHealth, BusPort, CycleRecord, Frame, HostInterface, Id, ReceiveBatch, Received, Snapshot};

/// Frames that a trace holds.
const TRACED: usize = 1 << 18;

/// A bus with drives that answer SYNC.
struct DriveBus {
    drives: u8,
}

impl BusPort for DriveBus {
    fn send(&mut self, _now_ns: u64, frames: &[Frame]) -> usize {
        frames.len()
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        for node in 1..=self.drives {
            let frame = Frame::of(Id::canopen(0x180, node), [0x37, 0x16, 1, 2, 3, 4]);
            batch.push(Received { frame, at_ns: now_ns });
        }
    }

    fn unconfirmed(&mut self, _now_ns: u64) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        BusHealth::default()
    }
}

/// The frames of one cycle: SYNC, an answer and a set-point for every drive.
fn exchange(port: &mut impl BusPort, drives: u8, now_ns: u64) {
    port.send(now_ns, &[Frame::of(Id::canopen(0x080, 0), [])]);
    let mut batch = ReceiveBatch::new();
    port.receive(now_ns, &mut batch);
    black_box(&batch);
    black_box(port.health());
    let set_points: Vec<Frame> =
        (1..=drives).map(|node| Frame::of(Id::canopen(0x200, node), [0x0F, 0, 1, 2, 3, 4])).collect();
    port.send(now_ns, &set_points);
}

/// Runs whole cycles of six simulated drives that hold, on these ports. With `is_noted` everything is noted that a replay needs of them
/// beside what the ports note.
fn run_cycles<P: BusPort>(
    config: &Config,
    ports: Vec<P>,
    mut traces: Vec<Trace>,
    is_noted: bool,
    cycles: u32,
) -> Result<(), Box<dyn std::error::Error>> {
    let (mut run, mut log) = VirtualRun::serving(config, ports, AfterBringUp::Enable)?;
    let mut journal = is_noted.then(|| run.journal());
    while run.snapshot().groups().iter().any(|group| group.phase != Phase::Holding) {
        run.step();
        while log.next_record(|_| ()).is_some() {}
        while log.take_event().is_some() {}
        traces.iter_mut().for_each(|trace| while trace.take_any().is_some() {});
        if let Some(journal) = &mut journal {
            while journal.clock.pop().is_some() {}
            while journal.host.take().is_some() {}
        }
    }
    for _ in 0..cycles {
        run.step();
        log.next_record(|_| ());
    }
    let dropped = journal.map_or(0, |journal| journal.dropped());
    if dropped > 0 {
        return Err(format!("{dropped} entries of the journal found no room").into());
    }
    Ok(())
}

/// The same with a journal as a recording has it, or without one.
fn arm6(is_journaled: bool, cycles: u32) -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let config = Config::load(&path)?;
    let buses = (0..config.buses.len()).map(|bus| takt::simulated_bus(&config, bus));
    if !is_journaled {
        return run_cycles(&config, buses.collect(), vec![], false, cycles);
    }
    let (ports, traces) = buses.map(|bus| traced(bus, "bus", TRACED)).unzip();
    run_cycles(&config, ports, traces, true, cycles)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let work = arguments.first().and_then(|work| work.split_once('-'));
    let numbers =
        (work.and_then(|(_, axes)| axes.parse::<u8>().ok()), arguments.get(1).and_then(|n| n.parse().ok()));
    let (Some((work, _)), (Some(axes), Some(repetitions))) = (work, numbers) else {
        eprintln!(
            "usage: ring_instructions push-AXES|publish-AXES|traced-AXES|untraced-AXES|run-6|journaled-6 REPETITIONS"
        );
        std::process::exit(2);
    };
    let repetitions: u32 = repetitions;
    if let "run" | "journaled" = work {
        return arm6(work == "journaled", repetitions);
    }
    let buses = usize::from(axes).div_ceil(3);
    let (mut rt, _host, mut log) = channels(&ChannelSizes {
        groups: vec![GroupStream::default()],
        axes: axes.into(),
        buses,
        records: 64,
        events: 64,
        requests: 16,
        service_out: 64,
        service_in: 64,
    });
    let record = CycleRecord { axis_count: axes, ..CycleRecord::default() };
    let snapshot = Snapshot { axis_count: axes, bus_count: buses as u8, ..Snapshot::default() };
    let mut plain = DriveBus { drives: axes };
    let (mut port, _trace) = traced(DriveBus { drives: axes }, "bus", TRACED);
    for now_ns in 0..repetitions.into() {
        match work {
            "push" => {
                rt.record(&record);
                log.next_record(|_| ());
            }
            "traced" => exchange(&mut port, axes, now_ns),
            "untraced" => exchange(&mut plain, axes, now_ns),
            _ => rt.publish(&snapshot),
        }
    }
    Ok(())
}
