//! The lock of an interface between processes: who is refused, what ends a lock, and how it is taken over. The other
//! process is this test program itself, started with the name of one of the ignored tests.

use std::env;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use nix::sys::socket::{AddressFamily, Backlog, SockFlag, SockType, UnixAddr, bind, connect, listen, socket};
use nix::unistd::{geteuid, getuid};
use takt::link::ownership::{InterfaceLock, LockError, Process, ReleaseError, Role, TakeOverError};
use tempfile::TempDir;

/// Names the interface for the other process.
const INTERFACE: &str = "TAKT_TEST_INTERFACE";
/// An ordinary user.
const NOBODY: u32 = 65_534;

/// A name that no other test and no other run of the tests has.
fn interface(test: &str) -> String {
    format!("test-{test}-{}", std::process::id())
}

struct Other {
    child: Child,
    said: BufReader<ChildStdout>,
}

impl Other {
    /// Starts one of the ignored tests as a process of its own.
    fn start(test: &str, interface: &str) -> Self {
        Self::started(Command::new(env::current_exe().unwrap()), test, interface)
    }

    /// As an ordinary user. Where the program lies may be closed to others, so a copy runs.
    fn start_as_nobody(folder: &TempDir, test: &str, interface: &str) -> Self {
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        let program = folder.path().join("interface_lock");
        // Not by `fs::copy`: the kernel's own copy of a running program was refused once as busy.
        fs::write(&program, fs::read(env::current_exe().unwrap()).unwrap()).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let mut command = Command::new("setpriv");
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups"]).arg(program);
        Self::started(command, test, interface)
    }

    fn started(mut command: Command, test: &str, interface: &str) -> Self {
        let mut child = command
            .args(["--exact", &format!("interface_lock::{test}"), "--ignored", "--nocapture"])
            .env(INTERFACE, interface)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let said = BufReader::new(child.stdout.take().unwrap());
        Self { child, said }
    }

    fn pid(&self) -> i32 {
        i32::try_from(self.child.id()).unwrap()
    }

    /// The next of its lines that is meant for us; the others are those of the test program.
    fn line(&mut self) -> String {
        loop {
            let mut line = String::new();
            assert!(self.said.read_line(&mut line).unwrap() > 0, "the other process has ended");
            if let Some((_, said)) = line.split_once("says: ") {
                return said.trim_end().to_owned();
            }
        }
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn say(words: &str) {
    println!("says: {words}");
    std::io::stdout().flush().unwrap();
}

fn take(role: Role) -> InterfaceLock {
    InterfaceLock::take(role, &env::var(INTERFACE).unwrap()).unwrap()
}

#[test]
#[ignore = "the other process of a test below"]
fn holder_that_obeys() {
    let mut lock = take(Role::Master);
    say("held");
    let process = loop {
        match lock.poll_release_request() {
            Some(process) => break process,
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    };
    say(&format!("asked by {}", process.pid));
    // The controlled stop.
    std::thread::sleep(Duration::from_millis(300));
    say("stopped");
}

#[test]
#[ignore = "the other process of a test below"]
fn holder_that_does_not_look() {
    let _lock = take(Role::Master);
    say("held");
    let _ = std::io::stdin().read_line(&mut String::new());
}

#[test]
#[ignore = "the other process of a test below"]
fn process_that_takes_over() {
    match InterfaceLock::take_over(Role::Master, &env::var(INTERFACE).unwrap()) {
        Ok(_) => say("taken over"),
        Err(error) => say(&format!("{error:?}")),
    }
}

/// A socket with the name of the lock.
fn squatting(interface: &str) -> (OwnedFd, UnixAddr) {
    let address = UnixAddr::new_abstract(format!("takt/master/{interface}").as_bytes()).unwrap();
    let socket = unix_socket();
    bind(socket.as_raw_fd(), &address).unwrap();
    (socket, address)
}

fn unix_socket() -> OwnedFd {
    socket(AddressFamily::Unix, SockType::Stream, SockFlag::SOCK_NONBLOCK, None).unwrap()
}

/// Connects until no further connection finds room.
fn fill(address: &UnixAddr) -> Vec<OwnedFd> {
    std::iter::from_fn(|| {
        let connecting = unix_socket();
        connect(connecting.as_raw_fd(), address).is_ok().then_some(connecting)
    })
    .collect()
}

#[test]
#[ignore = "the other process of a test below"]
fn squatter_that_does_not_listen() {
    let _squatting = squatting(&env::var(INTERFACE).unwrap());
    say("held");
    let _ = std::io::stdin().read_line(&mut String::new());
}

#[track_caller]
fn holder_of(interface: &str) -> Process {
    match InterfaceLock::take(Role::Master, interface) {
        Err(LockError::Held(process)) => process,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_second_master_is_refused_and_told_which_process_is_the_first() {
    let name = interface("second");
    let mut other = Other::start("holder_that_does_not_look", &name);
    assert_eq!(other.line(), "held");
    let holder = holder_of(&name);
    assert_eq!(holder, Process { pid: other.pid(), user: getuid().as_raw() });
    assert_eq!(holder.to_string(), format!("process {} (user {})", other.pid(), getuid()));
    assert!(InterfaceLock::take(Role::Master, &interface("elsewhere")).is_ok());
}

#[test]
fn a_lock_ends_with_its_process_whatever_ends_that() {
    let name = interface("killed");
    let mut other = Other::start("holder_that_does_not_look", &name);
    assert_eq!(other.line(), "held");
    holder_of(&name);
    other.child.kill().unwrap();
    other.child.wait().unwrap();
    let lock = InterfaceLock::take(Role::Master, &name).unwrap();
    assert_eq!(holder_of(&name).pid, i32::try_from(std::process::id()).unwrap());
    drop(lock);
    assert!(InterfaceLock::take(Role::Master, &name).is_ok());
}

#[test]
fn a_simulator_and_a_master_share_an_interface_and_two_simulators_do_not() {
    let name = interface("shared");
    let _master = InterfaceLock::take(Role::Master, &name).unwrap();
    let _simulator = InterfaceLock::take(Role::Simulator, &name).unwrap();
    assert!(matches!(InterfaceLock::take(Role::Simulator, &name), Err(LockError::Held(_))));
}

#[test]
fn a_lock_is_taken_over_when_the_holder_has_come_to_its_stop_and_not_before() {
    let name = interface("take-over");
    let mut other = Other::start("holder_that_obeys", &name);
    assert_eq!(other.line(), "held");
    let lock = InterfaceLock::take_over(Role::Master, &name).unwrap();
    // Whatever it has said is there by now: it has said it before it released the lock.
    assert_eq!(other.line(), format!("asked by {}", std::process::id()));
    assert_eq!(other.line(), "stopped");
    assert!(other.child.wait().unwrap().success());
    drop(lock);
}

#[test]
fn a_free_lock_is_taken_over_at_once() {
    assert!(InterfaceLock::take_over(Role::Master, &interface("free")).is_ok());
}

#[test]
fn a_holder_that_gives_no_answer_keeps_its_lock_and_is_named() {
    let name = interface("unanswered");
    let mut other = Other::start("holder_that_does_not_look", &name);
    assert_eq!(other.line(), "held");
    match InterfaceLock::take_over(Role::Master, &name) {
        Err(TakeOverError::NotReleased { holder, error }) => {
            assert_eq!((holder.pid, error), (other.pid(), ReleaseError::Unanswered));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(holder_of(&name).pid, other.pid());
}

#[test]
fn a_socket_with_the_name_that_accepts_no_connection_keeps_nobody_waiting_and_its_owner_is_named() {
    let name = interface("squatting");
    let (socket, address) = squatting(&name);
    let owner = Process { pid: i32::try_from(std::process::id()).unwrap(), user: geteuid().as_raw() };
    let check = || {
        let began = Instant::now();
        assert_eq!(holder_of(&name), owner);
        match InterfaceLock::take_over(Role::Master, &name) {
            Err(TakeOverError::NotReleased { holder, error: ReleaseError::Unanswered }) => {
                assert_eq!(holder, owner);
            }
            other => panic!("{other:?}"),
        }
        assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
    };
    check();
    listen(&socket, Backlog::new(0).unwrap()).unwrap();
    let connections = fill(&address);
    assert!(!connections.is_empty());
    check();
    drop((socket, connections));
    assert!(InterfaceLock::take(Role::Master, &name).is_ok());
}

#[test]
fn another_user_that_has_the_name_and_does_not_listen_is_named() {
    if !geteuid().is_root() {
        eprintln!("skipped: only root can start a process of another user");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let name = interface("stranger");
    let mut other = Other::start_as_nobody(&folder, "squatter_that_does_not_listen", &name);
    assert_eq!(other.line(), "held");
    assert_eq!(holder_of(&name), Process { pid: other.pid(), user: NOBODY });
}

/// Whoever only wanted to know the holder, or says nothing, keeps nobody from asking.
#[test]
fn a_request_is_found_among_connections_that_ask_for_nothing() {
    let name = interface("crowd");
    let mut lock = InterfaceLock::take(Role::Master, &name).unwrap();
    for _ in 0..40 {
        holder_of(&name);
    }
    assert_eq!(lock.poll_release_request(), None);
    let mut other = Other::start("process_that_takes_over", &name);
    let asking = loop {
        match lock.poll_release_request() {
            Some(process) => break process,
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    };
    assert_eq!(asking.pid, other.pid());
    drop(lock);
    assert_eq!(other.line(), "taken over");
}

#[test]
fn another_user_is_refused_too_and_may_not_have_the_holder_stopped() {
    if !geteuid().is_root() {
        eprintln!("skipped: only root can start a process of another user");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let name = interface("users");
    let mut lock = InterfaceLock::take(Role::Master, &name).unwrap();
    let mut other = Other::start_as_nobody(&folder, "process_that_takes_over", &name);
    let answer = std::thread::scope(|scope| {
        let answered = scope.spawn(|| other.line());
        while !answered.is_finished() {
            assert_eq!(lock.poll_release_request(), None);
            std::thread::sleep(Duration::from_millis(1));
        }
        answered.join().unwrap()
    });
    let own = Process { pid: i32::try_from(std::process::id()).unwrap(), user: 0 };
    assert_eq!(answer, format!("NotReleased {{ holder: {own:?}, error: Denied }}"));
    drop(lock);

    let mut other = Other::start_as_nobody(&folder, "holder_that_obeys", &name);
    assert_eq!(other.line(), "held");
    assert_eq!(holder_of(&name), Process { pid: other.pid(), user: NOBODY });
    assert!(InterfaceLock::take_over(Role::Master, &name).is_ok(), "root may");
}
