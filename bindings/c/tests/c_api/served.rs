//! Programs in C and C++ that command a controller of another process. That process is this test program, started with the name of the
//! ignored test.

use std::env;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::library::{Installed, Library, MEMORY, THREADS, program};
use takt::config::Interface;
use takt::{Config, Controller, SessionOptions};
use takt_remote::ServeOptions;
use tempfile::TempDir;

const LONG: Duration = Duration::from_secs(60);
/// Names the configuration and the controller for the other process.
const CONFIGURATION: &str = "TAKT_TEST_CONFIGURATION";
const NAME: &str = "TAKT_TEST_SERVED";

/// The process of a controller, which is killed in the end.
struct Served {
    process: Child,
    folder: TempDir,
}

impl Served {
    /// One of simulated drives, when it is served.
    fn start(config: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let process = Command::new(env::current_exe().unwrap())
            .args(["--ignored", "--exact", "served::serves_a_controller_until_it_is_killed"])
            .env(NAME, name_in(&folder))
            .env(CONFIGURATION, Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(config))
            .stdout(Stdio::null())
            .spawn();
        let served = Self { process: process.unwrap(), folder };
        let begun = Instant::now();
        while let Err(error) = takt_remote::connect(&served.name()) {
            assert!(begun.elapsed() < LONG, "{error}");
            thread::sleep(Duration::from_millis(10));
        }
        served
    }

    fn name(&self) -> String {
        name_in(&self.folder)
    }

    fn kill(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // It has been killed, or a test has failed.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn name_in(folder: &TempDir) -> String {
    folder.path().join("arm").to_str().unwrap().to_owned()
}

#[test]
#[ignore = "it is the process of the controller, which others start"]
fn serves_a_controller_until_it_is_killed() {
    let mut config = Config::load(Path::new(&env::var_os(CONFIGURATION).unwrap())).unwrap();
    config.buses.iter_mut().for_each(|bus| bus.interface = Interface::Simulated);
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    let controller = Controller::start(config, SessionOptions::default()).unwrap();
    let options = ServeOptions::default().with_lease(LONG);
    let _server = takt_remote::serve(controller.handle(), &env::var(NAME).unwrap(), options).unwrap();
    loop {
        thread::park();
    }
}

#[test]
fn a_program_in_c_commands_a_controller_of_another_process_as_its_own_until_that_is_killed() {
    let takt = Installed::new();
    for sanitizer in [&MEMORY[..], &THREADS[..]] {
        // The compiler would take the processor from the loop.
        let compiled = takt.compile(&program("served.c"), sanitizer, Library::Shared);
        let mut served = Served::start("arm6-erob.toml");
        let mut command = takt.command(&[], &compiled, &served.name());
        let mut running = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(running.stdout.take().unwrap());
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        assert_eq!(line, "kill the controller\n", "{sanitizer:?}: it has ended before");
        thread::sleep(Duration::from_millis(100));
        served.kill();
        let mut last = String::new();
        said.read_to_string(&mut last).unwrap();
        assert!(running.wait().unwrap().success(), "{sanitizer:?}");
        assert_eq!(last, "the controller has ended\n");
    }
}

#[test]
fn a_program_in_cpp_commands_a_group_of_another_process_and_takes_it_over() {
    let takt = Installed::new();
    let compiled = takt.compile(&program("served.cpp"), &MEMORY, Library::Shared);
    let served = Served::start("arm-and-gripper.toml");
    let output = takt.command(&[], &compiled, &served.name()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("all that another process can do"), "{}", String::from_utf8_lossy(&output.stderr));
}
