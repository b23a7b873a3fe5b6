//! What is fuzzed for hours elsewhere (`fuzz/run`), for a moment here: the inputs that are kept in `fuzz/seeds`, and some
//! thousands of random ones.

use std::path::Path;

use proptest::prelude::*;
use takt::config::DriveFamily;
use takt::family::{EROB_CANOPEN, YZ_AIM};
use takt_rt::{OperationMode, Phase, Rule};

#[path = "../../fuzz/subjects/mod.rs"]
mod subjects;

use subjects::engine::Journey;

fn seeds(name: &str) -> Vec<Vec<u8>> {
    let folder = match name {
        // The descriptions that come with takt.
        "field_description" => "drives/bit-fields".to_owned(),
        name => format!("fuzz/seeds/{name}"),
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "no seeds for {name}");
    paths.into_iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// A seed with some bytes replaced and its end cut off: what lies near something sound goes further than noise does.
fn mutated(name: &str) -> impl Strategy<Value = Vec<u8>> + use<> {
    let changes = proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8);
    (prop::sample::select(seeds(name)), changes, any::<prop::sample::Index>(), any::<bool>()).prop_map(
        |(mut bytes, changes, cut, is_cut)| {
            for (at, byte) in changes {
                let at = at.index(bytes.len().max(1));
                if let Some(place) = bytes.get_mut(at) {
                    *place = byte;
                }
            }
            if is_cut {
                bytes.truncate(cut.index(bytes.len() + 1));
            }
            bytes
        },
    )
}

/// Any characters that mean something in a TOML file.
const TOML: &str = "[\\[\\]=\", .0-9a-z_\n#'{}-]{0,200}";

#[test]
fn every_kept_input_is_borne() {
    type Subject = fn(&[u8]);
    let subjects: [(&str, Subject); 14] = [
        ("configuration", subjects::configuration::run),
        ("scenario", subjects::scenario::run),
        ("device_description", subjects::device_description::run),
        ("recording", subjects::recording::run),
        ("problem_lines", subjects::problem_lines::run),
        ("lines", subjects::lines::run),
        ("bus_logs", subjects::bus_logs::run),
        ("wire", subjects::wire::run),
        ("modbus", subjects::modbus::run),
        ("packets", |bytes| _ = subjects::packets::run(bytes)),
        ("field_description", subjects::field_description::run),
        ("erob_can", subjects::erob_can::run),
        ("journal", |bytes| _ = subjects::journal::run(bytes)),
        ("engine", |bytes| drop(subjects::engine::run(bytes))),
    ];
    for (name, run) in subjects {
        seeds(name).iter().for_each(|bytes| run(bytes));
    }
}

/// A change of the encoding makes them noise.
#[test]
fn every_kept_packet_and_journal_is_decoded() {
    let subjects: [(&str, fn(&[u8]) -> bool); 2] =
        [("packets", subjects::packets::run), ("journal", subjects::journal::run)];
    for (name, run) in subjects {
        assert!(seeds(name).iter().all(|bytes| run(bytes)), "{name}");
    }
}

/// Else it would be no wonder that nothing goes wrong.
#[test]
fn the_kept_inputs_lead_the_group_through_every_phase_and_move_it_in_every_mode() {
    let journeys: Vec<Journey> = seeds("engine").iter().map(|bytes| subjects::engine::run(bytes)).collect();
    for phase in Phase::ALL {
        assert!(journeys.iter().any(|journey| journey.phases.contains(&phase)), "{phase:?}");
    }
    let moved = |mode: OperationMode, family: DriveFamily| {
        journeys.iter().any(|journey| journey.modes_in_motion.contains(&(mode, family.clone())))
    };
    for mode in [
        OperationMode::CyclicSynchronousPosition,
        OperationMode::CyclicSynchronousVelocity,
        OperationMode::CyclicSynchronousTorque,
        OperationMode::InterpolatedPosition,
        OperationMode::ProfilePosition,
        OperationMode::ProfileVelocity,
        OperationMode::ProfileTorque,
    ] {
        assert!(moved(mode, EROB_CANOPEN), "{mode:?}");
    }
    for mode in
        [OperationMode::InterpolatedPosition, OperationMode::ProfilePosition, OperationMode::ProfileVelocity]
    {
        assert!(moved(mode, YZ_AIM), "{mode:?} of a YZ-AIM");
    }
    assert!(journeys.iter().any(|journey| journey.refused > 0 && journey.refused < journey.taken));
    assert!(journeys.iter().any(|journey| journey.calls > 100), "a callback is called");
    for rule in [Rule::CallbackOverrun, Rule::CallbackPanicked] {
        assert!(journeys.iter().any(|journey| journey.stops.contains(rule.key())), "{rule:?}");
    }
    assert!(journeys.iter().any(|journey| journey.are_apart), "one group moves, and another one does not");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_text_is_a_configuration_or_is_explained(text in TOML, seed in mutated("configuration")) {
        subjects::configuration::run(text.as_bytes());
        subjects::configuration::run(&seed);
    }

    #[test]
    fn any_text_is_a_scenario_or_is_explained(text in TOML, seed in mutated("scenario")) {
        subjects::scenario::run(text.as_bytes());
        subjects::scenario::run(&seed);
    }

    #[test]
    fn any_text_describes_a_device_or_is_explained(text in TOML, seed in mutated("device_description")) {
        subjects::device_description::run(text.as_bytes());
        subjects::device_description::run(&seed);
    }

    #[test]
    fn any_file_is_a_recording_or_is_explained(seed in mutated("recording")) {
        subjects::recording::run(&seed);
    }

    #[test]
    fn any_text_is_a_trajectory_problem_or_is_explained(text in TOML, seed in mutated("problem_lines")) {
        subjects::problem_lines::run(text.as_bytes());
        subjects::problem_lines::run(&seed);
    }

    #[test]
    fn any_frames_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("wire")) {
        subjects::wire::run(&bytes);
        subjects::wire::run(&seed);
    }

    #[test]
    fn any_bytes_of_a_serial_line_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("lines")) {
        subjects::lines::run(&bytes);
        subjects::lines::run(&seed);
    }

    #[test]
    fn any_log_is_read_or_explained_and_any_frames_have_a_meaning(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("bus_logs")) {
        subjects::bus_logs::run(&bytes);
        subjects::bus_logs::run(&seed);
        subjects::bus_logs::decode(&bytes);
    }

    #[test]
    fn any_bytes_on_a_modbus_line_are_borne(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("modbus")) {
        subjects::modbus::run(&bytes);
        subjects::modbus::run(&seed);
    }

    #[test]
    fn any_journal_is_read_and_replayed_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("journal")) {
        subjects::journal::run(&bytes);
        subjects::journal::run(&seed);
    }

    #[test]
    fn any_packets_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("packets")) {
        subjects::packets::run(&bytes);
        subjects::packets::run(&seed);
    }

    #[test]
    fn any_text_describes_a_drive_of_bit_fields_or_is_explained(text in TOML, seed in mutated("field_description")) {
        subjects::field_description::run(text.as_bytes());
        subjects::field_description::run(&seed);
    }

    #[test]
    fn the_engine_bears_anything(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("engine")) {
        subjects::engine::run(&bytes);
        subjects::engine::run(&seed);
    }
}

proptest! {
    // Each of them is seconds of a drive.
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn whoever_speaks_to_an_erob_bears_any_bus(bytes in proptest::collection::vec(any::<u8>(), 0..4000), seed in mutated("erob_can")) {
        subjects::erob_can::run(&bytes);
        subjects::erob_can::run(&seed);
    }
}

// TEMPORARY
#[test]
#[ignore = "writes seeds"]
fn write_seeds() {
    use std::time::Duration;
    use takt::command::{CommandError, LeaseError, MotionId, PointRefusal, StreamError};
    use takt::journal::{ClockAnswer, Journal};
    use takt::trajectory::{BrokenLimit, TrajectoryError, TrajectoryPoint};
    use takt::{MoveOptions, VirtualRun};
    use takt_remote::packets::{Answer, Command, Demand, Reply, Role, StopRequest};
    use takt_rt::{AxisPoint, RejectReason, RequestError, RequestKind, RequestTarget, StopCategory};
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    let put = |kind: u8, name: &str, packet: &[u8]| {
        std::fs::write(folder.join("packets").join(name), [&[kind], packet].concat()).unwrap();
    };
    let demand = |name: &str, number, command| {
        put(0, name, &Demand { number, asked_ns: 1_000_000_000_000, command }.packet());
    };
    let reply = |name: &str, number, reply| put(2, name, &Answer { number, slot: 7_000, reply }.packet());
    let target = RequestTarget::Group(0);
    let motion = MotionId::from_number(300 << 8 | 1);
    let axes = || vec![AxisPoint::moving(0.5, -0.1), AxisPoint::position(0.2).with_impedance(50.0, 3.0)];
    let options = MoveOptions { velocity_scale: 0.5, ..MoveOptions::default() };
    let point = |time_s| TrajectoryPoint {
        time_s,
        positions: vec![0.5, -0.5],
        velocities: vec![0.1, 0.0],
        ..TrajectoryPoint::default()
    };
    demand("lease", 1, Command::Lease { is_taken_over: true });
    demand("move", 2, Command::Move { target: RequestTarget::All, options, positions: vec![0.3, -0.2] });
    demand(
        "velocity",
        3,
        Command::Velocity { axis: 1, velocity: -0.2, valid_for: Duration::from_millis(250) },
    );
    demand("mode", 4, Command::ChangeMode { target, mode: OperationMode::CyclicSynchronousTorque });
    demand("point", 5, Command::Point { target, at_ns: 1_000_010_000_000, axes: axes() });
    let (from_ns, interval) = (1_000_010_000_000, Duration::from_millis(2));
    demand("chunk", 6, Command::Chunk { target, from_ns, interval, points: vec![axes(), axes()] });
    demand("points", 7, Command::Points { target, points: vec![point(1.0), point(2.0)] });
    demand("execute", 8, Command::Execute { target, points: 2 });
    demand("set_speed", 9, Command::SetSpeed { motion, rate: 0.5 });
    let frame = takt_rt::Frame::of(takt_rt::Id::canopen(0x600, 5), [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    demand("question", 10, Command::Question { bus: 1, frame });
    reply("motion", 1, Reply::Motion(motion));
    let axis = "joint2".to_owned();
    let outside = CommandError::OutsideLimits { axis, value: 4.0, lowest: -3.0, highest: 3.0 };
    reply("outside_limits", 2, Reply::Refused(outside));
    let limit = TrajectoryError::Limit {
        point: 1,
        axis: 0,
        broken: BrokenLimit::Velocity,
        time_s: 1.5,
        value: 2.5,
        limit: 2.0,
    };
    reply("trajectory_limit", 3, Reply::Refused(limit.into()));
    let request = RequestError {
        request: RequestKind::Move,
        reason: RejectReason::all().nth(5).unwrap(),
        axis: Some(1),
        phase: Phase::Holding,
    };
    let machine = takt::telemetry::Machine::of(
        &takt::Config::parse("first", include_str!("../../configs/first.toml")).unwrap(),
    );
    let refused = takt::Refused::new(Some(request), &machine);
    reply("request_error", 4, Reply::Refused(refused.into()));
    let held = LeaseError::Held { process: 4711, expires_in: Duration::from_millis(300) };
    reply("held", 5, Reply::lease(held));
    let reason = PointRefusal::Torque { torque: 90.0, limit: 40.0 };
    reply("point_refused", 6, Reply::NotTaken(StreamError::Refused { point: 3, axis: 1, reason }));
    put(3, "role", &Role::Commands.packet());
    put(3, "stop", &StopRequest { target, category: StopCategory::Two }.packet());

    let config = takt::Config::parse("first", include_str!("../../configs/first.toml")).unwrap();
    let (mut run, _log) = VirtualRun::simulated(&config).unwrap();
    let (mut answers, mut journal) = (run.journal(), Journal::default());
    for _ in 0..40 {
        assert!(run.step());
    }
    answers.drain_clock(&mut journal);
    answers.drain_host(&mut journal);
    let block = |journal: &mut Journal, name: &str| {
        std::fs::write(folder.join("journal").join(name), journal.take_block().unwrap()).unwrap();
    };
    block(&mut journal, "begin");
    let latest_ns = i64::MAX as u64;
    journal.add_clock(ClockAnswer::Epoch(latest_ns - 1_000_000));
    let wake = takt_rt::Wake { now_ns: latest_ns, timer_latency_ns: 1, suspended_ns: 0 };
    for answer in [
        ClockAnswer::Woke(wake),
        ClockAnswer::Now(latest_ns),
        ClockAnswer::WokeToSend(wake),
        ClockAnswer::CycleEnd,
    ] {
        journal.add_clock(answer);
    }
    block(&mut journal, "time_at_the_end");
}
