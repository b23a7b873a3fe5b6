//! Two axes of one drive: one node, one SDO server, one heartbeat, and process data of their own.

use std::io::Write as _;
use std::path::PathBuf;

use takt::Config;
use takt::family::bring_up::ProcessData;
use takt::family::cia402::{self, Device};
use takt::family::commission::{CommandValue, MotionProfile, MoveKind, TargetDrive, Task, ValueText};
use takt::schedule::{self, MessageKind};
use takt::sim::DriveFault;
use takt::{Outcome, VirtualClock};
use takt_rt::{Frame, Id, Origin, Phase, Rule};
use takt_tools::commission::bus_session::{self, SessionEvent};

use crate::cia402_nodes::machine::{finish, moving, run_of, sheet};

/// A data sheet with the drive profile and the PDOs of the first axis a second time: objects 0x800 higher, PDOs 64 further.
/// `second_pdo` is the default COB-ID of the PDOs of the second axis.
fn two_axes_sheet(second_pdo: &str) -> String {
    let text = std::fs::read_to_string(sheet("eyou-euservo.eds")).unwrap();
    let moved = |line: &str| {
        let index = u16::from_str_radix(line.strip_prefix('[')?.get(..4)?, 16).ok()?;
        let offset = match index {
            0x6000..0x6800 => 0x800,
            0x1400..=0x1403 | 0x1600..=0x1603 | 0x1800..=0x1803 | 0x1A00..=0x1A03 => 0x40,
            _ => return None,
        };
        Some(format!("[{:04X}{}", index + offset, &line[5..]))
    };
    let (mut second, mut is_moved, mut is_cob_id) = (String::new(), false, false);
    for line in text.lines() {
        if line.starts_with('[') {
            let moved = moved(line);
            is_moved = moved.is_some();
            is_cob_id = line.starts_with("[14") || line.starts_with("[18");
            is_cob_id &= line.ends_with("sub1]") || line.ends_with("sub1]\r");
            second += &moved.unwrap_or_default();
        } else if is_moved && is_cob_id && line.starts_with("DefaultValue") {
            second += &format!("DefaultValue={second_pdo}");
        } else if is_moved {
            second += line;
        }
        second += "\n";
    }
    format!("{text}\n{second}")
}

struct Sheet(tempfile::NamedTempFile);

impl Sheet {
    fn new(second_pdo: &str) -> Self {
        let mut file = tempfile::Builder::new().suffix(".eds").tempfile().unwrap();
        file.write_all(two_axes_sheet(second_pdo).as_bytes()).unwrap();
        Self(file)
    }

    fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }
}

/// Two axes of node 1 and an axis of node 2.
fn text(eds: &Sheet, more: &str) -> String {
    format!(
        "name = \"two\"\n[[bus]]\nname = \"can\"\n[defaults.axis]\nbus = \"can\"\ndrive = \"cia402\"\neds = {:?}\ncounts_per_turn = 65536\n{more}\
         limits = {{ position = [-1, 1], velocity = 1, acceleration = 5, torque = 10 }}\n\
         [[axis]]\nname = \"first\"\nnode = 1\n[[axis]]\nname = \"second\"\nnode = 1\nnode_axis = 2\ngear_ratio = 2\n\
         [[axis]]\nname = \"alone\"\nnode = 2\n\
         [[program.move]]\nto = [0.5, -0.4, 0.3]\n[[program.move]]\nto = [0.1, 0.2, 0.0]\n",
        eds.path().display().to_string()
    )
}

fn machine(more: &str) -> Config {
    let eds = Sheet::new("0x80000000");
    Config::parse("two.toml", &text(&eds, more)).unwrap_or_else(|error| panic!("{error:?}"))
}

fn refusal(text: &str) -> String {
    format!("{:?}", Config::parse("two.toml", text).unwrap_err())
}

fn requests(sent: &[(u64, Frame)], node: u8) -> Vec<[u8; 8]> {
    let to_node = sent.iter().filter(|(_, frame)| frame.id() == Id::canopen(0x600, node));
    to_node.map(|(_, frame)| frame.payload().try_into().unwrap()).collect()
}

/// The values that were written to an object, in order.
fn written(sent: &[(u64, Frame)], node: u8, index: u16, subindex: u8) -> Vec<u32> {
    let [low, high] = index.to_le_bytes();
    let downloads = requests(sent, node).into_iter().filter(|request| request[0] & 0xE3 == 0x23);
    let of_object = downloads.filter(|request| request[1..4] == [low, high, subindex]);
    of_object.map(|request| u32::from_le_bytes(request[4..].try_into().unwrap())).collect()
}

#[test]
fn two_axes_of_one_drive_run_their_program_in_csp() {
    let config = machine("");
    let mut run = run_of(&config);
    let mut farthest = [0.0_f64; 3];
    let outcome = run.run(60_000, |run| {
        for (farthest, axis) in farthest.iter_mut().zip(&run.snapshot().axes) {
            *farthest = farthest.max(axis.position.abs());
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    for (seen, target) in farthest.iter().zip([0.5, 0.4, 0.3]) {
        assert!((seen - target).abs() < 0.01, "{farthest:?}");
    }
    let there: Vec<f64> = run.snapshot().axes[..3].iter().map(|axis| axis.position).collect();
    for (position, target) in there.iter().zip([0.1, 0.2, 0.0]) {
        assert!((position - target).abs() < 0.001, "{there:?}");
    }
}

#[test]
fn what_belongs_to_the_node_is_done_once_and_what_belongs_to_an_axis_for_each() {
    let config = machine("heartbeat = \"50 ms\"\n");
    let mut run = run_of(&config);
    assert_eq!(finish(&mut run), Some(Outcome::Finished));
    let sent = &run.ports()[0].sent;
    let nmt = |command: u8| {
        let is_it = |frame: &Frame| frame.id() == Id::canopen(0, 0) && *frame.payload() == [command, 1];
        sent.iter().filter(|(_, frame)| is_it(frame)).count()
    };
    assert_eq!(
        (nmt(0x82), nmt(0x01), nmt(0x80)),
        (1, 1, 2),
        "a shutdown wakes the node and then commands it"
    );
    assert_eq!(written(sent, 1, 0x1017, 0), [50, 0]);
    assert_eq!(written(sent, 1, 0x1006, 0), [1_000, 0]);
    for (mode, target) in [(0x6060, 0x607A), (0x6860, 0x687A)] {
        assert_eq!(written(sent, 1, mode, 0).first(), Some(&8));
        assert_eq!(written(sent, 1, target, 0).len(), 1);
    }
    // Each axis has its mapping: controlword and target.
    let mapped = |parameter: u16| [1, 2].map(|subindex| written(sent, 1, parameter, subindex));
    assert_eq!(mapped(0x1600), [[0x6040_0010], [0x607A_0020]]);
    assert_eq!(mapped(0x1640), [[0x6840_0010], [0x687A_0020]]);
    // One SDO server has one request at a time: none is sent before the answer to the one before.
    let answers = run.ports()[0].received.iter().filter(|frame| frame.id() == Id::canopen(0x580, 1)).count();
    assert_eq!(requests(&run.ports()[0].sent, 1).len(), answers);
}

#[test]
fn a_fault_of_one_axis_is_a_defined_stop_of_the_group_and_names_the_axis() {
    let config = machine("");
    let mut run = moving(&config);
    run.ports()[0].bus.inject_fault(1, DriveFault::OverTemperature).unwrap();
    let outcome = finish(&mut run);
    let Some(Outcome::Stopped(stop)) = outcome else { panic!("{outcome:?}") };
    assert_eq!((stop.rule(), stop.origin), (Rule::DriveFault, Origin::Axis(0)));
    assert!(run.snapshot().axes[..3].iter().all(|axis| !axis.drive_state.has_torque()));
}

#[test]
fn a_node_that_restarts_is_a_fault_of_both_of_its_axes_and_of_no_other() {
    let eds = Sheet::new("0x80000000");
    let groups = "[[group]]\nname = \"a\"\naxes = [\"first\"]\n[[group]]\nname = \"b\"\naxes = [\"second\"]\n\
                  [[group]]\nname = \"c\"\naxes = [\"alone\"]\n";
    let text = text(&eds, "");
    let without_program = &text[..text.find("[[program").unwrap()];
    let program: String =
        ["a", "b", "c"].map(|group| format!("[[program.move]]\ngroup = {group:?}\nto = [0.5]\n")).concat();
    let config = Config::parse("two.toml", &format!("{without_program}{groups}{program}"))
        .unwrap_or_else(|error| panic!("{error:?}"));
    let mut run = moving(&config);
    run.ports()[0].bus.power_cycle(1).unwrap();
    let mut stopped = [None; 3];
    for _ in 0..3_000 {
        run.step();
        for (stopped, group) in stopped.iter_mut().zip(run.snapshot().groups()) {
            *stopped = stopped.or(group.stop.filter(|stop| stop.rule() != Rule::Requested));
        }
    }
    assert!(stopped[0].is_some() && stopped[1].is_some(), "{stopped:?}");
    assert_eq!(stopped[2], None);
    assert_ne!(run.snapshot().groups[0].phase, Phase::Moving);
}

#[test]
fn the_identifiers_of_a_further_axis_are_those_of_its_node_that_are_free() {
    let config = machine("");
    let ids = |axis: usize| -> Vec<u32> {
        ProcessData::of(&config.axes[axis], &config).all().map(|pdo| pdo.id.value()).collect()
    };
    assert_eq!(ids(0), [0x201, 0x181]);
    assert_eq!(ids(1), [0x301, 0x281]);
    assert_eq!(ids(2), [0x202, 0x182]);
    let numbers: Vec<u16> = ProcessData::of(&config.axes[1], &config).all().map(|pdo| pdo.number).collect();
    assert_eq!(numbers, [65, 65]);
}

#[test]
fn the_data_sheet_chooses_an_identifier_unless_another_pdo_has_it() {
    let ids = |default: &str| -> Vec<u32> {
        let eds = Sheet::new(default);
        let config = Config::parse("two.toml", &text(&eds, "")).unwrap();
        ProcessData::of(&config.axes[1], &config).all().map(|pdo| pdo.id.value()).collect()
    };
    // The first PDO takes it, and the other one finds it taken.
    assert_eq!(ids("$NODEID+0x80000400"), [0x401, 0x281]);
    assert_eq!(ids("0x202"), [0x301, 0x281], "it is of node 2");
    assert_eq!(ids("0x203"), [0x203, 0x281], "no node 3 is there");
    assert_eq!(ids("0x5A1"), [0x301, 0x281], "it is of an SDO");
}

#[test]
fn a_node_with_more_pdos_than_the_pre_defined_set_takes_identifiers_of_absent_nodes() {
    let mut config = machine("");
    let eds = Sheet::new("0x80000000");
    let device = Device::load(&eds.path(), None).unwrap();
    assert_eq!(device.axes(), 2);
    // Both axes with two PDOs in each direction, and the whole set of the first one counted as taken.
    config.axes[0].mapping = takt::config::PdoMapping::AsStored;
    config.axes[1].drive = cia402::drive(device.of_axis(2).unwrap());
    let ids: Vec<u32> = ProcessData::of(&config.axes[1], &config).all().map(|pdo| pdo.id.value()).collect();
    assert_eq!(ids, [0x200 + 126, 0x180 + 126]);
}

#[test]
fn the_schedule_counts_what_a_node_sends_once() {
    let config = machine("heartbeat = \"50 ms\"\n");
    let bus = &schedule::analyse(&config)[0];
    let count = |kind| bus.messages.iter().filter(|message| message.kind == kind).count();
    assert_eq!((count(MessageKind::Feedback), count(MessageKind::SetPoint)), (3, 3));
    assert_eq!((count(MessageKind::Emergency), count(MessageKind::DriveHeartbeat)), (2, 2));
}

#[test]
fn the_configuration_to_start_with_has_every_axis_of_the_drive() {
    let eds = Sheet::new("0x80000000");
    let text =
        cia402::starting_configuration(&Device::load(&eds.path(), None).unwrap(), &eds.path(), None, 5, None);
    let config = Config::parse("starting.toml", &text).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
    let places: Vec<(u8, u8)> = config.axes.iter().map(|axis| (axis.node, axis.drive.node_axis)).collect();
    assert_eq!(places, [(5, 1), (5, 2)]);
    assert_eq!(finish(&mut run_of(&config)), Some(Outcome::Finished));
}

#[test]
fn an_axis_that_the_drive_does_not_have_is_refused_by_its_number() {
    let eds = Sheet::new("0x80000000");
    let third = text(&eds, "").replace("node_axis = 2", "node_axis = 3");
    let error = refusal(&third);
    assert!(
        error.contains("`axis.node_axis`") && error.contains("7040") && error.contains("1 to 2"),
        "{error}"
    );
    let none = refusal(&text(&eds, "").replace("node_axis = 2", "node_axis = 9"));
    assert!(none.contains("`axis.node_axis`"), "{none}");
}

#[test]
fn two_axes_with_one_node_id_need_different_numbers_and_one_drive() {
    let eds = Sheet::new("0x80000000");
    let twice = refusal(&text(&eds, "").replace("node_axis = 2\n", ""));
    assert!(twice.contains("the node ID 1 is already taken") && twice.contains("node_axis"), "{twice}");
    let other = text(&eds, "").replace("node_axis = 2\n", "node_axis = 2\nidentity = { vendor = 5 }\n");
    assert!(Config::parse("two.toml", &other).is_ok(), "what is compared is what the data sheets say");
    let erob = text(&eds, "").replace("name = \"first\"\n", "name = \"first\"\ndrive = \"erob-canopen\"\n");
    assert!(refusal(&erob).contains("node"), "{}", refusal(&erob));
}

#[test]
fn a_further_axis_alone_is_moved_while_the_first_one_stays_where_it_is() {
    let eds = Sheet::new("0x80000000");
    let text = text(&eds, "").replace("[[axis]]\nname = \"first\"\nnode = 1\n", "");
    let text = text
        .replace("to = [0.5, -0.4, 0.3]", "to = [-0.4, 0.3]")
        .replace("to = [0.1, 0.2, 0.0]", "to = [0.2, 0.0]");
    let config = Config::parse("two.toml", &text).unwrap_or_else(|error| panic!("{error:?}"));
    let mut run = run_of(&config);
    assert_eq!(finish(&mut run), Some(Outcome::Finished));
    // The first axis has its PDOs switched off, and is never told anything.
    let sent = &run.ports()[0].sent;
    assert_eq!(written(sent, 1, 0x6040, 0), [0; 0]);
    assert!(run.ports()[0].bus.observe(1).unwrap().position.abs() < 1e-6);
}

#[test]
fn commissioning_of_the_second_axis_moves_the_second_axis_alone() {
    let mut config = machine("");
    config.simulation.longest_gap_ns = u64::MAX;
    let profile = MotionProfile {
        velocity: Some(CommandValue::Joint(0.5)),
        acceleration: Some(CommandValue::Joint(2.0)),
        deceleration: Some(CommandValue::Joint(2.0)),
    };
    let task = Task::Move {
        kind: MoveKind::Absolute { to: CommandValue::Joint(0.25), is_immediate: false },
        profile,
        keeps_enabled: false,
    };
    let mut bus = takt::simulated_bus(&config, 0);
    let target = TargetDrive::of(&config.axes[1]).unwrap();
    let task = target.family().commission(target.clone(), task).unwrap();
    let mut touched = vec![];
    bus_session::run(
        task.procedure,
        &mut bus,
        &mut VirtualClock::default(),
        || false,
        |_, seen| {
            if let SessionEvent::Sent(frame) = seen
                && frame.id() == Id::canopen(0x600, 1)
            {
                touched.push(u16::from_le_bytes([frame.payload()[1], frame.payload()[2]]));
            }
        },
    )
    .unwrap_or_else(|error| panic!("{error}"));
    let profile_objects: Vec<u16> = touched.into_iter().filter(|index| *index >= 0x6000).collect();
    assert!(!profile_objects.is_empty());
    assert!(profile_objects.iter().all(|index| *index >= 0x6800), "{profile_objects:04X?}");
    // Observed is the first axis of a node.
    assert!(bus.observe(1).unwrap().position.abs() < 1e-6);
}

#[test]
fn an_object_is_read_from_the_axis_that_it_was_written_to() {
    let config = machine("");
    let mut bus = takt::simulated_bus(&config, 0);
    let mut clock = VirtualClock::default();
    let mut run = |axis: usize, task: Task| {
        let target = TargetDrive::of(&config.axes[axis]).unwrap();
        let task = target.family().commission(target.clone(), task).unwrap();
        bus_session::run(task.procedure, &mut bus, &mut clock, || false, |_, _| {}).unwrap()
    };
    let name = "profile velocity".to_owned();
    let value = ValueText { text: "1234".to_owned(), is_raw: true };
    run(1, Task::Write { name: name.clone(), value, data_type: None });
    let mut read = |axis: usize| {
        let report = run(axis, Task::Read { names: vec![name.clone()], data_type: None });
        serde_json::to_value(&report).unwrap()["objects"][0]["raw"].as_i64().unwrap()
    };
    assert_eq!(read(1), 1234);
    assert_ne!(read(0), 1234);
}
