//! Commissioning in the browser: drives on buses that no controller runs.
//!
//! ```text
//! pages ──▶ Bench ── one errand at a time ──▶ worker: one thread, which owns the buses
//!   ▲                                           │  bus_session, line_session: the procedures of `takt drive`
//!   └────────── states, outcomes, frames ───────┘
//! ```
//!
//! A drive has torque for a page that is there and commands. When that page is lost, when anybody stops, and when the panel ends, what runs is
//! interrupted as by Ctrl-C (in control, then without torque), and a drive that was left with torque is disabled.

mod asked;
mod interruption;
mod told;
mod worker;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Instant;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use axum::routing::{get, post};
use serde::Deserialize;
use serde_json::json;

use super::access::Access;
use super::command::CommandRefusal;
use super::frames::{Frames, Wanted};
use super::gate::{self, Gate, Problematic, Visited, body, done, json_response, message, page_key};
use super::lock::locked;
use super::motions::HELD_FOR;
use super::page::{self, File};
use super::pages::{Asked, PageNumber};
use super::view::EventView;
use asked::{Ask, AskedTask};
use takt::words::Words;
use told::Told;

pub use worker::{BenchBus, BenchDrive, BenchLink, Worker, Workplace};

/// What the worker does for a page.
#[derive(Clone, Debug)]
struct Errand {
    page: PageNumber,
    ask: Ask,
    /// The stops until then: a later one discards it.
    stops: u64,
}

impl Errand {
    /// Returns `true` if it ends what goes on, and does not wait for it.
    const fn is_disabling(&self) -> bool {
        matches!(self.ask, Ask::Task { task: AskedTask::Disable {}, .. })
    }
}

/// What the threads of the panel share.
pub struct Bench {
    gate: Gate,
    told: Mutex<Told>,
    frames: Mutex<Frames>,
    next: Mutex<Next>,
    stops: AtomicU64,
    /// Another process takes the buses over.
    is_taken_over: AtomicBool,
}

/// What comes next, and what goes on with what runs.
#[derive(Debug, Default)]
struct Next {
    errand: Option<Errand>,
    /// True if an errand runs that is not to be replaced by another one.
    is_busy: bool,
    /// What runs is to end.
    ends: bool,
    /// Until then what is held goes on; `None` where nothing is held.
    held_until: Option<Instant>,
}

impl Visited for Bench {
    fn gate(&self) -> &Gate {
        &self.gate
    }

    fn files(&self) -> Vec<&'static File> {
        page::of_bench()
    }

    /// The worker sees that the page is not there any more.
    fn end_of(&self, _page: PageNumber) {}

    fn look(&self) {}

    fn state(&self) -> Bytes {
        let (commander, pages) = {
            let pages = self.gate.pages();
            (pages.commander(), pages.count())
        };
        let last = locked(&self.frames).last();
        let mut state = self.told().state();
        if let Some(state) = state.as_object_mut() {
            state.insert("commander".to_owned(), json!(commander));
            state.insert("pages".to_owned(), json!(pages));
            state.insert("frames".to_owned(), json!(last));
            state.insert("has_ended".to_owned(), json!(self.gate.has_ended()));
        }
        message("state", &state)
    }

    fn end(&self) {
        self.gate.end();
    }
}

impl Bench {
    pub fn new(access: Access, told: Told) -> Self {
        Self {
            gate: Gate::new(access),
            told: Mutex::new(told),
            frames: Mutex::default(),
            next: Mutex::default(),
            stops: AtomicU64::new(0),
            is_taken_over: AtomicBool::new(false),
        }
    }

    fn told(&self) -> MutexGuard<'_, Told> {
        locked(&self.told)
    }

    fn next(&self) -> MutexGuard<'_, Next> {
        locked(&self.next)
    }

    fn stops(&self) -> u64 {
        self.stops.load(Ordering::Acquire)
    }

    /// Returns `true` if another process has taken the buses over.
    pub fn is_taken_over(&self) -> bool {
        self.is_taken_over.load(Ordering::Acquire)
    }

    /// Returns `true` if a page is there and commands.
    fn may_move(&self, page: PageNumber) -> bool {
        !self.gate.has_ended() && self.gate.pages().may_move(page, Instant::now())
    }

    fn tell(&self, level: &'static str, words: Words) {
        self.gate.tell(None, |number| message("event", &EventView::said(number, level, words)));
    }

    /// Leaves an errand for the worker.
    fn leave(&self, errand: Errand) -> Result<(), CommandRefusal> {
        let mut next = self.next();
        let replaces = errand.is_disabling();
        if next.errand.is_some() || (next.is_busy && !replaces) {
            return Err(CommandRefusal::BusyWithDrive);
        }
        next.held_until = match errand.ask {
            Ask::Task { held: true, .. } => Some(Instant::now() + HELD_FOR),
            _ => None,
        };
        next.ends = replaces;
        next.errand = Some(errand);
        Ok(())
    }

    /// What needs no worker.
    fn go_on(&self, ask: &Ask) -> Option<Result<(), CommandRefusal>> {
        match ask {
            Ask::End {} => {
                self.next().ends = true;
                Some(Ok(()))
            }
            Ask::Renew {} => {
                let mut next = self.next();
                let is_held = next.held_until.is_some() && (next.is_busy || next.errand.is_some());
                Some(match is_held && !next.ends {
                    true => {
                        next.held_until = Some(Instant::now() + HELD_FOR);
                        Ok(())
                    }
                    false => Err(CommandRefusal::NothingToRenew),
                })
            }
            _ => None,
        }
    }
}

/// All that is answered.
pub fn routes(bench: &Arc<Bench>) -> Router {
    let own = Router::new()
        .route("/api/machine", get(machine))
        .route("/api/frames", post(frames))
        .route("/api/command", post(command))
        .route("/api/stop", post(stop));
    gate::routes(bench, own)
}

async fn machine(State(bench): State<Arc<Bench>>) -> Response {
    json_response(StatusCode::OK, &bench.told().machine())
}

async fn frames(State(bench): State<Arc<Bench>>, request: Request) -> Result<Response, Problematic> {
    let (_, wanted) = body::<Wanted>(request).await?;
    let view = locked(&bench.frames).wanted(&wanted);
    Ok(json_response(StatusCode::OK, &view))
}

/// A command with its number.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbered {
    number: u64,
    command: Ask,
}

async fn command(State(bench): State<Arc<Bench>>, request: Request) -> Result<Response, Problematic> {
    let (headers, Numbered { number, command: ask }) = body(request).await?;
    let asked = match ask {
        Ask::Renew {} | Ask::End {} => Asked::Renewal,
        _ => Asked::Command,
    };
    // A stop that comes after this discards it.
    let stops = bench.stops();
    if let Some(words) = ask.wrong() {
        return Err(Problematic::Malformed(words));
    }
    let page = bench.gate.pages().may_command(page_key(&headers)?, number, asked, Instant::now())?;
    match bench.go_on(&ask) {
        Some(result) => result?,
        None => bench.leave(Errand { page, ask, stops })?,
    }
    Ok(done())
}

/// A stop, in the words of the page of a running controller: there is one group and one kind of stop.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stop {
    /// The number of the command; none of a page that is not connected.
    number: Option<u64>,
    #[serde(rename = "group")]
    _group: Option<u8>,
    #[serde(rename = "category")]
    _category: u8,
}

/// Everybody may stop: it is not counted, and needs neither command nor connection.
async fn stop(State(bench): State<Arc<Bench>>, request: Request) -> Result<Response, Problematic> {
    let (headers, Stop { number, .. }) = body(request).await?;
    bench.stops.fetch_add(1, Ordering::AcqRel);
    if let (Ok(key), Some(number)) = (page_key(&headers), number) {
        bench.gate.pages().stopped(key, number);
    }
    Ok(done())
}
