//! `[[group]]`: which axes move together, and which groups stop together.

use takt::config::ProblemKind::{self, *};
use takt::config::{Config, Group, ProgramTarget};

const AXES: &str = r#"name = "two-groups"

[[bus]]
name = "can"

[defaults.axis]
bus = "can"
drive = "erob-canopen"
mode = "csp"

[defaults.axis.limits]
position = ["-90 deg", "90 deg"]
velocity = "90 deg/s"
acceleration = "6 rad/s^2"
torque = "31 Nm"

[[axis]]
name = "base"
node = 1

[[axis]]
name = "finger"
node = 2

[[axis]]
name = "elbow"
node = 3
"#;

const GROUPS: &str = r#"
[[group]]
name = "arm"
axes = ["elbow", "base"]

[[group]]
name = "gripper"
axes = ["finger"]
stops_with = ["arm"]

[[program.move]]
group = "arm"
to = ["10 deg", 0.5]

[[program.move]]
group = "gripper"
to = "20 deg"
"#;

fn sound() -> String {
    format!("{AXES}{GROUPS}")
}

fn read(text: &str) -> Config {
    Config::parse("two-groups.toml", text).unwrap_or_else(|error| panic!("{error:?}"))
}

/// The one problem of a text in which something was replaced, and the text of its place.
fn problem(replaced: &str, by: &str) -> (ProblemKind, String) {
    let text = sound();
    assert!(text.contains(replaced), "{replaced:?} is not there");
    problem_of(&text.replace(replaced, by))
}

fn problem_of(text: &str) -> (ProblemKind, String) {
    let error = Config::parse("two-groups.toml", text).expect_err("nothing was found");
    let [problem] = error.problems() else { panic!("{error:?}") };
    let place = &text[problem.span().unwrap()];
    (problem.kind.clone(), place.to_owned())
}

#[test]
fn a_group_has_its_axes_in_its_own_order_and_a_program_moves_them_in_it() {
    let config = read(&sound());
    let arm = Group { name: "arm".to_owned(), axes: vec![2, 0], stops_with: vec![] };
    let gripper = Group { name: "gripper".to_owned(), axes: vec![1], stops_with: vec![0] };
    assert_eq!(config.groups, [arm, gripper]);
    assert_eq!((config.axes_of_group(0), config.axes_of_group(1)), (vec![2, 0], vec![1]));
    let moves = &config.program.moves;
    assert_eq!(moves.iter().map(|own| own.group).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(moves[0].target, ProgramTarget::Position(vec![10_f64.to_radians(), 0.5]));
    assert_eq!(moves[1].target, ProgramTarget::Position(vec![20_f64.to_radians()]));
    config.validate().unwrap();
    takt::controller::assemble::engine(&config).unwrap();
}

#[test]
fn without_groups_all_axes_are_one_and_no_move_names_a_group() {
    let one = read(&format!("{AXES}[[program.move]]\nto = \"10 deg\"\n"));
    assert!(one.groups.is_empty());
    assert_eq!((one.axes_of_group(0), one.program.moves[0].group), (vec![0, 1, 2], 0));
    let named = problem_of(&format!("{AXES}[[program.move]]\ngroup = \"arm\"\nto = \"10 deg\"\n"));
    assert!(matches!(named.0, UnknownName { what: "group", .. }), "{named:?}");
    assert!(named.0.help().contains("no [[group]]"), "{}", named.0.help());
}

#[test]
fn a_single_group_needs_no_name_in_the_program() {
    let all = "[[group]]\nname = \"arm\"\naxes = [\"base\", \"finger\", \"elbow\"]\n";
    let config = read(&format!("{AXES}{all}[[program.move]]\nto = \"10 deg\"\n"));
    assert_eq!((config.groups.len(), config.program.moves[0].group), (1, 0));
}

#[test]
fn every_axis_is_in_exactly_one_group() {
    let (kind, place) = problem("axes = [\"finger\"]", "axes = [\"finger\", \"base\"]");
    assert_eq!(kind, InTwoGroups { axis: "base".to_owned(), group: "arm".to_owned() });
    assert_eq!(place, "\"base\"");
}

#[test]
fn an_axis_in_no_group_is_named_at_its_own_line() {
    let text = sound().replace("[\"elbow\", \"base\"]", "[\"elbow\"]").replace("[\"10 deg\", 0.5]", "0.5");
    let (kind, place) = problem_of(&text);
    assert_eq!(kind, InNoGroup { axis: "base".to_owned() });
    assert!(place.contains("[[axis]]"), "{place:?}");
    assert!(kind.help().contains("a [[group]] of its own"), "{}", kind.help());
}

#[test]
fn what_is_wrong_with_a_group_is_said_where_it_is() {
    let (kind, place) = problem("\"elbow\", \"base\"", "\"elbow\", \"bass\"");
    assert!(matches!(&kind, UnknownName { what: "axis", nearest: Some(nearest), .. } if nearest == "base"));
    assert_eq!((place.as_str(), kind.help().as_str()), ("\"bass\"", "did you mean \"base\"?"));
    let (kind, ..) = problem("\"elbow\", \"base\"", "\"elbow\", \"base\", \"base\"");
    assert!(matches!(&kind, Repeated { given, .. } if given == "base"), "{kind:?}");
    let (kind, place) = problem("stops_with = [\"arm\"]", "stops_with = [\"leg\"]");
    assert!(matches!(&kind, UnknownName { what: "group", known, .. } if known == &["arm", "gripper"]));
    assert_eq!(place, "\"leg\"");
    let (kind, ..) = problem("stops_with = [\"arm\"]", "stops_with = [\"gripper\"]");
    assert_eq!(kind, StopsWithItself { name: "gripper".to_owned() });
    let (kind, ..) = problem("stops_with = [\"arm\"]", "stops_with = [\"arm\", \"arm\"]");
    assert!(matches!(kind, Repeated { .. }), "{kind:?}");
    let (kind, ..) = problem("axes = [\"finger\"]", "axes = []");
    assert!(matches!(kind, OutOfRange { .. }), "{kind:?}");
}

#[test]
fn two_groups_have_two_names() {
    let text =
        sound().replace("name = \"gripper\"", "name = \"arm\"").replace("\"gripper\"\nto", "\"arm\"\nto");
    let text = text.replace("stops_with = [\"arm\"]\n", "");
    let error = Config::parse("two-groups.toml", &text).unwrap_err();
    let kinds: Vec<_> = error.problems().iter().map(|problem| &problem.kind).collect();
    assert!(matches!(kinds[..], [DuplicateName { what: "group", .. }]), "{kinds:?}");
}

#[test]
fn a_move_names_a_group_that_is_there_and_has_a_target_for_each_of_its_axes() {
    let (kind, ..) = problem("group = \"arm\"\nto", "to");
    assert!(matches!(&kind, MissingKey { key, .. } if key == "program.move.group"), "{kind:?}");
    let (kind, place) = problem("group = \"gripper\"", "group = \"griper\"");
    assert!(matches!(&kind, UnknownName { nearest: Some(nearest), .. } if nearest == "gripper"), "{kind:?}");
    assert_eq!(place, "\"griper\"");
    let (kind, ..) = problem("to = [\"10 deg\", 0.5]", "to = [0, 0, 0]");
    assert_eq!(kind, TargetCount { given: 3, axes: 2, group: Some("arm".to_owned()) });
    assert!(kind.to_string().contains("2 axes in the group \"arm\""), "{kind}");
}

#[test]
fn no_more_groups_than_a_controller_can_have() {
    let nine: String = (0..9).map(|n| format!("[[group]]\nname = \"g{n}\"\naxes = [\"base\"]\n")).collect();
    let error = Config::parse("nine.toml", &format!("{AXES}{nine}")).unwrap_err();
    let too_many = TooMany { what: "groups", given: 9, limit: 8 };
    assert!(error.problems().iter().any(|problem| problem.kind == too_many), "{error:?}");
}

#[test]
fn groups_that_were_changed_in_code_are_checked_by_the_same_rules() {
    let problems = |change: fn(&mut Config)| {
        let mut config = read(&sound());
        change(&mut config);
        let error = config.validate().expect_err("nothing was found");
        error.problems().iter().map(|problem| problem.kind.clone()).collect::<Vec<_>>()
    };
    let has = |kinds: Vec<ProblemKind>, wanted: ProblemKind| assert!(kinds.contains(&wanted), "{kinds:?}");
    has(
        problems(|config| config.groups[1].axes.push(0)),
        InTwoGroups { axis: "base".to_owned(), group: "arm".to_owned() },
    );
    has(problems(|config| config.groups[0].axes.truncate(1)), InNoGroup { axis: "base".to_owned() });
    has(problems(|config| config.groups[0].stops_with = vec![0]), StopsWithItself { name: "arm".to_owned() });
    has(
        problems(|config| config.groups[1].name = "arm".to_owned()),
        DuplicateName { what: "group", name: "arm".to_owned() },
    );
    assert!(matches!(
        problems(|config| config.groups[0].axes[0] = 7)[..],
        [UnknownName { what: "axis", .. }, ..]
    ));
    assert!(matches!(
        problems(|config| config.groups[0].stops_with = vec![5])[..],
        [UnknownName { what: "group", .. }]
    ));
    assert!(matches!(
        problems(|config| config.program.moves[0].group = 2)[..],
        [UnknownName { what: "group", .. }]
    ));
    assert!(matches!(problems(|config| config.groups[1].axes.clear())[..], [OutOfRange { .. }, ..]));
}
