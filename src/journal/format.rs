//! The journal as bytes: one entry after another, each a tag and numbers of 7 bits a byte, the lowest first. Times are differences to
//! the time before.

use std::collections::{HashMap, VecDeque};

use takt_rt::{BusState, MAX_BUSES, Nanoseconds, Received, TrajectoryId, Wake};

use super::clock::ClockAnswer;
use super::host_words::{put_entry, take_entry};
use super::port::{PortEntry, PortState};
use crate::channels::{GivenTrajectory, GroupAxes, JournalEntry};
use crate::link::trace::{PortAnswer, PortMark, Traced};
use crate::packet::{Malformed, Put, Take};
use crate::trajectory::Trajectory;

/// The state of a run between two cycles, so that its journal need not begin with the first one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
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
}

/// A journal, or a part of one.
#[derive(Debug, Default)]
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
    /// The trajectories by their numbers, each with its group.
    pub trajectories: HashMap<TrajectoryId, (u8, GivenTrajectory)>,
}

/// A journal that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the journal is damaged at byte {at} of a block")]
pub struct JournalDefect {
    /// Where.
    pub at: usize,
}

/// The latest time of a journal: no machine has run for 292 years. The cycle adds its phases to the times that its clock tells.
const LATEST_NS: Nanoseconds = i64::MAX as Nanoseconds;

const EPOCH: u8 = 0;
const NOW: u8 = 1;
const WOKE: u8 = 2;
const WOKE_TO_SEND: u8 = 3;
const FRAME: u8 = 4;
const MARK: u8 = 5;
const HOST: u8 = 6;
const TRAJECTORY: u8 = 7;
const CYCLE_END: u8 = 8;
const CHECKPOINT: u8 = 9;

/// Makes bytes of a journal. Each block can be read by itself.
#[derive(Debug, Default)]
pub struct Encoder {
    bytes: Vec<u8>,
    last_ns: Nanoseconds,
}

impl Encoder {
    /// The entries since the last call; nothing if there were none.
    pub fn take_block(&mut self) -> Option<Vec<u8>> {
        self.last_ns = 0;
        (!self.bytes.is_empty()).then(|| std::mem::take(&mut self.bytes))
    }

    /// Puts an answer of the clock.
    pub fn clock(&mut self, answer: ClockAnswer) {
        match answer {
            ClockAnswer::Epoch(at_ns) => {
                self.tag(EPOCH);
                self.time(at_ns);
            }
            ClockAnswer::Now(at_ns) => {
                self.tag(NOW);
                self.time(at_ns);
            }
            ClockAnswer::Woke(wake) => self.wake(WOKE, wake),
            ClockAnswer::WokeToSend(wake) => self.wake(WOKE_TO_SEND, wake),
            ClockAnswer::CycleEnd => self.tag(CYCLE_END),
        }
    }

    /// Puts what has passed a port. What was sent, the replay sends itself.
    pub fn port(&mut self, bus: usize, traced: &Traced) {
        match traced {
            Traced::Frame(frame) if frame.is_sent => {}
            Traced::Frame(frame) => {
                self.tag(FRAME);
                self.number(bus as u64);
                self.time(frame.at_ns);
                let mut words = Put::default();
                words.frame(&frame.frame);
                words.0.iter().for_each(|word| self.number(*word));
            }
            Traced::Mark(PortMark { at_ns, answer }) => {
                let (kind, value) = match answer {
                    PortAnswer::Received => (0, 0),
                    PortAnswer::Unconfirmed(count) => (1, *count),
                    PortAnswer::Taken(count) => (2, *count),
                    PortAnswer::State(state) => (3, *state as u64),
                };
                self.tag(MARK);
                self.number(bus as u64);
                self.time(*at_ns);
                self.number(kind);
                self.number(value);
            }
        }
    }

    /// Puts what the host has given.
    pub fn host(&mut self, entry: &JournalEntry) {
        let mut words = Put::default();
        put_entry(entry, &mut words);
        self.words(HOST, &words);
    }

    /// Puts the state of the run.
    pub fn checkpoint(&mut self, checkpoint: &Checkpoint) {
        let Checkpoint { next_slot, next_cycle, now_ns, ports, engine, streams } = checkpoint;
        self.tag(CHECKPOINT);
        self.number(*next_slot);
        self.number(*next_cycle);
        self.time(*now_ns);
        self.number(ports.len() as u64);
        for port in ports {
            self.number(port.state as u64);
            self.time(port.now_ns);
        }
        self.checked_bytes(engine);
        self.number(streams.len() as u64);
        streams.iter().for_each(|stream| self.checked_bytes(stream));
    }

    /// Puts a trajectory that the real-time thread has been given.
    pub fn trajectory(&mut self, id: TrajectoryId, group: u8, given: &GivenTrajectory) {
        let mut words = Put::default();
        words.word(id.0).word(group.into()).index(given.axes().places().len());
        given.axes().places().iter().for_each(|place| {
            words.index(*place);
        });
        given.trajectory().put(&mut words);
        self.words(TRAJECTORY, &words);
    }

    fn wake(&mut self, tag: u8, wake: Wake) {
        self.tag(tag);
        self.time(wake.now_ns);
        self.number(wake.timer_latency_ns);
        self.number(wake.suspended_ns);
    }

    fn words(&mut self, tag: u8, words: &Put) {
        self.tag(tag);
        self.number(words.0.len() as u64);
        words.0.iter().for_each(|word| self.number(*word));
    }

    fn tag(&mut self, tag: u8) {
        self.bytes.push(tag);
    }

    /// Bytes behind their count, and their CRC-32.
    fn checked_bytes(&mut self, bytes: &[u8]) {
        self.number(bytes.len() as u64);
        self.bytes.extend_from_slice(bytes);
        self.number(crc32fast::hash(bytes).into());
    }

    /// The difference to the time before, with its sign in the lowest bit.
    fn time(&mut self, at_ns: Nanoseconds) {
        let difference = at_ns.wrapping_sub(self.last_ns) as i64;
        self.last_ns = at_ns;
        self.number((difference << 1 ^ difference >> 63) as u64);
    }

    fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }
}

impl Journal {
    /// Adds a block.
    ///
    /// # Errors
    /// The block is damaged. The entries before the defect are there.
    pub fn add_block(&mut self, block: &[u8]) -> Result<(), JournalDefect> {
        let mut decoder = Decoder { bytes: block, last_ns: 0 };
        while !decoder.bytes.is_empty() {
            let at = block.len() - decoder.bytes.len();
            self.add_entry(&mut decoder).map_err(|Malformed| JournalDefect { at })?;
        }
        Ok(())
    }

    fn add_entry(&mut self, decoder: &mut Decoder<'_>) -> Result<(), Malformed> {
        match decoder.tag()? {
            EPOCH => self.epoch_ns = Some(decoder.time()?),
            NOW => self.clock.push_back(ClockAnswer::Now(decoder.time()?)),
            WOKE => self.clock.push_back(ClockAnswer::Woke(decoder.wake()?)),
            WOKE_TO_SEND => self.clock.push_back(ClockAnswer::WokeToSend(decoder.wake()?)),
            CYCLE_END => self.clock.push_back(ClockAnswer::CycleEnd),
            CHECKPOINT => self.checkpoint = Some(decoder.checkpoint()?),
            FRAME => {
                let (bus, at_ns) = (decoder.bus()?, decoder.time()?);
                let frame = decoder.frame()?;
                self.port(bus).push(PortEntry::Received(Received { frame, at_ns }));
            }
            MARK => {
                let (bus, at_ns) = (decoder.bus()?, decoder.time()?);
                let answer = match (decoder.number()?, decoder.number()?) {
                    (0, 0) => PortAnswer::Received,
                    (1, count) => PortAnswer::Unconfirmed(count),
                    (2, count) => PortAnswer::Taken(count),
                    (3, state) => PortAnswer::State(bus_state(state)?),
                    _ => return Err(Malformed),
                };
                self.port(bus).push(PortEntry::Mark(PortMark { at_ns, answer }));
            }
            HOST => {
                let words = decoder.words()?;
                let mut take = Take(&words);
                self.host.push_back(take_entry(&mut take)?);
                take.end()?;
            }
            TRAJECTORY => {
                let words = decoder.words()?;
                let mut take = Take(&words);
                let (id, group) =
                    (TrajectoryId(take.word()?), u8::try_from(take.word()?).map_err(|_| Malformed)?);
                let axes = take.count_of(1)?;
                let places = (0..axes).map(|_| take.index()).collect::<Result<_, _>>()?;
                let trajectory = Trajectory::take(&mut take)?;
                take.end()?;
                let given = GivenTrajectory::new(trajectory, GroupAxes::new(places));
                self.trajectories.insert(id, (group, given));
            }
            _ => return Err(Malformed),
        }
        Ok(())
    }

    fn port(&mut self, bus: usize) -> &mut Vec<PortEntry> {
        if self.ports.len() <= bus {
            self.ports.resize_with(bus + 1, Vec::new);
        }
        &mut self.ports[bus]
    }
}

fn bus_state(number: u64) -> Result<BusState, Malformed> {
    let states = [BusState::ErrorActive, BusState::ErrorPassive, BusState::BusOff, BusState::Down];
    states.into_iter().find(|state| *state as u64 == number).ok_or(Malformed)
}

struct Decoder<'a> {
    bytes: &'a [u8],
    last_ns: Nanoseconds,
}

impl Decoder<'_> {
    fn tag(&mut self) -> Result<u8, Malformed> {
        let (first, rest) = self.bytes.split_first().ok_or(Malformed)?;
        self.bytes = rest;
        Ok(*first)
    }

    fn number(&mut self) -> Result<u64, Malformed> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.tag()?;
            number |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(Malformed)
    }

    fn time(&mut self) -> Result<Nanoseconds, Malformed> {
        let number = self.number()?;
        let difference = (number >> 1) as i64 ^ -((number & 1) as i64);
        let at_ns = self.last_ns.checked_add_signed(difference).filter(|at_ns| *at_ns <= LATEST_NS);
        self.last_ns = at_ns.ok_or(Malformed)?;
        Ok(self.last_ns)
    }

    fn wake(&mut self) -> Result<Wake, Malformed> {
        let (now_ns, timer_latency_ns, suspended_ns) = (self.time()?, self.number()?, self.number()?);
        if timer_latency_ns > now_ns {
            return Err(Malformed);
        }
        Ok(Wake { now_ns, timer_latency_ns, suspended_ns })
    }

    fn checkpoint(&mut self) -> Result<Checkpoint, Malformed> {
        let (next_slot, next_cycle, now_ns) = (self.number()?, self.number()?, self.time()?);
        let ports = (0..self.count()?)
            .map(|_| Ok(PortState { state: bus_state(self.number()?)?, now_ns: self.time()? }))
            .collect::<Result<_, _>>()?;
        let engine = self.checked_bytes()?;
        let streams = (0..self.count()?).map(|_| self.checked_bytes()).collect::<Result<_, _>>()?;
        Ok(Checkpoint { next_slot, next_cycle, now_ns, ports, engine, streams })
    }

    /// A count of things that have a byte each at least.
    fn count(&mut self) -> Result<usize, Malformed> {
        usize::try_from(self.number()?).ok().filter(|count| *count <= self.bytes.len()).ok_or(Malformed)
    }

    fn checked_bytes(&mut self) -> Result<Vec<u8>, Malformed> {
        let count = self.count()?;
        let (bytes, rest) = self.bytes.split_at_checked(count).ok_or(Malformed)?;
        self.bytes = rest;
        let is_whole = self.number()? == u64::from(crc32fast::hash(bytes));
        is_whole.then(|| bytes.to_vec()).ok_or(Malformed)
    }

    fn bus(&mut self) -> Result<usize, Malformed> {
        usize::try_from(self.number()?).ok().filter(|bus| *bus < MAX_BUSES).ok_or(Malformed)
    }

    fn frame(&mut self) -> Result<takt_rt::Frame, Malformed> {
        let (head, id) = (self.number()?, self.number()?);
        let is_remote = head & 3 == 1;
        let bytes = usize::try_from(head >> 3).ok().filter(|bytes| *bytes <= takt_rt::Frame::MAX_BYTES);
        let payload = if is_remote { 0 } else { bytes.ok_or(Malformed)?.div_ceil(size_of::<u64>()) };
        let mut words = vec![head, id];
        for _ in 0..payload {
            words.push(self.number()?);
        }
        Take(&words).frame()
    }

    /// Words behind their count, each of which has a byte at least.
    fn words(&mut self) -> Result<Vec<u64>, Malformed> {
        (0..self.count()?).map(|_| self.number()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channels::HostInput;
    use crate::link::trace::TracedFrame;
    use proptest::prelude::*;
    use takt_rt::plan::State;
    use takt_rt::{
        AxisLimits, AxisPoint, AxisTarget, CallbackOutcome, CallbackReturn, DriveState, Frame, Id, MAX_AXES,
        Move, OffCycleReport, PointRole, Request, RequestEnvelope, RequestId, RequestTarget, StopCategory,
        StreamPoint,
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
        let frame = Frame::fd(Id::extended(0x1234_5678).unwrap(), &[7; 24], true).unwrap();
        let mark = |answer| Traced::Mark(PortMark { at_ns: 4_999_999_999, answer });
        let answers = [
            PortAnswer::Received,
            PortAnswer::Unconfirmed(3),
            PortAnswer::Taken(2),
            PortAnswer::State(BusState::BusOff),
        ];
        let traced = |is_sent| Traced::Frame(TracedFrame { at_ns: 5_000_400_000, is_sent, frame });
        let mut encoder = Encoder::default();
        let mut journal = Journal::default();
        encoder.clock(ClockAnswer::Epoch(4_999_000_000));
        for answer in clock {
            encoder.clock(answer);
            journal.add_block(&encoder.take_block().unwrap()).unwrap();
        }
        answers.into_iter().for_each(|answer| encoder.port(2, &mark(answer)));
        encoder.port(2, &traced(true));
        encoder.port(2, &traced(false));
        entries().iter().for_each(|entry| encoder.host(entry));
        journal.add_block(&encoder.take_block().unwrap()).unwrap();
        assert_eq!(encoder.take_block(), None);

        assert_eq!((journal.epoch_ns, journal.ports.len()), (Some(4_999_000_000), 3));
        assert!(journal.clock.iter().eq(&clock));
        let expected = answers.map(|answer| PortEntry::Mark(PortMark { at_ns: 4_999_999_999, answer }));
        assert_eq!(journal.ports[2][..4], expected);
        assert_eq!(journal.ports[2][4..], [PortEntry::Received(Received { frame, at_ns: 5_000_400_000 })]);
        assert!(journal.host.iter().eq(&entries()));
    }

    #[test]
    fn a_trajectory_comes_out_as_it_went_in() {
        use crate::trajectory::{TrajectoryConditions, TrajectoryPoint};
        use std::sync::Arc;
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
        let given = Arc::new(GivenTrajectory::new(trajectory.clone(), GroupAxes::new(vec![3, 1])));
        let mut encoder = Encoder::default();
        encoder.trajectory(TrajectoryId(9), 1, &given);
        let mut journal = Journal::default();
        journal.add_block(&encoder.take_block().unwrap()).unwrap();
        let (group, read) = &journal.trajectories[&TrajectoryId(9)];
        assert_eq!((*group, read.trajectory(), read.axes().places()), (1, &trajectory, &[3, 1][..]));
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_journal_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = Journal::default().add_block(&bytes);
        }
    }
}
