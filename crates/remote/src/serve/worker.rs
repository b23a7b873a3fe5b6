//! The commands of one client.

use std::sync::Arc;

use takt::command::{Command, CommandError, LeaseError, Reply, StreamError};
use takt_rt::{Nanoseconds, RequestTarget};

use super::lease::Claimant;
use super::served::Served;
use crate::commands::{Asked, Demand};
use crate::replies::{Answer, Replied};
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
            let is_of_lease =
                matches!(demand.asked, Asked::Command(Command::Lease { .. } | Command::Release));
            let Some(reply) = self.answer(demand.asked, demand.asked_ns) else { break };
            // Who has the lease is shown beside the next state, which a client waits for.
            let slot = self.served.controller.state().slot.saturating_add(is_of_lease.into());
            // A client that does not receive its replies is disconnected.
            if connection.send(&Answer { number, slot, reply }.packet()).is_err() {
                break;
            }
        }
        connection.shut_down();
    }

    /// Checks what is asked, and carries it out; `None` if it names a group that there is not: its sender has not read the description.
    pub fn answer(&self, asked: Asked, asked_ns: Nanoseconds) -> Option<Replied> {
        if let Some(RequestTarget::Group(group)) = asked.target()
            && self.served.controller.backend().axes_of(RequestTarget::Group(group)).is_empty()
        {
            return None;
        }
        Some(match self.admit(&asked) {
            Ok(()) if self.is_overtaken(&asked, asked_ns) => match asked.is_of_stream() {
                true => Replied::Points(Err(StreamError::NotStreaming)),
                false => Replied::Command(Err(CommandError::Overtaken)),
            },
            Ok(()) => {
                let reply = self.carry_out(asked);
                // The controller may have taken its time.
                self.served.lease().prolong(self.claimant, now_ns());
                reply
            }
            Err(error) if asked.is_of_stream() => Replied::Points(Err(error.into())),
            Err(error) => Replied::Command(Err(error.into())),
        })
    }

    /// Whether this client may command.
    fn admit(&self, asked: &Asked) -> Result<(), LeaseError> {
        let mut lease = self.served.lease();
        match asked {
            Asked::Command(Command::Lease { is_taken_over: true }) => {
                lease.take_over(self.claimant, now_ns())
            }
            Asked::Command(Command::Release) => lease.release(self.claimant.connection),
            // To look is for everybody who may write, and a question only reads.
            Asked::Command(command) if command.only_reads() => {}
            _ => lease.renew(self.claimant, now_ns())?,
        }
        Ok(())
    }

    /// True if a stop has come since the client asked.
    fn is_overtaken(&self, asked: &Asked, asked_ns: Nanoseconds) -> bool {
        let target = asked.target().unwrap_or(RequestTarget::All);
        asked.is_discarded_by_stops() && self.served.stops.came_after(target, asked_ns)
    }

    fn carry_out(&self, asked: Asked) -> Replied {
        let controller = self.served.controller.backend();
        match asked {
            Asked::Command(command) => Replied::Command(controller.submit(command)),
            Asked::Point { target, at_ns, axes } => Replied::Points(controller.push(target, at_ns, &axes)),
            Asked::Chunk { target, from_ns, interval, points } => {
                Replied::Points(controller.push_chunk(target, from_ns, interval, &points))
            }
            Asked::Points { target, points } => {
                let axes = controller.axes_of(target).len();
                let kept = self.served.lease().keep_points(self.claimant, axes, points);
                Replied::Command(kept.map(|()| Reply::Done))
            }
            Asked::Trajectory { target, points, is_timed } => {
                let points = self.served.lease().take_points(self.claimant, points);
                let command = points.map(|points| match is_timed {
                    true => Command::Execute { target, points },
                    false => {
                        let waypoints = points.into_iter().map(|point| point.positions).collect();
                        Command::Through { target, waypoints }
                    }
                });
                let command = command.map_err(CommandError::from);
                Replied::Command(command.and_then(|command| controller.submit(command)))
            }
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.served.lease().leave(self.claimant.connection);
    }
}
