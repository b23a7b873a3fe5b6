//! Hands cycle records to the logger's ring and publishes snapshots, for counting instructions; see
//! `benches/instructions`.
//!
//! The work is named by the first argument (`push-AXES`, `publish-AXES`) and repeated as often as the second says; the
//! difference between two repetition counts is free of the start-up. Each pushed record is also taken again.

use takt::controller::channels::{ChannelSizes, channels};
use takt_rt::door::{Door, Snapshot};
use takt_rt::record::CycleRecord;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let work = arguments.first().and_then(|work| work.split_once('-'));
    let numbers =
        (work.and_then(|(_, axes)| axes.parse::<u8>().ok()), arguments.get(1).and_then(|n| n.parse().ok()));
    let (Some((work, _)), (Some(axes), Some(repetitions))) = (work, numbers) else {
        eprintln!("usage: ring_instructions push-AXES|publish-AXES REPETITIONS");
        std::process::exit(2);
    };
    let repetitions: u32 = repetitions;
    let buses = usize::from(axes).div_ceil(3);
    let (mut rt, _host, mut log) = channels(&ChannelSizes {
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
    for _ in 0..repetitions {
        if work == "push" {
            rt.record(&record);
            log.next_record(|_| ());
        } else {
            rt.publish(&snapshot);
        }
    }
}
