//! Watches that the real-time loop goes on. Where it does not, because a callback does not return, the drives are stopped from outside.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use takt_rt::linux::{MonotonicClock, set_fifo, set_ordinary};
use takt_rt::{Clock, Nanoseconds};
use tracing::error;

use super::last_resort::LastResort;
use crate::channels::Abandonment;
use crate::sleep_alignment;

/// From one look to the next; longer where the period is.
const LOOK: Duration = Duration::from_millis(100);
/// Looks without a cycle in between after which the loop is given up: a second, which is longer than the usual heartbeat time-outs.
const LOOKS: u32 = 10;
/// The same for a loop that others keep from its CPU: one of them may be a loop that stands still, and is given up first.
const LOOKS_IF_STARVED: u32 = 3 * LOOKS;

/// What the loop shows of itself.
#[derive(Debug, Default)]
pub struct LoopWatch {
    cycles: AtomicU64,
    thread: AtomicI32,
    abandonment: Abandonment,
}

impl LoopWatch {
    /// That of a loop that is given up so.
    pub fn new(abandonment: Abandonment) -> Self {
        Self { abandonment, ..Self::default() }
    }

    /// The calling thread runs the loop.
    pub fn begin(&self) {
        self.thread.store(nix::unistd::gettid().as_raw(), Ordering::Relaxed);
    }

    /// A cycle is over. Returns whether the loop goes on.
    pub fn note_cycle(&self) -> bool {
        self.cycles.fetch_add(1, Ordering::Relaxed);
        !self.abandonment.has_begun()
    }
}

/// The thread that watches.
pub(super) struct Watchdog {
    thread: Option<JoinHandle<LastResort>>,
    shared: Arc<Shared>,
}

struct Shared {
    watch: Arc<LoopWatch>,
    is_over: AtomicBool,
    /// What was done when the loop was given up.
    done: OnceLock<Stalled>,
}

/// The loop has been given up.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stalled {
    /// For how long there was no cycle.
    pub after: Duration,
    /// What was done to stop the drives of each bus, in words.
    pub told: Vec<String>,
}

impl Watchdog {
    /// Begins to watch. `priority` is that of the loop.
    pub(super) fn start(
        watch: Arc<LoopWatch>,
        last_resort: LastResort,
        period_ns: Nanoseconds,
        priority: Option<u8>,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(Shared { watch, is_over: AtomicBool::new(false), done: OnceLock::new() });
        let body = {
            let shared = Arc::clone(&shared);
            move || {
                // On a computer with one processor, a loop that spins leaves no time to a thread of a lower priority.
                if let Some(priority) = priority {
                    let _ = set_fifo(priority.saturating_add(1).min(99));
                }
                shared.watch(&last_resort, period_ns);
                last_resort
            }
        };
        let thread = thread::Builder::new().name("takt-watchdog".into()).spawn(body)?;
        Ok(Self { thread: Some(thread), shared })
    }

    /// What was done if the loop has been given up.
    pub(super) fn stalled(&self) -> Option<&Stalled> {
        self.shared.done.get()
    }

    /// Ends it. Returns what is left to stop the drives, if it has not been used.
    pub(super) fn end(mut self) -> Option<LastResort> {
        self.shared.is_over.store(true, Ordering::Release);
        let thread = self.thread.take()?;
        thread.thread().unpark();
        thread.join().ok().filter(|_| self.stalled().is_none())
    }
}

/// Processor use of a thread of this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ThreadUse {
    /// It runs, or waits for nothing but a processor.
    is_ready: bool,
    /// The time for which it has had a processor, in ticks of 10 ms.
    ticks: u64,
}

impl ThreadUse {
    fn of(thread: i32) -> Option<Self> {
        Self::parse(&std::fs::read_to_string(format!("/proc/self/task/{thread}/stat")).ok()?)
    }

    /// Reads `/proc/pid/task/tid/stat` (proc_pid_stat(5)), whose second field is a name in parentheses.
    fn parse(stat: &str) -> Option<Self> {
        let (_, behind_name) = stat.rsplit_once(')')?;
        let mut fields = behind_name.split_ascii_whitespace();
        let is_ready = fields.next()? == "R";
        let mut ticks = fields.skip(10).map(str::parse::<u64>);
        Some(Self { is_ready, ticks: ticks.next()?.ok()? + ticks.next()?.ok()? })
    }
}

impl Shared {
    fn watch(&self, last_resort: &LastResort, period_ns: Nanoseconds) {
        let look = LOOK.max(Duration::from_nanos(period_ns.saturating_mul(2)));
        let mut clock = MonotonicClock::default();
        let (mut cycles, mut since_ns, mut looks) = (0, clock.now_ns(), 0);
        let mut used = None;
        loop {
            let before_ns = clock.now_ns();
            thread::park_timeout(sleep_alignment::pause(look, period_ns));
            if self.is_over.load(Ordering::Acquire) {
                return;
            }
            let present = self.watch.cycles.load(Ordering::Relaxed);
            // A look that is late shows that the whole computer, or the process, was held up, and the loop with it.
            let is_late = clock.now_ns().saturating_sub(before_ns) > 3 * look.as_nanos() as u64;
            if present != cycles || present == 0 || is_late {
                (cycles, since_ns, looks) = (present, clock.now_ns(), 0);
                continue;
            }
            looks += 1;
            let shown = ThreadUse::of(self.watch.thread.load(Ordering::Relaxed));
            if looks == 1 {
                used = shown;
            }
            let is_starved = shown.is_some_and(|shown| shown.is_ready) && shown == used;
            if looks >= if is_starved { LOOKS_IF_STARVED } else { LOOKS } {
                let after = Duration::from_nanos(clock.now_ns().saturating_sub(since_ns));
                return self.give_up(after, last_resort);
            }
        }
    }

    fn give_up(&self, after: Duration, last_resort: &LastResort) {
        self.watch.abandonment.begin();
        // Other controllers and programs of this computer go on.
        let _ = set_ordinary(self.watch.thread.load(Ordering::Relaxed));
        let told = last_resort.stop_drives();
        error!(target: "takt::realtime", ?after, ?told, "the real-time loop stands still, and is given up");
        let _ = self.done.set(Stalled { after, told });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_has_used_its_processor_or_waits_for_something_else_is_not_starved() {
        let stat =
            "12 (a) R (b) R 1 12 12 0 -1 4194304 93 0 0 0 7 5 0 0 -51 0 3 0 4710 22 1 18446744073709551615";
        assert_eq!(ThreadUse::parse(stat), Some(ThreadUse { is_ready: true, ticks: 12 }));
        assert_eq!(ThreadUse::parse("12 (a"), None);
        let own = ThreadUse::of(nix::unistd::gettid().as_raw()).unwrap();
        assert!(own.is_ready);
        let (send, receive) = std::sync::mpsc::channel();
        let waiting = thread::spawn(move || {
            send.send(nix::unistd::gettid().as_raw()).unwrap();
            thread::park();
        });
        let number = receive.recv().unwrap();
        while ThreadUse::of(number).unwrap().is_ready {
            thread::yield_now();
        }
        waiting.thread().unpark();
        waiting.join().unwrap();
    }
}
