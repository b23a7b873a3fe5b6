//! The side of the program that commands the controller.

use std::sync::Arc;

use takt_rt::CallbackRun;
use takt_rt::{
    ExecutionStart, Frame, OffCycleReport, Received, Request, RequestEnvelope, RequestId, RequestTarget,
    Snapshot,
};

use super::bring_up_failures::BringUpFailures;
use super::callbacks::CallbackGiver;
use super::callbacks::GivenCallback;
use super::client_requests::ClientRequests;
use super::observed_events::EventReader;
use super::questions::Questions;
use super::ring::{Consumer, Producer};
use super::stream::Streamer;
use super::trajectories::{GivenTrajectory, TrajectoryGiver};
use super::{ChannelError, Observer, RequestNumbers};

/// The side of the program that commands the controller.
pub struct HostSide {
    pub(super) requests: Producer<RequestEnvelope>,
    pub(super) numbers: RequestNumbers,
    pub(super) trajectories: TrajectoryGiver,
    pub(super) callbacks: CallbackGiver,
    pub(super) clients: ClientRequests,
    pub(super) observed: EventReader,
    pub(super) streamer: Streamer,
    pub(super) service: Vec<Producer<Frame>>,
    pub(super) questions: Questions,
    pub(super) bring_up_failures: BringUpFailures,
    pub(super) received: Consumer<(usize, Received)>,
    pub(super) off_cycle_reports: Producer<(u8, OffCycleReport)>,
    pub(super) observer: Observer,
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

    /// Why drives were not brought up again, for any thread.
    pub fn bring_up_failures(&self) -> BringUpFailures {
        self.bring_up_failures.clone()
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
