//! What a client asks in a packet.

use std::time::Duration;

use takt_rt::{AxisPoint, Frame, Nanoseconds, OperationMode, RequestId, RequestTarget, StopCategory};

use super::socket::PACKET_WORDS;
use crate::command::{MotionId, MoveOptions};
use crate::packet::{AXIS_POINT_WORDS, Malformed, Put, Take};
use crate::trajectory::TrajectoryPoint;

/// A packet of a client: a demand, by a number that its reply repeats.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// The number.
    pub number: u64,
    /// When the client made it, by `CLOCK_MONOTONIC`: a later stop discards it, if it has not been carried out by then.
    pub asked_ns: Nanoseconds,
    /// The demand.
    pub command: Command,
}

/// What a client that commands can ask.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// To command from now on; in place of another client only if `is_taken_over`.
    Lease {
        /// True if another client loses its lease.
        is_taken_over: bool,
    },
    /// To command no longer.
    Release,
    /// See [`RunningController::begin_move`](crate::RunningController::begin_move).
    Move {
        /// Whose axes.
        target: RequestTarget,
        /// How.
        options: MoveOptions,
        /// Where to.
        positions: Vec<f64>,
    },
    /// See [`RunningController::begin_move_by`](crate::RunningController::begin_move_by).
    MoveBy {
        /// Whose axes.
        target: RequestTarget,
        /// How.
        options: MoveOptions,
        /// How far.
        distances: Vec<f64>,
    },
    /// A velocity in profile velocity.
    Velocity {
        /// The axis.
        axis: usize,
        /// rad/s (m/s)
        velocity: f64,
        /// For how long.
        valid_for: Duration,
    },
    /// A torque in profile torque.
    Torque {
        /// The axis.
        axis: usize,
        /// N·m (N)
        torque: f64,
        /// For how long.
        valid_for: Duration,
    },
    /// Another mode of operation for all axes of a target.
    ChangeMode {
        /// Whose axes.
        target: RequestTarget,
        /// The mode.
        mode: OperationMode,
    },
    /// The same for one axis.
    ChangeAxisMode {
        /// The axis.
        axis: usize,
        /// The mode.
        mode: OperationMode,
    },
    /// To enable.
    Enable(RequestTarget),
    /// To disable.
    Disable(RequestTarget),
    /// To clear latched faults.
    ResetFaults(RequestTarget),
    /// To bring drives up again.
    BringUp(RequestTarget),
    /// To say why drives were not brought up again.
    BringUpFailure(RequestTarget),
    /// To follow points.
    BeginStream(RequestTarget),
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
    /// Points for [`Command::Execute`] or [`Command::Through`], behind those that came before.
    Points {
        /// Whose axes.
        target: RequestTarget,
        /// The points.
        points: Vec<TrajectoryPoint>,
    },
    /// To carry out the trajectory through the points that have come.
    Execute {
        /// Whose axes.
        target: RequestTarget,
        /// How many points have been sent.
        points: usize,
    },
    /// The same through waypoints: the positions of the points that have come.
    Through {
        /// Whose axes.
        target: RequestTarget,
        /// How many points have been sent.
        points: usize,
    },
    /// Another speed along a trajectory.
    SetSpeed {
        /// The trajectory.
        motion: MotionId,
        /// The speed.
        rate: f64,
    },
    /// To pause a trajectory.
    Pause(MotionId),
    /// To go on with it.
    Resume(MotionId),
    /// How far it is. It needs no lease.
    Progress(MotionId),
    /// To ask a device that is none of the configuration's.
    Question {
        /// The bus.
        bus: usize,
        /// The question.
        frame: Frame,
    },
}

const LEASE: u64 = 1;
const RELEASE: u64 = 2;
const MOVE: u64 = 3;
const VELOCITY: u64 = 4;
const TORQUE: u64 = 5;
const CHANGE_MODE: u64 = 6;
const CHANGE_AXIS_MODE: u64 = 7;
const ENABLE: u64 = 8;
const DISABLE: u64 = 9;
const RESET_FAULTS: u64 = 10;
const BEGIN_STREAM: u64 = 11;
const POINT: u64 = 12;
const CHUNK: u64 = 13;
const POINTS: u64 = 14;
const EXECUTE: u64 = 15;
const THROUGH: u64 = 16;
const SET_SPEED: u64 = 17;
const PAUSE: u64 = 18;
const RESUME: u64 = 19;
const MOVE_BY: u64 = 20;
const PROGRESS: u64 = 21;
const QUESTION: u64 = 22;
const BRING_UP: u64 = 23;
const BRING_UP_FAILURE: u64 = 24;

/// The words of a point of a trajectory beside its values: its time and three counts.
const POINT_HEAD: usize = 4;

/// The words of a point of a trajectory.
pub fn words_of_point(
    TrajectoryPoint { positions, velocities, accelerations, .. }: &TrajectoryPoint,
) -> usize {
    POINT_HEAD + positions.len() + velocities.len() + accelerations.len()
}
/// The words of a packet before what repeats in it, at most.
const HEAD: usize = 8;

/// The points of a trajectory, in as many packets as they need. A point for more axes than any controller has is in a packet of its own,
/// however long that is.
pub fn packets_of_points(target: RequestTarget, points: &[TrajectoryPoint]) -> Vec<Command> {
    let mut packets = vec![];
    let (mut now, mut room) = (vec![], PACKET_WORDS - HEAD);
    for point in points {
        let words = words_of_point(point);
        if words > room && !now.is_empty() {
            packets.push(Command::Points { target, points: std::mem::take(&mut now) });
            room = PACKET_WORDS - HEAD;
        }
        room = room.saturating_sub(words);
        now.push(point.clone());
    }
    if !now.is_empty() {
        packets.push(Command::Points { target, points: now });
    }
    packets
}

/// The points of a chunk that fit into one packet.
pub const fn chunk_points(axes: usize) -> usize {
    (PACKET_WORDS - HEAD) / (1 + if axes == 0 { 1 } else { axes * AXIS_POINT_WORDS })
}

impl Demand {
    /// Its words.
    pub fn words(&self) -> Vec<u64> {
        let mut put = Put::default();
        put.word(self.number).word(self.asked_ns);
        self.command.put(&mut put);
        put.0
    }

    /// The demand of a packet.
    pub fn of(words: &[u64]) -> Result<Self, Malformed> {
        let mut take = Take(words);
        let demand =
            Self { number: take.word()?, asked_ns: take.word()?, command: Command::take(&mut take)? };
        take.end()?;
        Ok(demand)
    }
}

impl Command {
    /// Whose axes are meant, where the client says so.
    pub const fn target(&self) -> Option<RequestTarget> {
        match self {
            Self::Lease { .. }
            | Self::Release
            | Self::Velocity { .. }
            | Self::Torque { .. }
            | Self::ChangeAxisMode { .. }
            | Self::Question { .. } => None,
            Self::SetSpeed { motion, .. }
            | Self::Pause(motion)
            | Self::Resume(motion)
            | Self::Progress(motion) => Some(motion.target),
            Self::Enable(target)
            | Self::Disable(target)
            | Self::ResetFaults(target)
            | Self::BringUp(target)
            | Self::BringUpFailure(target)
            | Self::BeginStream(target)
            | Self::Points { target, .. }
            | Self::Execute { target, .. }
            | Self::Through { target, .. }
            | Self::Move { target, .. }
            | Self::MoveBy { target, .. }
            | Self::ChangeMode { target, .. }
            | Self::Point { target, .. }
            | Self::Chunk { target, .. } => Some(*target),
        }
    }

    /// True for what begins or changes a motion.
    pub const fn is_discarded_by_stops(&self) -> bool {
        !matches!(
            self,
            Self::Lease { .. }
                | Self::Release
                | Self::Disable(_)
                | Self::Points { .. }
                | Self::Progress(_)
                | Self::BringUpFailure(_)
                | Self::Question { .. }
        )
    }

    fn put(&self, put: &mut Put) {
        match self {
            Self::Lease { is_taken_over } => {
                put.word(LEASE).word((*is_taken_over).into());
            }
            Self::Release => {
                put.word(RELEASE);
            }
            Self::Move { target, options, positions } => {
                put_options(*options, put.word(MOVE).target(*target)).numbers(positions);
            }
            Self::MoveBy { target, options, distances } => {
                put_options(*options, put.word(MOVE_BY).target(*target)).numbers(distances);
            }
            Self::Velocity { axis, velocity, valid_for } => {
                put.word(VELOCITY).index(*axis).number(*velocity).duration(*valid_for);
            }
            Self::Torque { axis, torque, valid_for } => {
                put.word(TORQUE).index(*axis).number(*torque).duration(*valid_for);
            }
            Self::ChangeMode { target, mode } => {
                put.word(CHANGE_MODE).target(*target).word(*mode as u64);
            }
            Self::ChangeAxisMode { axis, mode } => {
                put.word(CHANGE_AXIS_MODE).index(*axis).word(*mode as u64);
            }
            Self::Enable(target) => {
                put.word(ENABLE).target(*target);
            }
            Self::Disable(target) => {
                put.word(DISABLE).target(*target);
            }
            Self::ResetFaults(target) => {
                put.word(RESET_FAULTS).target(*target);
            }
            Self::BringUp(target) => {
                put.word(BRING_UP).target(*target);
            }
            Self::BringUpFailure(target) => {
                put.word(BRING_UP_FAILURE).target(*target);
            }
            Self::BeginStream(target) => {
                put.word(BEGIN_STREAM).target(*target);
            }
            Self::Point { target, at_ns, axes } => {
                put.word(POINT).target(*target).word(*at_ns);
                put_entries(axes, put);
            }
            Self::Chunk { target, from_ns, interval, points } => {
                put.word(CHUNK).target(*target).word(*from_ns).duration(*interval).index(points.len());
                points.iter().for_each(|axes| put_entries(axes, put));
            }
            Self::Points { target, points } => {
                put.word(POINTS).target(*target).index(points.len());
                for TrajectoryPoint { time_s, positions, velocities, accelerations } in points {
                    put.number(*time_s).numbers(positions).numbers(velocities).numbers(accelerations);
                }
            }
            Self::Execute { target, points } => {
                put.word(EXECUTE).target(*target).index(*points);
            }
            Self::Through { target, points } => {
                put.word(THROUGH).target(*target).index(*points);
            }
            Self::SetSpeed { motion, rate } => {
                put_motion(*motion, put.word(SET_SPEED));
                put.number(*rate);
            }
            Self::Pause(motion) => put_motion(*motion, put.word(PAUSE)),
            Self::Resume(motion) => put_motion(*motion, put.word(RESUME)),
            Self::Progress(motion) => put_motion(*motion, put.word(PROGRESS)),
            Self::Question { bus, frame } => {
                put.word(QUESTION).index(*bus).frame(frame);
            }
        }
    }

    fn take(take: &mut Take<'_>) -> Result<Self, Malformed> {
        Ok(match take.word()? {
            LEASE => Self::Lease {
                is_taken_over: match take.word()? {
                    0 => false,
                    1 => true,
                    _ => return Err(Malformed),
                },
            },
            RELEASE => Self::Release,
            MOVE => Self::Move {
                target: take.target()?,
                options: take_options(take)?,
                positions: take.numbers()?,
            },
            MOVE_BY => Self::MoveBy {
                target: take.target()?,
                options: take_options(take)?,
                distances: take.numbers()?,
            },
            VELOCITY => {
                Self::Velocity { axis: take.index()?, velocity: take.number()?, valid_for: take.duration()? }
            }
            TORQUE => {
                Self::Torque { axis: take.index()?, torque: take.number()?, valid_for: take.duration()? }
            }
            CHANGE_MODE => Self::ChangeMode { target: take.target()?, mode: take.mode()? },
            CHANGE_AXIS_MODE => Self::ChangeAxisMode { axis: take.index()?, mode: take.mode()? },
            ENABLE => Self::Enable(take.target()?),
            DISABLE => Self::Disable(take.target()?),
            RESET_FAULTS => Self::ResetFaults(take.target()?),
            BRING_UP => Self::BringUp(take.target()?),
            BRING_UP_FAILURE => Self::BringUpFailure(take.target()?),
            BEGIN_STREAM => Self::BeginStream(take.target()?),
            POINT => Self::Point { target: take.target()?, at_ns: take.word()?, axes: take_entries(take)? },
            CHUNK => {
                let (target, from_ns, interval) = (take.target()?, take.word()?, take.duration()?);
                let count = take.count_of(1)?;
                let points = (0..count).map(|_| take_entries(take)).collect::<Result<_, _>>()?;
                Self::Chunk { target, from_ns, interval, points }
            }
            POINTS => {
                let target = take.target()?;
                let count = take.count_of(POINT_HEAD)?;
                let point = |_| {
                    Ok(TrajectoryPoint {
                        time_s: take.number()?,
                        positions: take.numbers()?,
                        velocities: take.numbers()?,
                        accelerations: take.numbers()?,
                    })
                };
                Self::Points { target, points: (0..count).map(point).collect::<Result<_, _>>()? }
            }
            EXECUTE => Self::Execute { target: take.target()?, points: take.index()? },
            THROUGH => Self::Through { target: take.target()?, points: take.index()? },
            SET_SPEED => Self::SetSpeed { motion: take_motion(take)?, rate: take.number()? },
            PAUSE => Self::Pause(take_motion(take)?),
            RESUME => Self::Resume(take_motion(take)?),
            PROGRESS => Self::Progress(take_motion(take)?),
            QUESTION => Self::Question { bus: take.index()?, frame: take.frame()? },
            _ => return Err(Malformed),
        })
    }
}

fn put_options(options: MoveOptions, put: &mut Put) -> &mut Put {
    let MoveOptions { velocity_scale, acceleration_scale, minimum_duration_s } = options;
    put.number(velocity_scale).number(acceleration_scale).number(minimum_duration_s)
}

fn take_options(take: &mut Take<'_>) -> Result<MoveOptions, Malformed> {
    Ok(MoveOptions {
        velocity_scale: take.number()?,
        acceleration_scale: take.number()?,
        minimum_duration_s: take.number()?,
    })
}

fn put_entries(axes: &[AxisPoint], put: &mut Put) {
    put.index(axes.len());
    for axis in axes {
        put.axis_point(axis);
    }
}

fn take_entries(take: &mut Take<'_>) -> Result<Vec<AxisPoint>, Malformed> {
    let count = take.count_of(AXIS_POINT_WORDS)?;
    (0..count).map(|_| take.axis_point()).collect()
}

/// A motion.
pub fn put_motion(motion: MotionId, put: &mut Put) {
    put.word(motion.request.0).target(motion.target);
}

/// A motion. Whether there was such a one, the controller knows.
pub fn take_motion(take: &mut Take<'_>) -> Result<MotionId, Malformed> {
    Ok(MotionId { request: RequestId(take.word()?), target: take.target()? })
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
    /// The words of the packet.
    pub const fn words(self) -> [u64; 2] {
        let target = match self.target {
            RequestTarget::All => 0,
            RequestTarget::Group(group) => 1 + group as u64,
        };
        [target, self.category as u64]
    }

    /// The stop of a packet.
    pub fn of(words: &[u64]) -> Result<Self, Malformed> {
        let mut take = Take(words);
        let stop = Self { target: take.target()?, category: take.category()? };
        take.end()?;
        Ok(stop)
    }
}
