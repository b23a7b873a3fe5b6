//! What a client asks in a packet.

use std::time::Duration;

use bitcode::{Decode, Encode};
use takt::command::Command;
use takt::trajectory::TrajectoryPoint;
use takt_rt::{AxisPoint, Nanoseconds, RequestTarget, StopCategory};

use crate::socket::PACKET_BYTES;

/// A packet of a client: a demand, by a number that its reply repeats.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct Demand {
    /// The number.
    pub number: u64,
    /// When the client made it, by `CLOCK_MONOTONIC`: a later stop discards it, if it has not been carried out by then.
    pub asked_ns: Nanoseconds,
    /// What is asked.
    pub asked: Asked,
}

/// What a client that commands can ask.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Asked {
    /// What any controller can be asked.
    Command(Command),
    /// A point of a stream.
    Point {
        /// Whose axes.
        target: RequestTarget,
        /// When.
        at_ns: Nanoseconds,
        /// An entry for each axis.
        axes: Vec<AxisPoint>,
    },
    /// A chunk of a stream.
    Chunk {
        /// Whose axes.
        target: RequestTarget,
        /// From when on.
        from_ns: Nanoseconds,
        /// From one point to the next.
        interval: Duration,
        /// An entry for each axis, of each point.
        points: Vec<Vec<AxisPoint>>,
    },
    /// Points for [`Asked::Trajectory`], behind those that came before: one packet has no room for all of them.
    Points {
        /// Whose axes.
        target: RequestTarget,
        /// The points.
        points: Vec<TrajectoryPoint>,
    },
    /// To carry out [`Command::Execute`] with the points that have come, or [`Command::Through`] with their positions.
    Trajectory {
        /// Whose axes.
        target: RequestTarget,
        /// How many points have been sent.
        points: usize,
        /// True if their times count.
        is_timed: bool,
    },
}

impl From<Command> for Asked {
    fn from(command: Command) -> Self {
        Self::Command(command)
    }
}

/// The bytes of a packet beside what repeats in it, at most.
const HEAD: usize = 256;
/// The bytes of an axis of a point of a stream, at most.
const AXIS_POINT: usize = 56;

/// The bytes of a point of a trajectory, at most.
pub const fn bytes_of_point(point: &TrajectoryPoint) -> usize {
    let TrajectoryPoint { positions, velocities, accelerations, .. } = point;
    size_of::<f64>() * (4 + positions.len() + velocities.len() + accelerations.len())
}

/// The points of a trajectory, in as many packets as they need. A point for more axes than any controller has is in a packet of its own,
/// however long that is.
pub fn packets_of_points(target: RequestTarget, points: &[TrajectoryPoint]) -> Vec<Asked> {
    let mut packets = vec![];
    let (mut now, mut room) = (vec![], PACKET_BYTES - HEAD);
    for point in points {
        let bytes = bytes_of_point(point);
        if bytes > room && !now.is_empty() {
            packets.push(Asked::Points { target, points: std::mem::take(&mut now) });
            room = PACKET_BYTES - HEAD;
        }
        room = room.saturating_sub(bytes);
        now.push(point.clone());
    }
    if !now.is_empty() {
        packets.push(Asked::Points { target, points: now });
    }
    packets
}

/// The points of a chunk that fit into one packet.
pub const fn chunk_points(axes: usize) -> usize {
    (PACKET_BYTES - HEAD) / (size_of::<usize>() + if axes == 0 { 1 } else { axes * AXIS_POINT })
}

impl Demand {
    /// Its packet.
    pub fn packet(&self) -> Vec<u8> {
        bitcode::encode(self)
    }

    /// The demand of a packet; `None` if no client of takt has sent it. What its numbers mean, the controller checks.
    pub fn of(packet: &[u8]) -> Option<Self> {
        let demand: Self = bitcode::decode(packet).ok()?;
        match &demand.asked {
            Asked::Command(Command::Question { frame, .. }) if !frame.is_valid() => None,
            _ => Some(demand),
        }
    }
}

impl Asked {
    /// Whose axes are meant, where the client says so.
    pub const fn target(&self) -> Option<RequestTarget> {
        match self {
            Self::Command(command) => command.target(),
            Self::Point { target, .. }
            | Self::Chunk { target, .. }
            | Self::Points { target, .. }
            | Self::Trajectory { target, .. } => Some(*target),
        }
    }

    /// True for points of a stream.
    pub const fn is_of_stream(&self) -> bool {
        matches!(self, Self::Point { .. } | Self::Chunk { .. })
    }

    /// True for what begins or changes a motion.
    pub const fn is_discarded_by_stops(&self) -> bool {
        match self {
            Self::Command(command) => command.is_discarded_by_stops(),
            Self::Point { .. } | Self::Chunk { .. } | Self::Trajectory { .. } => true,
            Self::Points { .. } => false,
        }
    }
}

/// A stop: any process that may write asks for it, by a socket of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StopRequest {
    /// Whose axes.
    pub target: RequestTarget,
    /// How.
    pub category: StopCategory,
}

impl StopRequest {
    /// Its packet, which needs no allocation.
    pub const fn packet(self) -> [u8; 2] {
        let target = match self.target {
            RequestTarget::All => 0,
            RequestTarget::Group(group) => group.saturating_add(1),
        };
        [target, self.category as u8]
    }

    /// The stop of a packet; `None` if no client of takt has sent it.
    pub fn of(packet: &[u8]) -> Option<Self> {
        let [target, category] = *packet else { return None };
        let target = target.checked_sub(1).map_or(RequestTarget::All, RequestTarget::Group);
        let all = [StopCategory::Zero, StopCategory::One, StopCategory::Two];
        let category = all.into_iter().find(|known| *known as u8 == category)?;
        Some(Self { target, category })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::PositionPoint;

    /// A number of which every byte counts.
    fn number(of: usize) -> f64 {
        std::f64::consts::PI * (1.0 + of as f64).powi(9)
    }

    fn bytes(asked: Asked) -> usize {
        Demand { number: u64::MAX, asked_ns: u64::MAX, asked }.packet().len()
    }

    #[test]
    fn as_many_points_as_are_put_into_a_packet_fit() {
        let target = RequestTarget::Group(7);
        for axes in [0, 1, 6, 32, 254, 255, 300] {
            let point = |of| TrajectoryPoint {
                time_s: number(of),
                positions: (0..axes).map(number).collect(),
                velocities: (1..=axes).map(number).collect(),
                accelerations: (2..axes + 2).map(number).collect(),
            };
            let packets = packets_of_points(target, &(0..3000).map(point).collect::<Vec<_>>());
            assert!(packets.into_iter().all(|packet| bytes(packet) <= PACKET_BYTES), "{axes} axes");
            let motion = |of| PositionPoint {
                position: number(of),
                velocity: Some(number(of + 1)),
                acceleration: Some(number(of + 2)),
            };
            let entry = |of| match of % 4 {
                0 => AxisPoint::Velocity(number(of)),
                _ => AxisPoint::Impedance {
                    motion: motion(of),
                    stiffness: number(of + 3),
                    damping: number(of + 4),
                    torque: number(of + 5),
                },
            };
            let points = vec![(0..axes).map(entry).collect(); chunk_points(axes)];
            let interval = Duration::MAX;
            let chunk = Asked::Chunk { target, from_ns: u64::MAX, interval, points };
            assert!(bytes(chunk) <= PACKET_BYTES, "{axes} axes");
        }
    }

    #[test]
    fn a_question_that_is_no_frame_is_no_demand() {
        let frame = takt_rt::Frame::fd(takt_rt::Id::base(0x601).unwrap(), &[7; 12], false).unwrap();
        let asked = Command::Question { bus: 0, frame }.into();
        let packet = Demand { number: 1, asked_ns: 2, asked }.packet();
        assert!(Demand::of(&packet).is_some());
        let length = packet.iter().rposition(|byte| *byte == 12).unwrap();
        for wrong in [11, 13, 65, 255] {
            let mut packet = packet.clone();
            packet[length] = wrong;
            assert_eq!(Demand::of(&packet), None, "a frame of {wrong} bytes");
        }
    }

    #[test]
    fn a_stop_comes_out_of_its_packet_as_it_went_in_and_nothing_else_is_one() {
        for target in [RequestTarget::All, RequestTarget::Group(0), RequestTarget::Group(7)] {
            for category in [StopCategory::Zero, StopCategory::One, StopCategory::Two] {
                let stop = StopRequest { target, category };
                assert_eq!(StopRequest::of(&stop.packet()), Some(stop));
            }
        }
        for packet in [&[][..], &[0], &[0, 3], &[0, 1, 0]] {
            assert_eq!(StopRequest::of(packet), None);
        }
    }
}
