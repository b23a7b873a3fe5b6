//! The journal as bytes: blocks, each of which is a journal by itself, encoded by `bitcode`.

use std::collections::VecDeque;

use bitcode::{Decode, Encode};
use takt_rt::{MAX_BUSES, Nanoseconds, Received, Request, TrajectoryId};

use super::clock::ClockAnswer;
use super::port::{PortEntry, PortState};
use crate::channels::{GivenTrajectory, HostInput, JournalEntry};
use crate::link::trace::Traced;
use crate::trajectory::Trajectory;

/// The state of a run between two cycles, so that its journal need not begin with the first one.
#[derive(Clone, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub struct Checkpoint {
    /// The slot that comes next.
    pub next_slot: u64,
    /// The cycle that comes next, counted from 0.
    pub next_cycle: u64,
    /// The last time that the clock has told.
    pub now_ns: Nanoseconds,
    /// What the ports have shown, in the order of the buses.
    pub ports: Vec<PortState>,
    /// The engine: [`takt_rt::Engine::checkpoint`].
    pub engine: Vec<u8>,
    /// The stream of each group: [`takt_rt::LookAhead::checkpoint`].
    pub streams: Vec<Vec<u8>>,
    /// The [`checksum`](Self::checksum) of both when they were written.
    pub crc32: u32,
}

impl Checkpoint {
    /// The CRC-32 of the engine and of the streams. Damaged bytes may decode to a state that no engine has.
    pub fn checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        self.streams.iter().chain([&self.engine]).for_each(|bytes| hasher.update(bytes));
        hasher.finalize()
    }
}

/// A trajectory that the real-time thread has been given.
#[derive(Debug, PartialEq, Encode, Decode)]
pub struct JournaledTrajectory {
    /// Its number.
    pub id: TrajectoryId,
    /// The group that it was for.
    pub group: u8,
    /// The axes of the group, by their numbers in the controller.
    pub axes: Vec<usize>,
    /// The trajectory.
    pub trajectory: Trajectory,
}

/// A journal, or a part of one.
#[derive(Debug, Default, PartialEq, Encode, Decode)]
pub struct Journal {
    /// Where it begins; `None`: with the first cycle.
    pub checkpoint: Option<Checkpoint>,
    /// The start of slot 0; `None` if the run has not got so far.
    pub epoch_ns: Option<Nanoseconds>,
    /// The clock.
    pub clock: VecDeque<ClockAnswer>,
    /// The ports, in the order of the buses.
    pub ports: Vec<Vec<PortEntry>>,
    /// The host.
    pub host: VecDeque<JournalEntry>,
    /// The trajectories, in the order in which they were given.
    pub trajectories: Vec<JournaledTrajectory>,
}

/// Why bytes are no block of a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BlockDefect {
    /// They cannot be decoded.
    #[error("it cannot be decoded")]
    Undecodable,
    /// A time after 292 years, or a wake-up before the machine was started.
    #[error("it has a time that no machine has")]
    Time,
    /// More buses than a controller has.
    #[error("it has {buses} buses (allowed: {MAX_BUSES})")]
    Buses {
        /// How many.
        buses: usize,
    },
    /// A frame or an identifier that no bus carries.
    #[error("it has a frame that no bus carries")]
    Frame,
    /// A trajectory without a polynomial for each axis at each time.
    #[error("it has a trajectory with a part missing")]
    Trajectory,
    /// The state of the engine or of a stream is not what was written.
    #[error("the checksum of the engine's state is wrong")]
    Checksum,
}

/// The latest time of a journal: no machine has run for 292 years. The cycle adds its phases to the times that its clock tells.
const LATEST_NS: Nanoseconds = i64::MAX as Nanoseconds;

impl Journal {
    /// Adds an answer of the clock.
    pub fn add_clock(&mut self, answer: ClockAnswer) {
        match answer {
            ClockAnswer::Epoch(at_ns) => self.epoch_ns = Some(at_ns),
            answer => self.clock.push_back(answer),
        }
    }

    /// Adds what has passed a port. What was sent, the replay sends itself.
    pub fn add_port(&mut self, bus: usize, traced: &Traced) {
        let entry = match traced {
            Traced::Frame(frame) if frame.is_sent => return,
            Traced::Frame(frame) => {
                PortEntry::Received(Received { frame: frame.frame, at_ns: frame.at_ns }.into())
            }
            Traced::Mark(mark) => PortEntry::Mark(*mark),
        };
        self.port(bus).push(entry);
    }

    /// Adds a trajectory that the real-time thread has been given.
    pub fn add_trajectory(&mut self, id: TrajectoryId, group: u8, given: &GivenTrajectory) {
        let (axes, trajectory) = (given.axes().places().to_vec(), given.trajectory().clone());
        self.trajectories.push(JournaledTrajectory { id, group, axes, trajectory });
    }

    /// Takes everything as a block; `None` if there is nothing.
    pub fn take_block(&mut self) -> Option<Vec<u8>> {
        let is_empty = *self == Self::default();
        (!is_empty).then(|| bitcode::encode(&std::mem::take(self)))
    }

    /// Adds a block.
    ///
    /// # Errors
    /// The block is damaged. Nothing of it has been added.
    pub fn add_block(&mut self, block: &[u8]) -> Result<(), BlockDefect> {
        let block: Self = bitcode::decode(block).map_err(|_| BlockDefect::Undecodable)?;
        block.check()?;
        self.checkpoint = block.checkpoint.or(self.checkpoint.take());
        self.epoch_ns = block.epoch_ns.or(self.epoch_ns);
        self.clock.extend(block.clock);
        block.ports.into_iter().enumerate().for_each(|(bus, entries)| self.port(bus).extend(entries));
        self.host.extend(block.host);
        self.trajectories.extend(block.trajectories);
        Ok(())
    }

    fn port(&mut self, bus: usize) -> &mut Vec<PortEntry> {
        if self.ports.len() <= bus {
            self.ports.resize_with(bus + 1, Vec::new);
        }
        &mut self.ports[bus]
    }

    /// Checks what the types do not express.
    fn check(&self) -> Result<(), BlockDefect> {
        let ok_or = |is_ok: bool, defect| if is_ok { Ok(()) } else { Err(defect) };
        ok_or(self.ports.len() <= MAX_BUSES, BlockDefect::Buses { buses: self.ports.len() })?;
        ok_or(self.has_possible_times(), BlockDefect::Time)?;
        let received = self.ports.iter().flatten().all(PortEntry::is_valid);
        ok_or(received && self.host.iter().all(|entry| is_valid(&entry.input)), BlockDefect::Frame)?;
        ok_or(self.trajectories.iter().all(|given| given.trajectory.is_whole()), BlockDefect::Trajectory)?;
        let mut states = self.checkpoint.iter();
        ok_or(states.all(|state| state.crc32 == state.checksum()), BlockDefect::Checksum)
    }

    fn has_possible_times(&self) -> bool {
        let is_possible = |at_ns: Nanoseconds| at_ns <= LATEST_NS;
        let answers = self.clock.iter().all(|answer| match answer {
            ClockAnswer::Epoch(at_ns) | ClockAnswer::Now(at_ns) => is_possible(*at_ns),
            ClockAnswer::Woke(wake) | ClockAnswer::WokeToSend(wake) => {
                is_possible(wake.now_ns) && wake.timer_latency_ns <= wake.now_ns
            }
            ClockAnswer::CycleEnd => true,
        });
        let ports = self.ports.iter().flatten().all(|entry| is_possible(entry.at_ns()));
        let checkpoint = self.checkpoint.as_ref().is_none_or(|checkpoint| {
            is_possible(checkpoint.now_ns) && checkpoint.ports.iter().all(|port| is_possible(port.now_ns))
        });
        answers && ports && checkpoint && self.epoch_ns.is_none_or(is_possible)
    }
}

/// Returns `true` if all frames and identifiers of an input are such as a bus carries.
fn is_valid(input: &HostInput) -> bool {
    match input {
        HostInput::ServiceFrame { frame, .. } => frame.is_valid(),
        HostInput::Request(envelope) => match &envelope.request {
            Request::ProcessData(data) => {
                let mapped = data.commands.iter().chain(&data.feedback).flatten().map(|pdo| pdo.id);
                mapped.chain(data.unused.into_iter().flatten()).all(|id| id.is_valid())
            }
            _ => true,
        },
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::trace::{PortAnswer, PortMark, TracedFrame};
    use proptest::prelude::*;
    use takt_rt::plan::State;
    use takt_rt::{
        AxisLimits, AxisPoint, AxisTarget, BusState, CallbackOutcome, CallbackReturn, DriveState, Frame, Id,
        MAX_AXES, Move, OffCycleReport, PointRole, RequestEnvelope, RequestId, RequestTarget, StopCategory,
        StreamPoint, Wake,
    };

    fn entries() -> Vec<JournalEntry> {
        let mut target = [0.0; MAX_AXES];
        target[..2].copy_from_slice(&[0.5, -0.0]);
        let motion = Move {
            target,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: 0.5,
            acceleration_scale: 1.0,
            minimum_duration_s: 0.0,
        };
        let request = |id, request| {
            HostInput::Request(RequestEnvelope {
                id: RequestId(id),
                target: RequestTarget::Group(2),
                request,
            })
        };
        let mut point = StreamPoint {
            at_ns: 77,
            role: PointRole::Chunk { is_first: true, is_last: false },
            ..StreamPoint::default()
        };
        point.axes[3] = AxisPoint::moving(0.25, -1.0).with_impedance(50.0, 3.0);
        let mut targets = [None; MAX_AXES];
        targets[1] = Some(AxisTarget::Impedance {
            state: State::rest(1.0),
            stiffness: 9.0,
            damping: 0.1,
            torque: -2.0,
        });
        let report = OffCycleReport {
            state: DriveState::OperationEnabled,
            position: 1.5,
            velocity: -0.5,
            torque: 3.0,
            error_code: 0x2310,
            temperature: Some(41.5),
        };
        let inputs = [
            request(1, Request::Enable),
            request(2, Request::Move(motion)),
            request(u64::MAX, Request::Stop(StopCategory::One)),
            HostInput::OffCycleReport { axis: 4, report },
            HostInput::Point { group: 1, point },
            HostInput::CallbackTaken { is_there: true },
            HostInput::Called {
                returned: CallbackReturn { outcome: CallbackOutcome::Commanded, spent_ns: 1234 },
                targets,
            },
            HostInput::ServiceFrame { bus: 1, frame: Frame::of(Id::canopen(0x600, 5), [0x40, 0, 0x10, 0]) },
        ];
        (0..).zip(inputs).map(|(cycle, input)| JournalEntry { cycle, input }).collect()
    }

    #[test]
    fn everything_comes_out_as_it_went_in_also_over_several_blocks() {
        let wake = Wake { now_ns: 5_000_000_100, timer_latency_ns: 100, suspended_ns: 7 };
        let clock = [
            ClockAnswer::Now(5_000_000_000),
            ClockAnswer::WokeToSend(wake),
            ClockAnswer::Now(5_000_000_150),
            ClockAnswer::Woke(Wake { now_ns: 5_000_550_000, ..wake }),
            ClockAnswer::CycleEnd,
        ];
        let frames = [
            Frame::fd(Id::extended(0x1234_5678).unwrap(), &[7; 24], true).unwrap(),
            Frame::fd(Id::base(0x7FF).unwrap(), &[8; 64], false).unwrap(),
            Frame::of(Id::canopen(0x180, 5), [0, 1, 2]),
            Frame::remote(Id::canopen(0x700, 5), 1).unwrap(),
        ];
        let mark = |answer| PortMark { at_ns: 4_999_999_999, answer };
        let answers = [
            PortAnswer::Received,
            PortAnswer::Unconfirmed(3),
            PortAnswer::Taken(2),
            PortAnswer::State(BusState::BusOff),
        ];
        let traced = |is_sent, frame| Traced::Frame(TracedFrame { at_ns: 5_000_400_000, is_sent, frame });
        let mut written = Journal::default();
        let mut journal = Journal::default();
        written.add_clock(ClockAnswer::Epoch(4_999_000_000));
        for answer in clock {
            written.add_clock(answer);
            journal.add_block(&written.take_block().unwrap()).unwrap();
        }
        answers.into_iter().for_each(|answer| written.add_port(2, &Traced::Mark(mark(answer))));
        written.add_port(2, &traced(true, frames[0]));
        frames.into_iter().for_each(|frame| written.add_port(2, &traced(false, frame)));
        written.host.extend(entries());
        journal.add_block(&written.take_block().unwrap()).unwrap();
        assert_eq!(written.take_block(), None);

        assert_eq!((journal.epoch_ns, journal.ports.len()), (Some(4_999_000_000), 3));
        assert!(journal.clock.iter().eq(&clock));
        assert_eq!(journal.ports[2][..4], answers.map(|answer| PortEntry::Mark(mark(answer))));
        let received = frames.map(|frame| Received { frame, at_ns: 5_000_400_000 });
        assert_eq!(journal.ports[2][4..], received.map(|received| PortEntry::Received(received.into())));
        for (entry, received) in journal.ports[2][4..].iter().zip(received) {
            assert!(matches!(entry, PortEntry::Received(frame) if frame.received() == Ok(received)));
        }
        assert!(journal.host.iter().eq(&entries()));
    }

    #[test]
    fn a_trajectory_comes_out_as_it_went_in() {
        use crate::channels::GroupAxes;
        use crate::trajectory::{TrajectoryConditions, TrajectoryPoint};
        let limits = [AxisLimits::NONE; 2];
        let conditions =
            TrajectoryConditions { start: &[State::rest(0.0); 2], limits: &limits, period_s: 0.001 };
        let point = |time_s, positions: [f64; 2]| TrajectoryPoint {
            time_s,
            positions: positions.to_vec(),
            ..TrajectoryPoint::default()
        };
        let trajectory =
            Trajectory::new(&[point(1.0, [0.5, 0.1]), point(2.5, [-0.5, 0.3])], &conditions).unwrap();
        let given = GivenTrajectory::new(trajectory.clone(), GroupAxes::new(vec![3, 1]));
        let mut written = Journal::default();
        written.add_trajectory(TrajectoryId(9), 1, &given);
        let mut journal = Journal::default();
        journal.add_block(&written.take_block().unwrap()).unwrap();
        let expected = JournaledTrajectory { id: TrajectoryId(9), group: 1, axes: vec![3, 1], trajectory };
        assert_eq!(journal.trajectories, [expected]);
    }

    #[test]
    fn what_no_run_has_is_refused_with_the_reason_and_nothing_is_added() {
        let wake = Wake { now_ns: 5, timer_latency_ns: 6, suspended_ns: 0 };
        let mark = |at_ns| PortEntry::Mark(PortMark { at_ns, answer: PortAnswer::Received });
        let wrong_checksum = Checkpoint { engine: vec![1, 2, 3], ..Checkpoint::default() };
        let late = Checkpoint { now_ns: LATEST_NS + 1, ..Checkpoint::default() };
        let clock = |answer| Journal { clock: [answer].into(), ..Journal::default() };
        let ports = |ports| Journal { ports, ..Journal::default() };
        let checkpoint = |state| Journal { checkpoint: Some(state), ..Journal::default() };
        for (damaged, defect) in [
            (clock(ClockAnswer::Now(LATEST_NS + 1)), BlockDefect::Time),
            (clock(ClockAnswer::Woke(wake)), BlockDefect::Time),
            (Journal { epoch_ns: Some(u64::MAX), ..Journal::default() }, BlockDefect::Time),
            (ports(vec![vec![mark(LATEST_NS + 1)]]), BlockDefect::Time),
            (ports(vec![vec![]; MAX_BUSES + 1]), BlockDefect::Buses { buses: MAX_BUSES + 1 }),
            (checkpoint(late), BlockDefect::Time),
            (checkpoint(wrong_checksum), BlockDefect::Checksum),
        ] {
            let mut journal = Journal::default();
            assert_eq!(journal.add_block(&bitcode::encode(&damaged)), Err(defect), "{damaged:?}");
            assert_eq!(journal, Journal::default());
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_journal_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = Journal::default().add_block(&bytes);
        }
    }
}
