//! `takt plan` as a user meets it: problems in, one a line, answers out.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};

/// Two axes that arrive together, the second one with a position limit.
fn problem() -> Value {
    json!({
        "id": "both", "p0": [0.0, 0.5], "pf": [1.0, -0.5], "vmax": [2.0, 2.0], "amax": [8.0, 8.0],
        "jmax": [100.0, 100.0], "pmin": [null, -1.0], "pmax": [null, 1.0],
    })
}

fn plan(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("plan")
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Who does not read its input has closed it: that is seen in the answers.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

fn answers(output: &Output) -> Vec<Value> {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn an_answer_has_the_duration_the_samples_and_the_extrema() {
    let output = plan(&[], &format!("{}\n", problem()));
    assert_eq!(output.status.code(), Some(0));
    let answers = answers(&output);
    let [answer] = answers.as_slice() else { panic!("{answers:?}") };
    assert_eq!((&answer["id"], &answer["result"]), (&json!("both"), &json!("ok")));
    let duration_s = answer["duration"].as_f64().unwrap();
    assert_eq!(numbers(&answer["t_min"]), [duration_s; 2]);
    let times = numbers(&answer["t"]);
    assert_eq!((times.len(), times[0], times[15]), (16, 0.0, duration_s));
    for (key, first, last) in
        [("p", [0.0, 0.5], [1.0, -0.5]), ("v", [0.0; 2], [0.0; 2]), ("a", [0.0; 2], [0.0; 2])]
    {
        let samples = answer[key].as_array().unwrap();
        assert_eq!((samples.len(), numbers(&samples[0])), (16, first.to_vec()), "{key}");
        assert_eq!(numbers(&samples[15]), last, "{key}");
    }
    assert_eq!(numbers(&answer["pmin"]), [0.0, -0.5]);
    assert_eq!(numbers(&answer["pmax"]), [1.0, 0.5]);
}

#[test]
fn every_interface_and_order_is_planned() {
    let mut second_order = problem();
    second_order["jmax"] = json!([null, null]);
    let mut velocity = problem();
    velocity["interface"] = json!("velocity");
    velocity["vf"] = json!([1.0, -1.0]);
    velocity["min_duration"] = json!(2.5);
    let mut straight = problem();
    straight["sync"] = json!("straight");
    straight["dt"] = json!(0.001);
    let output = plan(&[], &format!("{second_order}\n\n{velocity}\n{straight}\n"));
    assert_eq!(output.status.code(), Some(0));
    let answers = answers(&output);
    assert_eq!(answers.len(), 3);
    assert!(answers.iter().all(|answer| answer["result"] == "ok"), "{answers:?}");
    // 0 to 1 at 2 and 8: a quarter of a second up, as long down, the same in between.
    assert_eq!(answers[0]["duration"], json!(0.75));
    assert_eq!(answers[1]["duration"], json!(2.5));
    assert_eq!(numbers(&answers[1]["v"][15]), [1.0, -1.0]);
    let cycles = answers[2]["duration"].as_f64().unwrap() / 0.001;
    assert!((cycles - cycles.round()).abs() < 1e-6, "{cycles}");
}

#[test]
fn an_answer_is_sampled_at_the_multiples_of_dt_or_at_the_times_that_are_asked_for() {
    let (mut grid, mut asked) = (problem(), problem());
    grid["dt"] = json!(0.01);
    asked["t"] = json!([0.1, 0.2]);
    let output = plan(&[], &format!("{grid}\n{asked}\n"));
    let answers = answers(&output);
    let times = numbers(&answers[0]["t"]);
    assert!(times.windows(2).all(|pair| (pair[1] - pair[0] - 0.01).abs() < 1e-12), "{times:?}");
    assert!((times[times.len() - 1] - answers[0]["duration"].as_f64().unwrap()).abs() < 1e-9);
    let last = numbers(&answers[0]["p"][times.len() - 1]);
    assert!((last[0] - 1.0).abs() < 1e-9 && (last[1] + 0.5).abs() < 1e-9, "{last:?}");
    assert_eq!(numbers(&answers[1]["t"]), [0.1, 0.2]);
    assert_eq!(answers[1]["p"].as_array().unwrap().len(), 2);
}

#[test]
fn the_help_has_every_key_of_a_problem() {
    let help = Command::new(env!("CARGO_BIN_EXE_takt")).args(["plan", "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    // A key that is not known is answered with all that are.
    let answer = &answers(&plan(&[], "{\"qqq\": 1}\n"))[0];
    let message = answer["message"].as_str().unwrap();
    let known: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
    let of_answers_alone = ["dofs", "family", "result", "duration", "t_min", "p", "v", "a"];
    assert!(known.contains(&"vmax"), "{message}");
    for key in known.into_iter().filter(|key| !of_answers_alone.contains(key)) {
        assert!(help.split([' ', ',', '\n']).any(|word| word == key), "{key} is not in\n{help}");
    }
}

#[test]
fn that_a_problem_has_no_answer_is_an_answer_with_a_name() {
    let mut beyond = problem();
    beyond["pf"] = json!([1.0, -1.5]);
    let output = plan(&[], &format!("{beyond}\n{}\n", problem()));
    assert_eq!(output.status.code(), Some(0));
    let answers = answers(&output);
    assert_eq!(answers[0]["result"], "position_beyond_limit");
    assert!(answers[0]["message"].as_str().unwrap().contains("axis 1"), "{}", answers[0]);
    assert_eq!(answers[1]["result"], "ok");
}

#[test]
fn a_line_that_is_no_problem_is_named_and_the_rest_is_answered() {
    let mut short = problem();
    short["vmax"] = json!([2.0]);
    let output = plan(&[], &format!("{}\nnonsense\n{short}\n{}\n", problem(), problem()));
    assert_eq!(output.status.code(), Some(2));
    let answers = answers(&output);
    let results: Vec<_> = answers.iter().map(|answer| answer["result"].as_str().unwrap()).collect();
    assert_eq!(results, ["ok", "malformed", "malformed", "ok"]);
    assert!(answers[1]["message"].as_str().unwrap().starts_with("line 2: "), "{}", answers[1]);
    assert!(answers[2]["message"].as_str().unwrap().starts_with("line 3: `vmax`"), "{}", answers[2]);
}

#[test]
fn a_misspelt_key_is_an_error_that_names_it_its_place_and_those_there_are() {
    let mut misspelt = problem();
    misspelt["jmx"] = json!([1.0, 1.0]);
    let output = plan(&[], &format!("{}\n{misspelt}\n", problem()));
    assert_eq!(output.status.code(), Some(2));
    let answers = answers(&output);
    assert_eq!((&answers[0]["result"], &answers[1]["result"]), (&json!("ok"), &json!("malformed")));
    let message = answers[1]["message"].as_str().unwrap();
    assert!(message.starts_with("line 2: unknown field `jmx`, expected one of "), "{message}");
    assert!(
        message.contains("`jmax`") && message.contains(" (column ") && !message.contains("line 1"),
        "{message}"
    );
}

/// `otg_oracle.py` writes the problem with its family, the number of axes, and Ruckig's answer, or why there is none.
#[test]
fn a_problem_with_a_known_answer_beside_it_is_a_problem_like_any_other() {
    let alone = json!({
        "id": 7, "interface": "position", "sync": "time", "dt": null, "min_duration": null,
        "p0": [0.0], "v0": [0.0], "a0": [0.0], "pf": [1.0], "vf": [0.0], "af": [0.0],
        "vmax": [2.0], "vmin": [-2.0], "amax": [8.0], "amin": [-8.0], "jmax": [null],
    });
    let mut answered = alone.clone();
    for (key, value) in [
        ("family", json!("second")),
        ("dofs", json!(1)),
        ("result", json!("ok")),
        ("duration", json!(0.75)),
        ("t_min", json!([0.75])),
        ("t", json!([0.0, 0.75])),
        ("p", json!([[0.0], [1.0]])),
        ("v", json!([[0.0], [0.0]])),
        ("a", json!([[8.0], [-8.0]])),
    ] {
        answered[key] = value;
    }
    let mut crashed = alone.clone();
    crashed["result"] = json!("crash");
    let output = plan(&[], &format!("{alone}\n{answered}\n{crashed}\n"));
    assert_eq!(output.status.code(), Some(0));
    let answers = answers(&output);
    assert_eq!((&answers[0]["result"], &answers[0]["duration"]), (&json!("ok"), &json!(0.75)));
    assert_eq!(answers[2], answers[0]);
    // The times of the known answer are those at which ours is sampled.
    assert_eq!(answers[1]["t"], answered["t"]);
    assert_eq!(
        (&answers[1]["duration"], &answers[1]["t_min"]),
        (&answers[0]["duration"], &answers[0]["t_min"])
    );
    answered["dofs"] = json!(6);
    let output = plan(&[], &answered.to_string());
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stdout).contains("`dofs` is 6, `p0` has 1 "));
}

#[test]
fn what_is_wrong_with_a_problem_is_said_with_its_key() {
    let with = |key: &str, value: Value| {
        let mut problem = problem();
        problem[key] = value;
        problem.to_string()
    };
    let cases = [
        (with("vmax", json!([2.0, 0.0])), "axis 1: `vmax` must be above 0"),
        (with("amin", json!([-1.0, 1.0])), "axis 1: `amin` must be below 0"),
        (with("jmax", json!([-1.0, null])), "axis 0: `jmax` must be above 0, or null for no limit"),
        (with("pmin", json!([null, 3.0])), "axis 1: `pmin` must be below `pmax`"),
        (with("vf", json!([3.0, 0.0])), "axis 0: the target cannot be reached within `vmax`"),
        (with("dt", json!(0.0)), "`dt` is not above 0"),
        (with("p0", json!([1e30, 0.0])), "axis 0: the numbers are too large or too small"),
        (with("sync", json!("tme")), "line 8: unknown variant `tme`, expected one of `time`, `phase`"),
        ("[0]".to_owned(), "line 9: a problem is no list"),
        ("7".to_owned(), "line 10: invalid type: integer `7`, expected a problem: {\"p0\""),
    ];
    let input: String = cases.iter().map(|(line, _)| format!("{line}\n")).collect();
    let answers = answers(&plan(&[], &input));
    assert_eq!(answers.len(), cases.len());
    for (answer, (_, words)) in answers.iter().zip(&cases) {
        assert!(answer["message"].as_str().unwrap().contains(words), "{answer} does not say {words:?}");
    }
}

#[test]
fn who_asks_one_problem_after_the_other_gets_each_answer_before_the_next() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("plan")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut questions, mut answers) =
        (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
    for _ in 0..3 {
        writeln!(questions, "{}", problem()).unwrap();
        let mut answer = String::new();
        answers.read_line(&mut answer).unwrap();
        assert!(answer.contains("\"ok\""), "{answer}");
    }
    drop(questions);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn answers_that_a_full_disk_has_swallowed_are_no_success() {
    let full = File::options().write(true).open("/dev/full").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let problems = folder.path().join("problems.jsonl");
    std::fs::write(&problems, format!("{}\n", problem())).unwrap();
    let output =
        Command::new(env!("CARGO_BIN_EXE_takt")).arg("plan").arg(problems).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("cannot be written to standard output: No space left"), "{said}");
}

#[test]
fn a_picture_that_is_not_drawn_is_said_and_costs_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().to_str().unwrap();
    let output = plan(&["--plot", inside], &format!("{}\n{}\n", problem(), problem()));
    assert_eq!((output.status.code(), answers(&output).len()), (Some(1), 2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.starts_with(&format!("takt: {inside} cannot be written: ")) && said.lines().count() == 1,
        "{said}"
    );
    let mut beyond = problem();
    beyond["pf"] = json!([1.0, -1.5]);
    let picture = folder.path().join("none.svg");
    let output = plan(&["--plot", picture.to_str().unwrap()], &beyond.to_string());
    assert_eq!(output.status.code(), Some(0));
    assert!(
        String::from_utf8_lossy(&output.stderr)
            .contains("none.svg is not written: there is no trajectory to plot")
    );
    assert!(!picture.exists());
}

#[test]
fn a_line_that_is_no_text_and_a_problem_without_axes_are_named_and_the_rest_is_answered() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("problems.jsonl");
    let lines =
        [b"\xFF\xFE".to_vec(), b"{\"p0\":[],\"vmax\":[],\"amax\":[]}".to_vec(), problem().to_string().into()];
    std::fs::write(&file, lines.join(&b'\n')).unwrap();
    let output = plan(&[file.to_str().unwrap()], "");
    assert_eq!(output.status.code(), Some(2));
    let answers = answers(&output);
    let results: Vec<_> = answers.iter().map(|answer| answer["result"].as_str().unwrap()).collect();
    assert_eq!(results, ["malformed", "malformed", "ok"]);
    assert!(answers[0]["message"].as_str().unwrap().starts_with("line 1: this is no text"), "{}", answers[0]);
    assert!(answers[1]["message"].as_str().unwrap().starts_with("line 2: `p0` is empty"), "{}", answers[1]);
}

#[test]
fn a_folder_in_place_of_a_file_is_named() {
    let output = plan(&["/"], "");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("takt: / cannot be read"));
}

#[test]
fn a_line_without_an_end_is_not_waited_for() {
    let output = plan(&["/dev/zero"], "");
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.starts_with("takt: /dev/zero cannot be read: a line does not end"), "{said}");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let output = plan(&["nowhere.jsonl"], "");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nowhere.jsonl"));
    assert_eq!(output.stdout, b"");
}

#[test]
fn the_picture_has_all_axes_and_their_limits() {
    let folder = tempfile::tempdir().unwrap();
    let (problems, picture) = (folder.path().join("two.jsonl"), folder.path().join("two.svg"));
    std::fs::write(&problems, format!("{}\n", problem())).unwrap();
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let output = plan(&[&text(&problems), "--plot", &text(&picture)], "");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let svg = std::fs::read_to_string(&picture).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    for panel in ["position", "velocity", "acceleration", "jerk"] {
        assert!(svg.contains(panel), "{panel}");
    }
    // Four quantities of two axes; two limits of each but the position, which only the second axis has.
    assert_eq!(svg.matches("<polyline").count(), 8);
    assert_eq!(svg.matches("stroke-dasharray").count(), 14);
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn a_velocity_target_that_is_only_reached_from_beyond_the_limit_is_refused() {
    let problem = |rest: &str| {
        format!("{{\"interface\":\"velocity\",\"p0\":[0],\"vmax\":[1],\"amax\":[1],\"jmax\":[1],{rest}}}\n")
    };
    let result = |rest: &str| answers(&plan(&[], &problem(rest)))[0]["result"].as_str().unwrap().to_owned();
    assert_eq!(result("\"vf\":[1],\"af\":[-0.5]"), "target_beyond_limit");
    assert_eq!(result("\"vf\":[-1],\"af\":[0.5]"), "target_beyond_limit");
    assert_eq!(result("\"vf\":[1]"), "ok");
    // Where the start is beyond the limit, or goes beyond it by itself, the way back is allowed.
    assert_eq!(result("\"v0\":[1.5],\"vf\":[1]"), "ok");
    assert_eq!(result("\"v0\":[0.9],\"a0\":[1],\"vf\":[0.5]"), "ok");
}
