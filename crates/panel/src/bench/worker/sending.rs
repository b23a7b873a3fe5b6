//! Free frames, and what is heard on a bus.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};
use takt_wire::bus_log::frame_text;

use super::super::interruption::Interruption;
use super::super::told::Torque;
use super::place::{BenchBus, BenchLink};
use super::watcher::keep;
use super::{POLL, PageNumber, Worker};
use takt::words;
use takt::words::Words;

/// How long drives are listened to before a frame is sent, as `takt send` does.
const TORQUE_NS: Nanoseconds = 300_000_000;
/// Batches that are read from a bus in one look.
const BATCHES: usize = 32;

impl Worker {
    /// Reads what has come on a bus. Returns who has shown torque.
    pub(super) fn listen(&mut self, number: usize) -> Option<String> {
        let bench = Arc::clone(&self.bench);
        let mut enabled = None;
        let BenchBus { link: BenchLink::Bus(port), decoder, .. } = self.place.buses.get_mut(number)? else {
            return None;
        };
        let mut clock = MonotonicClock::default();
        for _ in 0..BATCHES {
            let mut batch = ReceiveBatch::new();
            port.receive(clock.now_ns(), &mut batch);
            for received in &batch {
                enabled = keep(&bench, number, decoder, '<', &received.frame).or(enabled);
            }
            if !batch.is_full() {
                break;
            }
        }
        enabled
    }

    /// Sends a frame so many times, unless a drive has torque.
    pub(super) fn send(
        &mut self,
        page: PageNumber,
        stops: u64,
        number: usize,
        text: &str,
        count: u32,
        period: Duration,
    ) -> Result<(), Words> {
        let frame = frame_text::parse(text).map_err(|error| error.to_string())?;
        if let Some(drive) = (0..self.place.drives.len()).find(|drive| self.torque(*drive) != Torque::Off) {
            return Err(has_torque(&self.name(drive)));
        }
        let bus = self.place.buses.get(number).ok_or("there is no such bus")?;
        if matches!(bus.link, BenchLink::Line(..)) {
            return Err("a serial line carries no frames".into());
        }
        self.running(None, number, "send", false);
        let bench = Arc::clone(&self.bench);
        let mut interruption = Interruption::of(&bench, page, false, stops);
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_nanos(TORQUE_NS) {
            if let Some(who) = self.listen(number) {
                return Err(has_torque(&who));
            }
            if interruption.poll(&mut self.place.ownership) {
                return Ok(());
            }
            thread::sleep(POLL);
        }
        self.touched = Some((number, page));
        for time in 0..count {
            let due = Instant::now() + if time == 0 { Duration::ZERO } else { period };
            while Instant::now() < due {
                self.listen(number);
                if interruption.poll(&mut self.place.ownership) {
                    return Ok(());
                }
                thread::sleep(POLL);
            }
            self.hand_over(number, &frame)?;
        }
        Ok(())
    }

    fn hand_over(&mut self, number: usize, frame: &Frame) -> Result<(), Words> {
        let bench = Arc::clone(&self.bench);
        let Some(BenchBus { link: BenchLink::Bus(port), decoder, .. }) = self.place.buses.get_mut(number)
        else {
            return Err("there is no such bus".into());
        };
        if port.send(MonotonicClock::default().now_ns(), &[*frame]) != 1 {
            return Err(words!("{frame} was not taken by the interface", frame = format!("{frame:?}")));
        }
        keep(&bench, number, decoder, '>', frame);
        Ok(())
    }
}

fn has_torque(name: &str) -> Words {
    words!("{name} has torque. Nothing was sent: disable it first", name)
}
