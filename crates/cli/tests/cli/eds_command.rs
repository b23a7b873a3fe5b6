//! `takt eds` as a user meets it.

use std::process::{Command, Output};

use serde_json::Value;

fn takt(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("eds")
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap()
}

fn file(text: &str) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    file
}

const ODD: &str = "[2000]\nParameterName=Gain\nDataType=6\nAccessType=rw\nDefaultValue=010\n\
                   [ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n";

#[test]
fn a_file_in_order_is_printed_as_tables_for_its_node() {
    let output = takt(&["../../configs/eds/yz-aim.eds", "--node", "5"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
    assert!(text.contains("vendor 0x00000331, product 0x00000001, revision 0x00000100"), "{text}");
    assert!(text.contains("PDOs of node 5"), "{text}");
    let rpdo1 = text.lines().find(|line| line.contains("RPDO1  0x205")).unwrap();
    assert!(rpdo1.contains("6040:00") && rpdo1.contains("6060:00") && rpdo1.contains("607A:00"), "{rpdo1}");
    assert!(text.ends_with("55 objects, 109 entries\n"), "{text}");
}

#[test]
fn the_same_comes_as_one_json_object() {
    let output = takt(&["../../configs/eds/erob-canopen.eds", "--node", "2", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["identity"]["vendor"], 0x5A65_726F);
    assert_eq!(json["pdos"][5]["id"], 0x282);
    assert_eq!(json["pdos"][5]["is_valid"], false);
    assert_eq!(json["pdos"][5]["objects"][1]["name"], "Position actual value");
    assert_eq!(json["warnings"], Value::Array(vec![]));
}

#[test]
fn a_pdo_is_valid_or_not_whether_its_node_id_is_known_or_not() {
    let valid = |arguments: &[&str]| -> Vec<(Value, bool)> {
        let output = takt(&[&["../../configs/eds/erob-canopen.eds", "--json"], arguments].concat());
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        let pdos = json["pdos"].as_array().unwrap();
        pdos.iter().map(|pdo| (pdo["number"].clone(), pdo["is_valid"].as_bool().unwrap())).collect()
    };
    let known = valid(&["--node", "2"]);
    assert!(known.iter().any(|(_, is_valid)| *is_valid) && known.iter().any(|(_, is_valid)| !is_valid));
    assert_eq!(valid(&[]), known);
}

#[test]
fn a_repaired_file_is_printed_and_the_warning_shows_its_line() {
    let odd = file(ODD);
    let path = odd.path().to_str().unwrap();
    let output = takt(&[path]);
    let shown = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(String::from_utf8(output.stdout).unwrap().contains("1 objects, 1 entries, 1 warning"));
    assert!(shown.contains(":5:14") && shown.contains("DefaultValue=010"), "{shown}");
    let output = takt(&[path, "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["warnings"][0]["line"], 5);
    assert_eq!(json["warnings"][0]["source"], "DefaultValue=010");
    assert_eq!(json["objects"][0]["entries"][0]["default"], 8);
}

#[test]
fn a_file_that_cannot_be_used_ends_with_2() {
    let odd = file(&ODD.replace("010", "fast"));
    let path = odd.path().to_str().unwrap();
    let output = takt(&[path]);
    let shown = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), output.stdout.as_slice()), (Some(2), &b""[..]));
    assert!(shown.contains("is not a number: \"fast\"") && shown.contains(":5:14"), "{shown}");
    let output = takt(&[path, "--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(
        (&json["problems"][0]["severity"], &json["problems"][0]["line"]),
        (&"error".into(), &5.into())
    );
    assert_eq!(takt(&["no/such/file.eds"]).status.code(), Some(2));
    assert_eq!(takt(&["../../configs/eds/yz-aim.eds", "--node", "128"]).status.code(), Some(2));
}
