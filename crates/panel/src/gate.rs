//! What every panel does at its gate: who may ask, which pages are open, what they are sent, and what each request must have.
//!
//! What a page moves ends when it is lost: see [`Visited::end_of`].

use std::collections::{HashMap, VecDeque};
use std::convert::Infallible;
use std::io::Read;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
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
use tokio::sync::{Notify, watch};
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};

use super::access::{Access, Denied};
use super::command::{CommandRefusal, ProblemView};
use super::connections::Connection;
use super::lock::locked;
use super::page::File;
use super::pages::{PageNumber, PageRefusal, Pages};
use takt::telemetry::Machine;
use takt::words;
use takt::words::Words;

/// Between two states.
const STATE_EVERY: Duration = Duration::from_millis(50);
/// Events that a page that has just been opened is told.
const EVENTS_KEPT: usize = 300;
/// The body of a command: its largest size in bytes, and how long it may take to come.
const BODY_AT_MOST: usize = 8 * 1024;
const BODY_WITHIN: Duration = Duration::from_secs(3);
/// How late a wrong token is answered. It is shorter than the time that a connection without the token has.
const GUESS_TAKES: Duration = Duration::from_millis(500);

/// The header that every request of the page's own has. A browser lets no other site set it.
const OWN: &str = "x-takt-panel";
/// The header with the secret of an open page.
const PAGE: &str = "x-takt-page";

/// A panel, as its gate sees it.
pub trait Visited: Send + Sync + 'static {
    /// Its gate.
    fn gate(&self) -> &Gate;

    /// The files of its page.
    fn files(&self) -> Vec<&'static File>;

    /// A page is lost, or commands no longer: what it has set in motion comes to rest.
    fn end_of(&self, page: PageNumber);

    /// Looks whether the pages that move something are there. Called before every state.
    fn look(&self);

    /// The state that is sent to all pages, as an event of a stream.
    fn state(&self) -> Bytes;

    /// Ends what the threads of the panel do.
    fn end(&self);
}

/// Who may ask, which pages are open, and what they are sent.
pub struct Gate {
    access: Access,
    pages: Mutex<Pages>,
    /// What closes the connection of a page.
    closers: Mutex<HashMap<PageNumber, Arc<Notify>>>,
    events: Mutex<Events>,
    states: watch::Sender<Bytes>,
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

impl Gate {
    pub fn new(access: Access) -> Self {
        Self {
            access,
            pages: Mutex::default(),
            closers: Mutex::default(),
            events: Mutex::default(),
            states: watch::Sender::default(),
            has_ended: AtomicBool::new(false),
            ending: Notify::new(),
        }
    }

    pub fn pages(&self) -> MutexGuard<'_, Pages> {
        locked(&self.pages)
    }

    /// Tells all pages an event, or one page alone.
    pub fn tell(&self, page: Option<PageNumber>, event: impl FnOnce(u64) -> Bytes) {
        locked(&self.events).push(page, event);
    }

    pub fn end(&self) {
        self.has_ended.store(true, Ordering::Release);
        self.ending.notify_one();
    }

    pub fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Acquire)
    }
}

/// Sends states to the pages until the panel ends.
pub async fn show_states(panel: &impl Visited) {
    let gate = panel.gate();
    let mut ticks = interval(STATE_EVERY);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            _ = ticks.tick() => {}
            () = gate.ending.notified() => {
                gate.states.send_replace(panel.state());
                return;
            }
        }
        panel.look();
        let (silent, has_pages) = {
            let pages = gate.pages();
            (pages.silent(Instant::now()), pages.count() > 0)
        };
        for page in silent {
            close(panel, page);
        }
        if has_pages {
            gate.states.send_replace(panel.state());
        }
    }
}

/// A page is lost.
fn close(panel: &impl Visited, page: PageNumber) {
    panel.gate().pages().close(page);
    panel.end_of(page);
    if let Some(closer) = locked(&panel.gate().closers).remove(&page) {
        closer.notify_one();
    }
}

/// An event of a stream of server-sent events.
pub fn message(name: &str, value: &impl serde::Serialize) -> Bytes {
    let value = serde_json::to_string(value)
        .unwrap_or_else(|error| json!({ "error": error.to_string() }).to_string());
    format!("event: {name}\ndata: {value}\n\n").into()
}

pub fn done() -> Response {
    json_response(StatusCode::OK, &json!({ "done": true }))
}

pub fn json_response(status: StatusCode, value: &impl serde::Serialize) -> Response {
    let text = serde_json::to_string(value).unwrap_or_default();
    (status, [(header::CONTENT_TYPE, "application/json")], text).into_response()
}

/// Why a request is not done.
pub enum Problematic {
    Denied(Denied),
    NoHeader,
    Page(PageRefusal),
    Command(StatusCode, ProblemView),
    MediaType,
    TooLarge,
    TooSlow,
    Malformed(Words),
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
        Self::command(&refusal, None)
    }
}

impl Problematic {
    /// A command that is refused, on a machine if there is one.
    pub fn command(refusal: &CommandRefusal, machine: Option<&Machine>) -> Self {
        let status = match refusal {
            CommandRefusal::Busy => StatusCode::SERVICE_UNAVAILABLE,
            _ => StatusCode::CONFLICT,
        };
        Self::Command(status, refusal.view(machine))
    }

    /// Its status and what pages are told.
    pub fn told(self) -> (StatusCode, ProblemView) {
        let (status, error, words) = match self {
            Self::Denied(denied @ (Denied::NoToken | Denied::WrongToken)) => {
                (StatusCode::UNAUTHORIZED, "token", denied.words())
            }
            Self::Denied(denied) => (StatusCode::FORBIDDEN, "site", denied.words()),
            Self::NoHeader => {
                (StatusCode::FORBIDDEN, "header", words!("the header {header} is missing", header = OWN))
            }
            Self::Page(refusal) => {
                let status = match refusal {
                    PageRefusal::TooManyPages => StatusCode::SERVICE_UNAVAILABLE,
                    PageRefusal::NotOpen => StatusCode::GONE,
                    PageRefusal::TooOften { .. } => StatusCode::TOO_MANY_REQUESTS,
                    _ => StatusCode::CONFLICT,
                };
                (status, refusal.key(), refusal.words())
            }
            Self::Command(status, view) => return (status, view),
            Self::MediaType => {
                (StatusCode::UNSUPPORTED_MEDIA_TYPE, "media_type", "a command is application/json".into())
            }
            Self::TooLarge => (
                StatusCode::PAYLOAD_TOO_LARGE,
                "too_large",
                words!("a command has at most {bytes} bytes", bytes = BODY_AT_MOST),
            ),
            Self::TooSlow => (StatusCode::REQUEST_TIMEOUT, "too_slow", "the command came too slowly".into()),
            Self::Malformed(problem) => {
                (StatusCode::BAD_REQUEST, "malformed", words!("this is no command: {problem}", problem))
            }
        };
        (status, ProblemView::of(error, words))
    }
}

impl IntoResponse for Problematic {
    fn into_response(self) -> Response {
        let (status, problem) = self.told();
        let mut response = json_response(status, &problem);
        if status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        if status == StatusCode::TOO_MANY_REQUESTS {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
        }
        response
    }
}

/// What every panel answers, beside `own`, which are the routes of this one.
pub fn routes<P: Visited>(panel: &Arc<P>, own: Router<Arc<P>>) -> Router {
    let own = own
        .route("/api/states", get(states::<P>))
        .route("/api/confirm", post(confirm::<P>))
        .route("/api/control", post(control::<P>))
        .layer(from_fn_with_state(Arc::clone(panel), own_page::<P>));
    let page = panel.files().into_iter().fold(Router::new(), |router, file| {
        let headers = [(header::CONTENT_TYPE, file.media_type)];
        router.route(file.path, get(move || async move { (headers, file.text) }))
    });
    own.merge(page).layer(from_fn_with_state(Arc::clone(panel), own_site::<P>)).with_state(Arc::clone(panel))
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

async fn own_site<P: Visited>(
    State(panel): State<Arc<P>>,
    Extension(connection): Extension<Connection>,
    request: Request,
    next: Next,
) -> Response {
    let mut response = match panel.gate().access.check_site(request.headers(), connection.local) {
        Ok(()) => next.run(request).await,
        Err(denied) => Problematic::from(denied).into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn own_page<P: Visited>(
    State(panel): State<Arc<P>>,
    Extension(connection): Extension<Connection>,
    request: Request,
    next: Next,
) -> Result<Response, Problematic> {
    if !request.headers().contains_key(OWN) {
        return Err(Problematic::NoHeader);
    }
    let checked = panel.gate().access.check_token(request.headers());
    if checked == Err(Denied::WrongToken) {
        sleep(GUESS_TAKES).await;
    }
    checked?;
    connection.admit();
    Ok(next.run(request).await)
}

/// The secret of a page or of a panel: 128 random bits.
pub fn key() -> std::io::Result<String> {
    let mut bytes = [0u8; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(format!("{:032x}", u128::from_ne_bytes(bytes)))
}

/// A page is open as long as this lives.
struct OpenPage<P: Visited> {
    panel: Arc<P>,
    number: PageNumber,
}

impl<P: Visited> Drop for OpenPage<P> {
    fn drop(&mut self) {
        close(&*self.panel, self.number);
    }
}

/// What is sent to a page.
struct Feed<P: Visited> {
    greeting: Option<Bytes>,
    states: watch::Receiver<Bytes>,
    /// The last event that was sent.
    sent: u64,
    page: OpenPage<P>,
}

impl<P: Visited> Feed<P> {
    /// The newest state, with the events until then. A page that reads slowly gets fewer of them.
    async fn next(&mut self) -> Option<Bytes> {
        if let Some(greeting) = self.greeting.take() {
            return Some(greeting);
        }
        self.states.changed().await.ok()?;
        let state = self.states.borrow_and_update().clone();
        let mut text = Vec::with_capacity(state.len() + 64);
        {
            let events = locked(&self.page.panel.gate().events);
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

async fn states<P: Visited>(
    State(panel): State<Arc<P>>,
    Extension(connection): Extension<Connection>,
) -> Result<Response, Problematic> {
    let key = key().map_err(|error| Problematic::Malformed(error.to_string().into()))?;
    let number = panel.gate().pages().open(key.clone(), Instant::now())?;
    let page = OpenPage { panel: Arc::clone(&panel), number };
    locked(&panel.gate().closers).insert(number, connection.closer);
    let greeting = message("page", &json!({ "number": number, "key": key }));
    let feed = Feed { greeting: Some(greeting), states: panel.gate().states.subscribe(), sent: 0, page };
    let stream = futures_util::stream::unfold(feed, |mut feed| async move {
        let bytes = feed.next().await?;
        Some((Ok::<_, Infallible>(bytes), feed))
    });
    Ok(([(header::CONTENT_TYPE, "text/event-stream")], Body::from_stream(stream)).into_response())
}

/// The secret of the page that asks.
pub fn page_key(headers: &HeaderMap) -> Result<&str, PageRefusal> {
    headers.get(PAGE).and_then(|value| value.to_str().ok()).ok_or(PageRefusal::NotOpen)
}

pub async fn body<T: DeserializeOwned>(request: Request) -> Result<(HeaderMap, T), Problematic> {
    let (parts, body) = request.into_parts();
    let is_json = parts.headers.get(header::CONTENT_TYPE).is_some_and(|value| value == "application/json");
    if !is_json {
        return Err(Problematic::MediaType);
    }
    let bytes = timeout(BODY_WITHIN, to_bytes(body, BODY_AT_MOST)).await;
    let bytes = bytes.map_err(|_| Problematic::TooSlow)?.map_err(|_| Problematic::TooLarge)?;
    let value =
        serde_json::from_slice(&bytes).map_err(|error| Problematic::Malformed(error.to_string().into()))?;
    Ok((parts.headers, value))
}

async fn confirm<P: Visited>(
    State(panel): State<Arc<P>>,
    headers: HeaderMap,
) -> Result<Response, Problematic> {
    panel.gate().pages().confirm(page_key(&headers)?, Instant::now())?;
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
}

async fn control<P: Visited>(State(panel): State<Arc<P>>, request: Request) -> Result<Response, Problematic> {
    let (headers, control) = body::<Control>(request).await?;
    let key = page_key(&headers)?;
    let gone = match control {
        Control::Take {} => panel.gate().pages().take(key, false, Instant::now())?,
        Control::TakeOver {} => panel.gate().pages().take(key, true, Instant::now())?,
        Control::Release {} => Some(panel.gate().pages().release(key)?),
    };
    if let Some(gone) = gone {
        panel.end_of(gone);
    }
    Ok(done())
}
