//! The slots of the cycle records, which circulate between the real-time thread and the logger.

use loom::thread;
use takt_loom::records::{RecordConsumer, record_ring};
use takt_rt::{AxisRecord, CycleRecord};

const PUSHES: u64 = 4;

/// A record that has its number at its beginning and at its end.
fn record(number: u64) -> CycleRecord {
    let mut record = CycleRecord { axis_count: 1, ..CycleRecord::default() };
    record.timing.slot = number;
    record.axes[0] = AxisRecord { position: number as f64, ..AxisRecord::default() };
    record
}

fn next(consumer: &mut RecordConsumer) -> Option<u64> {
    consumer.next(|record| {
        assert_eq!(record.axes()[0].position, record.timing.slot as f64, "a record of two cycles");
        record.timing.slot
    })
}

#[test]
fn under_every_schedule_records_arrive_whole_and_in_order_and_no_slot_is_lost() {
    for capacity in 1..=2 {
        loom::model(move || {
            let (mut producer, mut consumer) = record_ring(capacity);
            let pushing = thread::spawn(move || {
                let pushed =
                    (1..=PUSHES).filter(|number| producer.push(&record(*number))).collect::<Vec<_>>();
                (producer, pushed)
            });
            let mut arrived = (0..2).filter_map(|_| next(&mut consumer)).collect::<Vec<_>>();
            let (mut producer, pushed) = pushing.join().unwrap();
            arrived.extend(std::iter::from_fn(|| next(&mut consumer)));
            assert_eq!(arrived, pushed);
            assert_eq!(consumer.dropped(), PUSHES - pushed.len() as u64);
            // All slots have been returned: as many records find room as at the start.
            let room = (1..=2 * capacity as u64).filter(|number| producer.push(&record(*number))).count();
            assert_eq!(room, capacity);
        });
    }
}
