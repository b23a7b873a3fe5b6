//! A page of numbers for Prometheus, at an address of its own.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use axum::Router;
use axum::http::StatusCode;
use axum::http::header::{CONNECTION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::Notify;

use super::connections::{self, Bounds};

/// The media type of the text exposition format.
const EXPOSITION: &str = "text/plain; version=0.0.4; charset=utf-8";
/// A scraper asks once on a connection.
const BOUNDS: Bounds = Bounds { count: 16, request_within: Duration::from_secs(5) };

/// Serves `/metrics` until it is dropped.
#[derive(Debug)]
pub struct MetricsServer {
    address: SocketAddr,
    ending: Arc<Notify>,
    thread: Option<JoinHandle<()>>,
}

impl MetricsServer {
    /// Begins to answer with what `text` returns.
    ///
    /// # Errors
    /// The address cannot be listened at, or there is no thread.
    pub fn begin(
        address: SocketAddr,
        text: impl Fn() -> String + Clone + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let (runtime, listener) = connections::runtime(listener)?;
        let ending = Arc::<Notify>::default();
        let end = Arc::clone(&ending);
        let routes = routes(text);
        let run = move || {
            runtime.block_on(async {
                tokio::select! {
                    () = connections::accept(routes, listener, BOUNDS) => {}
                    () = end.notified() => {}
                }
            });
        };
        let thread = Some(thread::Builder::new().name("takt-metrics".to_owned()).spawn(run)?);
        Ok(Self { address, ending, thread })
    }

    /// Where it listens.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for MetricsServer {
    fn drop(&mut self) {
        self.ending.notify_one();
        if let Some(thread) = self.thread.take() {
            // A thread that has panicked has told so.
            let _ = thread.join();
        }
    }
}

fn routes(text: impl Fn() -> String + Clone + Send + Sync + 'static) -> Router {
    let metrics = get(move || async move { answer(StatusCode::OK, EXPOSITION, text()) });
    Router::new()
        .route("/metrics", metrics)
        .method_not_allowed_fallback(|| async { refusal(StatusCode::METHOD_NOT_ALLOWED) })
        .fallback(|| async { refusal(StatusCode::NOT_FOUND) })
}

fn refusal(status: StatusCode) -> Response {
    answer(status, "text/plain; charset=utf-8", format!("{status}: the metrics are at /metrics\n"))
}

fn answer(status: StatusCode, media_type: &'static str, text: String) -> Response {
    (status, [(CONTENT_TYPE, media_type), (CONNECTION, "close")], text).into_response()
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use super::*;

    fn start() -> MetricsServer {
        // Larger than what the kernel takes of a client that reads nothing.
        MetricsServer::begin("127.0.0.1:0".parse().unwrap(), || "takt_text 1\n".repeat(1 << 20)).unwrap()
    }

    fn ask(address: SocketAddr, head: &str) -> TcpStream {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        stream
    }

    fn answer_to(address: SocketAddr, head: &str) -> String {
        let mut text = String::new();
        ask(address, head).read_to_string(&mut text).unwrap();
        text
    }

    const GET: &str = "GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n";

    #[test]
    fn clients_that_send_or_read_nothing_hold_up_no_other_one() {
        let server = start();
        let silent: Vec<TcpStream> =
            (0..2 * BOUNDS.count).map(|_| TcpStream::connect(server.address()).unwrap()).collect();
        let unread: Vec<TcpStream> = (0..2 * BOUNDS.count).map(|_| ask(server.address(), GET)).collect();
        for _ in 0..3 {
            let text = answer_to(server.address(), GET);
            assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.ends_with("takt_text 1\n"));
            assert!(text.len() > 12 << 20, "{}", text.len());
        }
        drop((silent, unread));
    }

    #[test]
    fn an_address_in_use_is_an_error_and_free_again_after_the_end() {
        let server = start();
        let address = server.address();
        let again = MetricsServer::begin(address, String::new);
        assert_eq!(again.err().map(|error| error.kind()), Some(io::ErrorKind::AddrInUse));
        drop(server);
        assert!(MetricsServer::begin(address, String::new).is_ok());
    }

    #[test]
    fn a_head_alone_has_no_text_and_what_is_not_there_or_not_allowed_is_refused() {
        let server = MetricsServer::begin("127.0.0.1:0".parse().unwrap(), || "takt 1\n".to_owned()).unwrap();
        let request = |line: &str| answer_to(server.address(), &format!("{line}\r\nHost: here\r\n\r\n"));
        let whole = request("GET /metrics?x=1 HTTP/1.0");
        assert!(whole.contains(" 200 OK\r\n") && whole.ends_with("\r\n\r\ntakt 1\n"), "{whole}");
        assert!(whole.contains(EXPOSITION) && whole.contains("content-length: 7\r\n"), "{whole}");
        let head = request("HEAD /metrics HTTP/1.1");
        assert!(head.contains("content-length: 7\r\n") && head.ends_with("\r\n\r\n"), "{head}");
        for (line, words) in [
            ("GET / HTTP/1.1", "404 Not Found: the metrics are at /metrics\n"),
            ("POST /metrics HTTP/1.1", "405 Method Not Allowed: the metrics are at /metrics\n"),
            ("@", "HTTP/1.1 400 Bad Request\r\n"),
        ] {
            let refused = request(line);
            assert!(refused.contains(words), "{line}: {refused}");
        }
        assert!(request("POST /metrics HTTP/1.1").contains("allow: GET,HEAD\r\n"));
    }
}
