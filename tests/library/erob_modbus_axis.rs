//! An axis on a Modbus line follows its group beside CSP axes, in virtual time: alone, beside others on the line, and when something
//! fails.

use std::path::Path;

use takt::family::OffCycleBudget;
use takt::family::erob_modbus::budget::LineBudget;
use takt::sim::{Defect, DriveFault, LineDisturbance, SimulatedBus};
use takt::{Config, Interrupt, Outcome, VirtualRun};
use takt_rt::{AxisSnapshot, DriveState, Fault, Origin, Phase, StopReason};

/// The axis on the line, the bus that is the line, and the address of its drive.
const TABLE: usize = 2;
const LINE: usize = 1;
const SLAVE: u8 = 2;
const LONGEST: u64 = 60_000;

fn turntable() -> Config {
    Config::load(Path::new("configs/turntable-modbus.toml")).unwrap()
}

fn budget(config: &Config) -> OffCycleBudget {
    LineBudget::of(config, LINE).unwrap().of_drive()
}

/// How far off the axis may seem: its position was true so long ago.
fn announced_error(config: &Config) -> f64 {
    let limits = config.axes[TABLE].limits;
    let old_ns = budget(config).report_ns + 3 * config.bus_cycle(LINE).period_ns;
    limits.velocity * old_ns as f64 * 1e-9
}

type Run = VirtualRun<SimulatedBus>;

fn start(config: &Config) -> Run {
    VirtualRun::simulated(config).unwrap().0
}

fn table(run: &Run) -> AxisSnapshot {
    run.snapshot().axes[TABLE]
}

/// Runs until the table moves at a good speed.
fn until_it_moves(run: &mut Run) {
    for _ in 0..LONGEST {
        assert!(run.step());
        if table(run).velocity.abs() > 0.5 {
            return;
        }
    }
    panic!("it never moves: {:?}", run.snapshot().groups()[0]);
}

/// The one reason of the stop that the run has ended with; every other axis is without torque, too.
#[track_caller]
fn stopped(run: &mut Run) -> StopReason {
    let Some(Outcome::Stopped(stop)) = run.run(LONGEST, |_| {}) else {
        panic!("{}", run.supervised());
    };
    let states = run.snapshot().axes[..2].iter().map(|axis| axis.drive_state).collect::<Vec<_>>();
    assert!(states.iter().all(|state| *state != DriveState::OperationEnabled), "{states:?}");
    stop
}

trait Supervised {
    fn supervised(&self) -> String;
}

impl Supervised for Run {
    fn supervised(&self) -> String {
        format!("{:?}", self.snapshot().groups()[0])
    }
}

fn disturb(run: &Run, disturbance: LineDisturbance) {
    assert!(run.line(LINE).unwrap().lock().disturb(disturbance, 7));
}

#[test]
fn the_turntable_follows_the_program_beside_the_arm_and_ends_at_rest_without_torque() {
    let config = turntable();
    let mut run = start(&config);
    let (mut farthest, mut seen_error, mut true_error) = (0.0_f64, 0.0_f64, 0.0_f64);
    let outcome = run.run(LONGEST, |run| {
        let axis = table(run);
        farthest = farthest.max(axis.position);
        if axis.drive_state == DriveState::OperationEnabled {
            seen_error = seen_error.max(axis.following_error.abs());
            let truth = run.line(LINE).unwrap().lock().observe(SLAVE).unwrap();
            true_error = true_error.max((truth.position - axis.position_set).abs());
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished), "{}", run.supervised());
    let axis = table(&run);
    assert!((farthest - 60_f64.to_radians()).abs() < 0.01, "{farthest}");
    assert!(axis.position.abs() < 0.01, "{axis:?}");
    assert!(true_error < 1_f64.to_radians(), "{} deg", true_error.to_degrees());
    assert!(seen_error < announced_error(&config), "{} deg", seen_error.to_degrees());
    let truth = run.line(LINE).unwrap().lock().observe(SLAVE).unwrap();
    assert!(truth.is_braked && (truth.position - axis.position).abs() < 1e-3, "{truth:?}");
    assert_eq!(truth.error_code, 0, "it does not wait for its master afterwards");
    assert_eq!(axis.temperature, Some(35.0), "the simulated drive is as warm as that");
}

#[test]
fn the_same_run_is_the_same_to_the_last_bit() {
    let last = || {
        let mut run = start(&turntable());
        run.run(8_000, |_| {});
        let axis = table(&run);
        [axis.position, axis.velocity, axis.torque.unwrap_or(0.0), axis.following_error].map(f64::to_bits)
    };
    assert_eq!(last(), last());
}

#[test]
fn a_line_whose_master_is_polled_rarely_goes_on_by_itself() {
    let mut run = start(&turntable());
    run.poll_life_cycle_every(20);
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
}

/// The configuration with some other text in place of its line.
fn changed(pairs: &[(&str, &str)]) -> Config {
    let mut text = std::fs::read_to_string("configs/turntable-modbus.toml").unwrap();
    for (from, to) in pairs {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Config::parse("changed.toml", &text).unwrap_or_else(|error| panic!("{error:?}"))
}

#[test]
fn three_drives_share_the_line_by_turns_and_all_follow() {
    let more = |name: &str, node| {
        format!(
            "[[axis]]\nname = \"{name}\"\nbus = \"table\"\nnode = {node}\ndrive = \"erob-modbus\"\n\n[[program"
        )
    };
    let text = std::fs::read_to_string("configs/turntable-modbus.toml").unwrap();
    let text = text.replacen("[[program", &more("third", 3), 1).replacen("[[program", &more("high", 247), 1);
    let text = text.replace("60 deg\"]", "60 deg\", \"20 deg\", \"-45 deg\"]");
    let text = text.replace("-30 deg\"]", "-30 deg\", \"-20 deg\", \"45 deg\"]");
    let text = text.replace(
        "\"0 deg\", \"0 deg\", \"0 deg\"]",
        "\"0 deg\", \"0 deg\", \"0 deg\", \"10 deg\", \"5 deg\"]",
    );
    let config = Config::parse("three.toml", &text).unwrap_or_else(|error| panic!("{error:?}"));
    let alone = budget(&turntable()).report_ns;
    assert_eq!(budget(&config).report_ns, 3 * alone);
    let mut run = start(&config);
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
    let axes = run.snapshot().axes;
    assert!((axes[3].position.to_degrees() - 10.0).abs() < 0.5, "{:?}", axes[3]);
    assert!((axes[4].position.to_degrees() - 5.0).abs() < 0.5, "{:?}", axes[4]);
}

#[test]
fn a_slower_line_is_slower_and_follows_all_the_same() {
    for rate in ["38400 bit/s", "19200 bit/s", "9600 bit/s"] {
        let config = changed(&[("115200 bit/s", rate)]);
        let mut run = start(&config);
        assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{rate}: {}", run.supervised());
    }
}

#[test]
fn ctrl_c_stops_the_table_in_control_and_disables_it() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    run.interrupt(Interrupt::Controlled);
    let mut fastest_braked = 0.0_f64;
    let outcome = run.run(LONGEST, |run| {
        let truth = run.line(LINE).unwrap().lock().observe(SLAVE).unwrap();
        if truth.is_braked {
            fastest_braked = fastest_braked.max(truth.velocity.abs());
        }
    });
    assert_eq!(outcome, Some(Outcome::Interrupted));
    assert!(fastest_braked < 0.02, "the brake engages at rest: {fastest_braked} rad/s");
    let truth = run.line(LINE).unwrap().lock().observe(SLAVE).unwrap();
    assert!(truth.is_braked && truth.velocity == 0.0, "{truth:?}");
    assert_eq!(truth.error_code, 0);
}

#[test]
fn a_second_ctrl_c_removes_the_power_of_the_table_too() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    run.interrupt(Interrupt::Immediate);
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Interrupted));
    let truth = run.line(LINE).unwrap().lock().observe(SLAVE).unwrap();
    assert!(truth.is_braked, "{truth:?}");
}

#[test]
fn a_silent_drive_stops_the_group_with_one_reason_and_by_itself() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    run.line(LINE).unwrap().lock().silence(SLAVE, true).unwrap();
    let stop = stopped(&mut run);
    assert!(matches!(stop.cause.fault(), Some(Fault::MissedFeedback { .. })), "{stop:?}");
    assert_eq!((stop.axis(), stop.phase), (Some(TABLE as u8), Phase::Moving));
    // Nobody could tell it: its own time-out has taken its torque.
    let truth = run.line(LINE).unwrap().lock().observe(SLAVE).unwrap();
    assert!(truth.is_braked && truth.error_code == 0x0FA2, "{truth:?}");
    assert_eq!(run.supervisor().unreached(), [TABLE]);
}

#[test]
fn a_cut_line_stops_the_group_with_one_reason() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    disturb(&run, LineDisturbance { is_cut: true, ..LineDisturbance::default() });
    let stop = stopped(&mut run);
    assert!(matches!(stop.cause.fault(), Some(Fault::MissedFeedback { .. })), "{stop:?}");
    assert_eq!(stop.origin, Origin::Axis(TABLE as u8));
}

#[test]
fn some_lost_and_damaged_bytes_cost_turns_and_no_motion() {
    let mut run = start(&turntable());
    // One byte of a thousand: a few exchanges of a hundred.
    disturb(
        &run,
        LineDisturbance { wrong_per_million: 300, lost_per_million: 200, ..LineDisturbance::default() },
    );
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
}

#[test]
fn a_line_of_nothing_but_damaged_bytes_stops_the_group_with_one_reason() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    disturb(&run, LineDisturbance { wrong_per_million: 200_000, ..LineDisturbance::default() });
    let stop = stopped(&mut run);
    assert!(matches!(stop.cause.fault(), Some(Fault::MissedFeedback { .. })), "{stop:?}");
    assert_eq!(stop.axis(), Some(TABLE as u8));
}

#[test]
fn replies_that_are_a_little_late_are_taken_and_those_that_are_too_late_stop_the_group() {
    let mut run = start(&turntable());
    disturb(&run, LineDisturbance { late_ns: 3_000_000, ..LineDisturbance::default() });
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    // Longer than a reply is waited for, and shorter than the silence after it.
    disturb(&run, LineDisturbance { late_ns: 30_000_000, ..LineDisturbance::default() });
    let stop = stopped(&mut run);
    assert!(matches!(stop.cause.fault(), Some(Fault::MissedFeedback { .. })), "{stop:?}");
    let (seen, truth) = (table(&run).position, run.line(LINE).unwrap().lock().observe(SLAVE).unwrap());
    assert!(truth.is_braked, "{truth:?}");
    assert!(seen.abs() < 3.0, "no late reply is taken for that of another request: {seen}");
}

#[test]
fn a_fault_of_the_drive_is_the_reason_with_its_code() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    run.line(LINE).unwrap().lock().inject_fault(SLAVE, DriveFault::OverCurrent).unwrap();
    let stop = stopped(&mut run);
    assert_eq!(stop.cause.fault(), Some(&Fault::DriveFault { error_code: 0x2310 }), "{stop:?}");
    assert_eq!(stop.axis(), Some(TABLE as u8));
    assert!(run.supervisor().unreached().is_empty(), "{:?}", run.supervisor().unreached());
}

#[test]
fn a_drive_that_loses_its_torque_without_a_fault_stops_the_group() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    run.line(LINE).unwrap().lock().inject_defect(SLAVE, Defect::TorqueOff, true).unwrap();
    let stop = stopped(&mut run);
    assert!(matches!(stop.cause.fault(), Some(Fault::DriveDisabled { .. })), "{stop:?}");
    assert_eq!(stop.axis(), Some(TABLE as u8));
}

#[test]
fn a_blocked_joint_is_a_following_error() {
    let mut run = start(&turntable());
    until_it_moves(&mut run);
    run.line(LINE).unwrap().lock().inject_defect(SLAVE, Defect::BlockedJoint, true).unwrap();
    let stop = stopped(&mut run);
    assert!(matches!(stop.cause.fault(), Some(Fault::FollowingError { .. })), "{stop:?}");
}

#[test]
fn a_fault_from_before_is_cleared_at_bring_up() {
    let mut run = start(&turntable());
    run.step();
    run.line(LINE).unwrap().lock().inject_fault(SLAVE, DriveFault::OverVoltage).unwrap();
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
}

#[test]
fn a_drive_that_is_not_there_is_named_and_nothing_moves() {
    let mut run = start(&turntable());
    run.line(LINE).unwrap().lock().silence(SLAVE, true).unwrap();
    let outcome = run.run(LONGEST, |run| assert!(run.snapshot().axes[0].velocity.abs() < 1e-6));
    assert_eq!(outcome, Some(Outcome::NotHeard { axis: TABLE }));
}

#[test]
fn a_drive_that_was_switched_on_with_the_controller_is_enabled_when_it_can_be() {
    let mut config = turntable();
    config.axes[TABLE].power_up_ns = 3_000_000_000;
    let mut run = start(&config);
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
}

#[test]
fn without_a_communication_time_out_the_drive_is_led_all_the_same() {
    let config = changed(&[("\"500 ms\"", "\"0 ms\"")]);
    let mut run = start(&config);
    assert_eq!(run.run(LONGEST, |_| {}), Some(Outcome::Finished), "{}", run.supervised());
}

#[test]
fn the_table_of_a_group_of_its_own_stops_alone() {
    let groups = "[[group]]\nname = \"arm\"\naxes = [\"shoulder\", \"elbow\"]\n\n[[group]]\nname = \"table\"\naxes = [\"table\"]\n\n[[program";
    let text =
        std::fs::read_to_string("configs/turntable-modbus.toml").unwrap().replacen("[[program", groups, 1);
    let from = text.find("[[program").unwrap();
    let moves = "[[program.move]]\ngroup = \"arm\"\nto = [\"90 deg\", \"-90 deg\"]\n\n[[program.move]]\ngroup = \"table\"\nto = [\"120 deg\"]\n";
    let config = Config::parse("groups.toml", &format!("{}{moves}", &text[..from]))
        .unwrap_or_else(|error| panic!("{error:?}"));
    let mut run = start(&config);
    until_it_moves(&mut run);
    run.line(LINE).unwrap().lock().inject_fault(SLAVE, DriveFault::OverCurrent).unwrap();
    let mut arm_after = None;
    run.run(LONGEST, |run| {
        let groups = run.snapshot();
        if groups.groups()[1].stop.is_some() && arm_after.is_none() {
            arm_after = Some(groups.groups()[0].stop.is_none());
        }
    });
    assert_eq!(arm_after, Some(true), "the arm does not stop with the table");
}
