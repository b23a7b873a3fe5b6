//! The points of a stream in the order of their stamps, and what they want at a time.

#[cfg(feature = "checkpoint")]
mod checkpoint;

use arrayvec::ArrayVec;

use super::axis_piece::{AxisPiece, IntervalTime};
use super::delay::{DelayEstimator, StreamDelay};
use super::interpolation::{BEGIN, WINDOW, Window};
use super::target::{AxisPoint, AxisTarget, PointRole, StreamCounts, StreamPoint, StreamSample, StreamWish};
use crate::capacity::MAX_AXES;
use crate::guard::AxisLimits;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// The most points that a [`LookAhead`] can hold.
pub const POINTS_AT_MOST: usize = 512;

/// A point that is meant for a time so far ahead, or so long ago, is not meant.
const FARTHEST_NS: u64 = 60 * NANOSECONDS_PER_SECOND;
/// Points before the present ones that the motion between these depends on.
const PAST_POINTS: usize = 2;
/// So many more may be there before they are removed together.
const PAST_POINTS_KEPT: usize = 8;
/// Behind its last point a motion goes on at its velocity for one interval, but no longer than this.
const COASTING_NS: i64 = 100_000_000;
/// A stream that has run dry for more intervals than this begins anew with the next point.
const PAUSE_INTERVALS: i64 = 4;
/// As [`PAUSE_INTERVALS`], in time: both have to have passed.
const PAUSE_NS: i64 = 100_000_000;
/// After a single point the next one is waited for so long before the stream counts as dry.
const SINGLE_POINT_NS: u64 = 500_000_000;

/// What does not change while a [`LookAhead`] is used.
#[derive(Clone, Debug)]
pub struct LookAheadParameters<const AXES: usize = MAX_AXES> {
    /// The limits of the axes that count. Points that ask for more are led to, and not along the motion between them. Without
    /// limits, they are followed to the letter.
    pub limits: ArrayVec<AxisLimits, AXES>,
    /// The period of the slots in which it is sampled.
    pub period_ns: Nanoseconds,
    /// How far behind the stamps it runs.
    pub delay: StreamDelay,
}

impl<const AXES: usize> Default for LookAheadParameters<AXES> {
    /// Of no axes, sampled once in a millisecond.
    fn default() -> Self {
        let period_ns = NANOSECONDS_PER_SECOND / 1000;
        Self { limits: ArrayVec::new(), period_ns, delay: StreamDelay::Automatic }
    }
}

/// Why a point cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointError {
    /// A number of it is not finite.
    NotFinite {
        /// The axis.
        axis: u8,
    },
    /// It is meant for a time more than a minute from now.
    FarAway,
    /// It has come so late that nothing depends on it any more, or so long after its time that no motion begins with it.
    Late,
    /// There is no room, and it is the farthest of all.
    Full,
}

impl core::error::Error for PointError {}

impl core::fmt::Display for PointError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite { axis } => write!(f, "a number for axis {axis} is not finite"),
            Self::FarAway => f.write_str("the point is meant for a time more than a minute from now"),
            Self::Late => f.write_str("the point has come after everything that depends on it"),
            Self::Full => f.write_str("there is no room for a point so far ahead"),
        }
    }
}

/// Where a stream is among its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
enum Playback {
    /// No point has come.
    Awaited,
    /// The axes are led to the first point, and wait there for its time.
    Leading,
    /// The axes follow the points.
    Following,
    /// The points have run out.
    Dry,
}

/// The points of a stream, in whatever order they have come. [`LookAhead::sample`] says what they want in a slot.
///
/// `P` is the storage: a slice, an array or a box of points. At most [`POINTS_AT_MOST`] of them are used.
///
/// ```
/// use takt_rt::{AxisLimits, AxisPoint, AxisTarget, LookAhead, LookAheadParameters, StreamDelay, StreamPoint, StreamSample, StreamWish};
///
/// let limits = [AxisLimits::NONE].into_iter().collect();
/// let parameters = LookAheadParameters { limits, period_ns: 1_000_000, delay: StreamDelay::Fixed(40_000_000) };
/// let mut stream = LookAhead::<1, _>::new([StreamPoint::default(); 64], parameters);
/// for number in 0..20 {
///     // 0.1 rad/s, every 10 ms.
///     let axes = [AxisPoint::position(0.001 * f64::from(number))];
///     let point = StreamPoint { at_ns: 10_000_000 * number as u64, axes, ..StreamPoint::default() };
///     stream.insert(&point, 0).unwrap();
/// }
/// let mut sample = StreamSample::default();
/// stream.sample(145_000_000, &mut sample);
/// let StreamWish::Targets([AxisTarget::Position { state: wanted, .. }]) = sample.wish else { panic!() };
/// assert!((wanted.position - 0.0105).abs() < 1e-12 && (wanted.velocity - 0.1).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct LookAhead<const AXES: usize, P> {
    points: P,
    /// The stamps of the points, in their order.
    stamps_ns: [Nanoseconds; POINTS_AT_MOST],
    /// In which place of the storage each of them is; behind those that are used, the free places.
    places: [u16; POINTS_AT_MOST],
    count: usize,
    capacity: usize,
    limits: ArrayVec<AxisLimits, AXES>,
    delay: DelayEstimator,
    playback: Playback,
    /// The time of the last sample.
    sampled_ns: Option<Nanoseconds>,
    /// When the last point came.
    arrived_ns: Nanoseconds,
    /// When the last arrival was that was looked at for how late points come.
    judged_ns: Option<Nanoseconds>,
    /// The stamp of the last point of a chunk that is not complete.
    open_chunk_ns: Option<Nanoseconds>,
    counts: StreamCounts,
    /// How often the points have changed.
    revision: u64,
    /// The motions of the present interval, and for what they were made: the points, and the beginning of the interval.
    pieces: [AxisPiece; AXES],
    pieces_of: Option<(u64, Nanoseconds)>,
}

impl<const AXES: usize, P> LookAhead<AXES, P>
where
    P: AsRef<[StreamPoint<AXES>]> + AsMut<[StreamPoint<AXES>]>,
{
    /// One without points. What is in the storage does not matter.
    pub fn new(points: P, parameters: LookAheadParameters<AXES>) -> Self {
        let capacity = points.as_ref().len().min(POINTS_AT_MOST);
        Self {
            points,
            stamps_ns: [0; POINTS_AT_MOST],
            places: core::array::from_fn(|place| place as u16),
            count: 0,
            capacity,
            limits: parameters.limits,
            delay: DelayEstimator::new(parameters.period_ns, parameters.delay),
            playback: Playback::Awaited,
            sampled_ns: None,
            arrived_ns: 0,
            judged_ns: None,
            open_chunk_ns: None,
            counts: StreamCounts::default(),
            revision: 0,
            pieces: [AxisPiece::default(); AXES],
            pieces_of: None,
        }
    }

    /// A stream begins: forgets the one before it.
    pub fn begin(&mut self) {
        self.count = 0;
        self.revision += 1;
        self.delay.restart();
        self.playback = Playback::Awaited;
        (self.sampled_ns, self.judged_ns, self.open_chunk_ns) = (None, None, None);
        self.counts = StreamCounts::default();
    }

    /// How the stream has gone so far.
    pub fn counts(&self) -> StreamCounts {
        StreamCounts { lag_ns: self.delay.present_ns(), ..self.counts }
    }

    fn stamps(&self) -> &[Nanoseconds] {
        self.stamps_ns.get(..self.count).unwrap_or_default()
    }

    fn stamp(&self, index: usize) -> Nanoseconds {
        self.stamps_ns.get(index).copied().unwrap_or(0)
    }

    fn last_stamp(&self) -> Option<Nanoseconds> {
        self.stamps().last().copied()
    }

    fn point(&self, index: usize) -> Option<&StreamPoint<AXES>> {
        let place = self.places.get(index).copied()?;
        self.points.as_ref().get(usize::from(place))
    }

    /// The time of the points that stands for a time of the slots.
    fn play_time(&self, at_ns: Nanoseconds) -> Nanoseconds {
        at_ns.saturating_sub(self.delay.present_ns())
    }

    /// Takes a point that has come at this time. Points may come in any order; times may not go back.
    ///
    /// # Errors
    /// Why it is of no use. It is counted then, and nothing else has changed.
    pub fn insert(&mut self, point: &StreamPoint<AXES>, now_ns: Nanoseconds) -> Result<(), PointError> {
        let result = self.try_insert(point, now_ns);
        self.counts.points += 1;
        match result {
            Ok(()) => {}
            Err(PointError::Late) => self.counts.late_points += 1,
            Err(_) => self.counts.lost_points += 1,
        }
        result
    }

    fn try_insert(&mut self, point: &StreamPoint<AXES>, now_ns: Nanoseconds) -> Result<(), PointError> {
        if let Some(axis) = point.axes.iter().take(self.limits.len()).position(|axis| !axis.is_finite()) {
            return Err(PointError::NotFinite { axis: axis as u8 });
        }
        let stamp_ns = point.at_ns;
        if stamp_ns.abs_diff(now_ns) > FARTHEST_NS {
            return Err(PointError::FarAway);
        }
        let age_ns = now_ns.saturating_sub(stamp_ns);
        let is_beginning = self.begins_with(stamp_ns);
        if is_beginning && age_ns > self.delay.longest_ns() {
            return Err(PointError::Late);
        }
        self.note_arrival(point, now_ns);
        self.begin_after_pause(is_beginning, stamp_ns, now_ns);
        let played_ns = self.play_time(now_ns);
        let mut index = self.stamps().partition_point(|stamp| *stamp < stamp_ns);
        let is_late = stamp_ns < played_ns && self.playback != Playback::Awaited;
        let present = self.stamps().partition_point(|stamp| *stamp <= played_ns);
        if is_late && index + 1 < present && self.playback == Playback::Following {
            self.go_on_with_chunk(point, index);
            return Err(PointError::Late);
        }
        index = self.go_on_with_chunk(point, index);
        if self.stamps().get(index) == Some(&stamp_ns) {
            self.put(index, point);
        } else {
            self.make_room(index)?;
            self.put_new(index, point);
            self.note_interval(index);
        }
        self.counts.late_points += u64::from(is_late);
        self.arrived_ns = now_ns;
        if self.playback == Playback::Awaited {
            self.playback = Playback::Leading;
        }
        Ok(())
    }

    /// Removes what a chunk takes the place of up to this point of it. Returns the index for the point.
    fn go_on_with_chunk(&mut self, point: &StreamPoint<AXES>, index: usize) -> usize {
        let PointRole::Chunk { is_first, is_last } = point.role else { return index };
        let mut index = index;
        if let (Some(before_ns), false) = (self.open_chunk_ns, is_first) {
            let from = self.stamps().partition_point(|stamp| *stamp <= before_ns);
            self.remove(from, index);
            index = from.min(index);
        }
        if is_last {
            self.remove(index, self.count);
        }
        self.open_chunk_ns = (!is_last).then_some(point.at_ns);
        index
    }

    /// Learns from an arrival how late points come. Those of one chunk come together, and so do those of one slot.
    fn note_arrival(&mut self, point: &StreamPoint<AXES>, now_ns: Nanoseconds) {
        let is_inside = matches!(point.role, PointRole::Chunk { is_first: false, .. });
        if is_inside || self.judged_ns.replace(now_ns) == Some(now_ns) {
            return;
        }
        let Some(last_ns) = self.last_stamp() else { return };
        let is_chunk = matches!(point.role, PointRole::Chunk { .. });
        if point.at_ns <= last_ns && !is_chunk {
            return;
        }
        let apart = |from_ns: u64, to_ns: u64| to_ns.wrapping_sub(from_ns) as i64;
        let interval_ns = match self.delay.interval_ns() {
            0 => apart(last_ns, point.at_ns).max(0),
            known => known,
        };
        // Whoever has paused is not late.
        let late_ns = apart(point.at_ns, now_ns).saturating_add(interval_ns);
        let behind_ns = apart(last_ns, now_ns);
        if self.delay.interval_ns() == 0 {
            self.delay.note_interval(interval_ns);
        }
        self.delay.note_arrival(behind_ns.min(late_ns));
    }

    fn note_interval(&mut self, index: usize) {
        let is_farthest = index + 1 == self.count;
        if let (true, Some(before)) = (is_farthest, index.checked_sub(1)) {
            self.delay.note_interval(self.stamp(index).saturating_sub(self.stamp(before)) as i64);
        }
    }

    /// True if the motion begins with a point of this stamp: no point has come before, or none for a long time.
    fn begins_with(&self, stamp_ns: Nanoseconds) -> bool {
        match self.playback {
            Playback::Awaited => true,
            Playback::Leading | Playback::Following => false,
            Playback::Dry => self.last_stamp().is_none_or(|last_ns| {
                let pause_ns = self.delay.interval_ns().saturating_mul(PAUSE_INTERVALS).max(PAUSE_NS);
                stamp_ns.saturating_sub(last_ns) > pause_ns.unsigned_abs()
            }),
        }
    }

    /// What had been played before a pause has nothing to do with what comes after it.
    fn begin_after_pause(&mut self, is_beginning: bool, stamp_ns: Nanoseconds, now_ns: Nanoseconds) {
        if self.playback != Playback::Dry {
            return;
        }
        self.delay.settle();
        if is_beginning {
            self.remove(0, self.count);
            self.playback = Playback::Leading;
        } else if self.last_stamp().is_some_and(|last_ns| stamp_ns > last_ns)
            && self.play_time(now_ns) < stamp_ns
        {
            self.playback = Playback::Following;
        }
    }

    /// Room for a point at this index, if need be in place of the farthest one.
    fn make_room(&mut self, index: usize) -> Result<(), PointError> {
        if self.count < self.capacity {
            return Ok(());
        }
        if index >= self.count {
            return Err(PointError::Full);
        }
        self.count -= 1;
        self.revision += 1;
        self.counts.lost_points += 1;
        Ok(())
    }

    fn put(&mut self, index: usize, point: &StreamPoint<AXES>) {
        self.revision += 1;
        let Some(place) = self.places.get(index).copied() else { return };
        if let Some(kept) = self.points.as_mut().get_mut(usize::from(place)) {
            (kept.at_ns, kept.role) = (point.at_ns, point.role);
            // A point has room for many more axes than most groups have.
            for (to, from) in kept.axes.iter_mut().zip(&point.axes).take(self.limits.len()) {
                *to = *from;
            }
        }
    }

    fn put_new(&mut self, index: usize, point: &StreamPoint<AXES>) {
        let end = self.count + 1;
        if let (Some(places), Some(stamps)) =
            (self.places.get_mut(index..end), self.stamps_ns.get_mut(index..end))
        {
            // The first free place comes to the index.
            places.rotate_right(1);
            stamps.rotate_right(1);
            if let Some(stamp) = stamps.first_mut() {
                *stamp = point.at_ns;
            }
            self.count = end;
            self.put(index, point);
        }
    }

    /// Removes the points with these indices.
    fn remove(&mut self, from: usize, to: usize) {
        if from >= to || to > self.count {
            return;
        }
        self.revision += 1;
        if let (Some(places), Some(stamps)) =
            (self.places.get_mut(from..self.count), self.stamps_ns.get_mut(from..self.count))
        {
            places.rotate_left(to - from);
            stamps.rotate_left(to - from);
            self.count -= to - from;
        }
    }

    /// Writes what the points want of every axis in the slot of this time. Ask for it once a slot: time goes on with it. Of axes that
    /// the stream does not have, nothing is written.
    pub fn sample(&mut self, at_ns: Nanoseconds, sample: &mut StreamSample<AXES>) {
        let elapsed_ns = self.sampled_ns.map_or(0, |last_ns| at_ns.saturating_sub(last_ns));
        self.sampled_ns = Some(at_ns);
        match self.playback {
            Playback::Following => self.delay.advance(elapsed_ns),
            Playback::Awaited | Playback::Leading | Playback::Dry => self.delay.settle(),
        }
        sample.counts = self.counts();
        self.put_wish(at_ns, &mut sample.wish);
    }

    fn put_wish(&mut self, at_ns: Nanoseconds, wish: &mut StreamWish<AXES>) {
        let (Some(first_ns), Some(last_ns)) = (self.stamps().first().copied(), self.last_stamp()) else {
            *wish = StreamWish::Awaited;
            return;
        };
        let played_ns = self.play_time(at_ns);
        if self.playback == Playback::Leading && (self.count == 1 || played_ns <= first_ns) {
            let is_alone = self.count == 1;
            let waited_ns = at_ns.saturating_sub(self.arrived_ns.max(first_ns));
            if is_alone && waited_ns > SINGLE_POINT_NS {
                self.playback = Playback::Dry;
                wish.put_dry(|targets| self.put_at_rest(0, targets));
            } else {
                wish.put_targets(|targets| self.put_at_rest(0, targets));
            }
            return;
        }
        let coasting_ns = self.delay.interval_ns().min(COASTING_NS).unsigned_abs();
        if played_ns > last_ns.saturating_add(coasting_ns) || self.count == 1 {
            self.playback = Playback::Dry;
        }
        if self.playback == Playback::Dry {
            wish.put_dry(|targets| self.put_at_rest(self.count - 1, targets));
        } else {
            self.playback = Playback::Following;
            wish.put_targets(|targets| self.put_interpolated(played_ns, targets));
        }
    }

    fn put_at_rest(&self, index: usize, targets: &mut [AxisTarget; AXES]) {
        let Some(point) = self.point(index) else { return };
        for (target, axis) in targets.iter_mut().zip(&point.axes).take(self.limits.len()) {
            *target = axis.at_rest();
        }
    }

    /// The motion between the points at a time, or behind the last one.
    fn put_interpolated(&mut self, played_ns: Nanoseconds, targets: &mut [AxisTarget; AXES]) {
        let behind = self.stamps().partition_point(|stamp| *stamp <= played_ns);
        // From the last but one on there is nothing behind the interval.
        let begin = behind.saturating_sub(1).min(self.count.saturating_sub(2));
        let begin = self.forget_past(begin);
        let begin_ns = self.stamp(begin);
        if self.pieces_of != Some((self.revision, begin_ns)) {
            self.update_pieces(begin);
            self.pieces_of = Some((self.revision, begin_ns));
        }
        let seconds = |duration_ns: u64| duration_ns as i64 as f64 / NANOSECONDS_PER_SECOND as f64;
        let time = IntervalTime {
            since_begin_s: seconds(played_ns.wrapping_sub(begin_ns)),
            rate: 1.0 / seconds(self.stamp(begin + 1).wrapping_sub(begin_ns)),
            time_rate: self.delay.time_rate(),
        };
        for (target, (piece, limits)) in targets.iter_mut().zip(self.pieces.iter().zip(&self.limits)) {
            *target = piece.target(&time, limits);
        }
    }

    /// Makes the motions of the interval that begins with this point.
    fn update_pieces(&mut self, begin: usize) {
        let mut stamps_ns = [0; WINDOW];
        let mut places = [0; WINDOW];
        let (mut from, mut to) = (WINDOW, 0);
        for (place, (stamp_ns, of_storage)) in stamps_ns.iter_mut().zip(&mut places).enumerate() {
            let Some(index) = (begin + place).checked_sub(BEGIN).filter(|index| *index < self.count) else {
                continue;
            };
            *stamp_ns = self.stamp(index);
            *of_storage = self.places.get(index).copied().map_or(0, usize::from);
            (from, to) = (from.min(place), place + 1);
        }
        let window = Window::new(&stamps_ns, from, to);
        let storage = self.points.as_ref();
        let unknown = AxisPoint::default();
        for (axis, (piece, limits)) in self.pieces.iter_mut().zip(&self.limits).enumerate() {
            let points = places.map(|place| {
                let point = storage.get(place).and_then(|point| point.axes.get(axis));
                point.unwrap_or(&unknown)
            });
            *piece = AxisPiece::new(&window, &points, limits);
        }
    }

    /// Removes the points that nothing depends on any more. Returns the new index of the present one.
    fn forget_past(&mut self, present: usize) -> usize {
        let past = present.saturating_sub(PAST_POINTS);
        if past < PAST_POINTS_KEPT && self.count < self.capacity {
            return present;
        }
        // The motion of the present interval stays as it is.
        let revision = self.revision;
        self.remove(0, past);
        self.revision = revision;
        present - past
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::AxisPoint;

    const MILLISECOND_NS: u64 = 1_000_000;

    fn look_ahead(capacity: usize) -> LookAhead<1, [StreamPoint<1>; 8]> {
        let parameters = LookAheadParameters {
            limits: [AxisLimits::NONE].into_iter().collect(),
            period_ns: MILLISECOND_NS,
            delay: StreamDelay::Fixed(0),
        };
        let mut look_ahead = LookAhead::new([StreamPoint::default(); 8], parameters);
        look_ahead.capacity = capacity;
        look_ahead
    }

    fn point(at_ms: u64, position: f64) -> StreamPoint<1> {
        let axes = [AxisPoint::position(position)];
        StreamPoint { at_ns: at_ms * MILLISECOND_NS, role: PointRole::Single, axes }
    }

    fn stamps_ms(look_ahead: &LookAhead<1, [StreamPoint<1>; 8]>) -> impl Iterator<Item = (u64, f64)> + '_ {
        (0..look_ahead.count).map(|index| {
            let point = look_ahead.point(index).unwrap();
            assert_eq!(point.at_ns, look_ahead.stamp(index));
            (point.at_ns / MILLISECOND_NS, point.axes[0].position_point().unwrap().position)
        })
    }

    #[test]
    fn points_stand_in_the_order_of_their_stamps_and_the_last_one_of_a_stamp_counts() {
        let mut look_ahead = look_ahead(8);
        for (at_ms, position) in [(30, 3.0), (10, 1.0), (20, 2.0), (40, 4.0), (20, 2.5)] {
            assert_eq!(look_ahead.insert(&point(at_ms, position), 0), Ok(()));
        }
        assert!(stamps_ms(&look_ahead).eq([(10, 1.0), (20, 2.5), (30, 3.0), (40, 4.0)]));
    }

    #[test]
    fn without_room_the_farthest_point_is_the_one_that_is_lost() {
        let mut look_ahead = look_ahead(3);
        for at_ms in [10, 20, 30] {
            look_ahead.insert(&point(at_ms, 0.0), 0).unwrap();
        }
        assert_eq!(look_ahead.insert(&point(40, 0.0), 0), Err(PointError::Full));
        assert_eq!(look_ahead.insert(&point(15, 0.0), 0), Ok(()));
        assert!(stamps_ms(&look_ahead).map(|(at_ms, _)| at_ms).eq([10, 15, 20]));
        assert_eq!(look_ahead.counts().lost_points, 2);
    }

    #[test]
    fn a_chunk_takes_the_place_of_what_came_before_from_its_first_stamp_on() {
        let mut look_ahead = look_ahead(8);
        for at_ms in [10, 20, 30, 40, 50] {
            look_ahead.insert(&point(at_ms, 1.0), 0).unwrap();
        }
        for (at_ms, is_first, is_last) in [(25, true, false), (35, false, false), (45, false, true)] {
            let role = PointRole::Chunk { is_first, is_last };
            look_ahead.insert(&StreamPoint { role, ..point(at_ms, 2.0) }, 0).unwrap();
        }
        let expected = [(10, 1.0), (20, 1.0), (25, 2.0), (35, 2.0), (45, 2.0)];
        assert!(stamps_ms(&look_ahead).eq(expected), "{:?}", look_ahead.stamps());
    }

    #[test]
    fn a_motion_begins_with_no_point_that_is_older_than_its_stream_can_lag() {
        for (delay, longest_ms) in [
            (StreamDelay::Fixed(0), 1),
            (StreamDelay::Fixed(40 * MILLISECOND_NS), 41),
            (StreamDelay::Automatic, 1_001),
        ] {
            let parameters = LookAheadParameters {
                limits: [AxisLimits::NONE].into_iter().collect(),
                period_ns: MILLISECOND_NS,
                delay,
            };
            let mut look_ahead = LookAhead::<1, _>::new([StreamPoint::default(); 8], parameters);
            let mut sample = StreamSample::default();
            // At first, and after a pause in which the stream has run dry.
            for now_ms in [20_000, 30_000] {
                let before = look_ahead.counts();
                let mut insert = |at_ms| look_ahead.insert(&point(at_ms, 1.0), now_ms * MILLISECOND_NS);
                assert_eq!(insert(now_ms - 8_000), Err(PointError::Late), "{delay:?}");
                assert_eq!(insert(now_ms - longest_ms - 1), Err(PointError::Late), "{delay:?}");
                look_ahead.sample(now_ms * MILLISECOND_NS, &mut sample);
                assert!(!matches!(sample.wish, StreamWish::Targets(_)), "{delay:?}: {:?}", sample.wish);
                assert_eq!(look_ahead.counts().late_points, before.late_points + 2);
                let now_ns = now_ms * MILLISECOND_NS;
                assert_eq!(look_ahead.insert(&point(now_ms - longest_ms, 1.0), now_ns), Ok(()), "{delay:?}");
                look_ahead.sample(now_ns, &mut sample);
                assert!(matches!(sample.wish, StreamWish::Targets(_)), "{delay:?}: {:?}", sample.wish);
                look_ahead.sample(now_ns + 2_000 * MILLISECOND_NS, &mut sample);
            }
        }
    }

    #[test]
    fn what_cannot_be_used_is_counted_and_changes_nothing() {
        let mut look_ahead = look_ahead(8);
        look_ahead.insert(&point(10, 1.0), 0).unwrap();
        assert_eq!(look_ahead.insert(&point(20, f64::NAN), 0), Err(PointError::NotFinite { axis: 0 }));
        assert_eq!(look_ahead.insert(&point(90_000, 1.0), 0), Err(PointError::FarAway));
        assert!(stamps_ms(&look_ahead).eq([(10, 1.0)]));
        assert_eq!((look_ahead.counts().points, look_ahead.counts().lost_points), (3, 2));
    }
}
