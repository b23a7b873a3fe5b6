//! Drives without a heartbeat of their own are guarded, by their data sheets.

use std::io::Write as _;

use takt::Config;
use takt::Outcome;
use takt::config::{ErrorControl, Supervision};
use takt::family::bring_up::stages as bring_up;
use takt::family::{Unwatched, WarningKind, stops_by_itself_after};
use takt::schedule::{self, MessageKind};
use takt_rt::{BusPort, DriveState, Id, Origin, ReceiveBatch, Rule};

use crate::cia402_nodes::machine::{MILLISECOND_NS, finish, moving, run_of, sheet};

/// What the guarded drive lacks: the heartbeats in both directions.
const HEARTBEATS: &str = "\"1016\", \"1017\"";

/// Two drives of one maker. The second one lacks some objects.
fn machine(head: &str, axes: &str, missing: &str) -> Config {
    let mut quirks = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    write!(
        quirks,
        "[drive]\nvendor = \"none\"\nproduct = \"none\"\nstatus = \"from its data sheet, not tried on hardware\"\nsources = [\"a test\"]\n\
         [objects]\nmissing = [{missing}]\n"
    )
    .unwrap();
    let text = format!(
        "name = \"guarded\"\n{head}[[bus]]\nname = \"can\"\n[defaults.axis]\nbus = \"can\"\ndrive = \"cia402\"\neds = {:?}\n{axes}\
         counts_per_turn = 65536\nlimits = {{ position = [-1, 1], velocity = 1, acceleration = 5, torque = 10 }}\n\
         [[axis]]\nname = \"watched\"\nnode = 1\n[[axis]]\nname = \"guarded\"\nnode = 2\nquirks = {:?}\n\
         [[program.move]]\nto = 0.5\n[[program.move]]\nto = 0\n",
        sheet("eyou-euservo.eds").display().to_string(),
        quirks.path().display().to_string()
    );
    Config::parse("guarded.toml", &text).unwrap_or_else(|error| panic!("{error:?}"))
}

fn guarding(guard_time_ms: u64, life_time_factor: u8) -> Supervision {
    Supervision::Guarding { guard_time_ns: guard_time_ms * MILLISECOND_NS, life_time_factor }
}

#[test]
fn a_drive_without_a_heartbeat_is_guarded_at_the_period_of_the_controllers_heartbeat_or_at_its_own() {
    let usual = machine("", "", HEARTBEATS);
    assert_eq!(usual.axes[0].supervision(&usual.master), Supervision::Feedback);
    assert_eq!(usual.axes[1].supervision(&usual.master), guarding(100, 5));
    let own = machine("", "heartbeat = \"50 ms\"\n", HEARTBEATS);
    let heartbeat = Supervision::Heartbeat { period_ns: 50 * MILLISECOND_NS };
    assert_eq!(own.axes[0].supervision(&own.master), heartbeat);
    assert_eq!(own.axes[1].supervision(&own.master), guarding(50, 10));
    let off = machine("[master]\nheartbeat = \"off\"\n", "", HEARTBEATS);
    assert_eq!(off.axes[1].supervision(&off.master), Supervision::Feedback);
}

#[test]
fn what_is_lost_without_heartbeat_and_without_guarding_is_said() {
    let guarded = machine("", "", HEARTBEATS);
    let about = |config: &Config, words: &str| config.losses().iter().any(|loss| loss.contains(words));
    assert!(guarded.warnings().is_empty() && !about(&guarded, "neither"));
    let none = machine("", "heartbeat = \"50 ms\"\n", "\"1016\", \"1017\", \"100C\"");
    assert_eq!(none.axes[1].drive.error_control, ErrorControl::None);
    assert_eq!(none.axes[1].supervision(&none.master), Supervision::Feedback);
    let warnings = none.warnings();
    let [unwatched] = &warnings[..] else { panic!("{warnings:?}") };
    assert_eq!(unwatched.kind, WarningKind::NoWatchdog { because: Unwatched::NoErrorControl });
    assert!(about(&none, "`guarded`: the drive has neither a heartbeat (1017) nor node guarding"));
    assert_eq!(stops_by_itself_after(&none.axes[1], &none), Err(Unwatched::NoErrorControl));
}

#[test]
fn a_guarded_drive_runs_its_program_and_is_asked_at_its_guard_time() {
    let config = machine("", "heartbeat = \"50 ms\"\n", HEARTBEATS);
    let mut run = run_of(&config);
    assert_eq!(finish(&mut run), Some(Outcome::Finished));
    let port = &run.ports()[0];
    let asked_ns = port.guard_requests_ns(2);
    assert!(asked_ns.len() > 30, "{}", asked_ns.len());
    assert!(asked_ns.windows(2).all(|pair| pair[1] - pair[0] == 50 * MILLISECOND_NS));
    assert_eq!(port.guard_requests_ns(1), [0; 0], "a drive with a heartbeat is not asked");
    let replies: Vec<u8> = port
        .received
        .iter()
        .filter(|frame| frame.id() == Id::canopen(0x700, 2))
        .map(|frame| frame.payload()[0])
        .collect();
    assert_eq!(
        replies[..3],
        [0, 0x05, 0x85],
        "boot-up, then operational with a toggle bit that is 0 at first"
    );
    // Neither heartbeat is asked of it, and guard time and life-time factor are.
    let written = |index: u16| -> Vec<u8> {
        let requests =
            port.sent.iter().map(|(_, frame)| frame).filter(|frame| frame.id() == Id::canopen(0x600, 2));
        let [low, high] = index.to_le_bytes();
        let is_download = |payload: &[u8]| payload[0] & 0xE0 == 0x20 && payload[1..3] == [low, high];
        requests.filter(|frame| is_download(frame.payload())).map(|frame| frame.payload()[4]).collect()
    };
    assert_eq!((written(0x1016), written(0x1017)), (vec![], vec![]));
    assert_eq!((written(0x100C), written(0x100D)), (vec![50, 0], vec![10, 0]));
    assert_eq!(bring_up::overwritten(&config, &config.axes[1]), []);
}

#[test]
fn a_guarded_drive_whose_replies_are_lost_is_a_lost_node_and_one_defined_stop() {
    let config = machine("[master]\nheartbeat = \"20 ms\"\n", "", HEARTBEATS);
    let mut run = moving(&config);
    run.ports()[0].loses_error_control_of = Some(2);
    let Some(Outcome::Stopped(stop)) = finish(&mut run) else { panic!("{:?}", run.supervisor().outcome()) };
    assert_eq!((stop.rule(), stop.origin), (Rule::NodeLost, Origin::Axis(1)));
}

#[test]
fn a_guarded_drive_notices_that_the_controller_is_gone() {
    let config = machine("", "", HEARTBEATS);
    let mut run = moving(&config);
    let died_ns = run.snapshot().at_ns;
    let port = &mut run.ports()[0];
    let mut states = |until_ns: u64| -> Vec<DriveState> {
        for at_ns in (died_ns..=until_ns).step_by(MILLISECOND_NS as usize) {
            port.receive(at_ns, &mut ReceiveBatch::new());
        }
        [1, 2].map(|node| port.bus.observe(node).unwrap().state).to_vec()
    };
    assert_eq!(states(died_ns + 300 * MILLISECOND_NS), [DriveState::OperationEnabled; 2]);
    assert!(states(died_ns + 1_500 * MILLISECOND_NS).iter().all(|state| !state.has_torque()));
}

#[test]
fn requests_and_replies_of_guarding_are_frames_of_the_schedule() {
    let config = machine("", "heartbeat = \"50 ms\"\n", HEARTBEATS);
    let bus = &schedule::analyse(&config)[0];
    let of = |kind| bus.messages.iter().filter(|message| message.kind == kind).collect::<Vec<_>>();
    let (requests, replies) = (of(MessageKind::GuardRequest), of(MessageKind::GuardReply));
    assert_eq!((requests.len(), replies.len()), (1, 1));
    assert_eq!((requests[0].axis.as_deref(), requests[0].id), (Some("guarded"), 0x702));
    // A remote frame carries no data, though its length code says one byte.
    assert_eq!((requests[0].bits, replies[0].bits), (55, 65));
    assert_eq!(requests[0].period_ns, 50 * MILLISECOND_NS);
    assert_eq!(of(MessageKind::DriveHeartbeat).len(), 1);
}

#[test]
fn the_slot_has_room_for_one_request_of_a_cycle_however_many_nodes_are_guarded() {
    let wait_ns = |guarded: usize| {
        let mut config = machine("", "", HEARTBEATS);
        config.cycle.period_ns *= 10;
        config.cycle.command_phase_ns *= 10;
        let axis = config.axes.pop().unwrap();
        config.axes = (0..guarded as u8)
            .map(|index| {
                let mut axis = axis.clone();
                (axis.name, axis.node) = (format!("axis{index}"), index + 1);
                axis
            })
            .collect();
        let bus = schedule::analyse(&config).remove(0);
        bus.slot.after_command_phase_ns - bus.slot.set_points_ns
    };
    // One request, and two replies of 65 µs: one to a request of the slot before.
    assert_eq!(wait_ns(2) - wait_ns(1), 65_000);
    assert_eq!(wait_ns(6), wait_ns(2));
}
