//! Drives that are found by a scan, or added by hand.

use std::ops::RangeInclusive;
use std::sync::Arc;

use takt_rt::Nanoseconds;
use takt_rt::linux::MonotonicClock;

use super::super::interruption::Interruption;
use super::super::told::{DriveView, FoundView, Torque};
use super::place::{BenchDrive, BenchLink, Workplace};
use super::watcher::Watcher;
use super::{PageNumber, Worker};
use takt::family;
use takt::family::scan::{BusScan, FoundDevice, LineScan, Scanned, scan_line};
use takt::words;
use takt::words::Words;
use takt_tools::commission::line_session::{self, LineEvent};
use takt_tools::commission::{TargetDrive, bus_scan};

/// How long a scan waits for an answer, and how long it listens.
const ANSWER_NS: Nanoseconds = 100_000_000;
const LISTENING_NS: Nanoseconds = 1_200_000_000;

impl Worker {
    /// Looks for drives on a bus, and puts them into the list.
    pub(super) fn scan(
        &mut self,
        page: PageNumber,
        stops: u64,
        number: usize,
        nodes: RangeInclusive<u8>,
    ) -> Result<(), Words> {
        if (0..self.place.drives.len()).any(|drive| self.torque(drive) != Torque::Off) {
            return Err("a drive has torque: disable it first".into());
        }
        self.running(None, number, "scan", false);
        let bench = Arc::clone(&self.bench);
        let mut watcher = Watcher::new(&bench, number, None);
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
                    of_controller: None,
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
                scanned.map_err(|failed| failed.failure.words())?
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
        let count = scanned.devices.len();
        let ended = match scanned.is_interrupted {
            true => words!("{name}: {count} found, interrupted", name, count),
            false => words!("{name}: {count} found", name, count),
        };
        self.bench.tell("info", ended);
        for remark in &scanned.remarks {
            let what = Words::from(remark.clone());
            self.bench.tell("warning", words!("{name}: {what}", name, what));
        }
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

    /// Puts a drive of a family into the list that no scan has found.
    pub(super) fn add(&mut self, bus: usize, node: u8, word: &str) -> Result<(), Words> {
        if bus >= self.place.buses.len() {
            return Err("there is no such bus".into());
        }
        let drive = family::named(word).and_then(|family| family.unconfigured());
        let drive = drive.ok_or_else(|| {
            words!("a drive of {family} needs a configuration", family = format!("{word:?}"))
        })?;
        let target = TargetDrive::unconfigured(node, drive).map_err(|error| error.to_string())?;
        let bench = Arc::clone(&self.bench);
        let mut told = bench.told();
        let known = told.drives.iter().position(|drive| drive.bus == bus && drive.node == Some(node));
        match known {
            Some(known) if told.drives.get(known).is_some_and(|drive| drive.family.is_some()) => {
                return Err(words!("node {node} is in the list already", node));
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
}
