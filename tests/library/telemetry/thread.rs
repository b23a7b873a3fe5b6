use std::fs;

use takt::telemetry::LoggerThread;
use takt::telemetry::{Logger, Notice, RecordingDestination};
use takt_rt::{EventKind, HostInterface, RequestId};

use crate::telemetry::reader::messages;
use crate::telemetry::run::{Notices, cycle, event, options, sides};

#[test]
fn the_thread_writes_everything_that_was_handed_over_before_finish() {
    let folder = tempfile::tempdir().unwrap();
    let (mut rt, _host, log) = sides(64);
    let notices = Notices::default();
    let options = options(Some(RecordingDestination::File(folder.path().join("run.mcap"))));
    let thread = LoggerThread::start(Logger::new(log, options, notices.sink())).unwrap();
    let last = event(999, EventKind::MotionFinished { request: RequestId(4) });
    let mut dropped = 0;
    for slot in 0..1000 {
        while !rt.record(&cycle(slot)) {
            dropped += 1;
            std::thread::yield_now();
        }
    }
    assert!(rt.event(&last));
    let summary = thread.finish();
    assert_eq!((summary.records, summary.records_dropped, summary.statistics.cycles), (1000, dropped, 1000));
    assert_eq!(notices.all(), [Notice::Event(last)]);
    let recording = fs::read(summary.recording.unwrap()).unwrap();
    assert_eq!(messages(&recording, "/cycle").len(), 1000);
    assert_eq!(messages(&recording, "/events").len(), 1);
}
