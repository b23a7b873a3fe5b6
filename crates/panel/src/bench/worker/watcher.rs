//! What the pages are told of a procedure, and of every frame.

use std::time::{SystemTime, UNIX_EPOCH};

use takt_rt::Frame;

use super::super::super::frames::FrameView;
use super::super::super::lock::locked;
use super::super::Bench;
use takt_tools::commission::ProcedureEvent;
use takt_tools::commission::bus_session::SessionEvent;
use takt_tools::commission::line_session::LineEvent;
use takt_tools::monitor::BusDecoder;

/// Tells the pages what a procedure does.
pub(super) struct Watcher<'a> {
    bench: &'a Bench,
    bus: usize,
    drive: Option<usize>,
    /// What the procedure has noted.
    pub notes: Vec<String>,
    /// True if anything has left.
    pub has_sent: bool,
}

impl<'a> Watcher<'a> {
    /// For a procedure on a bus, and on a drive if it is for one.
    pub const fn new(bench: &'a Bench, bus: usize, drive: Option<usize>) -> Self {
        Self { bench, bus, drive, notes: vec![], has_sent: false }
    }

    /// Sees what happens on a CAN bus.
    pub fn see(&mut self, decoder: &mut BusDecoder, event: &SessionEvent) {
        let (direction, frame) = match event {
            SessionEvent::Procedure(event) => return self.see_procedure(event),
            SessionEvent::Sent(frame) => ('>', frame),
            SessionEvent::Received(frame) => ('<', frame),
        };
        self.has_sent |= direction == '>';
        keep(self.bench, self.bus, decoder, direction, frame);
    }

    /// Sees what happens on a serial line.
    pub fn see_line(&mut self, event: &LineEvent<'_>) {
        let (direction, bytes) = match event {
            LineEvent::Procedure(event) => return self.see_procedure(event),
            LineEvent::Sent(bytes) => ('>', bytes),
            LineEvent::Received(bytes) => ('<', bytes),
        };
        self.has_sent |= direction == '>';
        let frame: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        push(
            self.bench,
            FrameView { direction, bus: self.bus, frame, number: 0, time: 0.0, words: String::new() },
        );
    }

    fn see_procedure(&mut self, event: &ProcedureEvent) {
        let mut told = self.bench.told();
        match event {
            ProcedureEvent::Step(name) => {
                if let Some(running) = &mut told.running {
                    running.step = name;
                }
            }
            ProcedureEvent::Progress { done, of } => {
                if let Some(running) = &mut told.running {
                    (running.done, running.of) = (*done, *of);
                }
            }
            ProcedureEvent::Reading(reading) => told.reading = self.drive.map(|drive| (drive, *reading)),
            ProcedureEvent::Note(text) => self.notes.push(text.clone()),
        }
    }
}

/// Keeps a frame for the monitor. Returns who has shown torque by it.
pub(super) fn keep(
    bench: &Bench,
    bus: usize,
    decoder: &mut BusDecoder,
    direction: char,
    frame: &Frame,
) -> Option<String> {
    let decoded = decoder.decode(frame);
    let words = decoded.line();
    push(bench, FrameView { direction, bus, frame: format!("{frame:?}"), number: 0, time: 0.0, words });
    (direction == '<' && decoded.shows_torque == Some(true)).then_some(decoded.who)
}

fn push(bench: &Bench, frame: FrameView) {
    let time = SystemTime::now().duration_since(UNIX_EPOCH);
    let time = time.map_or(0.0, |time| time.as_secs_f64());
    locked(&bench.frames).push(FrameView { time, ..frame });
}
