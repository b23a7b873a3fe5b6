//! A client as any running controller.

use std::time::Duration;

use takt::command::{
    AxisProperties, CommandError, EventSource, LeaseHolder, MotionError, MotionId, MoveOptions,
    RunningController, StreamError, TrajectoryProgress, WaitError,
};
use takt::telemetry::{LoopTiming, Machine};
use takt::trajectory::TrajectoryPoint;
use takt_rt::{
    AxisPoint, Frame, Nanoseconds, OperationMode, RequestId, RequestTarget, Snapshot, StopCategory,
};

use crate::client::Client;
use crate::commands::{Command, chunk_points};

impl RunningController for Client {
    fn machine(&self) -> &Machine {
        Self::machine(self)
    }

    fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        self.0.description.axes_of(target)
    }

    fn axis_properties(&self, axis: usize) -> Option<AxisProperties> {
        Self::axis_properties(self, axis)
    }

    fn state(&self) -> Snapshot {
        Self::state(self)
    }

    fn now_ns(&self) -> Nanoseconds {
        Self::now_ns(self)
    }

    fn timing(&self) -> LoopTiming {
        Self::timing(self)
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

    fn advance(&self, cycles: u64) -> Result<Snapshot, WaitError> {
        Self::advance(self, cycles)
    }

    fn wait_until_seen(
        &self,
        at_most: Duration,
        look: &mut dyn FnMut(&Snapshot) -> bool,
    ) -> Result<(), WaitError> {
        self.wait_until(at_most, |state| look(state).then_some(()))
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
        self.0.begun(Command::Move { target, options, positions: positions.to_vec() })
    }

    fn begin_move_by(
        &self,
        target: RequestTarget,
        distances: &[f64],
        options: MoveOptions,
    ) -> Result<MotionId, CommandError> {
        self.0.begun(Command::MoveBy { target, options, distances: distances.to_vec() })
    }

    fn begin_trajectory(
        &self,
        target: RequestTarget,
        points: &[TrajectoryPoint],
    ) -> Result<MotionId, CommandError> {
        self.0.trajectory(target, points, Command::Execute { target, points: points.len() })
    }

    fn begin_through(&self, target: RequestTarget, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        let point = |positions: &Vec<f64>| TrajectoryPoint {
            positions: positions.clone(),
            ..TrajectoryPoint::default()
        };
        let points: Vec<TrajectoryPoint> = waypoints.iter().map(point).collect();
        self.0.trajectory(target, &points, Command::Through { target, points: points.len() })
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

    fn trajectory_progress(&self, motion: MotionId) -> Result<Option<TrajectoryProgress>, CommandError> {
        Self::trajectory_progress(self, motion)
    }

    fn velocity(&self, axis: usize, velocity: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        Self::velocity(self, axis, velocity, valid_for)
    }

    fn torque(&self, axis: usize, torque: f64, valid_for: Duration) -> Result<MotionId, CommandError> {
        Self::torque(self, axis, torque, valid_for)
    }

    fn ask_device(&self, bus: usize, question: Frame) -> Result<(), CommandError> {
        Self::ask_device(self, bus, question)
    }

    fn begin_mode_change(
        &self,
        target: RequestTarget,
        mode: OperationMode,
    ) -> Result<MotionId, CommandError> {
        self.0.begun(Command::ChangeMode { target, mode })
    }

    fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        Self::change_axis_mode(self, axis, mode)
    }

    fn begin_streaming(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.0.done(Command::BeginStream(target))
    }

    fn push_point(
        &self,
        target: RequestTarget,
        at_ns: Nanoseconds,
        axes: &[AxisPoint],
    ) -> Result<(), StreamError> {
        self.0.taken(Command::Point { target, at_ns, axes: axes.to_vec() })
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
            self.0.taken(Command::Chunk { target, from_ns, interval, points: points.to_vec() })?;
        }
        Ok(())
    }

    fn request_stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError> {
        self.0.send_stop(target, category)
    }

    fn begin_enable(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.0.done(Command::Enable(target))
    }

    fn begin_disable(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.0.done(Command::Disable(target))
    }

    fn clear_faults(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.0.done(Command::ResetFaults(target))
    }

    fn begin_bring_up(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.0.done(Command::BringUp(target))
    }

    fn bring_up_failure(&self, target: RequestTarget) -> Result<Option<String>, CommandError> {
        self.0.bring_up_failure(target)
    }

    fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        Self::result_of(self, motion)
    }

    fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        Self::wait(self, motion, at_most)
    }

    fn lease(&self) -> Option<LeaseHolder> {
        Self::lease(self)
    }

    fn take_lease(&self) -> Result<(), CommandError> {
        Self::take_lease(self)
    }

    fn take_over(&self) -> Result<(), CommandError> {
        Self::take_over(self)
    }

    fn release(&self) -> Result<(), CommandError> {
        Self::release(self)
    }
}
