//! The connections of a client with the process of a controller: what it observes, and a demand and its answer.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use takt::command::{Command, CommandError, Reply, StreamError, WaitError};
use takt::trajectory::TrajectoryPoint;
use takt_rt::{Nanoseconds, RequestTarget, StopCategory};

use crate::commands::{Asked, Demand, StopRequest, packets_of_points};
use crate::layout::Description;
use crate::no_answer::{LOOK, NoAnswer, REPLY_WITHIN};
use crate::replies::{Answer, Replied};
use crate::shown::{Shown, now_ns};
use crate::socket::{Names, PACKET_BYTES, Packets, Received, Role};
use crate::stops::Stops;

/// A controller of another process, as what the handle of a [`Client`](crate::Client) stands on.
pub struct Connection {
    pub(crate) names: Names,
    pub(crate) shown: Shown,
    pub(crate) description: Description,
    /// It is closed when the process of the controller ends.
    observer: Packets,
    stops: Stops,
    /// Where commands are sent; connected by the first one.
    commands: Mutex<Commands>,
    /// The slot of the last answer.
    answered_at: AtomicU64,
}

#[derive(Default)]
struct Commands {
    connection: Option<Packets>,
    /// The number of the last demand.
    number: u64,
}

impl Connection {
    /// The controller of these names that shows itself so.
    pub(crate) fn new(names: Names, shown: Shown, description: Description, observer: Packets) -> Self {
        let (stops, commands) = (Stops::new(&names, &observer), Mutex::default());
        Self { names, shown, description, observer, stops, commands, answered_at: AtomicU64::new(0) }
    }

    /// Returns `true` if the controller has ended, or its process.
    pub(crate) fn is_over(&self) -> bool {
        self.shown.has_ended() || self.observer.is_closed()
    }

    /// Looks after each cycle, and when the other process ends.
    pub(crate) fn await_found<T>(
        &self,
        at_most: Duration,
        mut look: impl FnMut() -> Option<T>,
    ) -> Result<T, WaitError> {
        let deadline = Instant::now().checked_add(at_most);
        // A wait says by itself that the process has ended, or that its time is over.
        let _ = self.await_stops(at_most.min(REPLY_WITHIN));
        loop {
            // These are read before what is looked at, so that the last of it before the end is seen, and nothing is slept through.
            let (seen, has_ended) = (self.shown.states(), self.is_over());
            if let Some(found) = look() {
                return Ok(found);
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            let left = deadline.map_or(LOOK, |deadline| deadline.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return Err(WaitError::NotInTime);
            }
            self.shown.wait(seen, left.min(LOOK));
        }
    }

    fn await_stops(&self, at_most: Duration) -> Result<(), NoAnswer> {
        self.stops.await_taken(at_most, || self.is_over())
    }

    /// Asks, and waits for the answer.
    fn ask(&self, asked: Asked) -> Result<Replied, NoAnswer> {
        self.await_stops(REPLY_WITHIN)?;
        let asked_ns = now_ns();
        // A panic of another holder of the lock leaves a connection whose replies have other numbers.
        let mut commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        self.ask_by(&mut commands, asked_ns, asked)
    }

    fn ask_by(
        &self,
        commands: &mut Commands,
        asked_ns: Nanoseconds,
        asked: Asked,
    ) -> Result<Replied, NoAnswer> {
        if self.is_over() {
            return Err(NoAnswer::Ended);
        }
        commands.number += 1;
        let number = commands.number;
        let connection = match &mut commands.connection {
            Some(connection) => connection,
            place => place.insert(self.connected()?),
        };
        let sent = connection.send(&Demand { number, asked_ns, asked }.packet());
        let answer = match sent {
            Ok(()) => self.answer(connection, number),
            Err(_) => None,
        };
        match answer {
            Some(answer) => answer,
            None => {
                // The other process has closed it: it is gone, or it takes no commands of this client.
                commands.connection = None;
                Err(NoAnswer::Ended)
            }
        }
    }

    /// A connection for commands with the process whose state is observed.
    fn connected(&self) -> Result<Packets, NoAnswer> {
        let connection = Packets::connect_as(self.names.command(), Role::Commands);
        let connection = connection.map_err(|error| NoAnswer::from(error.kind()))?;
        // Another process may have the name by now.
        if connection.peer() != self.observer.peer() || connection.wait_at_most(REPLY_WITHIN).is_err() {
            return Err(NoAnswer::Ended);
        }
        Ok(connection)
    }

    /// The answer to a demand; `None` if the connection is closed.
    fn answer(&self, connection: &Packets, number: u64) -> Option<Result<Replied, NoAnswer>> {
        let begun = Instant::now();
        let mut packet = [0; PACKET_BYTES];
        loop {
            match connection.receive(&mut packet, true) {
                Received::Bytes(count) => match Answer::of(packet.get(..count)?) {
                    Some(answer) if answer.number == number || answer.number == u64::MAX => {
                        self.answered_at.fetch_max(answer.slot, Ordering::AcqRel);
                        return Some(Ok(answer.reply));
                    }
                    // The late answer to a demand that was waited for no longer.
                    Some(_) => {}
                    None => return None,
                },
                Received::Nothing if begun.elapsed() >= REPLY_WITHIN => return Some(Err(NoAnswer::NoReply)),
                Received::Nothing => {}
                Received::Closed => return None,
            }
        }
    }

    /// Waits until the state that is shown is as new as the last answer. So whoever commands sees what has become of it.
    fn await_answered_state(&self) {
        let answered_at = self.answered_at.load(Ordering::Acquire);
        // It is shown within a cycle. A process that is paused meanwhile shows an older one for longer.
        let _ = self
            .await_found(REPLY_WITHIN, || (self.shown.state().snapshot.slot >= answered_at).then_some(()));
    }

    /// Asks for what any controller can be asked.
    pub(crate) fn command(&self, command: Command) -> Result<Reply, CommandError> {
        let is_shown = !command.only_reads();
        let replied = match command {
            Command::Execute { target, points } => self.trajectory(target, &points, true)?,
            Command::Through { target, waypoints } => {
                let point = |positions| TrajectoryPoint { positions, ..TrajectoryPoint::default() };
                let points: Vec<TrajectoryPoint> = waypoints.into_iter().map(point).collect();
                self.trajectory(target, &points, false)?
            }
            command => self.ask(command.into())?,
        };
        let Replied::Command(reply) = replied else { return Err(CommandError::Unanswered) };
        if is_shown && reply.is_ok() {
            self.await_answered_state();
        }
        reply
    }

    /// Hands points to a stream.
    pub(crate) fn points(&self, asked: Asked) -> Result<(), StreamError> {
        match self.ask(asked)? {
            Replied::Points(taken) => taken,
            Replied::Command(Err(CommandError::Lease(error))) => Err(error.into()),
            Replied::Command(_) => Err(StreamError::Ended),
        }
    }

    /// Hands the points of a trajectory over, and asks to carry it out.
    fn trajectory(
        &self,
        target: RequestTarget,
        points: &[TrajectoryPoint],
        is_timed: bool,
    ) -> Result<Replied, NoAnswer> {
        self.await_stops(REPLY_WITHIN)?;
        let asked_ns = now_ns();
        let mut commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        for packet in packets_of_points(target, points) {
            let replied = self.ask_by(&mut commands, asked_ns, packet)?;
            if replied != Replied::Command(Ok(Reply::Done)) {
                return Ok(replied);
            }
        }
        let asked = Asked::Trajectory { target, points: points.len(), is_timed };
        self.ask_by(&mut commands, asked_ns, asked)
    }

    /// Sends a stop. It waits for nothing, allocates nothing and takes no lock.
    pub(crate) fn send_stop(
        &self,
        target: RequestTarget,
        category: StopCategory,
    ) -> Result<(), CommandError> {
        if self.shown.has_ended() {
            return Err(CommandError::Ended);
        }
        self.stops.send(StopRequest { target, category })
    }
}
