//! What a client is answered in a packet: errors as codes with their fields, which become the same words here as in the process of the
//! controller.

use std::time::Duration;

use takt_rt::{Phase, RejectReason, RequestError, RequestKind};

use super::commands::{put_motion, take_motion};
use crate::command::{
    CommandError, LeaseError, MotionId, PointRefusal, QuestionError, Refused, StreamError,
    TrajectoryProgress, needed,
};
use crate::packet::{Malformed, Put, Take};
use crate::telemetry::Machine;
use crate::trajectory::{BrokenLimit, PointQuantity, RateError, TrajectoryError};

/// A reply on its way.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The number of the demand.
    pub number: u64,
    /// The slot of the newest state that the process of the controller knew then: what the reply tells is in it.
    pub slot: u64,
    /// The reply.
    pub reply: Reply,
}

/// The answer to a demand.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// It is done, or has begun.
    Done,
    /// A motion has been asked for.
    Motion(MotionId),
    /// It has changed nothing.
    Refused(CommandError),
    /// Points were not taken.
    NotTaken(StreamError),
    /// How far a trajectory is; `None` if it is none under way.
    Progress(Option<TrajectoryProgress>),
    /// Why drives were not brought up again; `None` if they were, or are being brought up.
    BringUpFailure(Option<String>),
}

const DONE: u64 = 0;
const MOTION: u64 = 1;
const REFUSED: u64 = 2;
const NOT_TAKEN: u64 = 3;
const PROGRESS: u64 = 4;
const BRING_UP_FAILURE: u64 = 5;

impl Answer {
    /// Its words.
    pub fn words(&self) -> Vec<u64> {
        let mut put = Put::default();
        put.word(self.number).word(self.slot);
        match &self.reply {
            Reply::Done => {
                put.word(DONE);
            }
            Reply::Motion(motion) => put_motion(*motion, put.word(MOTION)),
            Reply::Refused(error) => put_command_error(error, put.word(REFUSED)),
            Reply::NotTaken(error) => put_stream_error(error, put.word(NOT_TAKEN)),
            Reply::Progress(progress) => {
                put.word(PROGRESS).word(progress.is_some().into());
                if let Some(TrajectoryProgress { path_s, of_s, rate }) = *progress {
                    put.number(path_s).number(of_s).number(rate);
                }
            }
            Reply::BringUpFailure(words) => {
                put.word(BRING_UP_FAILURE).word(words.is_some().into()).text(words.as_deref().unwrap_or(""));
            }
        }
        put.0
    }

    /// The answer of a packet.
    pub fn of(words: &[u64], machine: &Machine) -> Result<Self, Malformed> {
        let mut take = Take(words);
        let (number, slot) = (take.word()?, take.word()?);
        let reply = match take.word()? {
            DONE => Reply::Done,
            MOTION => Reply::Motion(take_motion(&mut take)?),
            REFUSED => Reply::Refused(take_command_error(&mut take, machine)?),
            NOT_TAKEN => Reply::NotTaken(take_stream_error(&mut take)?),
            PROGRESS => Reply::Progress(match take.word()? {
                0 => None,
                1 => Some(TrajectoryProgress {
                    path_s: take.number()?,
                    of_s: take.number()?,
                    rate: take.number()?,
                }),
                _ => return Err(Malformed),
            }),
            BRING_UP_FAILURE => {
                let (is_there, words) = (take.word()?, take.text()?);
                Reply::BringUpFailure((is_there != 0).then_some(words))
            }
            _ => return Err(Malformed),
        };
        take.end()?;
        Ok(Self { number, slot, reply })
    }
}

fn put_command_error(error: &CommandError, put: &mut Put) {
    match error {
        CommandError::Count { given, axes } => {
            put.word(1).index(*given).index(*axes);
        }
        CommandError::NoSuchAxis { axis, axes } => {
            put.word(2).index(*axis).index(*axes);
        }
        CommandError::NoSuchGroup { name, groups } => {
            put.word(3).text(name);
            put_texts(groups, put);
        }
        CommandError::OutsideLimits { axis, value, lowest, highest } => {
            put.word(4).text(axis).number(*value).number(*lowest).number(*highest);
        }
        CommandError::WrongMode { axis, needed } => {
            let number = needed::ALL.iter().position(|known| known == needed).unwrap_or(needed::ALL.len());
            put.word(5).text(axis).index(number);
        }
        CommandError::Full { waiting } => {
            put.word(6).index(*waiting);
        }
        CommandError::Trajectory(error) => put_trajectory_error(error, put.word(7)),
        CommandError::Rate(error) => put_rate_error(error, put.word(8)),
        CommandError::Budget { budget, longest } => {
            put.word(9).duration(*budget).duration(*longest);
        }
        CommandError::TooManyCallbacks => {
            put.word(10);
        }
        CommandError::SeveralGroups { groups } => put_texts(groups, put.word(11)),
        CommandError::NoTrajectory => {
            put.word(12);
        }
        CommandError::Refused(refused) => {
            put.word(13).word(refused.refusal.is_some().into());
            if let Some(RequestError { request, reason, axis, phase }) = refused.refusal {
                let (asked, allowed) = reason.numbers();
                put.word(request as u64).word(reason.number().into()).number(asked).number(allowed);
                put.word(axis.map_or(0, |axis| 1 + u64::from(axis))).word(phase as u64);
            }
        }
        CommandError::Unanswered => {
            put.word(14);
        }
        CommandError::Overtaken => {
            put.word(15);
        }
        CommandError::Lease(error) => put_lease_error(error, put.word(16)),
        CommandError::NoReply { after } => {
            put.word(17).duration(*after);
        }
        CommandError::Ended => {
            put.word(18);
        }
        CommandError::Question(error) => put_question_error(error, put.word(19)),
    }
}

fn take_command_error(take: &mut Take<'_>, machine: &Machine) -> Result<CommandError, Malformed> {
    Ok(match take.word()? {
        1 => CommandError::Count { given: take.index()?, axes: take.index()? },
        2 => CommandError::NoSuchAxis { axis: take.index()?, axes: take.index()? },
        3 => CommandError::NoSuchGroup { name: take.text()?, groups: take_texts(take)? },
        4 => CommandError::OutsideLimits {
            axis: take.text()?,
            value: take.number()?,
            lowest: take.number()?,
            highest: take.number()?,
        },
        5 => CommandError::WrongMode {
            axis: take.text()?,
            needed: needed::ALL.get(take.index()?).copied().unwrap_or("the mode for it"),
        },
        6 => CommandError::Full { waiting: take.index()? },
        7 => CommandError::Trajectory(take_trajectory_error(take)?),
        8 => CommandError::Rate(take_rate_error(take)?),
        9 => CommandError::Budget { budget: take.duration()?, longest: take.duration()? },
        10 => CommandError::TooManyCallbacks,
        11 => CommandError::SeveralGroups { groups: take_texts(take)? },
        12 => CommandError::NoTrajectory,
        13 => {
            let refusal = match take.word()? {
                0 => None,
                _ => Some(take_request_error(take)?),
            };
            Refused::new(refusal, machine).into()
        }
        14 => CommandError::Unanswered,
        15 => CommandError::Overtaken,
        16 => CommandError::Lease(take_lease_error(take)?),
        17 => CommandError::NoReply { after: take.duration()? },
        18 => CommandError::Ended,
        19 => CommandError::Question(take_question_error(take)?),
        _ => return Err(Malformed),
    })
}

fn put_question_error(error: &QuestionError, put: &mut Put) {
    match error {
        QuestionError::NoSuchBus { bus, buses } => put.word(1).index(*bus).index(*buses),
        QuestionError::NotReading { frame } => put.word(2).frame(frame),
        QuestionError::OwnDrive { frame, axis } => put.word(3).frame(frame).text(axis),
    };
}

fn take_question_error(take: &mut Take<'_>) -> Result<QuestionError, Malformed> {
    Ok(match take.word()? {
        1 => QuestionError::NoSuchBus { bus: take.index()?, buses: take.index()? },
        2 => QuestionError::NotReading { frame: take.frame()? },
        3 => QuestionError::OwnDrive { frame: take.frame()?, axis: take.text()? },
        _ => return Err(Malformed),
    })
}

fn take_request_error(take: &mut Take<'_>) -> Result<RequestError, Malformed> {
    let request = *RequestKind::ALL.get(take.index()?).ok_or(Malformed)?;
    let number = u8::try_from(take.word()?).map_err(|_| Malformed)?;
    let reason = RejectReason::from_numbers(number, take.number()?, take.number()?).ok_or(Malformed)?;
    let axis = take.word()?.checked_sub(1).map(u8::try_from).transpose().map_err(|_| Malformed)?;
    let phase = *Phase::ALL.get(take.index()?).ok_or(Malformed)?;
    Ok(RequestError { request, reason, axis, phase })
}

fn put_texts(texts: &[String], put: &mut Put) {
    put.index(texts.len());
    for text in texts {
        put.text(text);
    }
}

fn take_texts(take: &mut Take<'_>) -> Result<Vec<String>, Malformed> {
    let count = take.count_of(1)?;
    (0..count).map(|_| take.text()).collect()
}

fn put_lease_error(error: &LeaseError, put: &mut Put) {
    match error {
        LeaseError::Held { process, expires_in } => {
            put.word(1).word((*process).into()).duration(*expires_in);
        }
        LeaseError::TakenOver { process } => {
            put.word(2).word((*process).into());
        }
        LeaseError::ReadOnly => {
            put.word(3);
        }
        LeaseError::TooManyClients => {
            put.word(4);
        }
        LeaseError::Lost => {
            put.word(5);
        }
    }
}

fn take_lease_error(take: &mut Take<'_>) -> Result<LeaseError, Malformed> {
    let process = |word: u64| u32::try_from(word).map_err(|_| Malformed);
    Ok(match take.word()? {
        1 => LeaseError::Held { process: process(take.word()?)?, expires_in: take.duration()? },
        2 => LeaseError::TakenOver { process: process(take.word()?)? },
        3 => LeaseError::ReadOnly,
        4 => LeaseError::TooManyClients,
        5 => LeaseError::Lost,
        _ => return Err(Malformed),
    })
}

fn put_stream_error(error: &StreamError, put: &mut Put) {
    match error {
        StreamError::Count { given, axes } => {
            put.word(1).index(*given).index(*axes);
        }
        StreamError::Refused { point, axis, reason } => {
            put_point_refusal(reason, put.word(2).index(*point).index(*axis));
        }
        StreamError::Full => {
            put.word(3);
        }
        StreamError::Lease(error) => put_lease_error(error, put.word(4)),
        StreamError::NoReply { after } => {
            put.word(5).duration(*after);
        }
        StreamError::Ended => {
            put.word(6);
        }
        StreamError::NotStreaming => {
            put.word(7);
        }
    }
}

fn take_stream_error(take: &mut Take<'_>) -> Result<StreamError, Malformed> {
    Ok(match take.word()? {
        1 => StreamError::Count { given: take.index()?, axes: take.index()? },
        2 => StreamError::Refused {
            point: take.index()?,
            axis: take.index()?,
            reason: take_point_refusal(take)?,
        },
        3 => StreamError::Full,
        4 => StreamError::Lease(take_lease_error(take)?),
        5 => StreamError::NoReply { after: take.duration()? },
        6 => StreamError::Ended,
        7 => StreamError::NotStreaming,
        _ => return Err(Malformed),
    })
}

fn put_point_refusal(refusal: &PointRefusal, put: &mut Put) {
    match *refusal {
        PointRefusal::NotFinite { value } => put.word(1).axis_point(&value),
        PointRefusal::NoTorqueInMode { mode } => put.word(2).word(mode as u64),
        PointRefusal::NoFeedForward => put.word(3),
        PointRefusal::Torque { torque, limit } => put.word(4).number(torque).number(limit),
        PointRefusal::Stiffness { stiffness, limit } => put.word(5).number(stiffness).number(limit),
        PointRefusal::Damping { damping, limit } => put.word(6).number(damping).number(limit),
        PointRefusal::TooLarge { number, largest } => put.word(7).number(number).number(largest),
    };
}

fn take_point_refusal(take: &mut Take<'_>) -> Result<PointRefusal, Malformed> {
    Ok(match take.word()? {
        1 => PointRefusal::NotFinite { value: take.axis_point()? },
        2 => PointRefusal::NoTorqueInMode { mode: take.mode()? },
        3 => PointRefusal::NoFeedForward,
        4 => PointRefusal::Torque { torque: take.number()?, limit: take.number()? },
        5 => PointRefusal::Stiffness { stiffness: take.number()?, limit: take.number()? },
        6 => PointRefusal::Damping { damping: take.number()?, limit: take.number()? },
        7 => PointRefusal::TooLarge { number: take.number()?, largest: take.number()? },
        _ => return Err(Malformed),
    })
}

fn put_trajectory_error(error: &TrajectoryError, put: &mut Put) {
    match *error {
        TrajectoryError::NoPoint => put.word(1),
        TrajectoryError::Count { point, quantity, given, axes } => {
            put.word(2).index(point).word(quantity_number(quantity)).index(given).index(axes)
        }
        TrajectoryError::Missing { point, axis, quantity } => {
            put.word(3).index(point).index(axis).word(quantity_number(quantity))
        }
        TrajectoryError::NotFinite { point, axis, quantity, value } => {
            put.word(4).index(point).index(axis).word(quantity_number(quantity)).number(value)
        }
        TrajectoryError::Time { point, time_s } => put.word(5).index(point).number(time_s),
        TrajectoryError::TimeOrder { point, time_s, previous_s } => {
            put.word(6).index(point).number(time_s).number(previous_s)
        }
        TrajectoryError::Start { axis, quantity, given, present } => {
            put.word(7).index(axis).word(quantity_number(quantity)).number(given).number(present)
        }
        TrajectoryError::Limit { point, axis, broken, time_s, value, limit } => {
            put.word(8).index(point).index(axis).word(limit_number(broken));
            put.number(time_s).number(value).number(limit)
        }
        TrajectoryError::Unreachable { point, axis } => put.word(9).index(point).index(axis),
        TrajectoryError::EndAcceleration { axis, acceleration } => {
            put.word(10).index(axis).number(acceleration)
        }
        TrajectoryError::NoRoomToStop { axis, rest, limit } => {
            put.word(11).index(axis).number(rest).number(limit)
        }
        TrajectoryError::Excursion { point, axis, time_s, position, nearest, velocity } => {
            put.word(12).index(point).index(axis).number(time_s).number(position);
            put.number(nearest).number(velocity)
        }
    };
}

fn take_trajectory_error(take: &mut Take<'_>) -> Result<TrajectoryError, Malformed> {
    Ok(match take.word()? {
        1 => TrajectoryError::NoPoint,
        2 => TrajectoryError::Count {
            point: take.index()?,
            quantity: quantity(take.word()?)?,
            given: take.index()?,
            axes: take.index()?,
        },
        3 => TrajectoryError::Missing {
            point: take.index()?,
            axis: take.index()?,
            quantity: quantity(take.word()?)?,
        },
        4 => TrajectoryError::NotFinite {
            point: take.index()?,
            axis: take.index()?,
            quantity: quantity(take.word()?)?,
            value: take.number()?,
        },
        5 => TrajectoryError::Time { point: take.index()?, time_s: take.number()? },
        6 => TrajectoryError::TimeOrder {
            point: take.index()?,
            time_s: take.number()?,
            previous_s: take.number()?,
        },
        7 => TrajectoryError::Start {
            axis: take.index()?,
            quantity: quantity(take.word()?)?,
            given: take.number()?,
            present: take.number()?,
        },
        8 => TrajectoryError::Limit {
            point: take.index()?,
            axis: take.index()?,
            broken: broken_limit(take.word()?)?,
            time_s: take.number()?,
            value: take.number()?,
            limit: take.number()?,
        },
        9 => TrajectoryError::Unreachable { point: take.index()?, axis: take.index()? },
        10 => TrajectoryError::EndAcceleration { axis: take.index()?, acceleration: take.number()? },
        11 => {
            TrajectoryError::NoRoomToStop { axis: take.index()?, rest: take.number()?, limit: take.number()? }
        }
        12 => TrajectoryError::Excursion {
            point: take.index()?,
            axis: take.index()?,
            time_s: take.number()?,
            position: take.number()?,
            nearest: take.number()?,
            velocity: take.number()?,
        },
        _ => return Err(Malformed),
    })
}

fn put_rate_error(error: &RateError, put: &mut Put) {
    match *error {
        RateError::NotARate { rate } => put.word(1).number(rate),
        RateError::Over => put.word(2),
        RateError::Limit { rate, point, axis, broken } => {
            put.word(3).number(rate).index(point).index(axis).word(limit_number(broken))
        }
        RateError::NoRamp { rate } => put.word(4).number(rate),
    };
}

fn take_rate_error(take: &mut Take<'_>) -> Result<RateError, Malformed> {
    Ok(match take.word()? {
        1 => RateError::NotARate { rate: take.number()? },
        2 => RateError::Over,
        3 => RateError::Limit {
            rate: take.number()?,
            point: take.index()?,
            axis: take.index()?,
            broken: broken_limit(take.word()?)?,
        },
        4 => RateError::NoRamp { rate: take.number()? },
        _ => return Err(Malformed),
    })
}

const fn quantity_number(quantity: PointQuantity) -> u64 {
    match quantity {
        PointQuantity::Position => 0,
        PointQuantity::Velocity => 1,
        PointQuantity::Acceleration => 2,
    }
}

const fn quantity(number: u64) -> Result<PointQuantity, Malformed> {
    match number {
        0 => Ok(PointQuantity::Position),
        1 => Ok(PointQuantity::Velocity),
        2 => Ok(PointQuantity::Acceleration),
        _ => Err(Malformed),
    }
}

const fn limit_number(limit: BrokenLimit) -> u64 {
    match limit {
        BrokenLimit::Position => 0,
        BrokenLimit::Velocity => 1,
        BrokenLimit::Acceleration => 2,
        BrokenLimit::Deceleration => 3,
        BrokenLimit::Jerk => 4,
    }
}

const fn broken_limit(number: u64) -> Result<BrokenLimit, Malformed> {
    match number {
        0 => Ok(BrokenLimit::Position),
        1 => Ok(BrokenLimit::Velocity),
        2 => Ok(BrokenLimit::Acceleration),
        3 => Ok(BrokenLimit::Deceleration),
        4 => Ok(BrokenLimit::Jerk),
        _ => Err(Malformed),
    }
}

/// How a refusal of the lease fits each kind of error.
impl Reply {
    /// The command was refused for the lease.
    pub const fn lease(error: LeaseError) -> Self {
        Self::Refused(CommandError::Lease(error))
    }
}

/// A process that is there and does not answer is waited for so long: longer than any command takes, which is one that takes the place of
/// a trajectory under way.
pub const REPLY_WITHIN: Duration = Duration::from_secs(10);
