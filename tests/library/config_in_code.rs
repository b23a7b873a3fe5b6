//! A configuration that was changed in code is checked by whoever starts with it, by the rules of the reader of files.

use std::time::Duration;

use takt::SessionOptions;
use takt::config::{
    Axis, Bus, CanLine, Config, Control, DriveFamily, Feedback, Interface, Limits, Program, ProgramMove,
    ProgramTarget, StreamDelay, Travel,
};
use takt::controller::assemble;
use takt::family;
use takt::{Controller, Outcome, VirtualController, VirtualRun};

fn sound() -> Config {
    Config::parse("arm6-erob.toml", include_str!("../../configs/arm6-erob.toml")).unwrap()
}

/// What is spoilt, and words that the error must have.
type Case = (&'static str, fn(&mut Config), &'static [&'static str]);

/// A section of a file with one line, and the same value in code.
type FileAndField = (&'static str, fn(&mut Config));

/// A rule of a bus and of an axis of a list names the element.
const AXIS: &str = "axes[1] \"joint2\"";
const BUS: &str = "buses[1] \"wrist\"";

fn axis(config: &mut Config) -> &mut Axis {
    &mut config.axes[1]
}

fn bus(config: &mut Config) -> &mut Bus {
    &mut config.buses[1]
}

fn first_move(config: &mut Config) -> &mut ProgramMove {
    &mut config.program.moves[0]
}

const CASES: &[Case] = &[
    ("name", |c| c.name = String::new(), &["`name`"]),
    ("period of 1 ns", |c| c.cycle.period_ns = 1, &["`cycle.period` cannot be", "250 µs to 100 ms"]),
    ("endless period", |c| c.cycle.period_ns = u64::MAX, &["`cycle.period` cannot be"]),
    ("odd period", |c| c.cycle.period_ns = 1_000_500, &["whole microseconds"]),
    ("late phase", |c| c.cycle.command_phase_ns = 2_000_000, &["`cycle.command_phase` cannot be 2 ms"]),
    ("endless phase", |c| c.cycle.command_phase_ns = u64::MAX, &["`cycle.command_phase`"]),
    ("no phase", |c| c.cycle.command_phase_ns = 0, &["`cycle.command_phase` cannot be 0 s"]),
    ("no warning", |c| c.missed_slots.warning = 0, &["`cycle.missed_slots.warning` cannot be 0"]),
    ("falling ladder", |c| c.missed_slots.stop = 1, &["`cycle.missed_slots.stop` cannot be 1", "50 to"]),
    ("endless ladder", |c| c.missed_slots.degraded = u32::MAX, &["`cycle.missed_slots.degraded`"]),
    ("no leak", |c| c.missed_slots.leak_slots = 0, &["`cycle.missed_slots.leak_slots` cannot be 0"]),
    (
        "stream delay",
        |c| c.stream_delay = StreamDelay::Fixed(2_000_000_000),
        &["`stream.delay` cannot be 2 s", "0 s to 1 s"],
    ),
    ("priority", |c| c.realtime.priority = Some(0), &["`realtime.priority` cannot be 0", "1 to 99"]),
    ("priority", |c| c.realtime.priority = Some(255), &["`realtime.priority` cannot be 255"]),
    ("CPU", |c| c.realtime.cpu = Some(usize::MAX), &["`realtime.cpu` cannot be 18446744073709551615"]),
    (
        "CPU that is not there",
        |c| c.realtime.cpu = Some(999),
        &["`realtime.cpu` cannot be 999", "this machine"],
    ),
    ("spin guard", |c| c.realtime.spin_guard_ns = Some(u64::MAX), &["`realtime.spin_guard`"]),
    ("master node ID 0", |c| c.master.node = 0, &["`master.node` cannot be 0", "1 to 127"]),
    ("master node ID 200", |c| c.master.node = 200, &["`master.node` cannot be 200"]),
    (
        "master as an axis",
        |c| c.master.node = c.axes[1].node,
        &[AXIS, "is already taken on the bus \"base\""],
    ),
    ("no heartbeat", |c| c.master.heartbeat_ns = Some(0), &["`master.heartbeat` cannot be 0 s"]),
    ("endless heartbeat", |c| c.master.heartbeat_ns = Some(u64::MAX), &["`master.heartbeat`"]),
    ("odd heartbeat", |c| c.master.heartbeat_ns = Some(10_500_000), &["whole milliseconds"]),
    ("no time-out", |c| c.master.heartbeat_timeout_ns = 0, &["`master.heartbeat_timeout` cannot be 0 s"]),
    ("short time-out", |c| c.master.heartbeat_timeout_ns = 50_000_000, &["longer than heartbeat, 100 ms"]),
    ("TIME", |c| c.master.time_ns = Some(1), &["`master.time` cannot be"]),
    ("no bus", |c| c.buses.clear(), &["`bus` is missing"]),
    ("many buses", |c| c.buses = vec![c.buses[0].clone(); 100_000], &["100000 buses are more than the 16"]),
    ("bus name", |c| bus(c).name = "a=b".into(), &["buses[1] \"a=b\"", "`bus.name` cannot be \"a=b\""]),
    ("bus name", |c| bus(c).name = "base".into(), &["there is already a bus called \"base\""]),
    (
        "interface",
        |c| bus(c).interface = Interface::SocketCan("a b".into()),
        &[BUS, "\"a b\" cannot be the name"],
    ),
    ("interface", |c| bus(c).interface = Interface::SocketCan("sim".into()), &[BUS, "`bus.interface`"]),
    (
        "adapter",
        |c| bus(c).interface = Interface::Slcan(CanLine { device: "ttyACM0".into(), baud_rate: 1_000_000 }),
        &[BUS, "\"ttyACM0\" cannot be the path of a serial line"],
    ),
    (
        "data bit rate of an adapter",
        |c| {
            bus(c).interface = "slcan:/dev/ttyACM0".parse().unwrap();
            bus(c).data_bit_rate = Some(2_500_000);
        },
        &[BUS, "`bus.data_bit_rate`", "SLCAN adapters"],
    ),
    (
        "one interface twice",
        |c| c.buses.iter_mut().for_each(|bus| bus.interface = Interface::SocketCan("can0".into())),
        &[BUS, "the interface \"can0\" already belongs to another bus"],
    ),
    ("no cycle", |c| bus(c).divider = 0, &[BUS, "`bus.period` cannot be 0 s"]),
    ("endless cycle", |c| bus(c).divider = u32::MAX, &[BUS, "`bus.period` cannot be"]),
    ("33 cycles", |c| bus(c).divider = 33, &[BUS, "`bus.period` cannot be 33 ms", "32 cycles at most"]),
    ("bit rate 0", |c| bus(c).bit_rate = 0, &[BUS, "`bus.bit_rate` cannot be 0 bit/s"]),
    ("bit rate", |c| bus(c).bit_rate = 999_999, &[BUS, "`bus.bit_rate` cannot be"]),
    ("bit rate of eRobs", |c| bus(c).bit_rate = 500_000, &["axes[3]", "the one bit rate of the eRobs"]),
    ("data bit rate", |c| bus(c).data_bit_rate = Some(0), &[BUS, "`bus.data_bit_rate` cannot be 0 bit/s"]),
    ("restart", |c| bus(c).restart_ms = u32::MAX, &[BUS, "`bus.restart_ms`"]),
    (
        "service frames",
        |c| bus(c).service_frames_per_cycle = usize::MAX,
        &[BUS, "`bus.service_frames_per_cycle`"],
    ),
    ("no axis", |c| c.axes.clear(), &["`axis` is missing"]),
    ("many axes", |c| c.axes = vec![c.axes[0].clone(); 100_000], &["100000 axes are more than the 32"]),
    ("axis name", |c| axis(c).name = "joint1".into(), &["there is already an axis called \"joint1\""]),
    ("unknown bus", |c| axis(c).bus = usize::MAX, &[AXIS, "there is no bus called"]),
    ("node ID 0", |c| axis(c).node = 0, &[AXIS, "`axis.node` cannot be 0"]),
    ("node ID 200", |c| axis(c).node = 200, &[AXIS, "`axis.node` cannot be 200", "1 to 127"]),
    ("duplicate node ID", |c| axis(c).node = c.axes[0].node, &[AXIS, "already taken"]),
    ("counts", |c| axis(c).counts_per_turn = f64::NAN, &[AXIS, "`axis.counts_per_turn` cannot be NaN"]),
    ("counts", |c| axis(c).counts_per_turn = 1.0, &[AXIS, "`axis.counts_per_turn` cannot be 1"]),
    ("gear", |c| axis(c).gear_ratio = -1.0, &[AXIS, "`axis.gear_ratio` cannot be -1"]),
    (
        "lead",
        |c| axis(c).travel = Travel::Linear { lead_m: f64::NAN },
        &[AXIS, "`axis.lead` cannot be NaN m"],
    ),
    ("empty range", |c| axis(c).limits.position_min = 9.0, &[AXIS, "the lowest position 9 rad"]),
    (
        "range",
        |c| axis(c).limits.position_max = f64::INFINITY,
        &[AXIS, "`axis.limits.position` cannot be inf"],
    ),
    (
        "far range",
        |c| axis(c).limits.position_max = 1e9,
        &[AXIS, "and the drive counts from -2147483648 to 2147483647"],
    ),
    (
        "velocity",
        |c| axis(c).limits.velocity = f64::NAN,
        &[AXIS, "`axis.limits.velocity` cannot be NaN rad/s"],
    ),
    ("acceleration", |c| axis(c).limits.acceleration = 1e308, &[AXIS, "`axis.limits.acceleration`"]),
    ("deceleration", |c| axis(c).limits.deceleration = 5e-324, &[AXIS, "`axis.limits.deceleration`"]),
    ("jerk", |c| axis(c).limits.jerk = -1.0, &[AXIS, "`axis.limits.jerk` cannot be -1"]),
    ("slow stop", |c| axis(c).limits.jerk = 0.02, &[AXIS, "`axis.limits.jerk`", "within 10 s"]),
    ("torque", |c| axis(c).limits.torque = 0.0, &[AXIS, "`axis.limits.torque` cannot be 0 Nm"]),
    (
        "following error",
        |c| axis(c).following_error.limit = f64::NAN,
        &[AXIS, "`axis.following_error.limit`"],
    ),
    ("its time", |c| axis(c).following_error.time_ns = u64::MAX, &[AXIS, "`axis.following_error.time`"]),
    (
        "start tolerance",
        |c| axis(c).start_tolerance = f64::NAN,
        &[AXIS, "`axis.start_tolerance` cannot be NaN"],
    ),
    ("target tolerance", |c| axis(c).target_tolerance = 0.0, &[AXIS, "`axis.target_tolerance` cannot be 0"]),
    ("missed feedback", |c| axis(c).missed_feedback_cycles = 0, &[AXIS, "`axis.missed_feedback_cycles`"]),
    ("transmission type", |c| axis(c).transmission_type = 0, &[AXIS, "`axis.transmission_type` cannot be 0"]),
    ("transmission type", |c| axis(c).transmission_type = 250, &[AXIS, "254 or 255 (event)"]),
    ("feedback", |c| axis(c).feedback = vec![Feedback::Torque; 2], &[AXIS, "is in `axis.feedback` twice"]),
    ("feedback delay", |c| axis(c).feedback_delay_ns = u64::MAX, &[AXIS, "`axis.feedback_delay`"]),
    ("own heartbeat", |c| axis(c).heartbeat_ns = Some(0), &[AXIS, "`axis.heartbeat` cannot be 0 s"]),
    ("interpolation", |c| axis(c).drive = family::YZ_AIM, &[AXIS, "`axis.mode` cannot be"]),
    (
        "other modes of a YZ-AIM",
        |c| {
            let yz_aim = Axis::new("joint2", c.axes[1].bus, c.axes[1].node, family::YZ_AIM, c.axes[1].limits);
            c.axes[1] = yz_aim.with_other_modes(vec![Control::ProfilePosition]);
        },
        &[AXIS, "`axis.modes` cannot be given for a YZ-AIM", "no object 6061"],
    ),
    (
        "another profile mode",
        |c| axis(c).other_modes = vec![Control::ProfileVelocity],
        &[AXIS, "`axis.modes` cannot be ProfileVelocity"],
    ),
    (
        "other modes of a profile mode",
        |c| {
            axis(c).control = Control::ProfilePosition;
            axis(c).other_modes = vec![Control::Position];
        },
        &[AXIS, "`axis.modes` cannot be given for an axis in another mode than"],
    ),
    (
        "the first mode again",
        |c| axis(c).other_modes = vec![Control::Position],
        &[AXIS, "\"csp\" is in `axis.modes` twice"],
    ),
    (
        "one other mode twice",
        |c| axis(c).other_modes = vec![Control::Velocity { position_gain: 20.0 }; 2],
        &[AXIS, "\"csv\" is in `axis.modes` twice"],
    ),
    (
        "gain of another mode",
        |c| axis(c).other_modes = vec![Control::Velocity { position_gain: 900.0 }],
        &[AXIS, "`axis.velocity_loop.position_gain` cannot be 900 1/s"],
    ),
    (
        "gain",
        |c| axis(c).control = Control::Velocity { position_gain: f64::NAN },
        &[AXIS, "`axis.velocity_loop.position_gain` cannot be NaN"],
    ),
    (
        "unstable gain",
        |c| axis(c).control = Control::Velocity { position_gain: 900.0 },
        &[AXIS, "`axis.velocity_loop.position_gain` cannot be 900 1/s", "at a period of 1 ms", "unstable"],
    ),
    (
        "stiffness",
        |c| axis(c).control = torque_loop(f64::INFINITY, 80.0),
        &[AXIS, "`axis.torque_loop.stiffness` cannot be inf"],
    ),
    (
        "no damping",
        |c| axis(c).control = torque_loop(1600.0, 0.0),
        &[AXIS, "`axis.torque_loop.damping` cannot be 0 Nm s/rad", "more, for a stiffness of 1600"],
    ),
    (
        "inertia",
        |c| axis(c).joint.inertia = Some(f64::NAN),
        &[AXIS, "`axis.joint.inertia` cannot be NaN kg m^2"],
    ),
    ("friction", |c| axis(c).joint.viscous_friction = Some(-1.0), &[AXIS, "`axis.joint.viscous_friction`"]),
    (
        "friction",
        |c| axis(c).joint.coulomb_friction = Some(f64::NAN),
        &[AXIS, "`axis.joint.coulomb_friction`"],
    ),
    ("gravity", |c| axis(c).simulated.gravity = -1.0, &[AXIS, "`axis.simulated.gravity`"]),
    ("rated torque", |c| axis(c).joint.rated_torque = Some(0.0), &[AXIS, "`axis.joint.rated_torque`"]),
    ("peak torque", |c| axis(c).simulated.peak_torque = f64::NAN, &[AXIS, "`axis.simulated.peak_torque`"]),
    ("beginning", |c| axis(c).simulated.initial_position = 9.0, &[AXIS, "cannot begin at 9 rad"]),
    (
        "beginning",
        |c| axis(c).simulated.initial_position = f64::NAN,
        &[AXIS, "`axis.simulated.initial_position`"],
    ),
    ("power-up", |c| axis(c).power_up_ns = u64::MAX, &[AXIS, "`axis.power_up`"]),
    ("no repeat", |c| c.program.repeat = 0, &["`program.repeat` cannot be 0"]),
    (
        "targets",
        |c| first_move(c).target = ProgramTarget::Position(vec![0.0]),
        &["program.moves[0]", "the move has 1 targets, but there are 6 axes"],
    ),
    (
        "target",
        |c| first_move(c).target = ProgramTarget::Position(vec![f64::NAN; 6]),
        &["program.moves[0]", "`program.move.to` cannot be NaN rad"],
    ),
    (
        "far target",
        |c| first_move(c).target = ProgramTarget::Position(vec![1e9; 6]),
        &["program.moves[0]", "\"joint2\" may not go to 1e9 rad"],
    ),
    (
        "speed",
        |c| first_move(c).target = ProgramTarget::Velocity { velocity: vec![1.0; 6], duration_s: f64::NAN },
        &["`program.move.for` cannot be NaN s", "is not in mode = \"pv\""],
    ),
    (
        "torque",
        |c| first_move(c).target = ProgramTarget::Torque { torque: vec![0.0; 6], duration_s: 1.0 },
        &["`program.move.torque` cannot be 0 for every axis"],
    ),
    ("scale", |c| first_move(c).velocity_scale = f64::NAN, &["`program.move.velocity` cannot be NaN %"]),
    ("scale", |c| first_move(c).acceleration_scale = 2.0, &["`program.move.acceleration` cannot be 200 %"]),
    ("duration", |c| first_move(c).minimum_duration_s = f64::INFINITY, &["`program.move.minimum_duration`"]),
    ("dwell", |c| first_move(c).dwell_s = -1.0, &["`program.move.dwell` cannot be -1 s"]),
    ("directory", |c| c.telemetry.directory = "".into(), &["`telemetry.directory` cannot be an empty text"]),
    ("black box", |c| c.telemetry.black_box_ns = Some(u64::MAX), &["`telemetry.black_box` cannot be"]),
    (
        "ring",
        |c| c.telemetry.ring_records = 1_000_000_000_000,
        &["`telemetry.ring_records` cannot be 1000000000000"],
    ),
    ("gap", |c| c.simulation.longest_gap_ns = 0, &["`simulation.longest_gap` cannot be 0 s"]),
];

fn torque_loop(stiffness: f64, damping: f64) -> Control {
    Control::Torque { stiffness, damping, inertia: 1.0, viscous_friction: 0.0, coulomb_friction: 0.0 }
}

#[test]
fn nonsense_in_any_field_is_an_error_that_names_what_and_where_for_whoever_starts() {
    for (what, spoil, words) in CASES {
        let mut config = sound();
        config.telemetry.is_recorded = false;
        spoil(&mut config);
        let is_of_this_machine = words.contains(&"this machine");
        let mut told = vec![];
        if !is_of_this_machine {
            told.push(config.validate().expect_err(what).to_string());
            told.push(assemble::engine(&config).map(|_| ()).expect_err(what).to_string());
            told.push(VirtualRun::simulated(&config).map(|_| ()).expect_err(what).to_string());
        }
        told.push(
            Controller::start(config, SessionOptions::default()).map(|_| ()).expect_err(what).to_string(),
        );
        for told in told {
            for word in *words {
                assert!(told.contains(word), "{what}: {word:?} is not in {told:?}");
            }
        }
    }
}

#[test]
fn a_file_and_a_field_with_the_same_value_are_refused_in_the_same_words() {
    let text = include_str!("../../configs/single-erob.toml");
    let original = Config::parse("single-erob.toml", text).unwrap();
    let cases: &[FileAndField] = &[
        ("[cycle]\nperiod = \"1 us\"\n", |c| c.cycle.period_ns = 1000),
        ("[realtime]\npriority = 100\n", |c| c.realtime.priority = Some(100)),
        ("[master]\nnode = 128\n", |c| c.master.node = 128),
        ("[master]\nheartbeat = \"10.5 ms\"\n", |c| c.master.heartbeat_ns = Some(10_500_000)),
        ("[master]\nheartbeat_timeout = \"50 ms\"\n", |c| c.master.heartbeat_timeout_ns = 50_000_000),
        ("[telemetry]\nring_records = 1\n", |c| c.telemetry.ring_records = 1),
        ("[simulation]\nlongest_gap = \"61 s\"\n", |c| c.simulation.longest_gap_ns = 61_000_000_000),
        ("[defaults.axis.joint]\ninertia = 1e30\n", |c| c.axes[0].joint.inertia = Some(1e30)),
        ("[defaults.axis.following_error]\nlimit = 0\n", |c| c.axes[0].following_error.limit = 0.0),
        ("[defaults.axis]\ntransmission_type = 250\n", |c| c.axes[0].transmission_type = 250),
    ];
    for (section, spoil) in cases {
        let header = section.lines().next().unwrap();
        let line = section.lines().nth(1).unwrap();
        let key = line.split(" =").next().unwrap();
        // In place of the line of that key, if the file has the section, else beside it.
        let text = match text.split_once(&format!("{header}\n")) {
            None => format!("{text}\n{section}"),
            Some((before, after)) => {
                let after: Vec<_> =
                    after.lines().filter(|other| !other.starts_with(&format!("{key} ="))).collect();
                format!("{before}{header}\n{line}\n{}", after.join("\n"))
            }
        };
        let by_file = Config::parse("spoilt.toml", &text).expect_err(section);
        let mut config = original.clone();
        spoil(&mut config);
        let by_field = config.validate().expect_err(section);
        let kinds = |error: &takt::config::ConfigError| -> Vec<_> {
            error.problems().iter().map(|problem| problem.kind.clone()).collect()
        };
        assert_eq!(kinds(&by_file), kinds(&by_field), "{section}");
    }
}

#[test]
fn every_configuration_that_comes_with_takt_is_valid() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let files = |folder: &std::path::Path| -> Vec<_> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let all = [files(&folder), files(&folder.join("erob-modes"))].concat();
    for path in all.iter().filter(|path| path.extension().is_some_and(|extension| extension == "toml")) {
        Config::load(path).unwrap().validate().unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

#[test]
fn no_axis_whatever_its_mode_is_sent_where_it_cannot_be() {
    let text = include_str!("../../configs/erob-modes/erob-pv.toml");
    let mut config = Config::parse("erob-pv.toml", text).unwrap();
    config.program = Program { repeat: 1, moves: vec![] };
    let controller = VirtualController::start(&config, None).unwrap();
    for target in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e9, -1e9] {
        assert!(controller.move_to(&[target]).is_err(), "{target}");
    }
    let there = controller.move_to(&[0.0]).unwrap();
    controller.wait(there, Duration::from_secs(10)).unwrap();
    assert_eq!(controller.finish(), Outcome::Finished);
}

fn limits() -> Limits {
    Limits {
        position_min: 0.1,
        position_max: 0.9,
        velocity: 0.5,
        acceleration: 2.0,
        deceleration: 2.0,
        jerk: f64::INFINITY,
        torque: 20.0,
    }
}

/// A file with only what is required, and the same made in code.
fn made_and_read(drive: DriveFamily, axis: &str, period: &str, change: fn(Axis) -> Axis, period_ns: u64) {
    let text = format!(
        "name = \"m\"\n[cycle]\nperiod = \"{period}\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"j\"\nbus = \"can\"\n\
         node = 3\ndrive = \"{}\"\n{axis}\n\
         limits = {{ position = [0.1, 0.9], velocity = 0.5, acceleration = 2.0, torque = 20 }}\n",
        drive.word
    );
    let read = Config::parse("m.toml", &text).unwrap();
    let axis = change(Axis::new("j", 0, 3, drive, limits()));
    let made =
        Config::new("m", vec![Bus::new("can", Interface::Simulated)], vec![axis]).with_period(period_ns);
    assert_eq!(made, read);
    made.validate().unwrap();
}

#[test]
fn a_configuration_made_in_code_has_the_defaults_of_a_file() {
    use family::{EROB_CANOPEN, YZ_AIM};
    made_and_read(EROB_CANOPEN, "", "1 ms", |axis| axis, 1_000_000);
    made_and_read(EROB_CANOPEN, "", "4 ms", |axis| axis, 4_000_000);
    made_and_read(YZ_AIM, "", "2 ms", |axis| axis, 2_000_000);
    let linear = |axis: Axis| Axis { gear_ratio: 2.0, ..axis.linear(0.01) };
    made_and_read(
        EROB_CANOPEN,
        "travel = \"linear\"\nlead = \"10 mm\"\ngear_ratio = 2",
        "1 ms",
        linear,
        1_000_000,
    );
    let csv = |axis: Axis| axis.with_control(Control::Velocity { position_gain: 20.0 });
    made_and_read(EROB_CANOPEN, "mode = \"csv\"", "1 ms", csv, 1_000_000);
    let cst = |axis: Axis| {
        axis.with_control(Control::Torque {
            stiffness: 1600.0,
            damping: 80.0,
            inertia: 1.0,
            viscous_friction: 1.0,
            coulomb_friction: 0.5,
        })
    };
    made_and_read(EROB_CANOPEN, "mode = \"cst\"", "1 ms", cst, 1_000_000);
    let changing = |axis: Axis| {
        let torque = Control::Torque {
            stiffness: 1600.0,
            damping: 80.0,
            inertia: 1.0,
            viscous_friction: 1.0,
            coulomb_friction: 0.5,
        };
        axis.with_other_modes(vec![Control::Velocity { position_gain: 20.0 }, torque])
    };
    let modes = "modes = [\"csp\", \"csv\", \"cst\"]";
    made_and_read(EROB_CANOPEN, modes, "1 ms", changing, 1_000_000);
}

#[test]
fn a_configuration_made_in_code_moves_an_arm() {
    let joint = |name: &str, node| Axis::new(name, 0, node, family::EROB_CANOPEN, limits());
    let config = Config::new(
        "arm",
        vec![Bus::new("can", Interface::Simulated)],
        vec![joint("shoulder", 1), Axis { reversed: true, ..joint("elbow", 2) }],
    );
    let arm = VirtualController::start(&config, None).unwrap();
    let motion = arm.move_to(&[0.3, 0.2]).unwrap();
    assert_eq!(arm.wait(motion, Duration::from_secs(30)), Ok(()));
}
