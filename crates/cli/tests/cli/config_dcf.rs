//! `dcf` of an axis: a file beside the configuration, whose errors are shown at their lines.

use std::fs;
use std::path::Path;
use std::process::Command;

use takt::config::{Config, ConfigError};
use takt_wire::canopen::object::ObjectAddress;

const CONFIG: &str = r#"
name = "small"
[[bus]]
name = "left"
[[axis]]
name = "shoulder"
bus = "left"
node = 5
drive = "erob-canopen"
dcf = "shoulder.dcf"
[axis.limits]
position = [-1, 1]
velocity = 1
acceleration = 1
torque = 1
"#;

fn load(file: Option<&[u8]>) -> Result<Config, ConfigError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    fs::write(&path, CONFIG).unwrap();
    if let Some(file) = file {
        fs::write(folder.path().join("shoulder.dcf"), file).unwrap();
    }
    Config::load(&path)
}

fn message(file: Option<&[u8]>) -> String {
    let error = load(file).unwrap_err();
    assert_eq!(error.problems().len(), 1);
    assert_eq!(error.line(&error.problems()[0]), Some(10));
    format!("{:?}", miette::Report::new(error))
}

fn variable(value: &str) -> String {
    format!("[609A]\nParameterName=x\nDataType=7\nAccessType=rw\n{value}\n")
}

#[test]
fn a_file_is_read_from_the_folder_of_the_configuration_for_the_node_of_its_axis() {
    let config = load(Some(variable("ParameterValue=$NODEID+0x100").as_bytes())).unwrap();
    let configuration = config.axes[0].dcf.as_ref().unwrap();
    assert_eq!(configuration.path.file_name(), Path::new("shoulder.dcf").file_name());
    let [download] = configuration.downloads.as_slice() else { panic!("{configuration:?}") };
    assert_eq!(
        (download.object, download.data.as_slice()),
        (ObjectAddress::new(0x609A, 0), &[5, 1, 0, 0][..])
    );
}

#[test]
fn an_error_in_the_file_is_also_shown_at_its_own_line() {
    let shown = message(Some(variable("ParameterValue=fast").as_bytes()));
    for part in ["small.toml:10", "shoulder.dcf:5:16", "ParameterValue=fast", "is not a number"] {
        assert!(shown.contains(part), "no {part} in {shown}");
    }
}

#[test]
fn a_file_that_is_not_there_configures_nothing_or_is_for_another_node_is_refused() {
    assert!(message(None).contains("cannot be read"));
    assert!(message(Some(variable("DefaultValue=1").as_bytes())).contains("configures nothing"));
    let other = variable("ParameterValue=1") + "[DeviceComissioning]\nNodeID=6\n";
    assert!(message(Some(other.as_bytes())).contains("made for node 6, not for node 5"));
}

#[test]
fn takt_check_tells_what_of_the_file_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    fs::write(&path, CONFIG).unwrap();
    let file = variable("ParameterValue=1") + &variable("ParameterValue=15").replace("609A", "60FF");
    fs::write(folder.path().join("shoulder.dcf"), file).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(&path).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("shoulder: 1 writes from"), "{text}");
    assert!(
        text.contains("not written: 60FF:00 (a set-point, which only the controller may write)"),
        "{text}"
    );
}

/// The data sheet of a drive whose ramps are limited in jerk, and nothing else: profile jerk (60A4) instead of motion profile type (6086).
fn with_jerk(sheet: &str) -> String {
    let jerk = "[60A4]\nParameterName=Jerk\nObjectType=0x8\nSubNumber=2\n\n\
        [60A4sub0]\nParameterName=Count\nDataType=5\nAccessType=const\nDefaultValue=1\n\n\
        [60A4sub1]\nParameterName=Jerk 1\nDataType=7\nAccessType=rw\n\n";
    let (before, after) = sheet.split_once("[6086]").unwrap();
    let (_, after) = after.split_once("[6087]").unwrap();
    format!("{before}{jerk}[6087]{after}").replace("=0x6086", "=0x60A4")
}

/// What `takt check` prints of the configuration above with these changes, with a file that writes an object of 32 bits, and its exit code.
fn checked(changes: &[(&str, &str)], object: &str, value: &str) -> (String, Option<i32>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    let sheet = include_str!("../../../../configs/eds/erob-canopen.eds");
    fs::write(folder.path().join("jerk.eds"), with_jerk(sheet)).unwrap();
    let text = changes.iter().fold(CONFIG.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    fs::write(&path, text).unwrap();
    let file = variable(&format!("ParameterValue={value}")).replace("609A", object);
    let file = if object.starts_with("607D") { file.replace("DataType=7", "DataType=4") } else { file };
    fs::write(folder.path().join("shoulder.dcf"), file).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(&path).output().unwrap();
    // Lines of a diagnostic are broken and framed.
    let words = String::from_utf8(output.stderr).unwrap().replace(['│', '\n'], " ");
    (words.split_whitespace().collect::<Vec<_>>().join(" "), output.status.code())
}

const IN_PROFILE_VELOCITY: &[(&str, &str)] = &[("[axis.limits]", "mode = \"pv\"\n[axis.limits]")];
const BY_DATA_SHEET: &[(&str, &str)] = &[
    ("drive = \"erob-canopen\"", "drive = \"cia402\"\neds = \"EDS\"\ncounts_per_turn = 65536"),
    ("EDS", concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/eds/erob-canopen.eds")),
];

#[test]
fn takt_check_names_a_value_of_the_file_with_which_bring_up_would_refuse_the_drive() {
    let data_sheet_pv = [BY_DATA_SHEET, IN_PROFILE_VELOCITY].concat();
    for (changes, object, value, needed) in [
        (IN_PROFILE_VELOCITY, "60C6", "20000", "max deceleration"),
        (IN_PROFILE_VELOCITY, "6083", "2000000", "at most 83443 = 1 rad/s"),
        (IN_PROFILE_VELOCITY, "6084", "20000", "at least 83443 = 1 rad/s"),
        (IN_PROFILE_VELOCITY, "6085", "20000", "at least 83443"),
        (IN_PROFILE_VELOCITY, "607F", "20000", "or 0 for no bound"),
        (&data_sheet_pv, "60C6", "2000", "at least 10430 = 0.999964 rad/"),
        (&data_sheet_pv, "607Dsub1", "-10", "at most -10430 = "),
        (&[], "607Dsub2", "10", "at least 83443 = 1 rad"),
        (&[], "6080", "2", "at least 10 = 1.0472 rad/s"),
        (BY_DATA_SHEET, "6080", "2", "at least 10 = 1.0472 rad/s"),
    ] {
        let (text, code) = checked(changes, object, value);
        let object = object.replace("sub", ":0");
        for part in [
            "small.toml:10",
            "shoulder.dcf writes",
            &format!("{value} "),
            &object,
            needed,
            "\"shoulder\" needs",
        ] {
            let part = if changes.len() > 1 { part.trim_end_matches(":10") } else { part };
            assert!(text.contains(part), "{object}: {part} is not in: {text}");
        }
        assert_eq!(code, Some(2), "{text}");
    }
}

#[test]
fn takt_check_names_a_jerk_by_which_the_way_to_stop_is_longer_than_planned() {
    let (eds, counts) = ("eds = \"jerk.eds\"", "counts_per_turn = 65536\nmode = \"pv\"");
    let drive = format!("drive = \"cia402\"\n{eds}\n{counts}");
    let changes = [("drive = \"erob-canopen\"", drive.as_str())];
    let (text, code) = checked(&changes, "60A4sub1", "2000");
    for part in ["writes 2000 = 0.191748 rad/s^3 to 60A4:01 (profile jerk)", "\"shoulder\" needs at least "] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    assert_eq!(code, Some(2));
    for suits in ["0", "4000000"] {
        assert_eq!(checked(&changes, "60A4sub1", suits).1, Some(0), "{suits}");
    }
}

#[test]
fn takt_check_accepts_values_of_the_file_that_bring_up_accepts_or_overwrites() {
    let data_sheet_pv = [BY_DATA_SHEET, IN_PROFILE_VELOCITY].concat();
    for (changes, object, value) in [
        (IN_PROFILE_VELOCITY, "60C6", "83443"),
        (IN_PROFILE_VELOCITY, "60C6", "0"),
        (IN_PROFILE_VELOCITY, "60C5", "20000"),
        (IN_PROFILE_VELOCITY, "6085", "123456"),
        (IN_PROFILE_VELOCITY, "607Dsub1", "-83443"),
        // In modes that follow set-points, the drive plans nothing.
        (&[], "60C6", "20000"),
        (&[], "6084", "20000"),
        (&data_sheet_pv, "607Dsub1", "-100000"),
        (&[], "1017", "77"),
    ] {
        let (text, code) = checked(changes, object, value);
        assert_eq!(code, Some(0), "{object} = {value}: {text}");
    }
}
