//! Clients that behave badly beside the loop, for the jitter measurements of the laboratory.
//!
//! One streams a motion at 100 Hz, and stalls for a third of a second in every two. One hands over the same motion without a pause, as
//! fast as it can. Two observe without a pause. One after another begins to stream and panics on the way. All have ordinary
//! priority. The program takes the arguments of `takt run`, and ends with an error if the group has stopped.

mod run_arguments;
mod unruly_motion;

use std::error::Error;
use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use takt::{Controller, Event, EventKind, Handle};

use run_arguments::arguments;
use unruly_motion::{INTERVAL, Motion};

/// The motion, and when it has begun.
struct Begun {
    motion: Motion,
    begun: Instant,
}

impl Begun {
    fn now(&self) -> Vec<f64> {
        self.motion.after(self.begun.elapsed())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let (config, options, lasting) = arguments()?;
    let arm = Controller::start(config, options)?;
    let home = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    // Those that panic here are meant to.
    std::panic::set_hook(Box::new(|_| {}));
    arm.begin_stream()?;
    let motion = &Begun { motion: Motion { home }, begun: Instant::now() };
    let (is_over, mut events) = (&AtomicBool::new(false), arm.events());
    let mut stops = Vec::new();
    thread::scope(|scope| {
        let until_over = |client: fn(&Handle, &Begun)| {
            let handle = arm.handle();
            scope.spawn(move || {
                while !is_over.load(Ordering::Relaxed) {
                    client(&handle, motion);
                }
            });
        };
        for client in [lead, flood, observe, observe, begin_and_die] {
            until_over(client);
        }
        while motion.begun.elapsed() < lasting {
            thread::sleep(INTERVAL);
            let is_stop = |event: &Event| matches!(event.kind, EventKind::Stop(_));
            stops.extend(events.by_ref().filter(is_stop));
        }
        is_over.store(true, Ordering::Relaxed);
    });
    let report = arm.stream().report();
    let session = arm.finish()?;
    println!("{:?}\n{} records, {} dropped", report.counts, session.log.records, session.log.records_dropped);
    if stops.is_empty() { Ok(()) } else { Err(format!("the group has stopped: {stops:?}").into()) }
}

/// Streams for two seconds, and stalls for a third of a second.
fn lead(handle: &Handle, motion: &Begun) {
    let stream = handle.stream();
    for _ in 0..200 {
        // Where the other client has filled the look-ahead, there is no room.
        let _ = stream.push_now(&motion.now());
        thread::sleep(INTERVAL);
    }
    thread::sleep(Duration::from_millis(333));
}

/// Hands over the next fifth of a second.
fn flood(handle: &Handle, motion: &Begun) {
    let chunk = motion.motion.chunk(motion.begun.elapsed());
    let _ = handle.stream().push_chunk(handle.now_ns(), INTERVAL, &chunk);
}

fn observe(handle: &Handle, _motion: &Begun) {
    black_box(handle.state());
    black_box(handle.events().count());
}

/// A client that panics while it streams.
fn begin_and_die(handle: &Handle, motion: &Begun) {
    let (handle, point) = (handle.clone(), motion.now());
    let client = thread::spawn(move || {
        let (stream, _events) = (handle.stream(), handle.events());
        for _ in 0..10 {
            let _ = stream.push_now(&point);
        }
        panic!("this client dies");
    });
    assert!(client.join().is_err());
}
