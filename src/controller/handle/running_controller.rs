//! A handle as any running controller.

use std::time::Duration;

use takt_rt::{
    AxisPoint, Event, Frame, Nanoseconds, OperationMode, RequestId, RequestTarget, Snapshot, StopCategory,
};

use super::{Events, GroupHandle, Handle};
use crate::command::{
    AxisProperties, CommandError, EventSource, LeaseHolder, MotionError, MotionId, MoveOptions,
    RunningController, StreamError, TrajectoryProgress, WaitError,
};
use crate::telemetry::{LoopTiming, Machine};
use crate::trajectory::TrajectoryPoint;

impl Handle {
    /// The one group that is meant: what is one trajectory is for one group.
    fn one_group(&self, target: RequestTarget) -> Result<GroupHandle, CommandError> {
        match target {
            RequestTarget::All => self.only_group(),
            RequestTarget::Group(number) => Ok(self.group_of_number(number)),
        }
    }
}

impl RunningController for Handle {
    fn machine(&self) -> &Machine {
        Self::machine(self)
    }

    fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        match target {
            RequestTarget::Group(number) if number > 0 || !self.groups().is_empty() => {
                self.groups().get(usize::from(number)).map_or_else(Vec::new, |group| group.axes.clone())
            }
            _ => (0..self.axes().len()).collect(),
        }
    }

    fn axis_properties(&self, axis: usize) -> Option<AxisProperties> {
        self.axes().get(axis).map(AxisProperties::of)
    }

    fn state(&self) -> Snapshot {
        Self::state(self)
    }

    fn look_at_state(&self, look: &mut dyn FnMut(&Snapshot)) {
        self.0.observer.look(look);
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
        self.0.clients.newest_stop(target)
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
        self.move_axes(target, &self.axes_of(target), positions, options)
    }

    fn begin_move_by(
        &self,
        target: RequestTarget,
        distances: &[f64],
        options: MoveOptions,
    ) -> Result<MotionId, CommandError> {
        let axes = self.axes_of(target);
        self.move_axes(target, &axes, &self.beyond_set_points(&axes, distances), options)
    }

    fn begin_trajectory(
        &self,
        target: RequestTarget,
        points: &[TrajectoryPoint],
    ) -> Result<MotionId, CommandError> {
        self.one_group(target)?.execute(points)
    }

    fn begin_through(&self, target: RequestTarget, waypoints: &[Vec<f64>]) -> Result<MotionId, CommandError> {
        self.one_group(target)?.move_through(waypoints)
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
        Ok(Self::trajectory_progress(self, motion))
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
        self.change_modes(target, &self.axes_of(target), mode)
    }

    fn change_axis_mode(&self, axis: usize, mode: OperationMode) -> Result<MotionId, CommandError> {
        Self::change_axis_mode(self, axis, mode)
    }

    fn begin_streaming(&self, target: RequestTarget) -> Result<(), CommandError> {
        match target {
            RequestTarget::All => self.begin_stream(),
            RequestTarget::Group(number) => self.group_of_number(number).begin_stream(),
        }
    }

    fn push_point(
        &self,
        target: RequestTarget,
        at_ns: Nanoseconds,
        axes: &[AxisPoint],
    ) -> Result<(), StreamError> {
        self.stream_of(target).push(at_ns, axes)
    }

    fn push_chunk(
        &self,
        target: RequestTarget,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[Vec<AxisPoint>],
    ) -> Result<(), StreamError> {
        self.stream_of(target).push_chunk(from_ns, interval, points)
    }

    fn request_stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError> {
        self.stop_of(target, category)
    }

    fn begin_enable(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.request_of(target, takt_rt::Request::Enable)
    }

    fn begin_disable(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.disable_of(target)
    }

    fn clear_faults(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.request_of(target, takt_rt::Request::ResetFaults)
    }

    fn begin_bring_up(&self, target: RequestTarget) -> Result<(), CommandError> {
        self.request_of(target, takt_rt::Request::BringUp)
    }

    fn bring_up_failure(&self, target: RequestTarget) -> Result<Option<String>, CommandError> {
        let groups = 0..self.state().group_count;
        let mut meant = groups
            .filter(|group| matches!(target, RequestTarget::All) || target == RequestTarget::Group(*group));
        Ok(meant.find_map(|group| self.0.bring_up_failures.of(group)))
    }

    fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        Self::result_of(self, motion)
    }

    fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        Self::wait(self, motion, at_most)
    }

    fn lease(&self) -> Option<LeaseHolder> {
        None
    }

    fn take_lease(&self) -> Result<(), CommandError> {
        Ok(())
    }

    fn take_over(&self) -> Result<(), CommandError> {
        Ok(())
    }

    fn release(&self) -> Result<(), CommandError> {
        Ok(())
    }
}

impl EventSource for Events {
    fn wait(&mut self, at_most: Duration) -> Result<Event, WaitError> {
        Self::wait(self, at_most)
    }

    fn missed(&self) -> u64 {
        Self::missed(self)
    }
}
