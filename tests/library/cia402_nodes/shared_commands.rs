//! Command frames that several axes share, by dummy mapping.

use std::path::Path;

use takt::Config;
use takt::config::CommandFrames;
use takt::family::bring_up::ProcessData;
use takt::schedule::{self, MessageKind};
use takt::sim::DriveFault;
use takt::{Outcome, VirtualRun};
use takt_rt::{Frame, Id, Origin, Rule};

use crate::cia402_nodes::listening_bus::ListeningBus;
use crate::cia402_nodes::machine::{finish, moving, run_of, sheet};

/// So many axes of drives that can pass over parts of a frame.
fn text(eds: &Path, axes: u8, bus: &str, axis: &str) -> String {
    let mut text = format!(
        "name = \"shared\"\n[[bus]]\nname = \"can\"\n{bus}[defaults.axis]\nbus = \"can\"\ndrive = \"cia402\"\neds = {:?}\ncounts_per_turn = 65536\n\
         feedback = []\n{axis}limits = {{ position = [-1, 1], velocity = 1, acceleration = 5, torque = 10 }}\n",
        eds.display().to_string()
    );
    for node in 1..=axes {
        text += &format!("[[axis]]\nname = \"joint{node}\"\nnode = {node}\n");
    }
    text + "[[program.move]]\nto = 0.4\n[[program.move]]\nto = 0.1\n"
}

fn machine(axes: u8, bus: &str, axis: &str) -> Config {
    let text = text(&sheet("eyou-euservo.eds"), axes, bus, axis);
    Config::parse("shared.toml", &text).unwrap_or_else(|error| panic!("{error:?}"))
}

const SHARED: &str = "command_frames = \"shared\"\n";
const CST: &str = "mode = \"cst\"\n";

/// The identifiers and lengths of the commands of an axis.
fn commands(config: &Config, axis: usize) -> Vec<(u32, usize)> {
    let data = ProcessData::of(&config.axes[axis], config);
    data.commands.iter().map(|pdo| (pdo.id.value(), pdo.length())).collect()
}

fn all_commands(config: &Config) -> Vec<Vec<(u32, usize)>> {
    (0..config.axes.len()).map(|axis| commands(config, axis)).collect()
}

fn set_points(run: &mut VirtualRun<ListeningBus>) -> Vec<Frame> {
    let is_command = |frame: &&Frame| (0x200..0x580).contains(&frame.id().value());
    run.ports()[0].sent.iter().map(|(_, frame)| frame).filter(is_command).copied().collect()
}

#[test]
fn two_axes_in_cst_run_their_program_with_one_frame_for_both() {
    let config = machine(2, SHARED, CST);
    assert_eq!(all_commands(&config), [[(0x201, 8)], [(0x201, 8)]]);
    let second = &ProcessData::of(&config.axes[1], &config).commands[0];
    let mapped: Vec<u32> = second.objects.iter().map(|object| object.parameter()).collect();
    assert_eq!(mapped, [0x0006_0010, 0x0006_0010, 0x6040_0010, 0x6071_0010]);
    let mut run = run_of(&config);
    assert_eq!(finish(&mut run), Some(Outcome::Finished));
    for axis in &run.snapshot().axes[..2] {
        assert!((axis.position - 0.1).abs() < 0.02, "{}", axis.position);
    }
    let set_points = set_points(&mut run);
    assert!(set_points.len() > 1_000);
    assert!(set_points.iter().all(|frame| (frame.id(), frame.length()) == (Id::canopen(0x200, 1), 8)));
}

#[test]
fn four_axes_in_csp_share_frames_of_controlwords_and_of_targets() {
    let config = machine(4, SHARED, "");
    let controlwords = (0x201, 8);
    let (first, second) = (vec![controlwords, (0x301, 8)], vec![controlwords, (0x303, 8)]);
    assert_eq!(all_commands(&config), [first.clone(), first, second.clone(), second]);
    let mut config = config;
    // Four such axes do not fit a cycle of 1 ms.
    config.cycle.period_ns *= 2;
    config.cycle.command_phase_ns *= 2;
    let mut run = run_of(&config);
    assert_eq!(finish(&mut run), Some(Outcome::Finished));
    for axis in &run.snapshot().axes[..4] {
        assert!((axis.position - 0.1).abs() < 0.001, "{}", axis.position);
    }
}

#[test]
fn nothing_is_shared_where_that_makes_no_frame_shorter() {
    // Two controlwords and two targets in two frames are as long as two commands.
    let config = machine(2, SHARED, "");
    assert_eq!(all_commands(&config), [[(0x201, 6)], [(0x202, 6)]]);
}

#[test]
fn axes_share_by_themselves_where_their_bus_carries_no_frame_for_each_and_only_there() {
    let read = |axes, bus| {
        let text = text(&sheet("eyou-euservo.eds"), axes, bus, CST).replace("feedback = []\n", "");
        let cycle = "name = \"shared\"\n[cycle]\ncommand_phase = \"auto\"\n";
        Config::parse("shared.toml", &text.replace("name = \"shared\"\n", cycle))
    };
    let three = read(3, "").unwrap();
    assert_eq!(three.buses[0].command_frames, CommandFrames::OnePerAxis);
    assert!(schedule::verify(&three).is_ok());
    let four = read(4, "").unwrap_or_else(|error| panic!("{error:?}"));
    assert_eq!(four.buses[0].command_frames, CommandFrames::Shared);
    let fits = schedule::verify(&four).unwrap_or_else(|error| panic!("{error}"));
    let set_points = fits[0].messages.iter().filter(|message| message.kind == MessageKind::SetPoint);
    assert_eq!(
        set_points.map(|message| (message.id, message.length)).collect::<Vec<_>>(),
        [(0x201, 8), (0x203, 8)]
    );
    assert_eq!(finish(&mut run_of(&four)), Some(Outcome::Finished));
    // Whoever does not want that is told what would fit.
    let refused = format!("{:?}", read(4, "command_frames = \"one-per-axis\"\n").unwrap_err());
    assert!(refused.contains("command_frames = \"shared\""), "{refused}");
}

#[test]
fn a_drive_whose_data_sheet_knows_no_dummies_has_frames_of_its_own() {
    let eds = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/eds/erob-canopen.eds");
    let config = Config::parse("shared.toml", &text(&eds, 2, SHARED, CST)).unwrap();
    assert_eq!(all_commands(&config), [[(0x201, 4)], [(0x202, 4)]]);
}

#[test]
fn axes_of_two_groups_share_no_frame() {
    let groups = "[[group]]\nname = \"a\"\naxes = [\"joint1\", \"joint3\"]\n[[group]]\nname = \"b\"\naxes = [\"joint2\"]\n";
    let text = text(&sheet("eyou-euservo.eds"), 3, SHARED, CST);
    let text = format!("{}{groups}", &text[..text.find("[[program").unwrap()]);
    let config = Config::parse("shared.toml", &text).unwrap_or_else(|error| panic!("{error:?}"));
    assert_eq!(all_commands(&config), [[(0x201, 8)], [(0x202, 4)], [(0x201, 8)]]);
}

#[test]
fn a_fault_of_one_axis_is_a_defined_stop_of_those_that_share_its_frame() {
    let config = machine(2, SHARED, CST);
    let mut run = moving(&config);
    run.ports()[0].bus.inject_fault(2, DriveFault::OverTemperature).unwrap();
    let outcome = finish(&mut run);
    let Some(Outcome::Stopped(stop)) = outcome else { panic!("{outcome:?}") };
    assert_eq!((stop.rule(), stop.origin), (Rule::DriveFault, Origin::Axis(1)));
    for node in [1, 2] {
        assert!(!run.ports()[0].bus.observe(node).unwrap().state.has_torque());
    }
}
