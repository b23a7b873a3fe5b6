//! What the panel answers.

use std::collections::{HashMap, VecDeque};
use std::convert::Infallible;
use std::io::Read;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::http::header::{self, HeaderMap, HeaderValue};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;
use takt_rt::StopCategory;
use tokio::sync::{Notify, oneshot, watch};
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::TakeLease;
use super::access::{Access, Denied};
use super::command::{Command, CommandRefusal, target_of};
use super::connections::Connection;
use super::motions::{Motions, Problem};
use super::page::FILES;
use super::pages::{Asked, PageNumber, PageRefusal, Pages};
use super::view::{EventView, MachineView, Viewer};
use crate::command::{RunningController, WaitError};

/// Between two states.
const STATE_EVERY: Duration = Duration::from_millis(50);
/// Events that a page that has just been opened is told.
const EVENTS_KEPT: usize = 300;
/// Commands that may wait for the controller.
const COMMANDS_WAITING: usize = 16;
/// The body of a command: its largest size in bytes, and how long it may take to come.
const BODY_AT_MOST: usize = 8 * 1024;
const BODY_WITHIN: Duration = Duration::from_secs(3);
/// How often a thread that waits makes sure that the panel goes on.
const LOOK: Duration = Duration::from_millis(100);

/// The header that every request of the page's own has. A browser lets no other site set it.
const OWN: &str = "x-takt-panel";
/// The header with the secret of an open page.
const PAGE: &str = "x-takt-page";

/// What the threads of the panel share.
pub struct Server {
    controller: Arc<dyn RunningController>,
    access: Access,
    take_lease: Option<TakeLease>,
    pages: Mutex<Pages>,
    /// What closes the connection of a page.
    closers: Mutex<HashMap<PageNumber, Arc<Notify>>>,
    motions: Motions,
    events: Mutex<Events>,
    states: watch::Sender<Bytes>,
    commands: SyncSender<Work>,
    commands_out: Mutex<Option<Receiver<Work>>>,
    has_ended: AtomicBool,
    ending: Notify,
}

/// The last events, as they are sent, with the page that each is for, if it is for one.
#[derive(Default)]
struct Events {
    last: u64,
    kept: VecDeque<(u64, Option<PageNumber>, Bytes)>,
}

impl Events {
    fn push(&mut self, page: Option<PageNumber>, event: impl FnOnce(u64) -> Bytes) {
        self.last += 1;
        if self.kept.len() == EVENTS_KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back((self.last, page, event(self.last)));
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

/// A panic of another holder of a lock leaves what it guards consistent.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    pub fn new(
        controller: Arc<dyn RunningController>,
        access: Access,
        take_lease: Option<TakeLease>,
    ) -> Self {
        let (commands, commands_out) = sync_channel(COMMANDS_WAITING);
        Self {
            motions: Motions::new(Arc::clone(&controller)),
            controller,
            access,
            take_lease,
            pages: Mutex::default(),
            closers: Mutex::default(),
            events: Mutex::default(),
            states: watch::Sender::default(),
            commands,
            commands_out: Mutex::new(Some(commands_out)),
            has_ended: AtomicBool::new(false),
            ending: Notify::new(),
        }
    }

    fn pages(&self) -> MutexGuard<'_, Pages> {
        locked(&self.pages)
    }

    /// The commands that come, for the thread that carries them out.
    pub fn commands(&self) -> Receiver<Work> {
        // It is asked for once; a second receiver would get nothing.
        locked(&self.commands_out).take().unwrap_or_else(|| sync_channel(0).1)
    }

    /// Ends the panel.
    pub fn end(&self) {
        self.has_ended.store(true, Ordering::Release);
        self.motions.end();
        self.ending.notify_one();
    }

    fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Acquire)
    }

    /// Sends states to the pages until the panel ends.
    pub async fn show_states(&self) {
        let mut viewer = Viewer::default();
        let mut ticks = interval(STATE_EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = self.ending.notified() => break self.show_state(&mut viewer),
            }
            let now = Instant::now();
            let (silent, has_pages) = {
                let pages = self.pages();
                self.motions.end_unless(|page| pages.may_move(page, now));
                (pages.silent(now), pages.count() > 0)
            };
            for page in silent {
                self.close(page);
            }
            if has_pages {
                self.show_state(&mut viewer);
            }
        }
    }

    fn show_state(&self, viewer: &mut Viewer) {
        let (commander, count) = {
            let pages = self.pages();
            (pages.commander(), pages.count())
        };
        let view = viewer.view(&*self.controller, commander, count);
        self.states.send_replace(message("state", &view));
    }

    /// Keeps the events until the panel or the controller ends.
    pub fn collect_events(&self) {
        let mut source = self.controller.event_source();
        let mut missed = 0;
        while !self.has_ended() {
            match source.wait(LOOK) {
                Ok(event) => {
                    let machine = self.controller.machine();
                    locked(&self.events)
                        .push(None, |number| message("event", &EventView::of(number, &event, machine)));
                }
                Err(WaitError::NotInTime) => {}
                Err(WaitError::Ended) => return,
            }
            let now_missed = source.missed();
            if now_missed > missed {
                let count = now_missed - missed;
                locked(&self.events).push(None, |number| message("event", &EventView::missed(number, count)));
                missed = now_missed;
            }
        }
    }

    /// Carries commands out, one after another, until the panel ends.
    pub fn carry_out(&self, commands: &Receiver<Work>) {
        while !self.has_ended() {
            let Ok(Work { what, reply }) = commands.recv_timeout(LOOK) else { continue };
            let result = match what {
                Errand::Command { page, number, command, stops } => {
                    let may_begin = || self.pages().may_begin(page, number, Instant::now());
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
        let may_move = |page| self.pages().may_move(page, Instant::now());
        let tell = |Problem { page, refusal }: Problem| {
            let view = json!({ "error": refusal.key(), "words": refusal.to_string() });
            locked(&self.events).push(Some(page), |_| message("problem", &view));
        };
        self.motions.run(may_move, tell);
    }

    /// A page is lost: what it has set in motion comes to rest.
    fn close(&self, page: PageNumber) {
        self.pages().close(page);
        self.motions.end_of(page);
        if let Some(closer) = locked(&self.closers).remove(&page) {
            closer.notify_one();
        }
    }

    /// Has the thread of the commands do something, and waits for it.
    async fn wait_for(&self, what: Errand) -> Result<Response, Problematic> {
        let (reply, replied) = oneshot::channel();
        self.commands.try_send(Work { what, reply }).map_err(|_| CommandRefusal::Busy)?;
        match replied.await {
            Ok(Ok(())) => Ok(done()),
            Ok(Err(refusal)) => Err(refusal.into()),
            Err(_) => Err(CommandRefusal::Discarded.into()),
        }
    }
}

/// An event of a stream of server-sent events.
fn message(name: &str, value: &impl serde::Serialize) -> Bytes {
    let value = serde_json::to_string(value)
        .unwrap_or_else(|error| json!({ "error": error.to_string() }).to_string());
    format!("event: {name}\ndata: {value}\n\n").into()
}

fn done() -> Response {
    json_response(StatusCode::OK, &json!({ "done": true }))
}

fn json_response(status: StatusCode, value: &impl serde::Serialize) -> Response {
    let text = serde_json::to_string(value).unwrap_or_default();
    (status, [(header::CONTENT_TYPE, "application/json")], text).into_response()
}

/// Why a request is not done.
enum Problematic {
    Denied(Denied),
    NoHeader,
    Page(PageRefusal),
    Command(CommandRefusal),
    MediaType,
    TooLarge,
    TooSlow,
    Malformed(String),
}

impl From<Denied> for Problematic {
    fn from(denied: Denied) -> Self {
        Self::Denied(denied)
    }
}

impl From<PageRefusal> for Problematic {
    fn from(refusal: PageRefusal) -> Self {
        Self::Page(refusal)
    }
}

impl From<CommandRefusal> for Problematic {
    fn from(refusal: CommandRefusal) -> Self {
        Self::Command(refusal)
    }
}

impl IntoResponse for Problematic {
    fn into_response(self) -> Response {
        let (status, key, words) = match &self {
            Self::Denied(denied @ Denied::Token) => (StatusCode::UNAUTHORIZED, "token", denied.to_string()),
            Self::Denied(denied) => (StatusCode::FORBIDDEN, "site", denied.to_string()),
            Self::NoHeader => (StatusCode::FORBIDDEN, "header", format!("the header {OWN} is missing")),
            Self::Page(refusal) => {
                let status = match refusal {
                    PageRefusal::TooManyPages => StatusCode::SERVICE_UNAVAILABLE,
                    PageRefusal::NotOpen => StatusCode::GONE,
                    PageRefusal::TooOften { .. } => StatusCode::TOO_MANY_REQUESTS,
                    _ => StatusCode::CONFLICT,
                };
                (status, refusal.key(), refusal.to_string())
            }
            Self::Command(refusal) => {
                let status = match refusal {
                    CommandRefusal::Busy => StatusCode::SERVICE_UNAVAILABLE,
                    _ => StatusCode::CONFLICT,
                };
                (status, refusal.key(), refusal.to_string())
            }
            Self::MediaType => {
                (StatusCode::UNSUPPORTED_MEDIA_TYPE, "media_type", "a command is application/json".to_owned())
            }
            Self::TooLarge => (
                StatusCode::PAYLOAD_TOO_LARGE,
                "too_large",
                format!("a command has at most {BODY_AT_MOST} bytes"),
            ),
            Self::TooSlow => {
                (StatusCode::REQUEST_TIMEOUT, "too_slow", "the command came too slowly".to_owned())
            }
            Self::Malformed(words) => {
                (StatusCode::BAD_REQUEST, "malformed", format!("this is no command: {words}"))
            }
        };
        let mut response = json_response(status, &json!({ "error": key, "words": words }));
        if status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        if status == StatusCode::TOO_MANY_REQUESTS {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
        }
        response
    }
}

/// All that is answered.
pub fn routes(server: Arc<Server>) -> Router {
    let own = Router::new()
        .route("/api/machine", get(machine))
        .route("/api/states", get(states))
        .route("/api/confirm", post(confirm))
        .route("/api/control", post(control))
        .route("/api/command", post(command))
        .route("/api/stop", post(stop))
        .layer(from_fn_with_state(Arc::clone(&server), own_page));
    let page = FILES.iter().fold(Router::new(), |router, file| {
        let headers = [(header::CONTENT_TYPE, file.media_type)];
        router.route(file.path, get(move || async move { (headers, file.text) }))
    });
    own.merge(page).layer(from_fn_with_state(Arc::clone(&server), own_site)).with_state(server)
}

/// Of every answer: nothing from elsewhere is loaded or run, nobody frames the page, nothing is kept.
const HEADERS: [(&str, &str); 7] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cache-control", "no-store"),
];

async fn own_site(
    State(server): State<Arc<Server>>,
    Extension(connection): Extension<Connection>,
    request: Request,
    next: Next,
) -> Response {
    let mut response = match server.access.check_site(request.headers(), connection.local) {
        Ok(()) => next.run(request).await,
        Err(denied) => Problematic::from(denied).into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn own_page(
    State(server): State<Arc<Server>>,
    request: Request,
    next: Next,
) -> Result<Response, Problematic> {
    if !request.headers().contains_key(OWN) {
        return Err(Problematic::NoHeader);
    }
    server.access.check_token(request.headers())?;
    Ok(next.run(request).await)
}

async fn machine(State(server): State<Arc<Server>>) -> Response {
    json_response(StatusCode::OK, &MachineView::of(&*server.controller))
}

/// The secret of a page: 128 random bits.
fn key() -> std::io::Result<String> {
    let mut bytes = [0u8; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(format!("{:032x}", u128::from_ne_bytes(bytes)))
}

/// A page is open as long as this lives.
struct OpenPage {
    server: Arc<Server>,
    number: PageNumber,
}

impl Drop for OpenPage {
    fn drop(&mut self) {
        self.server.close(self.number);
    }
}

/// What is sent to a page.
struct Feed {
    greeting: Option<Bytes>,
    states: watch::Receiver<Bytes>,
    /// The last event that was sent.
    sent: u64,
    page: OpenPage,
}

impl Feed {
    /// The newest state, with the events until then. A page that reads slowly gets fewer of them.
    async fn next(&mut self) -> Option<Bytes> {
        if let Some(greeting) = self.greeting.take() {
            return Some(greeting);
        }
        self.states.changed().await.ok()?;
        let state = self.states.borrow_and_update().clone();
        let mut text = Vec::with_capacity(state.len() + 64);
        {
            let events = locked(&self.page.server.events);
            let new = events.kept.iter().filter(|(number, page, _)| {
                *number > self.sent && page.is_none_or(|page| page == self.page.number)
            });
            new.for_each(|(_, _, event)| text.extend_from_slice(event));
            self.sent = events.last;
        }
        text.extend_from_slice(&state);
        Some(text.into())
    }
}

async fn states(
    State(server): State<Arc<Server>>,
    Extension(connection): Extension<Connection>,
) -> Result<Response, Problematic> {
    let key = key().map_err(|error| Problematic::Malformed(error.to_string()))?;
    let number = server.pages().open(key.clone(), Instant::now())?;
    let page = OpenPage { server: Arc::clone(&server), number };
    locked(&server.closers).insert(number, connection.closer);
    let greeting = message("page", &json!({ "number": number, "key": key }));
    let feed = Feed { greeting: Some(greeting), states: server.states.subscribe(), sent: 0, page };
    let stream = futures_util::stream::unfold(feed, |mut feed| async move {
        let bytes = feed.next().await?;
        Some((Ok::<_, Infallible>(bytes), feed))
    });
    Ok(([(header::CONTENT_TYPE, "text/event-stream")], Body::from_stream(stream)).into_response())
}

/// The secret of the page that asks.
fn page_key(headers: &HeaderMap) -> Result<&str, PageRefusal> {
    headers.get(PAGE).and_then(|value| value.to_str().ok()).ok_or(PageRefusal::NotOpen)
}

async fn body<T: DeserializeOwned>(request: Request) -> Result<(HeaderMap, T), Problematic> {
    let (parts, body) = request.into_parts();
    let is_json = parts.headers.get(header::CONTENT_TYPE).is_some_and(|value| value == "application/json");
    if !is_json {
        return Err(Problematic::MediaType);
    }
    let bytes = timeout(BODY_WITHIN, to_bytes(body, BODY_AT_MOST)).await;
    let bytes = bytes.map_err(|_| Problematic::TooSlow)?.map_err(|_| Problematic::TooLarge)?;
    let value = serde_json::from_slice(&bytes).map_err(|error| Problematic::Malformed(error.to_string()))?;
    Ok((parts.headers, value))
}

async fn confirm(State(server): State<Arc<Server>>, headers: HeaderMap) -> Result<Response, Problematic> {
    server.pages().confirm(page_key(&headers)?, Instant::now())?;
    Ok(done())
}

/// Who commands.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
enum Control {
    /// This page, if no other one does.
    Take {},
    /// This page, in place of another one.
    TakeOver {},
    /// Not this page any more.
    Release {},
    /// This panel, in place of another process.
    TakeLease {},
}

async fn control(State(server): State<Arc<Server>>, request: Request) -> Result<Response, Problematic> {
    let (headers, control) = body::<Control>(request).await?;
    let (key, now) = (page_key(&headers)?, Instant::now());
    match control {
        Control::Take {} | Control::TakeOver {} => {
            let is_taken_over = matches!(control, Control::TakeOver {});
            let other = server.pages().take(key, is_taken_over, now)?;
            if let Some(other) = other {
                server.motions.end_of(other);
            }
            Ok(done())
        }
        Control::Release {} => {
            let page = server.pages().release(key)?;
            server.motions.end_of(page);
            Ok(done())
        }
        Control::TakeLease {} => {
            let commander = server.pages().commander();
            let is_commander = commander == Some(server.pages().number(key)?);
            if !is_commander {
                return Err(PageRefusal::NotCommander { commander }.into());
            }
            server.wait_for(Errand::TakeLease).await
        }
    }
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
    let page = server.pages().may_command(page_key(&headers)?, number, asked, Instant::now())?;
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
        _ => return Err(Problematic::Malformed("stop categories are 0, 1 and 2".to_owned())),
    };
    server.motions.stop(target_of(group, server.controller.machine())?, category)?;
    if let (Ok(key), Some(number)) = (page_key(&headers), number) {
        server.pages().stopped(key, number);
    }
    Ok(done())
}
