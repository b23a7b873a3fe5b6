use std::fs;
use std::path::{Path, PathBuf};

use takt::channels::RtSide;
use takt::link::trace::{TracedPort, traced};
use takt::telemetry::{BlackBoxOptions, Incident, LogSummary, Logger, LoggerOptions, Notice};
use takt_rt::{
    BusHealth, BusPort, BusState, CycleRecord, DriveState, EventKind, Frame, HostInterface, Id, Phase,
    ReceiveBatch, Received, Rule, StopCause, StopReason,
};

use crate::telemetry::reader::{Value, messages};
use crate::telemetry::run::{
    CYCLE_NS, EPOCH_NS, Notices, STOP, UNIX_AT_ZERO_NS, all_in, cycle, event, options, sides,
};

/// A bus on which a drive answers every SYNC, until the bus fails.
struct Bus {
    health: BusHealth,
}

impl BusPort for Bus {
    fn send(&mut self, _now_ns: u64, frames: &[Frame]) -> usize {
        frames.len()
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        batch.push(Received { frame: answer(), at_ns: now_ns - 100 });
    }

    fn unconfirmed(&mut self, _now_ns: u64) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        self.health
    }
}

fn sync() -> Frame {
    Frame::of(Id::canopen(0x080, 0), [])
}

fn answer() -> Frame {
    Frame::of(Id::canopen(0x180, 1), [0x37, 0x16])
}

const SPAN_NS: u64 = 1_000_000_000;

/// A run with a black box of one second.
struct Run {
    rt: RtSide,
    logger: Logger,
    port: TracedPort<Bus>,
    notices: Notices,
    slot: u64,
}

impl Run {
    fn new(directory: &Path) -> Self {
        Self::with(directory, Notices::default(), |notices| notices.sink())
    }

    fn with(
        directory: &Path,
        notices: Notices,
        sink: impl FnOnce(&Notices) -> Box<dyn FnMut(&Notice) + Send>,
    ) -> Self {
        let (rt, _host, log) = sides(8);
        let (port, trace) = traced(Bus { health: BusHealth::default() }, "left", 64);
        let options = LoggerOptions {
            black_box: Some(BlackBoxOptions { span_ns: SPAN_NS, directory: directory.to_owned() }),
            traces: vec![trace],
            ..options(None)
        };
        let logger = Logger::new(log, options, sink(&notices));
        Self { rt, logger, port, notices, slot: 0 }
    }

    fn cycles(&mut self, count: u64) {
        for _ in 0..count {
            let start_ns = EPOCH_NS + self.slot * CYCLE_NS;
            self.port.send(start_ns, &[sync()]);
            self.port.receive(start_ns + 500_000, &mut ReceiveBatch::new());
            self.port.health();
            assert!(self.rt.record(&cycle(self.slot)));
            self.logger.drain();
            self.slot += 1;
        }
    }

    fn stop(&mut self, rule: Rule) {
        let cause = StopCause::from_numbers(rule, 0.25, 8.0).unwrap();
        let stop = StopReason { cause, slot: self.slot, ..STOP };
        self.rt.event(&event(self.slot, EventKind::Stop(stop)));
    }

    fn finish(self) -> LogSummary {
        self.logger.finish()
    }
}

fn slots(recording: &[u8]) -> Vec<u64> {
    let number = |value: &Value| if let Value::Number(number) = value { *number as u64 } else { 0 };
    messages(recording, "/cycle").iter().map(|(_, fields)| number(&fields["slot"])).collect()
}

fn metadata(recording: &[u8]) -> Vec<std::collections::BTreeMap<String, String>> {
    let summary = mcap::Summary::read(recording).unwrap().unwrap();
    let named = summary.metadata_indexes.iter().filter(|index| index.name == "black_box");
    named.map(|index| mcap::read::metadata(recording, index).unwrap().metadata).collect()
}

fn names(files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|path| path.file_name().unwrap().to_str().unwrap().to_owned()).collect()
}

#[test]
fn a_fault_writes_the_last_second_and_the_next_half_second_without_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.cycles(3000);
    run.stop(Rule::FollowingError);
    run.cycles(2000);
    let summary = run.finish();
    assert_eq!(summary.recording, None);
    assert_eq!(names(&summary.black_boxes.files), ["arm-20231114T221323Z-black-box-following_error.mcap"]);
    let bytes = fs::read(&summary.black_boxes.files[0]).unwrap();
    // The event came with the record of slot 3000.
    assert_eq!(slots(&bytes), (2001..=3500).collect::<Vec<_>>());
    assert_eq!(messages(&bytes, "/axis/slide").len(), 1500);
    let text = &messages(&bytes, "/events")[0].1["text"];
    assert!(matches!(text, Value::Text(text) if text.starts_with("stop: slide was 0.2500 m")), "{text:?}");
}

#[test]
fn it_has_the_frames_of_every_bus_with_their_direction_and_the_health_of_the_bus() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.cycles(10);
    run.stop(Rule::BusLost);
    run.cycles(10);
    let bytes = fs::read(&run.finish().black_boxes.files[0]).unwrap();
    let frames = messages(&bytes, "/frames/left");
    assert_eq!(frames.len(), 40);
    let (time, sent) = &frames[0];
    assert_eq!(*time, UNIX_AT_ZERO_NS + EPOCH_NS);
    assert_eq!((&sent["text"], &sent["is_sent"]), (&Value::Text("080#".to_owned()), &Value::Number(1.0)));
    let (time, received) = &frames[1];
    assert_eq!(*time, UNIX_AT_ZERO_NS + EPOCH_NS + 499_900);
    assert_eq!(received["text"], Value::Text("181#3716".to_owned()));
    for (field, value) in [("id", 0x181), ("length", 2), ("data[0]", 0x37), ("data[1]", 0x16), ("is_sent", 0)]
    {
        assert_eq!(received[field], Value::Number(value.into()), "{field}");
    }
    assert_eq!(messages(&bytes, "/bus/left").len(), 0, "the bus was sound");
}

#[test]
fn it_has_the_errors_of_a_bus_when_they_have_changed() {
    let folder = tempfile::tempdir().unwrap();
    let (rt, _host, log) = sides(8);
    let health =
        BusHealth { state: BusState::ErrorPassive, errors: 7, tx_overruns: 2, ..BusHealth::default() };
    let (port, trace) = traced(Bus { health }, "left", 64);
    let black_box = Some(BlackBoxOptions { span_ns: SPAN_NS, directory: folder.path().to_owned() });
    let options = LoggerOptions { black_box, traces: vec![trace], ..options(None) };
    let logger = Logger::new(log, options, Notices::default().sink());
    let mut run = Run { rt, logger, port, notices: Notices::default(), slot: 0 };
    run.cycles(5);
    run.stop(Rule::BusLost);
    run.cycles(5);
    let bytes = fs::read(&run.finish().black_boxes.files[0]).unwrap();
    let told = messages(&bytes, "/bus/left");
    assert_eq!(told.len(), 1);
    for (field, value) in [("state", 1), ("errors", 7), ("tx_overruns", 2)] {
        assert_eq!(told[0].1[field], Value::Number(value.into()), "{field}");
    }
}

#[test]
fn the_metadata_has_the_reason_and_a_fault_that_follows_at_once_is_in_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.cycles(50);
    run.stop(Rule::FollowingError);
    run.cycles(400);
    run.stop(Rule::DriveFault);
    run.cycles(1000);
    let summary = run.finish();
    assert_eq!(summary.black_boxes.files.len(), 1);
    let bytes = fs::read(&summary.black_boxes.files[0]).unwrap();
    let metadata = metadata(&bytes);
    let rules: Vec<_> = metadata.iter().map(|fault| &*fault["rule"]).collect();
    assert_eq!(rules, ["following_error", "drive_fault"]);
    for (key, value) in [
        ("category", "1"),
        ("axis", "slide"),
        ("value", "0.25"),
        ("limit", "8"),
        ("slot", "50"),
        ("phase", "moving"),
    ] {
        assert_eq!(metadata[0][key], value, "{key}");
    }
    assert!(metadata[0]["reason"].starts_with("slide was 0.2500 m from its set-point"), "{metadata:?}");
    assert_eq!(slots(&bytes).last(), Some(&950), "half a second after the second fault");
}

#[test]
fn a_run_that_ends_soon_after_the_fault_leaves_a_complete_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.cycles(50);
    run.stop(Rule::FollowingError);
    run.cycles(20);
    let bytes = fs::read(&run.finish().black_boxes.files[0]).unwrap();
    assert_eq!(slots(&bytes), (0..70).collect::<Vec<_>>());
}

#[test]
fn the_history_is_in_the_file_as_soon_as_the_fault_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.cycles(500);
    run.stop(Rule::FollowingError);
    run.cycles(1);
    let path = fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    let bytes = fs::read(path).unwrap();
    let stream = mcap::MessageStream::new_with_options(&bytes, mcap::read::Options::IgnoreEndMagic.into());
    let read = stream.unwrap().map_while(Result::ok).filter(|message| message.channel.topic == "/cycle");
    assert_eq!(read.count(), 501);
}

#[test]
fn a_requested_stop_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.cycles(50);
    run.stop(Rule::Requested);
    run.cycles(1000);
    assert_eq!(run.finish().black_boxes.files, [""; 0].map(PathBuf::from));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_new_drive_fault_without_power_is_an_incident_and_an_old_one_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    let faulted = |slot| {
        event(slot, EventKind::DriveState { axis: 0, state: DriveState::decode(0x0008), statusword: 0x0008 })
    };
    let disabled = |run: &mut Run, count: u64| {
        for _ in 0..count {
            let record = CycleRecord { groups: all_in(Phase::Disabled), ..cycle(run.slot) };
            assert!(run.rt.record(&record));
            run.logger.drain();
            run.slot += 1;
        }
    };
    run.rt.event(&faulted(0));
    disabled(&mut run, 10);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    run.rt.event(&event(
        10,
        EventKind::DriveState { axis: 0, state: DriveState::decode(0x0250), statusword: 0x0250 },
    ));
    disabled(&mut run, 10);
    run.rt.event(&faulted(20));
    disabled(&mut run, 10);
    let summary = run.finish();
    assert_eq!(names(&summary.black_boxes.files), ["arm-20231114T221320Z-black-box-drive_fault.mcap"]);
    let bytes = fs::read(&summary.black_boxes.files[0]).unwrap();
    let metadata = &metadata(&bytes)[0];
    assert_eq!((&*metadata["axis"], &*metadata["phase"]), ("shoulder", "disabled"));
    assert_eq!(metadata["value"], 0x7305.to_string());
}

#[test]
fn a_drive_fault_that_stops_the_group_is_one_incident_even_if_it_is_seen_after_the_power_is_off() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.rt.event(&event(
        0,
        EventKind::DriveState { axis: 1, state: DriveState::decode(0x0237), statusword: 0x0237 },
    ));
    run.cycles(10);
    run.rt.event(&event(
        10,
        EventKind::DriveState { axis: 1, state: DriveState::decode(0x0008), statusword: 0x0008 },
    ));
    run.stop(Rule::DriveFault);
    run.rt.record(&CycleRecord { groups: all_in(Phase::Disabled), ..cycle(10) });
    let summary = run.finish();
    let bytes = fs::read(&summary.black_boxes.files[0]).unwrap();
    assert_eq!((summary.black_boxes.files.len(), metadata(&bytes).len()), (1, 1));
    assert_eq!(metadata(&bytes)[0]["phase"], "moving");
}

#[test]
fn of_many_incidents_the_first_fifteen_and_the_last_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    for _ in 0..20 {
        run.cycles(600);
        run.stop(Rule::FollowingError);
    }
    run.cycles(600);
    let summary = run.finish();
    assert_eq!((summary.black_boxes.files.len(), summary.black_boxes.replaced), (16, 4));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 16);
    let faults: Vec<u64> = summary
        .black_boxes
        .files
        .iter()
        .map(|path| metadata(&fs::read(path).unwrap())[0]["slot"].parse().unwrap())
        .collect();
    let expected: Vec<u64> = (1..=15).chain([20]).map(|fault| fault * 600).collect();
    assert_eq!(faults, expected);
}

#[test]
fn an_unwritable_folder_is_reported_once_and_the_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("runs");
    fs::write(&file, "a file in place of the folder").unwrap();
    let mut run = Run::new(&file);
    for _ in 0..3 {
        run.cycles(600);
        run.stop(Rule::FollowingError);
    }
    run.cycles(100);
    let notices = run.notices.clone();
    let summary = run.finish();
    assert_eq!((summary.records, summary.statistics.cycles), (1900, 1900));
    let told: Vec<_> = notices
        .all()
        .into_iter()
        .filter_map(|notice| if let Notice::NotWritten(message) = notice { Some(message) } else { None })
        .collect();
    assert_eq!(told, summary.not_written);
    assert!(told.len() == 1 && told[0].starts_with("no black box: cannot write "), "{told:?}");
}

#[test]
fn the_death_of_the_real_time_thread_is_an_incident_even_before_its_first_cycle() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(folder.path());
    run.logger.incident(&Incident::ThreadDied);
    let summary = run.finish();
    assert_eq!(names(&summary.black_boxes.files), ["arm-20231114T221320Z-black-box-thread_died.mcap"]);
    let bytes = fs::read(&summary.black_boxes.files[0]).unwrap();
    assert_eq!(metadata(&bytes)[0]["reason"], "the real-time thread ended by itself");
}

#[test]
fn a_file_that_is_removed_is_not_listed() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(&folder.path().join("runs"));
    run.cycles(50);
    run.stop(Rule::FollowingError);
    run.cycles(20);
    fs::remove_dir_all(folder.path().join("runs")).unwrap();
    run.cycles(1000);
    run.stop(Rule::DriveFault);
    run.cycles(20);
    let summary = run.finish();
    assert_eq!(names(&summary.black_boxes.files), ["arm-20231114T221321Z-black-box-drive_fault.mcap"]);
    assert!(summary.not_written[0].ends_with("was removed during the run"), "{:?}", summary.not_written);
}

#[test]
fn a_callback_that_panics_is_not_called_again_and_everything_is_still_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let notices = Notices::default();
    let mut run = Run::with(folder.path(), notices.clone(), |notices| {
        let mut sink = notices.sink();
        Box::new(move |notice| {
            sink(notice);
            panic!("the caller's mistake");
        })
    });
    let panic = run.logger.panic();
    run.cycles(10);
    assert_eq!(panic.get(), None);
    for _ in 0..3 {
        run.rt.event(&event(run.slot, EventKind::MissedSlots { count: 1 }));
        run.cycles(10);
    }
    assert_eq!(panic.get().map(String::as_str), Some("the caller's mistake"));
    assert_eq!(notices.all().len(), 1);
    let summary = run.finish();
    assert_eq!(summary.statistics.cycles, 40);
    let bytes = fs::read(&summary.black_boxes.files[0]).unwrap();
    assert_eq!(metadata(&bytes)[0]["reason"], "a function of the caller panicked: the caller's mistake");
    assert_eq!(messages(&bytes, "/events").len(), 3);
}
