//! The sockets of the panel, and their bounds: how many, how long a request may take to come, and that nobody who reads slowly holds up
//! anybody else.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, Semaphore};
use tokio::time::sleep;

use super::gate::{Visited, show_states};

/// Connections that may be open at the same time: a browser opens six for a page at most.
const CONNECTIONS_AT_MOST: usize = 320;
/// The head of a request must have come after so long, and a connection without a request is closed then.
const HEAD_WITHIN: Duration = Duration::from_secs(10);
/// The largest head of a request, in bytes.
const HEAD_AT_MOST: usize = 16 * 1024;
/// How long pages are given to read that the panel has ended.
const CLOSING_TIME: Duration = Duration::from_millis(150);

/// The connection that a request has come by.
#[derive(Clone, Debug)]
pub struct Connection {
    /// The address of this host that it was made to.
    pub local: SocketAddr,
    /// Closes it.
    pub closer: Arc<Notify>,
}

/// Serves pages until the panel ends.
pub async fn serve(panel: &impl Visited, routes: axum::Router, listener: TcpListener) {
    tokio::select! {
        () = accept(routes, listener) => {}
        () = show_states(panel) => sleep(CLOSING_TIME).await,
    }
}

async fn accept(routes: axum::Router, listener: TcpListener) {
    let room = Arc::new(Semaphore::new(CONNECTIONS_AT_MOST));
    let routes = TowerToHyperService::new(routes);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Too many files are open, or the connection has gone already.
            sleep(Duration::from_millis(50)).await;
            continue;
        };
        // Without room the connection is closed at once, and the browser says so.
        let Ok(place) = Arc::clone(&room).try_acquire_owned() else { continue };
        let Ok(local) = stream.local_addr() else { continue };
        let connection = Connection { local, closer: Arc::default() };
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
    let closer = Arc::clone(&connection.closer);
    let service = service_fn(move |mut request: hyper::Request<hyper::body::Incoming>| {
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
        () = closer.notified() => {}
    }
}
