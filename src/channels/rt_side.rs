//! The side of the real-time thread: what it takes from the host, and what it leaves for others.

use takt_rt::{
    AxisSnapshot, AxisTarget, CallbackCycle, CallbackId, CallbackReturn, CheckpointError, CycleRecord, Event,
    Frame, HostInterface, MAX_AXES, Nanoseconds, OffCycleReport, Received, RequestEnvelope, Snapshot,
    StreamPoint, StreamSample, TrajectoryId, TrajectorySample,
};

use super::abandonment::Abandonment;
use super::callbacks::{CallbackClock, CallbackTaker};
use super::client_requests::TakenRequests;
use super::journal::{HostInput, JournalWriter};
use super::latest::Writer;
use super::observed_events::EventWriter;
use super::records::RecordProducer;
use super::ring::{Consumer, Producer};
use super::stream::StreamReceiver;
use super::trajectories::TrajectoryTaker;
use super::words::put_snapshot;

/// The real-time thread's side.
pub struct RtSide {
    pub(super) requests: Consumer<RequestEnvelope>,
    pub(super) clients: TakenRequests,
    /// True if a client's request comes before the next one of the host. They alternate, so that no flood of the one holds up
    /// the other.
    pub(super) is_client_next: bool,
    pub(super) streams: Vec<StreamReceiver>,
    pub(super) trajectories: TrajectoryTaker,
    pub(super) callbacks: CallbackTaker,
    pub(super) service: Vec<Consumer<Frame>>,
    pub(super) received: Producer<(usize, Received)>,
    pub(super) off_cycle_reports: Consumer<(u8, OffCycleReport)>,
    pub(super) records: RecordProducer,
    pub(super) events: Producer<Event>,
    pub(super) observed: EventWriter,
    pub(super) snapshot: Writer,
    pub(super) abandonment: Abandonment,
    /// Notes what is taken, for a replay.
    pub(super) journal: Option<JournalWriter>,
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

    /// Takes a point of a stream as one that a client has pushed, for a replay.
    pub fn insert_point(&mut self, group: u8, point: &StreamPoint, slot_start_ns: Nanoseconds) {
        if let Some(stream) = self.streams.get_mut(usize::from(group)) {
            stream.insert(point, slot_start_ns);
        }
    }

    /// By which the loop is given up.
    pub fn abandonment(&self) -> Abandonment {
        self.abandonment.clone()
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

    fn discard_points(&mut self, group: u8) -> u64 {
        self.streams.get_mut(usize::from(group)).map_or(0, StreamReceiver::discard)
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
        self.abandonment.wait_if_begun();
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
