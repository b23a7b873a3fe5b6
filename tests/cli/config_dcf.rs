//! `dcf` of an axis: a file beside the configuration, whose errors are shown at their lines.

use std::fs;
use std::path::Path;
use std::process::Command;

use takt::canopen::object::ObjectAddress;
use takt::config::{Config, ConfigError};

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
