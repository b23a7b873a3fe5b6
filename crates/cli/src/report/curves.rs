//! The curves of a recording, thinned so that they fit the width of a drawing: of the cycles in one column, the lowest and the highest
//! value are kept, so that a peak of a single cycle is visible in a run of an hour.

use std::ops::RangeInclusive;

use takt_rt::{AxisRecord, CycleRecord, CycleTiming, NANOSECONDS_PER_SECOND, Phase};

use takt::telemetry::{Recorded, RecordedError};

/// A time in seconds, and a value.
type Point = (f64, f64);

/// What is kept of the cycles in one column.
#[derive(Clone, Copy, Debug, Default)]
enum Column {
    /// There was no cycle.
    #[default]
    Empty,
    /// There were cycles without a value.
    Silent(f64),
    /// The lowest and the highest value.
    Extremes(Point, Point),
}

/// A curve of so many columns.
#[derive(Clone, Debug)]
pub struct Envelope(Vec<Column>);

impl Envelope {
    fn new(columns: usize) -> Self {
        Self(vec![Column::Empty; columns])
    }

    /// The curve of these points, which lie between two times.
    pub fn of(points: impl Iterator<Item = Point>, (from_s, to_s): (f64, f64), columns: usize) -> Self {
        let mut curve = Self::new(columns);
        for (at_s, value) in points {
            let part = if to_s > from_s { (at_s - from_s) / (to_s - from_s) } else { 0.0 };
            let column = (part * columns as f64) as usize;
            curve.add(column.min(columns.saturating_sub(1)), at_s, Some(value));
        }
        curve
    }

    fn add(&mut self, column: usize, at_s: f64, value: Option<f64>) {
        let Some(column) = self.0.get_mut(column) else { return };
        *column = match (*column, value.filter(|value| value.is_finite())) {
            (Column::Empty | Column::Silent(_), None) => Column::Silent(at_s),
            (kept @ Column::Extremes(..), None) => kept,
            (Column::Empty | Column::Silent(_), Some(value)) => {
                Column::Extremes((at_s, value), (at_s, value))
            }
            (Column::Extremes(low, high), Some(value)) => {
                let point = (at_s, value);
                Column::Extremes(
                    if value < low.1 { point } else { low },
                    if value > high.1 { point } else { high },
                )
            }
        };
    }

    /// The points in the order of time. Where there was no value, there is one that is not a number.
    pub fn points(&self, factor: f64) -> Vec<Point> {
        let mut points = Vec::new();
        for column in &self.0 {
            match *column {
                Column::Empty => {}
                Column::Silent(at_s) => points.push((at_s, f64::NAN)),
                Column::Extremes(low, high) => {
                    let (first, last) = if low.0 <= high.0 { (low, high) } else { (high, low) };
                    points.push((first.0, first.1 * factor));
                    if first.0 < last.0 {
                        points.push((last.0, last.1 * factor));
                    }
                }
            }
        }
        points
    }
}

/// The quantities of an axis that are drawn.
#[derive(Clone, Debug)]
pub struct AxisCurves {
    pub position_set: Envelope,
    pub position: Envelope,
    pub velocity_set: Envelope,
    pub velocity: Envelope,
    pub acceleration_set: Envelope,
    pub torque_set: Envelope,
    pub torque: Envelope,
    pub following_error: Envelope,
    /// The columns in which the drive has not reported, each with its times.
    silent: Vec<Option<(f64, f64)>>,
}

impl AxisCurves {
    fn new(columns: usize) -> Self {
        let curve = || Envelope::new(columns);
        Self {
            position_set: curve(),
            position: curve(),
            velocity_set: curve(),
            velocity: curve(),
            acceleration_set: curve(),
            torque_set: curve(),
            torque: curve(),
            following_error: curve(),
            silent: vec![None; columns],
        }
    }

    fn add(&mut self, column: usize, at_s: f64, axis: &AxisRecord) {
        let is_fresh = axis.feedback_age == 0;
        // In a cycle without feedback there is no point, and the curve has a gap.
        let reported = |value: f64| is_fresh.then_some(value);
        for (curve, value) in [
            (&mut self.position_set, Some(axis.position_set)),
            (&mut self.position, reported(axis.position)),
            (&mut self.velocity_set, Some(axis.velocity_set.into())),
            (&mut self.velocity, reported(axis.velocity.into())),
            (&mut self.acceleration_set, Some(axis.acceleration_set.into())),
            (&mut self.torque_set, Some(axis.torque_set.into())),
            (&mut self.torque, reported(axis.torque.into())),
            (&mut self.following_error, reported(axis.following_error.into())),
        ] {
            curve.add(column, at_s, value);
        }
        if let Some(silent) = self.silent.get_mut(column).filter(|_| !is_fresh) {
            *silent = Some(silent.map_or((at_s, at_s), |(from_s, _)| (from_s, at_s)));
        }
    }

    /// The times in which the drive has not reported, each from the first column to the one behind the last.
    pub fn silences(&self) -> Vec<(f64, f64)> {
        let mut silences: Vec<(f64, f64)> = Vec::new();
        let mut was_silent = false;
        for (silent, curve) in self.silent.iter().zip(&self.position_set.0) {
            match (silent, silences.last_mut().filter(|_| was_silent), curve) {
                (_, _, Column::Empty) => continue,
                (Some((_, to_s)), Some(silence), _) => silence.1 = *to_s,
                (Some(silent), None, _) => silences.push(*silent),
                (None, Some(silence), Column::Extremes(low, high)) => silence.1 = low.0.min(high.0),
                (None, ..) => {}
            }
            was_silent = silent.is_some();
        }
        silences
    }
}

/// What a group was doing for a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseSpan {
    pub phase: Phase,
    pub from_s: f64,
    pub to_s: f64,
}

/// All curves of a part of a recording.
#[derive(Debug)]
pub struct Curves {
    /// The first and the last cycle, in seconds.
    pub span_s: (f64, f64),
    /// In the order of the configuration.
    pub axes: Vec<AxisCurves>,
    /// Of each cycle, in ns.
    pub wake: Envelope,
    pub sync: Envelope,
    pub compute: Envelope,
    /// Of each group, in the order of time.
    pub phases: Vec<Vec<PhaseSpan>>,
}

impl Curves {
    /// Reads these slots into so many columns. Times count from the slot `zero`.
    pub fn read(
        recorded: &Recorded,
        slots: &RangeInclusive<u64>,
        zero: u64,
        columns: usize,
    ) -> Result<Self, RecordedError> {
        let count = slots.end().saturating_sub(*slots.start()) + 1;
        let columns = columns.min(usize::try_from(count).unwrap_or(usize::MAX)).max(1);
        let period_s = recorded.machine.cycle_ns.max(1) as f64 / NANOSECONDS_PER_SECOND as f64;
        let time_s = |slot: u64| (slot as f64 - zero as f64) * period_s;
        let mut curves = Self {
            span_s: (time_s(*slots.start()), time_s(*slots.end())),
            axes: recorded.machine.axes.iter().map(|_| AxisCurves::new(columns)).collect(),
            wake: Envelope::new(columns),
            sync: Envelope::new(columns),
            compute: Envelope::new(columns),
            phases: Vec::new(),
        };
        recorded.each_cycle(|record| {
            let slot = record.timing.slot;
            if slots.contains(&slot) {
                let column = u128::from(slot - slots.start()) * columns as u128 / u128::from(count);
                curves.add(usize::try_from(column).unwrap_or(usize::MAX), time_s(slot), period_s, record);
            }
        })?;
        Ok(curves)
    }

    fn add(&mut self, column: usize, at_s: f64, period_s: f64, record: &CycleRecord) {
        let CycleTiming { wake_ns, sync_ns, compute_ns, .. } = record.timing;
        self.wake.add(column, at_s, Some(wake_ns as f64));
        self.sync.add(column, at_s, Some(sync_ns as f64));
        self.compute.add(column, at_s, Some(compute_ns as f64));
        for (curves, axis) in self.axes.iter_mut().zip(record.axes()) {
            curves.add(column, at_s, axis);
        }
        self.phases.resize_with(self.phases.len().max(record.groups().len()), Vec::new);
        for (spans, group) in self.phases.iter_mut().zip(record.groups()) {
            let to_s = at_s + period_s;
            match spans.last_mut().filter(|last| last.phase == group.phase) {
                Some(last) => last.to_s = to_s,
                None => spans.push(PhaseSpan { phase: group.phase, from_s: at_s, to_s }),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_cycles_in_a_column_the_peaks_of_single_ones_are_kept_in_the_order_of_time() {
        let mut curve = Envelope::new(2);
        for cycle in 0..2000_u32 {
            let value = match cycle {
                700 => 50.0,
                300 => -9.0,
                _ => 1.0,
            };
            curve.add(cycle as usize / 1000, f64::from(cycle), Some(value));
        }
        assert_eq!(curve.points(2.0), [(300.0, -18.0), (700.0, 100.0), (1000.0, 2.0)]);
    }

    #[test]
    fn a_time_without_feedback_is_a_gap_and_one_without_cycles_is_not() {
        let mut curves = AxisCurves::new(6);
        let axis = |position, feedback_age| AxisRecord { position, feedback_age, ..AxisRecord::default() };
        for (column, age) in [(0, 0), (1, 1), (2, 2), (4, 0), (5, 0)] {
            curves.add(column, column as f64, &axis(7.0, age));
        }
        let (points, set) = (curves.position.points(1.0), curves.position_set.points(1.0));
        assert!(points.iter().map(|(_, value)| value.is_nan()).eq([false, true, true, false, false]));
        assert!(set.len() == 5 && set.iter().all(|(_, value)| value.is_finite()));
        assert_eq!(curves.silences(), [(1.0, 4.0)]);
    }
}
