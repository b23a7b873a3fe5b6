//! The configurations that come with takt, and how values of a configuration are read.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use takt::config::{
    Config, Control, Feedback, Interface, OverrideError, PowerUpState, ProblemKind, ProgramTarget, Travel,
    reference, schema,
};
use takt::{Outcome, VirtualRun};

/// The configurations that come with takt; other folders in there hold other things.
fn configs() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let in_folder = |folder: PathBuf| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = in_folder(folder.clone()).chain(in_folder(folder.join("erob-modes"))).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    paths
}

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)
}

fn load(path: &Path) -> Config {
    Config::load(path).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

fn parse(text: &str) -> Config {
    Config::parse("test.toml", text).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

#[test]
fn every_configuration_that_comes_with_takt_loads() {
    let paths = configs();
    assert!(paths.len() >= 6, "{paths:?}");
    for path in paths {
        assert_eq!(load(&path).name, path.file_stem().unwrap().to_str().unwrap());
    }
}

/// Half a minute of the shortest cycle.
const SLOTS_AT_MOST: u64 = 60_000;

#[test]
fn every_configuration_that_comes_with_takt_runs_its_program_to_the_end() {
    for path in configs() {
        let config = load(&path);
        if config.program.moves.is_empty() {
            continue;
        }
        let mut run = VirtualRun::simulated(&config).unwrap().0;
        let outcome = run.run(SLOTS_AT_MOST, |_| {});
        assert_eq!(outcome, Some(Outcome::Finished), "{}", path.display());
    }
}

#[test]
fn feedback_may_be_missing_for_the_whole_cycles_in_a_time() {
    let text = fs::read_to_string(config("first.toml")).unwrap();
    let missed = |period: &str, time: &str| {
        let axis = format!("[[axis]]\nmissed_feedback_time = \"{time}\"\n");
        let cycle = format!("[cycle]\nperiod = \"{period}\"\n\n[[bus]]");
        let text = text.replacen("[[bus]]", &cycle, 1).replacen("[[axis]]\n", &axis, 1);
        parse(&text).axes[0].missed_feedback_cycles
    };
    assert_eq!(missed("1 ms", "50 ms"), 50);
    assert_eq!(missed("2 ms", "50 ms"), 25);
    assert_eq!(missed("4 ms", "50 ms"), 12);
    assert_eq!((missed("3 ms", "3 ms"), missed("1 ms", "1 s")), (1, 1_000));
}

#[test]
fn the_three_arms_differ_in_the_line_of_the_mode_alone() {
    let lines = |name: &str| -> Vec<String> {
        let text = fs::read_to_string(config(name)).unwrap();
        let counts = |line: &&str| !line.starts_with('#') && !line.starts_with("name = \"arm6");
        text.lines().filter(counts).map(str::to_owned).collect()
    };
    let csp = lines("arm6-erob.toml");
    for (name, mode) in [("arm6-erob-csv.toml", "mode = \"csv\""), ("arm6-erob-cst.toml", "mode = \"cst\"")] {
        let other = lines(name);
        let differences: Vec<_> = csp.iter().zip(&other).filter(|(a, b)| a != b).collect();
        assert_eq!(csp.len(), other.len());
        assert_eq!(differences, [(&"mode = \"csp\"".to_owned(), &mode.to_owned())]);
    }
}

#[test]
#[expect(clippy::approx_constant, reason = "a limit that happens to be close to half a turn")]
fn the_arm_is_the_one_of_the_field_notes() {
    let arm = load(&config("arm6-erob.toml"));
    let reversed: Vec<_> = arm.axes.iter().map(|axis| axis.reversed).collect();
    assert_eq!(reversed, [true, true, true, false, true, false]);
    let limits: Vec<_> = arm.axes.iter().map(|a| (a.limits.position_min, a.limits.position_max)).collect();
    assert_eq!(
        limits,
        [
            (-2.9671, 2.9671),
            (-1.8326, 1.8326),
            (-1.9671, 1.9671),
            (-3.1416, 0.0873),
            (-2.9671, 2.9671),
            (-0.0873, 3.8223)
        ]
    );
    assert_eq!(arm.axes.iter().map(|axis| axis.bus).collect::<Vec<_>>(), [0, 0, 0, 1, 1, 1]);
    assert!(arm.program.moves.len() >= 4);
    assert!(arm.axes.iter().all(|axis| axis.control == Control::Position));
}

#[test]
fn the_joints_of_the_arm_have_the_torque_for_their_acceleration_and_speed() {
    for axis in load(&config("arm6-erob.toml")).axes {
        let (joint, limits) = (axis.joint, axis.limits);
        let needed = joint.inertia() * limits.acceleration
            + joint.viscous_friction() * limits.velocity
            + joint.coulomb_friction();
        assert!(needed <= axis.rated_torque(), "{} needs {needed} N·m", axis.name);
        assert!(axis.simulated.peak_torque >= limits.torque, "{}", axis.name);
    }
}

/// The reference states every default in a line that ends in `# default`: without any of these lines, and without all
/// of them, the configuration is the same.
#[test]
fn every_default_of_the_reference_is_the_one_that_is_built_in() {
    let text = fs::read_to_string(config("reference.toml")).unwrap();
    let full = parse(&text);
    let is_default = |line: &str| {
        line.split_once('#').is_some_and(|(_, comment)| comment.trim_start().starts_with("default"))
    };
    let lines: Vec<&str> = text.lines().collect();
    let stated: Vec<usize> = (0..lines.len()).filter(|&index| is_default(lines[index])).collect();
    assert!(stated.len() > 50, "only {} defaults are stated", stated.len());
    for &left_out in &stated {
        let rest: Vec<_> =
            lines.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, l)| *l).collect();
        assert_eq!(parse(&rest.join("\n")), full, "without {:?}", lines[left_out]);
    }
    let rest: Vec<_> = lines.iter().filter(|line| !is_default(line)).copied().collect();
    assert_eq!(parse(&rest.join("\n")), full);
}

/// `TAKT_WRITE=1` writes the files instead.
#[test]
fn the_reference_and_the_schema_are_those_of_the_rows() {
    for (file, text) in [("reference.toml", reference()), ("takt.schema.json", schema())] {
        if env::var_os("TAKT_WRITE").is_some() {
            fs::write(config(file), &text).unwrap();
        }
        assert_eq!(fs::read_to_string(config(file)).unwrap(), text, "{file}");
    }
}

#[test]
fn the_schema_describes_every_key_of_every_configuration_that_comes_with_takt() {
    let root: serde_json::Value = serde_json::from_str(&schema()).unwrap();
    let resolve = |schema: &serde_json::Value| match schema["$ref"].as_str() {
        Some(place) => root.pointer(place.trim_start_matches('#')).unwrap().clone(),
        None => schema.clone(),
    };
    let mut keys = 0;
    for file in configs() {
        let document: toml::Value = toml::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
        let mut open = vec![(document, root.clone())];
        while let Some((value, schema)) = open.pop() {
            match value {
                toml::Value::Table(table) if schema["type"] == "object" => {
                    for (key, value) in table {
                        let described = schema["properties"].get(&key);
                        let described = described.unwrap_or_else(|| panic!("{}: {key}", file.display()));
                        open.push((value, resolve(described)));
                        keys += 1;
                    }
                }
                toml::Value::Array(list) if schema["items"]["type"] == "object" => {
                    open.extend(list.into_iter().map(|value| (value, schema["items"].clone())));
                }
                _ => {}
            }
        }
    }
    assert!(keys > 500, "{keys}");
}

#[test]
fn the_words_of_the_schema_are_those_that_a_key_may_have() {
    let root: serde_json::Value = serde_json::from_str(&schema()).unwrap();
    let reference = fs::read_to_string(config("reference.toml")).unwrap();
    let mut compared = 0;
    for table in
        ["/properties/bus/items", "/properties/axis/items", "/properties/axis/items/properties/simulated"]
    {
        for (key, schema) in root.pointer(table).unwrap()["properties"].as_object().unwrap() {
            let (words, is_list) = match schema.get("enum") {
                Some(words) => (words, false),
                None => (&schema["items"]["enum"], true),
            };
            let Some(words) = words.as_array() else { continue };
            let line = |line: &&str| line.trim_start_matches("# ").starts_with(&format!("{key} = "));
            // Two tables have a key `power_up`: that with words is the last one.
            let line = reference.lines().rfind(line).unwrap();
            let nonsense = if is_list { "[\"qqq\"]" } else { "\"qqq\"" };
            let (before, after) = reference.rsplit_once(line).unwrap();
            let text = format!("{before}{key} = {nonsense}{after}");
            let error = Config::parse("reference.toml", &text).unwrap_err();
            let choices = error.problems().iter().find_map(|problem| match &problem.kind {
                ProblemKind::UnknownChoice { given, choices, .. } if given == "qqq" => Some(choices.clone()),
                _ => None,
            });
            let choices = choices.unwrap_or_else(|| panic!("{key}: {:?}", error.problems()));
            assert_eq!(*words, choices, "{key}");
            compared += 1;
        }
    }
    assert!(compared >= 8, "{compared}");
}

#[test]
fn the_reference_shows_every_key_there_is() {
    let text = fs::read_to_string(config("reference.toml")).unwrap();
    let places =
        text.lines().filter(|line| line.starts_with('[') || line.starts_with("name = \"reference\""));
    for place in places {
        let (before, after) = text.split_at(text.find(&format!("\n{place}")).unwrap() + 1 + place.len());
        let error = Config::parse("reference.toml", &format!("{before}\nqqq = 1{after}")).unwrap_err();
        let known = error.problems().iter().find_map(|problem| match &problem.kind {
            ProblemKind::UnknownKey { key, known, .. } if key.ends_with("qqq") => Some(known.clone()),
            _ => None,
        });
        for key in known.unwrap_or_else(|| panic!("{place} takes any key: {:?}", error.problems())) {
            let is_shown = text.lines().any(|line| {
                let line = line.trim_start_matches("# ");
                let header = line.split_once(']').map_or("", |(header, _)| header.trim_start_matches('['));
                line.starts_with(&format!("{key} =")) || header.split('.').any(|part| part == key)
            });
            assert!(is_shown, "{place}: {key} is not in the reference");
        }
    }
}

const SMALL: &str = r#"
name = "small"
[[bus]]
name = "b"
[[axis]]
name = "a"
bus = "b"
node = 1
drive = "erob-canopen"
limits = { position = ["-90 deg", "0.25 turn"], velocity = 2, acceleration = "10 rad/s^2", torque = "20 Nm" }
"#;

/// The same with these lines in its axis.
fn with_axis(lines: &str) -> Config {
    parse(&SMALL.replace("node = 1\n", &format!("node = 1\n{lines}\n")))
}

fn with(additions: &str) -> Config {
    parse(&format!("{SMALL}\n{additions}"))
}

#[test]
fn a_number_is_si_and_a_text_has_its_unit() {
    let limits = with("").axes[0].limits;
    assert_eq!(limits.position_min, -std::f64::consts::FRAC_PI_2);
    assert_eq!(limits.position_max, std::f64::consts::FRAC_PI_2);
    assert_eq!((limits.velocity, limits.acceleration, limits.deceleration), (2.0, 10.0, 10.0));
    assert!(limits.jerk.is_infinite());
}

#[test]
fn the_zero_of_a_joint_is_a_count_or_the_position_where_the_drive_counts_zero() {
    let zero = |lines: &str| with_axis(lines).axes[0].zero_counts;
    assert_eq!(zero("zero_counts = -131072"), -131_072);
    // The drive counts zero at 90 degrees, so it has counted a quarter of a turn back where the joint is at zero.
    assert_eq!(zero("position_at_zero_counts = \"90 deg\""), -131_072);
    assert_eq!(zero("position_at_zero_counts = \"90 deg\"\nreversed = true"), 131_072);
}

#[test]
fn the_command_phase_is_a_fraction_or_a_time() {
    for phase in ["0.6", "\"60 %\"", "\"1.2 ms\"", "\"1200 us\""] {
        let cycle = with(&format!("[cycle]\nperiod = \"2 ms\"\ncommand_phase = {phase}")).cycle;
        assert_eq!((cycle.period_ns, cycle.command_phase_ns), (2_000_000, 1_200_000), "{phase}");
    }
    assert_eq!(with("[cycle]\nperiod = \"2 ms\"").cycle.command_phase_ns, 1_100_000);
}

#[test]
fn an_automatic_command_phase_is_resolved_when_the_file_is_read() {
    let auto = with("[cycle]\ncommand_phase = \"auto\"");
    // SYNC, 20 µs, feedback: 200 µs; set-points and heartbeat: 180 µs; no more than 100 µs for a SYNC that is late.
    assert_eq!(auto.cycle.command_phase_ns, 300_000);
    let arm = fs::read_to_string(config("arm6-erob.toml")).unwrap();
    let arm = parse(&arm.replace("command_phase = 0.5", "command_phase = \"auto\""));
    // From 450 to 590 µs: 60 µs for either wake-up, 20 µs for computing.
    assert_eq!(arm.cycle.command_phase_ns, 510_000);
    for bus in takt::schedule::verify(&arm).unwrap() {
        assert!(!bus.is_narrow());
        assert_eq!((bus.slot.sync_reserve_ns, bus.slot.set_points_reserve_ns), (60_000, 80_000));
    }
}

#[test]
fn an_automatic_command_phase_suits_the_fullest_bus_in_every_cycle() {
    let text = fs::read_to_string(config("axes32-erob.toml")).unwrap();
    for (period, expected_ns) in [("1 ms", 510_000), ("2 ms", 650_000), ("4 ms", 850_000)] {
        let cycle = format!("[cycle]\nperiod = {period:?}\ncommand_phase = \"auto\"\n[telemetry]");
        let config = parse(&text.replace("[telemetry]", &cycle));
        assert_eq!(config.cycle.command_phase_ns, expected_ns, "{period}");
        assert!(takt::schedule::verify(&config).is_ok());
    }
}

#[test]
fn an_axis_overrides_the_defaults_key_by_key() {
    let defaults =
        "[defaults.axis]\nmode = \"csv\"\ntransmission_type = 255\nlimits = { jerk = 500, torque = 1 }\n";
    let axis = &parse(&SMALL.replace("[[bus]]", &format!("{defaults}[[bus]]"))).axes[0];
    assert_eq!((axis.limits.jerk, axis.limits.torque, axis.transmission_type), (500.0, 20.0, 255));
    assert_eq!(axis.control, Control::Velocity { position_gain: 20.0 });
}

#[test]
fn the_gains_of_the_torque_loop_follow_from_inertia_and_bandwidth() {
    let torque_loop = "[axis.torque_loop]\nbandwidth = 10\ninertia = 2\nviscous_friction = 3\n";
    let joint = "[axis.joint]\ninertia = 7\ncoulomb_friction = \"300 mNm\"\n";
    assert_eq!(with(&format!("{torque_loop}{joint}")).axes[0].control, Control::Position);
    assert_eq!(
        with(&format!("mode = \"cst\"\n{torque_loop}{joint}")).axes[0].control,
        Control::Torque {
            stiffness: 200.0,
            damping: 40.0,
            inertia: 2.0,
            viscous_friction: 3.0,
            coulomb_friction: 0.3
        }
    );
}

#[test]
fn a_linear_axis_is_read_in_metres_and_newtons() {
    let config = parse(
        r#"
name = "slide"
[[bus]]
name = "b"
[[axis]]
name = "x"
bus = "b"
node = 1
drive = "erob-canopen"
travel = "linear"
lead = "5 mm"
feedback = ["torque", "error_code"]
limits = { position = [0, "500 mm"], velocity = "100 mm/s", acceleration = "1 m/s^2", torque = "400 N" }
[program]
move = [{ to = "250 mm" }, { to = [0.1] }]
"#,
    );
    let axis = &config.axes[0];
    assert_eq!(axis.travel, Travel::Linear { lead_m: 0.005 });
    assert_eq!(
        (axis.limits.position_max, axis.limits.torque, axis.following_error.limit),
        (0.5, 400.0, 0.01)
    );
    assert_eq!(axis.feedback, [Feedback::Torque, Feedback::ErrorCode]);
    assert_eq!(config.program.moves[0].target, ProgramTarget::Position(vec![0.25]));
    assert_eq!(config.program.moves[1].target, ProgramTarget::Position(vec![0.1]));
}

#[test]
fn words_stand_for_what_has_no_number() {
    let config = with(
        "[realtime]\npriority = \"off\"\nspin_guard = 0\ncpu = 3\n[master]\nheartbeat = \"off\"\n\
         [axis.identity]\nvendor = \"any\"",
    );
    let realtime = config.realtime;
    assert_eq!((realtime.priority, realtime.spin_guard_ns, realtime.cpu), (None, Some(0), Some(3)));
    assert_eq!((config.master.heartbeat_ns, config.axes[0].identity.vendor), (None, None));
    assert_eq!(config.axes[0].identity.product, Some(0x2648_3052));
}

#[test]
fn a_bus_can_be_connected_elsewhere_than_the_file_says() {
    let mut config = load(&config("arm6-erob.toml"));
    config.override_interface("base", "vcan0").unwrap();
    assert_eq!(config.buses[0].interface, Interface::SocketCan("vcan0".to_owned()));
    assert_eq!(config.buses[1].interface, Interface::Simulated);
    let taken = config.override_interface("wrist", "vcan0");
    assert!(matches!(taken, Err(OverrideError::InterfaceTaken { bus, .. }) if bus == "base"));
    let unknown = config.override_interface("elbow", "vcan1");
    assert!(matches!(unknown, Err(OverrideError::UnknownBus { .. })));
    config.override_interface("wrist", "slcan:/dev/ttyACM0").unwrap();
    assert!(matches!(&config.buses[1].interface, Interface::Slcan(line) if line.device == "/dev/ttyACM0"));
    let no_path = config.override_interface("wrist", "slcan:ttyACM0");
    assert!(matches!(no_path, Err(OverrideError::Interface { .. })));
    config.override_interface("base", "sim").unwrap();
    assert_eq!(config.buses[0].interface, Interface::Simulated);
}

/// A drive that goes on moving by itself is to notice soon that the controller is gone.
#[test]
fn the_default_heartbeat_is_faster_where_a_drive_would_go_on_moving() {
    let times = |mode: &str, more: &str| {
        let text = format!("[defaults.axis]\nmode = \"{mode}\"\n{more}");
        let master = with(&text).master;
        (master.heartbeat_ns.map(|ns| ns / 1_000_000), master.heartbeat_timeout_ns / 1_000_000)
    };
    for mode in ["csp", "ip"] {
        assert_eq!(times(mode, ""), (Some(100), 500), "{mode}");
    }
    for mode in ["csv", "cst", "pp", "pv", "pt"] {
        assert_eq!(times(mode, ""), (Some(20), 100), "{mode}");
        assert_eq!(times(mode, "[cycle]\nperiod = \"50 ms\""), (Some(50), 250), "{mode}");
        assert_eq!(times(mode, "[master]\nheartbeat = \"40 ms\""), (Some(40), 200), "{mode}");
        assert_eq!(times(mode, "[master]\nheartbeat_timeout = \"60 ms\""), (Some(20), 60), "{mode}");
        assert_eq!(times(mode, "[master]\nheartbeat = \"off\""), (None, 500), "{mode}");
    }
    assert_eq!(times("csp", "[master]\nheartbeat = \"60 s\""), (Some(60_000), 65_535));
}

#[test]
fn what_a_stream_may_ask_of_the_torque_loop_is_that_of_the_loop_unless_it_is_given() {
    let axis = |keys: &str| with(&format!("mode = \"cst\"\n[axis.torque_loop]\n{keys}")).axes[0].clone();
    let by_default = axis("bandwidth = 10\n").compliance;
    assert_eq!((by_default.stiffness_max, by_default.damping_max), (100.0, 20.0));
    assert_eq!(by_default.torque_rise_ns, 100_000_000);
    let given = axis("stiffness_max = \"2 kNm/rad\"\ndamping_max = 90\ntorque_rise = \"20 ms\"\n").compliance;
    assert_eq!((given.stiffness_max, given.damping_max, given.torque_rise_ns), (2000.0, 90.0, 20_000_000));
}

#[test]
fn a_stream_may_not_be_allowed_to_make_a_loop_swing() {
    let text = format!("{SMALL}\nmode = \"cst\"\n[axis.torque_loop]\nstiffness_max = 1000000\n");
    let error = format!("{:?}", Config::parse("small.toml", &text).unwrap_err().problems());
    assert!(error.contains("axis.torque_loop.stiffness_max"), "{error}");
}

#[test]
fn what_is_fed_forward_goes_into_the_process_data() {
    use takt::family::bring_up::ProcessData;
    let lengths = |mode: &str, feed_forward: &str| -> Vec<usize> {
        let keys = format!("mode = {mode:?}\nfeed_forward = {feed_forward:?}");
        let config = with(&keys);
        ProcessData::of(&config.axes[0], &config).commands.iter().map(|pdo| pdo.length()).collect()
    };
    assert_eq!(lengths("csp", "none"), [6]);
    assert_eq!(lengths("csp", "torque"), [8]);
    assert_eq!(lengths("csp", "velocity"), [6, 4]);
    assert_eq!(lengths("csp", "velocity-and-torque"), [8, 4]);
    assert_eq!(lengths("csv", "velocity-and-torque"), [8]);
    assert_eq!(lengths("cst", "velocity-and-torque"), [4]);
    assert_eq!(lengths("pp", "velocity-and-torque"), [6]);
}

#[test]
fn a_drive_whose_process_data_are_fixed_takes_nothing_beside_its_target() {
    let text = SMALL.replace("erob-canopen", "yz-aim") + "\nfeed_forward = \"torque\"\n";
    let error = format!("{:?}", Config::parse("small.toml", &text).unwrap_err().problems());
    assert!(error.contains("axis.feed_forward"), "{error}");
}

#[test]
fn an_axis_in_cst_on_a_real_bus_must_give_the_mechanics_of_its_joint() {
    let joint = "[axis.joint]\ninertia = 7\nviscous_friction = 0\ncoulomb_friction = \"300 mNm\"\n";
    let mut given = with(&format!("mode = \"cst\"\n{joint}"));
    let mut lacking = with(&format!("mode = \"cst\"\n{}", joint.replace("inertia = 7\n", "")));
    for config in [&mut given, &mut lacking] {
        assert!(config.validate().is_ok());
        config.buses[0].interface = Interface::SocketCan("can0".to_owned());
    }
    assert!(given.validate().is_ok(), "{:?}", given.validate());
    let error = lacking.validate().unwrap_err().to_string();
    assert!(error.contains("joint.inertia` is missing"), "{error}");
    lacking.axes[0].control = Control::Position;
    assert!(lacking.validate().is_ok());
}

#[test]
fn a_simulated_yz_aim_may_power_up_operational() {
    let text = fs::read_to_string(config("gantry-yz-aim.toml")).unwrap();
    let operational = "[defaults.axis.simulated]\npower_up = \"operational\"\n\n[defaults.axis.joint]";
    let gantry = parse(&text.replace("[defaults.axis.joint]", operational));
    for axis in &gantry.axes {
        assert_eq!(axis.simulated.power_up, PowerUpState::Operational);
        let unit = takt::family::yz_aim::simulated_parameters(axis, 1_000_000, &gantry.simulation);
        assert_eq!(unit.device.power_up, PowerUpState::Operational);
    }
    assert_eq!(parse(&text).axes[0].simulated.power_up, PowerUpState::PreOperational);
}
