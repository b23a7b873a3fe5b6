//! The commands of one client.

use std::sync::Arc;

use takt::command::{CommandError, LeaseError, MotionId, StreamError};
use takt::trajectory::TrajectoryPoint;
use takt_rt::{Nanoseconds, RequestTarget};

use super::lease::Claimant;
use super::served::Served;
use crate::commands::{Command, Demand};
use crate::replies::{Answer, Reply};
use crate::shown::now_ns;
use crate::socket::{PACKET_BYTES, Packets, Received};

/// Carries the commands of one client out.
pub struct Worker {
    served: Arc<Served>,
    claimant: Claimant,
}

impl Worker {
    /// For a client.
    pub const fn new(served: Arc<Served>, claimant: Claimant) -> Self {
        Self { served, claimant }
    }

    /// Carries commands out until the client disconnects, or sends what is no command.
    pub fn run(self, connection: &Packets) {
        let mut packet = [0; PACKET_BYTES];
        while let Received::Bytes(count) = connection.receive(&mut packet, true) {
            let Some(demand) = Demand::of(packet.get(..count).unwrap_or_default()) else { break };
            let number = demand.number;
            let is_of_lease = matches!(demand.command, Command::Lease { .. } | Command::Release);
            let Some(reply) = self.answer(demand.command, demand.asked_ns) else { break };
            // Who has the lease is shown beside the next state, which a client waits for.
            let slot = self.served.controller.state().slot.saturating_add(is_of_lease.into());
            // A client that does not receive its replies is disconnected.
            if connection.send(&Answer { number, slot, reply }.packet()).is_err() {
                break;
            }
        }
        connection.shut_down();
    }

    /// Checks a command, and carries it out; `None` if it names a group that there is not: its sender has not read the description.
    pub fn answer(&self, command: Command, asked_ns: Nanoseconds) -> Option<Reply> {
        if let Some(RequestTarget::Group(group)) = command.target()
            && self.served.controller.axes_of(RequestTarget::Group(group)).is_empty()
        {
            return None;
        }
        let is_of_stream = matches!(command, Command::Point { .. } | Command::Chunk { .. });
        Some(match self.admit(&command) {
            Ok(()) if self.is_overtaken(&command, asked_ns) => match is_of_stream {
                true => Reply::NotTaken(StreamError::NotStreaming),
                false => Reply::Refused(CommandError::Overtaken),
            },
            Ok(()) => {
                let reply = self.carry_out(command);
                // The controller may have taken its time.
                self.served.lease().prolong(self.claimant, now_ns());
                reply
            }
            Err(error) if is_of_stream => Reply::NotTaken(StreamError::Lease(error)),
            Err(error) => Reply::Refused(error.into()),
        })
    }

    /// Whether this client may command.
    fn admit(&self, command: &Command) -> Result<(), LeaseError> {
        let mut lease = self.served.lease();
        match command {
            Command::Lease { is_taken_over: true } => lease.take_over(self.claimant, now_ns()),
            Command::Release => lease.release(self.claimant.connection),
            // To look is for everybody who may write, and a question only reads.
            Command::Progress(_) | Command::BringUpFailure(_) | Command::Question { .. } => {}
            _ => lease.renew(self.claimant, now_ns())?,
        }
        Ok(())
    }

    /// True if a stop has come since the client asked.
    fn is_overtaken(&self, command: &Command, asked_ns: Nanoseconds) -> bool {
        let target = command.target().unwrap_or(RequestTarget::All);
        command.is_discarded_by_stops() && self.served.stops.came_after(target, asked_ns)
    }

    fn carry_out(&self, command: Command) -> Reply {
        let controller = &self.served.controller;
        match command {
            Command::Lease { .. } | Command::Release => Reply::Done,
            Command::Move { target, options, positions } => {
                motion(controller.begin_move(target, &positions, options))
            }
            Command::MoveBy { target, options, distances } => {
                motion(controller.begin_move_by(target, &distances, options))
            }
            Command::Velocity { axis, velocity, valid_for } => {
                motion(controller.velocity(axis, velocity, valid_for))
            }
            Command::Torque { axis, torque, valid_for } => motion(controller.torque(axis, torque, valid_for)),
            Command::ChangeMode { target, mode } => motion(controller.begin_mode_change(target, mode)),
            Command::ChangeAxisMode { axis, mode } => motion(controller.change_axis_mode(axis, mode)),
            Command::Enable(target) => done(controller.begin_enable(target)),
            Command::Disable(target) => done(controller.begin_disable(target)),
            Command::ResetFaults(target) => done(controller.clear_faults(target)),
            Command::BringUp(target) => done(controller.begin_bring_up(target)),
            Command::BringUpFailure(target) => {
                controller.bring_up_failure(target).map_or_else(Reply::Refused, Reply::BringUpFailure)
            }
            Command::BeginStream(target) => done(controller.begin_streaming(target)),
            Command::Point { target, at_ns, axes } => taken(controller.push_point(target, at_ns, &axes)),
            Command::Chunk { target, from_ns, interval, points } => {
                taken(controller.push_chunk(target, from_ns, interval, &points))
            }
            Command::Points { target, points } => {
                let axes = controller.axes_of(target).len();
                done(self.served.lease().keep_points(self.claimant, axes, points))
            }
            Command::Execute { target, points } => motion(
                self.take_points(points).and_then(|points| controller.begin_trajectory(target, &points)),
            ),
            Command::Through { target, points } => motion(self.take_points(points).and_then(|points| {
                let waypoints: Vec<Vec<f64>> = points.into_iter().map(|point| point.positions).collect();
                controller.begin_through(target, &waypoints)
            })),
            Command::SetSpeed { motion, rate } => done(controller.set_speed(motion, rate)),
            Command::Pause(motion) => done(controller.pause(motion)),
            Command::Resume(motion) => done(controller.resume(motion)),
            Command::Question { bus, frame } => done(controller.ask_device(bus, frame)),
            Command::Progress(motion) => {
                controller.trajectory_progress(motion).map_or_else(Reply::Refused, Reply::Progress)
            }
        }
    }

    /// The points that have come, so many.
    fn take_points(&self, count: usize) -> Result<Vec<TrajectoryPoint>, CommandError> {
        Ok(self.served.lease().take_points(self.claimant, count)?)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.served.lease().leave(self.claimant.connection);
    }
}

fn done(result: Result<(), CommandError>) -> Reply {
    result.map_or_else(Reply::Refused, |()| Reply::Done)
}

fn motion(result: Result<MotionId, CommandError>) -> Reply {
    result.map_or_else(Reply::Refused, Reply::Motion)
}

fn taken(result: Result<(), StreamError>) -> Reply {
    result.map_or_else(Reply::NotTaken, |()| Reply::Done)
}
