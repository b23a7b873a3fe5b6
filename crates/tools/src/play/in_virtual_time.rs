//! A performance in virtual time, on simulated drives: bit for bit the same each time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use takt_rt::plan::State;
use takt_rt::{
    AxisLimits, ExecutionStart, MAX_AXES, Move, NANOSECONDS_PER_SECOND, Nanoseconds, Request, RequestId,
    RequestTarget, Snapshot, StopCategory, StreamPoint,
};

use super::groups::PlayedGroup;
use super::performance::{APPROACH_SCALE, MakeTrajectory, PlayError, Stage};
use super::set_points::SetPointLog;
use takt::channels::{GivenTrajectory, GroupAxes, LogSide};
use takt::config::Config;
use takt::controller::assemble::AssembleError;
use takt::controller::{AfterBringUp, Interrupt, Outcome, VirtualRun};
use takt::trajectory::TrajectoryConditions;
use takt_sim::SimulatedBus;

/// An arm of simulated drives in virtual time.
pub struct VirtualStage<'a> {
    run: VirtualRun<SimulatedBus>,
    log: LogSide,
    set_points: SetPointLog,
    limits: Vec<AxisLimits>,
    period_s: f64,
    period_ns: Nanoseconds,
    interrupted: &'a AtomicBool,
    was_interrupted: bool,
}

impl<'a> VirtualStage<'a> {
    /// An arm of this configuration, whatever interfaces its buses have. It ends in control once `interrupted` is set.
    ///
    /// # Errors
    /// A configuration that cannot be executed.
    pub fn new(
        config: &Config,
        set_points: SetPointLog,
        interrupted: &'a AtomicBool,
    ) -> Result<Self, AssembleError> {
        config.validate()?;
        let ports = (0..config.buses.len()).map(|bus| takt::family::simulated_bus(config, bus)).collect();
        let (run, log) = VirtualRun::serving(config, ports, AfterBringUp::Enable)?;
        Ok(Self {
            run,
            log,
            set_points,
            limits: config.axes.iter().map(|axis| axis.limits).collect(),
            period_s: config.cycle.period_ns as f64 / NANOSECONDS_PER_SECOND as f64,
            period_ns: config.cycle.period_ns.max(1),
            interrupted,
            was_interrupted: false,
        })
    }

    fn request(&mut self, group: &PlayedGroup, request: Request) -> Result<RequestId, PlayError> {
        let requested = self.run.host().request_of(RequestTarget::Group(group.number), request);
        requested.map_err(|error| PlayError::Command(error.to_string()))
    }

    fn step(&mut self) -> bool {
        if self.interrupted.swap(false, Ordering::Relaxed) {
            self.was_interrupted = true;
            self.run.interrupt(Interrupt::Controlled);
        }
        let goes_on = self.run.step();
        while self.log.next_record(|record| self.set_points.add(record)).is_some() {}
        while self.log.take_event().is_some() {}
        goes_on
    }

    /// Brings the arm to rest, disables and shuts down the drives. Returns how the run ended, unless it was by this, and its
    /// set-points.
    pub fn finish(mut self) -> (Option<Outcome>, Snapshot, SetPointLog) {
        // The last set-points at rest.
        for _ in 0..4 {
            self.step();
        }
        let by_itself = self.was_interrupted || self.run.supervisor().outcome().is_some();
        self.run.interrupt(Interrupt::Controlled);
        while self.step() {}
        let outcome = self.run.supervisor().outcome().filter(|_| by_itself).cloned();
        let snapshot = self.run.snapshot();
        (outcome, snapshot, self.set_points)
    }
}

impl Stage for VirtualStage<'_> {
    fn snapshot(&mut self) -> Snapshot {
        self.run.snapshot()
    }

    fn pass(&mut self) -> bool {
        self.step() && !self.was_interrupted
    }

    fn move_to(&mut self, group: &PlayedGroup, target: &[f64]) -> Result<RequestId, PlayError> {
        let mut all = [0.0; MAX_AXES];
        all.iter_mut().zip(target).for_each(|(to, from)| *to = *from);
        let request = Request::Move(Move {
            target: all,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: APPROACH_SCALE,
            acceleration_scale: APPROACH_SCALE,
            minimum_duration_s: 0.0,
        });
        self.request(group, request)
    }

    fn execute(&mut self, group: &PlayedGroup, make: MakeTrajectory<'_>) -> Result<RequestId, PlayError> {
        let axes = group.pick(&self.run.snapshot().axes);
        let start: Vec<State> = axes.iter().map(|axis| State::rest(axis.position_set)).collect();
        let limits = group.pick(&self.limits);
        let conditions = TrajectoryConditions { start: &start, limits: &limits, period_s: self.period_s };
        let trajectory = make(&conditions).map_err(|error| PlayError::Command(error.to_string()))?;
        let places = GroupAxes::new(group.axes.clone());
        let given = Arc::new(GivenTrajectory::new(trajectory, places));
        let executed = self.run.host().execute(group.number, &given, ExecutionStart::Now);
        executed.map_err(|error| PlayError::Command(error.to_string()))
    }

    fn begin_stream(&mut self, group: &PlayedGroup) -> Result<RequestId, PlayError> {
        self.request(group, Request::Stream)
    }

    fn push(&mut self, group: &PlayedGroup, points: &[StreamPoint]) -> bool {
        self.run.host().streamer().push_to(group.number, points).is_ok()
    }

    fn stop(&mut self) -> Result<(), PlayError> {
        let requested = self.run.host().request(Request::Stop(StopCategory::Two));
        requested.map(drop).map_err(|error| PlayError::Command(error.to_string()))
    }

    /// The beginning of the next slot. The slots of virtual time begin at multiples of the period.
    fn time_ns(&mut self) -> Nanoseconds {
        (self.run.snapshot().at_ns / self.period_ns + 1) * self.period_ns
    }
}
