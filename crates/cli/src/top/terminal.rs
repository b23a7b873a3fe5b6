//! The shell of the view: the terminal, the connection, and the thread that waits for the controller's answers.
//!
//! A stop is sent by the thread of the keys: it waits for nothing. What has an answer is asked by a thread of its own, so that a controller that
//! is paused holds up no key.

use std::io;
use std::os::fd::AsFd;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use ratatui::crossterm::event::{
    self, Event as TerminalEvent, KeyCode, KeyEvent, KeyEventKind, KeyModifiers,
};
use takt_rt::{AxisPoint, Nanoseconds, RequestTarget};

use super::model::{Key, Model, Seen};
use super::request::Request;
use super::view::{self, Palette};
use crate::exit::Exit;
use crate::interruption;
use takt::command::Events;
use takt_remote::{Client, connect, now_ns};

/// From one picture to the next one, if no key comes.
const FRAME: Duration = Duration::from_millis(50);
/// Requests that wait for the controller.
const WAITING: usize = 16;
/// A velocity that has waited for longer is not sent.
const PERISHED_NS: Nanoseconds = 150_000_000;
/// After the end, a new controller of the same name is looked for so often.
const RETRY: Duration = Duration::from_secs(1);
/// The last requests are waited for so long at the end.
const LAST_REQUESTS: Duration = Duration::from_millis(300);

/// Shows a controller until the end is asked for.
pub fn show(name: &str, client: Client) -> Exit {
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for signals: {error}");
            return Exit::Stopped;
        }
    };
    // Restores the terminal when a panic is printed, too.
    let mut terminal = match ratatui::try_init() {
        Ok(terminal) => terminal,
        Err(error) => {
            ratatui::restore();
            say!("takt: the terminal cannot be used: {error}");
            return Exit::Usage;
        }
    };
    let palette = Palette { has_colours: std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty()) };
    let mut view = View::new(name, client);
    let result = loop {
        if interrupted.load(Ordering::Relaxed) {
            break Ok(Exit::Interrupted);
        }
        view.look();
        if let Err(error) = terminal.draw(|frame| view::draw(frame, &view.model, now_ns(), palette)) {
            break Err(error);
        }
        match view.keys() {
            Ok(true) => {}
            Ok(false) => break Ok(Exit::Done),
            Err(error) => break Err(error),
        }
    };
    // A terminal that is closed cannot be restored.
    let _ = ratatui::try_restore();
    view.end();
    result.unwrap_or_else(|error| {
        if interrupted.load(Ordering::Relaxed) {
            return Exit::Interrupted;
        }
        say!("takt: the terminal can no longer be used: {error}");
        Exit::Stopped
    })
}

/// What is to be seen of a controller now.
pub fn look(client: &Client) -> Seen {
    Seen {
        has_ended: client.has_ended(),
        snapshot: client.state(),
        timing: client.timing(),
        lease: client.lease(),
        silent_for: client.silent_for(),
    }
}

/// The model of a controller that was connected.
fn model_of(name: &str, client: &Client) -> Model {
    let machine = client.machine().clone();
    let limits = (0..machine.axes.len()).map(|axis| client.limits(axis)).collect();
    let groups =
        (0u8..).zip(&machine.groups).map(|(group, _)| client.of(RequestTarget::Group(group)).axis_numbers());
    let groups = groups.collect();
    let seen = (look(client), now_ns());
    Model::new(name, machine, (limits, groups), std::process::id(), seen)
}

struct View {
    client: Client,
    events: Events,
    model: Model,
    asker: Asker,
    retried: Instant,
}

impl View {
    fn new(name: &str, client: Client) -> Self {
        let events = client.events();
        let model = model_of(name, &client);
        Self { asker: Asker::new(client.clone()), client, events, model, retried: Instant::now() }
    }

    /// Looks at the controller, and at what became of the requests.
    fn look(&mut self) {
        for event in self.events.by_ref() {
            self.model.happened(&event);
        }
        self.model.missed_events = self.events.missed();
        self.model.observe(now_ns(), look(&self.client));
        while let Ok((request, answer)) = self.asker.answers.try_recv() {
            self.model.answered(now_ns(), &request, answer);
        }
        if self.model.seen.has_ended {
            self.reconnect();
        }
    }

    /// Takes a new controller of the same name. The lease is that of the old one, and gone.
    fn reconnect(&mut self) {
        if self.retried.elapsed() < RETRY {
            return;
        }
        self.retried = Instant::now();
        let Ok(client) = connect(&self.model.name) else { return };
        if client.process() == self.client.process() && client.has_ended() {
            return;
        }
        let name = self.model.name.clone();
        *self = Self::new(&name, client);
        self.model.message =
            Some(("another controller serves by this name now, and is shown".to_owned(), false));
    }

    /// Waits for keys until the next picture is due. Returns whether to go on.
    fn keys(&mut self) -> io::Result<bool> {
        let begun = Instant::now();
        loop {
            verify_open()?;
            if !event::poll(Duration::ZERO)? {
                let left = FRAME.saturating_sub(begun.elapsed());
                if left.is_zero() {
                    break;
                }
                wait_for_key(left)?;
                continue;
            }
            let TerminalEvent::Key(key) = event::read()? else { break };
            let Some(key) = known(key) else { continue };
            let requests = self.model.key(now_ns(), key);
            if !self.carry_out(requests) {
                return Ok(false);
            }
        }
        let requests = self.model.pass(now_ns());
        Ok(self.carry_out(requests))
    }

    /// Sends requests. Returns whether to go on.
    fn carry_out(&mut self, requests: Vec<Request>) -> bool {
        for request in requests {
            match request {
                Request::Quit => return false,
                Request::Stop { target, category } => {
                    let answer = self.client.of(target).stop(category).map_err(|error| error.to_string());
                    self.model.answered(now_ns(), &request, answer);
                }
                request => {
                    if let Err(request) = self.asker.ask(request) {
                        let why = "the controller does not answer; the request was not sent".to_owned();
                        self.model.answered(now_ns(), &request, Err(why));
                    }
                }
            }
        }
        true
    }

    /// Gives the lease back, if the controller takes it in time. To end the process does the same.
    fn end(self) {
        if self.model.commands() {
            // Without room for it, the end of the process does it.
            let _ = self.asker.ask(Request::Release);
        }
        self.asker.end();
    }
}

/// # Errors
/// The terminal is closed. crossterm would read its end for ever.
fn verify_open() -> io::Result<()> {
    wait_for_key(Duration::ZERO)
}

/// Waits until there is something to read, or the window has another size, or the time is over.
///
/// # Errors
/// The terminal is closed.
fn wait_for_key(wait: Duration) -> io::Result<()> {
    let stdin = io::stdin();
    let mut terminal = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
    let wait = PollTimeout::try_from(wait).unwrap_or(PollTimeout::ZERO);
    match poll(&mut terminal, wait) {
        Ok(_) | Err(Errno::EINTR) => {}
        Err(errno) => return Err(errno.into()),
    }
    let closed = PollFlags::POLLHUP | PollFlags::POLLERR | PollFlags::POLLNVAL;
    let is_closed = terminal.iter().filter_map(PollFd::revents).any(|events| events.intersects(closed));
    if is_closed { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}

/// A key, if it means anything.
fn known(key: KeyEvent) -> Option<Key> {
    if key.kind == KeyEventKind::Release {
        return None;
    }
    let has_control = key.modifiers.contains(KeyModifiers::CONTROL);
    Some(match key.code {
        KeyCode::Char('c') if has_control => Key::Interrupt,
        KeyCode::Char(_) if has_control || key.modifiers.contains(KeyModifiers::ALT) => return None,
        KeyCode::Char(letter) => Key::Letter(letter),
        KeyCode::Up => Key::Up,
        KeyCode::Down => Key::Down,
        KeyCode::Left => Key::Left,
        KeyCode::Right => Key::Right,
        KeyCode::Esc => Key::Escape,
        _ => return None,
    })
}

/// A request, and what became of it.
type Answer = (Request, Result<(), String>);

/// The thread that asks.
struct Asker {
    requests: SyncSender<Request>,
    answers: Receiver<Answer>,
    thread: io::Result<JoinHandle<()>>,
}

impl Asker {
    fn new(client: Client) -> Self {
        let (requests, asked) = mpsc::sync_channel::<Request>(WAITING);
        let (answered, answers) = mpsc::channel();
        let run = move || {
            for request in asked {
                let answer = ask(&client, &request);
                // Nobody waits for it any more at the end.
                let _ = answered.send((request, answer));
            }
        };
        Self { requests, answers, thread: thread::Builder::new().name("takt-ask".to_owned()).spawn(run) }
    }

    /// Hands a request over, or back if it finds no room.
    fn ask(&self, request: Request) -> Result<(), Request> {
        match self.requests.try_send(request) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(request) | TrySendError::Disconnected(request)) => Err(request),
        }
    }

    /// Waits for the last answers for a moment.
    fn end(self) {
        drop(self.requests);
        let begun = Instant::now();
        while self.thread.as_ref().is_ok_and(|thread| !thread.is_finished())
            && begun.elapsed() < LAST_REQUESTS
        {
            thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Asks, and waits for the answer.
fn ask(client: &Client, request: &Request) -> Result<(), String> {
    let is_late = |since: Nanoseconds| now_ns().saturating_sub(since) > PERISHED_NS;
    if request.perishes_since().is_some_and(is_late) {
        return Err("the controller answers too slowly to be jogged".to_owned());
    }
    let result = match request {
        Request::Stop { target, category } => client.of(*target).stop(*category),
        Request::TakeLease | Request::RenewLease => client.take_lease(),
        Request::TakeOver => client.take_over(),
        Request::Release => client.release(),
        Request::Enable(target) => client.of(*target).enable(),
        Request::Disable(target) => client.of(*target).disable(),
        Request::ClearFaults(target) => client.of(*target).reset_faults(),
        Request::BeginStream(target) => client.of(*target).begin_stream(),
        Request::Velocities { target, at_ns, velocities } => {
            let axes: Vec<AxisPoint> =
                velocities.iter().map(|velocity| AxisPoint::Velocity(*velocity)).collect();
            return client.of(*target).stream().push(*at_ns, &axes).map_err(|error| error.to_string());
        }
        Request::ProfileVelocity { axis, velocity, valid_for, .. } => {
            client.velocity(*axis, *velocity, *valid_for).map(|_| ())
        }
        Request::Quit => Ok(()),
    };
    result.map_err(|error| error.to_string())
}
