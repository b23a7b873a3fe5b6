//! The channels between the real-time thread and the rest of the program. [`channels`] allocates all of them, and returns
//! their three sides.
//!
//! ```text
//! HostSide ── requests, trajectories, service frames ──▶ RtSide (takt_rt::HostInterface)
//! clients  ── requests, stops, trajectories, points of a stream, from any number of threads ──▶ RtSide
//! HostSide ◀── service frames, newest snapshot, last events (any number of observers) ── RtSide
//! clients  ◀── trajectories that are done with ── RtSide
//! clients  ── questions to devices that are none of the configuration's ──▶ HostSide
//! LogSide  ◀── cycle records, events ── RtSide
//! ```
//!
//! No call on [`RtSide`] allocates, locks or waits, even if another thread is preempted in the middle of a call.

mod callback_panic;
mod callback_record;
mod callbacks;
mod client_requests;
mod event_words;
mod group_axes;
mod journal;
mod latest;
mod lending;
mod motion_words;
mod observed_events;
mod primitives;
mod questions;
mod records;
mod request_numbers;
mod ring;
mod stream;
mod trajectories;
mod words;

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use takt_rt::{
    AxisSnapshot, AxisTarget, CallbackCycle, CallbackId, CallbackReturn, CallbackRun, CheckpointError,
    CycleRecord, Event, ExecutionStart, Frame, HostInterface, MAX_AXES, Nanoseconds, OffCycleReport,
    Received, Request, RequestEnvelope, RequestId, RequestTarget, Snapshot, StreamSample, TrajectoryId,
    TrajectorySample,
};

use callbacks::CallbackTaker;
use client_requests::{TakenRequests, client_requests};
use journal::JournalWriter;
use latest::{Reader, Writer};
use observed_events::observed_events;
use records::{RecordConsumer, RecordProducer};
use stream::{StreamReceiver, stream_channels};
use trajectories::TrajectoryTaker;

pub(crate) use callback_panic::panic_message;
pub use callback_record::{CallbackRecord, CallbackTimes};
pub use callbacks::{
    CallbackClock, CallbackCommand, CallbackGiver, CallbackState, GivenCallback, LoopCallback,
};
pub use client_requests::{ClientRequests, MotionEnd, WAITING_AT_MOST};
pub(crate) use event_words::EVENT_WORDS;
pub use group_axes::GroupAxes;
pub use journal::{HostInput, JournalEntry, JournalReader};
pub(crate) use latest::{
    Allocated, Attempt, Cells, Reader as LatestReader, Words, Writer as LatestWriter, latest,
};
pub use observed_events::EventReader;
pub(crate) use observed_events::EventWriter;
pub use questions::{QUESTIONS_AT_MOST, Questions};
pub use request_numbers::RequestNumbers;
pub use ring::{Consumer, Producer, ring};
pub use stream::{GroupStream, SentPoint, Streamer, chunk};
pub use trajectories::{GivenTrajectory, NumberedTrajectory, TrajectoryGiver};
use words::take_snapshot_into;
pub(crate) use words::{put_snapshot, snapshot_words, take_snapshot};

/// The capacity of each channel.
#[derive(Clone, Debug)]
pub struct ChannelSizes {
    /// The stream of each group of the controller, up to [`takt_rt::MAX_GROUPS`].
    pub groups: Vec<GroupStream>,
    /// Axes of the controller, up to [`takt_rt::MAX_AXES`].
    pub axes: usize,
    /// Buses of the controller, up to [`takt_rt::MAX_BUSES`].
    pub buses: usize,
    /// Cycle records that wait for the logger.
    pub records: usize,
    /// Events that wait for the logger, and events that an observer can be behind.
    pub events: usize,
    /// Requests that wait for the next cycle.
    pub requests: usize,
    /// Service frames that wait to be sent, for each bus.
    pub service_out: usize,
    /// Received service frames that wait for the host, of all buses together.
    pub service_in: usize,
}

/// Why a request or frame was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelError {
    /// The channel is full: the real-time thread does not run, or gets too much.
    #[error("the channel to the real-time thread is full")]
    Full,
    /// No bus has this number.
    #[error("there is no bus {bus}: the controller has {buses} buses")]
    NoSuchBus {
        /// The number of the bus.
        bus: usize,
        /// The number of buses.
        buses: usize,
    },
}

/// Reports of each drive that can wait, of those that are spoken to outside of the cycle.
const REPORTS_OF_AXIS: usize = 4;

/// Makes the channels, and allocates and touches all their memory.
pub fn channels(sizes: &ChannelSizes) -> (RtSide, HostSide, LogSide) {
    let (request_in, request_out) = ring(sizes.requests);
    let (streamer, streams) = stream_channels(&sizes.groups);
    let (snapshot_in, snapshot_out) = latest(snapshot_words(sizes.groups.len(), sizes.axes, sizes.buses));
    let (service_in, service_out) = (0..sizes.buses).map(|_| ring(sizes.service_out)).unzip();
    let (received_in, received_out) = ring(sizes.service_in);
    let (record_in, record_out) = records::record_ring(sizes.records);
    let (event_in, event_out) = ring(sizes.events);
    let (giver, taker) = trajectories::trajectories();
    let (callback_giver, callback_taker) = callbacks::callbacks();
    let (observed_in, observed_out) = observed_events(sizes.events);
    let (report_in, report_out) = ring(REPORTS_OF_AXIS * sizes.axes.max(1));
    let numbers = RequestNumbers::default();
    let (clients, taken) = client_requests(numbers.clone(), WAITING_AT_MOST, sizes.groups.len());
    let mut rt = RtSide {
        requests: request_out,
        clients: taken,
        is_client_next: true,
        streams,
        trajectories: taker,
        callbacks: callback_taker,
        service: service_out,
        received: received_in,
        off_cycle_reports: report_out,
        records: record_in,
        events: event_in,
        observed: observed_in,
        snapshot: snapshot_in,
        journal: None,
    };
    rt.publish(&snapshot_before_first_cycle(sizes));
    let host = HostSide {
        requests: request_in,
        trajectories: giver,
        callbacks: callback_giver,
        numbers,
        clients,
        observed: observed_out,
        streamer,
        service: service_in,
        questions: Questions::default(),
        received: received_out,
        off_cycle_reports: report_in,
        observer: Observer {
            snapshot: snapshot_out,
            number: CONTROLLERS.fetch_add(1, Ordering::Relaxed) + 1,
        },
    };
    (rt, host, LogSide { records: record_out, events: event_out })
}

/// A passive controller of so many groups, axes and buses, whose drives have reported nothing.
fn snapshot_before_first_cycle(sizes: &ChannelSizes) -> Snapshot {
    Snapshot {
        group_count: sizes.groups.len() as u8,
        axis_count: sizes.axes as u8,
        bus_count: sizes.buses as u8,
        ..words::NO_SNAPSHOT
    }
}

/// The real-time thread's side.
pub struct RtSide {
    requests: Consumer<RequestEnvelope>,
    clients: TakenRequests,
    /// Whether a client's request comes before the next one of the host. They alternate, so that no flood of the one holds up
    /// the other.
    is_client_next: bool,
    streams: Vec<StreamReceiver>,
    trajectories: TrajectoryTaker,
    callbacks: CallbackTaker,
    service: Vec<Consumer<Frame>>,
    received: Producer<(usize, Received)>,
    off_cycle_reports: Consumer<(u8, OffCycleReport)>,
    records: RecordProducer,
    events: Producer<Event>,
    observed: EventWriter,
    snapshot: Writer,
    /// Notes what is taken, for a replay.
    journal: Option<JournalWriter>,
}

impl RtSide {
    fn note(&mut self, input: impl FnOnce() -> HostInput) {
        if let Some(journal) = &mut self.journal {
            journal.note(input());
        }
    }

    /// The state of the stream of each group between two cycles.
    pub fn stream_checkpoints(&self) -> Vec<Vec<u8>> {
        self.streams.iter().map(StreamReceiver::checkpoint).collect()
    }

    /// Goes on with the streams of another controller of the same groups.
    ///
    /// # Errors
    /// They are none of these groups.
    pub fn resume_streams(&mut self, checkpoints: &[Vec<u8>]) -> Result<(), CheckpointError> {
        if checkpoints.len() != self.streams.len() {
            return Err(CheckpointError::OtherMachine);
        }
        self.streams.iter_mut().zip(checkpoints).try_for_each(|(stream, state)| stream.resume(state))
    }

    /// From now on the calls of callbacks are measured so.
    pub fn measure_callbacks_by(&mut self, clock: CallbackClock) {
        self.callbacks.measure_by(clock);
    }
}

impl HostInterface for RtSide {
    fn request(&mut self) -> Option<RequestEnvelope> {
        self.is_client_next = !self.is_client_next;
        let request = if self.is_client_next {
            self.requests.pop().or_else(|| self.clients.take())
        } else {
            self.clients.take().or_else(|| self.requests.pop())
        }?;
        self.note(|| HostInput::Request(request));
        Some(request)
    }

    fn off_cycle_report(&mut self) -> Option<(u8, OffCycleReport)> {
        let (axis, report) = self.off_cycle_reports.pop()?;
        self.note(|| HostInput::OffCycleReport { axis, report });
        Some((axis, report))
    }

    fn begin_stream(&mut self, group: u8) {
        if let Some(stream) = self.streams.get_mut(usize::from(group)) {
            stream.begin();
        }
    }

    fn stream(&mut self, group: u8, slot_start_ns: Nanoseconds, sample: &mut StreamSample) {
        let Self { streams, journal, .. } = self;
        let Some(stream) = streams.get_mut(usize::from(group)) else { return };
        stream.sample(slot_start_ns, sample, |point| {
            if let Some(journal) = journal {
                journal.note(HostInput::Point { group, point: *point });
            }
        });
    }

    fn trajectory(&mut self, group: u8, trajectory: TrajectoryId, at_s: f64) -> Option<TrajectorySample> {
        self.trajectories.sample(group, trajectory, at_s)
    }

    fn keep_trajectories(&mut self, group: u8, needed: [Option<TrajectoryId>; 2]) {
        self.trajectories.keep(group, needed);
    }

    fn take_callback(&mut self, group: u8, callback: CallbackId) -> bool {
        let is_there = self.callbacks.take(group, callback);
        self.note(|| HostInput::CallbackTaken { is_there });
        is_there
    }

    fn callback(
        &mut self,
        group: u8,
        callback: CallbackId,
        cycle: &CallbackCycle,
        axes: &[AxisSnapshot; MAX_AXES],
        targets: &mut [Option<AxisTarget>; MAX_AXES],
    ) -> CallbackReturn {
        let returned = self.callbacks.call(group, callback, cycle, axes, targets);
        self.note(|| HostInput::Called { returned, targets: *targets });
        returned
    }

    fn keep_callback(&mut self, group: u8, needed: Option<CallbackId>) {
        self.callbacks.keep(group, needed);
    }

    fn service_frame(&mut self, bus: usize) -> Option<Frame> {
        let frame = self.service.get_mut(bus)?.pop()?;
        self.note(|| HostInput::ServiceFrame { bus: bus as u8, frame });
        Some(frame)
    }

    fn received(&mut self, bus: usize, frame: &Received) -> bool {
        self.received.push((bus, *frame))
    }

    fn record(&mut self, record: &CycleRecord) -> bool {
        self.records.push(record)
    }

    fn event(&mut self, event: &Event) -> bool {
        self.observed.write(event);
        self.events.push(*event)
    }

    fn publish(&mut self, snapshot: &Snapshot) {
        self.snapshot.write(|words| put_snapshot(snapshot, words));
        if let Some(journal) = &mut self.journal {
            journal.end_cycle();
        }
    }
}

/// Notes from now on everything that the real-time thread takes from the host, for a replay. Call it before the first cycle.
pub fn journal(rt: &mut RtSide, host: &mut HostSide) -> JournalReader {
    let (writer, reader) = journal::journal();
    rt.journal = Some(writer);
    host.trajectories.note_in(reader.trajectories());
    reader
}

/// The side of the program that commands the controller.
pub struct HostSide {
    requests: Producer<RequestEnvelope>,
    numbers: RequestNumbers,
    trajectories: TrajectoryGiver,
    callbacks: CallbackGiver,
    clients: ClientRequests,
    observed: EventReader,
    streamer: Streamer,
    service: Vec<Producer<Frame>>,
    questions: Questions,
    received: Consumer<(usize, Received)>,
    off_cycle_reports: Producer<(u8, OffCycleReport)>,
    observer: Observer,
}

impl HostSide {
    /// Sends a request. The engine handles the requests in their order, from its next cycle on. Returns the id of the request,
    /// for [`Snapshot::answers`] and [`Snapshot::motions`].
    ///
    /// # Errors
    /// [`ChannelError::Full`]; the request is not sent then.
    pub fn request(&mut self, request: Request) -> Result<RequestId, ChannelError> {
        self.request_of(RequestTarget::All, request)
    }

    /// The same, for one group.
    ///
    /// # Errors
    /// [`ChannelError::Full`]; the request is not sent then.
    pub fn request_of(&mut self, target: RequestTarget, request: Request) -> Result<RequestId, ChannelError> {
        let id = self.numbers.next();
        self.submit(RequestEnvelope { id, target, request }).map(|()| id)
    }

    /// Sends a request with an id of [`HostSide::numbers`].
    ///
    /// # Errors
    /// [`ChannelError::Full`]; the request is not sent then.
    pub fn submit(&mut self, envelope: RequestEnvelope) -> Result<(), ChannelError> {
        if self.requests.push(envelope) { Ok(()) } else { Err(ChannelError::Full) }
    }

    /// Asks for a trajectory of a group to be carried out. Returns the number of the request.
    ///
    /// # Errors
    /// [`ChannelError::Full`]; nothing is sent then.
    pub fn execute(
        &mut self,
        group: u8,
        given: &Arc<GivenTrajectory>,
        start: ExecutionStart,
    ) -> Result<RequestId, ChannelError> {
        let trajectory = self.trajectories.give(group, given).ok_or(ChannelError::Full)?;
        let requested = self.request_of(RequestTarget::Group(group), Request::Execute { trajectory, start });
        if requested.is_err() {
            self.trajectories.take_back(trajectory);
        }
        requested
    }

    /// Asks for a callback to lead its group, as `run` says but for the number. Returns the number of the request.
    ///
    /// # Errors
    /// [`ChannelError::Full`]; nothing is sent then.
    #[cfg(feature = "internals")]
    pub fn run_callback(
        &mut self,
        given: GivenCallback,
        run: CallbackRun,
    ) -> Result<RequestId, ChannelError> {
        let target = RequestTarget::Group(given.group());
        let callback = self.callbacks.give(given).ok_or(ChannelError::Full)?;
        let id = self.numbers.next();
        let request = Request::RunCallback(CallbackRun { callback, ..run });
        let submitted = self.submit(RequestEnvelope { id, target, request });
        if submitted.is_err() {
            self.callbacks.take_back(callback);
        }
        submitted.map(|()| id)
    }

    /// Frees the callbacks that the real-time thread needs no longer.
    pub fn free_callbacks(&self) {
        self.callbacks.release();
    }

    /// The end that gives callbacks, for another thread.
    pub fn callbacks(&self) -> CallbackGiver {
        self.callbacks.clone()
    }

    /// The end that gives trajectories, for another thread.
    pub fn trajectories(&self) -> TrajectoryGiver {
        self.trajectories.clone()
    }

    /// The source of request ids.
    pub fn numbers(&self) -> RequestNumbers {
        self.numbers.clone()
    }

    /// The way for requests from other threads.
    pub fn clients(&self) -> ClientRequests {
        self.clients.clone()
    }

    /// The events from now on, for another thread.
    pub fn events(&self) -> EventReader {
        self.observed.begin_now()
    }

    /// The writing ends of the points of streams, for any thread.
    pub fn streamer(&self) -> Streamer {
        self.streamer.clone()
    }

    /// The questions of clients, for any thread.
    pub fn questions(&self) -> Questions {
        self.questions.clone()
    }

    /// Queues a service frame. It is sent after the set-points of a later cycle.
    ///
    /// # Errors
    /// [`ChannelError::Full`] or [`ChannelError::NoSuchBus`]; the frame will not be sent then.
    pub fn send_service(&mut self, bus: usize, frame: Frame) -> Result<(), ChannelError> {
        let buses = self.service.len();
        let ring = self.service.get_mut(bus).ok_or(ChannelError::NoSuchBus { bus, buses })?;
        if ring.push(frame) { Ok(()) } else { Err(ChannelError::Full) }
    }

    /// Reports what a drive has said that is spoken to outside of the cycle. Returns whether there was room.
    pub fn report_off_cycle(&mut self, axis: u8, report: OffCycleReport) -> bool {
        self.off_cycle_reports.push((axis, report))
    }

    /// The oldest received frame that is not process data, with its bus.
    pub fn take_service(&mut self) -> Option<(usize, Received)> {
        self.received.pop()
    }

    /// The state after the newest complete cycle.
    pub fn snapshot(&self) -> Snapshot {
        self.observer.snapshot()
    }

    /// The same, written over an earlier one of this controller, or over [`Snapshot::default`].
    pub fn read_snapshot(&self, snapshot: &mut Snapshot) {
        self.observer.read(snapshot);
    }

    /// A handle to the state for another thread.
    pub fn observer(&self) -> Observer {
        self.observer.clone()
    }
}

/// The last state that a thread has looked at, of any controller. What a later one does not count stays in it.
#[derive(Default)]
struct LookedAt {
    /// The number of the observers of that controller; 0 for none.
    observers: u64,
    /// The number of the state in its mailbox.
    number: u64,
    snapshot: Snapshot,
}

/// The controllers that this process has had.
static CONTROLLERS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static LOOKED_AT: Cell<Option<Box<LookedAt>>> = const { Cell::new(None) };
}

/// Reads the state of the controller at any time, without disturbing it. Clone it for every thread.
#[derive(Clone)]
pub struct Observer {
    snapshot: Reader,
    /// Another one for the observers of each controller of this process.
    number: u64,
}

impl Observer {
    /// The state after the newest complete cycle. Before the first one, it is a passive controller whose drives have reported nothing.
    pub fn snapshot(&self) -> Snapshot {
        let mut snapshot = words::NO_SNAPSHOT;
        self.read(&mut snapshot);
        snapshot
    }

    /// Shows that state to `look`, without a copy: a snapshot has twelve kilobytes, most of which do not count.
    pub fn look<T>(&self, look: impl FnOnce(&Snapshot) -> T) -> T {
        let mut looked_at = LOOKED_AT.take().unwrap_or_default();
        self.update(&mut looked_at);
        let seen = look(&looked_at.snapshot);
        LOOKED_AT.set(Some(looked_at));
        seen
    }

    /// Reads the state, unless it is the one that is there.
    fn update(&self, looked_at: &mut LookedAt) {
        let newest = if looked_at.observers == self.number { looked_at.number } else { 0 };
        loop {
            match self.snapshot.attempt(newest, |words| take_snapshot_into(words, &mut looked_at.snapshot)) {
                Attempt::Whole((), number) => {
                    (looked_at.observers, looked_at.number) = (self.number, number);
                    return;
                }
                Attempt::Nothing if newest > 0 => return,
                Attempt::Torn | Attempt::Nothing => std::hint::spin_loop(),
            }
        }
    }

    /// The same, written over an earlier one of this controller, or over [`Snapshot::default`].
    pub fn read(&self, snapshot: &mut Snapshot) {
        loop {
            match self.snapshot.attempt(0, |words| take_snapshot_into(words, snapshot)) {
                Attempt::Whole((), _) => return,
                // Three cycles have passed during the read, because this thread was preempted. There is one from the beginning.
                Attempt::Torn | Attempt::Nothing => std::hint::spin_loop(),
            }
        }
    }
}

/// The logger's side.
pub struct LogSide {
    records: RecordConsumer,
    events: Consumer<Event>,
}

impl LogSide {
    /// Passes the oldest waiting cycle record to `read`, in place. Axes beyond `axis_count` hold arbitrary values.
    pub fn next_record<T>(&mut self, read: impl FnOnce(&CycleRecord) -> T) -> Option<T> {
        self.records.next(read)
    }

    /// The oldest waiting event.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// The number of records written since the start.
    pub fn records_written(&self) -> u64 {
        self.records.pushed()
    }

    /// The number of records dropped since the start.
    pub fn records_dropped(&self) -> u64 {
        self.records.dropped()
    }

    /// The number of events dropped since the start.
    pub fn events_dropped(&self) -> u64 {
        self.events.dropped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{EventKind, Phase, StopCategory};
    use takt_rt::{Id, LookAheadParameters};

    fn envelope(id: RequestId, request: Request) -> RequestEnvelope {
        RequestEnvelope { id, target: RequestTarget::All, request }
    }

    fn sizes() -> ChannelSizes {
        ChannelSizes {
            groups: vec![GroupStream {
                axes: GroupAxes::new(vec![0, 1]),
                look_ahead: LookAheadParameters::default(),
            }],
            axes: 2,
            buses: 2,
            records: 4,
            events: 2,
            requests: 2,
            service_out: 2,
            service_in: 2,
        }
    }

    #[test]
    fn requests_arrive_in_order_and_one_too_many_is_an_error() {
        let (mut rt, mut host, _log) = channels(&sizes());
        let first = host.request(Request::Enable).unwrap();
        let second = host.request(Request::Stop(StopCategory::Two)).unwrap();
        assert!(first < second);
        assert_eq!(host.request(Request::Shutdown), Err(ChannelError::Full));
        assert_eq!(rt.request(), Some(envelope(first, Request::Enable)));
        let request = Request::Stop(StopCategory::Two);
        assert_eq!(rt.request(), Some(envelope(second, request)));
        assert_eq!(rt.request(), None);
    }

    #[test]
    fn neither_the_host_nor_a_client_holds_up_the_other() {
        let (mut rt, mut host, _log) = channels(&sizes());
        let client = host.clients();
        let own: Vec<_> = (0..2).map(|_| host.request(Request::Enable).unwrap()).collect();
        let theirs: Vec<_> =
            (0..4).map(|_| client.submit_to(RequestTarget::All, Request::ResetFaults).unwrap()).collect();
        let taken: Vec<_> = std::iter::from_fn(|| rt.request()).map(|envelope| envelope.id).collect();
        assert_eq!(taken, [theirs[0], own[0], theirs[1], own[1], theirs[2], theirs[3]]);
    }

    #[test]
    fn service_frames_keep_to_their_bus_in_both_directions() {
        let (mut rt, mut host, _log) = channels(&sizes());
        let frame = Frame::of(Id::canopen(0x600, 5), [0x40, 0x00, 0x10, 0x00]);
        host.send_service(1, frame).unwrap();
        assert_eq!(host.send_service(2, frame), Err(ChannelError::NoSuchBus { bus: 2, buses: 2 }));
        assert_eq!((rt.service_frame(0), rt.service_frame(2)), (None, None));
        assert_eq!(rt.service_frame(1), Some(frame));

        let received = Received { frame, at_ns: 77 };
        assert_eq!([0, 1, 1].map(|bus| rt.received(bus, &received)), [true, true, false]);
        assert_eq!(host.take_service(), Some((0, received)));
        assert_eq!(host.take_service(), Some((1, received)));
        assert_eq!(host.take_service(), None);
    }

    #[test]
    fn a_thread_that_looks_at_two_controllers_in_turn_sees_the_newest_state_of_each() {
        let (mut first, first_host, _log) = channels(&sizes());
        let (mut second, second_host, _log) = channels(&sizes());
        for slot in 1..5 {
            first.publish(&Snapshot { slot, ..Snapshot::default() });
            for (host, seen) in [(&first_host, slot), (&second_host, 2 * (slot - 1)), (&first_host, slot)] {
                assert_eq!(host.observer().look(|state| state.slot), seen);
            }
            second.publish(&Snapshot { slot: 2 * slot, ..Snapshot::default() });
            assert_eq!(second_host.observer().look(|state| state.slot), 2 * slot);
        }
    }

    #[test]
    fn reports_of_drives_outside_of_the_cycle_arrive_in_order_until_there_is_no_room() {
        let (mut rt, mut host, _log) = channels(&sizes());
        let report = |position| OffCycleReport { position, ..OffCycleReport::default() };
        let most = REPORTS_OF_AXIS * 2;
        let taken = (0..most + 3).filter(|at| host.report_off_cycle(1, report(*at as f64))).count();
        assert_eq!(taken, most);
        let arrived: Vec<_> = std::iter::from_fn(|| rt.off_cycle_report()).collect();
        assert_eq!(arrived, (0..most).map(|at| (1, report(at as f64))).collect::<Vec<_>>());
    }

    #[test]
    fn the_state_before_the_first_cycle_has_every_group_axis_and_bus() {
        let group = |axis| GroupStream {
            axes: GroupAxes::new(vec![axis]),
            look_ahead: LookAheadParameters::default(),
        };
        let sizes = ChannelSizes { groups: (0..3).map(group).collect(), axes: 3, ..sizes() };
        let (_rt, host, _log) = channels(&sizes);
        let first = host.snapshot();
        assert_eq!((first.groups().len(), first.axis_count, first.bus_count), (3, 3, 2));
        assert!(first.groups().iter().all(|group| group.phase == Phase::Passive));
    }

    #[test]
    fn every_observer_sees_the_newest_snapshot() {
        let (mut rt, host, _log) = channels(&sizes());
        let observer = host.observer();
        let mut snapshot = Snapshot { slot: 9, axis_count: 2, ..words::NO_SNAPSHOT };
        snapshot.groups[0].phase = Phase::Holding;
        rt.publish(&snapshot);
        assert_eq!((observer.snapshot(), host.snapshot()), (snapshot, snapshot));
    }

    #[test]
    fn the_log_side_gets_records_and_events_and_the_numbers_of_dropped_ones() {
        let (mut rt, host, mut log) = channels(&sizes());
        let record = CycleRecord { axis_count: 2, ..CycleRecord::default() };
        assert_eq!((0..6).filter(|_| rt.record(&record)).count(), 4);
        let mut observer = host.events();
        let event = |slot| Event {
            slot,
            at_ns: 0,
            group: None,
            kind: EventKind::MotionFinished { request: RequestId(1) },
        };
        assert_eq!((0..3).filter(|slot| rt.event(&event(*slot))).count(), 2);
        assert_eq!(log.next_record(|seen| *seen), Some(record));
        assert_eq!(log.take_event(), Some(event(0)));
        assert_eq!(observer.by_ref().map(|seen| seen.slot).collect::<Vec<_>>(), [1, 2]);
        assert_eq!((observer.missed(), log.events_dropped()), (1, 1));
        assert_eq!((log.records_written(), log.records_dropped(), log.events_dropped()), (4, 2, 1));
    }
}
