//! Whether the system grants this process real-time scheduling and locked memory. Only an attempt shows that.

use std::thread;

use nix::sys::mman::munlockall;
use takt_rt::linux::{RealtimeThread, ThreadConfig, ThreadReport};

use super::subject::Subject;
use crate::controller::realtime_thread::thread_config;

/// Sets up a separate thread as the loop's thread would be, and undoes it. The result counts more than limits and
/// capabilities. `None` when no thread could be started.
pub fn attempt(subject: &Subject) -> Option<ThreadReport> {
    let config = ThreadConfig { cpu: Some(subject.cpu), ..thread_config(&subject.realtime) };
    let probe = move || *RealtimeThread::enter(&config).report();
    let report = thread::Builder::new().name("takt-probe".into()).spawn(probe).ok()?.join().ok();
    // Scheduling and CPU affinity ended with the thread; memory locking belongs to the process and is undone here.
    let _ = munlockall();
    report
}
