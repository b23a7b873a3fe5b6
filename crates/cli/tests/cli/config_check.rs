//! `takt check` as a person or a script sees it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use takt::family::WarningKind;

fn configs() -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs")
}

fn check(config: &Path, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(config).args(options).output().unwrap()
}

fn standard_output(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", standard_output(output)))
}

/// The arm with all of its axes on one bus.
fn six_on_one_bus(folder: &Path) -> PathBuf {
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    let path = folder.join("six.toml");
    std::fs::write(&path, arm.replace("bus = \"wrist\"", "bus = \"base\"")).unwrap();
    path
}

#[test]
fn a_configuration_that_fits_is_shown_with_limits_units_and_buses_and_exit_code_0() {
    let output = check(&configs().join("arm6-erob.toml"), &[]);
    let text = standard_output(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for part in [
        "\n6 axes on 2 buses",
        "-2.9671   2.9671",
        "83443 per rad",
        "199.6",
        "775 µs = 55 SYNC + 375 feedback + 345 set-points",
        "450 to 590",
    ] {
        assert!(text.contains(part), "{part:?} is missing in\n{text}");
    }
}

#[test]
fn the_verdict_comes_first() {
    let text = standard_output(&check(&configs().join("arm6-erob.toml"), &[]));
    assert!(text.starts_with("arm6-erob: every bus carries its traffic in the worst case.\n"), "{text}");
    let folder = tempfile::tempdir().unwrap();
    let text = standard_output(&check(&six_on_one_bus(folder.path()), &[]));
    assert!(text.starts_with("arm6-erob: REFUSED: not every bus"), "{text}");
}

#[test]
fn every_line_fits_a_terminal_of_80_or_100_columns() {
    let files = std::fs::read_dir(configs()).unwrap().map(|entry| entry.unwrap().path());
    for config in files.filter(|path| path.extension().is_some_and(|extension| extension == "toml")) {
        for columns in [80, 100] {
            let output = Command::new(env!("CARGO_BIN_EXE_takt"))
                .arg("check")
                .arg(&config)
                .env("COLUMNS", columns.to_string())
                .output()
                .unwrap();
            let text = standard_output(&output);
            let longest = text.lines().map(|line| line.chars().count()).max().unwrap();
            assert!(longest <= columns, "{}: {longest} of {columns} columns\n{text}", config.display());
        }
    }
}

#[test]
fn limits_are_shown_in_the_unit_that_the_file_has_for_the_position() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("degrees.toml");
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    std::fs::write(&path, arm.replace("[-2.9671, 2.9671]", "[\"-170 deg\", \"170 deg\"]")).unwrap();
    let text = standard_output(&check(&path, &[]));
    let of_joint1: Vec<&str> = text.lines().filter(|line| line.trim_start().starts_with("joint1")).collect();
    assert!(of_joint1.iter().any(|line| line.contains("deg   -170.00   170.00    137.08")), "{text}");
    assert_eq!(json(&check(&path, &["--json"]))["axes"][0]["position_max"], 170_f64.to_radians());
}

#[test]
fn the_modes_that_an_axis_may_be_changed_to_are_shown_and_their_pdos_are_counted() {
    let changing = configs().join("erob-modes/erob-changing.toml");
    let text = standard_output(&check(&changing, &[]));
    for part in ["Modes of operation", "csv, cst", "while disabled", "Torque that streams may ask for"] {
        assert!(text.contains(part), "{part:?} is missing in\n{text}");
    }
    let value = json(&check(&changing, &["--json"]));
    assert_eq!(value["axes"][0]["other_modes"], serde_json::json!(["csv", "cst"]));
    assert_eq!(value["axes"][0]["mode_change"], "while disabled");
    // In CSP and CSV alone it would hold its place, or go on at its speed; the worst is a torque.
    let goes_on = &value["axes"][0]["without_controller"];
    assert_eq!(goes_on["does"], "goes_on");
    let plain = json(&check(&configs().join("erob-modes/erob-csp.toml"), &["--json"]));
    assert_eq!(plain["axes"][0]["other_modes"], serde_json::json!([]));
    let load = |value: &Value| value["buses"][0]["load_percent"].as_f64().unwrap();
    assert!(load(&value) > load(&plain) + 5.0, "{} {}", load(&value), load(&plain));
}

#[test]
fn a_script_reads_the_same_as_one_json_object() {
    let output = check(&configs().join("arm6-erob.toml"), &["--json"]);
    assert_eq!(output.status.code(), Some(0));
    let value = json(&output);
    assert_eq!(value["fits"], true);
    assert_eq!(value["axes"].as_array().map(Vec::len), Some(6));
    assert_eq!(value["axes"][3]["counts_range"][1], 7285.0);
    assert_eq!(value["buses"][1]["slot"]["set_points_done_ns"], 845_000);
}

#[test]
fn buses_that_cannot_carry_their_traffic_end_in_exit_code_2_and_what_would_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = six_on_one_bus(folder.path());
    let output = check(&path, &[]);
    let text = standard_output(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("1495 µs = 55 SYNC + 750 feedback + 690 set-points"), "{text}");
    assert!(text.contains("what would fit: 2 buses: 3 of these axes fit one"), "{text}");
    let output = check(&path, &["--json"]);
    assert_eq!((output.status.code(), &json(&output)["fits"]), (Some(2), &Value::Bool(false)));
}

#[test]
fn a_bad_configuration_ends_in_exit_code_2_and_its_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    std::fs::write(&path, "name = \"bad\"\n[cycle]\nperiod = \"1 m\"\n").unwrap();
    let output = check(&path, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(standard_output(&output).is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("period = \"1 m\"") && text.contains("`bus` is missing"), "{text}");

    let output = check(&path, &["--json"]);
    let value = json(&output);
    assert_eq!(output.status.code(), Some(2));
    let problems = value["problems"].as_array().unwrap();
    assert!(problems.iter().any(|problem| problem["line"] == 3), "{problems:?}");
    assert_eq!(problems.len(), 3);
}

#[test]
fn an_automatic_command_phase_is_shown_and_explained_where_there_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("auto.toml");
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    let auto = arm.replace("command_phase = 0.5", "command_phase = \"auto\"");
    std::fs::write(&path, &auto).unwrap();
    let text = standard_output(&check(&path, &[]));
    assert!(text.contains("the command phase at 510 µs (as \"auto\" has it)"), "{text}");
    assert_eq!(json(&check(&path, &["--json"]))["command_phase_ns"], 510_000);

    std::fs::write(&path, auto.replace("bus = \"wrist\"", "bus = \"base\"")).unwrap();
    let output = check(&path, &["--json"]);
    assert_eq!(output.status.code(), Some(2));
    let problem = &json(&output)["problems"][0];
    assert_eq!(problem["message"], "no command phase suits every bus");
    let help = problem["help"].as_str().unwrap();
    assert!(help.contains("825 µs at the earliest") && help.contains("245 µs at the latest"), "{help}");
    assert!(help.contains("2 buses: 3 of these axes fit one"), "{help}");
}

#[test]
fn thirty_two_axes_that_are_alike_are_shown_once() {
    let text = standard_output(&check(&configs().join("axes32-erob.toml"), &[]));
    assert!(text.lines().count() < 70, "{text}");
    for part in ["axis1 … axis32 (32)", "bus1 … bus10 (10)", "Bus bus1, and 9 alike", "Bus bus11 (times"]
    {
        assert!(text.contains(part), "{part:?} is missing in\n{text}");
    }
    assert!(text.lines().all(|line| line.chars().count() <= 145), "{text}");
    let json = json(&check(&configs().join("axes32-erob.toml"), &["--json"]));
    assert_eq!(json["axes"].as_array().map(Vec::len), Some(32));
    assert_eq!(json["buses"].as_array().map(Vec::len), Some(11));
    assert_eq!(json["buses"][0]["messages"][0]["in_slot_ns"], 55_000);
}

fn standard_error(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn what_is_no_regular_file_is_refused_at_once_with_its_name_and_why() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo.toml");
    nix::unistd::mkfifo(&fifo, nix::sys::stat::Mode::S_IRWXU).unwrap();
    for (path, kind) in [
        (fifo.as_path(), "a FIFO"),
        (folder.path(), "a directory"),
        (Path::new("/dev/null"), "a device"),
        (Path::new("/proc/kmsg"), "a file of the kernel"),
    ] {
        let output = check(path, &[]);
        let text = standard_error(&output).replace("\n  │ ", " ");
        assert_eq!(output.status.code(), Some(2), "{path:?}: {text}");
        assert!(text.contains(path.to_str().unwrap()), "{path:?}: {text}");
        // Only root may open /proc/kmsg.
        assert!(text.contains(kind) || text.contains("Permission denied"), "{path:?}: {text}");
    }
    let text = std::fs::read_to_string(configs().join("single-erob.toml")).unwrap();
    let path = folder.path().join("with-dcf.toml");
    let named = text.replacen("[[axis]]", "[[axis]]\ndcf = \"fifo.toml\"", 1);
    std::fs::write(&path, named).unwrap();
    let output = check(&path, &[]);
    let text = standard_error(&output).replace("\n  │ ", " ");
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("fifo.toml cannot be read: it is a FIFO"), "{text}");
}

#[test]
fn of_many_problems_the_first_twenty_are_shown_and_the_rest_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.toml");
    let keys: String = (0..100_000).map(|key| format!("key{key} = 1\n")).collect();
    std::fs::write(&path, keys).unwrap();
    let output = check(&path, &[]);
    let text = standard_error(&output).replace("\n  │ ", " ");
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("100003 problems, of which the first 20 follow"), "{text}");
    assert!(text.contains("`key16`") && !text.contains("`key17`"), "{text}");
    let value = json(&check(&path, &["--json"]));
    assert_eq!((value["problems"].as_array().unwrap().len(), &value["omitted"]), (20, &Value::from(99_983)));
}

#[test]
fn more_buses_or_axes_than_a_controller_has_are_counted_and_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.toml");
    let bus = |number| format!("[[bus]]\nname = \"b{number}\"\n");
    let axis = |number| format!("[[axis]]\nname = \"a{number}\"\nbus = 1\n");
    let buses: String = (0..100_000).map(bus).collect();
    let axes: String = (0..100_000).map(axis).collect();
    std::fs::write(&path, format!("name = \"many\"\n{buses}{axes}")).unwrap();
    let text = standard_error(&check(&path, &[]));
    assert!(text.contains("100000 buses are more than the 16"), "{text}");
}

#[test]
fn of_a_line_of_a_million_letters_the_part_around_the_problem_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.toml");
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    for text in [
        // Old Macintosh line ends make one line of the file.
        arm.replace('\n', "\r"),
        format!("{arm}\nk{} = 1\n", "k".repeat(1_000_000)),
        arm.replace("node = 1\n", &format!("node = 1\nfeedback = [{}]\n", "\"colour\", ".repeat(100_000))),
    ] {
        std::fs::write(&path, text).unwrap();
        let output = check(&path, &[]);
        let text = standard_error(&output);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.len() < 40_000, "{} bytes", text.len());
        assert!(text.lines().all(|line| line.chars().count() < 500), "{text}");
    }
}

#[test]
fn no_escape_character_from_outside_reaches_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(configs().join("single-erob.toml")).unwrap();
    let escape = "\u{1B}]0;title\u{7}";
    let takt = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).current_dir(&folder).output().unwrap()
    };
    let dcf = "[DeviceComissioning]\nNodeID=1\n[OptionalObjects]\nSupportedObjects=1\n1=0x6083\n\
               [6083]\nParameterName=a\nDataType=7\nAccessType=rw\nParameterValue=5\n";
    std::fs::write(folder.path().join(format!("{escape}.dcf")), dcf).unwrap();
    let toml_escape = "\\u001B]0;title\\u0007";
    let with_dcf = text.replacen("[[axis]]", &format!("[[axis]]\ndcf = \"{toml_escape}.dcf\""), 1);
    std::fs::write(folder.path().join("dcf.toml"), &with_dcf).unwrap();
    let missing = with_dcf.replace(".dcf", ".none");
    std::fs::write(folder.path().join("missing.toml"), missing).unwrap();
    let directory = format!("{text}\n[telemetry]\ndirectory = \"{toml_escape}\"\n");
    std::fs::write(folder.path().join("directory.toml"), directory).unwrap();
    std::fs::write(folder.path().join(escape), "name = 1").unwrap();
    for arguments in [
        &["check", "dcf.toml"][..],
        &["check", "missing.toml"],
        &["check", escape],
        &["check", &format!("no{escape}.toml")],
        &["check", "dcf.toml", &format!("--{escape}")],
        &["eds", &format!("{escape}.dcf")],
        &["plan", escape],
        &["run", "directory.toml"],
        &["run", "dcf.toml", "--bus", &format!("{escape}=can0")],
        &["report", escape],
        &[escape],
    ] {
        let output = takt(arguments);
        for stream in [&output.stdout, &output.stderr] {
            let text = String::from_utf8_lossy(stream);
            assert!(!text.contains('\u{7}') && !text.contains("\u{1B}]"), "{arguments:?}: {text:?}");
        }
    }
}

#[test]
fn what_an_axis_does_without_the_controller_is_told_for_its_mode() {
    for (mode, words) in [
        ("csp", "holds its last set-point, 0.1024 rad (5.9 deg) away at most"),
        ("csv", "goes on for 100 ms, then brakes: at rest after 399 ms and 0.5964 rad (34.2 deg) at most"),
        ("cst", "goes on for 100 ms, then brakes"),
        ("pp", "goes on for 100 ms, then brakes: at rest after 399 ms and 0.5964 rad (34.2 deg) at most"),
        ("pv", "goes on for 100 ms, then brakes"),
        ("pt", "goes on for 100 ms, then brakes"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.toml");
        let text = |heartbeat: &str| {
            format!(
                "name = \"one\"\n{heartbeat}[[bus]]\nname = \"b\"\n[[axis]]\nname = \"a\"\nbus = \"b\"\nnode = 1\n\
                 drive = \"erob-canopen\"\nmode = \"{mode}\"\n[axis.limits]\nposition = [-1, 1]\n\
                 velocity = \"137 deg/s\"\nacceleration = 8\ntorque = 40\n"
            )
        };
        std::fs::write(&path, text("")).unwrap();
        let told = standard_output(&check(&path, &[]));
        assert!(told.contains(words), "{mode}: {told}");
        std::fs::write(&path, text("[master]\nheartbeat = \"off\"\n")).unwrap();
        let told = standard_output(&check(&path, &[]));
        assert_eq!(told.contains("FOR EVER"), !matches!(mode, "csp" | "pp"), "{mode}: {told}");
        assert_eq!(told.contains("ends its move by itself"), mode == "pp", "{mode}: {told}");
    }
}

#[test]
fn groups_are_shown_with_their_axes_and_whose_stops_stop_them() {
    let path = configs().join("arm-and-gripper.toml");
    let text = standard_output(&check(&path, &[]));
    assert!(text.contains("Groups\n"), "{text}");
    let gripper = text.lines().find(|line| line.trim_start().starts_with("gripper")).unwrap();
    assert!(gripper.contains("finger") && gripper.contains("arm"), "{gripper}");
    let groups = &json(&check(&path, &["--json"]))["groups"];
    assert_eq!(groups[0]["axes"], serde_json::json!(["base", "shoulder", "elbow"]));
    assert_eq!(
        (&groups[1]["name"], &groups[1]["stops_with"]),
        (&"gripper".into(), &serde_json::json!(["arm"]))
    );
}

#[test]
fn a_command_that_expires_and_ends_without_power_is_warned_of() {
    let with_category =
        |category: u8| warnings(|arm| format!("{arm}\n[stops]\nstale_command = {category}\n"));
    let words = with_category(0);
    assert!(
        matches!(&words[..], [one] if one.starts_with("`[stops]`: `stale_command = 0` removes")),
        "{words:?}"
    );
    assert_eq!((with_category(1), with_category(2)), (vec![], vec![]));
}

/// The warnings about the arm with a change.
fn warnings(change: impl Fn(String) -> String) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.toml");
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    std::fs::write(&path, change(arm)).unwrap();
    let output = check(&path, &["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let words = json(&output)["warnings"].as_array().unwrap().clone();
    let words: Vec<String> = words.iter().map(|word| word.as_str().unwrap().to_owned()).collect();
    let text = standard_output(&check(&path, &[]));
    assert!(words.iter().all(|warning| text.contains(warning)), "{text}");
    words
}

#[test]
fn a_gear_ratio_of_the_gear_inside_an_erob_is_warned_about() {
    let geared = |ratio: &str| {
        let line = format!("drive = \"erob-canopen\"\ngear_ratio = {ratio}");
        move |arm: String| arm.replacen("drive = \"erob-canopen\"", &line, 1)
    };
    let fast = warnings(geared("100"));
    assert!(!fast.is_empty());
    assert!(fast[0].contains("times a second") && fast[0].contains("`gear_ratio = 100`"), "{fast:?}");
    assert!(fast[0].contains("the drive counts turns of its output"), "{fast:?}");
    let slow = warnings(geared("50"));
    assert!(slow[0].contains("leave `gear_ratio` at 1"), "{slow:?}");
}

#[test]
fn limits_near_a_wrap_of_the_drive_s_count_are_warned_about() {
    // The joint is at about 3.3 rad where the count of its drive wraps; its limits are ±2.9671 rad.
    let zero_at = |count: &str| {
        let line = format!("node = 1\nzero_counts = {count}");
        move |arm: String| arm.replacen("node = 1\n", &format!("{line}\n"), 1)
    };
    for count in ["2147208000", "-2147208000"] {
        let near = warnings(zero_at(count));
        assert_eq!(near.len(), 1, "{near:?}");
        assert!(near[0].contains("the count of its drive wraps at"), "{near:?}");
    }
    assert_eq!(warnings(zero_at("2146900000")), Vec::<String>::new());
}

#[test]
fn limits_that_look_like_degrees_are_warned_about() {
    let changed = |find: &'static str, with: &'static str| move |arm: String| arm.replacen(find, with, 1);
    let limits = "position = [-2.9671, 2.9671]";
    let range = warnings(changed(limits, "position = [-90, 90]"));
    assert_eq!(range.len(), 1, "{range:?}");
    assert!(range[0].contains("range of 28.6479 turns"), "{range:?}");
    assert!(range[0].contains("[\"-90 deg\", \"90 deg\"]"), "{range:?}");
    let turns = warnings(changed(limits, "position = [-7.5, 7.5]"));
    assert!(turns[0].contains("range of 2.38732 turns: check its unit"), "{turns:?}");
    let fast = "velocity = 30, acceleration = 100";
    let velocity = warnings(changed("velocity = \"2.3925 rad/s\", acceleration = \"8 rad/s^2\"", fast));
    assert!(velocity[0].contains("write \"30 deg/s\""), "{velocity:?}");
}

#[test]
fn no_configuration_that_comes_with_takt_is_warned_about_but_for_drives_without_a_watchdog() {
    for file in std::fs::read_dir(configs()).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let Ok(config) = takt::config::Config::load(&path) else { continue };
        let warnings = config.warnings();
        let is_other = |kind: &WarningKind| !matches!(kind, WarningKind::NoWatchdog { .. });
        let others = warnings.iter().filter(|warning| is_other(&warning.kind));
        let words: Vec<String> = others.map(ToString::to_string).collect();
        assert_eq!(words, Vec::<String>::new(), "{}", path.display());
    }
}
