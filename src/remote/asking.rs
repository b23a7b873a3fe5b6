//! Asking the process of a controller: a demand and its answer, and stops.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use takt_rt::{Nanoseconds, RequestTarget, StopCategory};

use super::client::{Client, LOOK};
use super::commands::{Command, Demand, StopRequest, packets_of_points};
use super::replies::{Answer, REPLY_WITHIN, Reply};
use super::shown::now_ns;
use super::socket::{Names, PACKET_WORDS, Packets, Received, Role};
use crate::command::{CommandError, LeaseError, MotionId, StreamError, TrajectoryProgress};
use crate::trajectory::TrajectoryPoint;

/// The connections by which a client asks.
pub(super) struct Asking {
    /// Where stops are sent; or why they cannot be.
    stops: Result<Packets, io::ErrorKind>,
    /// The stops that were sent, and how many of them the other process has taken.
    stops_sent: AtomicU64,
    stops_taken: AtomicU64,
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

impl Asking {
    /// The controller of these names that is observed is asked.
    pub fn new(names: &Names, observer: &Packets) -> Self {
        let stops = Packets::connect_as(names.command(), Role::Stops).map_err(|error| error.kind());
        let is_same = |stops: &Packets| stops.peer() == observer.peer();
        Self {
            // Another process may have the name by now.
            stops: stops.and_then(|stops| is_same(&stops).then_some(stops).ok_or(io::ErrorKind::NotFound)),
            stops_sent: AtomicU64::new(0),
            stops_taken: AtomicU64::new(0),
            commands: Mutex::default(),
            answered_at: AtomicU64::new(0),
        }
    }
}

/// Why a demand has no answer.
pub(super) enum NoAnswer {
    Lease(LeaseError),
    NoReply,
    Ended,
}

impl From<NoAnswer> for CommandError {
    fn from(no_answer: NoAnswer) -> Self {
        match no_answer {
            NoAnswer::Lease(error) => Self::Lease(error),
            NoAnswer::NoReply => Self::NoReply { after: REPLY_WITHIN },
            NoAnswer::Ended => Self::Ended,
        }
    }
}

impl From<NoAnswer> for StreamError {
    fn from(no_answer: NoAnswer) -> Self {
        match no_answer {
            NoAnswer::Lease(error) => Self::Lease(error),
            NoAnswer::NoReply => Self::NoReply { after: REPLY_WITHIN },
            NoAnswer::Ended => Self::Ended,
        }
    }
}

/// Why a connection for commands or stops cannot be had.
const fn refused(kind: io::ErrorKind) -> NoAnswer {
    match kind {
        io::ErrorKind::PermissionDenied => NoAnswer::Lease(LeaseError::ReadOnly),
        _ => NoAnswer::Ended,
    }
}

impl Client {
    /// Asks, and waits for the answer.
    fn ask(&self, command: Command) -> Result<Reply, NoAnswer> {
        self.await_stops()?;
        let asked_ns = now_ns();
        // A panic of another holder of the lock leaves a connection whose replies have other numbers.
        let mut commands = self.0.asking.commands.lock().unwrap_or_else(PoisonError::into_inner);
        self.ask_by(&mut commands, asked_ns, command)
    }

    fn ask_by(
        &self,
        commands: &mut Commands,
        asked_ns: Nanoseconds,
        command: Command,
    ) -> Result<Reply, NoAnswer> {
        if self.has_ended() {
            return Err(NoAnswer::Ended);
        }
        commands.number += 1;
        let number = commands.number;
        let connection = match &mut commands.connection {
            Some(connection) => connection,
            place => place.insert(self.connected()?),
        };
        let asked = connection.send(&Demand { number, asked_ns, command }.words());
        let answer = match asked {
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

    /// Waits until the other process has taken the stops that this client has sent: what it asks after a stop comes after it.
    fn await_stops(&self) -> Result<(), NoAnswer> {
        match &self.0.asking.stops {
            Ok(connection) => self.await_stops_for(connection, REPLY_WITHIN),
            Err(_) => Ok(()),
        }
    }

    fn await_stops_for(&self, connection: &Packets, at_most: Duration) -> Result<(), NoAnswer> {
        let (sent, begun) = (self.0.asking.stops_sent.load(Ordering::Acquire), Instant::now());
        while self.take_answers_to_stops(connection) < sent {
            let left = at_most.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return Err(NoAnswer::NoReply);
            }
            if self.has_ended() || connection.is_closed() {
                return Err(NoAnswer::Ended);
            }
            connection.await_packet(left.min(LOOK));
        }
        Ok(())
    }

    /// The same before a wait, for no longer than the wait.
    pub(super) fn await_stops_before(&self, at_most: Duration) {
        if let Ok(connection) = &self.0.asking.stops {
            // A wait says by itself that the process has ended, or that its time is over.
            let _ = self.await_stops_for(connection, at_most.min(REPLY_WITHIN));
        }
    }

    /// How many stops the other process has taken. It does not wait.
    fn take_answers_to_stops(&self, connection: &Packets) -> u64 {
        while let Some(taken) = connection.receive_word() {
            self.0.asking.stops_taken.fetch_max(taken, Ordering::AcqRel);
        }
        self.0.asking.stops_taken.load(Ordering::Acquire)
    }

    /// A connection for commands with the process whose state is observed.
    fn connected(&self) -> Result<Packets, NoAnswer> {
        let connection = Packets::connect_as(self.0.names.command(), Role::Commands);
        let connection = connection.map_err(|error| refused(error.kind()))?;
        // Another process may have the name by now.
        if connection.peer() != self.0.observer.peer() || connection.wait_at_most(REPLY_WITHIN).is_err() {
            return Err(NoAnswer::Ended);
        }
        Ok(connection)
    }

    /// The answer to a demand; `None` if the connection is closed.
    fn answer(&self, connection: &Packets, number: u64) -> Option<Result<Reply, NoAnswer>> {
        let begun = Instant::now();
        let mut words = [0; PACKET_WORDS];
        loop {
            match connection.receive(&mut words, true) {
                Received::Words(count) => match Answer::of(words.get(..count)?, self.machine()) {
                    Ok(answer) if answer.number == number || answer.number == u64::MAX => {
                        self.0.asking.answered_at.fetch_max(answer.slot, Ordering::AcqRel);
                        return Some(Ok(answer.reply));
                    }
                    // The late answer to a demand that was waited for no longer.
                    Ok(_) => {}
                    Err(_) => return None,
                },
                Received::Nothing if begun.elapsed() >= REPLY_WITHIN => return Some(Err(NoAnswer::NoReply)),
                Received::Nothing => {}
                Received::Closed => return None,
            }
        }
    }

    /// Waits until the state that is shown is as new as the last answer. So whoever commands sees what has become of it.
    fn await_answered_state(&self) {
        let answered_at = self.0.asking.answered_at.load(Ordering::Acquire);
        // It is shown within a cycle. A process that is paused meanwhile shows an older one for longer.
        let _ = self.wait_until(REPLY_WITHIN, |state| (state.slot >= answered_at).then_some(()));
    }

    pub(super) fn done(&self, command: Command) -> Result<(), CommandError> {
        self.asked(command)?;
        self.await_answered_state();
        Ok(())
    }

    /// As [`Client::done`], for what no state shows.
    pub(super) fn asked(&self, command: Command) -> Result<(), CommandError> {
        match self.ask(command)? {
            Reply::Done | Reply::Motion(_) => Ok(()),
            Reply::Refused(error) => Err(error),
            Reply::NotTaken(_) | Reply::Progress(_) | Reply::BringUpFailure(_) => {
                Err(CommandError::Unanswered)
            }
        }
    }

    pub(super) fn progress(&self, motion: MotionId) -> Result<Option<TrajectoryProgress>, CommandError> {
        match self.ask(Command::Progress(motion))? {
            Reply::Progress(progress) => Ok(progress),
            Reply::Refused(error) => Err(error),
            _ => Err(CommandError::Unanswered),
        }
    }

    pub(super) fn asked_for_bring_up_failure(
        &self,
        target: RequestTarget,
    ) -> Result<Option<String>, CommandError> {
        match self.ask(Command::BringUpFailure(target))? {
            Reply::BringUpFailure(words) => Ok(words),
            Reply::Refused(error) => Err(error),
            _ => Err(CommandError::Unanswered),
        }
    }

    pub(super) fn begun(&self, command: Command) -> Result<MotionId, CommandError> {
        self.motion(self.ask(command)?)
    }

    fn motion(&self, reply: Reply) -> Result<MotionId, CommandError> {
        match reply {
            Reply::Motion(motion) => {
                self.await_answered_state();
                Ok(motion)
            }
            Reply::Refused(error) => Err(error),
            _ => Err(CommandError::Unanswered),
        }
    }

    pub(super) fn taken(&self, command: Command) -> Result<(), StreamError> {
        match self.ask(command)? {
            Reply::NotTaken(error) => Err(error),
            Reply::Refused(CommandError::Lease(error)) => Err(error.into()),
            Reply::Refused(_) | Reply::Progress(_) | Reply::BringUpFailure(_) => Err(StreamError::Ended),
            Reply::Done | Reply::Motion(_) => Ok(()),
        }
    }

    /// Hands the points of a trajectory over, and asks to carry it out.
    pub(super) fn trajectory(
        &self,
        target: RequestTarget,
        points: &[TrajectoryPoint],
        command: Command,
    ) -> Result<MotionId, CommandError> {
        self.await_stops()?;
        let asked_ns = now_ns();
        let mut commands = self.0.asking.commands.lock().unwrap_or_else(PoisonError::into_inner);
        for packet in packets_of_points(target, points) {
            if let Reply::Refused(error) = self.ask_by(&mut commands, asked_ns, packet)? {
                return Err(error);
            }
        }
        let reply = self.ask_by(&mut commands, asked_ns, command)?;
        drop(commands);
        self.motion(reply)
    }

    /// Sends a stop. It waits for nothing, allocates nothing and takes no lock.
    pub(super) fn send_stop(
        &self,
        target: RequestTarget,
        category: StopCategory,
    ) -> Result<(), CommandError> {
        if self.0.shown.has_ended() {
            return Err(CommandError::Ended);
        }
        let connection = self.0.asking.stops.as_ref().map_err(|kind| refused(*kind))?;
        let [target, category] = StopRequest { target, category }.words().map(u64::to_ne_bytes);
        let mut bytes = [0; 2 * size_of::<u64>()];
        bytes.iter_mut().zip(target.into_iter().chain(category)).for_each(|(to, from)| *to = from);
        // Before it is sent, so that a command that comes after it waits for it.
        self.0.asking.stops_sent.fetch_add(1, Ordering::AcqRel);
        let sent = connection.send_bytes(&bytes);
        self.take_answers_to_stops(connection);
        sent.map_err(|error| {
            self.0.asking.stops_sent.fetch_sub(1, Ordering::AcqRel);
            match error.kind() {
                io::ErrorKind::WouldBlock => CommandError::NoReply { after: Duration::ZERO },
                _ => CommandError::Ended,
            }
        })
    }
}
