//! What is looked at and told while a run goes on: the progress bar, what is urgent, Ctrl-C.

use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use takt::config::Config;
use takt::controller::{Interrupt, Progress};
use takt::faults::{FaultEvents, FaultInjector};
use takt::telemetry::{Machine, Notice, words};
use takt_remote::now_ns;
use takt_rt::{Event, EventKind, Snapshot, StopCause};

use crate::full_queue::FullQueues;
use crate::interruption;
use crate::metrics::Metrics;
use crate::service::Notifier;
use crate::usage_error::UsageError;

/// What is looked at and told during a run.
pub(super) struct Watcher {
    throttled_bar: ThrottledBar,
    full_queues: FullQueues,
    fault_injector: Option<Arc<FaultInjector>>,
    fault_events: FaultEvents,
    signals: Signals,
    pub bar: ProgressBar,
    metrics: Option<Arc<Metrics>>,
    pub notifier: Arc<Mutex<Option<Notifier>>>,
}

impl Watcher {
    /// Of a run of this configuration.
    pub fn new(
        config: &Config,
        metrics: Option<Arc<Metrics>>,
        fault_injector: Option<Arc<FaultInjector>>,
    ) -> Result<Self, UsageError> {
        let signals = Signals::watch().map_err(|error| format!("cannot watch for Ctrl-C: {error}"))?;
        let (bar, machine) = (progress_bar(config), Machine::of(config));
        Ok(Self {
            notifier: Arc::new(Mutex::new(Notifier::of_environment(&machine))),
            throttled_bar: ThrottledBar::new(bar.clone(), machine),
            full_queues: FullQueues::new(config),
            fault_injector,
            fault_events: FaultEvents::default(),
            signals,
            bar,
            metrics,
        })
    }

    /// Looks at the run. Returns whether it is to end.
    pub fn watch(&mut self, snapshot: &Snapshot, progress: &Progress) -> Option<Interrupt> {
        if self.throttled_bar.show(progress, snapshot)
            && let Some(metrics) = &self.metrics
        {
            metrics.state(snapshot);
        }
        tell_manager(&self.notifier, |notifier| notifier.look(now_ns(), snapshot, progress));
        let Self { full_queues, bar, .. } = self;
        full_queues.poll(snapshot).for_each(|hint| bar.suspend(|| say!("takt: {hint}")));
        self.tell();
        self.signals.next()
    }

    /// Tells which faults were injected since the last call.
    pub fn tell(&mut self) {
        let Some(fault_injector) = self.fault_injector.as_deref() else { return };
        for fault_event in self.fault_events.next(fault_injector) {
            self.bar.suspend(|| say!("takt: {fault_event}"));
        }
    }
}

/// Tells the service manager, if there is one.
pub(super) fn tell_manager(notifier: &Mutex<Option<Notifier>>, tell: impl FnOnce(&mut Notifier)) {
    // A panic of another holder of the lock leaves what was told.
    if let Some(notifier) = notifier.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
        tell(notifier);
    }
}

/// Ctrl-C and SIGTERM. The first asks for a controlled stop, the second for an immediate one.
struct Signals {
    arrived: Arc<AtomicBool>,
    next: Interrupt,
}

impl Signals {
    fn watch() -> std::io::Result<Self> {
        Ok(Self { arrived: interruption::watch()?, next: Interrupt::Controlled })
    }

    fn next(&mut self) -> Option<Interrupt> {
        let has_arrived = self.arrived.swap(false, Ordering::Relaxed);
        has_arrived.then(|| std::mem::replace(&mut self.next, Interrupt::Immediate))
    }
}

const BAR_STEPS: u64 = 1000;

fn progress_bar(config: &Config) -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(BAR_STEPS);
    if let Ok(style) = ProgressStyle::with_template("{prefix}  [{bar:24}]  {elapsed}  {wide_msg}") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(config.name.clone());
    bar
}

/// A progress bar that is updated at most ten times a second.
struct ThrottledBar {
    bar: ProgressBar,
    machine: Machine,
    last: Option<(Instant, Progress)>,
}

impl ThrottledBar {
    const INTERVAL: Duration = Duration::from_millis(100);

    fn new(bar: ProgressBar, machine: Machine) -> Self {
        Self { bar, machine, last: None }
    }

    /// Returns whether it was time for it.
    fn show(&mut self, progress: &Progress, snapshot: &Snapshot) -> bool {
        if self.last.as_ref().is_some_and(|(at, _)| at.elapsed() < Self::INTERVAL) {
            return false;
        }
        if let Some(fraction) = progress.fraction {
            self.bar.set_position((fraction * BAR_STEPS as f64) as u64);
        }
        let silence =
            words::silence(snapshot, &self.machine).map_or(String::new(), |text| format!("; {text}"));
        self.bar.set_message(format!("{}{silence}", progress.what));
        self.last = Some((Instant::now(), progress.clone()));
        true
    }
}

/// Returns `true` if an event is not part of an ordinary run. One of a stated duration ends with a stop that it requests itself.
fn is_urgent(event: &Event, has_duration: bool) -> bool {
    match &event.kind {
        EventKind::Stop(stop) => !(has_duration && matches!(stop.cause, StopCause::Requested)),
        EventKind::Emergency { .. } | EventKind::Rejected { .. } => true,
        _ => false,
    }
}

/// Prints messages that must not wait for the end of the run.
pub(super) fn notices(
    bar: &ProgressBar,
    machine: Machine,
    metrics: Option<Arc<Metrics>>,
    has_duration: bool,
) -> Box<dyn FnMut(&Notice) + Send> {
    let bar = bar.clone();
    Box::new(move |notice| {
        if let (Notice::Event(event), Some(metrics)) = (notice, &metrics) {
            metrics.event(event);
        }
        let text = match notice {
            Notice::NotWritten(text) => format!("takt: {text}"),
            Notice::Event(event) if is_urgent(event, has_duration) => {
                words::event(event, &machine).to_string()
            }
            _ => return,
        };
        bar.suspend(|| say!("{text}"));
    })
}
