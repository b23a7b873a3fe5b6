//! What the host has given, in the words of the journal. What is read from a file is checked word by word.

use takt_rt::plan::State;
use takt_rt::{
    AxisPoint, AxisProcessData, AxisTarget, CallbackId, CallbackOutcome, CallbackReturn, CallbackRun,
    DriveState, ExecutionStart, Follow, Id, MAX_AXES, MappedObject, MappedPdo, ModeChange, Move,
    OffCycleReport, OperationMode, PointRole, ProfileMove, ProfileTarget, Request, RequestEnvelope,
    RequestId, RequestKind, StreamPoint, TrajectoryId, TransmissionType,
};

use crate::channels::{HostInput, JournalEntry};
use crate::packet::{Malformed, Put, Take};

const REQUEST: u64 = 0;
const OFF_CYCLE_REPORT: u64 = 1;
const POINT: u64 = 2;
const CALLBACK_TAKEN: u64 = 3;
const CALLED: u64 = 4;
const SERVICE_FRAME: u64 = 5;

/// An entry in words.
pub fn put_entry(entry: &JournalEntry, put: &mut Put) {
    put.word(entry.cycle);
    match &entry.input {
        HostInput::Request(envelope) => put_request(envelope, put.word(REQUEST)),
        HostInput::OffCycleReport { axis, report } => {
            let OffCycleReport { state, position, velocity, torque, error_code, temperature } = *report;
            put.word(OFF_CYCLE_REPORT).word((*axis).into()).word(state as u64).number(position);
            put.number(velocity).number(torque).word(error_code.into());
            put.word(temperature.is_some().into()).number(temperature.unwrap_or_default().into());
        }
        HostInput::Point { group, point } => {
            put.word(POINT).word((*group).into()).word(point.at_ns).word(match point.role {
                PointRole::Single => 0,
                PointRole::Chunk { is_first, is_last } => {
                    1 | u64::from(is_first) << 1 | u64::from(is_last) << 2
                }
            });
            let axes = used(&point.axes, |axis| *axis == AxisPoint::default());
            put.index(axes.len());
            for axis in axes {
                put.axis_point(axis);
            }
        }
        HostInput::CallbackTaken { is_there } => {
            put.word(CALLBACK_TAKEN).word((*is_there).into());
        }
        HostInput::Called { returned, targets } => {
            put.word(CALLED).word(returned.outcome as u64).word(returned.spent_ns);
            let targets = used(targets, Option::is_none);
            put.index(targets.len());
            targets.iter().for_each(|target| put_target(target.as_ref(), put));
        }
        HostInput::ServiceFrame { bus, frame } => {
            put.word(SERVICE_FRAME).word((*bus).into());
            put.frame(frame);
        }
    }
}

/// Stands for the torque limit of a drive that has not told it.
const UNLIMITED: u64 = u64::MAX;

/// An entry of words.
pub fn take_entry(take: &mut Take<'_>) -> Result<JournalEntry, Malformed> {
    let cycle = take.word()?;
    let input = match take.word()? {
        REQUEST => HostInput::Request(take_request(take)?),
        OFF_CYCLE_REPORT => HostInput::OffCycleReport {
            axis: byte(take)?,
            report: OffCycleReport {
                state: one_of(take, DriveState::ALL, |state| state as u64)?,
                position: take.number()?,
                velocity: take.number()?,
                torque: take.number()?,
                error_code: u16::try_from(take.word()?).map_err(|_| Malformed)?,
                temperature: {
                    let (is_known, celsius) = (flag(take)?, take.number()?);
                    is_known.then_some(celsius as f32)
                },
            },
        },
        POINT => {
            let (group, at_ns, role) = (byte(take)?, take.word()?, take.word()?);
            let role = match role {
                0 => PointRole::Single,
                1 | 3 | 5 | 7 => PointRole::Chunk { is_first: role & 2 != 0, is_last: role & 4 != 0 },
                _ => return Err(Malformed),
            };
            let mut point = StreamPoint { at_ns, role, ..StreamPoint::default() };
            for axis in room(take, &mut point.axes)? {
                *axis = take.axis_point()?;
            }
            HostInput::Point { group, point }
        }
        CALLBACK_TAKEN => HostInput::CallbackTaken { is_there: flag(take)? },
        CALLED => {
            let outcomes = [
                CallbackOutcome::Missing,
                CallbackOutcome::Commanded,
                CallbackOutcome::Finished,
                CallbackOutcome::Panicked,
            ];
            let outcome = one_of(take, outcomes, |outcome| outcome as u64)?;
            let returned = CallbackReturn { outcome, spent_ns: take.word()? };
            let mut targets = [None; MAX_AXES];
            for target in room(take, &mut targets)? {
                *target = take_target(take)?;
            }
            HostInput::Called { returned, targets }
        }
        SERVICE_FRAME => HostInput::ServiceFrame { bus: byte(take)?, frame: take.frame()? },
        _ => return Err(Malformed),
    };
    Ok(JournalEntry { cycle, input })
}

fn put_request(envelope: &RequestEnvelope, put: &mut Put) {
    put.word(envelope.id.0).target(envelope.target).word(envelope.request.kind() as u64);
    match &envelope.request {
        Request::Sync(is_on) => {
            put.word((*is_on).into());
        }
        Request::TimeOfDay { at_zero_ns } => {
            put.word(*at_zero_ns);
        }
        Request::RatedTorque { axis, torque, limit_per_mille } => {
            put.word((*axis).into()).number(*torque).word(limit_per_mille.map_or(UNLIMITED, u64::from));
        }
        Request::ProcessData(data) => put_process_data(data, put),
        Request::Position { axis, counts } => {
            put.word((*axis).into()).word(signed(*counts));
        }
        Request::Move(motion) => {
            put.numbers(used(&motion.target, |number| number.to_bits() == 0));
            put.numbers(used(&motion.target_velocity, |number| number.to_bits() == 0));
            put.number(motion.velocity_scale)
                .number(motion.acceleration_scale)
                .number(motion.minimum_duration_s);
        }
        Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns }) => {
            let (kind, value) = match *target {
                ProfileTarget::Position(position) => (0, position),
                ProfileTarget::Velocity(velocity) => (1, velocity),
                ProfileTarget::Torque(torque) => (2, torque),
            };
            put.word((*axis).into()).word(kind).number(value).word(*valid_until_ns);
        }
        Request::ChangeMode(ModeChange { modes }) => {
            let modes = used(modes, Option::is_none);
            put.index(modes.len());
            for mode in modes {
                put.word(mode.map_or(0, |mode| mode as u64));
            }
        }
        Request::Execute { trajectory, start } => {
            put.word(trajectory.0);
            match *start {
                ExecutionStart::Now => {
                    put.word(0);
                }
                ExecutionStart::After { trajectory, cycles, is_same_motion } => {
                    put.word(1 | u64::from(is_same_motion) << 1).word(trajectory.0).word(cycles);
                }
            }
        }
        Request::RunCallback(CallbackRun { callback, budget_ns, overruns_allowed, follow }) => {
            put.word(callback.0).word(*budget_ns).word((*overruns_allowed).into()).word(match follow {
                None => 0,
                Some(Follow::Smooth) => 1,
                Some(Follow::Exact) => 2,
            });
        }
        Request::Stop(category) => {
            put.word(*category as u64);
        }
        Request::Activate
        | Request::BringUp
        | Request::ConfirmBringUp
        | Request::Enable
        | Request::Stream
        | Request::Disable
        | Request::ResetFaults
        | Request::InhibitEnable
        | Request::Shutdown => {}
    }
}

fn take_request(take: &mut Take<'_>) -> Result<RequestEnvelope, Malformed> {
    let (id, target) = (RequestId(take.word()?), take.target()?);
    let request = match one_of(take, RequestKind::ALL, |kind| kind as u64)? {
        RequestKind::Sync => Request::Sync(flag(take)?),
        RequestKind::TimeOfDay => Request::TimeOfDay { at_zero_ns: take.word()? },
        RequestKind::RatedTorque => Request::RatedTorque {
            axis: byte(take)?,
            torque: take.number()?,
            limit_per_mille: match take.word()? {
                UNLIMITED => None,
                limit => Some(u16::try_from(limit).map_err(|_| Malformed)?),
            },
        },
        RequestKind::ProcessData => Request::ProcessData(take_process_data(take)?),
        RequestKind::Position => Request::Position { axis: byte(take)?, counts: take.word()? as u32 as i32 },
        RequestKind::Activate => Request::Activate,
        RequestKind::BringUp => Request::BringUp,
        RequestKind::ConfirmBringUp => Request::ConfirmBringUp,
        RequestKind::Enable => Request::Enable,
        RequestKind::Move => Request::Move(Move {
            target: axes_of(take)?,
            target_velocity: axes_of(take)?,
            velocity_scale: take.number()?,
            acceleration_scale: take.number()?,
            minimum_duration_s: take.number()?,
        }),
        RequestKind::SetProfileTarget => {
            let (axis, kind, value) = (byte(take)?, take.word()?, take.number()?);
            let target = match kind {
                0 => ProfileTarget::Position(value),
                1 => ProfileTarget::Velocity(value),
                2 => ProfileTarget::Torque(value),
                _ => return Err(Malformed),
            };
            Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns: take.word()? })
        }
        RequestKind::ChangeMode => {
            let mut modes = [None; MAX_AXES];
            for mode in room(take, &mut modes)? {
                let number = i8::try_from(take.word()?).map_err(|_| Malformed)?;
                *mode = OperationMode::from_number(number);
            }
            Request::ChangeMode(ModeChange { modes })
        }
        RequestKind::Stream => Request::Stream,
        RequestKind::Execute => {
            let trajectory = TrajectoryId(take.word()?);
            let start = match take.word()? {
                0 => ExecutionStart::Now,
                kind @ (1 | 3) => ExecutionStart::After {
                    trajectory: TrajectoryId(take.word()?),
                    cycles: take.word()?,
                    is_same_motion: kind == 3,
                },
                _ => return Err(Malformed),
            };
            Request::Execute { trajectory, start }
        }
        RequestKind::RunCallback => Request::RunCallback(CallbackRun {
            callback: CallbackId(take.word()?),
            budget_ns: take.word()?,
            overruns_allowed: u32::try_from(take.word()?).map_err(|_| Malformed)?,
            follow: match take.word()? {
                0 => None,
                1 => Some(Follow::Smooth),
                2 => Some(Follow::Exact),
                _ => return Err(Malformed),
            },
        }),
        RequestKind::Stop => Request::Stop(take.category()?),
        RequestKind::Disable => Request::Disable,
        RequestKind::ResetFaults => Request::ResetFaults,
        RequestKind::InhibitEnable => Request::InhibitEnable,
        RequestKind::Shutdown => Request::Shutdown,
    };
    Ok(RequestEnvelope { id, target, request })
}

fn put_process_data(data: &AxisProcessData, put: &mut Put) {
    put.word(data.axis.into());
    for pdo in data.commands.iter().chain(&data.feedback) {
        let Some(MappedPdo { id, transmission, objects }) = pdo else {
            put.word(0);
            continue;
        };
        put.word(1 | u64::from(*transmission == TransmissionType::OnControlword) << 1);
        put_id(*id, put);
        for object in objects {
            put.word(object.map_or(0, |MappedObject { index, subindex, bits }| {
                1 | u64::from(index) << 8 | u64::from(subindex) << 24 | u64::from(bits) << 32
            }));
        }
    }
    for id in data.unused {
        match id {
            None => {
                put.word(0);
            }
            Some(id) => put_id(id, put.word(1)),
        }
    }
}

fn take_process_data(take: &mut Take<'_>) -> Result<AxisProcessData, Malformed> {
    let axis = byte(take)?;
    let mut data = AxisProcessData {
        axis,
        commands: Default::default(),
        feedback: Default::default(),
        unused: Default::default(),
    };
    for pdo in data.commands.iter_mut().chain(&mut data.feedback) {
        let transmission = match take.word()? {
            0 => continue,
            1 => TransmissionType::EveryCycle,
            3 => TransmissionType::OnControlword,
            _ => return Err(Malformed),
        };
        let mut mapped = MappedPdo { id: take_id(take)?, transmission, objects: Default::default() };
        for object in &mut mapped.objects {
            let word = take.word()?;
            *object = (word & 1 == 1).then_some(MappedObject {
                index: (word >> 8) as u16,
                subindex: (word >> 24) as u8,
                bits: (word >> 32) as u8,
            });
        }
        *pdo = Some(mapped);
    }
    for id in &mut data.unused {
        if flag(take)? {
            *id = Some(take_id(take)?);
        }
    }
    Ok(data)
}

fn put_id(id: Id, put: &mut Put) {
    put.word(u64::from(id.value()) << 1 | u64::from(id.is_extended()));
}

fn take_id(take: &mut Take<'_>) -> Result<Id, Malformed> {
    let word = take.word()?;
    let number = u32::try_from(word >> 1).map_err(|_| Malformed)?;
    if word & 1 == 0 { Id::base(number) } else { Id::extended(number) }.map_err(|_| Malformed)
}

fn put_target(target: Option<&AxisTarget>, put: &mut Put) {
    match target {
        None => {
            put.word(0);
        }
        Some(AxisTarget::Position { state, torque }) => {
            put_state(state, put.word(1));
            put.number(*torque);
        }
        Some(AxisTarget::Impedance { state, stiffness, damping, torque }) => {
            put_state(state, put.word(2));
            put.number(*stiffness).number(*damping).number(*torque);
        }
        Some(AxisTarget::Velocity { velocity, acceleration }) => {
            put.word(3).number(*velocity).number(*acceleration);
        }
        Some(AxisTarget::Torque(torque)) => {
            put.word(4).number(*torque);
        }
    }
}

fn take_target(take: &mut Take<'_>) -> Result<Option<AxisTarget>, Malformed> {
    Ok(match take.word()? {
        0 => None,
        1 => Some(AxisTarget::Position { state: take_state(take)?, torque: take.number()? }),
        2 => Some(AxisTarget::Impedance {
            state: take_state(take)?,
            stiffness: take.number()?,
            damping: take.number()?,
            torque: take.number()?,
        }),
        3 => Some(AxisTarget::Velocity { velocity: take.number()?, acceleration: take.number()? }),
        4 => Some(AxisTarget::Torque(take.number()?)),
        _ => return Err(Malformed),
    })
}

fn put_state(state: &State, put: &mut Put) {
    put.number(state.position).number(state.velocity).number(state.acceleration);
}

fn take_state(take: &mut Take<'_>) -> Result<State, Malformed> {
    Ok(State { position: take.number()?, velocity: take.number()?, acceleration: take.number()? })
}

/// The entries up to the last one that says something.
fn used<T>(all: &[T], says_nothing: impl Fn(&T) -> bool) -> &[T] {
    let end = all.iter().rposition(|entry| !says_nothing(entry)).map_or(0, |last| last + 1);
    all.get(..end).unwrap_or(all)
}

/// Room for as many entries as the next word says.
fn room<'a, T>(take: &mut Take<'_>, all: &'a mut [T]) -> Result<&'a mut [T], Malformed> {
    all.get_mut(..take.index()?).ok_or(Malformed)
}

/// Numbers of axes behind their count; 0 for those that are not there.
fn axes_of(take: &mut Take<'_>) -> Result<[f64; MAX_AXES], Malformed> {
    let mut all = [0.0; MAX_AXES];
    for number in room(take, &mut all)? {
        *number = take.number()?;
    }
    Ok(all)
}

fn byte(take: &mut Take<'_>) -> Result<u8, Malformed> {
    u8::try_from(take.word()?).map_err(|_| Malformed)
}

fn flag(take: &mut Take<'_>) -> Result<bool, Malformed> {
    match take.word()? {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(Malformed),
    }
}

fn signed(number: i32) -> u64 {
    u64::from(number as u32)
}

/// The value whose number the next word is.
fn one_of<T: Copy, const N: usize>(
    take: &mut Take<'_>,
    all: [T; N],
    number: impl Fn(T) -> u64,
) -> Result<T, Malformed> {
    let word = take.word()?;
    all.into_iter().find(|value| number(*value) == word).ok_or(Malformed)
}
