//! A serial line of this machine, with the thread that is its master. The thread is an ordinary one.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use takt_rt::linux::MonotonicClock;
use takt_rt::{Clock, Nanoseconds, OffCycleReport};
use tracing::{info, warn};

use super::status::LineStatus;
use crate::family::{OffCycleLine, OffCycleTarget, OffCycleWish};
use crate::faults::LineFaults;
use crate::link::SerialLineError;
use crate::link::serial_line::{SerialLine, SerialSettings};

/// How long a read waits: the master looks at its targets so often.
const TICK: Duration = Duration::from_millis(1);
/// From one attempt to open a line that was lost to the next.
const AGAIN: Duration = Duration::from_millis(200);
/// When it is over, the drives are disabled; what takes longer is given up.
const ENDING_NS: Nanoseconds = 1_000_000_000;
/// Reports that wait. The life cycle takes them about once in a millisecond.
const REPORTS: usize = 256;

/// This side of the thread of a line.
pub(super) struct ThreadEnd {
    targets: Arc<Mutex<Vec<OffCycleTarget>>>,
    reports: Receiver<(usize, OffCycleReport)>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// What both sides see.
#[derive(Debug, Default)]
struct Shared {
    is_over: AtomicBool,
    /// A bit for each drive that may have torque, or may watch for its master.
    unsettled: AtomicU64,
}

impl ThreadEnd {
    /// Opens a line, and starts its thread.
    ///
    /// # Errors
    /// The line cannot be opened, or the system has no thread.
    pub fn start(
        device: &str,
        settings: SerialSettings,
        line: Box<dyn OffCycleLine>,
        status: Arc<LineStatus>,
        faults: LineFaults,
    ) -> Result<Self, SerialLineError> {
        let serial = SerialLine::open(device, &settings)?;
        let (sender, reports) = mpsc::sync_channel(REPORTS);
        let targets = Arc::<Mutex<Vec<OffCycleTarget>>>::default();
        let shared = Arc::<Shared>::default();
        let master = LineMaster {
            device: device.to_owned(),
            settings,
            line,
            reports: sender,
            targets: Arc::clone(&targets),
            shared: Arc::clone(&shared),
            status,
            faults,
        };
        let thread = thread::Builder::new().name("takt-line".to_owned()).spawn(move || master.run(serial));
        let thread = thread.map_err(|error| SerialLineError::System {
            device: device.to_owned(),
            action: "starting its thread",
            error,
        })?;
        Ok(Self { targets, reports, shared, thread: Some(thread) })
    }

    /// Hands the newest targets over, and takes what drives have said.
    pub fn poll(&self, targets: &[OffCycleTarget], report: &mut dyn FnMut(usize, OffCycleReport)) {
        let mut wanted = self.targets.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.clear();
        wanted.extend_from_slice(targets);
        drop(wanted);
        self.reports.try_iter().for_each(|(place, news)| report(place, news));
    }

    /// Returns `true` if a drive has no torque and does not watch for its master any more.
    pub fn is_settled(&self, place: usize) -> bool {
        place < 64 && self.shared.unsettled.load(Ordering::Relaxed) >> place & 1 == 0
    }
}

impl Drop for ThreadEnd {
    /// The thread disables its drives first.
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        // A thread that has panicked is over, too.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// What the thread has.
struct LineMaster {
    device: String,
    settings: SerialSettings,
    line: Box<dyn OffCycleLine>,
    reports: SyncSender<(usize, OffCycleReport)>,
    targets: Arc<Mutex<Vec<OffCycleTarget>>>,
    shared: Arc<Shared>,
    status: Arc<LineStatus>,
    faults: LineFaults,
}

impl LineMaster {
    /// Goes on until it is over, whatever becomes of the line.
    fn run(mut self, serial: SerialLine) {
        let mut serial = Some(serial);
        let mut clock = MonotonicClock::default();
        let mut over_ns = None;
        loop {
            let is_over = self.shared.is_over.load(Ordering::Relaxed);
            let now_ns = clock.now_ns();
            if is_over {
                let began_ns = *over_ns.get_or_insert(now_ns);
                let is_settled = self.shared.unsettled.load(Ordering::Relaxed) == 0;
                if is_settled || serial.is_none() || now_ns.saturating_sub(began_ns) > ENDING_NS {
                    return;
                }
            }
            let Some(open) = &mut serial else {
                thread::sleep(AGAIN);
                serial = SerialLine::open(&self.device, &self.settings).ok();
                if serial.is_some() {
                    self.status.set_down(false);
                    info!(target: "takt::bus", device = self.device.as_str(), "{} is there again", self.device);
                }
                continue;
            };
            if let Err(error) = self.turn(open, &mut clock, is_over) {
                self.status.set_down(true);
                warn!(target: "takt::bus", device = self.device.as_str(), "{}", lost(&error));
                serial = None;
            }
        }
    }

    /// Waits a moment for bytes, and goes on.
    fn turn(
        &mut self,
        serial: &mut SerialLine,
        clock: &mut MonotonicClock,
        is_over: bool,
    ) -> Result<(), SerialLineError> {
        let mut bytes = [0; 512];
        let count = serial.read(&mut bytes, TICK)?;
        let now_ns = clock.now_ns();
        self.faults.advance(now_ns);
        let arrived = bytes.get(..count).unwrap_or_default().to_vec();
        self.line.receive(&self.faults.receive(now_ns, arrived));
        let mut targets = self.targets.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if is_over {
            for target in &mut targets {
                (target.wish, target.at_ns) = (OffCycleWish::Stop, now_ns);
            }
        }
        let reports = &self.reports;
        // What finds no room is old by the time that there is some.
        let mut report = |place, news| {
            let _ = reports.try_send((place, news));
        };
        let request = self.line.poll(now_ns, &targets, &mut report);
        for bytes in self.faults.send(now_ns, request) {
            serial.write(&bytes)?;
        }
        let is_unsettled = |place: &usize| !self.line.is_settled(*place);
        let unsettled =
            (0..targets.len().min(64)).filter(is_unsettled).fold(0, |bits, place| bits | 1 << place);
        self.shared.unsettled.store(unsettled, Ordering::Relaxed);
        self.status.show(self.line.counts());
        self.status.set_taken_away(self.faults.is_gone());
        Ok(())
    }
}

/// A line that is not open any more, for people.
fn lost(error: &SerialLineError) -> String {
    format!("{error}; it is opened again as soon as it is there")
}
