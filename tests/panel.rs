//! The panel's server, as a browser, another site and a lost page meet it. The page itself is driven in `tests/panel/`.

#[path = "panel/bench.rs"]
mod bench;

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use takt::internals::panel::{Listening, PAGES_AT_MOST, Panel, PanelError, PanelOptions};
use takt::{Config, Controller, FaultInjector, Phase, Scenario, SessionOptions, StopCategory};

const LONG: Duration = Duration::from_secs(30);
/// Speeds below this are rest: rad/s.
const REST: f64 = 1e-3;

fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

fn options(token: Option<&str>) -> PanelOptions {
    PanelOptions { address: "127.0.0.1:0".parse().unwrap(), token: token.map(str::to_owned), origins: vec![] }
}

/// A controller with its panel. The panel is dropped first.
struct Shown {
    panel: Panel,
    controller: Controller,
}

impl Shown {
    fn start(name: &str) -> Self {
        Self::with(config(name), SessionOptions::default(), &options(None))
    }

    fn with(config: Config, session: SessionOptions, options: &PanelOptions) -> Self {
        let listening = Listening::begin(options).unwrap();
        let controller = Controller::start(config, session).unwrap();
        let panel = listening.show(controller.handle(), None).unwrap();
        Self { panel, controller }
    }

    fn address(&self) -> SocketAddr {
        self.panel.address()
    }

    fn open(&self) -> Page {
        Page::open(self.address()).unwrap()
    }

    fn commander(&self) -> Page {
        let mut page = self.open();
        assert_eq!(page.control("take"), (200, json!({ "done": true })));
        page
    }

    fn until(&self, what: &str, mut is_so: impl FnMut(&takt::Snapshot) -> bool) {
        let begun = Instant::now();
        while !is_so(&self.controller.state()) {
            assert!(begun.elapsed() < LONG, "{what}: {:?}", self.controller.state().groups());
            thread::sleep(Duration::from_millis(2));
        }
    }

    fn until_phase(&self, phase: Phase) {
        self.until(&format!("{phase:?}"), |state| state.groups().iter().all(|group| group.phase == phase));
    }

    fn until_rest(&self) {
        self.until("rest", |state| state.axes().iter().all(|axis| axis.velocity_set.abs() < REST));
    }
}

/// Sends a request as it is, and reads the answer.
fn exchange(address: SocketAddr, request: &str) -> (u16, String, Value) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    // Where the answer comes before the whole request is there, the rest may find the connection closed.
    let _ = stream.write_all(request.as_bytes());
    let mut reader = BufReader::new(stream);
    let (status, head) = read_head(&mut reader).expect("no answer");
    let mut body = String::new();
    let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
    let length: u64 = length.map_or(0, |length| length.trim().parse().unwrap());
    reader.take(length).read_to_string(&mut body).unwrap();
    (status, head, serde_json::from_str(&body).unwrap_or(Value::String(body)))
}

fn read_head(reader: &mut impl BufRead) -> Option<(u16, String)> {
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if reader.read_line(&mut head).ok()? == 0 {
            return None;
        }
    }
    let status = head.split(' ').nth(1)?.parse().ok()?;
    Some((status, head.to_ascii_lowercase()))
}

fn get(address: SocketAddr, path: &str, headers: &str) -> (u16, String, Value) {
    exchange(
        address,
        &format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n{headers}Connection: close\r\n\r\n"),
    )
}

fn post(address: SocketAddr, path: &str, headers: &str, body: &str) -> (u16, String, Value) {
    let length = body.len();
    let own = "Content-Type: application/json\r\nX-Takt-Panel: 1\r\nConnection: close\r\n";
    exchange(
        address,
        &format!(
            "POST {path} HTTP/1.1\r\nHost: {address}\r\n{own}{headers}Content-Length: {length}\r\n\r\n{body}"
        ),
    )
}

/// An open page: it reads its stream, and confirms what comes, as long as it is to.
struct Page {
    address: SocketAddr,
    number: u64,
    key: String,
    sequence: u64,
    stream: TcpStream,
    confirms: Arc<AtomicBool>,
    messages: Arc<Mutex<VecDeque<(String, Value)>>>,
    reader: Option<JoinHandle<()>>,
}

impl Page {
    fn open(address: SocketAddr) -> Result<Self, (u16, Value)> {
        let stream = TcpStream::connect(address).unwrap();
        let request = format!("GET /api/states HTTP/1.1\r\nHost: {address}\r\nX-Takt-Panel: 1\r\n\r\n");
        (&stream).write_all(request.as_bytes()).unwrap();
        let mut reader = BufReader::new(stream.try_clone().unwrap());
        let (status, head) = read_head(&mut reader).unwrap();
        if status != 200 {
            return Err((status, Value::String(head)));
        }
        let mut greeting = vec![];
        while greeting.len() < 2 {
            let mut line = String::new();
            reader.read_line(&mut line).unwrap();
            if line.starts_with("event: ") || line.starts_with("data: ") {
                greeting.push(line);
            }
        }
        let page: Value = serde_json::from_str(greeting[1].trim_start_matches("data: ")).unwrap();
        let (number, key) = (page["number"].as_u64().unwrap(), page["key"].as_str().unwrap().to_owned());
        let (confirms, messages) = (Arc::new(AtomicBool::new(true)), Arc::<Mutex<VecDeque<_>>>::default());
        let (told, kept, own) = (Arc::clone(&confirms), Arc::clone(&messages), key.clone());
        let reader = thread::spawn(move || read(reader, address, &own, &told, &kept));
        Ok(Self { address, number, key, sequence: 0, stream, confirms, messages, reader: Some(reader) })
    }

    fn headers(&self) -> String {
        format!("X-Takt-Page: {}\r\n", self.key)
    }

    fn control(&mut self, what: &str) -> (u16, Value) {
        let (status, _, value) =
            post(self.address, "/api/control", &self.headers(), &json!({ "do": what }).to_string());
        (status, value)
    }

    fn command(&mut self, command: &Value) -> (u16, Value) {
        self.sequence += 1;
        let body = json!({ "number": self.sequence, "command": command }).to_string();
        let (status, _, value) = post(self.address, "/api/command", &self.headers(), &body);
        (status, value)
    }

    fn does(&mut self, command: &Value) {
        assert_eq!(self.command(command), (200, json!({ "done": true })), "{command}");
    }

    fn is_refused(&mut self, command: &Value, with: u16, key: &str) -> String {
        let (status, value) = self.command(command);
        assert_eq!((status, value["error"].as_str()), (with, Some(key)), "{command}: {value}");
        value["words"].as_str().unwrap().to_owned()
    }

    /// The next message of this kind.
    fn next(&self, kind: &str) -> Value {
        let begun = Instant::now();
        loop {
            let found = {
                let mut messages = self.messages.lock().unwrap();
                std::iter::from_fn(|| messages.pop_front()).find(|(name, _)| name == kind)
            };
            if let Some((_, value)) = found {
                return value;
            }
            assert!(begun.elapsed() < LONG, "no {kind} has come");
            thread::sleep(Duration::from_millis(5));
        }
    }

    fn newest_state(&self) -> Value {
        self.messages.lock().unwrap().clear();
        self.next("state")
    }

    /// The page is gone: its process is killed, its tab is closed.
    fn kill(mut self) {
        self.stream.shutdown(std::net::Shutdown::Both).unwrap();
        self.reader.take().unwrap().join().unwrap();
    }
}

fn read(
    mut reader: impl BufRead,
    address: SocketAddr,
    key: &str,
    confirms: &AtomicBool,
    messages: &Mutex<VecDeque<(String, Value)>>,
) {
    let (mut line, mut name, mut states) = (String::new(), String::new(), 0);
    while matches!(reader.read_line(&mut line), Ok(1..)) {
        if let Some(event) = line.trim_end().strip_prefix("event: ") {
            event.clone_into(&mut name);
        } else if let Some(data) = line.strip_prefix("data: ") {
            messages.lock().unwrap().push_back((name.clone(), serde_json::from_str(data).unwrap()));
            states += usize::from(name == "state");
            if states % 5 == 1 && name == "state" && confirms.load(Ordering::Relaxed) {
                // After the end of the panel nobody listens.
                let Ok(mut stream) = TcpStream::connect(address) else { return };
                let request = format!(
                    "POST /api/confirm HTTP/1.1\r\nHost: {address}\r\nX-Takt-Panel: 1\r\nX-Takt-Page: {key}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
                );
                let _ = stream.write_all(request.as_bytes());
                let _ = stream.read_to_end(&mut vec![]);
            }
        }
        line.clear();
    }
}

/// Holds a key for a velocity of the first axis until something is so. On a machine that is too busy to renew it in time, it is pressed again.
fn hold_until(shown: &Shown, page: &mut Page, velocity: f64, is_so: impl Fn(&takt::Snapshot) -> bool) {
    let (begun, mut is_held) = (Instant::now(), false);
    while !is_so(&shown.controller.state()) {
        assert!(begun.elapsed() < LONG, "{:?}", shown.controller.state().groups());
        let (status, value) = match is_held {
            true => page.command(&json!({ "do": "renew", "axis": 0, "value": velocity })),
            false => page.command(&jog(0, velocity)),
        };
        let words = value["words"].as_str().unwrap_or_default();
        // A busy machine misses slots as well, and begins no stream then.
        let is_late = value["error"] == "nothing_to_renew" || words.contains("slots were missed");
        assert!(status == 200 || value["error"] == "too_often" || is_late, "{value}");
        is_held = status == 200;
        thread::sleep(Duration::from_millis(40));
    }
}

fn jog(axis: usize, velocity: f64) -> Value {
    json!({ "do": "drive", "axis": axis, "quantity": "velocity", "value": velocity, "while": "held" })
}

#[test]
fn a_page_sees_the_machine_and_its_states() {
    let shown = Shown::start("arm-and-gripper.toml");
    let (status, _, machine) = get(shown.address(), "/api/machine", "X-Takt-Panel: 1\r\n");
    assert_eq!((status, &machine["name"]), (200, &json!("arm-and-gripper")));
    assert_eq!(machine["groups"][1], json!({ "name": "gripper", "axes": [3] }));
    assert_eq!(machine["axes"][0]["position_max"].as_f64(), Some(150f64.to_radians()));
    let page = shown.open();
    let state = page.next("state");
    assert_eq!(state["groups"][0]["phase"], "holding");
    assert_eq!((state["axes"][0]["mode"].as_i64(), state["axes"][3]["mode"].as_i64()), (Some(8), Some(4)));
    assert_eq!(state["axes"][0]["drive"], "operation enabled");
    assert_eq!((&state["commander"], state["pages"].as_u64()), (&Value::Null, Some(1)));
}

#[test]
fn every_file_of_the_page_is_there_and_may_load_nothing_from_elsewhere() {
    let shown = Shown::start("first.toml");
    let files = [
        "/",
        "/panel.css",
        "/panel.js",
        "/connection.js",
        "/texts.js",
        "/frame.js",
        "/units.js",
        "/axes.js",
        "/motion.js",
        "/plots.js",
    ];
    for path in files {
        let (status, head, text) = get(shown.address(), path, "");
        assert_eq!(status, 200, "{path}");
        assert!(head.contains("content-security-policy: default-src 'none'; script-src 'self'"), "{head}");
        assert!(head.contains("frame-ancestors 'none'") && head.contains("nosniff"), "{head}");
        let text = text.as_str().unwrap();
        assert!(!text.contains("http://") && !text.contains("https://"), "{path} names another server");
    }
    let (_, _, page) = get(shown.address(), "/", "");
    let page = page.as_str().unwrap();
    assert!(!page.contains("style=") && !page.contains("onclick") && !page.contains("<script>"), "{page}");
    assert_eq!(get(shown.address(), "/other", "").0, 404);
}

#[test]
fn another_site_is_refused_by_its_host_its_origin_and_its_missing_header() {
    let shown = Shown::start("first.toml");
    let address = shown.address();
    let rebound =
        format!("GET / HTTP/1.1\r\nHost: evil.example:{}\r\nConnection: close\r\n\r\n", address.port());
    let (status, _, value) = exchange(address, &rebound);
    assert_eq!((status, &value["error"]), (403, &json!("site")));
    for origin in ["http://evil.example", "http://localhost:1", "null"] {
        let stop = r#"{"category":2}"#;
        let (status, _, value) = post(address, "/api/stop", &format!("Origin: {origin}\r\n"), stop);
        assert_eq!((status, &value["error"]), (403, &json!("site")), "{origin}");
    }
    let (status, _, value) = get(address, "/api/states", "");
    assert_eq!((status, &value["error"]), (403, &json!("header")), "a foreign page can ask without a header");
    let plain = format!(
        "POST /api/stop HTTP/1.1\r\nHost: {address}\r\nX-Takt-Panel: 1\r\nContent-Type: text/plain\r\nContent-Length: 14\r\nConnection: close\r\n\r\n{{\"category\":2}}"
    );
    assert_eq!(exchange(address, &plain).0, 415);
    let own = format!("Origin: http://{address}\r\n");
    assert_eq!(post(address, "/api/stop", &own, r#"{"category":2}"#).0, 200);
}

#[test]
fn a_panel_that_others_can_reach_needs_a_token_and_takes_nothing_without_it() {
    let open = PanelOptions { address: "0.0.0.0:0".parse().unwrap(), token: None, origins: vec![] };
    assert!(matches!(Listening::begin(&open), Err(PanelError::NoToken { .. })));
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let same = PanelOptions { address: taken.local_addr().unwrap(), token: None, origins: vec![] };
    let error = Listening::begin(&same).err().unwrap().to_string();
    assert!(error.contains("another program does"), "{error}");

    let token = "0123456789abcdef0123";
    let everywhere = PanelOptions { token: Some(token.to_owned()), ..open };
    let shown = Shown::with(config("first.toml"), SessionOptions::default(), &everywhere);
    let address = SocketAddr::from(([127, 0, 0, 1], shown.address().port()));
    assert_eq!(get(address, "/", "").0, 200, "the page itself is no secret");
    for wrong in ["", "Authorization: Bearer 0123456789abcdef\r\n", "Authorization: Basic x\r\n"] {
        let (status, head, value) = post(address, "/api/stop", wrong, r#"{"category":2}"#);
        assert_eq!((status, &value["error"]), (401, &json!("token")), "{wrong}");
        assert!(head.contains("www-authenticate: bearer"), "{head}");
        assert_eq!(get(address, "/api/states", &format!("X-Takt-Panel: 1\r\n{wrong}")).0, 401);
    }
    let right = format!("Authorization: Bearer {token}\r\n");
    assert_eq!(post(address, "/api/stop", &right, r#"{"category":2}"#).0, 200);
}

#[test]
fn one_page_commands_and_everyone_may_stop() {
    let shown = Shown::start("arm6-erob.toml");
    let (mut first, mut second) = (shown.open(), shown.open());
    let words = first.is_refused(&json!({ "do": "disable" }), 409, "not_commander");
    assert!(words.contains("take command first"), "{words}");
    assert_eq!(first.control("take").0, 200);
    assert_eq!(second.control("take").0, 409);
    let words = second.is_refused(&json!({ "do": "disable" }), 409, "not_commander");
    assert!(words.contains(&format!("page {} does", first.number)), "{words}");

    let axis = json!({ "do": "move", "axis": 0, "to": 1.0, "relative": false, "velocity": 0.2, "acceleration": 0.5 });
    first.does(&axis);
    shown.until_phase(Phase::Moving);
    // Neither command nor a connection is needed for a stop.
    assert_eq!(post(shown.address(), "/api/stop", "", r#"{"category":2}"#).0, 200);
    shown.until_phase(Phase::Holding);
    let reached = shown.controller.state().axes[0].position_set;
    assert!((0.0..0.9).contains(&reached.abs()), "{reached}");

    first.does(&axis);
    shown.until_phase(Phase::Moving);
    assert_eq!(second.control("take_over").0, 200);
    shown.until_phase(Phase::Holding);
    first.is_refused(&axis, 409, "not_commander");
    second.does(&json!({ "do": "disable" }));
    shown.until_phase(Phase::Disabled);
    second.does(&json!({ "do": "enable" }));
    shown.until_phase(Phase::Holding);
    assert_eq!(second.newest_state()["commander"].as_u64(), Some(second.number));
}

#[test]
fn an_axis_moves_to_a_position_by_a_distance_to_and_fro_and_with_its_group() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    let set = |axis: usize| shown.controller.state().axes[axis].position_set;
    let others = set(1);
    page.does(&json!({ "do": "move", "axis": 0, "to": 0.1, "relative": false, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until("0.1", |state| state.axes[0].position_set == 0.1 && state.groups[0].phase == Phase::Holding);
    page.does(&json!({ "do": "move", "axis": 0, "to": -0.05, "relative": true, "velocity": 1.0, "acceleration": 1.0 }));
    let is_there = |state: &takt::Snapshot| (state.axes[0].position_set - 0.05).abs() < 1e-9;
    shown.until("0.05", |state| is_there(state) && state.groups[0].phase == Phase::Holding);
    assert_eq!(set(1), others);

    page.does(&json!({ "do": "reciprocate", "axis": 0, "between": [0.0, 0.1], "velocity": 1.0, "acceleration": 1.0 }));
    for _ in 0..2 {
        shown.until("one end", |state| state.axes[0].position_set < 0.01);
        shown.until("the other end", |state| state.axes[0].position_set > 0.09);
    }
    page.does(&json!({ "do": "release", "axis": 0 }));
    shown.until_phase(Phase::Holding);

    let to: Vec<f64> = (0..6).map(|axis| set(axis) + if axis == 0 { -0.02 } else { 0.0 }).collect();
    page.does(&json!({ "do": "move_group", "group": 0, "to": to, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until("the group", |state| state.axes[0].position_set == to[0]);

    let beyond = json!({ "do": "move", "axis": 0, "to": 9.0, "relative": false, "velocity": 1.0, "acceleration": 1.0 });
    let words = page.is_refused(&beyond, 409, "refused");
    assert!(words.contains("joint1") && words.contains("not within its limits"), "{words}");
    let wrong_group =
        json!({ "do": "move_group", "group": 3, "to": to, "velocity": 1.0, "acceleration": 1.0 });
    assert!(page.is_refused(&wrong_group, 409, "refused").contains("there is no group 3"));
    let too_fast =
        json!({ "do": "move", "axis": 0, "to": 0.0, "relative": true, "velocity": 3.0, "acceleration": 1.0 });
    assert!(page.is_refused(&too_fast, 409, "refused").contains("fraction of the velocity limits"));
    let no_axis = json!({ "do": "release", "axis": 0, "extra": 1 });
    assert!(page.is_refused(&no_axis, 400, "malformed").contains("unknown field"));
}

#[test]
fn a_held_key_moves_the_axis_and_it_comes_to_rest_when_it_is_not_renewed() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    let moves = |state: &takt::Snapshot| {
        state.groups[0].phase == Phase::Streaming && (state.axes[0].velocity_set - 0.2).abs() < 0.01
    };
    hold_until(&shown, &mut page, 0.2, moves);
    assert!(shown.controller.state().axes[1].velocity_set.abs() < REST);
    // The page is there, and renews nothing.
    shown.until_phase(Phase::Holding);
    page.is_refused(&json!({ "do": "renew", "axis": 0, "value": 0.2 }), 409, "nothing_to_renew");
    hold_until(&shown, &mut page, -0.2, |state| state.axes[0].velocity_set < -0.19);
    page.does(&json!({ "do": "release", "axis": 0 }));
    // The next one begins when the axis is at rest, without a word.
    hold_until(&shown, &mut page, 0.2, |state| state.axes[0].velocity_set > 0.19);
    page.does(&json!({ "do": "release", "axis": 0 }));
    shown.until_phase(Phase::Holding);
}

#[test]
fn a_page_that_is_killed_or_hangs_leaves_the_arm_at_rest() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    // It goes on until it is ended, so that the loss of the page alone ends it.
    let mut open = jog(0, 0.1);
    open["while"] = json!("open");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity_set > 0.09);
    page.kill();
    shown.until_phase(Phase::Holding);

    let mut page = shown.commander();
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity_set > 0.09);
    // Its connection stands, but nothing is read at its other end.
    page.confirms.store(false, Ordering::Relaxed);
    shown.until_phase(Phase::Holding);
    page.is_refused(&open, 409, "not_present");
    page.confirms.store(true, Ordering::Relaxed);
    shown.until("presence", |_| page.command(&open).0 == 200);

    // The attempts above have used up what the page may ask in a second.
    let far = json!({ "do": "move", "axis": 0, "to": -1.0, "relative": false, "velocity": 0.1, "acceleration": 0.5 });
    shown.until("allowance", |_| page.command(&far).0 == 200);
    shown.until_phase(Phase::Moving);
    page.kill();
    shown.until_phase(Phase::Holding);
    assert!(shown.controller.state().axes[0].position_set > -0.9, "a move ends with its page as well");
}

#[test]
fn a_stop_of_anyone_ends_what_is_held_and_nothing_renews_it() {
    let shown = Shown::start("erob-modes/erob-pv.toml");
    let mut page = shown.commander();
    let mut open = jog(0, 0.2);
    open["while"] = json!("open");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity > 0.15);
    shown.controller.stop(StopCategory::Two).unwrap();
    shown.until_phase(Phase::Holding);
    let state = page.newest_state();
    assert_eq!(state["groups"][0]["stop"]["is_fault"], false, "{state}");
    page.is_refused(&json!({ "do": "renew", "axis": 0, "value": 0.2 }), 409, "nothing_to_renew");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity > 0.15);
    let stop = json!({ "category": 1, "number": page.sequence + 5 }).to_string();
    assert_eq!(post(shown.address(), "/api/stop", &page.headers(), &stop).0, 200);
    shown.until_phase(Phase::Disabled);
    page.is_refused(&open, 409, "overtaken");
    page.sequence += 10;
    page.is_refused(&open, 409, "refused");
}

#[test]
fn what_a_mode_does_not_take_is_refused_by_its_name() {
    let shown = Shown::start("arm-and-gripper.toml");
    let mut page = shown.commander();
    let torque = |axis: usize| json!({ "do": "drive", "axis": axis, "quantity": "torque", "value": 1.0, "while": "held" });
    let words = page.is_refused(&torque(0), 409, "refused");
    assert!(words.contains("base is in cyclic synchronous position, which takes no torque"), "{words}");
    let words = page.is_refused(&jog(3, 0.1), 409, "refused");
    assert!(words.contains("finger is in profile torque, which takes no velocity"), "{words}");
    page.does(&torque(3));
    shown.until("torque", |state| state.axes[3].velocity > 0.01);
    assert_eq!(shown.controller.state().groups[0].phase, Phase::Holding, "the arm stays");
    hold_until(&shown, &mut page, 0.1, |state| state.axes[0].velocity_set > 0.05);
    // The gripper stops with the arm, as its configuration says.
    shown.until("rest", |state| {
        state.groups[0].phase == Phase::Holding && state.groups[1].phase == Phase::Disabled
    });
    let words = page.is_refused(&jog(9, 0.1), 409, "refused");
    assert!(words.contains("there is no axis 9"), "{words}");
    assert!(
        page.is_refused(&json!({ "do": "change_mode", "axis": 0, "mode": 77 }), 409, "refused")
            .contains("no mode 77")
    );
}

#[test]
fn a_fault_is_told_with_its_words_and_is_cleared_by_the_page() {
    let config = config("arm6-erob.toml");
    let alarm =
        "[[fault]]\nkind = \"alarm\"\naxis = \"joint2\"\ncode = 0x4310\nwhen = \"moving\"\nat = \"200 ms\"\n";
    let injector = FaultInjector::new(Scenario::parse("alarm", alarm, &config).unwrap());
    let session = SessionOptions { fault_injector: Some(Arc::new(injector)), ..SessionOptions::default() };
    let shown = Shown::with(config, session, &options(None));
    let mut page = shown.commander();
    page.does(&json!({ "do": "move", "axis": 1, "to": 0.9, "relative": false, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until_phase(Phase::Disabled);
    let stop = page.newest_state()["groups"][0]["stop"].clone();
    assert_eq!(
        (&stop["rule"], &stop["axis"], &stop["is_fault"]),
        (&json!("drive_fault"), &json!(1), &json!(true))
    );
    assert!(stop["words"].as_str().unwrap().contains("joint2 reports fault"), "{stop}");
    assert!(!stop["cure"].as_str().unwrap().is_empty(), "{stop}");
    let words = page.is_refused(&json!({ "do": "enable" }), 409, "refused");
    assert!(words.contains("must be reset first"), "{words}");
    page.does(&json!({ "do": "clear_faults" }));
    page.does(&json!({ "do": "enable", "group": 0 }));
    shown.until_phase(Phase::Holding);
    // A page that is opened later is told what has happened.
    let late = shown.open();
    let mut told = std::iter::repeat_with(|| late.next("event")["words"].as_str().unwrap().to_owned());
    let stop = told.find(|words| words.starts_with("stop: ") && !words.contains("requested"));
    assert!(stop.unwrap().contains("joint2"));
}

#[test]
fn a_page_that_asks_too_often_is_told_so_and_may_still_stop() {
    let shown = Shown::start("first.toml");
    let mut page = shown.commander();
    let refused =
        (0..200).map(|_| page.command(&json!({ "do": "clear_faults" }))).find(|(status, _)| *status != 200);
    let (status, value) = refused.expect("200 commands at once were taken");
    assert_eq!((status, &value["error"]), (429, &json!("too_often")));
    assert!(value["words"].as_str().unwrap().contains("10 a second"), "{value}");
    for _ in 0..100 {
        assert_eq!(post(shown.address(), "/api/stop", "", r#"{"category":2}"#).0, 200);
    }
}

#[test]
fn what_is_too_long_too_much_or_garbage_is_refused_and_the_panel_goes_on() {
    let shown = Shown::start("first.toml");
    let address = shown.address();
    assert_eq!(post(address, "/api/stop", "", &" ".repeat(100_000)).0, 413);
    for garbage in [
        "",
        "{",
        "[]",
        "{\"category\":9}",
        "{\"category\":-1}",
        "{\"category\":1,\"x\":1}",
        "\u{0}\u{1}",
        "null",
    ] {
        assert_eq!(post(address, "/api/stop", "", garbage).0, 400, "{garbage:?}");
    }
    let deep = "[".repeat(8000);
    assert_eq!(post(address, "/api/command", "", &deep).0, 400);
    assert_eq!(post(address, "/api/command", "", r#"{"number":1,"command":{"do":"enable"}}"#).0, 410);
    assert_eq!(
        post(address, "/api/command", "X-Takt-Page: ffff\r\n", r#"{"number":1,"command":{"do":"enable"}}"#).0,
        410
    );
    for raw in [
        "\r\n\r\n",
        "GET\r\n\r\n",
        "\u{16}\u{3}\u{1}",
        "POST /api/stop HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999\r\n\r\n",
    ] {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(raw.as_bytes()).unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        let _ = stream.read_to_end(&mut vec![]);
    }
    let long = format!("GET / HTTP/1.1\r\nHost: {address}\r\nX-Long: {}\r\n\r\n", "x".repeat(100_000));
    assert!(matches!(exchange(address, &long).0, 400..=499));
    assert_eq!(get(address, "/", "").0, 200);
}

#[test]
fn pages_that_read_nothing_hold_up_nobody_and_their_number_is_bounded() {
    let shown = Shown::start("arm6-erob.toml");
    let address = shown.address();
    let request = format!("GET /api/states HTTP/1.1\r\nHost: {address}\r\nX-Takt-Panel: 1\r\n\r\n");
    let mut silent = vec![];
    for _ in 1..PAGES_AT_MOST {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        // The first bytes of the answer: the page is open.
        stream.read_exact(&mut [0; 15]).unwrap();
        silent.push(stream);
    }
    let mut page = shown.commander();
    let Err((status, _)) = Page::open(address) else { panic!("one page too many is open") };
    assert_eq!(status, 503);
    page.does(&json!({ "do": "move", "axis": 0, "to": 0.1, "relative": false, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until("0.1", |state| state.axes[0].position_set == 0.1);
    assert_eq!(page.newest_state()["pages"].as_u64(), Some(PAGES_AT_MOST as u64));
    // They confirm nothing, and are closed.
    shown.until("room", |_| Page::open(address).is_ok());
}

#[test]
fn pages_are_told_that_the_controller_has_ended() {
    let Shown { panel, controller } = Shown::start("first.toml");
    let page = Page::open(panel.address()).unwrap();
    page.next("state");
    controller.finish().unwrap();
    while page.next("state")["has_ended"] != true {}
    let (status, _, value) = post(panel.address(), "/api/stop", "", r#"{"category":2}"#);
    assert_eq!((status, &value["error"]), (409, &json!("ended")));
    drop(panel);
    page.kill();
}

#[test]
fn what_pages_have_moved_comes_to_rest_when_the_panel_ends() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    let mut open = jog(0, 0.1);
    open["while"] = json!("open");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity_set > 0.09);
    let Shown { panel, controller } = shown;
    drop(panel);
    controller.wait_for(Phase::Holding, LONG).unwrap();
}

#[test]
fn a_panel_of_another_process_commands_by_its_client() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("arm").to_str().unwrap().to_owned();
    let controller = Controller::start(config("arm6-erob.toml"), SessionOptions::default()).unwrap();
    let _server = takt::serve(controller.handle(), &name, takt::ServeOptions::default()).unwrap();
    let client = takt::connect(&name).unwrap();
    let lease = client.clone();
    let take_lease: takt::internals::panel::TakeLease = Box::new(move || lease.take_over());
    let panel = Listening::begin(&options(None)).unwrap().show(client, Some(take_lease)).unwrap();
    let shown = Shown { panel, controller };
    let mut page = shown.commander();
    // Another program commands, until the page takes over from it by name.
    let other = takt::connect(&name).unwrap();
    // Before the page asks for it: whoever commands without a pause keeps the lease.
    other.take_lease().unwrap();
    let is_other = AtomicBool::new(true);
    thread::scope(|scope| {
        scope.spawn(|| {
            let begun = Instant::now();
            while is_other.load(Ordering::Relaxed) && begun.elapsed() < 2 * LONG {
                let _ = other.reset_faults();
                thread::sleep(Duration::from_millis(20));
            }
        });
        shown.until("the lease of the other", |_| page.command(&jog(0, 0.2)).1["error"] == "lease");
        assert_eq!(post(page.address, "/api/lease", &page.headers(), "").0, 200);
        is_other.store(false, Ordering::Relaxed);
    });
    hold_until(&shown, &mut page, 0.2, |state| state.axes[0].velocity_set > 0.19);
    page.kill();
    shown.until_rest();
    shown.until_phase(Phase::Holding);
}
