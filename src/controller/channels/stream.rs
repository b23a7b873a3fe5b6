//! Points of a stream, from any thread to the real-time thread.
//!
//! Clients share the writing end of a ring behind a lock of their own. The real-time thread never touches that lock: a client
//! that is preempted in the middle of a call holds up other clients, and nothing else.

use std::sync::{Arc, Mutex, PoisonError};

use takt_rt::{
    AxisPoint, LookAhead, LookAheadParameters, MAX_AXES, Nanoseconds, PointRole, StreamPoint, StreamSample,
};

use super::ChannelError;
use super::ring::{Consumer, Producer, ring};

/// Points that the real-time thread takes in one cycle. The rest waits, so that a flood of them costs a bounded time.
const POINTS_PER_CYCLE: usize = 32;
/// Points that wait for the next cycle.
const WAITING_POINTS: usize = 256;
/// Points that the real-time thread can look ahead.
const LOOK_AHEAD_POINTS: usize = 256;

/// The writing end of the points of a stream. Clone it for every thread.
#[derive(Clone)]
pub struct Streamer(Arc<Mutex<Producer<StreamPoint>>>);

/// The two ends.
pub fn stream_channel(parameters: LookAheadParameters) -> (Streamer, StreamReceiver) {
    let (producer, consumer) = ring(WAITING_POINTS);
    let points = vec![StreamPoint::default(); LOOK_AHEAD_POINTS].into_boxed_slice();
    let look_ahead = Box::new(LookAhead::new(points, parameters));
    (Streamer(Arc::new(Mutex::new(producer))), StreamReceiver { waiting: consumer, look_ahead })
}

impl Streamer {
    /// Hands points over, all of them or none.
    ///
    /// # Errors
    /// [`ChannelError::Full`] if there is no room for all of them.
    pub fn push(&self, points: &[StreamPoint]) -> Result<(), ChannelError> {
        // A panic of another holder of the lock leaves the ring consistent.
        let mut producer = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if producer.room() < points.len() {
            return Err(ChannelError::Full);
        }
        points.iter().for_each(|point| {
            producer.push(*point);
        });
        Ok(())
    }

    /// Hands a chunk over, all of it or nothing: points from a time on, at equal intervals. It takes the place of every point
    /// from its first one on that came before it.
    ///
    /// # Errors
    /// [`ChannelError::Full`] if there is no room for all of it.
    pub fn push_chunk(
        &self,
        from_ns: Nanoseconds,
        interval_ns: Nanoseconds,
        points: &[[AxisPoint; MAX_AXES]],
    ) -> Result<(), ChannelError> {
        let stamps_ns = (0..).map(|number: u64| from_ns.saturating_add(number.saturating_mul(interval_ns)));
        let chunk: Vec<StreamPoint> = (points.iter().zip(stamps_ns).enumerate())
            .map(|(index, (axes, at_ns))| {
                let role = PointRole::Chunk { is_first: index == 0, is_last: index + 1 == points.len() };
                StreamPoint { at_ns, role, axes: *axes }
            })
            .collect();
        self.push(&chunk)
    }
}

/// The real-time thread's end.
pub struct StreamReceiver {
    waiting: Consumer<StreamPoint>,
    look_ahead: Box<LookAhead<MAX_AXES, Box<[StreamPoint]>>>,
}

impl StreamReceiver {
    /// A stream begins: forgets the one before it.
    pub fn begin(&mut self) {
        self.look_ahead.begin();
    }

    /// What the stream wants in the slot that begins at this time. Nothing here allocates, locks or waits.
    pub fn sample(&mut self, slot_start_ns: Nanoseconds) -> StreamSample {
        for _ in 0..POINTS_PER_CYCLE {
            let Some(point) = self.waiting.pop() else { break };
            // A point that is of no use is counted.
            let _ = self.look_ahead.insert(&point, slot_start_ns);
        }
        self.look_ahead.sample(slot_start_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_rt::{AxisLimits, AxisTarget, StreamDelay, StreamWish};

    const MILLISECOND_NS: u64 = 1_000_000;

    fn channel() -> (Streamer, StreamReceiver) {
        let limits = [AxisLimits::NONE].into_iter().collect();
        let delay = StreamDelay::Fixed(0);
        stream_channel(LookAheadParameters { limits, period_ns: MILLISECOND_NS, delay })
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
        assert_eq!(receiver.sample(MILLISECOND_NS).wish, StreamWish::Awaited);
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
        assert_eq!(wanted(&receiver.sample(2 * MILLISECOND_NS)), 0.0);
        for at_ms in 60..150 {
            let expected = 0.001 * (at_ms - 10) as f64;
            let wanted = wanted(&receiver.sample(at_ms * MILLISECOND_NS));
            assert!((wanted - expected).abs() < 1e-9, "{wanted} for {expected}");
        }
    }

    #[test]
    fn a_chunk_without_room_is_an_error_and_leaves_nothing() {
        let (streamer, mut receiver) = channel();
        let chunk = positions(|_| 1.0, 300);
        assert_eq!(streamer.push_chunk(0, MILLISECOND_NS, &chunk), Err(ChannelError::Full));
        assert_eq!(receiver.sample(MILLISECOND_NS).wish, StreamWish::Awaited);
        streamer.push_chunk(0, MILLISECOND_NS, &chunk[..256]).unwrap();
        assert_eq!(streamer.push_chunk(0, MILLISECOND_NS, &chunk[..1]), Err(ChannelError::Full));
        receiver.sample(2 * MILLISECOND_NS);
        assert_eq!(receiver.look_ahead.counts().points, POINTS_PER_CYCLE as u64);
        streamer.push_chunk(0, MILLISECOND_NS, &chunk[..POINTS_PER_CYCLE]).unwrap();
    }
}
