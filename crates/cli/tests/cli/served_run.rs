//! `takt run --serve`: what its clients see when the program is killed or interrupted.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use takt::{CommandError, MotionError, MoveOptions, Phase, StopCategory, StreamError, WaitError};
use takt_remote::{Client, ConnectError, connect};
use tempfile::TempDir;

const LONG: Duration = Duration::from_secs(30);

/// A program that is killed at the latest when a test ends.
struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn path_in(folder: &TempDir) -> String {
    folder.path().join("arm").to_str().unwrap().to_owned()
}

/// `takt run --serve`, as a user starts it.
fn takt_serves(folder: &TempDir) -> Program {
    let child = Command::new(env!("CARGO_BIN_EXE_takt"))
        .args(["run", "../../configs/arm6-erob.toml", "--serve", &path_in(folder), "--record"])
        .arg(folder.path().join("run.mcap"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    Program(child.unwrap())
}

/// As soon as it is served.
fn connected(folder: &TempDir) -> Client {
    let begun = Instant::now();
    loop {
        match connect(&path_in(folder)) {
            Ok(client) => return client,
            Err(ConnectError::NotServed { .. }) if begun.elapsed() < LONG => {
                thread::sleep(Duration::from_millis(10));
            }
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn every_call_returns_when_the_process_of_the_controller_is_killed_and_a_new_one_is_found_again() {
    let folder = TempDir::new().unwrap();
    for alive_ms in [50, 70, 95, 120, 149] {
        let mut takt = takt_serves(&folder);
        let client = connected(&folder);
        thread::scope(|scope| {
            let commanding = scope.spawn(|| {
                // It may be killed before it has answered.
                match client.begin_stream() {
                    Ok(()) => {}
                    Err(CommandError::Ended) => return StreamError::Ended,
                    Err(error) => panic!("{error}"),
                }
                loop {
                    match client.stream().push_now(&[0.0; 6]) {
                        Ok(()) | Err(StreamError::Full) => {}
                        Err(error) => return error,
                    }
                }
            });
            let waiting = scope.spawn(|| client.wait_for(Phase::Moving, Duration::MAX));
            let listening = scope.spawn(|| {
                let mut events = client.events();
                loop {
                    if let Err(error) = events.wait(Duration::MAX) {
                        return error;
                    }
                }
            });
            thread::sleep(Duration::from_millis(alive_ms));
            takt.0.kill().unwrap();
            takt.0.wait().unwrap();
            assert_eq!(commanding.join().unwrap(), StreamError::Ended);
            assert_eq!(waiting.join().unwrap(), Err(WaitError::Ended));
            assert_eq!(listening.join().unwrap(), WaitError::Ended);
        });
        assert_eq!(client.stop(StopCategory::One), Err(CommandError::Ended));
        assert!(client.has_ended() && client.state().slot > 0, "the last state is still there");
        assert!(matches!(connect(&path_in(&folder)), Err(ConnectError::NotServed { .. })));
    }
}

#[test]
fn ctrl_c_brings_a_served_arm_to_rest_and_its_clients_are_told() {
    let folder = TempDir::new().unwrap();
    let mut takt = takt_serves(&folder);
    let client = connected(&folder);
    let motion = client.move_by(&[1.0, 1.0, 1.0, -1.0, 1.0, 1.0], MoveOptions::default()).unwrap();
    client.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    kill(Pid::from_raw(takt.0.id() as i32), Signal::SIGINT).unwrap();
    let Err(MotionError::Stopped(stopped)) = client.wait(motion, LONG) else { panic!("it has not stopped") };
    assert_eq!(stopped.reason.category, StopCategory::Two);
    assert_eq!(client.wait_for(Phase::Moving, LONG), Err(WaitError::Ended));
    assert_eq!(takt.0.wait().unwrap().code(), Some(130));
}

#[test]
fn a_name_is_in_a_folder_of_its_user_alone_and_is_claimed_before_anything_is_enabled() {
    let folder = TempDir::new().unwrap();
    let takt = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        command.env("XDG_RUNTIME_DIR", folder.path()).stdin(Stdio::null());
        command
    };
    let serve = |record: &str| {
        let mut command = takt();
        command
            .args(["run", "../../configs/first.toml", "--serve", "arm", "--record"])
            .arg(folder.path().join(record));
        command
    };
    let first = serve("first.mcap").stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let _first = Program(first.unwrap());
    let begun = Instant::now();
    let listed = || String::from_utf8(takt().args(["top", "--list"]).output().unwrap().stdout).unwrap();
    while !listed().lines().any(|name| name == "arm") {
        assert!(begun.elapsed() < LONG);
        thread::sleep(Duration::from_millis(50));
    }
    let names = fs::metadata(folder.path().join("takt")).unwrap();
    assert_eq!(names.permissions().mode() & 0o777, 0o700);
    let second = serve("second.mcap").output().unwrap();
    assert_eq!(second.status.code(), Some(2));
    assert!(!folder.path().join("second.mcap").exists(), "nothing was begun");
}
