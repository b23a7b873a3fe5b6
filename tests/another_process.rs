//! A controller that other processes observe and command. The other process is this test program itself, started with the name of one of
//! the ignored tests, or `takt run --serve`.

use std::env;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, geteuid};
use takt::internals::remote::{Demand, PACKET_WORDS, Packets, Received, Role};
use takt::{
    AxisPoint, Client, ClientStream, CommandError, Config, ConnectError, Controller, EventKind, LeaseError,
    MotionError, MoveOptions, OperationMode, Phase, RunningController, ServeError, ServeOptions, Server,
    SessionOptions, StopCategory, StreamError, StreamState, TrajectoryPoint, WaitError, connect, serve,
};
use takt_rt::RequestTarget;
use tempfile::TempDir;

const LONG: Duration = Duration::from_secs(30);
/// Names the controller for the other process.
const NAME: &str = "TAKT_TEST_SERVED";

fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
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
        let folder = TempDir::new().unwrap();
        let controller = Controller::start(config(name), SessionOptions::default()).unwrap();
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

#[test]
fn a_client_sees_and_moves_the_arm_with_the_calls_of_a_handle() {
    let served = Served::start("arm6-erob.toml");
    let client = served.connect();
    assert_eq!(client.machine(), served.controller.machine());
    for (number, axis) in served.controller.axes().iter().enumerate() {
        assert_eq!(client.limits(number), Some(axis.limits));
    }
    let (mut events, target) = (client.events(), moved(&client, 0.05));
    let motion = client.move_to(&target).unwrap();
    assert_eq!(client.wait(motion, LONG), Ok(()));
    assert_eq!(client.result_of(motion), Some(Ok(())));
    assert_eq!(positions(&client), target);
    let finished = EventKind::MotionFinished { request: motion.request() };
    while events.wait(LONG).unwrap().kind != finished {}
    assert_eq!(events.missed(), 0);

    let through = client.move_through(&[moved(&client, 0.02), moved(&client, -0.02)]).unwrap();
    assert_eq!(client.wait(through, LONG), Ok(()));
    let last = moved(&client, 0.05);
    let point = |time_s: f64, part: f64| TrajectoryPoint {
        time_s,
        positions: moved(&client, 0.05 * part),
        ..TrajectoryPoint::default()
    };
    // More points than a packet has room for.
    let points: Vec<TrajectoryPoint> = (0..=2000)
        .map(|number| {
            let part = f64::from(number) / 2000.0;
            point(3.0 * part, part * part * part * (10.0 - 15.0 * part + 6.0 * part * part))
        })
        .collect();
    let trajectory = client.execute(&points).unwrap();
    client.set_speed(trajectory, 0.5).unwrap();
    client.pause(trajectory).unwrap();
    client.resume(trajectory).unwrap();
    assert_eq!(client.wait(trajectory, LONG), Ok(()));
    for (position, last) in positions(&client).iter().zip(&last) {
        assert!((position - last).abs() < 1e-9, "{position} for {last}");
    }

    client.disable().unwrap();
    client.wait_for(Phase::Disabled, LONG).unwrap();
    client.enable().unwrap();
    client.wait_for(Phase::Holding, LONG).unwrap();
    let before = client.state().slot;
    assert!(client.cycle_after(before, LONG).unwrap().slot > before);

    served.controller.finish().unwrap();
    assert_eq!(client.wait_for(Phase::Moving, LONG), Err(WaitError::Ended));
    assert!(client.has_ended());
    assert_eq!(client.move_to(&target), Err(CommandError::Ended));
    assert_eq!(client.stop(StopCategory::Two), Err(CommandError::Ended));
    assert_eq!(client.next_cycle(LONG), Err(WaitError::Ended));
    while events.next().is_some() {}
    assert_eq!(events.wait(LONG), Err(WaitError::Ended));
}

#[test]
fn what_is_refused_has_the_same_words_as_in_the_own_process() {
    for name in ["arm6-erob.toml", "erob-modes/erob-pv.toml"] {
        let served = Served::start(name);
        let (client, own) = (served.connect(), &served.controller.handle());
        let axes = client.machine().axes.len();
        let here = positions(&client);
        let far: Vec<f64> = here.iter().map(|position| position + 1e3).collect();
        let point = |time_s: f64, positions: &[f64]| TrajectoryPoint {
            time_s,
            positions: positions.to_vec(),
            ..TrajectoryPoint::default()
        };
        let trajectories = [
            vec![],
            vec![point(0.0, &here), point(1.0, &here[1..])],
            vec![point(-1.0, &here)],
            vec![point(2.0, &here), point(1.0, &here)],
            vec![point(1.0, &vec![f64::NAN; axes])],
            vec![point(0.0, &far), point(1.0, &here)],
            vec![point(0.001, &far)],
            vec![TrajectoryPoint { velocities: vec![0.1; axes + 1], ..point(3.0, &here) }],
            vec![TrajectoryPoint { accelerations: vec![0.1; axes], ..point(3.0, &here) }],
        ];
        let motion = client.move_to(&here).unwrap();
        client.wait(motion, LONG).unwrap();
        let ask = |asked: &dyn RunningController| -> Vec<Option<String>> {
            let all = RequestTarget::All;
            let mut errors = vec![
                asked.begin_move(all, &far, MoveOptions::default()).err(),
                asked.begin_move(all, &[0.0; 40], MoveOptions::default()).err(),
                asked.velocity(0, 1e3, LONG).err(),
                asked.torque(0, f64::INFINITY, LONG).err(),
                asked.velocity(77, 0.1, LONG).err(),
                asked.change_axis_mode(99, OperationMode::Homing).err(),
                asked.set_speed(motion, 2.0).err(),
                asked.pause(motion).err(),
                asked.begin_enable(all).err(),
            ];
            errors.extend(trajectories.iter().map(|points| asked.begin_trajectory(all, points).err()));
            errors.extend([
                asked.begin_through(all, std::slice::from_ref(&far)).err(),
                asked.begin_through(all, &[]).err(),
            ]);
            let refused =
                asked.begin_move(all, &here, MoveOptions { velocity_scale: 7.0, ..MoveOptions::default() });
            let result = asked.wait(refused.unwrap(), LONG);
            let Err(MotionError::Refused(refused)) = result else { panic!("{name}: {result:?}") };
            errors.push(Some(refused.into()));
            // A number that is none is not equal to itself.
            errors.into_iter().map(|error| error.map(|error: CommandError| error.to_string())).collect()
        };
        let (of_client, of_handle) = (ask(&client), ask(own));
        assert_eq!(of_client, of_handle, "{name}");
        assert!(of_client.iter().all(Option::is_some), "{name}: {of_client:?}");
        let push = |asked: &dyn RunningController, entries: &[AxisPoint]| {
            asked.push_point(RequestTarget::All, 1, entries).err()
        };
        for entries in [
            vec![AxisPoint::default(); axes + 1],
            vec![AxisPoint::Torque(1.0); axes],
            vec![AxisPoint::position(0.0).with_torque(1.0); axes],
            vec![AxisPoint::position(0.0).with_impedance(-1.0, 0.0); axes],
        ] {
            let of_client = push(&client, &entries);
            assert!(of_client.is_some());
            assert_eq!(of_client, push(own, &entries), "{name}");
        }
        let NotFinite(of_client) = NotFinite::of(push(&client, &vec![f64::NAN.into(); axes]));
        assert_eq!(of_client, NotFinite::of(push(own, &vec![f64::NAN.into(); axes])).0);
    }
}

/// A refusal with a number that is not equal to itself.
struct NotFinite(String);

impl NotFinite {
    fn of(error: Option<StreamError>) -> Self {
        let error = error.unwrap();
        assert!(matches!(error, StreamError::Refused { point: 0, axis: 0, .. }), "{error}");
        Self(error.to_string())
    }
}

#[test]
fn groups_are_moved_apart_and_named_alike() {
    let served = Served::start("arm-and-gripper.toml");
    let client = served.connect();
    let arm = client.group("arm").unwrap();
    assert_eq!(arm.axes(), served.controller.group("arm").unwrap().axes());
    assert_eq!(client.group("leg").err(), served.controller.group("leg").err());
    let several = client.execute(&[]).unwrap_err();
    assert!(matches!(several, CommandError::SeveralGroups { .. }));
    assert_eq!(several, served.controller.execute(&[]).unwrap_err());
    let motion = arm.move_to(&[0.1, -0.1, 0.1]).unwrap();
    assert_eq!(arm.state().phase, served.controller.group("arm").unwrap().state().phase);
    client.group("gripper").unwrap().stop(StopCategory::Two).unwrap();
    assert_eq!(client.wait(motion, LONG), Ok(()));
    let motion = arm.move_to(&[0.5, -0.1, 0.1]).unwrap();
    client.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    arm.stop(StopCategory::Two).unwrap();
    assert!(matches!(client.wait(motion, LONG), Err(MotionError::Stopped(_))));
}

#[test]
fn a_stream_of_a_client_that_stops_sending_comes_to_rest_and_goes_on_without_a_stop() {
    let served = Served::start("arm6-erob.toml");
    let client = served.connect();
    client.begin_stream().unwrap();
    let (stream, home) = (client.stream(), positions(&client));
    let mut events = client.events();
    for _ in 0..2 {
        let begun = positions(&client);
        for number in 0..100 {
            let part = 0.05 * f64::from(number) / 100.0;
            let wanted: Vec<f64> = begun.iter().map(|position| position + part).collect();
            stream.push_now(&wanted).unwrap();
            thread::sleep(Duration::from_millis(2));
        }
        let dry = |kind: EventKind| kind == EventKind::Stream { state: StreamState::Dry };
        while !dry(events.wait(LONG).unwrap().kind) {}
        let at_rest = |state: &takt::Snapshot| {
            state.axes().iter().all(|axis| axis.velocity_set.abs() < 1e-9).then(|| state.groups()[0])
        };
        let group = client.wait_until(LONG, at_rest).unwrap();
        assert_eq!((group.phase, group.stop), (Phase::Streaming, None));
    }
    let gone = positions(&client).iter().zip(&home).all(|(now, then)| now - then > 0.05);
    assert!(gone && stream.report().counts.points >= 200);

    let chunk: Vec<Vec<f64>> = (0..300).map(|_| positions(&client)).collect();
    stream.push_chunk(ClientStream::now_ns(), Duration::from_millis(1), &chunk[..100]).unwrap();
    let too_many = vec![positions(&client); 20_000];
    assert_eq!(
        stream.push_chunk(ClientStream::now_ns(), Duration::from_millis(1), &too_many),
        Err(StreamError::Full)
    );
}

#[test]
fn one_client_commands_and_another_takes_over_only_explicitly() {
    let options = ServeOptions::default().with_lease(Duration::from_millis(300));
    let served = Served::with("arm6-erob.toml", options);
    let (first, second) = (served.connect(), served.connect());
    assert_eq!(first.lease(), None);
    let motion = first.move_to(&moved(&first, 0.3)).unwrap();
    first.next_cycle(LONG).unwrap();
    first.next_cycle(LONG).unwrap();
    assert_eq!(second.lease().map(|holder| holder.process), Some(std::process::id()));
    let held = second.move_to(&positions(&second)).unwrap_err();
    assert!(matches!(held, CommandError::Lease(LeaseError::Held { .. })), "{held}");
    assert!(matches!(second.stream().push_now(&[0.0; 6]), Err(StreamError::Lease(LeaseError::Held { .. }))));

    second.take_over().unwrap();
    let taken_over = Err(CommandError::Lease(LeaseError::TakenOver { process: std::process::id() }));
    assert_eq!(first.take_lease(), taken_over);
    assert_eq!(first.wait(motion, LONG), Ok(()), "what moves goes on, beyond the end of every lease");
    assert_eq!(second.lease(), None);
    assert_eq!(first.take_lease(), taken_over, "even when the lease is free");
    assert_eq!(second.take_lease(), Ok(()));
    second.release().unwrap();
    first.take_over().unwrap();
    assert_eq!(first.move_to(&positions(&first)).map(drop), Ok(()));

    first.release().unwrap();
    assert!(matches!(second.take_lease(), Err(CommandError::Lease(LeaseError::TakenOver { .. })) | Ok(())));
}

#[test]
fn a_thousand_clients_that_fight_for_the_lease_leave_one_that_commands() {
    let served = Served::start("single-erob.toml");
    let commanded = AtomicBool::new(false);
    thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..125 {
                    let client = served.connect();
                    client.take_over().unwrap();
                    match client.move_to(&positions(&client)) {
                        Ok(_) => commanded.store(true, Ordering::Relaxed),
                        Err(CommandError::Lease(
                            LeaseError::TakenOver { .. } | LeaseError::TooManyClients,
                        )) => {}
                        Err(error) => panic!("{error}"),
                    }
                }
            });
        }
    });
    assert!(commanded.load(Ordering::Relaxed));
    let last = served.connect();
    let motion = last.move_to(&moved(&last, 0.05)).unwrap();
    assert_eq!(last.wait(motion, LONG), Ok(()));
}

#[test]
fn any_client_stops_the_arm_without_the_lease_and_past_commands_that_wait() {
    let served = Served::start("arm6-erob.toml");
    let (commanding, other) = (served.connect(), served.connect());
    let motion = commanding.move_to(&moved(&commanding, 0.8)).unwrap();
    commanding.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    other.stop(StopCategory::Two).unwrap();
    let Err(MotionError::Stopped(stopped)) = commanding.wait(motion, LONG) else { panic!("no stop") };
    assert_eq!(stopped.reason.category, StopCategory::Two);
    commanding.wait_for(Phase::Holding, LONG).unwrap();
    assert!(matches!(other.take_lease(), Err(CommandError::Lease(LeaseError::Held { .. })) | Ok(())));

    // A flood of commands that are not received, on a connection of its own.
    let flooding =
        Packets::connect_as(Path::new(&format!("{}.command", served.name())), Role::Commands).unwrap();
    let mut number = 0;
    while flooding.send(&Demand::of(&[number, 1, 0]).unwrap().words()).is_ok() {
        number += 1;
    }
    let motion = commanding.take_over().and_then(|()| commanding.move_to(&moved(&commanding, 0.8))).unwrap();
    commanding.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    other.stop(StopCategory::Two).unwrap();
    assert!(matches!(commanding.wait(motion, LONG), Err(MotionError::Stopped(_))));
}

#[test]
fn a_name_is_served_once_and_again_after_its_end() {
    let mut served = Served::start("single-erob.toml");
    let again = serve(served.controller.handle(), &served.name(), ServeOptions::default());
    assert!(matches!(again, Err(ServeError::InUse { .. })));
    let client = served.connect();
    served.server = None;
    assert_eq!(client.move_to(&[0.0]), Err(CommandError::Ended));
    assert_eq!(client.next_cycle(LONG), Err(WaitError::Ended));
    assert!(matches!(connect(&served.name()), Err(ConnectError::NotServed { .. })));
    served.server = Some(serve(served.controller.handle(), &served.name(), ServeOptions::default()).unwrap());
    assert_eq!(client.move_to(&[0.0]), Err(CommandError::Ended), "it stays with the server that it knew");
    let motion = served.connect().move_to(&[0.01]).unwrap();
    assert_eq!(served.connect().wait(motion, LONG), Ok(()));
    for name in ["", "a b", "ä", "/", &"n".repeat(200)] {
        let refused = serve(served.controller.handle(), name, ServeOptions::default());
        assert!(matches!(refused, Err(ServeError::Name { .. })), "{name}");
        assert!(matches!(connect(name), Err(ConnectError::Name { .. })), "{name}");
    }
    let refused = serve(served.controller.handle(), "x", ServeOptions::default().with_mode(0o755));
    assert!(matches!(refused, Err(ServeError::Mode { .. })));
}

/// An ordinary user.
const NOBODY: u32 = 65_534;

#[test]
fn file_permissions_say_who_observes_and_who_commands() {
    // For root there are no permissions: another user observes then.
    let (mode, is_root) = if geteuid().is_root() { (0o604, true) } else { (0o400, false) };
    let served = Served::with("single-erob.toml", ServeOptions::default().with_mode(mode));
    let permissions =
        |end: &str| fs::metadata(format!("{}.{end}", served.name())).unwrap().permissions().mode() & 0o777;
    let expected = if is_root { [0o606, 0o600] } else { [0o600, 0] };
    assert_eq!([permissions("observe"), permissions("command")], expected);
    if !is_root {
        return only_observes(&served.connect());
    }
    fs::set_permissions(served.folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    let program = served.folder.path().join("another_process");
    fs::copy(env::current_exe().unwrap(), &program).unwrap();
    let mut other = Command::new("setpriv");
    other.args([format!("--reuid={NOBODY}"), format!("--regid={NOBODY}"), "--clear-groups".to_owned()]);
    let status = other
        .arg(program)
        .args(["--exact", "observe", "--ignored"])
        .env(NAME, served.name())
        .stdout(Stdio::null())
        .status()
        .unwrap();
    assert!(status.success());
    let closed = serve(
        served.controller.handle(),
        &format!("{}-closed", served.name()),
        ServeOptions::default().with_mode(0o200),
    );
    assert!(closed.is_ok());
}

fn only_observes(client: &Client) {
    assert!(client.next_cycle(LONG).unwrap().slot > 0);
    let refused = Err(CommandError::Lease(LeaseError::ReadOnly));
    assert_eq!(client.move_to(&[0.0]).map(drop), refused);
    assert_eq!(client.stop(StopCategory::Two), refused);
    assert_eq!(client.take_over(), refused);
}

#[test]
#[ignore = "it is the other process of another test"]
fn observe() {
    only_observes(&connect(&env::var(NAME).unwrap()).unwrap());
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

#[test]
fn clients_that_are_killed_at_any_instant_leave_a_controller_that_takes_commands() {
    let served = Served::start("arm6-erob.toml");
    let watching = served.connect();
    let mut random = Random(0x5EED);
    for round in 0..25 {
        let mut other = other_process("command_without_end", &served.name());
        let begun = served.connect();
        // From before its first command on.
        thread::sleep(Duration::from_millis(random.below(60)));
        if round % 2 == 0 {
            let _ = begun.wait_until(LONG, |_| begun.lease().map(drop));
            thread::sleep(Duration::from_micros(random.below(20_000)));
        }
        other.0.kill().unwrap();
        other.0.wait().unwrap();
        within_limits(&watching);
        let next = served.connect();
        next.take_over().unwrap();
        assert!(
            served.controller.state().groups[0].stop.is_none_or(|stop| stop.rule() == takt::Rule::Requested)
        );
        next.stop(StopCategory::Two).unwrap();
        // It is handed to the loop then, which takes it in one of these cycles.
        insist(&next, || next.take_lease());
        next.next_cycle(LONG).unwrap();
        next.next_cycle(LONG).unwrap();
        next.wait_for(Phase::Holding, LONG).unwrap();
        let motion = insist(&next, || next.move_to(&[0.0; 6]));
        assert_eq!(next.wait(motion, LONG), Ok(()), "round {round}");
        within_limits(&watching);
    }
    assert!(!served.controller.has_ended());
}

/// A command of a client that takes over again where it was taken over from. What a killed process has sent is whole, and may be carried
/// out after its end, its take-over too.
fn insist<T>(client: &Client, command: impl Fn() -> Result<T, CommandError>) -> T {
    loop {
        match command() {
            Err(CommandError::Lease(LeaseError::TakenOver { .. })) => client.take_over().unwrap(),
            done => return done.unwrap(),
        }
    }
}

#[test]
#[ignore = "it is the other process of another test"]
fn command_without_end() {
    let client = connect(&env::var(NAME).unwrap()).unwrap();
    let mut random = Random(u64::from(std::process::id()) << 20 | 1);
    client.take_over().unwrap();
    loop {
        let away = 0.2 * random.below(1000) as f64 / 1000.0 - 0.1;
        let target = vec![away; 6];
        let _ = match random.below(6) {
            0 => client.move_to(&target).map(drop),
            1 => client.move_through(&[vec![away / 2.0; 6], target]).map(drop),
            2 => {
                let point = TrajectoryPoint { time_s: 3.0, positions: target, ..TrajectoryPoint::default() };
                client.execute(&vec![point; 500]).map(drop)
            }
            3 => client.begin_stream(),
            4 => {
                let chunk: Vec<Vec<f64>> = (0..40).map(|_| target.clone()).collect();
                let _ = client.stream().push_chunk(ClientStream::now_ns(), Duration::from_millis(5), &chunk);
                Ok(())
            }
            _ => client.stop(StopCategory::Two),
        };
    }
}

#[test]
fn garbage_from_clients_leaves_the_arm_within_its_limits_and_stops_nothing() {
    let served = Served::start("arm6-erob.toml");
    let path = format!("{}.command", served.name());
    let path = Path::new(&path);
    let client = served.connect();
    client.begin_stream().unwrap();
    let mut random = Random(0xBAD);
    let mut words = [0; PACKET_WORDS];
    let (mut refused, mut answered) = (0, 0);
    let home = positions(&client);
    for round in 0..3000 {
        let role = if round % 8 == 0 { Role::Stops } else { Role::Commands };
        let Ok(connection) = Packets::connect_as(path, role) else { continue };
        let _ = connection.wait_at_most(LONG);
        for _ in 0..4 {
            let packet = garbage(&mut random, &home, role);
            if connection.send(&packet).is_err() {
                break;
            }
            if role == Role::Commands {
                match connection.receive(&mut words, true) {
                    Received::Words(_) => answered += 1,
                    Received::Nothing | Received::Closed => {
                        refused += 1;
                        break;
                    }
                }
            }
        }
        if round % 50 == 0 {
            within_limits(&client);
            let group = client.state().groups[0];
            assert_eq!(group.stop, None, "round {round}");
        }
    }
    assert!(refused > 300 && answered > 300, "{refused} were refused, {answered} answered");
    client.stop(StopCategory::Two).unwrap();
    client.take_over().unwrap();
    client.next_cycle(LONG).unwrap();
    client.next_cycle(LONG).unwrap();
    client.wait_for(Phase::Holding, LONG).unwrap();
    let motion = client.move_to(&[0.0; 6]).unwrap();
    assert_eq!(client.wait(motion, LONG), Ok(()));
}

/// Random words, or a command with some bits turned, neither of which may be a stop.
fn garbage(random: &mut Random, home: &[f64], role: Role) -> Vec<u64> {
    let of_length = |random: &mut Random, length: u64| (0..length).map(|_| random.next() | 1 << 40).collect();
    if role == Role::Stops || random.below(3) == 0 {
        let length = random.below(40);
        return of_length(random, length);
    }
    let axes: Vec<AxisPoint> =
        home.iter().map(|position| AxisPoint::position(position + 0.05 * random.below(100) as f64)).collect();
    // Neither disabling nor another mode.
    let mut words = match random.below(4) {
        0 => [vec![1, 12, 0, ClientStream::now_ns()], entries(&axes)].concat(),
        1 => [vec![2, 13, 0, ClientStream::now_ns(), 1_000_000, 1], entries(&axes)].concat(),
        2 => vec![3, 1, 1],
        _ => vec![4, 3, 0, 1f64.to_bits(), 1f64.to_bits(), 0, 6, 0, 0, 0, 0, 0, 0],
    };
    let kind = words[1];
    for _ in 0..random.below(4) {
        let at = random.below(words.len() as u64) as usize;
        words[at] ^= 1 << random.below(64);
    }
    words[1] = kind;
    words
}

fn entries(axes: &[AxisPoint]) -> Vec<u64> {
    let words = |point: &AxisPoint| {
        let AxisPoint::Position { motion, torque } = point else { unreachable!() };
        [0, motion.position.to_bits(), 0, 0, 0, 0, torque.to_bits()]
    };
    std::iter::once(axes.len() as u64).chain(axes.iter().flat_map(words)).collect()
}

/// `takt run --serve`, as a user starts it.
fn takt_serves(folder: &TempDir) -> Other {
    let child = Command::new(env!("CARGO_BIN_EXE_takt"))
        .args(["run", "configs/arm6-erob.toml", "--serve", &path_in(folder), "--record"])
        .arg(folder.path().join("run.mcap"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    Other(child.unwrap())
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
    let mut random = Random(0xD1E);
    for _ in 0..5 {
        let mut takt = takt_serves(&folder);
        let client = connected(&folder);
        thread::scope(|scope| {
            let commanding = scope.spawn(|| {
                client.begin_stream().unwrap();
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
            thread::sleep(Duration::from_millis(50 + random.below(100)));
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
    let motion = client.move_to(&moved(&client, 1.0)).unwrap();
    client.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    kill(Pid::from_raw(takt.0.id() as i32), Signal::SIGINT).unwrap();
    let Err(MotionError::Stopped(stopped)) = client.wait(motion, LONG) else { panic!("it has not stopped") };
    assert_eq!(stopped.reason.category, StopCategory::Two);
    assert_eq!(client.wait_for(Phase::Moving, LONG), Err(WaitError::Ended));
    assert_eq!(takt.0.wait().unwrap().code(), Some(130));
}
