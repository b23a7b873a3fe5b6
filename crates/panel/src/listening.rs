//! A panel listens: where, for whom, and on which threads.

use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use axum::Router;
use tokio::time::sleep;

use super::access::{Access, AccessError};
use super::bench::{self, Bench, Worker, Workplace};
use super::connections::{self, Bounds};
use super::gate::{self, Visited};
use super::server::{self, FrameSource, Server, TakeLease};
use takt::command::AnyHandle;

/// How long pages are given to read that the panel has ended.
const CLOSING_TIME: Duration = Duration::from_millis(150);

/// The token that every request of a page must carry.
#[derive(Clone, Debug)]
pub enum PanelToken {
    /// A new one, which is part of the address: see [`Panel::url`].
    New,
    /// This one, which pages ask for.
    Given(String),
    /// None: every user of the computer may command. It listens on loopback alone.
    Open,
}

/// How the panel is reached.
#[derive(Clone, Debug)]
pub struct PanelOptions {
    /// Where it listens.
    pub address: SocketAddr,
    /// The token.
    pub token: PanelToken,
    /// Where pages may come from beside the own address: that of a reverse proxy, as `https://robot.example`.
    pub origins: Vec<String>,
}

/// Why there is no panel.
#[derive(thiserror::Error)]
pub enum PanelError {
    /// It would be open to others without a token.
    #[error(
        "the panel at {address} would be open to the network: with --panel-open it listens on loopback alone, as at 127.0.0.1"
    )]
    NoToken {
        /// Where it was to listen.
        address: SocketAddr,
    },
    /// The token or an origin cannot be one.
    #[error(transparent)]
    Access(#[from] AccessError),
    /// It cannot listen there.
    #[error("the panel cannot listen at {address}: {}", match error.kind() {
        io::ErrorKind::AddrInUse => "another program does; choose another port, or 0 for a free one".to_owned(),
        io::ErrorKind::AddrNotAvailable => "this host has no such address".to_owned(),
        io::ErrorKind::PermissionDenied => "this user may not; choose a port from 1024 on".to_owned(),
        _ => error.to_string(),
    })]
    Listen {
        /// Where it was to listen.
        address: SocketAddr,
        /// Why it cannot.
        error: io::Error,
    },
    /// A thread or the runtime cannot be had.
    #[error("the panel cannot be started: {0}")]
    Thread(io::Error),
}

impl fmt::Debug for PanelError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// Reads where a panel listens: `127.0.0.1:8080`, `localhost:8080`, `[::1]:8080`, or a port on loopback alone.
///
/// # Errors
/// What is wrong, in words.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse::<u16>() {
        return Ok((Ipv4Addr::LOCALHOST, port).into());
    }
    if let Ok(address) = text.parse() {
        return Ok(address);
    }
    if text.parse::<IpAddr>().is_ok() {
        return Err("the port is missing, as in 127.0.0.1:8080".to_owned());
    }
    let found = text.to_socket_addrs().ok().and_then(|found| found.min_by_key(SocketAddr::is_ipv6));
    found.ok_or_else(|| "an address is a host and a port, as in 127.0.0.1:8080".to_owned())
}

/// A panel that listens, and has no controller yet: browsers that come meanwhile wait.
pub struct Listening {
    listener: TcpListener,
    url: String,
    access: Access,
}

impl Listening {
    /// Begins to listen.
    ///
    /// # Errors
    /// See [`PanelError`].
    pub fn begin(options: &PanelOptions) -> Result<Self, PanelError> {
        let address = options.address;
        let (token, is_in_url) = match &options.token {
            PanelToken::New => (Some(gate::key().map_err(PanelError::Thread)?), true),
            PanelToken::Given(token) => (Some(token.clone()), false),
            PanelToken::Open if address.ip().to_canonical().is_loopback() => (None, false),
            PanelToken::Open => return Err(PanelError::NoToken { address }),
        };
        let access = Access::new(token.clone(), &options.origins)?;
        let failed = |error| PanelError::Listen { address, error };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        // Browsers send no fragment: the token comes into no log.
        let fragment = token.filter(|_| is_in_url).map_or(String::new(), |token| format!("#token={token}"));
        Ok(Self { listener, url: format!("http://{address}/{fragment}"), access })
    }

    /// Shows a controller from now on. `take_lease` takes it over from another process; `frames` are for the monitor.
    ///
    /// # Errors
    /// [`PanelError::Thread`].
    pub fn show(
        self,
        controller: impl Into<AnyHandle>,
        take_lease: Option<TakeLease>,
        frames: Option<FrameSource>,
    ) -> Result<Panel, PanelError> {
        let server = Arc::new(Server::new(controller.into(), self.access, take_lease, frames.is_some()));
        let mut threads = Threads::new(Arc::<Server>::clone(&server));
        let routes = server::routes(&server);
        let commands = server.commands();
        let start = || {
            threads.serve(Arc::clone(&server), routes, self.listener)?;
            let own = Arc::clone(&server);
            threads.spawn("takt-panel-event", move || own.collect_events())?;
            let own = Arc::clone(&server);
            threads.spawn("takt-panel-command", move || own.carry_out(&commands))?;
            if let Some(frames) = frames {
                let own = Arc::clone(&server);
                threads.spawn("takt-panel-frames", move || own.collect_frames(frames))?;
            }
            threads.spawn("takt-panel-motion", move || server.lead_motions())
        };
        start().map_err(PanelError::Thread)?;
        let is_taken_over = Box::new(|| false);
        Ok(Panel { _threads: threads, url: self.url, is_taken_over })
    }

    /// Commissions drives on buses without a controller from now on.
    ///
    /// # Errors
    /// [`PanelError::Thread`].
    pub fn commission(self, place: Workplace) -> Result<Panel, PanelError> {
        let bench = Arc::new(Bench::new(self.access, place.told()));
        let mut threads = Threads::new(Arc::<Bench>::clone(&bench));
        let worker = Worker::new(Arc::clone(&bench), place);
        let routes = bench::routes(&bench);
        let start = || {
            threads.serve(Arc::clone(&bench), routes, self.listener)?;
            threads.spawn("takt-bench", move || worker.run())
        };
        start().map_err(PanelError::Thread)?;
        let is_taken_over = Box::new(move || bench.is_taken_over());
        Ok(Panel { _threads: threads, url: self.url, is_taken_over })
    }
}

/// A panel that is open as long as it lives. When it is dropped, what its pages have set in motion comes to rest.
pub struct Panel {
    _threads: Threads,
    url: String,
    is_taken_over: Box<dyn Fn() -> bool + Send + Sync>,
}

impl Panel {
    /// What a browser opens. A token that was made for this panel is part of it.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Returns `true` if it has ended because another process takes the buses of commissioning over.
    pub fn is_taken_over(&self) -> bool {
        (self.is_taken_over)()
    }
}

/// The threads of a panel. They end when this is dropped.
struct Threads {
    panel: Arc<dyn Visited>,
    running: Vec<JoinHandle<()>>,
}

impl Threads {
    fn new(panel: Arc<dyn Visited>) -> Self {
        Self { panel, running: vec![] }
    }

    /// Serves pages on a thread of its own.
    fn serve<P: Visited>(&mut self, panel: Arc<P>, routes: Router, listener: TcpListener) -> io::Result<()> {
        let (runtime, listener) = connections::runtime(listener)?;
        self.spawn("takt-panel", move || runtime.block_on(serve(&*panel, routes, listener)))
    }

    fn spawn(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> io::Result<()> {
        self.running.push(thread::Builder::new().name(name.to_owned()).spawn(run)?);
        Ok(())
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.panel.end();
        for thread in self.running.drain(..) {
            // A thread that has panicked has told so.
            let _ = thread.join();
        }
    }
}

/// Serves pages until the panel ends.
async fn serve(panel: &impl Visited, routes: Router, listener: tokio::net::TcpListener) {
    tokio::select! {
        () = connections::accept(routes, listener, Bounds::PANEL) => {}
        () = gate::show_states(panel) => sleep(CLOSING_TIME).await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_host_and_a_port_or_a_port_of_loopback() {
        let is = |text: &str, expected: &str| assert_eq!(address(text).unwrap().to_string(), expected);
        is("127.0.0.1:8080", "127.0.0.1:8080");
        is("8080", "127.0.0.1:8080");
        is("localhost:0", "127.0.0.1:0");
        is("[::1]:8080", "[::1]:8080");
        assert!(address("127.0.0.1").unwrap_err().contains("port is missing"));
        for wrong in ["", "x", "70000", "127.0.0.1:70000", "http://127.0.0.1:8080"] {
            assert!(address(wrong).is_err(), "{wrong}");
        }
    }
}
