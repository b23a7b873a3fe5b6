//! The channels between the real-time thread and the rest of the program. [`channels`] allocates all of them, and returns
//! their three sides.
//!
//! ```text
//! HostSide ── requests, trajectories, service frames ──▶ RtSide (takt_rt::HostInterface)
//! clients  ── requests, stops, trajectories, points of a stream, from any number of threads ──▶ RtSide
//! HostSide ◀── service frames, newest snapshot, last events (any number of observers) ── RtSide
//! clients  ◀── trajectories that are done with ── RtSide
//! clients  ── questions to devices that the configuration does not have ──▶ HostSide
//! clients  ◀── why drives were not brought up again ── HostSide
//! LogSide  ◀── cycle records, events ── RtSide
//! ```
//!
//! No call on [`RtSide`] allocates, locks or waits, even if another thread is preempted in the middle of a call.

mod abandonment;
mod bring_up_failures;
mod callback_panic;
mod callback_record;
mod callbacks;
mod client_requests;
mod error;
mod event_words;
mod group_axes;
mod host_side;
mod journal;
mod latest;
mod lending;
mod log_side;
mod motion_words;
mod observed_events;
mod observer;
mod primitives;
mod questions;
mod records;
mod request_numbers;
mod ring;
mod rt_side;
mod stop_words;
mod stream;
mod trajectories;
mod words;

use takt_rt::{HostInterface, Snapshot};

use client_requests::client_requests;
use observed_events::observed_events;
use stream::stream_channels;

pub use abandonment::Abandonment;
pub use bring_up_failures::BringUpFailures;
pub(crate) use callback_panic::panic_message;
pub use callback_record::{CallbackRecord, CallbackTimes};
pub use callbacks::{
    CallbackClock, CallbackCommand, CallbackGiver, CallbackState, GivenCallback, LoopCallback,
};
pub use client_requests::{ClientRequests, MotionEnd, WAITING_AT_MOST};
pub use error::ChannelError;
pub use event_words::EVENT_WORDS;
pub use group_axes::GroupAxes;
pub use host_side::HostSide;
pub use journal::{HostInput, JournalEntry, JournalReader};
pub use latest::{Allocated, Attempt, Cells, Reader as LatestReader, Words, Writer as LatestWriter, latest};
pub use log_side::LogSide;
pub use observed_events::EventReader;
pub use observed_events::EventWriter;
pub use observer::Observer;
pub use questions::{QUESTIONS_AT_MOST, Questions};
pub use request_numbers::RequestNumbers;
pub use ring::{Consumer, Producer, ring};
pub use rt_side::RtSide;
pub use stream::{GroupStream, SentPoint, Streamer, chunk};
pub use trajectories::{GivenTrajectory, NumberedTrajectory, TrajectoryGiver};
pub use words::{put_snapshot, snapshot_words, take_snapshot};

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
        abandonment: Abandonment::default(),
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
        bring_up_failures: BringUpFailures::default(),
        received: received_out,
        off_cycle_reports: report_in,
        observer: Observer::new(snapshot_out),
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

/// Notes from now on everything that the real-time thread takes from the host, for a replay. Call it before the first cycle.
pub fn journal(rt: &mut RtSide, host: &mut HostSide) -> JournalReader {
    let (writer, reader) = journal::journal();
    rt.journal = Some(writer);
    host.trajectories.note_in(reader.trajectories());
    reader
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{
        CycleRecord, Event, EventKind, Frame, Id, LookAheadParameters, OffCycleReport, Phase, Received,
        Request, RequestEnvelope, RequestId, RequestTarget, StopCategory,
    };

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
