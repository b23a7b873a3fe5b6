//! The thread that answers scrapers: an ordinary one, which never waits for any of them.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::request::{HEAD_BYTES, answer, wish};

/// Connections at a time. The one that has been there for longest makes room for another one.
const CONNECTIONS: usize = 16;
/// A connection is closed after this time, whether its answer has been taken or not.
const LONGEST: Duration = Duration::from_secs(5);
/// How often it is looked whether the end has come.
const LOOK_MS: u16 = 200;

/// Answers until it is dropped.
pub struct Server {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Begins to answer with what `metrics` returns.
    ///
    /// # Errors
    /// The address cannot be listened at, or there is no thread.
    pub fn start(
        address: SocketAddr,
        metrics: impl Fn() -> String + Send + 'static,
    ) -> io::Result<(Self, SocketAddr)> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let bound = listener.local_addr()?;
        let is_over = Arc::new(AtomicBool::new(false));
        let end = Arc::clone(&is_over);
        let run = move || {
            let mut connections = vec![];
            while !end.load(Ordering::Acquire) {
                turn(&listener, &mut connections, &metrics);
            }
        };
        let thread = Some(thread::Builder::new().name("takt-metrics".to_owned()).spawn(run)?);
        Ok((Self { is_over, thread }, bound))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A thread that has panicked has told so.
            let _ = thread.join();
        }
    }
}

/// One client.
struct Connection {
    stream: TcpStream,
    begun: Instant,
    received: Vec<u8>,
    /// What is still to be sent; `None` until the request is complete.
    unsent: Option<Vec<u8>>,
}

/// Waits until something happens, and does what can be done at once.
fn turn(listener: &TcpListener, connections: &mut Vec<Connection>, metrics: &impl Fn() -> String) {
    let mut watched = vec![PollFd::new(listener.as_fd(), PollFlags::POLLIN)];
    watched.extend(connections.iter().map(|connection| {
        let event = if connection.unsent.is_some() { PollFlags::POLLOUT } else { PollFlags::POLLIN };
        PollFd::new(connection.stream.as_fd(), event)
    }));
    if poll(&mut watched, PollTimeout::from(LOOK_MS)).is_err() {
        thread::sleep(Duration::from_millis(LOOK_MS.into()));
    }
    drop(watched);
    connections.retain_mut(|connection| connection.begun.elapsed() < LONGEST && connection.go_on(metrics));
    while let Ok((stream, _)) = listener.accept() {
        if stream.set_nonblocking(true).is_err() {
            continue;
        }
        if connections.len() == CONNECTIONS {
            connections.remove(0);
        }
        connections.push(Connection { stream, begun: Instant::now(), received: vec![], unsent: None });
    }
}

impl Connection {
    /// Reads and writes what can be at once. Returns whether there is more to do.
    fn go_on(&mut self, metrics: &impl Fn() -> String) -> bool {
        if self.unsent.is_none() && !self.receive(metrics) {
            return false;
        }
        let Some(unsent) = &mut self.unsent else { return true };
        match self.stream.write(unsent) {
            Ok(sent) => {
                unsent.drain(..sent);
                !unsent.is_empty() || !self.close()
            }
            Err(error) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
        }
    }

    /// Ends the answer. What the client has sent beyond its request would take the answer from it.
    fn close(&mut self) -> bool {
        let _ = self.stream.shutdown(std::net::Shutdown::Write);
        let mut rest = [0; HEAD_BYTES];
        let _ = self.stream.read(&mut rest);
        true
    }

    /// Receives what has come. Returns whether the client is still there.
    fn receive(&mut self, metrics: &impl Fn() -> String) -> bool {
        let mut bytes = [0; HEAD_BYTES];
        let room = HEAD_BYTES.saturating_sub(self.received.len());
        match self.stream.read(bytes.get_mut(..room).unwrap_or_default()) {
            Ok(0) => return false,
            Ok(count) => self.received.extend(bytes.iter().take(count)),
            Err(error) => return matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
        }
        self.unsent = wish(&self.received).map(|wish| answer(wish, metrics));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start() -> (Server, SocketAddr) {
        // Larger than what the kernel takes of a client that reads nothing.
        Server::start("127.0.0.1:0".parse().unwrap(), || "takt_text 1\n".repeat(1 << 20)).unwrap()
    }

    fn ask(address: SocketAddr) -> TcpStream {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(b"GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n").unwrap();
        stream
    }

    fn whole_answer(address: SocketAddr) -> String {
        let mut text = String::new();
        ask(address).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn clients_that_send_or_read_nothing_hold_up_no_other_one() {
        let (_server, address) = start();
        let silent: Vec<TcpStream> =
            (0..2 * CONNECTIONS).map(|_| TcpStream::connect(address).unwrap()).collect();
        let unread: Vec<TcpStream> = (0..2 * CONNECTIONS).map(|_| ask(address)).collect();
        for _ in 0..3 {
            let text = whole_answer(address);
            assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.ends_with("takt_text 1\n"));
            assert!(text.len() > 12 << 20, "{}", text.len());
        }
        drop((silent, unread));
    }

    #[test]
    fn an_address_in_use_is_an_error_and_free_again_after_the_end() {
        let (server, address) = start();
        assert_eq!(
            Server::start(address, String::new).err().map(|error| error.kind()),
            Some(ErrorKind::AddrInUse)
        );
        drop(server);
        assert!(Server::start(address, String::new).is_ok());
    }
}
