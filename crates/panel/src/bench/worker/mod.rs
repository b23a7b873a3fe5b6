//! The one thread that owns the buses: it carries out one errand after the other, and takes the torque from drives whose page is gone.

mod place;
mod scanning;
mod sending;
mod watcher;

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, Nanoseconds};

use super::super::command::ProblemView;
use super::super::gate::message;
use super::super::pages::PageNumber;
use super::asked::{Ask, AskedTask};
use super::interruption::Interruption;
use super::told::{RunningView, Torque, outcome};
use super::{Bench, Errand};
use takt::link::ownership::Ownership;
use takt::words;
use takt::words::Words;
use takt_tools::commission::line_session::{self, LineEvent};
use takt_tools::commission::{Failure, ProcedureError, Report, TargetDrive, Task, bus_session};
use watcher::Watcher;

pub use place::{BenchBus, BenchDrive, BenchLink, Workplace};

/// The pause between two looks at buses on which nothing is done.
const POLL: Duration = Duration::from_millis(2);
/// How often the pages are told the state of the buses.
const HEALTH_EVERY: Duration = Duration::from_millis(250);

/// A drive that is read while nothing else is done.
#[derive(Clone, Copy)]
struct Watched {
    drive: usize,
    every_ns: Nanoseconds,
    page: PageNumber,
}

/// How a procedure has ended.
struct Ended {
    outcome: Result<Report, ProcedureError>,
    notes: Vec<String>,
    /// True if anything was sent.
    has_sent: bool,
}

/// The thread.
pub struct Worker {
    bench: Arc<Bench>,
    place: Workplace,
    watched: Option<Watched>,
    /// The bus that a page has sent frames of its own on: drives there may obey them.
    touched: Option<(usize, PageNumber)>,
    /// The stops that were obeyed.
    stops: u64,
    health_at: Option<Instant>,
}

impl Worker {
    pub const fn new(bench: Arc<Bench>, place: Workplace) -> Self {
        Self { bench, place, watched: None, touched: None, stops: 0, health_at: None }
    }

    /// Carries out errands until the panel ends or another process takes the buses over. No drive is left with torque.
    pub fn run(mut self) {
        while !self.bench.gate.has_ended() && !self.bench.is_taken_over() {
            self.keep_safe();
            self.show_health();
            match self.next() {
                Some(errand) => self.carry_out(errand),
                None => self.rest(),
            }
        }
        self.disable_where(|_| true);
        self.disable_touched();
        self.bench.gate.end();
    }

    /// The next errand, unless a stop or its page has discarded it.
    fn next(&self) -> Option<Errand> {
        let errand = {
            let mut next = self.bench.next();
            let errand = next.errand.take()?;
            let is_ended = next.ends && !errand.is_disabling();
            next.ends = false;
            next.is_busy = !is_ended;
            (!is_ended).then_some(errand)
        };
        let errand =
            errand.filter(|errand| errand.stops == self.bench.stops() && self.bench.may_move(errand.page));
        if errand.is_none() {
            self.finish();
        }
        errand
    }

    fn finish(&self) {
        {
            let mut next = self.bench.next();
            next.is_busy = false;
            if next.errand.is_none() {
                next.ends = false;
                next.held_until = None;
            }
        }
        // Who sees that nothing is done may ask for something.
        self.bench.told().running = None;
    }

    fn carry_out(&mut self, errand: Errand) {
        let Errand { page, ask, stops } = errand;
        let result = match ask {
            Ask::Scan { bus, from, to } => self.scan(page, stops, bus, from..=to),
            Ask::Add { bus, node, family } => self.add(bus, node, &family),
            Ask::Task { drive, task, .. } => self.task(page, stops, drive, &task),
            Ask::Watch { drive, every_ms } => self.choose_watched(page, drive, every_ms),
            Ask::Send { bus, frame, count, period_ms } => {
                self.send(page, stops, bus, &frame, count, Duration::from_millis(period_ms.into()))
            }
            Ask::Renew {} | Ask::End {} => Ok(()),
        };
        if let Err(words) = result {
            let problem = ProblemView::of("refused", words);
            self.bench.gate.tell(Some(page), |_| message("problem", &problem));
        }
        self.finish();
    }

    fn running(&self, drive: Option<usize>, bus: usize, action: &'static str, is_watch: bool) {
        self.bench.told().running =
            Some(RunningView { drive, bus, action, step: "", done: 0, of: 0, is_watch });
    }

    /// Nothing is asked: the watched drive is read, or the buses are listened to.
    fn rest(&mut self) {
        self.watched = self.watched.filter(|watched| self.bench.may_move(watched.page));
        self.bench.told().watched = self.watched.map(|watched| watched.drive);
        match self.watched {
            Some(watched) => self.watch(watched),
            None => {
                for bus in 0..self.place.buses.len() {
                    self.listen(bus);
                }
                thread::sleep(POLL);
            }
        }
    }

    fn watch(&mut self, watched: Watched) {
        let Watched { drive, every_ns, page } = watched;
        let Some((bus, target)) = self.drive(drive) else {
            self.watched = None;
            return;
        };
        self.running(Some(drive), bus, "watch", true);
        let task = Task::Watch { every_ns, duration_ns: None };
        let stops = self.stops;
        let ended = self.carry(drive, bus, target, task, &|bench| Interruption::of(bench, page, true, stops));
        self.bench.told().running = None;
        if let Err(failed) = &ended.outcome
            && failed.failure != Failure::Interrupted
        {
            self.watched = None;
            let what = failed.failure.words();
            self.bench.tell("warning", words!("{name}: {what}", name = self.name(drive), what));
        }
    }

    fn choose_watched(&mut self, page: PageNumber, drive: Option<usize>, every_ms: u32) -> Result<(), Words> {
        if let Some(drive) = drive {
            self.drive(drive).ok_or_else(no_such_drive)?;
        }
        self.watched =
            drive.map(|drive| Watched { drive, every_ns: Nanoseconds::from(every_ms) * 1_000_000, page });
        Ok(())
    }

    /// A drive that can be moved.
    fn drive(&self, drive: usize) -> Option<(usize, TargetDrive)> {
        let known = self.place.drives.get(drive)?;
        Some((known.bus, known.target.clone()?))
    }

    fn name(&self, drive: usize) -> String {
        self.bench.told().drives.get(drive).map_or_else(String::new, |drive| drive.name.clone())
    }

    fn torque(&self, drive: usize) -> Torque {
        self.bench.told().torque.get(drive).copied().unwrap_or_default()
    }

    fn set_torque(&self, drive: usize, torque: Torque) {
        if let Some(own) = self.bench.told().torque.get_mut(drive) {
            *own = torque;
        }
    }

    fn task(&mut self, page: PageNumber, stops: u64, drive: usize, task: &AskedTask) -> Result<(), Words> {
        let (bus, target) = self.drive(drive).ok_or_else(no_such_drive)?;
        let has_torque = matches!(self.torque(drive), Torque::Held(_));
        let carried = task.task(&target, has_torque).map_err(|failure| failure.words())?;
        let keeps = match &carried {
            Task::Enable { .. } => true,
            Task::Move { keeps_enabled, .. } | Task::Velocity { keeps_enabled, .. } => *keeps_enabled,
            _ => false,
        };
        self.running(Some(drive), bus, task.name(), false);
        if task.may_give_torque() {
            // From the first frame on: whatever ends this thread finds it.
            self.set_torque(drive, Torque::Held(page));
        }
        let ended =
            self.carry(drive, bus, target, carried, &|bench| Interruption::of(bench, page, false, stops));
        let told = outcome(drive, task.name(), &ended.outcome, &ended.notes);
        match &ended.outcome {
            Ok(_) if task.may_give_torque() && !keeps => self.set_torque(drive, Torque::Off),
            Ok(_) if matches!(task, AskedTask::Disable {}) => self.set_torque(drive, Torque::Off),
            Ok(_) => {}
            // The procedure has tried to disable it; this makes sure.
            Err(_) if ended.has_sent && task.may_give_torque() => self.disable(drive),
            Err(_) if ended.has_sent && matches!(task, AskedTask::Disable {}) => {
                self.tell_torque_unsure(drive)
            }
            Err(_) if !has_torque && task.may_give_torque() => self.set_torque(drive, Torque::Off),
            Err(_) => {}
        }
        self.bench.gate.tell(None, |_| message("outcome", &told));
        Ok(())
    }

    /// Takes the torque from a drive, whoever is there.
    fn disable(&mut self, drive: usize) {
        let Some((bus, target)) = self.drive(drive) else { return };
        self.running(Some(drive), bus, "disable", false);
        let ended = self.carry(drive, bus, target, Task::Disable, &|bench| Interruption::never(bench));
        match ended.outcome {
            Ok(_) => self.set_torque(drive, Torque::Off),
            Err(_) => self.tell_torque_unsure(drive),
        }
        self.bench.told().running = None;
    }

    /// The drive was to be disabled, and has not confirmed it.
    fn tell_torque_unsure(&self, drive: usize) {
        self.set_torque(drive, Torque::Unsure);
        let name = self.name(drive);
        self.bench.tell(
            "fault",
            words!("{name} may still have torque: it could not be disabled. Use the emergency stop", name),
        );
    }

    fn disable_where(&mut self, is_meant: impl Fn(Torque) -> bool) {
        for drive in 0..self.place.drives.len() {
            let torque = self.torque(drive);
            if torque != Torque::Off && is_meant(torque) {
                self.disable(drive);
            }
        }
    }

    /// Drives may have obeyed frames that a page has sent.
    fn disable_touched(&mut self) {
        let Some((bus, _)) = self.touched.take() else { return };
        for drive in 0..self.place.drives.len() {
            if self.place.drives.get(drive).is_some_and(|known| known.bus == bus) {
                self.disable(drive);
            }
        }
    }

    /// Disables the drives whose page is gone, and all of them after a stop.
    fn keep_safe(&mut self) {
        let stops = self.bench.stops();
        let is_stopped = stops != self.stops;
        self.stops = stops;
        let bench = Arc::clone(&self.bench);
        self.disable_where(|torque| match torque {
            Torque::Off => false,
            Torque::Held(page) => is_stopped || !bench.may_move(page),
            Torque::Unsure => is_stopped,
        });
        if self.touched.is_some_and(|(_, page)| is_stopped || !bench.may_move(page)) {
            self.disable_touched();
        }
        if is_stopped {
            self.bench.tell("warning", "a page has stopped everything".into());
        }
    }

    fn show_health(&mut self) {
        if self.health_at.is_some_and(|at| at.elapsed() < HEALTH_EVERY) {
            return;
        }
        self.health_at = Some(Instant::now());
        let health = |bus: &mut BenchBus| match &mut bus.link {
            BenchLink::Bus(port) => Some(port.health()),
            BenchLink::Line(..) => None,
        };
        let health = self.place.buses.iter_mut().map(health).collect();
        self.bench.told().health = health;
    }

    /// Carries a task out with a drive.
    fn carry(
        &mut self,
        drive: usize,
        number: usize,
        target: TargetDrive,
        task: Task,
        interruption: &dyn for<'a> Fn(&'a Bench) -> Interruption<'a>,
    ) -> Ended {
        let bench = Arc::clone(&self.bench);
        let mut watcher = Watcher::new(&bench, number, Some(drive));
        let Workplace { buses, ownership, .. } = &mut self.place;
        let outcome = match buses.get_mut(number) {
            None => Err(refused(Failure::Unsuitable("there is no such bus".to_owned()))),
            Some(bus) => on(bus, target, task, ownership, interruption(&bench), &mut watcher),
        };
        let Watcher { notes, has_sent, .. } = watcher;
        Ended { outcome, notes, has_sent }
    }
}

fn no_such_drive() -> Words {
    "no drive has this number, or none that takt can move".into()
}

const fn refused(failure: Failure) -> ProcedureError {
    ProcedureError { step: "", failure }
}

/// Carries out a task on a bus or a line.
fn on(
    bus: &mut BenchBus,
    target: TargetDrive,
    task: Task,
    ownership: &mut Ownership,
    mut interruption: Interruption<'_>,
    watcher: &mut Watcher<'_>,
) -> Result<Report, ProcedureError> {
    let family = target.family();
    let is_interrupted = || interruption.poll(ownership);
    match &mut bus.link {
        BenchLink::Bus(port) => {
            let procedure = family.commission(target, task).map_err(refused)?.procedure;
            let decoder = &mut bus.decoder;
            let see = |_, event| watcher.see(decoder, &event);
            bus_session::run(procedure, port.as_mut(), &mut MonotonicClock::default(), is_interrupted, see)
        }
        BenchLink::Line(line, bit_rate) => {
            let word = target.drive.word;
            let task = family.commission_on_line(target, task, *bit_rate).ok_or_else(|| {
                let words = format!("the family {word} is on a CAN bus, not on a serial line");
                refused(Failure::Unsuitable(words))
            })?;
            let see = |_, event: LineEvent<'_>| watcher.see_line(&event);
            line_session::run(task.map_err(refused)?.procedure, line, is_interrupted, see).unwrap_or_else(
                |error| {
                    let failure = Failure::Request { what: error.to_string(), cure: None };
                    Err(ProcedureError { step: "serial line", failure })
                },
            )
        }
    }
}
