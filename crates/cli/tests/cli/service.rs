//! `takt run` beside a service manager and a scraper.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use takt::sim::pseudo_terminal::PseudoTerminal;
use tempfile::TempDir;

/// A run is ended when its test ends, however it does.
struct Run {
    child: Child,
    stderr: BufReader<ChildStderr>,
    /// By which it is served.
    name: PathBuf,
    _folder: TempDir,
}

impl Run {
    /// Serves the arm, with these arguments beside, and this environment.
    fn start(arguments: &[&str], environment: &[(&str, &str)]) -> Self {
        let folder = TempDir::new().unwrap();
        let name = folder.path().join("arm");
        let mut child = Command::new(env!("CARGO_BIN_EXE_takt"))
            .args(["run", "../../configs/arm6-erob.toml", "--serve", name.to_str().unwrap(), "--record"])
            .arg(folder.path().join("run.mcap"))
            .args(arguments)
            .env_remove("NOTIFY_SOCKET")
            .envs(environment.iter().copied())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        Self { child, stderr, name, _folder: folder }
    }

    fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.child.id().try_into().unwrap()), signal).unwrap();
    }

    /// The next line on standard error with this in it.
    fn line_with(&mut self, words: &str) -> String {
        loop {
            let mut line = String::new();
            assert!(self.stderr.read_line(&mut line).unwrap() > 0, "it has ended without {words:?}");
            if line.contains(words) {
                return line;
            }
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The messages of a run to its service manager, until one of them is this.
fn until(manager: &UnixDatagram, last: &str) -> Vec<String> {
    let mut messages = vec![];
    loop {
        let mut bytes = [0; 4096];
        let length = manager.recv(&mut bytes).unwrap_or_else(|_| panic!("no {last:?} after {messages:?}"));
        let text = str::from_utf8(&bytes[..length]).unwrap();
        messages.extend(text.lines().map(str::to_owned));
        if messages.iter().any(|message| message == last) {
            return messages;
        }
    }
}

#[test]
fn a_service_manager_is_told_when_the_arm_is_ready_that_it_lives_and_that_it_ends_and_nothing_after_that() {
    let folder = TempDir::new().unwrap();
    let socket = folder.path().join("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let environment = [("NOTIFY_SOCKET", socket.to_str().unwrap()), ("WATCHDOG_USEC", "300000")];
    let mut run = Run::start(&[], &environment);

    let before = until(&manager, "READY=1");
    let statuses: Vec<&String> = before.iter().filter(|message| message.starts_with("STATUS=")).collect();
    assert!(statuses.first().is_some_and(|status| status.contains("bring-up")), "{before:?}");
    let during: Vec<String> = (0..3).flat_map(|_| until(&manager, "WATCHDOG=1")).collect();
    assert!(!during.iter().any(|message| message == "STOPPING=1" || message == "READY=1"), "{during:?}");

    // A process that is stopped makes no cycles, and says nothing.
    run.signal(Signal::SIGSTOP);
    manager.set_read_timeout(Some(Duration::from_millis(700))).unwrap();
    while manager.recv(&mut [0; 4096]).is_ok() {}
    run.signal(Signal::SIGCONT);
    manager.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    run.signal(Signal::SIGTERM);
    until(&manager, "STOPPING=1");
    run.child.wait().unwrap();
    manager.set_nonblocking(true).unwrap();
    let mut rest = vec![];
    let mut bytes = [0; 4096];
    while let Ok(length) = manager.recv(&mut bytes) {
        rest.extend(str::from_utf8(&bytes[..length]).unwrap().lines().map(str::to_owned));
    }
    assert!(!rest.iter().any(|message| message == "READY=1" || message == "STOPPING=1"), "{rest:?}");
    manager.set_nonblocking(false).unwrap();
    manager.set_read_timeout(Some(Duration::from_millis(400))).unwrap();
    assert!(manager.recv(&mut bytes).is_err(), "a message of a process that is no more");
}

fn scrape(address: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    stream.write_all(b"GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n").unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

/// The value of a sample.
fn value(text: &str, sample: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(sample)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {sample} in\n{text}")).parse().unwrap()
}

#[test]
fn a_scraper_gets_the_histograms_of_every_cycle_and_the_state_of_axes_and_buses() {
    let mut run = Run::start(&["--metrics", "0"], &[]);
    let line = run.line_with("metrics at http://");
    let address = line.split("http://").nth(1).unwrap().trim().trim_end_matches("/metrics").to_owned();
    run.line_with("served by the name");
    let before = value(&scrape(&address), "takt_cycles_total");
    let text = loop {
        let text = scrape(&address);
        if value(&text, "takt_cycles_total") > before + 100.0 {
            break text;
        }
    };
    assert!(
        text.starts_with("HTTP/1.1 200 OK\r\ncontent-type: text/plain; version=0.0.4; charset=utf-8\r\n")
    );
    for histogram in ["takt_wake_seconds", "takt_sync_release_seconds", "takt_compute_seconds"] {
        let all = value(&text, &format!("{histogram}_count"));
        assert_eq!(all, value(&text, "takt_cycles_total"));
        assert_eq!(all, value(&text, &format!("{histogram}_bucket{{le=\"+Inf\"}}")));
        assert!(value(&text, &format!("{histogram}_sum")) > 0.0);
    }
    assert_eq!(value(&text, "takt_group_state{group=\"arm6-erob\",state=\"holding\"}"), 1.0);
    assert_eq!(value(&text, "takt_drive_state{axis=\"joint6\",state=\"operation enabled\"}"), 1.0);
    assert_eq!(value(&text, "takt_bus_state{bus=\"wrist\",interface=\"sim\",state=\"error active\"}"), 1.0);
    assert!(value(&text, "takt_bus_frames_total{bus=\"base\",direction=\"rx\"}") > 100.0);
    assert!(value(&text, "takt_bus_busy_seconds_total{bus=\"base\"}") > 0.0);
    let limit = 0.1;
    assert!(value(&text, "takt_axis_following_error_max{axis=\"joint1\",unit=\"rad\"}") < limit);
    run.signal(Signal::SIGTERM);
    run.child.wait().unwrap();
    assert!(TcpStream::connect(&address).is_err());
}

#[test]
fn an_address_that_is_in_use_or_none_is_refused_before_anything_moves() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for (address, words) in [(address.as_str(), "in use"), ("somewhere", "HOST:PORT")] {
        let output = Command::new(env!("CARGO_BIN_EXE_takt"))
            .args(["run", "../../configs/first.toml", "--metrics", address])
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && stderr.contains(words), "{stderr}");
    }
}

#[test]
fn the_view_in_the_terminal_needs_a_terminal() {
    let output =
        Command::new(env!("CARGO_BIN_EXE_takt")).args(["top", "arm"]).stdin(Stdio::null()).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && stderr.contains("needs a terminal"), "{stderr}");
}

#[test]
fn the_view_ends_when_its_terminal_is_closed() {
    let mut run = Run::start(&[], &[]);
    run.line_with("served by the name");
    let mut terminal = PseudoTerminal::open().unwrap();
    let end = || File::options().read(true).write(true).open(terminal.path()).unwrap();
    let mut view = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("top")
        .arg(&run.name)
        .env("TERM", "xterm")
        .stdin(end())
        .stdout(end())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let (mut shown, mut bytes) = (vec![], [0; 4096]);
    // It has changed to a screen of its own.
    while !shown.windows(8).any(|sequence| sequence == b"\x1b[?1049h") {
        assert_eq!(view.try_wait().unwrap(), None);
        terminal.wait(100_000_000);
        if let Ok(count) = terminal.read(&mut bytes) {
            shown.extend_from_slice(&bytes[..count]);
        }
    }
    drop(terminal);
    let closed = Instant::now();
    let ended = loop {
        match view.try_wait().unwrap() {
            None if closed.elapsed() < Duration::from_secs(60) => thread::sleep(Duration::from_millis(10)),
            ended => break ended,
        }
    };
    // Nothing of it is left behind, whatever has become of it.
    let _ = view.kill();
    assert_eq!(ended.map(|status| status.code()), Some(Some(1)), "it goes on without a terminal");
}
