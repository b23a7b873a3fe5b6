//! A controller of this process as what a handle stands on.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::{AxisPoint, Nanoseconds, PointRole, Request, RequestId, RequestTarget, Snapshot, StopCategory};

use super::OwnProcess;
use super::events::OwnEvents;
use crate::channels::{MotionEnd, SentPoint, chunk};
use crate::command::{
    AxisProperties, Backend, Command, CommandError, EventSource, LeaseHolder, MotionId, Reply, StreamError,
    WaitError,
};
use crate::telemetry::{LoopTiming, Machine};
use crate::trajectory::Trajectory;

impl Backend for OwnProcess {
    fn machine(&self) -> &Machine {
        &self.machine
    }

    fn axes_of(&self, target: RequestTarget) -> Vec<usize> {
        match target {
            RequestTarget::Group(number) if number > 0 || !self.groups.is_empty() => {
                self.groups.get(usize::from(number)).map_or_else(Vec::new, |group| group.axes.clone())
            }
            _ => (0..self.axes.len()).collect(),
        }
    }

    fn axis_properties(&self, axis: usize) -> Option<AxisProperties> {
        self.axes.get(axis).map(AxisProperties::of)
    }

    fn look(&self, look: &mut dyn FnMut(&Snapshot)) {
        self.observer.look(look);
    }

    fn now_ns(&self) -> Nanoseconds {
        self.pace.now_ns()
    }

    fn timing(&self) -> LoopTiming {
        self.timing.newest()
    }

    fn has_ended(&self) -> bool {
        self.life.is_over()
    }

    fn newest_stop(&self, target: RequestTarget) -> RequestId {
        self.clients.newest_stop(target)
    }

    fn submit(&self, command: Command) -> Result<Reply, CommandError> {
        match command {
            // Every part of the program may command.
            Command::Lease { .. } | Command::Release => Ok(Reply::Done),
            Command::Move { target, options, positions } => {
                motion(self.move_axes(self.asked(target), &self.axes_of(target), &positions, options))
            }
            Command::MoveBy { target, options, distances } => {
                let axes = self.axes_of(target);
                let positions = self.beyond_set_points(&axes, &distances);
                motion(self.move_axes(self.asked(target), &axes, &positions, options))
            }
            Command::Execute { target, points } => motion(
                self.one_group(target)?.execute_with(|conditions| Trajectory::new(&points, conditions)),
            ),
            Command::Through { target, waypoints } => motion(
                self.one_group(target)?
                    .execute_with(|conditions| Trajectory::through(&waypoints, conditions)),
            ),
            Command::SetSpeed { motion, rate } => done(self.group_of_motion(motion)?.set_speed(motion, rate)),
            Command::Pause(motion) => done(self.group_of_motion(motion)?.set_paused(motion, true)),
            Command::Resume(motion) => done(self.group_of_motion(motion)?.set_paused(motion, false)),
            Command::Progress(motion) => Ok(Reply::Progress(self.progress(motion))),
            Command::Velocity { axis, velocity, valid_for } => {
                motion(self.give_velocity(axis, velocity, valid_for))
            }
            Command::Torque { axis, torque, valid_for } => motion(self.give_torque(axis, torque, valid_for)),
            Command::ChangeMode { target, mode } => {
                motion(self.change_modes(self.asked(target), &self.axes_of(target), mode))
            }
            Command::ChangeAxisMode { axis, mode } => motion(self.change_axis_mode(axis, mode)),
            Command::Enable(target) => done(self.request(self.asked(target), Request::Enable)),
            Command::Disable(target) => done(self.disable(self.asked(target))),
            Command::ResetFaults(target) => done(self.request(self.asked(target), Request::ResetFaults)),
            Command::BringUp(target) => done(self.request(self.asked(target), Request::BringUp)),
            Command::BringUpFailure(target) => {
                let is_meant = |group: &u8| {
                    matches!(target, RequestTarget::All) || target == RequestTarget::Group(*group)
                };
                let mut meant = (0..self.observer.look(|state| state.group_count)).filter(is_meant);
                Ok(Reply::BringUpFailure(meant.find_map(|group| self.bring_up_failures.of(group))))
            }
            Command::BeginStream(target) => done(self.request(self.asked(target), Request::Stream)),
            Command::Question { bus, frame } => done(self.ask_device(bus, frame)),
        }
    }

    fn stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandError> {
        if self.has_ended() {
            return Err(CommandError::Ended);
        }
        self.clients.stop_of(self.asked(target), MotionEnd::Stop(category));
        Ok(())
    }

    fn push(&self, target: RequestTarget, at_ns: Nanoseconds, axes: &[AxisPoint]) -> Result<(), StreamError> {
        self.check_points(target, [axes].into_iter())?;
        self.hand_over(target, &[SentPoint { at_ns, role: PointRole::Single, axes }])
    }

    fn push_chunk(
        &self,
        target: RequestTarget,
        from_ns: Nanoseconds,
        interval: Duration,
        points: &[Vec<AxisPoint>],
    ) -> Result<(), StreamError> {
        self.check_points(target, points.iter().map(Vec::as_slice))?;
        let interval_ns = u64::try_from(interval.as_nanos()).unwrap_or(u64::MAX);
        self.hand_over(target, &chunk(from_ns, interval_ns, points))
    }

    fn look_until(
        &self,
        at_most: Duration,
        look: &mut dyn FnMut(&Snapshot) -> bool,
    ) -> Result<(), WaitError> {
        self.wait_until(at_most, |state| look(state).then_some(()))
    }

    fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.wait_for_cycle(slot, at_most)
    }

    fn events(self: Arc<Self>) -> Box<dyn EventSource> {
        Box::new(OwnEvents::new(self))
    }

    fn lease(&self) -> Option<LeaseHolder> {
        None
    }
}

fn done(result: Result<(), CommandError>) -> Result<Reply, CommandError> {
    result.map(|()| Reply::Done)
}

fn motion(result: Result<MotionId, CommandError>) -> Result<Reply, CommandError> {
    result.map(Reply::Motion)
}
