//! The sockets of the panel, and their bounds: how many, how long a request may take to come, and that nobody who reads slowly holds up
//! anybody else.
//!
//! Connections that have shown the token, and those that have not, have places of their own. Without the token a connection has a second
//! for each request, and gives its place to a newer one when there are too many. So strangers, silent or not, keep nobody with the token out.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Runtime;
use tokio::sync::Notify;
use tokio::time::sleep;

use super::lock::locked;

/// Connections with the token that may be open at the same time: a browser opens six for a page at most.
const ADMITTED_AT_MOST: usize = 320;
/// Bounds of connections that have not shown the token.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// How many may be open at the same time.
    pub count: usize,
    /// Time for each request.
    pub request_within: Duration,
}

impl Bounds {
    /// Those of a panel.
    pub const PANEL: Self = Self { count: 256, request_within: Duration::from_secs(1) };
}

/// The head of a request must have come after so long, and a connection without a request is closed then.
const HEAD_WITHIN: Duration = Duration::from_secs(10);
/// The largest head of a request, in bytes.
const HEAD_AT_MOST: usize = 16 * 1024;
/// The connection that a request has come by.
#[derive(Clone, Debug)]
pub struct Connection {
    /// The address of this host that it was made to.
    pub local: SocketAddr,
    /// Closes it.
    pub closer: Arc<Notify>,
    number: u64,
    request_within: Duration,
    requests: Arc<AtomicU64>,
    places: Arc<Places>,
}

impl Connection {
    /// It has shown the token. Without a free place for those that have, it stays among the others.
    pub fn admit(&self) {
        self.places.admit(self.number);
    }

    /// Returns when it has sent no request for its time, and has not shown the token.
    async fn is_silent(&self) {
        loop {
            let requests = self.requests.load(Ordering::Relaxed);
            sleep(self.request_within).await;
            if requests == self.requests.load(Ordering::Relaxed) && !self.places.is_admitted(self.number) {
                return;
            }
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        locked(&self.places.0).retain(|entry| entry.number != self.number);
    }
}

/// The connections that are open, in the order in which they came.
#[derive(Debug, Default)]
struct Places(Mutex<VecDeque<Entry>>);

#[derive(Debug)]
struct Entry {
    number: u64,
    is_admitted: bool,
    closer: Arc<Notify>,
}

/// A connection counts as long as this lives.
struct Place {
    number: u64,
    places: Arc<Places>,
}

impl Places {
    /// A new connection has not shown the token. One too many of these takes the place of the oldest.
    fn enter(self: &Arc<Self>, number: u64, closer: Arc<Notify>, strangers_at_most: usize) -> Place {
        let mut entries = locked(&self.0);
        if entries.iter().filter(|entry| !entry.is_admitted).count() >= strangers_at_most
            && let Some(oldest) = entries.iter().position(|entry| !entry.is_admitted)
            && let Some(oldest) = entries.remove(oldest)
        {
            oldest.closer.notify_one();
        }
        entries.push_back(Entry { number, is_admitted: false, closer });
        Place { number, places: Arc::clone(self) }
    }

    fn admit(&self, number: u64) {
        let mut entries = locked(&self.0);
        let has_room = entries.iter().filter(|entry| entry.is_admitted).count() < ADMITTED_AT_MOST;
        if let Some(entry) = entries.iter_mut().find(|entry| entry.number == number) {
            entry.is_admitted |= has_room;
        }
    }

    fn is_admitted(&self, number: u64) -> bool {
        locked(&self.0).iter().any(|entry| entry.number == number && entry.is_admitted)
    }
}

/// What runs the server of a listener on one thread.
///
/// # Errors
/// The operating system refuses it.
pub fn runtime(listener: std::net::TcpListener) -> io::Result<(Runtime, TcpListener)> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    listener.set_nonblocking(true)?;
    let listener = {
        let _guard = runtime.enter();
        TcpListener::from_std(listener)?
    };
    Ok((runtime, listener))
}

/// Accepts connections, and serves pages on each.
pub async fn accept(routes: axum::Router, listener: TcpListener, bounds: Bounds) {
    let places = Arc::<Places>::default();
    let routes = TowerToHyperService::new(routes);
    for number in 0.. {
        let Ok((stream, _)) = listener.accept().await else {
            // Too many files are open, or the connection has gone already.
            sleep(Duration::from_millis(50)).await;
            continue;
        };
        let Ok(local) = stream.local_addr() else { continue };
        let (closer, requests) = (Arc::<Notify>::default(), Arc::default());
        let Bounds { count, request_within } = bounds;
        let place = places.enter(number, Arc::clone(&closer), count);
        let places = Arc::clone(&places);
        let connection = Connection { local, closer, number, request_within, requests, places };
        let routes = routes.clone();
        tokio::spawn(async move {
            converse(stream, connection, routes).await;
            drop(place);
        });
    }
}

async fn converse(stream: TcpStream, connection: Connection, routes: TowerToHyperService<axum::Router>) {
    // A command is small and must not wait for more of them; where the option is refused it only comes later.
    let _ = stream.set_nodelay(true);
    let own = connection.clone();
    let service = service_fn(move |mut request: hyper::Request<hyper::body::Incoming>| {
        connection.requests.fetch_add(1, Ordering::Relaxed);
        request.extensions_mut().insert(connection.clone());
        routes.call(request)
    });
    let conversation = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_WITHIN)
        .max_buf_size(HEAD_AT_MOST)
        .serve_connection(TokioIo::new(stream), service);
    tokio::select! {
        // A client that breaks off, or sends what is no request, has been answered as far as that goes.
        _ = conversation => {}
        () = own.closer.notified() => {}
        () = own.is_silent() => {}
    }
}
