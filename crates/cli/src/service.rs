//! What the service manager is told of a run (`sd_notify(3)`): when it is ready, what it does, that its loop lives, that it ends.

use std::time::Duration;

use sd_notify::NotifyState;
use takt_rt::{Nanoseconds, Phase, Snapshot};

use takt::controller::Progress;
use takt::telemetry::{Machine, words};

/// The status is told no more often than this.
const STATUS_NS: Nanoseconds = 1_000_000_000;

/// One message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// The drives are enabled, and the loop makes cycles.
    Ready,
    /// The loop has made cycles since the last such message.
    Watchdog,
    /// The run ends.
    Stopping,
    /// What it does, for people.
    Status(String),
}

/// What has been told.
#[derive(Debug)]
pub struct Service {
    machine: Machine,
    /// How often the watchdog is told; never without one.
    interval_ns: Option<Nanoseconds>,
    is_ready: bool,
    is_stopping: bool,
    /// The slot of the first look.
    first_slot: Option<u64>,
    /// When the watchdog was last told, and the slot then.
    alive: (Nanoseconds, u64),
    status: (Nanoseconds, String),
}

impl Service {
    /// For a watchdog that bites after so long.
    pub fn new(machine: Machine, watchdog: Option<Duration>) -> Self {
        let third = |time: Duration| u64::try_from(time.as_nanos() / 3).unwrap_or(u64::MAX);
        Self {
            machine,
            interval_ns: watchdog.map(third),
            is_ready: false,
            is_stopping: false,
            first_slot: None,
            alive: (0, 0),
            status: (0, String::new()),
        }
    }

    /// The run was looked at: what is to be told now.
    pub fn look(&mut self, now_ns: Nanoseconds, state: &Snapshot, progress: &Progress) -> Vec<Message> {
        let mut messages = vec![];
        let first_slot = *self.first_slot.get_or_insert(state.slot);
        if progress.is_ending {
            messages.extend(self.stop());
        }
        let is_enabled = |phase| matches!(phase, Phase::Holding | Phase::Moving | Phase::Streaming);
        let are_enabled = state.groups().iter().all(|group| is_enabled(group.phase));
        if !self.is_ready && !self.is_stopping && are_enabled && state.slot > first_slot {
            self.is_ready = true;
            messages.push(Message::Ready);
        }
        let (told_ns, told_slot) = self.alive;
        let is_due = |interval_ns| now_ns.saturating_sub(told_ns) >= interval_ns;
        if self.interval_ns.is_some_and(is_due) && state.slot > told_slot.max(first_slot) {
            self.alive = (now_ns, state.slot);
            messages.push(Message::Watchdog);
        }
        let status = self.status_words(state, progress);
        let (told_ns, told) = &self.status;
        let is_first = told.is_empty();
        if status != *told && (is_first || now_ns.saturating_sub(*told_ns) >= STATUS_NS) {
            messages.push(Message::Status(status.clone()));
            self.status = (now_ns, status);
        }
        messages
    }

    /// The run ends: told once.
    pub fn stop(&mut self) -> Option<Message> {
        (!std::mem::replace(&mut self.is_stopping, true)).then_some(Message::Stopping)
    }

    fn status_words(&self, state: &Snapshot, progress: &Progress) -> String {
        let mut status = progress.what.clone();
        if self.is_ready && !self.is_stopping {
            let phases: Vec<&str> = state.groups().iter().map(|group| words::phase(group.phase)).collect();
            status = phases.join(", ");
        }
        if let Some(stop) = state.first_stop() {
            status = format!("{status}; stopped: {}", words::stop(&stop, &self.machine));
        }
        if state.missed_slots > 0 {
            status = format!("{status}; {} slots missed", state.missed_slots);
        }
        // A message is a line each.
        status.replace(['\n', '\r'], " ")
    }
}

/// The way to the service manager.
pub struct Notifier {
    service: Service,
    has_failed: bool,
}

impl Notifier {
    /// `None` if no service manager wants to know.
    pub fn of_environment(machine: &Machine) -> Option<Self> {
        std::env::var_os("NOTIFY_SOCKET")?;
        let service = Service::new(machine.clone(), sd_notify::watchdog_enabled());
        Some(Self { service, has_failed: false })
    }

    /// See [`Service::look`].
    pub fn look(&mut self, now_ns: Nanoseconds, state: &Snapshot, progress: &Progress) {
        let messages = self.service.look(now_ns, state, progress);
        self.tell(messages);
    }

    /// See [`Service::stop`].
    pub fn stop(&mut self) {
        let message = self.service.stop();
        self.tell(message);
    }

    fn tell(&mut self, messages: impl IntoIterator<Item = Message>) {
        for message in messages {
            let state = match &message {
                Message::Ready => NotifyState::Ready,
                Message::Watchdog => NotifyState::Watchdog,
                Message::Stopping => NotifyState::Stopping,
                Message::Status(words) => NotifyState::Status(words),
            };
            if let Err(error) = sd_notify::notify(&[state])
                && !std::mem::replace(&mut self.has_failed, true)
            {
                say!("takt: the service manager cannot be told: {error}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use takt::config::Config;

    const MS: u64 = 1_000_000;

    fn service(watchdog_ms: Option<u64>) -> Service {
        let config = Config::load(Path::new("../../configs/first.toml")).unwrap();
        Service::new(Machine::of(&config), watchdog_ms.map(Duration::from_millis))
    }

    fn state(slot: u64, phase: Phase) -> Snapshot {
        let mut state = Snapshot { slot, ..Snapshot::default() };
        state.groups[0].phase = phase;
        state
    }

    fn doing(what: &str) -> Progress {
        Progress { what: what.to_owned(), ..Progress::default() }
    }

    #[test]
    fn it_is_ready_once_when_the_drives_are_enabled_and_cycles_are_made() {
        let mut service = service(None);
        let enabling = service.look(0, &state(5, Phase::Enabling), &doing("enabling"));
        assert_eq!(enabling, [Message::Status("enabling".to_owned())]);
        assert_eq!(service.look(1, &state(5, Phase::Holding), &doing("")), [], "no cycle since");
        assert_eq!(service.look(2, &state(6, Phase::Holding), &doing("")), [Message::Ready]);
        assert_eq!(service.look(3, &state(7, Phase::Moving), &doing("")), []);
        let later = service.look(2_000 * MS, &state(8, Phase::Moving), &doing("move 1"));
        assert_eq!(later, [Message::Status("moving".to_owned())]);
    }

    #[test]
    fn the_watchdog_is_told_three_times_in_its_time_while_the_loop_makes_cycles_and_never_when_it_does_not() {
        let mut service = service(Some(300));
        let mut told = 0;
        for ms in 0..3_000 {
            // The loop hangs after two seconds, and the thread that looks goes on.
            let messages = service.look(ms * MS, &state(ms.min(2_000), Phase::Holding), &doing(""));
            if messages.contains(&Message::Watchdog) {
                assert!(ms <= 2_100, "at {ms} ms");
                told += 1;
            }
        }
        assert!((20..=21).contains(&told), "{told}");
    }

    #[test]
    fn the_end_is_told_once_and_nothing_is_ready_after_it() {
        let mut service = service(None);
        service.look(0, &state(1, Phase::Enabling), &doing("enabling"));
        let ending = Progress { is_ending: true, ..doing("stopping") };
        assert_eq!(service.look(1, &state(2, Phase::Holding), &ending), [Message::Stopping]);
        assert_eq!(service.look(2, &state(3, Phase::Holding), &ending), []);
        assert_eq!(service.stop(), None);
    }
}
