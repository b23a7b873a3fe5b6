//! `takt eds` as a user meets it.

use std::path::{Path, PathBuf};
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
    // Of an object that takt works by.
    let odd = file(&ODD.replace("010", "fast").replace("2000", "1017"));
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

/// The data sheets of makers, and those of the project.
fn sheets() -> Vec<PathBuf> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["tests/eds/vendors", "configs/eds"].map(|folder| repository.join(folder));
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let mut sheets: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    sheets.retain(|path| path.extension().is_some_and(|extension| extension == "eds"));
    sheets.sort();
    sheets
}

#[test]
fn a_configuration_that_is_printed_is_one_that_check_accepts() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("arm.toml");
    let mut accepted = 0;
    for sheet in sheets() {
        let output = takt(&[sheet.to_str().unwrap(), "--config"]);
        if output.status.code() != Some(0) {
            // The mapping of these is fixed, and has no target.
            let words = String::from_utf8(output.stderr).unwrap();
            assert!(words.contains("in no mode") && words.contains("PDO mapping"), "{words}");
            assert_eq!((output.status.code(), output.stdout.as_slice()), (Some(2), &b""[..]));
            continue;
        }
        std::fs::write(&config, output.stdout).unwrap();
        let checked = Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(&config).output().unwrap();
        assert_eq!(checked.status.code(), Some(0), "{}", String::from_utf8_lossy(&checked.stdout));
        accepted += 1;
    }
    assert!(accepted >= 8, "{accepted}");
}

/// The data sheet of an eRob in which the keys of some sections have other values.
fn changed(changes: &[(&str, &str, &str)]) -> String {
    let mut sheet =
        std::fs::read_to_string(sheets().first().unwrap().with_file_name("erob-canopen.eds")).unwrap();
    for (section, key, value) in changes {
        let begin = sheet.find(&format!("[{section}]\n")).unwrap();
        let line = begin + sheet[begin..].find(&format!("\n{key}=")).unwrap() + 1;
        let end = line + sheet[line..].find('\n').unwrap();
        sheet.replace_range(line..end, &format!("{key}={value}"));
    }
    sheet
}

/// What `check` says of an axis with this data sheet, and its exit code.
fn checked(sheet: &str, keys: &str) -> (String, Option<i32>) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("drive.eds"), sheet).unwrap();
    let config = format!(
        "name = \"m\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"joint\"\nbus = \"can\"\nnode = 1\ndrive = \"cia402\"\n\
         eds = \"drive.eds\"\ncounts_per_turn = 524288\n{keys}\n\
         limits = {{ position = [-1, 1], velocity = 1, acceleration = 5, torque = 10 }}\n"
    );
    std::fs::write(folder.path().join("arm.toml"), config).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    let output =
        command.arg("check").arg(folder.path().join("arm.toml")).env("COLUMNS", "500").output().unwrap();
    (String::from_utf8([output.stdout, output.stderr].concat()).unwrap(), output.status.code())
}

#[test]
fn check_refuses_what_the_data_sheet_makes_impossible_and_names_the_object() {
    let fixed = [("1600sub0", "AccessType", "ro"), ("1600sub0", "DefaultValue", "2")];
    for (changes, words) in [
        (vec![("607A", "PDOMapping", "0")], "1600:02 (mapped object)"),
        (fixed.to_vec(), "no valid RPDO carries 607A:00"),
        (
            [&fixed[..], &[("1600sub2", "DefaultValue", "0x60FF0020")]].concat(),
            "no valid RPDO carries 607A:00",
        ),
        (vec![("1400sub1", "AccessType", "ro")], "1400:01"),
        (vec![("1400sub1", "PDOMapping", "0\nLowLimit=0\nHighLimit=0x7FF")], "1400:01"),
        (vec![("1017", "PDOMapping", "0\nLowLimit=0\nHighLimit=10")], "1017:00"),
        (vec![("6060", "AccessType", "ro")], "6060:00"),
    ] {
        let (text, exit) = checked(&changed(&changes), "heartbeat = \"100 ms\"");
        assert_eq!(exit, Some(2), "{changes:?}: {text}");
        assert!(
            text.contains("REFUSED: by their data sheets") && text.contains(words),
            "{changes:?}: {text}"
        );
    }
    assert_eq!(checked(&changed(&[]), "heartbeat = \"100 ms\"").1, Some(0));
}

#[test]
fn what_the_data_sheet_lets_takt_change_is_changed() {
    let fixed = [
        ("1600sub0", "AccessType", "ro"),
        ("1600sub0", "DefaultValue", "2"),
        ("1600sub2", "DefaultValue", "0x607A0020"),
        ("1A00sub0", "AccessType", "ro"),
        ("1A00sub0", "DefaultValue", "2"),
        ("1A00sub2", "DefaultValue", "0x60640020"),
        // The identifier of TPDO 1 of node 1, and the transmission type of the manufacturer.
        ("1400sub1", "DefaultValue", "0x181"),
        ("1800sub2", "DefaultValue", "254"),
    ];
    let (text, exit) = checked(&changed(&fixed), "");
    assert_eq!(exit, Some(0), "{text}");
    let read_only = [&fixed[..], &[("1400sub1", "AccessType", "ro")]].concat();
    let (text, exit) = checked(&changed(&read_only), "");
    assert_eq!(exit, Some(2), "{text}");
    assert!(text.contains("RPDO 1 has the identifier 0x181, expected 0x201"), "{text}");
    let (text, exit) = checked(&changed(&[("DeviceInfo", "VendorNumber", "0x123")]), "");
    assert_eq!(exit, Some(0), "{text}");
    assert!(text.contains("two numbers of its vendor or product: that of object 1018 is expected"), "{text}");
}

#[test]
fn a_data_sheet_that_is_not_there_is_said_so() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("arm.toml");
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/first.toml"))
            .unwrap();
    let drive = "drive = \"cia402\"\neds = \"axis.eds\"";
    std::fs::write(&config, text.replace("drive = \"erob-canopen\"", drive)).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("check")
        .arg(&config)
        .env("COLUMNS", "300")
        .output()
        .unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert!(words.contains("the file cannot be read: No such file or directory"), "{words}");
}
