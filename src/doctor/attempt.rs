//! What only an attempt can tell: whether the system lets this process be real-time.

use std::thread;

use nix::sys::mman::munlockall;
use takt_rt::linux::{RealtimeThread, ThreadConfig, ThreadReport};

use super::subject::Subject;
use crate::controller::realtime_thread::thread_config;

/// Sets a thread of its own up as the loop's would be, and undoes it. What was granted is thereby proven, whatever
/// limits and capabilities seem to say. `None` when the system has no thread for it.
pub fn attempt(subject: &Subject) -> Option<ThreadReport> {
    let config = ThreadConfig { cpu: Some(subject.cpu), ..thread_config(&subject.realtime) };
    let probe = move || *RealtimeThread::enter(&config).report();
    let report = thread::Builder::new().name("takt-probe".into()).spawn(probe).ok()?.join().ok();
    // Scheduling and CPU ended with the thread; locking concerns the process. It fails for no reason that matters.
    let _ = munlockall();
    report
}
