//! What the panel of a running controller answers.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::http::header::HeaderMap;
use axum::response::Response;
use axum::routing::{get, post};
use serde::Deserialize;
use takt_rt::StopCategory;
use tokio::sync::oneshot;

use super::access::Access;
use super::command::{Command, CommandRefusal, target_of};
use super::frames::{FrameView, Frames, Wanted};
use super::gate::{self, Gate, Problematic, Visited, body, done, json_response, message, page_key};
use super::lock::locked;
use super::motions::{Motions, Problem};
use super::page::{self, File};
use super::pages::{Asked, PageNumber, PageRefusal};
use super::view::{EventView, MachineView, Viewer, time_ms};
use takt::command::{AnyHandle, CommandError, WaitError};
use takt::telemetry::missed_slots::MissedSlotsSoFar;
use takt::telemetry::{FrameFeed, OnBus};
use takt_tools::monitor::BusDecoder;

/// Commands that may wait for the controller.
const COMMANDS_WAITING: usize = 16;
/// How often a thread that waits makes sure that the panel goes on.
const LOOK: Duration = Duration::from_millis(100);
/// So long after a page has asked for frames, they are not collected any more.
const FRAMES_FOR: Duration = Duration::from_secs(2);

/// Takes over from another process that commands the controller, where there may be one.
pub type TakeLease = Box<dyn Fn() -> Result<(), CommandError> + Send + Sync>;

/// The frames of a controller of this process, for the monitor.
pub struct FrameSource {
    /// Where they come from.
    pub feed: Arc<FrameFeed>,
    /// What they mean, in the order of the buses.
    pub decoders: Vec<BusDecoder>,
}

/// What the threads of the panel share.
pub struct Server {
    gate: Gate,
    controller: AnyHandle,
    take_lease: Option<TakeLease>,
    motions: Motions,
    viewer: Mutex<Viewer>,
    has_frames: bool,
    frames: Mutex<Frames>,
    /// When a page has asked for frames.
    frames_asked: Mutex<Option<Instant>>,
    commands: SyncSender<Work>,
    commands_out: Mutex<Option<Receiver<Work>>>,
}

impl Visited for Server {
    fn gate(&self) -> &Gate {
        &self.gate
    }

    fn files(&self) -> Vec<&'static File> {
        page::of_controller()
    }

    fn end_of(&self, page: PageNumber) {
        self.motions.end_of(page);
    }

    fn look(&self) {
        let now = Instant::now();
        let pages = self.gate.pages();
        self.motions.end_unless(|page| pages.may_move(page, now));
    }

    fn state(&self) -> Bytes {
        let (commander, count) = {
            let pages = self.gate.pages();
            (pages.commander(), pages.count())
        };
        message("state", &locked(&self.viewer).view(&self.controller, commander, count, time_ms()))
    }

    fn end(&self) {
        self.motions.end();
        self.gate.end();
    }
}

/// What the thread of the commands does.
pub struct Work {
    what: Errand,
    reply: oneshot::Sender<Result<(), CommandRefusal>>,
}

enum Errand {
    Command { page: PageNumber, number: u64, command: Command, stops: u64 },
    TakeLease,
}

impl Server {
    pub fn new(
        controller: AnyHandle,
        access: Access,
        take_lease: Option<TakeLease>,
        has_frames: bool,
    ) -> Self {
        let (commands, commands_out) = sync_channel(COMMANDS_WAITING);
        Self {
            gate: Gate::new(access),
            motions: Motions::new(controller.clone()),
            controller,
            take_lease,
            viewer: Mutex::default(),
            has_frames,
            frames: Mutex::default(),
            frames_asked: Mutex::default(),
            commands,
            commands_out: Mutex::new(Some(commands_out)),
        }
    }

    /// The commands that come, for the thread that carries them out.
    pub fn commands(&self) -> Receiver<Work> {
        // It is asked for once; a second receiver would get nothing.
        locked(&self.commands_out).take().unwrap_or_else(|| sync_channel(0).1)
    }

    /// Keeps the events until the panel or the controller ends.
    pub fn collect_events(&self) {
        let mut source = self.controller.events();
        let (mut missed, mut missed_slots) = (0, MissedSlotsSoFar::default());
        while !self.gate.has_ended() {
            match source.wait(LOOK) {
                Ok(event) => {
                    let machine = self.controller.machine();
                    if let Some(event) = missed_slots.told(event) {
                        self.gate.tell(None, |number| {
                            message("event", &EventView::of(number, &event, machine, time_ms()))
                        });
                    }
                }
                Err(WaitError::NotInTime) => {}
                Err(WaitError::Ended) => return,
            }
            let now_missed = source.missed();
            if now_missed > missed {
                let count = now_missed - missed;
                self.gate.tell(None, |number| message("event", &EventView::missed(number, count, time_ms())));
                missed = now_missed;
            }
        }
    }

    fn are_frames_wanted(&self) -> bool {
        locked(&self.frames_asked).is_some_and(|asked| asked.elapsed() < FRAMES_FOR) && !self.gate.has_ended()
    }

    /// Keeps frames with their meaning, while pages ask for them, until the panel ends.
    pub fn collect_frames(&self, source: FrameSource) {
        let FrameSource { feed, mut decoders } = source;
        while !self.gate.has_ended() {
            if !self.are_frames_wanted() {
                std::thread::sleep(LOOK);
                continue;
            }
            let reader = feed.reader();
            while self.are_frames_wanted() {
                let Ok(OnBus { bus, what }) = reader.wait(LOOK) else { continue };
                let words = decoders.get_mut(bus).map(|decoder| decoder.decode(&what.frame).line());
                let age_ns = self.controller.now_ns().saturating_sub(what.at_ns);
                let mut frames = locked(&self.frames);
                frames.lose(reader.take_lost());
                frames.push(FrameView {
                    number: 0,
                    time: time_ms() as f64 * 1e-3 - age_ns as f64 * 1e-9,
                    bus,
                    direction: if what.is_sent { '>' } else { '<' },
                    frame: format!("{:?}", what.frame),
                    words: words.unwrap_or_default(),
                });
            }
        }
    }

    /// Carries commands out, one after another, until the panel ends.
    pub fn carry_out(&self, commands: &Receiver<Work>) {
        while !self.gate.has_ended() {
            let Ok(Work { what, reply }) = commands.recv_timeout(LOOK) else { continue };
            let result = match what {
                Errand::Command { page, number, command, stops } => {
                    let may_begin = || self.gate.pages().may_begin(page, number, Instant::now());
                    self.motions.carry_out(page, command, stops, &may_begin)
                }
                Errand::TakeLease => self.take_lease.as_ref().map_or(Ok(()), |take| Ok(take()?)),
            };
            // The page may have gone meanwhile.
            let _ = reply.send(result);
        }
    }

    /// Leads what pages have set in motion until the panel ends.
    pub fn lead_motions(&self) {
        let may_move = |page| self.gate.pages().may_move(page, Instant::now());
        let tell = |Problem { page, refusal }: Problem| {
            self.gate
                .tell(Some(page), |_| message("problem", &refusal.view(Some(self.controller.machine()))));
        };
        self.motions.run(may_move, tell);
    }

    /// Has the thread of the commands do something, and waits for it.
    async fn wait_for(&self, what: Errand) -> Result<Response, Problematic> {
        let (reply, replied) = oneshot::channel();
        self.commands.try_send(Work { what, reply }).map_err(|_| CommandRefusal::Busy)?;
        match replied.await {
            Ok(Ok(())) => Ok(done()),
            Ok(Err(refusal)) => Err(Problematic::command(&refusal, Some(self.controller.machine()))),
            Err(_) => Err(CommandRefusal::Discarded.into()),
        }
    }
}

/// All that is answered.
pub fn routes(server: &Arc<Server>) -> Router {
    let own = Router::new()
        .route("/api/machine", get(machine))
        .route("/api/frames", post(frames))
        .route("/api/lease", post(lease))
        .route("/api/command", post(command))
        .route("/api/stop", post(stop));
    gate::routes(server, own)
}

async fn machine(State(server): State<Arc<Server>>) -> Response {
    json_response(StatusCode::OK, &MachineView::of(&server.controller, server.has_frames))
}

async fn frames(State(server): State<Arc<Server>>, request: Request) -> Result<Response, Problematic> {
    let (_, wanted) = body::<Wanted>(request).await?;
    *locked(&server.frames_asked) = Some(Instant::now());
    let view = locked(&server.frames).wanted(&wanted);
    Ok(json_response(StatusCode::OK, &view))
}

/// Takes the controller over from another process.
async fn lease(State(server): State<Arc<Server>>, headers: HeaderMap) -> Result<Response, Problematic> {
    let (commander, asking) = {
        let pages = server.gate.pages();
        (pages.commander(), pages.number(page_key(&headers)?)?)
    };
    if commander != Some(asking) {
        return Err(PageRefusal::NotCommander { commander }.into());
    }
    server.wait_for(Errand::TakeLease).await
}

/// A command with its number.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbered {
    number: u64,
    command: Command,
}

async fn command(State(server): State<Arc<Server>>, request: Request) -> Result<Response, Problematic> {
    let (headers, Numbered { number, command }) = body(request).await?;
    let asked = match command {
        Command::Renew { .. } | Command::Release { .. } => Asked::Renewal,
        _ => Asked::Command,
    };
    // A stop that comes after this discards it.
    let stops = server.motions.stops();
    let page = server.gate.pages().may_command(page_key(&headers)?, number, asked, Instant::now())?;
    server.wait_for(Errand::Command { page, number, command, stops }).await
}

/// A stop.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stop {
    /// The number of the command; none of a page that is not connected.
    number: Option<u64>,
    /// The group; all of them without it.
    group: Option<u8>,
    /// IEC 60204-1: 0, 1 or 2.
    category: u8,
}

/// Everybody may stop: it is not counted, and needs neither command nor connection.
async fn stop(State(server): State<Arc<Server>>, request: Request) -> Result<Response, Problematic> {
    let (headers, Stop { number, group, category }) = body(request).await?;
    let category = match category {
        0 => StopCategory::Zero,
        1 => StopCategory::One,
        2 => StopCategory::Two,
        _ => return Err(Problematic::Malformed("stop categories are 0, 1 and 2".into())),
    };
    server.motions.stop(target_of(group, server.controller.machine())?, category)?;
    if let (Ok(key), Some(number)) = (page_key(&headers), number) {
        server.gate.pages().stopped(key, number);
    }
    Ok(done())
}
