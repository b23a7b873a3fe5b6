//! A controller with its panel, and pages that are open as a browser keeps them.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use takt::{Config, Controller, Phase, SessionOptions};
use takt_panel::{Listening, Panel, PanelOptions, PanelToken};

pub const LONG: Duration = Duration::from_secs(30);
/// Speeds below this are rest: rad/s.
pub const REST: f64 = 1e-3;

pub fn config(name: &str) -> Config {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs").join(name);
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

pub fn options(token: Option<&str>) -> PanelOptions {
    let token = token.map_or(PanelToken::Open, |token| PanelToken::Given(token.to_owned()));
    PanelOptions { address: "127.0.0.1:0".parse().unwrap(), token, origins: vec![] }
}

/// A controller with its panel. The panel is dropped first.
pub struct Shown {
    pub panel: Panel,
    pub controller: Controller,
}

/// Where a panel listens, by the address that it prints.
pub fn address_of(panel: &Panel) -> SocketAddr {
    let place = panel.url().strip_prefix("http://").and_then(|rest| rest.split('/').next());
    place.unwrap().parse().unwrap()
}

impl Shown {
    pub fn start(name: &str) -> Self {
        Self::with(config(name), SessionOptions::default(), &options(None))
    }

    pub fn with(config: Config, session: SessionOptions, options: &PanelOptions) -> Self {
        let listening = Listening::begin(options).unwrap();
        let controller = Controller::start(config, session).unwrap();
        let panel = listening.show(controller.handle(), None, None).unwrap();
        Self { panel, controller }
    }

    pub fn address(&self) -> SocketAddr {
        address_of(&self.panel)
    }

    pub fn open(&self) -> Page {
        Page::open(self.address()).unwrap()
    }

    pub fn commander(&self) -> Page {
        let mut page = self.open();
        assert_eq!(page.control("take"), (200, json!({ "done": true })));
        page
    }

    pub fn until(&self, what: &str, mut is_so: impl FnMut(&takt::Snapshot) -> bool) {
        let begun = Instant::now();
        while !is_so(&self.controller.state()) {
            assert!(begun.elapsed() < LONG, "{what}: {:?}", self.controller.state().groups());
            thread::sleep(Duration::from_millis(2));
        }
    }

    pub fn until_phase(&self, phase: Phase) {
        self.until(&format!("{phase:?}"), |state| state.groups().iter().all(|group| group.phase == phase));
    }

    pub fn until_rest(&self) {
        self.until("rest", |state| state.axes().iter().all(|axis| axis.velocity_set.abs() < REST));
    }
}

/// Sends a request as it is, and reads the answer.
pub fn exchange(address: SocketAddr, request: &str) -> (u16, String, Value) {
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

pub fn get(address: SocketAddr, path: &str, headers: &str) -> (u16, String, Value) {
    exchange(
        address,
        &format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n{headers}Connection: close\r\n\r\n"),
    )
}

pub fn post(address: SocketAddr, path: &str, headers: &str, body: &str) -> (u16, String, Value) {
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
pub struct Page {
    pub address: SocketAddr,
    pub number: u64,
    pub key: String,
    pub sequence: u64,
    stream: TcpStream,
    pub confirms: Arc<AtomicBool>,
    pub messages: Arc<Mutex<VecDeque<(String, Value)>>>,
    reader: Option<JoinHandle<()>>,
}

impl Page {
    pub fn open(address: SocketAddr) -> Result<Self, (u16, Value)> {
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

    pub fn headers(&self) -> String {
        format!("X-Takt-Page: {}\r\n", self.key)
    }

    pub fn control(&mut self, what: &str) -> (u16, Value) {
        let (status, _, value) =
            post(self.address, "/api/control", &self.headers(), &json!({ "do": what }).to_string());
        (status, value)
    }

    pub fn command(&mut self, command: &Value) -> (u16, Value) {
        self.sequence += 1;
        let body = json!({ "number": self.sequence, "command": command }).to_string();
        let (status, _, value) = post(self.address, "/api/command", &self.headers(), &body);
        (status, value)
    }

    pub fn does(&mut self, command: &Value) {
        assert_eq!(self.command(command), (200, json!({ "done": true })), "{command}");
    }

    /// Gives a command, no more often than a page may, until it is carried out.
    pub fn does_in_the_end(&mut self, command: &Value) {
        let begun = Instant::now();
        while let (status, value) = self.command(command)
            && status != 200
        {
            assert!(begun.elapsed() < LONG, "{command}: {value}");
            thread::sleep(Duration::from_millis(100));
        }
    }

    pub fn is_refused(&mut self, command: &Value, with: u16, key: &str) -> String {
        let (status, value) = self.command(command);
        assert_eq!((status, value["error"].as_str()), (with, Some(key)), "{command}: {value}");
        english(&value["words"])
    }

    /// The next message of this kind.
    pub fn next(&self, kind: &str) -> Value {
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

    pub fn newest_state(&self) -> Value {
        self.messages.lock().unwrap().clear();
        self.next("state")
    }

    /// The page is gone: its process is killed, its tab is closed.
    pub fn kill(mut self) {
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
pub fn hold_until(shown: &Shown, page: &mut Page, velocity: f64, is_so: impl Fn(&takt::Snapshot) -> bool) {
    let (begun, mut is_held) = (Instant::now(), false);
    while !is_so(&shown.controller.state()) {
        assert!(begun.elapsed() < LONG, "{:?}", shown.controller.state().groups());
        let (status, value) = match is_held {
            true => page.command(&json!({ "do": "renew", "axis": 0, "value": velocity })),
            false => page.command(&jog(0, velocity)),
        };
        let words = english(&value["words"]);
        // A busy machine misses slots as well, and begins no stream then.
        let is_late = value["error"] == "nothing_to_renew" || words.contains("slots were missed");
        assert!(status == 200 || value["error"] == "too_often" || is_late, "{value}");
        is_held = status == 200;
        thread::sleep(Duration::from_millis(40));
    }
}

/// Words as a page in English shows them.
pub fn english(words: &Value) -> String {
    let text = words["text"].as_str().unwrap_or_default().to_owned();
    words["fields"].as_object().into_iter().flatten().fold(text, |text, (name, field)| {
        let field = field.as_str().map_or_else(|| english(field), str::to_owned);
        text.replace(&format!("{{{name}}}"), &field)
    })
}

pub fn jog(axis: usize, velocity: f64) -> Value {
    json!({ "do": "drive", "axis": axis, "quantity": "velocity", "value": velocity, "while": "held" })
}
