//! The controller with the simulated arm in virtual time.

use std::f64::consts::TAU;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

use takt::config::{Config, Control};
use takt::controller::AfterBringUp;
use takt::sim::{DriveFault, Observation, SimulatedBus};
use takt::{Interrupt, Outcome, VirtualRun};
use takt_rt::{
    Answer, BusHealth, BusPort, Clock, DriveState, Fault, Frame, Id, MAX_AXES, MotionState, Move, Phase,
    ReceiveBatch, RejectReason, Request, RequestKind, Rule, StopCategory, StopCause,
};

/// A minute of 1 ms cycles. Every program here takes less.
const CYCLES_AT_MOST: u64 = 60_000;

fn load(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    Config::load(&path).unwrap_or_else(|error| panic!("{name}: {error:?}"))
}

fn start(config: &Config) -> VirtualRun<SimulatedBus> {
    VirtualRun::simulated(config).unwrap().0
}

/// The distance of each axis from its last target, in counts, when the group holds for the last time.
fn run_and_measure(config: &Config) -> Vec<f64> {
    let mut run = start(config);
    let mut errors = vec![];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        let snapshot = run.snapshot();
        let targets: Option<Vec<f64>> = run.supervisor().targets().into_iter().collect();
        if let (Phase::Holding, Some(target)) = (snapshot.groups[0].phase, targets) {
            errors = target
                .iter()
                .zip(&snapshot.axes)
                .zip(&config.axes)
                .map(|((target, axis), config)| {
                    (axis.position - target) * config.counts_per_turn * config.gear_ratio / TAU
                })
                .collect();
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    assert_eq!(run.snapshot().missed_slots, 0);
    errors
}

#[test]
fn the_six_axis_arm_runs_its_program_and_every_axis_ends_within_two_counts() {
    let errors = run_and_measure(&load("arm6-erob.toml"));
    assert_eq!(errors.len(), 6);
    assert!(errors.iter().all(|error| error.abs() <= 2.0), "{errors:?}");
}

#[test]
fn the_same_program_runs_in_cyclic_synchronous_velocity() {
    let errors = run_and_measure(&load("arm6-erob-csv.toml"));
    assert!(errors.iter().all(|error| error.abs() <= 2.0), "{errors:?}");
}

/// A PD loop without an integral part comes to rest where its stiffness balances the Coulomb friction.
#[test]
fn the_same_program_runs_in_cyclic_synchronous_torque() {
    let config = load("arm6-erob-cst.toml");
    let errors = run_and_measure(&config);
    for (error, axis) in errors.iter().zip(&config.axes) {
        let Control::Torque { stiffness, .. } = axis.control else { panic!("{} is not in CST", axis.name) };
        let bound = axis.joint.coulomb_friction() / stiffness * axis.counts_per_turn / TAU;
        assert!(error.abs() <= bound + 2.0, "{}: {error} counts, at most {bound} are friction", axis.name);
    }
}

#[test]
fn thirty_two_axes_run_on_eleven_buses() {
    let errors = run_and_measure(&load("axes32-erob.toml"));
    assert_eq!(errors.len(), 32);
    assert!(errors.iter().all(|error| error.abs() <= 2.0), "{errors:?}");
}

#[test]
fn after_a_run_every_drive_is_disabled_and_at_rest() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    run.run(CYCLES_AT_MOST, |_| {});
    for (axis, shown) in config.axes.iter().zip(run.snapshot().axes) {
        assert!(!DriveState::decode(shown.statusword).has_torque(), "{}", axis.name);
    }
}

#[test]
fn ctrl_c_during_a_move_stops_in_control_and_disables() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    while run.snapshot().groups[0].phase != Phase::Moving {
        assert!(run.step());
    }
    run.run(300, |_| {});
    run.interrupt(Interrupt::Controlled);
    let mut phases = vec![];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        let phase = run.snapshot().groups[0].phase;
        if phases.last() != Some(&phase) {
            phases.push(phase);
        }
    });
    assert_eq!(outcome, Some(Outcome::Interrupted));
    assert_eq!(phases, [Phase::Moving, Phase::Stopping, Phase::Holding, Phase::Disabling, Phase::Disabled]);
}

/// The controlwords that remove the power take effect at the next SYNC. If the run ended before, a drive would keep its last
/// torque.
#[test]
fn a_second_ctrl_c_removes_the_power_and_the_run_ends_when_it_is_off() {
    for name in ["arm6-erob.toml", "arm6-erob-csv.toml", "arm6-erob-cst.toml", "gantry-yz-aim.toml"] {
        let config = load(name);
        for first in [Some(Interrupt::Controlled), None] {
            let mut run = start(&config);
            while run.snapshot().groups[0].phase != Phase::Moving {
                assert!(run.step());
            }
            run.run(300, |_| {});
            if let Some(first) = first {
                run.interrupt(first);
                run.run(5, |_| {});
            }
            run.interrupt(Interrupt::Immediate);
            assert_eq!(run.run(200, |_| {}), Some(Outcome::Interrupted), "{name}");
            for axis in &config.axes {
                let drive = run.ports()[axis.bus].observe(axis.node).unwrap();
                assert!(!drive.state.has_torque(), "{name}: {} is {:?} in the end", axis.name, drive.state);
            }
        }
    }
}

#[test]
fn the_simulation_runs_at_every_cycle_time() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
    let text = std::fs::read_to_string(path).unwrap();
    for (period, of_bus) in [("1 ms", "2 ms"), ("4 ms", "8 ms"), ("20 ms", "20 ms")] {
        let bus = format!("name = \"wrist\"\nperiod = \"{of_bus}\"");
        let text = text.replace("\"1 ms\"", &format!("\"{period}\"")).replace("name = \"wrist\"", &bus);
        let mut config = Config::parse("slow.toml", &text).unwrap();
        config.program.moves.truncate(1);
        let mut run = start(&config);
        assert_eq!(run.run(CYCLES_AT_MOST, |_| {}), Some(Outcome::Finished), "{period}");
        let paused_ns: Vec<u64> = run.ports().iter().map(|bus| bus.paused_ns()).collect();
        assert_eq!(paused_ns, [0, 0], "{period}");
    }
}

/// A hash of all records of a run.
fn fingerprint(config: &Config) -> u64 {
    let (mut run, mut log) = VirtualRun::simulated(config).unwrap();
    let mut hasher = DefaultHasher::new();
    run.run(CYCLES_AT_MOST, |_| {
        while log
            .next_record(|record| format!("{:?}{:?}", record.timing, record.axes()).hash(&mut hasher))
            .is_some()
        {}
    });
    hasher.finish()
}

#[test]
fn the_same_configuration_gives_the_same_run_bit_for_bit() {
    let mut config = load("arm6-erob.toml");
    config.program.moves.truncate(1);
    assert_eq!(fingerprint(&config), fingerprint(&config));
    let joint = &mut config.axes[0].joint;
    joint.coulomb_friction = joint.coulomb_friction.map(|friction| friction * 1.001);
    assert_ne!(
        fingerprint(&config),
        fingerprint(&load("arm6-erob.toml")),
        "another friction gives another fingerprint"
    );
}

#[test]
fn after_ten_minutes_of_motion_the_axis_still_reaches_its_targets_exactly() {
    let mut config = load("single-erob.toml");
    config.program.repeat = 120;
    let mut run = start(&config);
    let mut largest_counts = 0.0_f64;
    let mut holding = 0;
    let outcome = run.run(800_000, |run| {
        let snapshot = run.snapshot();
        holding = if snapshot.groups[0].phase == Phase::Holding { holding + 1 } else { 0 };
        // The joint has settled a tenth of a second after each move.
        if let (100, [Some(target)]) = (holding, &run.supervisor().targets()[..]) {
            let counts = (snapshot.axes[0].position - target) * config.axes[0].counts_per_turn / TAU;
            largest_counts = largest_counts.max(counts.abs());
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    let slots = run.snapshot().slot;
    assert!(slots > 600_000, "{slots} ms");
    assert!(largest_counts <= 2.0, "{largest_counts}");
}

#[test]
fn stalls_of_the_computer_are_counted_and_the_program_still_finishes() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    let mut cycle = 0;
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        cycle += 1;
        if cycle % 700 == 0 {
            run.clock().stall(30_000_000);
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    let missed = run.snapshot().missed_slots;
    assert!(missed >= 10 * 29, "{missed}");
}

#[test]
fn an_arm_stops_when_its_computer_resumes_after_a_suspension_and_a_disabled_one_takes_no_notice() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    run.clock().suspend(3_600_000_000_000);
    while run.snapshot().groups[0].phase != Phase::Moving {
        assert!(run.step());
    }
    run.clock().suspend(3_200_000_000);
    assert!(run.step());
    let stop = run.snapshot().groups[0].stop.unwrap();
    assert_eq!(stop.cause, StopCause::Fault(Fault::Suspended { suspended_ns: 3_200_000_000 }));
    assert_eq!(stop.category, StopCategory::One);
    let outcome = run.run(CYCLES_AT_MOST, |_| {});
    assert_eq!(rule_and_axis(outcome), (Rule::TimingUnfit, None));
}

/// Runs into a move, injects a fault, and runs on to the end.
fn run_and_inject(config: &Config, inject: impl FnOnce(&mut SimulatedBus)) -> (Option<Outcome>, Vec<Phase>) {
    let mut run = start(config);
    while run.snapshot().groups[0].phase != Phase::Moving {
        assert!(run.step());
    }
    run.run(300, |_| {});
    inject(&mut run.ports()[0]);
    let mut phases = vec![];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        let phase = run.snapshot().groups[0].phase;
        if phases.last() != Some(&phase) {
            phases.push(phase);
        }
    });
    (outcome, phases)
}

fn rule_and_axis(outcome: Option<Outcome>) -> (Rule, Option<u8>) {
    match outcome {
        Some(Outcome::Stopped(stop)) => (stop.rule(), stop.axis()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_fault_of_one_drive_stops_the_whole_arm_in_a_coordinated_way() {
    let config = load("arm6-erob.toml");
    let (outcome, phases) =
        run_and_inject(&config, |bus| bus.inject_fault(2, DriveFault::OverCurrent).unwrap());
    assert_eq!(rule_and_axis(outcome), (Rule::DriveFault, Some(1)));
    // The stop begins in the cycle in which the drive reports the fault.
    assert_eq!(phases, [Phase::Stopping, Phase::Disabling, Phase::Disabled]);
}

#[test]
fn a_drive_that_falls_silent_stops_the_whole_arm() {
    let config = load("arm6-erob.toml");
    let (outcome, _) = run_and_inject(&config, |bus| bus.silence(3, true).unwrap());
    assert_eq!(rule_and_axis(outcome), (Rule::MissedFeedback, Some(2)));
}

#[test]
fn a_drive_that_restarts_in_motion_stops_the_whole_arm() {
    let config = load("arm6-erob.toml");
    let (outcome, _) = run_and_inject(&config, |bus| bus.power_cycle(1).unwrap());
    assert_eq!(rule_and_axis(outcome), (Rule::MissedFeedback, Some(0)));
}

#[test]
fn a_blocked_joint_stops_the_whole_arm() {
    let config = load("arm6-erob.toml");
    let (outcome, _) = run_and_inject(&config, |bus| bus.set_load_torque(1, 1e4).unwrap());
    let (rule, axis) = rule_and_axis(outcome);
    // So much torque moves it faster than is plausible.
    let seen = [Rule::FollowingError, Rule::DriveFault, Rule::ImplausibleFeedback];
    assert!(seen.contains(&rule), "{rule:?}");
    assert_eq!(axis, Some(0));
}

/// The state of every simulated drive.
fn drives_of(ports: &mut [SimulatedBus]) -> Vec<Observation> {
    let mut seen = vec![];
    for port in ports {
        let nodes: Vec<u8> = port.nodes().collect();
        seen.extend(nodes.into_iter().map(|node| port.observe(node).unwrap()));
    }
    seen
}

/// The controller ends without a shut-down, as after `kill -9`. The heartbeat watchdogs of the drives stop the arm: an eRob by
/// object 1029, a YZ-AIM by its alarm 20.
#[test]
fn after_the_controller_was_killed_the_drives_of_every_family_stop_by_themselves() {
    for name in ["arm6-erob.toml", "gantry-yz-aim.toml"] {
        let config = load(name);
        let mut run = start(&config);
        while run.snapshot().groups[0].phase != Phase::Moving {
            assert!(run.step());
        }
        run.run(300, |_| {});
        assert!(
            drives_of(run.ports()).iter().any(|seen| seen.velocity.abs() > 0.01),
            "{name}: no drive moves"
        );
        let mut now_ns = run.clock().now_ns();
        let end_ns = now_ns + config.master.heartbeat_timeout_ns + 300_000_000;
        while now_ns < end_ns {
            now_ns += 1_000_000;
            run.ports().iter_mut().for_each(|port| port.receive(now_ns, &mut ReceiveBatch::new()));
        }
        for seen in drives_of(run.ports()) {
            assert!(!seen.state.has_torque(), "{name}: {:?}", seen.state);
            assert!(seen.velocity.abs() < 1e-3, "{name}: {}", seen.velocity);
        }
    }
}

/// A bus whose time has begun before that of the controller.
struct EarlierBus {
    bus: SimulatedBus,
    by_ns: u64,
}

impl BusPort for EarlierBus {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.bus.send(now_ns + self.by_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        self.bus.receive(now_ns + self.by_ns, batch);
        batch.iter_mut().for_each(|received| received.at_ns = received.at_ns.saturating_sub(self.by_ns));
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.bus.unconfirmed(now_ns + self.by_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.bus.health()
    }
}

/// The drives may still be enabled, or their watchdogs may have stopped them.
#[test]
fn drives_of_a_killed_controller_are_brought_up_again() {
    for (name, silence_ms) in [
        ("arm6-erob.toml", 100),
        ("arm6-erob.toml", 3_000),
        ("gantry-yz-aim.toml", 100),
        ("gantry-yz-aim.toml", 3_000),
    ] {
        let config = load(name);
        let mut killed = start(&config);
        while killed.snapshot().groups[0].phase != Phase::Moving {
            assert!(killed.step());
        }
        killed.run(300, |_| {});
        let mut now_ns = killed.clock().now_ns();
        let mut ports = vec![];
        for (bus, port) in killed.ports().iter_mut().enumerate() {
            ports.push(std::mem::replace(port, takt::simulated_bus(&config, bus)));
        }
        for _ in 0..silence_ms {
            now_ns += 1_000_000;
            ports.iter_mut().for_each(|port| port.receive(now_ns, &mut ReceiveBatch::new()));
        }
        let ports = ports.into_iter().map(|bus| EarlierBus { bus, by_ns: now_ns }).collect();
        let mut next = VirtualRun::new(&config, ports).unwrap().0;
        assert_eq!(next.run(CYCLES_AT_MOST, |_| {}), Some(Outcome::Finished), "{name}, {silence_ms} ms");
    }
}

#[test]
fn a_refused_request_of_another_client_does_not_end_the_program() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        if run.snapshot().groups[0].phase == Phase::Moving {
            // Enabled axes cannot be enabled.
            let _ = run.host().request(Request::Enable);
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    assert!(run.snapshot().rejected > 1000);
}

fn move_to(target: [f64; MAX_AXES], minimum_duration_s: f64) -> Move {
    Move {
        target,
        target_velocity: [0.0; MAX_AXES],
        velocity_scale: 1.0,
        acceleration_scale: 1.0,
        minimum_duration_s,
    }
}

#[test]
fn a_client_that_keeps_moving_the_group_does_not_prevent_the_end_of_the_run() {
    let config = load("arm6-erob.toml");
    let ports = (0..config.buses.len()).map(|bus| takt::simulated_bus(&config, bus)).collect();
    let mut run = VirtualRun::serving(&config, ports, AfterBringUp::Enable).unwrap().0;
    while run.snapshot().groups[0].phase != Phase::Holding {
        assert!(run.step());
    }
    let here = run.snapshot().axes.map(|axis| axis.position_set);
    run.interrupt(Interrupt::Controlled);
    let mut cycles = 0;
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        cycles += 1;
        let mut target = here;
        target[0] += if cycles % 200 < 100 { 0.3 } else { -0.3 };
        // The queue may be full.
        let _ = run.host().request(Request::Move(move_to(target, 0.0)));
    });
    assert_eq!(outcome, Some(Outcome::Interrupted));
    assert!(
        drives_of(run.ports())
            .iter()
            .all(|drive| drive.state != DriveState::OperationEnabled && drive.is_braked)
    );
}

#[test]
fn a_group_that_a_client_moves_before_the_life_cycle_sees_it_hold_goes_on() {
    let config = load("arm6-erob.toml");
    let ports = (0..config.buses.len()).map(|bus| takt::simulated_bus(&config, bus)).collect();
    let mut run = VirtualRun::serving(&config, ports, AfterBringUp::Enable).unwrap().0;
    while run.snapshot().groups[0].phase != Phase::Enabling {
        assert!(run.step());
    }
    run.poll_life_cycle_every(50);
    while run.snapshot().groups[0].phase != Phase::Holding {
        assert!(run.step());
    }
    let mut target = run.snapshot().axes.map(|axis| axis.position_set);
    target[0] += 0.1;
    let slow_move = move_to(target, 20.0);
    let motion = run.host().request(Request::Move(slow_move)).unwrap();
    run.run(2, |_| {});
    assert_eq!(run.snapshot().groups[0].phase, Phase::Moving);
    // This is longer than the enable time-out.
    run.run(25_000, |_| {});
    assert_eq!(run.snapshot().groups[0].phase, Phase::Holding);
    let snapshot = run.snapshot();
    assert_eq!((snapshot.motions.of(motion), snapshot.groups[0].stop), (Some(MotionState::Finished), None));
    run.interrupt(Interrupt::Controlled);
    assert_eq!(run.run(CYCLES_AT_MOST, |_| {}), Some(Outcome::Interrupted));
}

#[test]
fn the_answer_to_a_request_is_found_by_its_id_with_the_reason_of_a_refusal() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    while run.snapshot().groups[0].phase != Phase::Moving {
        assert!(run.step());
    }
    let refused = run.host().request(Request::Enable).unwrap();
    let taken = run.host().request(Request::Stop(StopCategory::Two)).unwrap();
    run.run(2, |_| {});
    let answers = run.snapshot().answers;
    let Answer::Rejected(Some(refusal)) = answers.of(refused) else { panic!("{answers:?}") };
    let kind = (refusal.request, refusal.reason, refusal.phase);
    assert_eq!(kind, (RequestKind::Enable, RejectReason::Phase, Phase::Moving));
    assert_eq!(answers.of(taken), Answer::Granted);
}

#[test]
fn a_fault_during_disabling_is_the_outcome_of_the_run() {
    let config = load("arm6-erob.toml");
    let mut run = start(&config);
    let mut is_disturbed = false;
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        if run.snapshot().groups[0].phase == Phase::Disabling && !is_disturbed {
            is_disturbed = true;
            let now_ns = run.clock().now_ns();
            assert!(run.ports()[0].send_foreign(now_ns, &Frame::of(Id::canopen(0x080, 0), [])));
        }
    });
    let Some(Outcome::Stopped(stop)) = outcome else { panic!("{outcome:?}") };
    assert_eq!((stop.rule(), stop.phase), (Rule::ForeignMaster, Phase::Disabling));
}
