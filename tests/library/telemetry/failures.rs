use std::fs::{self, OpenOptions};

use takt::link::trace::{TracedPort, traced};
use takt::telemetry::{Logger, Notice, RecordingDestination};
use takt_rt::{BusHealth, BusPort, EventKind, Frame, HostInterface, Id, ReceiveBatch, RequestId};

use crate::telemetry::run::{Disk, Notices, cycle, event, options, run, sides};

/// Records 5000 cycles, many more than a chunk holds, into a destination that fails. Returns the notices.
fn record_into(destination: RecordingDestination) -> Vec<Notice> {
    let (mut rt, _host, log) = sides(8);
    let notices = Notices::default();
    let mut logger = Logger::new(log, options(Some(destination)), notices.sink());
    run(&mut rt, &mut logger, 0..5000);
    let summary = logger.finish();
    assert_eq!((summary.records, summary.records_dropped, summary.statistics.cycles), (5000, 0, 5000));
    assert_eq!(summary.not_written.len(), 1);
    notices.all()
}

fn assert_one_message(notices: &[Notice], beginning: &str, reason: &str) {
    let [Notice::NotWritten(message)] = notices else { panic!("{notices:?}") };
    assert!(message.starts_with(beginning) && message.contains(reason), "{message}");
}

#[test]
fn a_full_disk_ends_the_recording_with_one_message_and_nothing_else() {
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let notices = record_into(RecordingDestination::Stream("/dev/full".to_owned(), Box::new(full)));
    assert_one_message(&notices, "no recording: cannot write /dev/full: ", "No space left");
}

#[test]
fn a_disk_that_becomes_full_at_any_point_gives_one_message() {
    for room in [0, 1, 100, 3_000, 10_000, 100_000, 200_000, 300_000] {
        let disk = Disk::new(room);
        let notices = record_into(disk.destination());
        let beginning = if room <= 3_000 { "no recording: " } else { "the recording ends here: " };
        assert_one_message(&notices, beginning, "cannot write the disk: no storage space");
        assert!(disk.bytes.lock().unwrap().len() <= room);
    }
}

#[test]
fn a_disk_that_becomes_full_at_the_very_end_is_reported_too() {
    let (mut rt, _host, log) = sides(8);
    let (notices, disk) = (Notices::default(), Disk::new(8_000));
    let mut logger = Logger::new(log, options(Some(disk.destination())), notices.sink());
    run(&mut rt, &mut logger, 0..20);
    assert_eq!(notices.all(), []);
    let summary = logger.finish();
    assert_one_message(&notices.all(), "the recording is incomplete: cannot write the disk: ", "no storage");
    assert_eq!(summary.statistics.cycles, 20);
}

#[test]
fn an_unwritable_folder_gives_one_message_with_the_path_and_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("runs");
    fs::write(&file, "a file in place of the folder").unwrap();
    let beginning = format!("no recording: cannot write {}/arm-", file.display());
    assert_one_message(&record_into(RecordingDestination::Directory(file)), &beginning, "exists");
}

#[test]
fn a_full_ring_drops_records_and_counts_them() {
    let (mut rt, _host, log) = sides(8);
    let disk = Disk::new(usize::MAX);
    let mut logger = Logger::new(log, options(Some(disk.destination())), Notices::default().sink());
    assert_eq!((0..20).filter(|slot| rt.record(&cycle(*slot))).count(), 8);
    let accepted = (0..20)
        .filter(|id| rt.event(&event(0, EventKind::MotionFinished { request: RequestId(*id) })))
        .count();
    assert_eq!(accepted, 16);
    assert_eq!(logger.drain(), 24);
    run(&mut rt, &mut logger, 20..30);
    let summary = logger.finish();
    assert_eq!((summary.records, summary.statistics.cycles), (18, 18));
    assert_eq!((summary.records_dropped, summary.events_dropped), (12, 4));
}

struct Silent;

impl BusPort for Silent {
    fn send(&mut self, _now_ns: u64, frames: &[Frame]) -> usize {
        frames.len()
    }

    fn receive(&mut self, _now_ns: u64, _batch: &mut ReceiveBatch) {}

    fn unconfirmed(&mut self, _now_ns: u64) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        BusHealth::default()
    }
}

fn send(port: &mut TracedPort<Silent>, frames: u64) {
    (0..frames).for_each(|at_ns| {
        port.send(at_ns * 1_000_000, &[Frame::of(Id::canopen(0x200, 1), [0; 8])]);
    });
}

#[test]
fn a_candump_log_on_a_full_disk_ends_with_one_message_and_its_traces_do_not_fill_up() {
    let (_rt, _host, log) = sides(8);
    let (mut port, trace) = traced(Silent, "can0", 1000);
    let (notices, disk) = (Notices::default(), Disk::new(50_000));
    let mut options = options(None);
    options.candump = Some(disk.destination());
    options.traces = vec![trace];
    let mut logger = Logger::new(log, options, notices.sink());
    for _ in 0..10 {
        send(&mut port, 1000);
        logger.drain();
    }
    assert_one_message(&notices.all(), "the candump log ends here: cannot write the disk: ", "no storage");
    assert_eq!(logger.finish().frames_dropped, 0);
}
