//! The set-points that were commanded while a file was played: one row a cycle into a file, and the largest of their rates.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;
use takt_rt::{CycleRecord, Nanoseconds, Phase};

/// Cycles at rest that are kept after the end: a third difference has three more set-points before it.
const RESTING_ROWS: u32 = 3;

/// The largest rates of an axis, as the guard takes them: by the differences of the set-points from cycle to cycle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisMaxima {
    /// The name of the axis.
    pub name: String,
    /// rad/s (m/s)
    pub velocity_max: f64,
    /// rad/s² (m/s²)
    pub acceleration_max: f64,
    /// rad/s³ (m/s³)
    pub jerk_max: f64,
}

/// From when on set-points count. Set by whoever begins the motion.
#[derive(Clone, Debug)]
pub struct ArmedFrom {
    /// The first motion that begins in this slot or later counts.
    slot: Arc<AtomicU64>,
    /// Every set-point of a slot that begins at this time or later counts.
    time_ns: Arc<AtomicU64>,
}

impl Default for ArmedFrom {
    fn default() -> Self {
        let never = || Arc::new(AtomicU64::new(u64::MAX));
        Self { slot: never(), time_ns: never() }
    }
}

impl ArmedFrom {
    /// The next motion that begins in this slot or later counts.
    pub fn set(&self, slot: u64) {
        self.slot.store(slot, Ordering::Release);
    }

    /// Set-points of slots that begin at this time or later count; it is the time 0 of the rows.
    pub fn set_time(&self, time_ns: Nanoseconds) {
        self.time_ns.store(time_ns, Ordering::Release);
    }

    fn has_come(&self, slot: u64) -> bool {
        slot >= self.slot.load(Ordering::Acquire)
    }

    /// The time 0 of the rows, once a slot begins there or later.
    fn time_that_has_come(&self, slot_start_ns: Nanoseconds) -> Option<Nanoseconds> {
        let time_ns = self.time_ns.load(Ordering::Acquire);
        (slot_start_ns >= time_ns).then_some(time_ns)
    }
}

/// Takes the records of a run, one after the other.
pub struct SetPointLog {
    out: Option<Box<dyn Write + Send>>,
    failure: Option<io::Error>,
    armed: ArmedFrom,
    /// The time of the set-points from which the motion begins.
    begins_s: f64,
    period_s: f64,
    stage: LogStage,
    maxima: Vec<AxisMaxima>,
    /// The positions of the last three rows of each axis, the newest first.
    last: Vec<[f64; 3]>,
    /// The groups that play.
    groups: Vec<u8>,
}

/// Where the times of the rows begin.
#[derive(Clone, Copy)]
enum Zero {
    /// At the set-points of this slot, from which a motion began.
    Slot(u64),
    /// At this time.
    Time(Nanoseconds),
}

enum LogStage {
    /// The motion has not begun; the record of the last cycle.
    Waiting(Option<Box<CycleRecord>>),
    Playing(Zero),
    Resting(Zero, u32),
    Over,
}

impl SetPointLog {
    /// A log for axes with these names. `begins_s` is the time of the set-points from which the motion begins.
    pub fn new(
        axes: &[String],
        period_ns: u64,
        begins_s: f64,
        armed: ArmedFrom,
        out: Option<Box<dyn Write + Send>>,
    ) -> Self {
        let maxima = axes.iter().map(|name| AxisMaxima {
            name: name.clone(),
            velocity_max: 0.0,
            acceleration_max: 0.0,
            jerk_max: 0.0,
        });
        let mut log = Self {
            out,
            failure: None,
            armed,
            begins_s,
            period_s: period_ns as f64 / 1e9,
            stage: LogStage::Waiting(None),
            maxima: maxima.collect(),
            last: Vec::new(),
            groups: vec![0],
        };
        let columns = ["", ".velocity", ".acceleration"]
            .iter()
            .flat_map(|suffix| axes.iter().map(move |axis| quoted(&format!("{axis}{suffix}"))));
        let header = ["t".to_owned()].into_iter().chain(columns).collect::<Vec<_>>().join(",");
        log.write(&header);
        log
    }

    /// A log that begins and ends with the motion of these groups, and not with that of the first one.
    pub fn of_groups(self, groups: impl Iterator<Item = u8>) -> Self {
        Self { groups: groups.collect(), ..self }
    }

    /// Returns `true` if every group that plays is in such a phase.
    fn are_all(&self, record: &CycleRecord, is_such: impl Fn(Phase) -> bool) -> bool {
        let mut own = self.groups.iter().filter_map(|group| record.groups.get(usize::from(*group)));
        own.all(|group| is_such(group.phase))
    }

    /// Takes the record of the next cycle. Set-points that were not sent leave no row.
    pub fn add(&mut self, record: &CycleRecord) {
        if !record.is_commanded {
            return;
        }
        let (slot, slot_start_ns) = (record.timing.slot, record.timing.slot_start_ns);
        let is_holding = |phase| phase == Phase::Holding;
        let is_moved = |phase| matches!(phase, Phase::Moving | Phase::Streaming | Phase::Stopping);
        let is_at_rest = self.are_all(record, is_holding);
        let is_in_motion = !self.are_all(record, |phase| !is_moved(phase));
        let is_over = !self
            .are_all(record, |phase| is_moved(phase) || matches!(phase, Phase::Holding | Phase::Disabling));
        let was_at_rest = match &self.stage {
            LogStage::Waiting(Some(last)) => self.are_all(last, is_holding),
            _ => false,
        };
        match &mut self.stage {
            LogStage::Waiting(last) => {
                if let Some(time_ns) = self.armed.time_that_has_come(slot_start_ns) {
                    let zero = Zero::Time(time_ns);
                    self.stage = LogStage::Playing(zero);
                    return self.row(record, zero);
                }
                if let Some(first) = last
                    .as_ref()
                    .filter(|_| was_at_rest)
                    .filter(|_| is_in_motion && self.armed.has_come(slot))
                {
                    let zero = Zero::Slot(slot.saturating_sub(1));
                    let mut first = first.clone();
                    first.timing.slot = slot.saturating_sub(1);
                    self.stage = LogStage::Playing(zero);
                    self.row(&first, zero);
                    self.row(record, zero);
                } else {
                    *last = Some(Box::new(*record));
                }
            }
            LogStage::Playing(zero) => {
                let zero = *zero;
                if is_at_rest {
                    self.stage = LogStage::Resting(zero, 0);
                } else if !is_in_motion && is_over {
                    self.stage = LogStage::Over;
                    return;
                }
                self.row(record, zero);
            }
            LogStage::Resting(zero, rows) => {
                let (zero, rows) = (*zero, *rows + 1);
                self.stage = LogStage::Resting(zero, rows);
                if is_at_rest {
                    self.row(record, zero);
                }
                if !is_at_rest || rows >= RESTING_ROWS {
                    self.stage = LogStage::Over;
                }
            }
            LogStage::Over => {}
        }
    }

    /// Returns `true` if the motion has ended, and all of it is here.
    pub fn is_over(&self) -> bool {
        matches!(self.stage, LogStage::Over)
    }

    /// The largest rates, and the first error of writing.
    pub fn finish(mut self) -> (Vec<AxisMaxima>, Option<io::Error>) {
        if let Some(out) = &mut self.out
            && let Err(error) = out.flush()
        {
            self.failure.get_or_insert(error);
        }
        (self.maxima, self.failure)
    }

    fn row(&mut self, record: &CycleRecord, zero: Zero) {
        let axes = record.axes();
        if self.last.is_empty() {
            // The motion begins from rest.
            self.last = axes.iter().map(|axis| [axis.position_set; 3]).collect();
        }
        let period_s = self.period_s;
        for ((axis, last), maxima) in axes.iter().zip(&mut self.last).zip(&mut self.maxima) {
            let (next, [p0, p1, p2]) = (axis.position_set, *last);
            let largest = |most: &mut f64, value: f64| *most = most.max(value.abs());
            largest(&mut maxima.velocity_max, (next - p0) / period_s);
            largest(&mut maxima.acceleration_max, (next - 2.0 * p0 + p1) / (period_s * period_s));
            largest(&mut maxima.jerk_max, (next - 3.0 * (p0 - p1) - p2) / (period_s * period_s * period_s));
            *last = [next, p0, p1];
        }
        if self.out.is_none() {
            return;
        }
        let at_s = match zero {
            Zero::Slot(slot) => self.begins_s + record.timing.slot.saturating_sub(slot) as f64 * period_s,
            Zero::Time(time_ns) => record.timing.slot_start_ns.saturating_sub(time_ns) as f64 / 1e9,
        };
        let mut line = format!("{at_s:.9}");
        for axis in axes {
            line += &format!(",{}", axis.position_set);
        }
        for rate in
            axes.iter().map(|axis| axis.velocity_set).chain(axes.iter().map(|axis| axis.acceleration_set))
        {
            line += &format!(",{rate}");
        }
        self.write(&line);
    }

    /// Writes a line; after a failure, none.
    fn write(&mut self, line: &str) {
        if self.failure.is_some() {
            return;
        }
        if let Some(out) = &mut self.out {
            self.failure = writeln!(out, "{line}").err();
        }
    }
}

/// A name as a cell.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn record(slot: u64, phase: Phase, position: f64) -> CycleRecord {
        let mut record = CycleRecord { is_commanded: true, axis_count: 1, ..CycleRecord::default() };
        record.groups[0].phase = phase;
        record.timing.slot = slot;
        record.axes[0].position_set = position;
        record
    }

    #[test]
    fn the_motion_that_begins_when_armed_is_kept_with_the_rest_on_both_sides() {
        let (out, armed) = (Shared::default(), ArmedFrom::default());
        let sink: Box<dyn Write + Send> = Box::new(out.clone());
        let mut log = SetPointLog::new(&["a,b".to_owned()], 1_000_000, 2.0, armed.clone(), Some(sink));
        // The way to the first point is not kept.
        log.add(&record(1, Phase::Holding, 0.0));
        log.add(&record(2, Phase::Moving, 0.5));
        log.add(&record(3, Phase::Holding, 1.0));
        armed.set(4);
        log.add(&record(4, Phase::Holding, 1.0));
        log.add(&record(5, Phase::Moving, 1.001));
        log.add(&CycleRecord { is_commanded: false, ..record(6, Phase::Moving, 9.0) });
        log.add(&record(7, Phase::Moving, 1.003));
        (8..20).for_each(|slot| log.add(&record(slot, Phase::Holding, 1.003)));
        assert!(log.is_over());
        let (maxima, failure) = log.finish();
        assert!(failure.is_none());
        let close = |value: f64, expected: f64| (value - expected).abs() < 1e-6 * expected;
        assert!(close(maxima[0].velocity_max, 2.0) && close(maxima[0].acceleration_max, 2_000.0));
        assert!(close(maxima[0].jerk_max, 3e6), "{}", maxima[0].jerk_max);
        let text = String::from_utf8(out.0.lock().unwrap().clone()).unwrap();
        let expected = "t,\"a,b\",\"a,b.velocity\",\"a,b.acceleration\"\n2.000000000,1,0,0\n2.001000000,1.001,0,0\n\
            2.003000000,1.003,0,0\n2.004000000,1.003,0,0\n2.005000000,1.003,0,0\n2.006000000,1.003,0,0\n\
            2.007000000,1.003,0,0\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_told_in_the_end() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::Error::other("no space"))
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let log = SetPointLog::new(&[], 1_000_000, 0.0, ArmedFrom::default(), Some(Box::new(Full)));
        assert_eq!(log.finish().1.unwrap().to_string(), "no space");
    }
}
