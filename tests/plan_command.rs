//! `takt plan` as a user meets it: problems in, one a line, answers out.

use std::io::Write;
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
