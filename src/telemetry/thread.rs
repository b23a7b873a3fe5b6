//! The logger as a thread.

use std::io;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::logger::{LogSummary, Logger};
use crate::controller::quiet;

/// A pause between two looks at the rings; at 1 ms, five records.
const PAUSE: Duration = Duration::from_millis(5);

/// A logger in a thread of its own. Start it before the real-time thread is elevated, so that it inherits neither
/// the priority nor the CPU.
pub struct LoggerThread {
    is_over: Arc<AtomicBool>,
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
        let thread = thread::Builder::new().name("takt-logger".to_owned()).spawn(move || {
            while !told.load(Ordering::Acquire) {
                logger.drain();
                thread::park_timeout(quiet::pause(PAUSE, period_ns));
            }
            logger.finish()
        })?;
        Ok(Self { is_over, thread })
    }

    /// Lets the thread work off what waits and close its files. Call it when nothing more will be handed over.
    pub fn finish(self) -> LogSummary {
        self.is_over.store(true, Ordering::Release);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or_else(|payload| panic::resume_unwind(payload))
    }
}
