//! Whether the system grants this process real-time scheduling and locked memory. Only an attempt shows that.

use std::thread;

use nix::sys::mman::munlockall;
use takt_rt::linux::ThreadReport;

use super::subject::Subject;
use takt::controller::realtime_thread::ThreadSetup;

/// Sets up a separate thread as the loop's thread would be, and undoes it. The result counts more than limits and
/// capabilities. `None` when no thread could be started.
pub fn attempt(subject: &Subject) -> Option<ThreadReport> {
    let setup = ThreadSetup { cpu: Some(subject.cpu), ..ThreadSetup::of(&subject.realtime) };
    let probe = move || *setup.enter().report();
    let report = thread::Builder::new().name("takt-probe".into()).spawn(probe).ok()?.join().ok();
    // Scheduling and CPU affinity ended with the thread; memory locking belongs to the process and is undone here.
    let _ = munlockall();
    report
}
