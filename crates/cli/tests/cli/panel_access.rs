//! Who may open the panel of `takt run --panel`: the token in the address that it prints, and files of tokens.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::open_page::get;

fn takt(folder: &TempDir) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command
        .args(["run", "../../configs/first.toml", "--panel", "127.0.0.1:0", "--record"])
        .arg(folder.path().join("run.mcap"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

#[test]
fn the_address_that_is_printed_has_the_token_that_the_panel_demands() {
    let folder = TempDir::new().unwrap();
    let mut program = takt(&folder).spawn().unwrap();
    let said = BufReader::new(program.stderr.take().unwrap()).lines().map_while(Result::ok);
    let printed = said.filter_map(|line| Some(line.split_once("http://")?.1.to_owned())).next().unwrap();
    let (address, token) = printed.split_once("/#token=").unwrap();
    let (address, token): (SocketAddr, _) = (address.parse().unwrap(), token.split(',').next().unwrap());
    assert_eq!(get(address, "/api/machine", "X-Takt-Panel: 1\r\n").0, 401);
    let headers = format!("X-Takt-Panel: 1\r\nAuthorization: Bearer {token}\r\n");
    assert_eq!(get(address, "/api/machine", &headers).0, 200);
    program.kill().unwrap();
    program.wait().unwrap();
}

#[test]
fn a_file_that_others_can_read_or_that_has_no_token_is_refused() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("token");
    let refusal = |file: &str| {
        let output = takt(&folder).args(["--panel-token", file]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{file}");
        String::from_utf8(output.stderr).unwrap()
    };
    fs::write(&file, "0123456789abcdef0123\n").unwrap();
    let name = file.to_str().unwrap();
    for mode in [0o644, 0o640, 0o606] {
        fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
        let said = refusal(name);
        assert!(said.contains("other users can read or write the token"), "{said}");
    }
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
    // Larger than any token, and no characters.
    fs::write(&file, vec![0; 1 << 20]).unwrap();
    let said = refusal(name);
    assert!(said.contains("not printable ASCII"), "{said}");
    assert!(refusal("/dev/zero").contains("a device"));
    let fifo = folder.path().join("fifo");
    nix::unistd::mkfifo(&fifo, nix::sys::stat::Mode::S_IRUSR).unwrap();
    let said = refusal(fifo.to_str().unwrap());
    assert!(said.contains("a FIFO (named pipe); only regular files are read"), "{said}");
}
