//! Points of streams, from any thread to the real-time thread: each group has a stream of its own.
//!
//! Clients share the writing end of a ring behind a lock of their own. The real-time thread never touches that lock: a client
//! that is preempted in the middle of a call holds up other clients, and nothing else.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use takt_rt::{
    AxisPoint, CheckpointError, LookAhead, LookAheadParameters, MAX_AXES, Nanoseconds, PointRole,
    StreamPoint, StreamSample, StreamWish,
};

use super::ChannelError;
use super::group_axes::GroupAxes;
use super::ring::{Consumer, Producer, ring};

/// Points that the real-time thread takes in one cycle: a chunk of 64 is taken within eight. The rest waits, so that a flood of them costs
/// little time in each cycle.
const POINTS_PER_CYCLE: usize = 8;
/// Points that wait for the next cycle.
const WAITING_POINTS: usize = 256;
/// Points that the real-time thread can look ahead.
const LOOK_AHEAD_POINTS: usize = 256;

/// The stream of one group.
#[derive(Clone, Debug, Default)]
pub struct GroupStream {
    /// The axes of the group.
    pub axes: GroupAxes,
    /// How its points are looked ahead, with its axes in the order of the group.
    pub look_ahead: LookAheadParameters,
}

/// The writing ends of the points of every group's stream. Clone it for every thread.
#[derive(Clone)]
pub struct Streamer(Arc<[StreamWriter]>);

struct StreamWriter {
    axes: GroupAxes,
    points: Mutex<Producer<StreamPoint>>,
}

impl StreamWriter {
    fn lock(&self) -> MutexGuard<'_, Producer<StreamPoint>> {
        // A panic of another holder of the lock leaves the ring consistent.
        self.points.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The two ends, the reading ones in the order of the groups.
pub fn stream_channels(groups: &[GroupStream]) -> (Streamer, Vec<StreamReceiver>) {
    let (writers, receivers): (Vec<StreamWriter>, Vec<StreamReceiver>) =
        groups.iter().map(stream_channel).unzip();
    (Streamer(writers.into()), receivers)
}

fn stream_channel(group: &GroupStream) -> (StreamWriter, StreamReceiver) {
    let (producer, waiting) = ring(WAITING_POINTS);
    let points = vec![StreamPoint::default(); LOOK_AHEAD_POINTS].into_boxed_slice();
    let look_ahead = Box::new(LookAhead::new(points, group.look_ahead.clone()));
    let writer = StreamWriter { axes: group.axes.clone(), points: Mutex::new(producer) };
    (writer, StreamReceiver { axes: group.axes.clone(), waiting, look_ahead })
}

/// A chunk: points from a time on, at equal intervals. It takes the place of every point from its first one on that came before
/// it.
pub fn chunk(
    from_ns: Nanoseconds,
    interval_ns: Nanoseconds,
    points: &[[AxisPoint; MAX_AXES]],
) -> Vec<StreamPoint> {
    let stamps_ns = (0..).map(|number: u64| from_ns.saturating_add(number.saturating_mul(interval_ns)));
    let stamped = points.iter().zip(stamps_ns).enumerate();
    stamped
        .map(|(index, (axes, at_ns))| {
            let role = PointRole::Chunk { is_first: index == 0, is_last: index + 1 == points.len() };
            StreamPoint { at_ns, role, axes: *axes }
        })
        .collect()
}

impl Streamer {
    /// Hands points with an entry for each axis of the controller to the streams of all groups, all of them or none.
    ///
    /// # Errors
    /// [`ChannelError::Full`] if there is no room for all of them.
    pub fn push(&self, points: &[StreamPoint]) -> Result<(), ChannelError> {
        // Every thread takes the locks in this order.
        let mut writers: Vec<_> = self.0.iter().map(|writer| (&writer.axes, writer.lock())).collect();
        if writers.iter_mut().any(|(_, producer)| producer.room() < points.len()) {
            return Err(ChannelError::Full);
        }
        for (places, producer) in &mut writers {
            for point in points {
                producer.push(StreamPoint { axes: places.pick(&point.axes), ..*point });
            }
        }
        Ok(())
    }

    /// Hands points with an entry for each axis of a group to its stream, all of them or none. A group that does not exist takes
    /// none.
    ///
    /// # Errors
    /// [`ChannelError::Full`] if there is no room for all of them.
    pub fn push_to(&self, group: u8, points: &[StreamPoint]) -> Result<(), ChannelError> {
        let writer = self.0.get(usize::from(group)).ok_or(ChannelError::Full)?;
        let mut producer = writer.lock();
        if producer.room() < points.len() {
            return Err(ChannelError::Full);
        }
        points.iter().for_each(|point| {
            producer.push(*point);
        });
        Ok(())
    }
}

/// The real-time thread's end of the stream of a group.
pub struct StreamReceiver {
    axes: GroupAxes,
    waiting: Consumer<StreamPoint>,
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

    /// A stream begins: forgets the one before it.
    pub fn begin(&mut self) {
        self.look_ahead.begin();
    }

    /// What the stream wants of the axes of the controller in the slot that begins at this time. `note` is told of each point that is
    /// taken. Nothing here allocates, locks or waits.
    pub fn sample(&mut self, slot_start_ns: Nanoseconds, mut note: impl FnMut(&StreamPoint)) -> StreamSample {
        for _ in 0..POINTS_PER_CYCLE {
            let Some(point) = self.waiting.pop() else { break };
            note(&point);
            // A point that is of no use is counted.
            let _ = self.look_ahead.insert(&point, slot_start_ns);
        }
        let sample = self.look_ahead.sample(slot_start_ns);
        let wish = match sample.wish {
            StreamWish::Awaited => StreamWish::Awaited,
            StreamWish::Targets(targets) => StreamWish::Targets(self.axes.spread(targets)),
            StreamWish::Dry(last) => StreamWish::Dry(self.axes.spread(last)),
        };
        StreamSample { wish, ..sample }
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

    fn channel() -> (Streamer, StreamReceiver) {
        let (streamer, mut receivers) = stream_channels(&[group(&[0])]);
        (streamer, receivers.pop().unwrap())
    }

    fn positions(of: impl Fn(u32) -> f64, count: u32) -> Vec<[AxisPoint; MAX_AXES]> {
        (0..count).map(|number| [AxisPoint::position(of(number)); MAX_AXES]).collect()
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
        assert_eq!(receiver.sample(MILLISECOND_NS, |_| {}).wish, StreamWish::Awaited);
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
            receiver.sample(at_ms * MILLISECOND_NS, |_| {});
        }
        assert_eq!(wanted(&receiver.sample(4 * MILLISECOND_NS, |_| {})), 0.0);
        for at_ms in 60..150 {
            let expected = 0.001 * (at_ms - 10) as f64;
            let wanted = wanted(&receiver.sample(at_ms * MILLISECOND_NS, |_| {}));
            assert!((wanted - expected).abs() < 1e-9, "{wanted} for {expected}");
        }
    }

    #[test]
    fn a_chunk_without_room_is_an_error_and_leaves_nothing() {
        let (streamer, mut receiver) = channel();
        let chunk = chunk(0, MILLISECOND_NS, &positions(|_| 1.0, 300));
        assert_eq!(streamer.push(&chunk), Err(ChannelError::Full));
        assert_eq!(receiver.sample(MILLISECOND_NS, |_| {}).wish, StreamWish::Awaited);
        streamer.push(&chunk[..256]).unwrap();
        assert_eq!(streamer.push(&chunk[..1]), Err(ChannelError::Full));
        receiver.sample(2 * MILLISECOND_NS, |_| {});
        assert_eq!(receiver.look_ahead.counts().points, POINTS_PER_CYCLE as u64);
        streamer.push(&chunk[..POINTS_PER_CYCLE]).unwrap();
    }

    #[test]
    fn each_group_gets_the_points_of_its_own_axes_in_its_own_order() {
        let (streamer, mut receivers) = stream_channels(&[group(&[2, 0]), group(&[1])]);
        let wanted = |receiver: &mut StreamReceiver, axis: usize| {
            let StreamWish::Targets(targets) = receiver.sample(20 * MILLISECOND_NS, |_| {}).wish else {
                panic!()
            };
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
        assert_eq!(streamer.push_to(2, &[point(10, [0.0; 3])]), Err(ChannelError::Full));
    }
}
