//! The one thread that owns the buses: it carries out one errand after the other, and takes the torque from drives whose page is gone.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::json;
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};

use super::super::gate::{locked, message};
use super::super::pages::PageNumber;
use super::asked::{Ask, AskedTask};
use super::frames::FrameView;
use super::interruption::Interruption;
use super::told::{BusView, DriveView, FoundView, RunningView, Told, Torque, outcome};
use super::{Bench, Errand};
use crate::bus_log::frame_text;
use crate::commission::bus_session::{self, SessionEvent};
use crate::commission::line_session::{self, LineEvent};
use crate::commission::{Failure, ProcedureError, ProcedureEvent, Report, TargetDrive, Task, bus_scan};
use crate::controller::port::Port;
use crate::family;
use crate::family::scan::{BusScan, FoundDevice, LineScan, Scanned, scan_line};
use crate::link::modbus_line::ModbusLine;
use crate::link::ownership::Ownership;
use crate::monitor::BusDecoder;

/// The pause between two looks at buses on which nothing is done.
const POLL: Duration = Duration::from_millis(2);
/// How long a scan waits for an answer, and how long it listens.
const ANSWER_NS: Nanoseconds = 100_000_000;
const LISTENING_NS: Nanoseconds = 1_200_000_000;
/// How long drives are listened to before a frame is sent, as `takt send` does.
const TORQUE_NS: Nanoseconds = 300_000_000;
/// How often the pages are told the state of the buses.
const HEALTH_EVERY: Duration = Duration::from_millis(250);
/// Batches that are read from a bus in one look.
const BATCHES: usize = 32;

/// What a bus is reached by.
pub enum BenchLink {
    /// A CAN bus.
    Bus(Box<Port>),
    /// A serial line of this bit rate.
    Line(ModbusLine, u32),
}

/// An open bus.
pub struct BenchBus {
    /// Its name for people.
    pub name: String,
    /// Its interface.
    pub interface: String,
    /// What it is reached by.
    pub link: BenchLink,
    /// What its frames mean.
    pub decoder: BusDecoder,
    /// Whether it carries CAN FD frames.
    pub has_fd: bool,
}

/// A drive and its bus.
#[derive(Clone, Debug)]
pub struct BenchDrive {
    /// The number of the bus.
    pub bus: usize,
    /// The drive; `None` where no family here moves it.
    pub target: Option<TargetDrive>,
}

/// Buses that this process owns, with their drives.
pub struct Workplace {
    /// The name for people.
    pub name: String,
    /// The buses.
    pub buses: Vec<BenchBus>,
    /// The drives that are known from the beginning.
    pub drives: Vec<BenchDrive>,
    /// The right to command the buses.
    pub ownership: Ownership,
}

impl Workplace {
    /// What pages are told of it at first.
    pub fn told(&self) -> Told {
        let buses = self.buses.iter().map(|bus| BusView {
            name: bus.name.clone(),
            interface: bus.interface.clone(),
            is_line: matches!(bus.link, BenchLink::Line(..)),
        });
        let drives =
            self.drives.iter().filter_map(|drive| Some(DriveView::of(drive.target.as_ref()?, drive.bus)));
        let families = family::all().into_iter().filter(|family| family.unconfigured().is_some());
        Told {
            name: self.name.clone(),
            families: families.map(|family| family.word()).collect(),
            buses: buses.collect(),
            drives: drives.collect(),
            torque: vec![Torque::Off; self.drives.len()],
            health: vec![None; self.buses.len()],
            running: None,
            watched: None,
            reading: None,
            version: 1,
        }
    }
}

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
    /// Whether anything was sent.
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
            let problem = json!({ "error": "refused", "words": words });
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
            self.bench.tell("warning", format!("{}: {}", self.name(drive), failed.failure));
        }
    }

    fn choose_watched(
        &mut self,
        page: PageNumber,
        drive: Option<usize>,
        every_ms: u32,
    ) -> Result<(), String> {
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

    fn task(&mut self, page: PageNumber, stops: u64, drive: usize, task: &AskedTask) -> Result<(), String> {
        let (bus, target) = self.drive(drive).ok_or_else(no_such_drive)?;
        let has_torque = matches!(self.torque(drive), Torque::Held(_));
        let carried = task.task(&target, has_torque).map_err(|failure| failure.to_string())?;
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
            Err(_) if ended.has_sent && matches!(task, AskedTask::Disable {}) => self.give_up(drive),
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
            Err(_) => self.give_up(drive),
        }
        self.bench.told().running = None;
    }

    fn give_up(&self, drive: usize) {
        self.set_torque(drive, Torque::Unsure);
        let name = self.name(drive);
        self.bench.tell(
            "fault",
            format!("{name} may still have torque: it could not be disabled. Use the emergency stop"),
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
            self.bench.tell("warning", "a page has stopped everything".to_owned());
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
        let mut watcher =
            Watcher { bench: &bench, bus: number, drive: Some(drive), notes: vec![], has_sent: false };
        let Workplace { buses, ownership, .. } = &mut self.place;
        let outcome = match buses.get_mut(number) {
            None => Err(refused(Failure::Unsuitable("there is no such bus".to_owned()))),
            Some(bus) => on(bus, target, task, ownership, interruption(&bench), &mut watcher),
        };
        let Watcher { notes, has_sent, .. } = watcher;
        Ended { outcome, notes, has_sent }
    }

    fn scan(
        &mut self,
        page: PageNumber,
        stops: u64,
        number: usize,
        nodes: std::ops::RangeInclusive<u8>,
    ) -> Result<(), String> {
        if (0..self.place.drives.len()).any(|drive| self.torque(drive) != Torque::Off) {
            return Err("a drive has torque: disable it first".to_owned());
        }
        self.running(None, number, "scan", false);
        let bench = Arc::clone(&self.bench);
        let mut watcher = Watcher { bench: &bench, bus: number, drive: None, notes: vec![], has_sent: false };
        let mut interruption = Interruption::of(&bench, page, false, stops);
        let Workplace { buses, ownership, .. } = &mut self.place;
        let bus = buses.get_mut(number).ok_or("there is no such bus")?;
        let name = bus.name.clone();
        let scanned = match &mut bus.link {
            BenchLink::Bus(port) => {
                let what = BusScan {
                    nodes,
                    wait_ns: ANSWER_NS,
                    listening_ns: LISTENING_NS,
                    only_listens: false,
                    may_take_torque: false,
                    has_fd: bus.has_fd,
                };
                let decoder = &mut bus.decoder;
                let mut clock = MonotonicClock::default();
                bus_scan::scan(
                    &what,
                    true,
                    port.as_mut(),
                    &mut clock,
                    &mut || interruption.poll(ownership),
                    &mut |_, event| watcher.see(decoder, &event),
                )
            }
            BenchLink::Line(line, bit_rate) => {
                let what = LineScan { nodes, bit_rate: *bit_rate, wait_ns: ANSWER_NS };
                let scan = Box::new(scan_line(what));
                let is_interrupted = || interruption.poll(ownership);
                let see = |_, event: LineEvent<'_>| watcher.see_line(&event);
                let scanned =
                    line_session::run(scan, line, is_interrupted, see).map_err(|error| error.to_string())?;
                scanned.map_err(|failed| failed.failure.to_string())?
            }
        };
        self.found(number, &name, &scanned);
        Ok(())
    }

    fn found(&mut self, bus: usize, name: &str, scanned: &Scanned) {
        for device in &scanned.devices {
            self.add_found(bus, device);
        }
        self.bench.told().version += 1;
        let ended = if scanned.is_interrupted { ", interrupted" } else { "" };
        self.bench.tell("info", format!("{name}: {} found{ended}", scanned.devices.len()));
        scanned.remarks.iter().for_each(|remark| self.bench.tell("warning", format!("{name}: {remark}")));
    }

    fn add_found(&mut self, bus: usize, device: &FoundDevice) {
        let bench = Arc::clone(&self.bench);
        let mut told = bench.told();
        let is_known = |drive: &DriveView| {
            let is_same = device.node.is_some() || drive.found.as_ref().is_some_and(|found| found.is(device));
            drive.bus == bus && drive.node == device.node && is_same
        };
        if let Some(known) = told.drives.iter_mut().find(|drive| is_known(drive)) {
            known.found = Some(FoundView::of(device));
            return;
        }
        let drive = device.drive.and_then(family::named).and_then(|family| family.unconfigured());
        let target =
            device.node.zip(drive).and_then(|(node, drive)| TargetDrive::unconfigured(node, drive).ok());
        let mut view = DriveView::found(device, bus);
        if let Some(target) = &target {
            view = DriveView { found: view.found, ..DriveView::of(target, bus) };
        }
        told.drives.push(view);
        told.torque.push(Torque::Off);
        drop(told);
        self.place.drives.push(BenchDrive { bus, target });
    }

    fn add(&mut self, bus: usize, node: u8, word: &str) -> Result<(), String> {
        if bus >= self.place.buses.len() {
            return Err("there is no such bus".to_owned());
        }
        let drive = family::named(word).and_then(|family| family.unconfigured());
        let drive = drive.ok_or_else(|| format!("a drive of {word:?} needs a configuration"))?;
        let target = TargetDrive::unconfigured(node, drive).map_err(|error| format!("{error:?}"))?;
        let bench = Arc::clone(&self.bench);
        let mut told = bench.told();
        let known = told.drives.iter().position(|drive| drive.bus == bus && drive.node == Some(node));
        match known {
            Some(known) if told.drives.get(known).is_some_and(|drive| drive.family.is_some()) => {
                return Err(format!("node {node} is in the list already"));
            }
            Some(known) => {
                if let (Some(view), Some(own)) =
                    (told.drives.get_mut(known), self.place.drives.get_mut(known))
                {
                    *view = DriveView { found: view.found.take(), ..DriveView::of(&target, bus) };
                    own.target = Some(target);
                }
            }
            None => {
                told.drives.push(DriveView::of(&target, bus));
                told.torque.push(Torque::Off);
                self.place.drives.push(BenchDrive { bus, target: Some(target) });
            }
        }
        told.version += 1;
        Ok(())
    }

    /// Reads what has come on a bus. Returns who has shown torque.
    fn listen(&mut self, number: usize) -> Option<String> {
        let bench = Arc::clone(&self.bench);
        let mut enabled = None;
        let BenchBus { link: BenchLink::Bus(port), decoder, .. } = self.place.buses.get_mut(number)? else {
            return None;
        };
        let mut clock = MonotonicClock::default();
        for _ in 0..BATCHES {
            let mut batch = ReceiveBatch::new();
            port.receive(clock.now_ns(), &mut batch);
            for received in &batch {
                enabled = keep(&bench, number, decoder, '<', &received.frame).or(enabled);
            }
            if !batch.is_full() {
                break;
            }
        }
        enabled
    }

    fn send(
        &mut self,
        page: PageNumber,
        stops: u64,
        number: usize,
        text: &str,
        count: u32,
        period: Duration,
    ) -> Result<(), String> {
        let frame = frame_text::parse(text).map_err(|error| error.to_string())?;
        if let Some(drive) = (0..self.place.drives.len()).find(|drive| self.torque(*drive) != Torque::Off) {
            return Err(format!("{} has torque. Nothing was sent: disable it first", self.name(drive)));
        }
        let bus = self.place.buses.get(number).ok_or("there is no such bus")?;
        if matches!(bus.link, BenchLink::Line(..)) {
            return Err("a serial line carries no frames".to_owned());
        }
        self.running(None, number, "send", false);
        let bench = Arc::clone(&self.bench);
        let mut interruption = Interruption::of(&bench, page, false, stops);
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_nanos(TORQUE_NS) {
            if let Some(who) = self.listen(number) {
                return Err(format!("{who} has torque. Nothing was sent: disable it first"));
            }
            if interruption.poll(&mut self.place.ownership) {
                return Ok(());
            }
            thread::sleep(POLL);
        }
        self.touched = Some((number, page));
        for time in 0..count {
            let due = Instant::now() + if time == 0 { Duration::ZERO } else { period };
            while Instant::now() < due {
                self.listen(number);
                if interruption.poll(&mut self.place.ownership) {
                    return Ok(());
                }
                thread::sleep(POLL);
            }
            self.hand_over(number, &frame)?;
        }
        Ok(())
    }

    fn hand_over(&mut self, number: usize, frame: &Frame) -> Result<(), String> {
        let bench = Arc::clone(&self.bench);
        let Some(BenchBus { link: BenchLink::Bus(port), decoder, .. }) = self.place.buses.get_mut(number)
        else {
            return Err("there is no such bus".to_owned());
        };
        if port.send(MonotonicClock::default().now_ns(), &[*frame]) != 1 {
            return Err(format!("{frame:?} was not taken by the interface"));
        }
        keep(&bench, number, decoder, '>', frame);
        Ok(())
    }
}

fn no_such_drive() -> String {
    "no drive has this number, or none that takt can move".to_owned()
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

/// Tells the pages what a procedure does.
struct Watcher<'a> {
    bench: &'a Bench,
    bus: usize,
    drive: Option<usize>,
    notes: Vec<String>,
    has_sent: bool,
}

impl Watcher<'_> {
    fn see(&mut self, decoder: &mut BusDecoder, event: &SessionEvent) {
        let (direction, frame) = match event {
            SessionEvent::Procedure(event) => return self.see_procedure(event),
            SessionEvent::Sent(frame) => ('>', frame),
            SessionEvent::Received(frame) => ('<', frame),
        };
        self.has_sent |= direction == '>';
        keep(self.bench, self.bus, decoder, direction, frame);
    }

    fn see_line(&mut self, event: &LineEvent<'_>) {
        let (direction, bytes) = match event {
            LineEvent::Procedure(event) => return self.see_procedure(event),
            LineEvent::Sent(bytes) => ('>', bytes),
            LineEvent::Received(bytes) => ('<', bytes),
        };
        self.has_sent |= direction == '>';
        let frame: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        push(
            self.bench,
            FrameView { direction, bus: self.bus, frame, number: 0, time: 0.0, words: String::new() },
        );
    }

    fn see_procedure(&mut self, event: &ProcedureEvent) {
        let mut told = self.bench.told();
        match event {
            ProcedureEvent::Step(name) => {
                if let Some(running) = &mut told.running {
                    running.step = name;
                }
            }
            ProcedureEvent::Progress { done, of } => {
                if let Some(running) = &mut told.running {
                    (running.done, running.of) = (*done, *of);
                }
            }
            ProcedureEvent::Reading(reading) => told.reading = self.drive.map(|drive| (drive, *reading)),
            ProcedureEvent::Note(text) => self.notes.push(text.clone()),
        }
    }
}

/// Keeps a frame for the monitor. Returns who has shown torque by it.
fn keep(
    bench: &Bench,
    bus: usize,
    decoder: &mut BusDecoder,
    direction: char,
    frame: &Frame,
) -> Option<String> {
    let decoded = decoder.decode(frame);
    let words = decoded.line();
    push(bench, FrameView { direction, bus, frame: format!("{frame:?}"), number: 0, time: 0.0, words });
    (direction == '<' && decoded.shows_torque == Some(true)).then_some(decoded.who)
}

fn push(bench: &Bench, frame: FrameView) {
    let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let time = time.map_or(0.0, |time| time.as_secs_f64());
    locked(&bench.frames).push(FrameView { time, ..frame });
}
