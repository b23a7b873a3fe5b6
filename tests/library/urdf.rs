//! Limits that an axis has from the joint of a robot description (URDF): `tests/urdf/*.csv` are the vectors.

use std::path::Path;

use takt::config::{LimitOrigin, Urdf, UrdfError};
use takt::{Config, ConfigError};

/// A configuration of one axis. The lines of a vector have `;` where TOML has a comma or the end of a line.
fn configured(urdf: &str, travel: &str, joint: &str, limits: &str) -> Result<Config, ConfigError> {
    let limits = if limits.contains('[') { limits.replace(';', ",") } else { limits.replace(';', "\n") };
    let travel = if travel == "linear" { "travel = \"linear\"\nlead = 0.01" } else { "travel = \"rotary\"" };
    let text = format!(
        "name = \"arm\"\n{urdf}\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"{joint}\"\nbus = \"can\"\nnode = 1\n\
         drive = \"erob-canopen\"\n{travel}\n[axis.limits]\nacceleration = 1.0\n{limits}\n",
    );
    Config::parse("tests/urdf/arm.toml", &text)
}

const ARM: &str = "urdf = \"arm.urdf\"";

fn rows(file: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/urdf").join(file));
    let rows = text.unwrap();
    let rows = rows.lines().filter(|row| !row.starts_with('#'));
    rows.map(|row| row.split(',').map(str::to_owned).collect()).collect()
}

/// Words without the values in degrees that stand in parentheses behind those in radians.
fn in_radians(words: &str) -> String {
    let mut parts = words.split(" (");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |words, part| match part.split_once(')') {
        Some((aside, rest)) if aside.contains(" deg") => words + rest,
        _ => words + " (" + part,
    })
}

#[test]
fn an_axis_has_the_limits_of_its_joint_unless_its_own_are_narrower() {
    let rows = rows("limits.csv");
    assert_eq!(rows.len(), 12);
    for row in rows {
        let [travel, joint, limits, low, high, velocity, torque, origins @ ..] = row.as_slice() else {
            panic!("{row:?}")
        };
        let config = configured(ARM, travel, joint, limits).unwrap();
        let axis = &config.axes[0];
        let found =
            [axis.limits.position_min, axis.limits.position_max, axis.limits.velocity, axis.limits.torque];
        assert_eq!(
            found,
            [low, high, velocity, torque].map(|value| value.parse::<f64>().unwrap()),
            "{row:?}"
        );
        assert_eq!((axis.limits.acceleration, axis.limits.jerk), (1.0, f64::INFINITY));
        let urdf = axis.urdf.as_ref().unwrap();
        assert_eq!(urdf.joint, *joint);
        assert!(urdf.file.ends_with("tests/urdf/arm.urdf"));
        assert_eq!([urdf.position, urdf.velocity, urdf.torque].map(|origin| format!("{origin:?}")), origins);
    }
}

#[test]
fn what_contradicts_the_robot_description_is_refused_with_file_joint_and_value() {
    let rows = rows("refused.csv");
    assert_eq!(rows.len(), 16);
    for row in rows {
        let [travel, joint, limits, words] = row.as_slice() else { panic!("{row:?}") };
        let error = configured(ARM, travel, joint, limits).unwrap_err();
        let [problem] = error.problems() else { panic!("{row:?}: {error:?}") };
        let words = words.replace("; and", ", and").replace("; its", ", its");
        assert_eq!(in_radians(&problem.to_string()), words, "{row:?}");
        assert!(error.line(problem).is_some(), "{row:?}");
    }
}

#[test]
fn a_limit_that_is_too_wide_is_shown_at_its_line_with_what_to_do() {
    let error = configured(ARM, "rotary", "shoulder_pan", "velocity = 2.0").unwrap_err();
    assert_eq!(error.line(&error.problems()[0]), Some(13));
    let shown = format!("{error:?}");
    assert!(shown.contains("may be narrower than that of the robot description, not wider"), "{shown}");
}

#[test]
fn an_axis_names_its_joint_or_is_none() {
    let named = |key: &str| {
        let axis = "\nnode = 1";
        let text = "name = \"arm\"\nurdf = \"arm.urdf\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"a\"\nbus = \"can\"\nnode = 1\n\
             drive = \"erob-canopen\"\n[axis.limits]\nacceleration = 1.0\n";
        Config::parse("tests/urdf/arm.toml", &text.replace(axis, &format!("{axis}\n{key}")))
    };
    let config = named("urdf_joint = \"elbow\"").unwrap();
    assert_eq!(config.axes[0].urdf.as_ref().unwrap().position, LimitOrigin::SafetyController);
    let error = named("urdf_joint = \"off\"").unwrap_err();
    let missing: Vec<String> = error.problems().iter().map(ToString::to_string).collect();
    let all = ["position", "velocity", "torque"].map(|key| format!("`axis.limits.{key}` is missing"));
    assert_eq!(missing, all);
    // The nearest joint is offered.
    let error = named("urdf_joint = \"elbo\"").unwrap_err();
    assert!(error.problems()[0].kind.help().contains("did you mean urdf_joint = \"elbow\""));
}

#[test]
fn a_joint_without_a_robot_description_and_a_file_that_is_none_are_each_one_problem() {
    let only = |error: ConfigError| {
        let [problem] = error.problems() else { panic!("{error:?}") };
        problem.to_string()
    };
    let limits = "position = [-1; 1]";
    let whole = "velocity = 1.0; torque = 1.0";
    let missing = only(configured("urdf = \"missing.urdf\"", "rotary", "elbow", limits).unwrap_err());
    assert!(missing.starts_with("tests/urdf/missing.urdf cannot be read: "), "{missing}");
    let other = only(configured("urdf = \"limits.csv\"", "rotary", "elbow", whole).unwrap_err());
    assert!(other.starts_with("tests/urdf/limits.csv is no URDF: "), "{other}");
    let error = Config::parse(
        "arm.toml",
        "name = \"arm\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"a\"\nurdf_joint = \"elbow\"\nbus = \"can\"\nnode = 1\n\
         drive = \"erob-canopen\"\n[axis.limits]\nposition = [-1, 1]\nvelocity = 1\nacceleration = 1\ntorque = 1\n",
    );
    assert_eq!(only(error.unwrap_err()), "`urdf` is missing");
}

#[test]
fn limits_that_a_description_leaves_open_are_none() {
    let text = "<robot name=\"r\" version=\"1.2\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"continuous\">\
                <parent link=\"a\"/><child link=\"b\"/><limit/></joint></robot>";
    let urdf = Urdf::parse("r.urdf".as_ref(), text).unwrap();
    let joint = urdf.joint("j", takt::config::Travel::Rotary).unwrap();
    assert_eq!((joint.position, joint.velocity, joint.effort), (None, None, None));
    assert!(urdf.has_joint("j") && !urdf.has_joint("k"));
    let unbounded = text.replace("continuous", "revolute");
    let urdf = Urdf::parse("r.urdf".as_ref(), &unbounded).unwrap();
    assert!(matches!(urdf.joint("j", takt::config::Travel::Rotary), Err(UrdfError::NoRoom { .. })));
}

#[test]
fn a_configuration_that_was_made_without_a_description_is_compared_with_it() {
    let own = |joint: &str, limits: &str| configured("", "rotary", joint, limits).unwrap();
    let urdf = Urdf::load("tests/urdf/arm.urdf".as_ref()).unwrap();
    let said = |config: &Config| -> Vec<String> {
        urdf.contradictions(config).iter().map(|error| in_radians(&error.to_string())).collect()
    };
    let within = "position = [-2.5; 2.0]\nvelocity = 1.75\ntorque = 80.0";
    assert_eq!(said(&own("shoulder_pan", within)), Vec::<String>::new());
    let wider = "position = [-2.6; 2.0]\nvelocity = 2.0\ntorque = 88.0";
    let ends = [
        "velocity of 2 rad/s, and the joint of that name in tests/urdf/arm.urdf allows 1.75 rad/s",
        "allows 87 Nm",
    ];
    let found = said(&own("shoulder_pan", wider));
    assert_eq!(found.len(), 3);
    assert!(
        found[0].starts_with("the axis \"shoulder_pan\" has a position of -2.6 rad to 2 rad"),
        "{found:?}"
    );
    assert!(found[1].ends_with(ends[0]) && found[2].ends_with(ends[1]), "{found:?}");
    // A joint that turns without end has no limits of its position, and an axis that is no joint contradicts nothing.
    assert_eq!(said(&own("wrist_roll", "position = [-9.0; 9.0]\nvelocity = 1.0\ntorque = 1.0")).len(), 0);
    assert_eq!(said(&own("turntable", wider)).len(), 0);
    assert!(matches!(urdf.contradictions(&own("lift", within))[..], [UrdfError::OtherTravel { .. }]));
}

#[test]
fn the_example_of_the_guide_is_read() {
    let guide = std::fs::read_to_string("docs/ros2.md").unwrap();
    let example = guide.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let config = Config::parse("tests/urdf/guide.toml", example).unwrap();
    let axis = &config.axes[0];
    assert_eq!((axis.limits.position_max, axis.limits.torque), (2.25, 87.0));
    assert_eq!(axis.urdf.as_ref().unwrap().velocity, LimitOrigin::Configuration);
}
