//! The logger as a thread.

use std::io;
use std::panic;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use nix::sys::signal::{SigSet, Signal};
use takt_rt::linux::{Outcome, set_nice};

use super::black_box::Incident;
use super::logger::{LogSummary, Logger};
use crate::sleep_alignment;

/// The pause between two drains of the rings: five records at a cycle of 1 ms.
const PAUSE: Duration = Duration::from_millis(5);

/// For a logger that is behind: before ordinary threads, which would let the ring fill up on a busy CPU, and behind all real-time threads.
const HASTY: i8 = -15;
/// For one that is not. It compresses for some ms at a time, in which a hasty one keeps every ordinary program from a lone CPU.
const ORDINARY: i8 = 0;
/// How far it is behind before it is hasty, a sixteenth of what the ring holds at 1 ms.
const BEHIND: Duration = Duration::from_millis(256);

/// A logger in a thread of its own. Start it before the calling thread becomes real-time: otherwise it inherits the
/// priority and the CPU.
pub struct LoggerThread {
    is_over: Arc<AtomicBool>,
    incidents: Sender<Incident>,
    panic: Arc<OnceLock<String>>,
    thread: JoinHandle<LogSummary>,
}

impl LoggerThread {
    /// Starts the thread.
    ///
    /// # Errors
    /// The operating system gives no thread.
    pub fn start(mut logger: Logger) -> io::Result<Self> {
        let is_over = Arc::new(AtomicBool::new(false));
        let end = Arc::clone(&is_over);
        let period_ns = logger.period_ns();
        let panic = logger.panic();
        let (incidents, reported) = mpsc::channel::<Incident>();
        let thread = thread::Builder::new().name("takt-logger".to_owned()).spawn(move || {
            survive_size_limits();
            let behind_cycles = BEHIND.as_nanos() as u64 / period_ns.max(1);
            let mut is_hasty = false;
            while !end.load(Ordering::Acquire) {
                let is_behind = logger.drain() as u64 > behind_cycles;
                // Without the permission, the ring alone bridges the time in which other threads have the CPU.
                if is_behind != is_hasty
                    && let Outcome::Granted = set_nice(if is_behind { HASTY } else { ORDINARY })
                {
                    is_hasty = is_behind;
                }
                reported.try_iter().for_each(|incident| logger.incident(&incident));
                thread::park_timeout(sleep_alignment::pause(PAUSE, period_ns));
            }
            logger.drain();
            reported.try_iter().for_each(|incident| logger.incident(&incident));
            logger.finish()
        })?;
        Ok(Self { is_over, incidents, panic, thread })
    }

    /// Makes the black box write a file for an incident that the records do not show.
    pub fn incident(&self, incident: Incident) {
        // A logger that has ended by itself has already reported why.
        let _ = self.incidents.send(incident);
    }

    /// The message of the panic of `notify`, if it has panicked.
    pub fn panic(&self) -> Option<&str> {
        self.panic.get().map(String::as_str)
    }

    /// Lets the thread drain the rings and close its files. Call it when nothing more will be put into the rings.
    pub fn finish(self) -> LogSummary {
        self.is_over.store(true, Ordering::Release);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or_else(|payload| panic::resume_unwind(payload))
    }
}

/// Blocks SIGXFSZ, which would end the process in motion when a file reaches `RLIMIT_FSIZE`. The kernel sends the signal to
/// the thread that writes. With the signal blocked, the write fails, as on a full disk.
fn survive_size_limits() {
    let mut signals = SigSet::empty();
    signals.add(Signal::SIGXFSZ);
    // This call fails only for a signal that does not exist.
    let _ = signals.thread_block();
}
