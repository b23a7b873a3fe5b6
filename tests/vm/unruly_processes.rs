//! Clients in other processes that behave badly beside a served controller, for the jitter measurements of the laboratory.
//!
//! It has `takt run CONFIG --serve` as one process, and each client as another, of ordinary priority: one streams at 100 Hz and stalls
//! for a third of a second after every 0.7 s. One hands over chunks of points as fast as it can. Both take the lease from each other with every
//! call. One gives commands as fast as it can, all of which must be refused. Two observe without a pause. And one after another
//! streams, and is killed (`kill -9`) on the way. The program takes the arguments of `takt run`; TAKT names it. It ends with
//! an error if the group has stopped, or has not come to rest after the last client.

mod unruly_motion;

use std::error::Error;
use std::hint::black_box;
use std::process::{Child, Command};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use takt::StreamError;
use takt_remote::{Client, connect};
use takt_rt::StreamState;

use unruly_motion::{INTERVAL, Motion};

type Result<T = ()> = std::result::Result<T, Box<dyn Error>>;

/// A client that is killed lives so long.
const LIFE: Duration = Duration::from_millis(130);
/// Within this time the axes come to rest.
const TO_REST: Duration = Duration::from_secs(5);
/// What rounding may leave of the velocity of an axis at rest: rad/s (m/s).
const AT_REST: f64 = 1e-9;
/// The exit code of `takt run` after Ctrl-C.
const INTERRUPTED: i32 = 130;

fn main() -> Result {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.split_first() {
        Some((role, rest)) if role == "client" => client(rest),
        Some(_) => beside_clients(&arguments),
        None => Err("usage: unruly_processes CONFIG [--bus NAME=INTERFACE]... --duration S".into()),
    }
}

/// Processes that are killed when this ends, however it ends.
struct Clients(Vec<Child>);

impl Clients {
    fn kill(&mut self) -> Result {
        for mut client in self.0.drain(..) {
            // One that has ended by itself has failed.
            if let Some(status) = client.try_wait()? {
                return Err(format!("a client has ended: {status}").into());
            }
            client.kill()?;
            client.wait()?;
        }
        Ok(())
    }
}

impl Drop for Clients {
    fn drop(&mut self) {
        for client in &mut self.0 {
            let _ = client.kill();
            let _ = client.wait();
        }
    }
}

fn beside_clients(arguments: &[String]) -> Result {
    let (lasting, arguments) = without_duration(arguments)?;
    let name = format!("unruly-{}", std::process::id());
    let takt = std::env::var("TAKT").map_err(|_| "TAKT names no program")?;
    let mut takt = Command::new(takt).arg("run").args(arguments).args(["--serve", &name]).spawn()?;
    let result = beside(&name, &mut takt, lasting);
    kill(Pid::from_raw(takt.id().try_into()?), Signal::SIGINT)?;
    let status = takt.wait()?;
    result?;
    if status.code() == Some(INTERRUPTED) { Ok(()) } else { Err(format!("takt run: {status}").into()) }
}

/// Has the clients run, and waits until the axes have come to rest after them.
fn beside(name: &str, takt: &mut Child, lasting: Duration) -> Result {
    let watching = loop {
        match connect(name) {
            Ok(client) => break client,
            Err(_) if takt.try_wait()?.is_none() => thread::sleep(INTERVAL),
            Err(error) => return Err(error.into()),
        }
    };
    let home: Vec<String> =
        watching.state().axes().iter().map(|axis| axis.position_set.to_string()).collect();
    watching.begin_stream()?;
    watching.release()?;
    let (begun, begun_ns) = (Instant::now(), takt_remote::now_ns().to_string());
    let spawn = |role: &str| {
        Command::new(std::env::current_exe()?).args(["client", role, name, &begun_ns]).args(&home).spawn()
    };
    let roles = ["stream", "flood", "command", "observe", "observe"];
    let mut clients = Clients(roles.map(spawn).into_iter().collect::<std::io::Result<_>>()?);
    let mut killed = 0;
    while begun.elapsed() < lasting {
        clients.0.push(spawn("stream")?);
        thread::sleep(LIFE);
        if let Some(mut client) = clients.0.pop() {
            client.kill()?;
            client.wait()?;
            killed += 1;
        }
    }
    clients.kill()?;
    come_to_rest(&watching)?;
    let state = watching.state();
    if let Some(stop) = state.groups().iter().find_map(|group| group.stop) {
        return Err(format!("the group has stopped: {stop:?}").into());
    }
    println!(
        "{:?}, {} requests rejected, {killed} clients killed",
        watching.stream().report().counts,
        state.rejected
    );
    Ok(())
}

/// Without points the stream runs dry, and the axes come to rest.
fn come_to_rest(watching: &Client) -> Result {
    let until = Instant::now() + TO_REST;
    loop {
        let state = watching.next_cycle(TO_REST)?;
        let is_dry = state.groups().iter().all(|group| group.stream.state == StreamState::Dry);
        if is_dry && state.axes().iter().all(|axis| axis.velocity_set.abs() < AT_REST) {
            return Ok(());
        }
        if Instant::now() > until {
            let speeds: Vec<f64> = state.axes().iter().map(|axis| axis.velocity_set).collect();
            let report = watching.stream().report();
            return Err(format!("the axes have not come to rest: {speeds:?}, {report:?}").into());
        }
    }
}

/// One client, until it is killed.
fn client(arguments: &[String]) -> Result {
    let [role, name, begun_ns, home @ ..] = arguments else {
        return Err("client ROLE NAME BEGUN HOME...".into());
    };
    let motion =
        Motion { home: home.iter().map(|home| home.parse()).collect::<std::result::Result<_, _>>()? };
    let begun_ns: u64 = begun_ns.parse()?;
    let since = || Duration::from_nanos(takt_remote::now_ns().saturating_sub(begun_ns));
    let client = connect(name)?;
    match role.as_str() {
        "stream" => stream(&client, &motion, since),
        "flood" => flood(&client, &motion, since),
        "command" => command(&client, &motion),
        "observe" => observe(&client),
        role => Err(format!("there is no role {role}").into()),
    }
}

/// Streams for 0.7 s, and stalls for a third of a second.
fn stream(client: &Client, motion: &Motion, since: impl Fn() -> Duration) -> Result {
    loop {
        for _ in 0..70 {
            if let Err(StreamError::Lease(_)) = client.stream().push_now(&motion.after(since())) {
                let _ = client.take_over();
            }
            thread::sleep(INTERVAL);
        }
        thread::sleep(Duration::from_millis(333));
    }
}

/// Hands over the next fifth of a second, again and again.
fn flood(client: &Client, motion: &Motion, since: impl Fn() -> Duration) -> Result {
    loop {
        let chunk = motion.chunk(since());
        let pushed = client.stream().push_chunk(takt_remote::now_ns(), INTERVAL, &chunk);
        if let Err(StreamError::Lease(_)) = pushed {
            let _ = client.take_over();
        }
    }
}

/// Commands that must be refused: by the limits, by the mode, because the group streams, and without the lease.
fn command(client: &Client, motion: &Motion) -> Result {
    let far = vec![1e3; motion.home.len()];
    let none = vec![f64::NAN; motion.home.len()];
    loop {
        let taken = [
            client.move_to(&far).is_ok(),
            client.move_to(&none).is_ok(),
            client.velocity(0, 1.0, Duration::from_secs(1)).is_ok(),
            client.begin_stream().is_ok(),
            client.stream().push_now(&none).is_ok(),
        ];
        if taken.contains(&true) {
            return Err(format!("a command was taken that must be refused: {taken:?}").into());
        }
    }
}

fn observe(client: &Client) -> Result {
    loop {
        black_box(client.state());
        black_box(client.events().count());
    }
}

/// The duration, and the other arguments, which are those of `takt run`.
fn without_duration(arguments: &[String]) -> Result<(Duration, Vec<&String>)> {
    let (mut lasting, mut others) = (Duration::from_secs(2), vec![]);
    let mut arguments = arguments.iter();
    while let Some(argument) = arguments.next() {
        if argument == "--duration" {
            let value = arguments.next().ok_or("--duration needs a value")?;
            lasting = Duration::from_secs_f64(value.parse()?);
        } else {
            others.push(argument);
        }
    }
    Ok((lasting, others))
}
