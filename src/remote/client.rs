//! A client of a controller in another process.

use std::fmt;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use takt_rt::{
    AxisLimits, AxisPoint, Nanoseconds, OperationMode, Phase, RequestId, RequestTarget, Snapshot,
    StopCategory,
};

use super::commands::{Command, Demand, StopRequest, chunk_points, packets_of_points};
use super::error::ConnectError;
use super::events::ClientEvents;
use super::group::ClientGroup;
use super::layout::Description;
use super::memory::Memory;
use super::replies::{REPLY_WITHIN, Reply};
use super::shown::{Shown, Unreadable, now_ns};
use super::socket::{CONNECTED_WITHIN, Names, PACKET_WORDS, Packets, Received, Role};
use super::stream::ClientStream;
use crate::command::{
    CommandError, EventSource, LeaseError, MotionError, MotionId, MoveOptions, RunningController,
    StreamError, WaitError, motion,
};
use crate::telemetry::Machine;
use crate::trajectory::TrajectoryPoint;

/// How often a client that waits makes sure that the other process is still there.
const LOOK: Duration = Duration::from_millis(50);

/// Connects to a controller that another process serves by a name: `takt run CONFIG --serve NAME`, or [`serve`](crate::serve). A name with a
/// slash is the beginning of the paths of its sockets.
///
/// The connection stays with that process. When it ends, every call of the client says so, and a new one is found by connecting again.
///
/// ```no_run
/// # fn main() -> takt::Result {
/// use std::time::Duration;
///
/// let arm = takt::connect("arm")?;
/// let motion = arm.move_to(&[0.3, -0.2, 0.1, -0.5, 0.0, 0.4])?;
/// arm.wait(motion, Duration::from_secs(10))?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// See [`ConnectError`].
pub fn connect(name: &str) -> Result<Client, ConnectError> {
    let names = Names::new(name)?;
    let failed = |error| ConnectError::Failed { path: names.observe().to_owned(), error };
    let observer = Packets::connect(names.observe()).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
            ConnectError::NotServed { name: name.to_owned() }
        }
        io::ErrorKind::PermissionDenied => ConnectError::NotAllowed { path: names.observe().to_owned() },
        io::ErrorKind::WouldBlock => ConnectError::NoReply { after: CONNECTED_WITHIN },
        _ => failed(error),
    })?;
    let foreign = || ConnectError::Foreign { name: name.to_owned() };
    let (_, file) = observer
        .receive_memory()
        .map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => foreign(),
            io::ErrorKind::WouldBlock => ConnectError::NoReply { after: CONNECTED_WITHIN },
            _ => failed(error),
        })?
        .ok_or(ConnectError::TooManyObservers)?;
    let memory = Memory::of_other(file).map_err(|_| foreign())?;
    let (shown, description) = Shown::of(memory).map_err(|unreadable| match unreadable {
        Unreadable::Foreign => foreign(),
        Unreadable::Version(theirs) => ConnectError::Version { theirs },
    })?;
    let stops = Packets::connect_as(names.command(), Role::Stops).map_err(|error| error.kind());
    Ok(Client(Arc::new(Shared {
        names,
        shown,
        description,
        observer,
        stops,
        stops_sent: AtomicU64::new(0),
        stops_taken: AtomicU64::new(0),
        commands: Mutex::default(),
    })))
}

/// Commands and observes a controller of another process, from any thread. Clones are cheap and equal. It has the calls of a
/// [`Handle`](crate::Handle), with the same meaning and the same errors, but for the callbacks in the real-time loop.
///
/// # Who commands
/// Any number of clients observe. One of them commands: it has the *lease*. The first command takes the lease if nobody has it, and each
/// command renews it. It expires some time after the last one ([`ServeOptions::lease`](crate::ServeOptions)), or when its process ends;
/// then another client may take it. [`Client::take_over`] takes it from a client that still has it; that one gets
/// [`LeaseError::TakenOver`] from then on, until it takes the controller over again itself.
///
/// A lease that expires stops nothing: a move goes on to its end, and a stream runs dry and comes to rest within the limits, as one of the
/// own process does. [`Client::stop`] needs no lease, and waits for nobody.
#[derive(Clone)]
pub struct Client(Arc<Shared>);

struct Shared {
    names: Names,
    shown: Shown,
    description: Description,
    /// It is closed when the process of the controller ends.
    observer: Packets,
    /// Where stops are sent; or why they cannot be.
    stops: Result<Packets, io::ErrorKind>,
    /// The stops that were sent, and how many of them the other process has taken.
    stops_sent: AtomicU64,
    stops_taken: AtomicU64,
    /// Where commands are sent; connected by the first one.
    commands: Mutex<Commands>,
}

#[derive(Default)]
struct Commands {
    connection: Option<Packets>,
    /// The number of the last demand.
    number: u64,
}

/// Who commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeaseHolder {
    /// The process.
    pub process: u32,
    /// When its lease expires, unless it gives another command.
    pub expires_in: Duration,
}

/// Why a demand has no answer.
enum NoAnswer {
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
    /// The name that it was connected by.
    pub fn name(&self) -> &str {
        &self.0.names.name
    }

    /// The process of the controller.
    pub fn process(&self) -> u32 {
        self.0.shown.process()
    }

    /// How long ago the process of the controller last showed a cycle. It is longer than a few periods if that is paused, or overloaded.
    pub fn silent_for(&self) -> Duration {
        self.0.shown.silent_for()
    }

    /// The names and units of the machine, for texts about events and states.
    pub fn machine(&self) -> &Machine {
        &self.0.description.machine
    }

    /// The limits of an axis, in rad (m), seconds and N·m (N).
    pub fn limits(&self, axis: usize) -> Option<AxisLimits> {
        self.0.description.limits(axis)
    }

    /// The group with this name in the configuration of the controller.
    ///
    /// # Errors
    /// [`CommandError::NoSuchGroup`].
    pub fn group(&self, name: &str) -> Result<ClientGroup, CommandError> {
        let groups = &self.machine().groups;
        let found = (0..).zip(groups).find(|(_, group)| *group == name);
        let (number, _) = found
            .ok_or_else(|| CommandError::NoSuchGroup { name: name.to_owned(), groups: groups.clone() })?;
        Ok(ClientGroup::new(self.clone(), number))
    }

    /// Who commands; `None` if nobody does.
    pub fn lease(&self) -> Option<LeaseHolder> {
        let lease = self.0.shown.lease();
        let left_ns = lease.until_ns.saturating_sub(now_ns());
        let is_held = lease.process != 0 && left_ns > 0;
        is_held.then_some(LeaseHolder { process: lease.process, expires_in: Duration::from_nanos(left_ns) })
    }

    /// Takes the lease, or renews it, without a command.
    ///
    /// # Errors
    /// [`CommandError::Lease`] if another client has it, or has taken it from this one.
    pub fn take_lease(&self) -> Result<(), CommandError> {
        self.done(Command::Lease { is_taken_over: false })
    }

    /// Takes the lease from whoever has it. What moves goes on.
    ///
    /// # Errors
    /// [`CommandError::Lease`] without write permission, [`CommandError::Ended`].
    pub fn take_over(&self) -> Result<(), CommandError> {
        self.done(Command::Lease { is_taken_over: true })
    }

    /// Gives the lease back, so that another client need not wait for its end.
    ///
    /// # Errors
    /// [`CommandError::Ended`].
    pub fn release(&self) -> Result<(), CommandError> {
        self.done(Command::Release)
    }

    /// See [`Handle::state`](crate::Handle::state). An ordinary thread shows it to other processes, shortly after it is complete.
    pub fn state(&self) -> Snapshot {
        self.0.shown.state().snapshot
    }

    /// See [`Handle::events`](crate::Handle::events).
    pub fn events(&self) -> ClientEvents {
        ClientEvents::new(self.clone(), self.0.shown.clone())
    }

    /// Whether the controller has ended, or the process that it ran in: every command returns an error that says `Ended` then.
    pub fn has_ended(&self) -> bool {
        self.0.shown.has_ended() || self.0.observer.is_closed()
    }

    /// See [`Handle::next_cycle`](crate::Handle::next_cycle).
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn next_cycle(&self, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.cycle_after(self.state().slot, at_most)
    }

    /// See [`Handle::cycle_after`](crate::Handle::cycle_after).
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.wait_until(at_most, |state| (state.slot > slot).then_some(*state))
    }

    /// See [`Handle::wait_for`](crate::Handle::wait_for).
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> Result<(), WaitError> {
        let is_there = |state: &Snapshot| state.groups().iter().all(|group| group.phase == phase);
        self.wait_until(at_most, |state| is_there(state).then_some(()))
    }

    /// Waits until `find` finds something in a state. It looks at one state of each cycle.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_until<T>(
        &self,
        at_most: Duration,
        mut find: impl FnMut(&Snapshot) -> Option<T>,
    ) -> Result<T, WaitError> {
        self.look_until(at_most, || find(&self.state()))
    }

    /// Looks after each cycle, and when the other process ends.
    pub(super) fn look_until<T>(
        &self,
        at_most: Duration,
        mut look: impl FnMut() -> Option<T>,
    ) -> Result<T, WaitError> {
        let deadline = Instant::now().checked_add(at_most);
        loop {
            // These are read before what is looked at, so that the last of it before the end is seen, and nothing is slept through.
            let (seen, has_ended) = (self.0.shown.states(), self.has_ended());
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
            self.0.shown.wait(seen, left.min(LOOK));
        }
    }

    /// See [`Handle::wait`](crate::Handle::wait).
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        match self.look_until(at_most, || self.result_in_state(motion)) {
            Ok(result) => result,
            Err(WaitError::NotInTime) => Err(MotionError::NotInTime),
            Err(WaitError::Ended) => Err(MotionError::Ended),
        }
    }

    /// See [`Handle::result_of`](crate::Handle::result_of).
    pub fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        let has_ended = self.has_ended();
        self.result_in_state(motion).or_else(|| has_ended.then_some(Err(MotionError::Ended)))
    }

    fn result_in_state(&self, MotionId { request, target }: MotionId) -> Option<Result<(), MotionError>> {
        let state = self.0.shown.state();
        motion::result_in(&state.snapshot, request, state.newest_stop(target), self.machine())
    }

    /// See [`Handle::move_to`](crate::Handle::move_to).
    ///
    /// # Errors
    /// See [`CommandError`]; nothing has changed then, but for [`CommandError::NoReply`].
    pub fn move_to(&self, target: &[f64]) -> Result<MotionId, CommandError> {
        self.move_with(target, MoveOptions::default())
    }

    /// See [`Handle::move_with`](crate::Handle::move_with).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_with(&self, target: &[f64], options: MoveOptions) -> Result<MotionId, CommandError> {
        self.begin_move(RequestTarget::All, target, options)
    }

    /// See [`Handle::execute`](crate::Handle::execute).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn execute(&self, points: &[TrajectoryPoint]) -> Result<MotionId, CommandError> {
        self.begin_trajectory(RequestTarget::All, points)
    }

    /// See [`Handle::move_through`](crate::Handle::move_through).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn move_through(&self, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.begin_through(RequestTarget::All, waypoints)
    }

    /// See [`Handle::set_speed`](crate::Handle::set_speed).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError> {
        self.done(Command::SetSpeed { motion, rate })
    }

    /// See [`Handle::pause`](crate::Handle::pause).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn pause(&self, motion: MotionId) -> Result<(), CommandError> {
        self.done(Command::Pause(motion))
    }

    /// See [`Handle::resume`](crate::Handle::resume).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn resume(&self, motion: MotionId) -> Result<(), CommandError> {
        self.done(Command::Resume(motion))
    }

    /// See [`Handle::velocity`](crate::Handle::velocity).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn velocity(
        &self,
        axis: usize,
        velocity: f64,
        valid_for: Duration,
    ) -> Result<MotionId, CommandError> {
        self.begun(Command::Velocity { axis, velocity, valid_for })
    }

    /// See [`Handle::torque`](crate::Handle::torque).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        self.begun(Command::Torque { axis, torque, valid_for })
    }

    /// See [`Handle::change_mode`](crate::Handle::change_mode).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn change_mode(&self, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.begin_mode_change(RequestTarget::All, mode)
    }

    /// See [`Handle::change_axis_mode`](crate::Handle::change_axis_mode).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        self.begun(Command::ChangeAxisMode { axis, mode })
    }

    /// See [`Handle::begin_stream`](crate::Handle::begin_stream).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.begin_streaming(RequestTarget::All)
    }

    /// See [`Handle::stream`](crate::Handle::stream).
    pub fn stream(&self) -> ClientStream {
        ClientStream::new(self.clone(), RequestTarget::All)
    }

    /// See [`Handle::enable`](crate::Handle::enable).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn enable(&self) -> Result<(), CommandError> {
        self.begin_enable(RequestTarget::All)
    }

    /// See [`Handle::disable`](crate::Handle::disable).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn disable(&self) -> Result<(), CommandError> {
        self.begin_disable(RequestTarget::All)
    }

    /// See [`Handle::reset_faults`](crate::Handle::reset_faults).
    ///
    /// # Errors
    /// As [`Client::move_to`].
    pub fn reset_faults(&self) -> Result<(), CommandError> {
        self.clear_faults(RequestTarget::All)
    }

    /// Requests a stop of this category, and returns at once. It needs no lease, and is not queued behind any command of this or another
    /// client. What this client asks after it comes after it. See [`Handle::stop`](crate::Handle::stop).
    ///
    /// The call makes two system calls or three that do not wait, allocates nothing and takes no lock. So it may be called in a signal handler.
    ///
    /// # Errors
    /// [`CommandError::Lease`] without write permission, [`CommandError::Ended`], and [`CommandError::NoReply`] if the other process has
    /// taken none of many stops.
    pub fn stop(&self, category: StopCategory) -> Result<(), CommandError> {
        self.request_stop(RequestTarget::All, category)
    }

    /// Asks, and waits for the answer.
    fn ask(&self, command: Command) -> Result<Reply, NoAnswer> {
        // A panic of another holder of the lock leaves a connection whose replies have other numbers.
        let mut commands = self.0.commands.lock().unwrap_or_else(PoisonError::into_inner);
        self.ask_by(&mut commands, command)
    }

    fn ask_by(&self, commands: &mut Commands, command: Command) -> Result<Reply, NoAnswer> {
        if self.has_ended() {
            return Err(NoAnswer::Ended);
        }
        self.await_stops()?;
        commands.number += 1;
        let number = commands.number;
        let connection = match &mut commands.connection {
            Some(connection) => connection,
            place => place.insert(self.connected()?),
        };
        let asked = connection.send(&Demand { number, command }.words());
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
        let Ok(connection) = &self.0.stops else { return Ok(()) };
        let (sent, begun) = (self.0.stops_sent.load(Ordering::Acquire), Instant::now());
        while self.take_answers_to_stops(connection) < sent {
            let left = REPLY_WITHIN.saturating_sub(begun.elapsed());
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

    /// How many stops the other process has taken. It does not wait.
    fn take_answers_to_stops(&self, connection: &Packets) -> u64 {
        while let Some(taken) = connection.receive_word() {
            self.0.stops_taken.fetch_max(taken, Ordering::AcqRel);
        }
        self.0.stops_taken.load(Ordering::Acquire)
    }

    /// A connection for commands with the process whose state is observed.
    fn connected(&self) -> Result<Packets, NoAnswer> {
        let connection = Packets::connect_as(self.0.names.command(), Role::Commands);
        let connection = connection.map_err(|error| refused(error.kind()))?;
        // Another process may have the name by now.
        if connection.process() != self.0.observer.process() || connection.wait_at_most(REPLY_WITHIN).is_err()
        {
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
                Received::Words(count) => match Reply::of(words.get(..count)?, self.machine()) {
                    Ok((answered, reply)) if answered == number || answered == u64::MAX => {
                        return Some(Ok(reply));
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

    fn done(&self, command: Command) -> Result<(), CommandError> {
        match self.ask(command)? {
            Reply::Done | Reply::Motion(_) => Ok(()),
            Reply::Refused(error) => Err(error),
            Reply::NotTaken(_) => Err(CommandError::Unanswered),
        }
    }

    fn begun(&self, command: Command) -> Result<MotionId, CommandError> {
        Self::motion(self.ask(command)?)
    }

    fn motion(reply: Reply) -> Result<MotionId, CommandError> {
        match reply {
            Reply::Motion(motion) => Ok(motion),
            Reply::Refused(error) => Err(error),
            Reply::Done | Reply::NotTaken(_) => Err(CommandError::Unanswered),
        }
    }

    fn taken(&self, command: Command) -> Result<(), StreamError> {
        match self.ask(command)? {
            Reply::NotTaken(error) => Err(error),
            Reply::Refused(CommandError::Lease(error)) => Err(error.into()),
            Reply::Refused(_) => Err(StreamError::Ended),
            Reply::Done | Reply::Motion(_) => Ok(()),
        }
    }

    /// Hands the points of a trajectory over, and asks to carry it out.
    fn trajectory(&self, points: &[TrajectoryPoint], command: Command) -> Result<MotionId, CommandError> {
        let mut commands = self.0.commands.lock().unwrap_or_else(PoisonError::into_inner);
        for packet in packets_of_points(points) {
            if let Reply::Refused(error) = self.ask_by(&mut commands, packet)? {
                return Err(error);
            }
        }
        Self::motion(self.ask_by(&mut commands, command)?)
    }
}

impl RunningController for Client {
    fn machine(&self) -> &Machine {
        Self::machine(self)
    }

    fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        self.0.description.axes_of(target)
    }

    fn limits(&self, axis: usize) -> Option<AxisLimits> {
        Self::limits(self, axis)
    }

    fn state(&self) -> Snapshot {
        Self::state(self)
    }

    fn has_ended(&self) -> bool {
        Self::has_ended(self)
    }

    fn newest_stop(&self, target: RequestTarget) -> RequestId {
        self.0.shown.state().newest_stop(target)
    }

    fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        Self::cycle_after(self, slot, at_most)
    }

    fn event_source(&self) -> Box<dyn EventSource> {
        Box::new(self.events())
    }

    fn begin_move(
        &self,
        target: RequestTarget,
        positions: &[f64],
        options: MoveOptions,
    ) -> Result<MotionId, CommandError> {
        self.begun(Command::Move { target, options, positions: positions.to_vec() })
    }

    fn begin_trajectory(
        &self,
        target: RequestTarget,
        points: &[TrajectoryPoint],
    ) -> Result<MotionId, CommandError> {
        self.trajectory(points, Command::Execute(target))
    }

    fn begin_through(&self, target: RequestTarget, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        let point = |positions: &Vec<f64>| TrajectoryPoint {
            positions: positions.clone(),
            ..TrajectoryPoint::default()
        };
        let points: Vec<TrajectoryPoint> = waypoints.iter().map(point).collect();
        self.trajectory(&points, Command::Through(target))
    }

    fn set_speed(&self, motion: MotionId, rate: f64) -> Result<(), CommandError> {
        Self::set_speed(self, motion, rate)
    }

    fn pause(&self, motion: MotionId) -> Result<(), CommandError> {
        Self::pause(self, motion)
    }

    fn resume(&self, motion: MotionId) -> Result<(), CommandError> {
        Self::resume(self, motion)
    }

    fn velocity(&self, axis: usize, velocity: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        Self::velocity(self, axis, velocity, valid_for)
    }

    fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        Self::torque(self, axis, torque, valid_for)
    }

    fn begin_mode_change(
        &self,
        target: RequestTarget,
        mode: OperationMode,
    ) -> Result<MotionId, CommandError> {
        self.begun(Command::ChangeMode { target, mode })
    }

    fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        Self::change_axis_mode(self, axis, mode)
    }

    fn begin_streaming(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.done(Command::BeginStream(target))
    }

    fn push_point(
        &self,
        target: RequestTarget,
        at_ns: Nanoseconds,
        axes: &[AxisPoint],
    ) -> Result<(), StreamError> {
        self.taken(Command::Point { target, at_ns, axes: axes.to_vec() })
    }

    fn push_chunk(
        &self,
        target: RequestTarget,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[Vec<AxisPoint>],
    ) -> Result<(), StreamError> {
        // A chunk takes the place of what comes after it, so a part of it is a chunk of its own.
        let each = chunk_points(points.iter().map(Vec::len).max().unwrap_or(0)).max(1);
        let interval_ns = u64::try_from(interval.as_nanos()).unwrap_or(u64::MAX);
        for (part, points) in (0..).zip(points.chunks(each)) {
            let before_ns = interval_ns.saturating_mul(part * each as u64);
            let from_ns = from_ns.saturating_add(before_ns);
            self.taken(Command::Chunk { target, from_ns, interval, points: points.to_vec() })?;
        }
        Ok(())
    }

    fn request_stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError> {
        if self.0.shown.has_ended() {
            return Err(CommandError::Ended);
        }
        let connection = self.0.stops.as_ref().map_err(|kind| refused(*kind))?;
        let [target, category] = StopRequest { target, category }.words().map(u64::to_ne_bytes);
        let mut bytes = [0; 2 * size_of::<u64>()];
        bytes.iter_mut().zip(target.into_iter().chain(category)).for_each(|(to, from)| *to = from);
        // Before it is sent, so that a command that comes after it waits for it.
        self.0.stops_sent.fetch_add(1, Ordering::AcqRel);
        let sent = connection.send_bytes(&bytes);
        self.take_answers_to_stops(connection);
        sent.map_err(|error| {
            self.0.stops_sent.fetch_sub(1, Ordering::AcqRel);
            match error.kind() {
                io::ErrorKind::WouldBlock => CommandError::NoReply { after: Duration::ZERO },
                _ => CommandError::Ended,
            }
        })
    }

    fn begin_enable(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.done(Command::Enable(target))
    }

    fn begin_disable(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.done(Command::Disable(target))
    }

    fn clear_faults(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.done(Command::ResetFaults(target))
    }

    fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        Self::result_of(self, motion)
    }

    fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        Self::wait(self, motion, at_most)
    }
}

impl fmt::Debug for Client {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Client")
            .field("name", &self.name())
            .field("process", &self.process())
            .finish()
    }
}
