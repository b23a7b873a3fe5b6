//! Points of streams, from any thread to the real-time thread: each group has a stream of its own.
//!
//! Clients share the writing end of a ring behind a lock of their own. The real-time thread never touches that lock: a client
//! that is preempted in the middle of a call holds up other clients, and nothing else.
//!
//! Points are taken while the group streams. A point carries the number of the stream for which it was pushed: so one whose thread was
//! held up in the middle of a call does not end up in a later stream.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use takt_rt::{
    AxisPoint, CheckpointError, LookAhead, LookAheadParameters, MAX_AXES, Nanoseconds, PointRole,
    StreamPoint, StreamSample, StreamWish,
};

use super::ChannelError;
use super::group_axes::GroupAxes;
use super::primitives::{AtomicU64, Ordering};
use super::ring::{Consumer, Producer, ring};

/// Points that the real-time thread takes in one cycle: a chunk of 64 is taken within eight. The rest waits, so that a flood of them costs
/// little time in each cycle.
const POINTS_PER_CYCLE: usize = 8;
/// Points that wait for the next cycle.
const WAITING_POINTS: usize = 256;
/// Points that the real-time thread can look ahead.
const LOOK_AHEAD_POINTS: usize = 256;

/// The number of a stream while none runs. Streams have numbers from 1 on.
const NO_STREAM: u64 = 0;

/// The stream of one group.
#[derive(Clone, Debug, Default)]
pub struct GroupStream {
    /// The axes of the group.
    pub axes: GroupAxes,
    /// How its points are looked ahead, with its axes in the order of the group.
    pub look_ahead: LookAheadParameters,
}

/// A point of a stream as a client has it, with an entry for each axis that it is for.
#[derive(Clone, Copy)]
pub struct SentPoint<'a> {
    /// The time that it is meant for.
    pub at_ns: Nanoseconds,
    /// How it is put among the others.
    pub role: PointRole,
    /// What it says of each axis.
    pub axes: &'a [AxisPoint],
}

impl<'a> From<&'a StreamPoint> for SentPoint<'a> {
    fn from(point: &'a StreamPoint) -> Self {
        Self { at_ns: point.at_ns, role: point.role, axes: &point.axes }
    }
}

impl<'a> From<&'a SentPoint<'a>> for SentPoint<'a> {
    fn from(point: &'a SentPoint<'a>) -> Self {
        *point
    }
}

/// The writing ends of the points of every group's stream. Clone it for every thread.
#[derive(Clone)]
pub struct Streamer(Arc<[StreamWriter]>);

struct StreamWriter {
    axes: GroupAxes,
    points: Mutex<PointSender>,
}

/// A point on its way.
#[derive(Default)]
struct WaitingPoint {
    /// The stream that it was pushed for.
    stream: u64,
    point: StreamPoint,
}

impl StreamWriter {
    fn lock(&self) -> MutexGuard<'_, PointSender> {
        // A panic of another holder of the lock leaves the rings consistent.
        self.points.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The clients' end of the points of a group. A point has room for many more axes than most groups have: it is written where it is, and
/// only the axes of the group.
struct PointSender {
    /// The stream that runs; [`NO_STREAM`] while none does.
    running: Arc<AtomicU64>,
    waiting: Producer<Box<WaitingPoint>>,
    free: Consumer<Box<WaitingPoint>>,
}

impl PointSender {
    fn room(&mut self) -> usize {
        self.free.waiting()
    }

    /// The stream that takes points now; `None` while none does.
    fn running(&self) -> Option<u64> {
        Some(self.running.load(Ordering::Acquire)).filter(|stream| *stream != NO_STREAM)
    }

    /// Sends a point that there is room for. `axes` is what it says of each axis of the group, in the order of the group.
    fn send<'a>(
        &mut self,
        stream: u64,
        sent: SentPoint<'a>,
        axes: impl Iterator<Item = Option<&'a AxisPoint>>,
    ) {
        let Some(mut waiting) = self.free.pop() else { return };
        waiting.stream = stream;
        (waiting.point.at_ns, waiting.point.role) = (sent.at_ns, sent.role);
        for (to, from) in waiting.point.axes.iter_mut().zip(axes) {
            *to = from.copied().unwrap_or_default();
        }
        self.waiting.push(waiting);
    }
}

/// The two ends, the reading ones in the order of the groups.
pub fn stream_channels(groups: &[GroupStream]) -> (Streamer, Vec<StreamReceiver>) {
    let (writers, receivers): (Vec<StreamWriter>, Vec<StreamReceiver>) =
        groups.iter().map(stream_channel).unzip();
    (Streamer(writers.into()), receivers)
}

fn stream_channel(group: &GroupStream) -> (StreamWriter, StreamReceiver) {
    let (sent, waiting) = ring(WAITING_POINTS);
    // Every point is in one of both rings, so neither is ever full.
    let (mut given_back, free) = ring(WAITING_POINTS);
    (0..WAITING_POINTS).for_each(|_| {
        given_back.push(Box::default());
    });
    let running = Arc::new(AtomicU64::new(NO_STREAM));
    let points = vec![StreamPoint::default(); LOOK_AHEAD_POINTS].into_boxed_slice();
    let look_ahead = Box::new(LookAhead::new(points, group.look_ahead.clone()));
    let sender = PointSender { running: Arc::clone(&running), waiting: sent, free };
    let writer = StreamWriter { axes: group.axes.clone(), points: Mutex::new(sender) };
    let receiver = StreamReceiver {
        axes: group.axes.clone(),
        running,
        stream: NO_STREAM,
        overtaken: 0,
        waiting,
        free: given_back,
        look_ahead,
    };
    (writer, receiver)
}

/// A chunk: points from a time on, at equal intervals. It takes the place of every point from its first one on that came before
/// it.
pub fn chunk<A: AsRef<[AxisPoint]>>(
    from_ns: Nanoseconds,
    interval_ns: Nanoseconds,
    points: &[A],
) -> Vec<SentPoint<'_>> {
    let stamps_ns = (0..).map(|number: u64| from_ns.saturating_add(number.saturating_mul(interval_ns)));
    let stamped = points.iter().zip(stamps_ns).enumerate();
    stamped
        .map(|(index, (axes, at_ns))| {
            let role = PointRole::Chunk { is_first: index == 0, is_last: index + 1 == points.len() };
            SentPoint { at_ns, role, axes: axes.as_ref() }
        })
        .collect()
}

impl Streamer {
    /// Hands points with an entry for each axis of the controller to the streams that run, all of them or none.
    ///
    /// # Errors
    /// [`ChannelError::NotStreaming`] if no group streams, [`ChannelError::Full`] if there is no room for all of them.
    pub fn push<'a, P>(&self, points: &'a [P]) -> Result<(), ChannelError>
    where
        &'a P: Into<SentPoint<'a>>,
    {
        // Every thread takes the locks in this order.
        let writers = self.0.iter().map(|writer| (&writer.axes, writer.lock()));
        let mut streams: Vec<_> =
            writers.filter_map(|(axes, sender)| Some((axes, sender.running()?, sender))).collect();
        if streams.is_empty() {
            return Err(ChannelError::NotStreaming);
        }
        if streams.iter_mut().any(|(.., sender)| sender.room() < points.len()) {
            return Err(ChannelError::Full);
        }
        for (axes, stream, sender) in &mut streams {
            for point in points.iter().map(Into::into) {
                sender.send(*stream, point, axes.places().iter().map(|place| point.axes.get(*place)));
            }
        }
        Ok(())
    }

    /// Hands points with an entry for each axis of a group to its stream, all of them or none.
    ///
    /// # Errors
    /// [`ChannelError::NotStreaming`] if the group does not stream, or does not exist; [`ChannelError::Full`] if there is no room for all
    /// of them.
    pub fn push_to<'a, P>(&self, group: u8, points: &'a [P]) -> Result<(), ChannelError>
    where
        &'a P: Into<SentPoint<'a>>,
    {
        let writer = self.0.get(usize::from(group)).ok_or(ChannelError::NotStreaming)?;
        let mut sender = writer.lock();
        let stream = sender.running().ok_or(ChannelError::NotStreaming)?;
        if sender.room() < points.len() {
            return Err(ChannelError::Full);
        }
        for point in points.iter().map(Into::into) {
            sender.send(stream, point, (0..writer.axes.places().len()).map(|axis| point.axes.get(axis)));
        }
        Ok(())
    }
}

/// The real-time thread's end of the stream of a group.
pub struct StreamReceiver {
    axes: GroupAxes,
    /// The number of the stream while it runs, for the clients.
    running: Arc<AtomicU64>,
    /// The number of the last stream.
    stream: u64,
    /// Points of an earlier stream that have arrived in this one.
    overtaken: u64,
    waiting: Consumer<Box<WaitingPoint>>,
    /// Points that have been used go back here.
    free: Producer<Box<WaitingPoint>>,
    look_ahead: Box<LookAhead<MAX_AXES, Box<[StreamPoint]>>>,
}

impl StreamReceiver {
    /// The state between two cycles, without the points that wait.
    pub fn checkpoint(&self) -> Vec<u8> {
        self.look_ahead.checkpoint()
    }

    /// Goes on from the state of a stream of the same axes.
    ///
    /// # Errors
    /// It is of other axes, or of another version of takt.
    pub fn resume(&mut self, checkpoint: &[u8]) -> Result<(), CheckpointError> {
        self.look_ahead.resume(checkpoint)
    }

    /// A stream begins: forgets the one before it, and takes points from now on.
    pub fn begin(&mut self) {
        self.look_ahead.begin();
        self.overtaken = 0;
        self.stream += 1;
        self.running.store(self.stream, Ordering::Release);
    }

    /// No stream runs: takes no points from now on, and discards those that wait. Returns how many.
    pub fn discard(&mut self) -> u64 {
        if self.running.load(Ordering::Relaxed) != NO_STREAM {
            self.running.store(NO_STREAM, Ordering::Release);
        }
        let mut discarded = 0;
        // Clients that have begun a call before can push no more than the ring holds.
        while discarded < WAITING_POINTS as u64
            && let Some(point) = self.waiting.pop()
        {
            self.free.push(point);
            discarded += 1;
        }
        discarded
    }

    /// Takes a point for the slot that begins at this time.
    pub fn insert(&mut self, point: &StreamPoint, slot_start_ns: Nanoseconds) {
        // A point that is of no use is counted.
        let _ = self.look_ahead.insert(point, slot_start_ns);
    }

    /// Writes what the stream wants of the axes of the controller in the slot that begins at this time. `note` is told of each point that is
    /// taken. Nothing here allocates, locks or waits.
    pub fn sample(
        &mut self,
        slot_start_ns: Nanoseconds,
        sample: &mut StreamSample,
        mut note: impl FnMut(&StreamPoint),
    ) {
        for _ in 0..POINTS_PER_CYCLE {
            let Some(waiting) = self.waiting.pop() else { break };
            if waiting.stream == self.stream {
                note(&waiting.point);
                self.insert(&waiting.point, slot_start_ns);
            } else {
                self.overtaken += 1;
            }
            self.free.push(waiting);
        }
        self.look_ahead.sample(slot_start_ns, sample);
        sample.counts.points += self.overtaken;
        sample.counts.lost_points += self.overtaken;
        match &mut sample.wish {
            StreamWish::Awaited => {}
            StreamWish::Targets(targets) | StreamWish::Dry(targets) => self.axes.spread(targets),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{AxisLimits, AxisTarget, StreamDelay};

    const MILLISECOND_NS: u64 = 1_000_000;

    fn group(axes: &[usize]) -> GroupStream {
        let limits = axes.iter().map(|_| AxisLimits::NONE).collect();
        let delay = StreamDelay::Fixed(0);
        GroupStream {
            axes: GroupAxes::new(axes.to_vec()),
            look_ahead: LookAheadParameters { limits, period_ns: MILLISECOND_NS, delay },
        }
    }

    /// A stream that runs.
    fn channel() -> (Streamer, StreamReceiver) {
        let (streamer, mut receivers) = stream_channels(&[group(&[0])]);
        let mut receiver = receivers.pop().unwrap();
        receiver.begin();
        (streamer, receiver)
    }

    fn positions(of: impl Fn(u32) -> f64, count: u32) -> Vec<[AxisPoint; MAX_AXES]> {
        (0..count).map(|number| [AxisPoint::position(of(number)); MAX_AXES]).collect()
    }

    fn sampled(receiver: &mut StreamReceiver, slot_start_ns: Nanoseconds) -> StreamSample {
        let mut sample = StreamSample::default();
        receiver.sample(slot_start_ns, &mut sample, |_| {});
        sample
    }

    fn wanted(sample: &StreamSample) -> f64 {
        let StreamWish::Targets([AxisTarget::Position { state: first, .. }, ..]) = sample.wish else {
            panic!("{:?}", sample.wish)
        };
        first.position
    }

    #[test]
    fn points_of_any_thread_are_wanted_at_their_time() {
        let (streamer, mut receiver) = channel();
        assert_eq!(sampled(&mut receiver, MILLISECOND_NS).wish, StreamWish::Awaited);
        let chunk = positions(|number| 0.01 * f64::from(number), 20);
        let threads: Vec<_> = (0..2)
            .map(|half| {
                let (streamer, chunk) = (streamer.clone(), chunk.clone());
                std::thread::spawn(move || {
                    for (number, axes) in chunk.iter().enumerate().skip(half).step_by(2) {
                        let at_ns = (10 + 10 * number as u64) * MILLISECOND_NS;
                        streamer
                            .push(&[StreamPoint { at_ns, role: PointRole::Single, axes: *axes }])
                            .unwrap();
                    }
                })
            })
            .collect();
        threads.into_iter().for_each(|thread| thread.join().unwrap());
        // One thread may have been first with all of its points, and a cycle takes only some of them.
        for at_ms in 2..4 {
            sampled(&mut receiver, at_ms * MILLISECOND_NS);
        }
        assert_eq!(wanted(&sampled(&mut receiver, 4 * MILLISECOND_NS)), 0.0);
        for at_ms in 60..150 {
            let expected = 0.001 * (at_ms - 10) as f64;
            let wanted = wanted(&sampled(&mut receiver, at_ms * MILLISECOND_NS));
            assert!((wanted - expected).abs() < 1e-9, "{wanted} for {expected}");
        }
    }

    fn point(at_ms: u64) -> StreamPoint {
        let axes = [AxisPoint::position(1.0); MAX_AXES];
        StreamPoint { at_ns: at_ms * MILLISECOND_NS, role: PointRole::Single, axes }
    }

    #[test]
    fn points_are_taken_from_the_beginning_of_a_stream_to_its_end_and_those_that_wait_then_are_discarded() {
        let (streamer, mut receivers) = stream_channels(&[group(&[0])]);
        let receiver = &mut receivers[0];
        let refused = |streamer: &Streamer| {
            assert_eq!(streamer.push(&[point(1)]), Err(ChannelError::NotStreaming));
            assert_eq!(streamer.push_to(0, &[point(1)]), Err(ChannelError::NotStreaming));
        };
        refused(&streamer);
        assert_eq!(receiver.discard(), 0);
        for _ in 0..2 {
            receiver.begin();
            (0..20).for_each(|at_ms| streamer.push(&[point(at_ms)]).unwrap());
            sampled(receiver, MILLISECOND_NS);
            assert_eq!(receiver.discard(), 20 - POINTS_PER_CYCLE as u64);
            refused(&streamer);
            assert_eq!(receiver.discard(), 0);
            receiver.begin();
            assert_eq!(sampled(receiver, MILLISECOND_NS), StreamSample::default());
            streamer.push(&vec![point(1); WAITING_POINTS]).unwrap();
            assert_eq!(receiver.discard(), WAITING_POINTS as u64);
        }
    }

    #[test]
    fn a_point_whose_thread_was_held_up_does_not_end_up_in_a_later_stream() {
        let (streamer, mut receiver) = channel();
        {
            let mut sender = streamer.0[0].lock();
            let stream = sender.running().unwrap();
            receiver.discard();
            receiver.begin();
            let late = point(1);
            sender.send(stream, SentPoint::from(&late), late.axes.iter().map(Some));
        }
        let sample = sampled(&mut receiver, MILLISECOND_NS);
        assert_eq!(sample.wish, StreamWish::Awaited);
        assert_eq!((sample.counts.points, sample.counts.lost_points), (1, 1));
    }

    #[test]
    fn a_chunk_without_room_is_an_error_and_leaves_nothing() {
        let (streamer, mut receiver) = channel();
        let points = positions(|_| 1.0, 300);
        let chunk = chunk(0, MILLISECOND_NS, &points);
        assert_eq!(streamer.push(&chunk), Err(ChannelError::Full));
        assert_eq!(sampled(&mut receiver, MILLISECOND_NS).wish, StreamWish::Awaited);
        streamer.push(&chunk[..256]).unwrap();
        assert_eq!(streamer.push(&chunk[..1]), Err(ChannelError::Full));
        sampled(&mut receiver, 2 * MILLISECOND_NS);
        assert_eq!(receiver.look_ahead.counts().points, POINTS_PER_CYCLE as u64);
        streamer.push(&chunk[..POINTS_PER_CYCLE]).unwrap();
    }

    #[test]
    fn each_group_gets_the_points_of_its_own_axes_in_its_own_order() {
        let (streamer, mut receivers) = stream_channels(&[group(&[2, 0]), group(&[1])]);
        receivers.iter_mut().for_each(StreamReceiver::begin);
        let wanted = |receiver: &mut StreamReceiver, axis: usize| {
            let StreamWish::Targets(targets) = sampled(receiver, 20 * MILLISECOND_NS).wish else { panic!() };
            let AxisTarget::Position { state, .. } = targets[axis] else { panic!("{targets:?}") };
            state.position
        };
        let point = |at_ms: u64, positions: [f64; 3]| {
            let mut axes = [AxisPoint::default(); MAX_AXES];
            axes.iter_mut().zip(positions).for_each(|(to, position)| *to = position.into());
            StreamPoint { at_ns: at_ms * MILLISECOND_NS, role: PointRole::Single, axes }
        };
        streamer.push(&[point(10, [1.0, 2.0, 3.0]), point(30, [1.0, 2.0, 3.0])]).unwrap();
        streamer.push_to(1, &[point(10, [7.0, 0.0, 0.0]), point(30, [7.0, 0.0, 0.0])]).unwrap();
        assert_eq!((wanted(&mut receivers[0], 0), wanted(&mut receivers[0], 2)), (1.0, 3.0));
        assert_eq!(wanted(&mut receivers[1], 1), 7.0, "a point with the same stamp takes the place");
        assert_eq!(streamer.push_to(2, &[point(10, [0.0; 3])]), Err(ChannelError::NotStreaming));
    }
}
