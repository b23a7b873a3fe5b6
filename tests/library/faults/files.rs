//! Scenario files: the examples, the reference, and the messages about invalid files.

use takt::Outcome;
use takt::config::Config;
use takt::faults::Scenario;

use crate::faults::arm::{arm, folder, play_scenario};

/// The example with its whole program.
fn example(name: &str) -> Scenario {
    let config = Config::load(&folder().join("arm6-erob.toml")).unwrap();
    Scenario::load(&folder().join("faults").join(name), &config)
        .unwrap_or_else(|error| panic!("{name}: {error:?}"))
}

#[test]
fn every_example_is_valid_and_does_what_it_says() {
    let mut names: Vec<String> = std::fs::read_dir(folder().join("faults"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let ends: Vec<(String, bool)> = names
        .into_iter()
        .filter(|name| name != "reference.toml")
        .map(|name| {
            let played = play_scenario(&arm(), example(&name));
            let began = played.events.iter().filter(|events| events.ends_with("has begun")).count();
            assert_eq!(began, example(&name).faults.len(), "{name}: {:?}", played.events);
            (name, played.outcome == Some(Outcome::Finished))
        })
        .collect();
    let finishing: Vec<&str> =
        ends.iter().filter(|(_, is_done)| *is_done).map(|(name, _)| name.as_str()).collect();
    assert!(finishing.contains(&"lossy-bus.toml"), "{ends:?}");
    for stopping in [
        "babbling-node.toml",
        "blocked-joint.toml",
        "bus-off.toml",
        "drive-reboots.toml",
        "over-voltage-while-stopping.toml",
    ] {
        assert!(ends.contains(&(stopping.to_owned(), false)), "{ends:?}");
    }
}

#[test]
fn the_reference_shows_every_kind() {
    let reference = example("reference.toml");
    let config = arm();
    let unknown = Scenario::parse("x", "[[fault]]\nkind = \"?\"\nbus = \"base\"", &config).unwrap_err();
    let help = unknown.problems()[0].kind.help();
    let kinds: Vec<&str> = help.split('"').skip(1).step_by(2).collect();
    assert!(kinds.len() > 30, "{help}");
    for kind in kinds {
        assert!(reference.faults.iter().any(|fault| fault.kind == kind), "{kind}");
    }
}

/// Text of a file, the line of the problem, and parts of its message and help.
const WRONG: [(&str, usize, &str, &str); 31] = [
    ("", 1, "`fault` is missing", "[[fault]]"),
    ("[[fault]", 1, "this is not TOML", "toml.io"),
    ("fault = 3", 1, "`fault` must be a list of tables", "[[double brackets]]"),
    ("[[fault]]\nbus = \"base\"", 1, "`fault.kind` is missing", "kind ="),
    ("[[fault]]\nkind = \"dorp\"\nbus = \"base\"", 2, "cannot be \"dorp\"", "did you mean \"drop\"?"),
    ("[[fault]]\nkind = \"drop\"", 1, "`fault.bus` is missing", "bus ="),
    ("[[fault]]\nkind = \"drop\"\nbus = \"bass\"", 3, "`fault.bus` cannot be \"bass\"", "base, wrist"),
    ("[[fault]]\nkind = \"stall\"", 1, "`fault.axis` is missing", "axis ="),
    ("[[fault]]\nkind = \"stall\"\naxis = \"elbow\"", 3, "`fault.axis` cannot be \"elbow\"", "joint1"),
    ("[[fault]]\nkind = \"stall\"\naxis = 7", 3, "`fault.axis` must be a text", "text"),
    (
        "[[fault]]\nkind = \"stall\"\naxis = \"joint1\"\nat = \"2 deg\"",
        4,
        "is not a unit of that",
        "duration",
    ),
    (
        "[[fault]]\nkind = \"stall\"\naxis = \"joint1\"\nat = \"soon\"",
        4,
        "does not begin with a number",
        "duration",
    ),
    ("[[fault]]\nkind = \"stall\"\naxis = \"joint1\"\nat = -1", 4, "`fault.at` cannot be -1 s", "0 s to"),
    ("[[fault]]\nkind = \"stall\"\naxis = \"joint1\"\nfor = \"-2 cycles\"", 4, "\"cycles\"", "duration"),
    ("[[fault]]\nkind = \"stall\"\naxis = \"joint1\"\nwhen = \"moved\"", 4, "cannot be \"moved\"", "moving"),
    (
        "[[fault]]\nkind = \"stall\"\naxis = \"joint1\"\nprobability = 0.5",
        4,
        "means nothing here",
        "allowed here",
    ),
    (
        "[[fault]]\nkind = \"reboot\"\naxis = \"joint1\"\nfor = \"1 s\"",
        4,
        "`fault.for` means nothing here",
        "at",
    ),
    (
        "[[fault]]\nkind = \"bus-off\"\nbus = \"base\"\nfor = \"1 s\"",
        4,
        "`fault.for` means nothing here",
        "restart",
    ),
    ("[[fault]]\nkind = \"delay\"\nbus = \"base\"", 1, "`fault.by` is missing", "300 us"),
    (
        "[[fault]]\nkind = \"drop\"\nbus = \"base\"\nid = 0x20000000",
        4,
        "`fault.id` cannot be",
        "0 to 536870911",
    ),
    (
        "[[fault]]\nkind = \"drop\"\nbus = \"base\"\nid = [1, 2, 3]",
        4,
        "a list of 3",
        "the first and the last",
    ),
    ("[[fault]]\nkind = \"drop\"\nbus = \"base\"\nid = [0x200, 0x1FF]", 4, "0x200 to 0x1ff", "comes first"),
    ("[[fault]]\nkind = \"drop\"\nbus = \"base\"\nfunction = \"pdo\"", 4, "cannot be \"pdo\"", "pdo"),
    ("[[fault]]\nkind = \"drop\"\nbus = \"base\"\nprobability = 1.5", 4, "cannot be 150 %", "up to 100 %"),
    ("[[fault]]\nkind = \"drop\"\nbus = \"base\"\ncount = 0", 4, "`fault.count` cannot be 0", "1 to"),
    (
        "[[fault]]\nkind = \"duplicate\"\nbus = \"base\"\ncopies = 9",
        4,
        "`fault.copies` cannot be 9",
        "1 to 8",
    ),
    (
        "[[fault]]\nkind = \"echo-loss\"\nbus = \"base\"\ndirection = \"received\"",
        4,
        "means nothing here",
        "did you mean",
    ),
    (
        "[[fault]]\nkind = \"flood\"\nbus = \"base\"\nperiod = \"1 us\"",
        4,
        "`fault.period` cannot be 1 µs",
        "20 µs or more",
    ),
    (
        "[[fault]]\nkind = \"foreign-frame\"\nbus = \"base\"\nid = 1\ndata = [256]",
        5,
        "`fault.data` cannot be 256",
        "0 to 255",
    ),
    ("[[fault]]\nkind = \"load\"\naxis = \"joint1\"\ntorque = \"3 N\"", 4, "is not a unit of that", "Nm"),
    (
        "[[fault]]\nkind = \"foreign-nmt\"\nbus = \"base\"\ncommand = \"halt\"",
        4,
        "cannot be \"halt\"",
        "stop",
    ),
];

#[test]
fn every_problem_is_reported_with_its_line_and_a_remedy() {
    let config = arm();
    for (text, line, said, help) in WRONG {
        let Err(error) = Scenario::parse("scenario", text, &config) else { panic!("{text} is taken") };
        let problem = &error.problems()[0];
        assert_eq!(error.line(problem), Some(line), "{text}: {problem}");
        assert!(problem.to_string().contains(said), "{text}: {problem}");
        assert!(problem.kind.help().contains(help), "{text}: {}", problem.kind.help());
    }
}

#[test]
fn all_problems_of_a_file_are_reported_together() {
    let text = "[[fault]]\nkind = \"drop\"\nbus = \"bass\"\nprobability = 2\n\n[[fault]]\nkind = \"stall\"\naxis = \"elbow\"\nfro = 1";
    let error = Scenario::parse("scenario", text, &arm()).unwrap_err();
    let lines: Vec<_> = error.problems().iter().map(|problem| error.line(problem).unwrap()).collect();
    assert_eq!(lines, [3, 4, 8, 9]);
}

#[test]
fn faults_behind_a_real_interface_are_possible_for_frames_but_not_for_drives() {
    let mut config = arm();
    config.override_interface("wrist", "can0").unwrap();
    let text = "[[fault]]\nkind = \"stall\"\naxis = \"joint5\"";
    let error = Scenario::parse("scenario", text, &config).unwrap_err();
    let problem = &error.problems()[0];
    assert_eq!(error.line(problem), Some(3));
    assert!(problem.to_string().contains("can0") && problem.kind.help().contains("simulated"), "{problem}");
    let frames = text.replace("stall", "drop");
    assert_eq!(Scenario::parse("scenario", &frames, &config).unwrap().faults[0].bus, 1);
}

#[test]
fn a_machine_with_one_bus_need_not_name_it() {
    let config = Config::load(&folder().join("single-erob.toml")).unwrap();
    let scenario = Scenario::parse("scenario", "[[fault]]\nkind = \"error-passive\"", &config).unwrap();
    assert_eq!(scenario.faults[0].bus, 0);
}

#[test]
fn a_missing_file_is_named() {
    let error = Scenario::load(&folder().join("faults/none.toml"), &arm()).unwrap_err().to_string();
    assert!(error.contains("none.toml"), "{error}");
}
