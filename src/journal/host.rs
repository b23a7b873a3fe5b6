//! The host of a run, replayed.

use std::collections::{HashMap, VecDeque};

use takt_rt::{
    AxisSnapshot, AxisTarget, CallbackCycle, CallbackId, CallbackOutcome, CallbackReturn, CheckpointError,
    CycleRecord, Event, Frame, HostInterface, MAX_AXES, Nanoseconds, OffCycleReport, RequestEnvelope,
    StreamPoint, StreamSample, TrajectoryId, TrajectorySample,
};

use super::format::JournaledTrajectory;
use super::pop_front_if;
use crate::channels::{ChannelSizes, GivenTrajectory, GroupAxes, HostInput, JournalEntry, RtSide, channels};

/// A host that gives what it gave, cycle by cycle.
pub struct ReplayHost {
    /// The streams are those of every run: points are looked ahead, and become set-points.
    rt: RtSide,
    entries: VecDeque<JournalEntry>,
    trajectories: HashMap<TrajectoryId, (u8, GivenTrajectory)>,
    now: Inputs,
    cycle: u64,
    /// The record of the last cycle.
    pub record: Box<CycleRecord>,
    /// The events since the last look.
    pub events: Vec<Event>,
}

/// What the present cycle takes.
#[derive(Default)]
struct Inputs {
    requests: VecDeque<RequestEnvelope>,
    reports: VecDeque<(u8, OffCycleReport)>,
    /// Of all groups, in the order in which they were taken.
    points: Vec<(u8, Box<StreamPoint>)>,
    service_frames: VecDeque<(usize, Frame)>,
    callbacks_taken: VecDeque<bool>,
    calls: VecDeque<(CallbackReturn, Box<[Option<AxisTarget>; MAX_AXES]>)>,
}

impl ReplayHost {
    /// A host that has nothing to give yet, for a controller with such channels.
    pub fn new(sizes: &ChannelSizes) -> Self {
        let (rt, _host, _log) = channels(sizes);
        Self {
            rt,
            entries: VecDeque::new(),
            trajectories: HashMap::new(),
            now: Inputs::default(),
            cycle: 0,
            record: Box::default(),
            events: Vec::new(),
        }
    }

    /// Adds what it is to give.
    pub fn add(&mut self, entries: VecDeque<JournalEntry>, trajectories: Vec<JournaledTrajectory>) {
        self.entries.extend(entries);
        self.trajectories.extend(trajectories.into_iter().map(
            |JournaledTrajectory { id, group, axes, trajectory }| {
                (id, (group, GivenTrajectory::new(trajectory, GroupAxes::new(axes))))
            },
        ));
    }

    /// Goes on with this cycle and these streams.
    ///
    /// # Errors
    /// The streams are none of this controller's.
    pub fn resume(&mut self, cycle: u64, streams: &[Vec<u8>]) -> Result<(), CheckpointError> {
        self.rt.resume_streams(streams)?;
        self.cycle = cycle;
        Ok(())
    }

    /// The cycle that comes next, counted from 0.
    pub const fn next_cycle(&self) -> u64 {
        self.cycle
    }

    /// The state of each stream.
    pub fn streams(&self) -> Vec<Vec<u8>> {
        self.rt.stream_checkpoints()
    }

    /// The entries that it has not given yet.
    pub fn unused(&self) -> impl Iterator<Item = &JournalEntry> {
        self.entries.iter()
    }

    /// The trajectories that may still be asked for.
    pub fn trajectories(&self) -> impl Iterator<Item = (TrajectoryId, u8, &GivenTrajectory)> {
        self.trajectories.iter().map(|(id, (group, given))| (*id, *group, given))
    }

    /// Lays out what the next cycle takes. What the one before has left is gone.
    pub fn begin_cycle(&mut self) {
        self.now = Inputs::default();
        while let Some(JournalEntry { input, .. }) =
            pop_front_if(&mut self.entries, |entry| entry.cycle <= self.cycle)
        {
            match input {
                HostInput::Request(request) => self.now.requests.push_back(request),
                HostInput::OffCycleReport { axis, report } => self.now.reports.push_back((axis, report)),
                HostInput::Point { group, point } => self.now.points.push((group, Box::new(point))),
                HostInput::CallbackTaken { is_there } => self.now.callbacks_taken.push_back(is_there),
                HostInput::Called { returned, targets } => {
                    self.now.calls.push_back((returned, Box::new(targets)))
                }
                HostInput::ServiceFrame { bus, frame } => {
                    self.now.service_frames.push_back((bus.into(), frame));
                }
            }
        }
        self.cycle += 1;
    }
}

impl HostInterface for ReplayHost {
    fn request(&mut self) -> Option<RequestEnvelope> {
        self.now.requests.pop_front()
    }

    fn off_cycle_report(&mut self) -> Option<(u8, OffCycleReport)> {
        self.now.reports.pop_front()
    }

    fn begin_stream(&mut self, group: u8) {
        self.rt.begin_stream(group);
    }

    fn stream(&mut self, group: u8, slot_start_ns: Nanoseconds, sample: &mut StreamSample) {
        for (_, point) in self.now.points.iter().filter(|(of_group, _)| *of_group == group) {
            self.rt.insert_point(group, point, slot_start_ns);
        }
        self.rt.stream(group, slot_start_ns, sample);
    }

    fn trajectory(&mut self, group: u8, trajectory: TrajectoryId, at_s: f64) -> Option<TrajectorySample> {
        let (of_group, given) = self.trajectories.get(&trajectory)?;
        (*of_group == group).then(|| given.sample(at_s))
    }

    /// Numbers rise: what was given before the oldest that is needed will not be asked for again.
    fn keep_trajectories(&mut self, group: u8, needed: [Option<TrajectoryId>; 2]) {
        if let Some(oldest) = needed.into_iter().flatten().min_by_key(|id| id.0) {
            self.trajectories.retain(|id, (of_group, _)| *of_group != group || id.0 >= oldest.0);
        }
    }

    fn take_callback(&mut self, _group: u8, _callback: CallbackId) -> bool {
        self.now.callbacks_taken.pop_front().unwrap_or(false)
    }

    /// A call that was not made in the run commands nothing: the axes hold.
    fn callback(
        &mut self,
        _group: u8,
        _callback: CallbackId,
        _cycle: &CallbackCycle,
        _axes: &[AxisSnapshot; MAX_AXES],
        targets: &mut [Option<AxisTarget>; MAX_AXES],
    ) -> CallbackReturn {
        let Some((returned, wanted)) = self.now.calls.pop_front() else {
            return CallbackReturn { outcome: CallbackOutcome::Commanded, spent_ns: 0 };
        };
        *targets = *wanted;
        returned
    }

    fn service_frame(&mut self, bus: usize) -> Option<Frame> {
        let place = self.now.service_frames.iter().position(|(of_bus, _)| *of_bus == bus)?;
        self.now.service_frames.remove(place).map(|(_, frame)| frame)
    }

    fn record(&mut self, record: &CycleRecord) -> bool {
        *self.record = *record;
        true
    }

    fn event(&mut self, event: &Event) -> bool {
        self.events.push(*event);
        true
    }
}
