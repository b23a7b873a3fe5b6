//! A controller that other processes observe and command. The other process is this test program itself, started with the name of one of
//! the ignored tests, or `takt run --serve`.

mod calls;
mod crowds;
mod deaths;
mod garbage;
mod lease;
mod names;
mod stops;

use std::env;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nix::unistd::geteuid;
use takt::{
    AnyHandle, AxisPoint, CommandError, Config, Controller, EventKind, LeaseError, MotionError, MoveOptions,
    OperationMode, Phase, Reply, SessionOptions, StopCategory, StreamError, StreamState, TrajectoryPoint,
    WaitError,
};
use takt_remote::packets::{
    Answer, Asked, Demand, PACKET_BYTES, Packets, Received, Replied, Role, StopRequest,
};
use takt_remote::{Client, ConnectError, ServeError, ServeOptions, Server, connect, now_ns, serve};
use takt_rt::{Frame, Id, RequestTarget};
use tempfile::TempDir;

const LONG: Duration = Duration::from_secs(30);
/// An ordinary user.
const NOBODY: u32 = 65_534;
/// Names the controller for the other process.
const NAME: &str = "TAKT_TEST_SERVED";

fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(name);
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

/// A controller that is served in a folder of its own.
struct Served {
    controller: Controller,
    server: Option<Server>,
    folder: TempDir,
}

impl Served {
    fn start(name: &str) -> Self {
        Self::with(name, ServeOptions::default())
    }

    fn with(name: &str, options: ServeOptions) -> Self {
        Self::with_config(config(name), options)
    }

    fn with_config(config: Config, options: ServeOptions) -> Self {
        let folder = TempDir::new().unwrap();
        let controller = Controller::start(config, SessionOptions::default()).unwrap();
        let path = path_in(&folder);
        let server = Some(serve(controller.handle(), &path, options).unwrap());
        Self { controller, server, folder }
    }

    fn name(&self) -> String {
        path_in(&self.folder)
    }

    fn connect(&self) -> Client {
        connect(&self.name()).unwrap()
    }

    /// This test program as another user, who may enter the folder and write into it. For root alone.
    fn other_user(&self, test: &str) -> Other {
        fs::set_permissions(self.folder.path(), fs::Permissions::from_mode(0o1777)).unwrap();
        let program = self.folder.path().join("another_process");
        fs::copy(env::current_exe().unwrap(), &program).unwrap();
        let mut other = Command::new("setpriv");
        other.args([format!("--reuid={NOBODY}"), format!("--regid={NOBODY}"), "--clear-groups".to_owned()]);
        other.arg(program).args(["--exact", test, "--ignored"]).env(NAME, self.name());
        Other(other.stdout(Stdio::null()).spawn().unwrap())
    }
}

fn path_in(folder: &TempDir) -> String {
    folder.path().join("arm").to_str().unwrap().to_owned()
}

fn positions(client: &Client) -> Vec<f64> {
    client.state().axes().iter().map(|axis| axis.position_set).collect()
}

/// So far away, to the other side where a limit is in the way.
fn moved(client: &Client, by: f64) -> Vec<f64> {
    let axes = positions(client).into_iter().enumerate();
    let beside = axes.map(|(number, position)| {
        let limits = client.limits(number).unwrap();
        let allowed = limits.position_min..=limits.position_max;
        if allowed.contains(&(position + by)) { position + by } else { position - by }
    });
    beside.collect()
}

/// The same numbers in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, end: u64) -> u64 {
        (self.next() >> 33) % end
    }
}

/// A process that is killed at the latest when a test ends.
struct Other(Child);

impl Drop for Other {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn other_process(test: &str, name: &str) -> Other {
    let child = Command::new(env::current_exe().unwrap())
        .args(["--exact", test, "--ignored", "--nocapture"])
        .env(NAME, name)
        .stdout(Stdio::null())
        .spawn();
    Other(child.unwrap())
}

/// The most that a set-point may be outside of the limits of an axis: what is left by rounding.
const ROUNDING: f64 = 1e-9;

fn within_limits(client: &Client) {
    for (number, axis) in client.state().axes().iter().enumerate() {
        let limits = client.limits(number).unwrap();
        let allowed = limits.position_min - ROUNDING..=limits.position_max + ROUNDING;
        assert!(allowed.contains(&axis.position_set), "{number}: {}", axis.position_set);
        assert!(
            axis.velocity_set.abs() <= limits.velocity * (1.0 + ROUNDING),
            "{number}: {}",
            axis.velocity_set
        );
    }
}
