//! Axes that did not confirm in the end that they have no torque are named, whatever their protocol.

use std::io::Write as _;
use std::sync::Arc;

use takt::config::Config;
use takt::family::{SignOfLife, Unwatched, Watchdog, stops_by_itself_after, unreached_words};
use takt::faults::FaultInjector;
use takt::sim::SimulatedBus;
use takt::{Interrupt, Outcome, Port, VirtualRun};
use takt_rt::{BusHealth, BusPort, Frame, Id, Phase, ReceiveBatch, Rule};

use crate::faults::arm::{folder, scenario};

const SECOND_NS: u64 = 1_000_000_000;
/// Two axes on one bus, whose heartbeats an eRob watches, and a Damiao does not.
const MIXED: &str = r#"
name = "mixed"
[[bus]]
name = "can"
[[axis]]
name = "elbow"
bus = "can"
node = 1
drive = "erob-canopen"
limits = { position = [-2, 2], velocity = 1, acceleration = 6, torque = 60 }
[[axis]]
name = "jaws"
bus = "can"
node = 9
master_id = 0x11
drive = "bit-fields"
description = "damiao-dm-mit"
position_full_scale = "12.5 rad"
velocity_full_scale = "30 rad/s"
torque_full_scale = "10 Nm"
kp = 100
kd = 3
joint = { inertia = "0.05 kg m^2", viscous_friction = 0.1, coulomb_friction = 0.1 }
limits = { position = [-2, 2], velocity = 1, acceleration = 6, torque = 8 }
[[program.move]]
to = 1
[[program.move]]
to = 0
"#;
const OWN_PROTOCOL: &str = r#"
name = "turntable"
[[bus]]
name = "can"
period = "10 ms"
[[axis]]
name = "table"
bus = "can"
node = 1
drive = "erob-can"
limits = { position = [-2, 2], velocity = 1, acceleration = 2, torque = 31 }
[[program.move]]
to = 1
"#;
const ONE_EROB: &str = r#"
name = "one"
[[bus]]
name = "can"
[[axis]]
name = "joint"
bus = "can"
node = 1
drive = "erob-canopen"
limits = { position = [-2, 2], velocity = 1, acceleration = 6, torque = 31 }
[[program.move]]
to = 1
[[program.move]]
to = 0
"#;
const LINE: &str = r#"
name = "turntable"
[[bus]]
name = "line"
bit_rate = "115200 bit/s"
period = "25 ms"
[[axis]]
name = "table"
bus = "line"
node = 1
drive = "erob-modbus"
communication_timeout = "500 ms"
limits = { position = [-2, 2], velocity = 1, acceleration = 2, torque = 31 }
[[program.move]]
to = 1
"#;

fn config(text: &str) -> Config {
    let mut config = Config::parse("unreached.toml", text).unwrap_or_else(|error| panic!("{error:?}"));
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    config
}

struct Ended {
    outcome: Option<Outcome>,
    unreached: Vec<usize>,
    /// From the first motion to the first cycle in which the group was disabled.
    until_disabled_ns: u64,
    /// From there to the end.
    after_disabled_ns: u64,
}

/// Runs to the end with an axis that falls silent in motion, and with an interrupt 100 ms after that.
fn ended(config: &Config, silent: Option<&str>, interrupt: Option<Interrupt>) -> Ended {
    // One that never begins where none is wanted: a scenario has at least one fault.
    let (axis, when) = silent.map_or((config.axes[0].name.as_str(), "at = \"3600 s\""), |axis| {
        (axis, "when = \"moving\"\nat = \"300 ms\"")
    });
    ended_by(config, &format!("[[fault]]\nkind = \"silent-node\"\naxis = {axis:?}\n{when}\n"), interrupt)
}

/// Runs to the end with these faults, and with an interrupt 400 ms after the first motion.
fn ended_by(config: &Config, faults: &str, interrupt: Option<Interrupt>) -> Ended {
    let injector = Arc::new(FaultInjector::new(scenario(faults, config)));
    let (mut run, _) = VirtualRun::<Port>::with_faults(config, injector).unwrap();
    let (mut moving_ns, mut disabled_ns) = (None, None);
    let outcome = run.run(120_000, |run| {
        let snapshot = run.snapshot();
        if snapshot.groups[0].phase == Phase::Moving {
            moving_ns = moving_ns.or(Some(snapshot.at_ns));
        }
        if moving_ns.is_some_and(|since_ns| snapshot.at_ns > since_ns + SECOND_NS * 4 / 10) {
            interrupt.into_iter().for_each(|interrupt| run.interrupt(interrupt));
        }
        if moving_ns.is_some() && snapshot.groups[0].phase == Phase::Disabled {
            disabled_ns = disabled_ns.or(Some(snapshot.at_ns));
        }
    });
    let disabled_ns = disabled_ns.unwrap();
    Ended {
        outcome,
        unreached: run.supervisor().unreached().to_vec(),
        until_disabled_ns: disabled_ns - moving_ns.unwrap(),
        after_disabled_ns: run.snapshot().at_ns - disabled_ns,
    }
}

#[test]
fn drives_that_confirm_that_they_have_no_torque_are_not_named() {
    for text in [MIXED, OWN_PROTOCOL, LINE] {
        let config = config(text);
        let finished = ended(&config, None, None);
        assert_eq!(
            (finished.outcome, finished.unreached),
            (Some(Outcome::Finished), vec![]),
            "{}",
            config.name
        );
        let interrupted = ended(&config, None, Some(Interrupt::Immediate));
        assert_eq!(
            (interrupted.outcome, interrupted.unreached),
            (Some(Outcome::Interrupted), vec![]),
            "{}",
            config.name
        );
    }
}

#[test]
fn a_drive_that_falls_silent_in_motion_is_named_whatever_its_protocol_and_however_the_run_ends() {
    for (text, axis, index) in
        [(MIXED, "elbow", 0), (MIXED, "jaws", 1), (OWN_PROTOCOL, "table", 0), (LINE, "table", 0)]
    {
        let config = config(text);
        for interrupt in [None, Some(Interrupt::Controlled), Some(Interrupt::Immediate)] {
            let ended = ended(&config, Some(axis), interrupt);
            assert_eq!(ended.unreached, [index], "{axis} of {}, {interrupt:?}", config.name);
        }
    }
}

#[test]
fn a_drive_without_a_watchdog_whose_last_report_shows_torque_is_told_to_stop_until_the_time_out() {
    let ended = ended(&config(MIXED), Some("jaws"), None);
    assert!(ended.after_disabled_ns > 4 * SECOND_NS, "{} ns", ended.after_disabled_ns);
}

/// A bus on which a drive refuses every request by SDO from some time on.
struct Refusing {
    bus: SimulatedBus,
    node: u8,
    is_refusing: bool,
}

impl BusPort for Refusing {
    fn send(&mut self, now_ns: u64, frames: &[Frame]) -> usize {
        self.bus.send(now_ns, frames)
    }

    fn receive(&mut self, now_ns: u64, batch: &mut ReceiveBatch) {
        let mut all = ReceiveBatch::new();
        self.bus.receive(now_ns, &mut all);
        for mut received in all {
            let [_, index, high, subindex, ..] = *received.frame.payload() else {
                batch.push(received);
                continue;
            };
            if self.is_refusing && received.frame.id() == Id::canopen(0x580, self.node) {
                // "Data cannot be transferred because of the present device state" (CiA 301, 7.2.4.3.17).
                let abort = [0x80, index, high, subindex, 0x22, 0x00, 0x00, 0x08];
                received.frame = Frame::of(received.frame.id(), abort);
            }
            batch.push(received);
        }
    }

    fn unconfirmed(&mut self, now_ns: u64) -> usize {
        self.bus.unconfirmed(now_ns)
    }

    fn health(&mut self) -> BusHealth {
        self.bus.health()
    }
}

#[test]
fn a_drive_that_refuses_to_be_shut_down_is_named() {
    let config = config(MIXED);
    let port = Refusing { bus: takt::simulated_bus(&config, 0), node: 1, is_refusing: false };
    let (mut run, _) = VirtualRun::new(&config, vec![port]).unwrap();
    let mut has_moved = false;
    run.run(120_000, |run| {
        let phase = run.snapshot().groups[0].phase;
        has_moved |= phase == Phase::Moving;
        run.ports()[0].is_refusing |= has_moved && phase == Phase::Disabled;
    });
    assert_eq!(run.supervisor().unreached(), [0]);
}

#[test]
fn after_a_bring_up_that_fails_the_others_are_told_to_stop_and_those_not_reached_are_named() {
    let config = config(MIXED);
    let mut port = Refusing { bus: takt::simulated_bus(&config, 0), node: 1, is_refusing: true };
    // An earlier run has left it with torque.
    let enable = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
    for at_ms in 0..20 {
        port.send(at_ms * 1_000_000, &[Frame::of(Id::canopen(0, 9), enable)]);
        port.receive(at_ms * 1_000_000, &mut ReceiveBatch::new());
    }
    assert!(port.bus.observe(9).unwrap().state.has_torque());
    let (mut run, _) = VirtualRun::new(&config, vec![port]).unwrap();
    let outcome = run.run(120_000, |_| {});
    assert!(matches!(outcome, Some(Outcome::BringUpFailed(_))), "{outcome:?}");
    assert_eq!(run.supervisor().unreached(), [0]);
    assert!(!run.ports()[0].bus.observe(9).unwrap().state.has_torque());
}

#[test]
fn after_an_interrupted_bring_up_every_axis_that_has_confirmed_nothing_is_named() {
    let config = config(&OWN_PROTOCOL.replace("erob-can", "erob-canopen"));
    for (interrupt, unreached) in [(Interrupt::Controlled, vec![]), (Interrupt::Immediate, vec![0])] {
        let (mut run, _) = VirtualRun::new(&config, vec![takt::simulated_bus(&config, 0)]).unwrap();
        run.interrupt(interrupt);
        assert_eq!(run.run(120_000, |_| {}), Some(Outcome::Interrupted));
        assert_eq!(run.supervisor().unreached(), unreached, "{interrupt:?}");
    }
}

/// Runs to the end with a joint whose drive stops to obey in motion, and returns the axes named at the end and the speed of the joint and
/// whether it has torque a second later.
fn after_disobedience(config: &Config, how: &str) -> (Vec<usize>, f64, bool) {
    let text = format!(
        "[[fault]]\nkind = \"disobedience\"\nhow = {how:?}\naxis = \"joint\"\nwhen = \"moving\"\nat = \"100 ms\"\n"
    );
    let injector = Arc::new(FaultInjector::new(scenario(&text, config)));
    let (mut run, _) = VirtualRun::<Port>::with_faults(config, injector).unwrap();
    let outcome = run.run(120_000, |_| {});
    assert!(matches!(outcome, Some(Outcome::Stopped(_))), "{how}: {outcome:?}");
    let end_ns = run.snapshot().at_ns;
    let unreached = run.supervisor().unreached().to_vec();
    let port = &mut run.ports()[0];
    for at_ms in 1..=1000 {
        port.receive(end_ns + at_ms * 1_000_000, &mut ReceiveBatch::new());
    }
    let drive = port.simulated_mut().unwrap().observe(1).unwrap();
    (unreached, drive.velocity, drive.state.has_torque())
}

#[test]
fn a_drive_that_has_not_shown_that_it_has_no_torque_keeps_its_watchdog() {
    let sheet = folder().join("eds/erob-canopen.eds").display().to_string();
    let by_sheet = ONE_EROB.replace(
        "drive = \"erob-canopen\"",
        &format!("drive = \"cia402\"\neds = {sheet:?}\ncounts_per_turn = 524288"),
    );
    for text in [ONE_EROB, &by_sheet] {
        for how in ["keeps-state", "local", "enables-itself"] {
            let (unreached, velocity, has_torque) = after_disobedience(&config(text), how);
            assert!(velocity == 0.0 && !has_torque, "{how}: {velocity} rad/s, {has_torque}\n{text}");
            assert_eq!(unreached, [0], "{how}");
        }
    }
}

#[test]
fn a_drive_that_shows_torque_while_it_is_shut_down_is_the_outcome_of_the_run() {
    let config = config(ONE_EROB);
    // The drive goes on to report until the shut-down has asked it for its state.
    let shows_torque = |at_us: u64| {
        let time = format!("when = \"moving\"\nat = \"{at_us} us\"\n");
        format!(
            "[[fault]]\nkind = \"statusword\"\naxis = \"joint\"\nset = 0x0027\nclear = 0x0048\n{time}\
             [[fault]]\nkind = \"drop\"\nfunction = \"nmt\"\n{time}"
        )
    };
    let untroubled = ended_by(&config, &shows_torque(3_600_000_000), None);
    assert_eq!(untroubled.outcome, Some(Outcome::Finished));
    let Ended { outcome, .. } =
        ended_by(&config, &shows_torque(untroubled.until_disabled_ns / 1000 + 1), None);
    assert!(
        matches!(outcome, Some(Outcome::Stopped(stop)) if stop.rule() == Rule::DriveEnabled),
        "{outcome:?}"
    );
}

#[test]
fn each_drive_stops_by_its_own_watchdog_or_not_at_all() {
    let fact = |config: &Config, axis: usize| stops_by_itself_after(&config.axes[axis], config);
    let by = |sign, ms: u64| Ok(Watchdog::new(sign, Some(ms * 1_000_000)));
    let mixed = config(MIXED);
    assert_eq!(fact(&mixed, 0), by(SignOfLife::Heartbeat, mixed.master.heartbeat_timeout_ns / 1_000_000));
    assert_eq!(fact(&mixed, 1), Err(Unwatched::NoWatchdog), "the heartbeats of its bus are not its own");
    let off = config(&format!("{MIXED}[master]\nheartbeat = \"off\"\n"));
    assert_eq!(
        [0, 1].map(|axis| fact(&off, axis).unwrap_err()),
        [Unwatched::HeartbeatOff, Unwatched::NoWatchdog]
    );
    assert_eq!(fact(&config(OWN_PROTOCOL), 0), Err(Unwatched::NoWatchdog));
    assert_eq!(fact(&config(LINE), 0), by(SignOfLife::Request, 500));
    assert_eq!(fact(&config(&LINE.replace("500 ms", "0 ms")), 0), Err(Unwatched::TimeoutOff));
}

#[test]
fn a_consumer_heartbeat_that_cannot_be_written_is_no_watchdog() {
    let sheet = folder().join("eds/erob-canopen.eds");
    let with = |objects: &str| {
        let mut quirks = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
        write!(
            quirks,
            "[drive]\nvendor = \"none\"\nproduct = \"none\"\nstatus = \"from its data sheet, not tried on hardware\"\n\
             sources = [\"a test\"]\n[objects]\n{objects}\n"
        )
        .unwrap();
        let text = format!(
            "name = \"one\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"joint\"\nbus = \"can\"\nnode = 1\ndrive = \"cia402\"\n\
             counts_per_turn = 524288\neds = {:?}\nquirks = {:?}\nlimits = {{ position = [-1, 1], velocity = 1, acceleration = 5, torque = 10 }}\n",
            sheet.display().to_string(),
            quirks.path().display().to_string()
        );
        let config = config(&text);
        stops_by_itself_after(&config.axes[0], &config)
    };
    assert!(with("").is_ok());
    assert_eq!(with("constant = [\"1016\"]"), Err(Unwatched::NoErrorControl));
    assert_eq!(with("missing = [\"1016\"]"), Err(Unwatched::NoErrorControl));
}

#[test]
fn the_last_message_names_together_the_axes_that_stop_for_the_same_reason() {
    let words = unreached_words(&config(MIXED), &[0, 1]);
    let [elbow, jaws] = &words[..] else { panic!("{words:?}") };
    assert!(elbow.starts_with("elbow: ") && elbow.contains("after the last heartbeat"), "{elbow}");
    assert!(
        jaws.starts_with("jaws: ") && jaws.contains("it does not stop by itself (its drive has no watchdog)"),
        "{jaws}"
    );
    assert_eq!(unreached_words(&config(MIXED), &[]), [""; 0]);
}
