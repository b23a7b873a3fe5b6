//! A log of every frame in the format of `candump -l`.

use std::io::{self, BufWriter, Write};

use takt_rt::Nanoseconds;
use takt_wire::bus_log::candump::CandumpLine;

use super::destination::Opened;
use super::history::OnBus;
use super::wall_clock::WallClock;
use crate::link::trace::{Trace, TracedFrame};

/// Frames wait this long before they are written, so that the log is in the order of time. Received frames are read some
/// time after their arrival, and the buses are read one after the other.
const REORDER_NS: Nanoseconds = 20_000_000;

/// A log that is being written.
pub struct CandumpLog {
    /// Its name in messages.
    pub label: String,
    writer: BufWriter<Box<dyn Write + Send>>,
    wall_clock: WallClock,
    waiting: Vec<(TracedFrame, usize)>,
}

impl CandumpLog {
    pub fn new(opened: Opened, wall_clock: WallClock) -> Self {
        let writer = BufWriter::new(opened.writer);
        Self { label: opened.label, writer, wall_clock, waiting: Vec::new() }
    }

    /// Adds a frame.
    pub fn add(&mut self, OnBus { bus, what }: &OnBus<TracedFrame>) {
        self.waiting.push((*what, *bus));
    }

    /// Writes the frames that have waited long enough.
    pub fn write(&mut self, traces: &[Trace]) -> io::Result<()> {
        self.waiting.sort_by_key(|(frame, _)| frame.at_ns);
        let newest_ns = self.waiting.last().map_or(0, |(frame, _)| frame.at_ns);
        self.write_until(newest_ns.saturating_sub(REORDER_NS), traces)
    }

    /// Writes the rest.
    pub fn finish(mut self, traces: &[Trace]) -> io::Result<()> {
        self.write(traces)?;
        self.write_until(Nanoseconds::MAX, traces)?;
        self.writer.flush()
    }

    fn write_until(&mut self, until_ns: Nanoseconds, traces: &[Trace]) -> io::Result<()> {
        let ready = self.waiting.partition_point(|(frame, _)| frame.at_ns <= until_ns);
        for (traced, bus) in self.waiting.drain(..ready) {
            let name = traces.get(bus).map_or("can", Trace::name);
            let unix_ns = self.wall_clock.unix_ns(traced.at_ns);
            writeln!(self.writer, "{}", CandumpLine { unix_ns, bus: name, frame: traced.frame })?;
        }
        Ok(())
    }
}
