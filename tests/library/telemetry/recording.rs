use std::fs;
use std::path::Path;

use takt::link::trace::traced;
use takt::telemetry::{Logger, LoggerOptions, RecordingDestination, RecordingOptions};
use takt_rt::{
    BusHealth, BusPort, EventKind, Frame, HostInterface, Id, Phase, ReceiveBatch, Received, RejectReason,
    RequestError, RequestKind,
};

use crate::telemetry::reader::{Fields, Value, messages};
use crate::telemetry::run::{
    CYCLE_NS, Disk, EPOCH_NS, Notices, STOP, UNIX_AT_ZERO_NS, cycle, event, machine, options, run, sides,
};

/// Records twenty cycles and some events, and returns the bytes.
fn record() -> Vec<u8> {
    let (mut rt, _host, log) = sides(8);
    let disk = Disk::new(usize::MAX);
    let mut logger = Logger::new(log, options(Some(disk.destination())), Notices::default().sink());
    rt.event(&event(1, EventKind::PhaseChanged { from: Phase::Holding, to: Phase::Moving }));
    run(&mut rt, &mut logger, 0..20);
    rt.event(&event(7, EventKind::Stop(STOP)));
    rt.event(&event(
        8,
        EventKind::Emergency { axis: 1, code: 0x7305, register: 0x21, manufacturer: [1, 2, 3, 4, 5] },
    ));
    rt.event(&event(
        9,
        EventKind::Rejected(RequestError {
            request: RequestKind::Move,
            reason: RejectReason::PositionLimit { position: 1.25, limit: 0.75 },
            axis: Some(1),
            phase: Phase::Holding,
        }),
    ));
    let summary = logger.finish();
    assert_eq!((summary.records, summary.records_dropped, summary.not_written.len()), (20, 0, 0));
    disk.bytes.lock().unwrap().clone()
}

fn number(value: impl Into<f64>) -> Value {
    Value::Number(value.into())
}

#[test]
fn every_field_can_be_read_by_the_schema_in_the_file() {
    let recording = record();
    for (index, name) in ["shoulder", "slide"].into_iter().enumerate() {
        let messages = messages(&recording, &format!("/axis/{name}"));
        assert_eq!(messages.len(), 20);
        for (slot, (time, fields)) in messages.iter().enumerate() {
            let axis = cycle(slot as u64).axes[index];
            assert_eq!(*time, UNIX_AT_ZERO_NS + EPOCH_NS + slot as u64 * CYCLE_NS);
            let expected = [
                ("slot", number(slot as f64)),
                ("position_set", number(axis.position_set)),
                ("position", number(axis.position)),
                ("velocity_set", number(axis.velocity_set)),
                ("acceleration_set", number(axis.acceleration_set)),
                ("jerk_set", number(axis.jerk_set)),
                ("velocity", number(axis.velocity)),
                ("torque_set", number(axis.torque_set)),
                ("torque", number(axis.torque)),
                ("following_error", number(axis.following_error)),
                ("command_raw", number(axis.command_raw)),
                ("position_raw", number(axis.position_raw)),
                ("controlword", number(axis.controlword)),
                ("statusword", number(axis.statusword)),
                ("error_code", number(axis.error_code)),
                ("feedback_age", number(axis.feedback_age)),
                ("state", number(4)),
            ];
            assert_eq!(*fields, expected.map(|(name, value)| (name.to_owned(), value)).into());
        }
    }
    let (_, group) = &messages(&recording, "/group/all")[3];
    let expected = [
        ("slot", number(3)),
        ("phase", number(4)),
        ("is_stopped", number(0)),
        ("category", number(0)),
        ("rule", number(0)),
        ("is_called", number(0)),
        ("callback_ns", number(0)),
    ];
    assert_eq!(*group, expected.map(|(name, value)| (name.to_owned(), value)).into());
    let (_, times) = &messages(&recording, "/cycle")[3];
    let expected = [
        ("slot", number(3)),
        ("slot_start_ns", number((EPOCH_NS + 3 * CYCLE_NS) as f64)),
        ("wake_ns", number(1003)),
        ("sync_ns", number(2003)),
        ("compute_ns", number(3003)),
        ("sent_ns", number(4003)),
        ("missed_slots", number(1)),
        ("phase", number(4)),
        ("is_commanded", number(0)),
    ];
    assert_eq!(*times, expected.map(|(name, value)| (name.to_owned(), value)).into());
}

#[test]
fn events_are_recorded_as_text_and_as_numbers() {
    let events = messages(&record(), "/events");
    let texts: Vec<_> = events.iter().map(|(_, fields)| fields["text"].clone()).collect();
    let expected = [
        "holding → moving",
        "stop: slide was 0.2500 m from its set-point (allowed: 0.1250 m) while moving; \
         category 1: decelerate, then remove power; try: look for an obstacle or a brake that is not released; then clear the fault \
         and move more slowly",
        "slide: emergency message: error 0x7305 (incremental sensor 1 fault), register 0x21, \
         manufacturer 01 02 03 04 05; try: check the encoder and its cable, then power-cycle the drive",
        "the move was rejected while holding: slide cannot go to 1.2500 m, beyond its position limit of 0.7500 m",
    ];
    assert_eq!(texts, expected.map(|text| Value::Text(text.to_owned())));
    let (time, stop) = &events[1];
    assert_eq!(*time, UNIX_AT_ZERO_NS + EPOCH_NS + 7 * CYCLE_NS);
    for (field, value) in [("kind", 1.0), ("axis", 1.0), ("rule", 5.0), ("value", 0.25), ("limit", 0.125)] {
        assert_eq!(stop[field], number(value), "{field}");
    }
    let (_, emergency) = &events[2];
    for (field, value) in [("error_code", 0x7305), ("error_register", 0x21), ("manufacturer[4]", 5)] {
        assert_eq!(emergency[field], number(value), "{field}");
    }
    let (_, rejection) = &events[3];
    for (field, value) in [("axis", 1.0), ("value", 1.25), ("limit", 0.75), ("request", 7.0), ("reason", 7.0)]
    {
        assert_eq!(rejection[field], number(value), "{field}");
    }
    assert_eq!(events[0].1["axis"], number(-1));
}

#[test]
fn a_recording_has_an_index_and_the_description_of_the_machine() {
    let recording = record();
    let summary = mcap::Summary::read(&recording).unwrap().unwrap();
    let statistics = summary.stats.unwrap();
    // Each event is also in words, and the joint states come a hundred times a second.
    assert_eq!((statistics.message_count, statistics.channel_count), (20 * 4 + 4 * 2 + 2, 8));
    let slide = summary.channels.values().find(|channel| channel.topic == "/axis/slide").unwrap();
    let expected = [
        ("acceleration_limit", "10"),
        ("counts_per_unit", "83443"),
        ("group", "0"),
        ("index", "1"),
        ("jerk_limit", "50"),
        ("name", "slide"),
        ("plans_own_profile", "false"),
        ("unit", "m"),
        ("velocity_limit", "2"),
    ];
    let mut metadata = slide.metadata.clone();
    assert!(metadata.remove("offered_qos_profiles").is_some());
    assert_eq!(metadata, expected.map(|(key, value)| (key.to_owned(), value.to_owned())).into());
    let metadata = mcap::read::metadata(&recording, &summary.metadata_indexes[0]).unwrap();
    assert_eq!((&*metadata.name, &*metadata.metadata["axes"]), ("takt", "shoulder\nslide"));
    assert_eq!(metadata.metadata["cycle_ns"], "1000000");
}

#[test]
fn programs_of_ros_2_find_all_joints_that_have_reported_and_the_events_in_words() {
    let recording = record();
    let joints = messages(&recording, "/joint_states");
    let times: Vec<u64> = joints.iter().map(|(time, _)| time - UNIX_AT_ZERO_NS - EPOCH_NS).collect();
    assert_eq!(times, [0, 10 * CYCLE_NS]);
    let names: Vec<&str> =
        joints[0].1.keys().filter(|name| !name.starts_with("header")).map(|name| &**name).collect();
    assert_eq!(
        names,
        ["effort[0]", "name[0]", "position[0]", "velocity[0]"],
        "the first one has not reported"
    );
    assert_eq!(joints[0].1["name[0]"], Value::Text("slide".to_owned()));
    let (axes, fields) = (cycle(10).axes, &joints[1].1);
    let expected = [
        ("header.stamp.sec", number(1_700_000_000)),
        ("header.stamp.nanosec", number((EPOCH_NS + 10 * CYCLE_NS) as f64)),
        ("header.frame_id", Value::Text(String::new())),
        ("name[0]", Value::Text("shoulder".to_owned())),
        ("name[1]", Value::Text("slide".to_owned())),
        ("position[0]", number(axes[0].position)),
        ("position[1]", number(axes[1].position)),
        ("velocity[0]", number(1.25)),
        ("velocity[1]", number(1.25)),
        ("effort[0]", number(-8.5)),
        ("effort[1]", number(-8.5)),
    ];
    assert_eq!(*fields, expected.map(|(name, value)| (name.to_owned(), value)).into());

    let events = messages(&recording, "/events");
    let log = messages(&recording, "/rosout");
    let of = |fields: &[(u64, Fields)], key: &str| -> Vec<(u64, Value)> {
        fields.iter().map(|(time, fields)| (*time, fields[key].clone())).collect()
    };
    assert_eq!(of(&log, "msg"), of(&events, "text"));
    let levels: Vec<Value> = log.iter().map(|(_, fields)| fields["level"].clone()).collect();
    assert_eq!(levels, [20, 40, 30, 30].map(number), "information, error, and two warnings");
    assert!(log.iter().all(|(_, fields)| fields["name"] == Value::Text("arm".to_owned())));
}

/// A message of a recording: its topic, its time and its bytes.
type RecordedMessage = (String, u64, Vec<u8>);

/// The bytes of a recording of so many cycles, and the messages that are read from it.
fn written(is_compressed: bool, cycles: u64) -> (Vec<u8>, Vec<RecordedMessage>) {
    let (mut rt, _host, log) = sides(8);
    let disk = Disk::new(usize::MAX);
    let recording_options = RecordingOptions { is_compressed, ..RecordingOptions::default() };
    let options = LoggerOptions { recording_options, ..options(Some(disk.destination())) };
    let mut logger = Logger::new(log, options, Notices::default().sink());
    run(&mut rt, &mut logger, 0..cycles);
    logger.finish();
    let bytes = disk.bytes.lock().unwrap().clone();
    let stream = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let messages =
        stream.map(|message| (message.channel.topic.clone(), message.log_time, message.data.to_vec()));
    let messages = messages.collect();
    (bytes, messages)
}

#[test]
fn a_compressed_recording_has_the_same_messages_in_less_than_a_third_of_the_bytes() {
    let (compressed, of_compressed) = written(true, 2000);
    let (plain, of_plain) = written(false, 2000);
    assert_eq!(of_compressed, of_plain);
    assert!(compressed.len() * 3 < plain.len(), "{} of {} bytes", compressed.len(), plain.len());
}

#[test]
fn a_recording_in_several_files_keeps_the_newest_each_of_which_can_be_read_alone() {
    const LIMIT: u64 = 1 << 20;
    let folder = tempfile::tempdir().unwrap();
    let (mut rt, _host, log) = sides(8);
    let recording_options =
        RecordingOptions { is_compressed: false, size_limit_bytes: Some(LIMIT), keep: Some(3) };
    let destination = RecordingDestination::File(folder.path().join("run.mcap"));
    let options = LoggerOptions { recording_options, ..options(Some(destination)) };
    let mut logger = Logger::new(log, options, Notices::default().sink());
    run(&mut rt, &mut logger, 0..12_000);
    let summary = logger.finish();
    assert_eq!(summary.not_written, [""; 0]);
    let files: Vec<_> = summary.earlier_recordings.into_iter().chain(summary.recording).collect();
    let mut found: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    assert_eq!((files.len(), &files), (3, &found), "the order of the names is that of time");
    let first = summary.recordings_removed + 1;
    assert!(first > 3, "{first}");
    let mut next_slot = None;
    for (number, file) in (first..).zip(&files) {
        assert_eq!(file.file_name().unwrap().to_str().unwrap(), format!("run.{number:04}.mcap"));
        let bytes = fs::read(file).unwrap();
        assert!(bytes.len() as u64 <= LIMIT, "{} bytes", bytes.len());
        let slots: Vec<f64> = messages(&bytes, "/cycle")
            .iter()
            .map(|(_, fields)| match fields["slot"] {
                Value::Number(slot) => slot,
                Value::Text(_) => panic!("a slot is a number"),
            })
            .collect();
        assert!(slots.windows(2).all(|pair| pair[1] == pair[0] + 1.0));
        assert_eq!(next_slot.unwrap_or(slots[0]), slots[0], "no cycle between two files is lost");
        next_slot = slots.last().map(|last| last + 1.0);
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let recorded =
            summary.metadata_indexes.iter().map(|index| mcap::read::metadata(&bytes, index).unwrap());
        let part = recorded.clone().find(|metadata| metadata.name == "part").unwrap();
        assert_eq!(
            (&*part.metadata["first"], &*part.metadata["number"]),
            ("run.0001.mcap", &*number.to_string())
        );
        assert!(recorded.clone().any(|metadata| metadata.name == "takt"));
    }
    assert_eq!(next_slot, Some(12_000.0));
}

#[test]
fn the_same_run_leaves_the_same_bytes() {
    assert_eq!(record(), record());
}

#[test]
fn a_recording_that_is_cut_off_can_be_read_up_to_its_last_chunk() {
    let (mut rt, _host, log) = sides(8);
    let disk = Disk::new(usize::MAX);
    let mut logger = Logger::new(log, options(Some(disk.destination())), Notices::default().sink());
    run(&mut rt, &mut logger, 0..3000);
    let written = disk.bytes.lock().unwrap().clone();
    let read = cycles_of_unfinished(&written);
    assert!((2000..3000).contains(&read), "{read} cycles");
}

/// The cycles in the bytes that were written before the end.
fn cycles_of_unfinished(written: &[u8]) -> usize {
    let whole =
        mcap::read::MessageStream::new_with_options(written, mcap::read::Options::IgnoreEndMagic.into());
    let messages = whole.unwrap().map_while(Result::ok);
    messages.filter(|message| message.channel.topic == "/cycle").count()
}

#[test]
fn a_crash_loses_at_most_a_second_of_a_recording_of_few_axes() {
    let (mut rt, _host, log) = sides(8);
    let disk = Disk::new(usize::MAX);
    let mut options = options(Some(disk.destination()));
    options.machine.axes.clear();
    let mut logger = Logger::new(log, options, Notices::default().sink());
    for seconds in 1..5 {
        run(&mut rt, &mut logger, (seconds - 1) * 1000..seconds * 1000);
        let read = cycles_of_unfinished(&disk.bytes.lock().unwrap());
        assert!(read as u64 + 1001 >= seconds * 1000, "{read} cycles of {seconds} s");
    }
}

#[test]
fn recordings_are_named_after_machine_and_time_and_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let record = || {
        let (mut rt, _host, log) = sides(8);
        let directory = RecordingDestination::Directory(folder.path().join("runs"));
        let mut logger = Logger::new(log, options(Some(directory)), Notices::default().sink());
        run(&mut rt, &mut logger, 0..5);
        logger.finish().recording.unwrap()
    };
    let paths = [record(), record()];
    let names = paths.each_ref().map(|path| path.file_name().unwrap().to_owned());
    assert_eq!(names, ["arm-20231114T221320Z.mcap", "arm-20231114T221320Z-2.mcap"]);
    for path in &paths {
        assert_eq!(messages(&fs::read(path).unwrap(), "/cycle").len(), 5);
    }
}

/// Receives one frame that arrived 50 µs earlier.
struct Port;

impl BusPort for Port {
    fn send(&mut self, _now_ns: u64, frames: &[Frame]) -> usize {
        frames.len()
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        let frame = Frame::of(Id::canopen(0x180, 1), [0x37, 0x16]);
        batch.push(Received { frame, at_ns: now_ns - 50_000 });
    }

    fn unconfirmed(&mut self, _now_ns: u64) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        BusHealth::default()
    }
}

#[test]
fn a_candump_log_has_every_frame_of_every_bus_in_the_order_of_time() {
    let folder = tempfile::tempdir().unwrap();
    let (_rt, _host, log) = sides(8);
    let ((mut left, left_trace), (mut right, right_trace)) =
        (traced(Port, "can0", 64), traced(Port, "sim right", 64));
    let mut options = options(None);
    options.candump = Some(RecordingDestination::Directory(folder.path().to_owned()));
    options.traces = vec![left_trace, right_trace];
    let mut logger = Logger::new(log, options, Notices::default().sink());

    let sync = [Frame::of(Id::canopen(0x080, 0), [])];
    left.send(1_000_000, &sync);
    right.send(1_010_000, &sync);
    left.receive(1_070_000, &mut ReceiveBatch::new());
    right.receive(1_055_000, &mut ReceiveBatch::new());
    logger.drain();
    let fd = Frame::fd(Id::extended(0x123).unwrap(), &[1, 2], true).unwrap();
    left.send(2_000_000, &[fd, Frame::remote(Id::base(0x701).unwrap(), 1).unwrap()]);

    let path = logger.finish().candump.unwrap();
    assert_eq!(path.file_name().unwrap(), Path::new("arm-20231114T221320Z.log"));
    let expected = "(1700000000.001000) can0 080#\n\
                    (1700000000.001005) sim_right 181#3716\n\
                    (1700000000.001010) sim_right 080#\n\
                    (1700000000.001020) can0 181#3716\n\
                    (1700000000.002000) can0 00000123##10102\n\
                    (1700000000.002000) can0 701#R1\n";
    assert_eq!(fs::read_to_string(path).unwrap(), expected);
}

#[test]
fn a_machine_without_axes_can_be_recorded() {
    let (_rt, _host, log) = sides(8);
    let disk = Disk::new(usize::MAX);
    let mut options = options(Some(disk.destination()));
    options.machine.axes.clear();
    let summary = Logger::new(log, options, Notices::default().sink()).finish();
    assert_eq!(summary.not_written, [""; 0]);
    assert_eq!(messages(&disk.bytes.lock().unwrap(), "/cycle").len(), 0);
    assert_eq!(machine().axis_name(7), "axis 7");
}
