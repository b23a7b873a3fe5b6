//! The logger as a thread.

use std::io;
use std::panic;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use nix::sys::signal::{SigSet, Signal};
use takt_rt::linux::set_nice;

use super::black_box::Fault;
use super::logger::{LogSummary, Logger};
use crate::controller::quiet;

/// A pause between two looks at the rings; at 1 ms, five records.
const PAUSE: Duration = Duration::from_millis(5);

/// Ahead of ordinary work, which on a busy CPU would let the ring run full; far behind everything that is real-time.
const NICE: i8 = -15;

/// A logger in a thread of its own. Start it before the real-time thread is elevated, so that it inherits neither
/// the priority nor the CPU.
pub struct LoggerThread {
    is_over: Arc<AtomicBool>,
    faults: Sender<Fault>,
    panic: Arc<OnceLock<String>>,
    thread: JoinHandle<LogSummary>,
}

impl LoggerThread {
    /// Starts the thread.
    ///
    /// # Errors
    /// The operating system's, when it gives no thread.
    pub fn start(mut logger: Logger) -> io::Result<Self> {
        let is_over = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&is_over);
        let period_ns = logger.period_ns();
        let panic = logger.panic();
        let (faults, told_faults) = mpsc::channel::<Fault>();
        let thread = thread::Builder::new().name("takt-logger".to_owned()).spawn(move || {
            survive_size_limits();
            // Where there is no right to it, the ring alone bridges the time in which others have the CPU.
            let _ = set_nice(NICE);
            while !told.load(Ordering::Acquire) {
                logger.drain();
                told_faults.try_iter().for_each(|fault| logger.fault(&fault));
                thread::park_timeout(quiet::pause(PAUSE, period_ns));
            }
            logger.drain();
            told_faults.try_iter().for_each(|fault| logger.fault(&fault));
            logger.finish()
        })?;
        Ok(Self { is_over, faults, panic, thread })
    }

    /// Has the black box written because of something that the records do not show.
    pub fn fault(&self, fault: Fault) {
        // A logger that is gone has said why itself.
        let _ = self.faults.send(fault);
    }

    /// What `notify` said when it panicked, if it has.
    pub fn panic(&self) -> Option<&str> {
        self.panic.get().map(String::as_str)
    }

    /// Lets the thread work off what waits and close its files. Call it when nothing more will be handed over.
    pub fn finish(self) -> LogSummary {
        self.is_over.store(true, Ordering::Release);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or_else(|payload| panic::resume_unwind(payload))
    }
}

/// A file that grows beyond what the process may write (`RLIMIT_FSIZE`) is a full disk, not a reason to die in motion:
/// the kernel's signal for it, which comes to the thread that writes, is not taken, and the call fails instead.
fn survive_size_limits() {
    let mut signals = SigSet::empty();
    signals.add(Signal::SIGXFSZ);
    // It can only fail for a signal that does not exist.
    let _ = signals.thread_block();
}
