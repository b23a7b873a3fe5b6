//! `takt jitter`: how good this machine is at keeping time.

use clap::Args;
use serde::Serialize;

use takt::bus::{SocketCanOptions, open_socketcan};
use takt::config::Realtime;
use takt::controller::realtime_thread::thread_config;
use takt::jitter::{JitterOptions, JitterReport, JitterRun, measure};
use takt::telemetry::{LatencyReport, RealtimeReport};
use takt_rt::frame::{Frame, Id};
use takt_rt::linux::SocketCanPort;

use super::exit::Exit;
use super::table::Table;

/// Measure how exactly this machine keeps a period: wake-up latency and SYNC release error, sleeping alone against
/// sleeping and then spinning.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Send SYNC (identifier 080) on this CAN interface, which must be up
    #[arg(long, value_name = "INTERFACE")]
    bus: Option<String>,
    /// The period in microseconds
    #[arg(long, value_name = "US", default_value_t = 1_000, value_parser = clap::value_parser!(u64).range(50..=1_000_000))]
    period_us: u64,
    /// How many periods, in each of the two runs
    #[arg(long, value_name = "N", default_value_t = 5_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    cycles: u32,
    /// How long before a slot to stop sleeping and spin, in microseconds, instead of choosing it by measurement
    #[arg(long, value_name = "US")]
    spin_guard_us: Option<u64>,
    /// SCHED_FIFO priority
    #[arg(long, value_name = "1-99", default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,
    /// Stay on this CPU instead of the last one that may be used
    #[arg(long)]
    cpu: Option<usize>,
    /// Print the figures as one JSON object
    #[arg(long)]
    json: bool,
}

/// Measures and prints.
pub fn run(arguments: &Arguments) -> Exit {
    let port = match arguments.bus.as_deref().map(open).transpose() {
        Ok(port) => port,
        Err(error) => {
            eprintln!("takt: {error}");
            return Exit::Usage;
        }
    };
    let realtime = Realtime {
        priority: Some(arguments.priority),
        cpu: arguments.cpu,
        lock_memory: true,
        hold_dma_latency: true,
        spin_guard_ns: None,
    };
    let options = JitterOptions {
        period_ns: arguments.period_us * 1_000,
        cycles: usize::try_from(arguments.cycles).unwrap_or(usize::MAX),
        spin_guard_ns: arguments.spin_guard_us.map(|guard| guard.saturating_mul(1_000)),
        thread: thread_config(&realtime),
    };
    match measure(&options, Frame::of(Id::canopen(0x080, 0), []), port) {
        Ok(report) => {
            let printed = Printed::new(arguments, &report);
            if arguments.json { printed.json() } else { printed.text() }
        }
        Err(error) => {
            eprintln!("takt: {error}");
            Exit::Stopped
        }
    }
}

fn open(interface: &str) -> Result<SocketCanPort, takt::bus::SocketCanError> {
    let options =
        SocketCanOptions { identifiers: vec![Id::canopen(0x080, 0)], ..SocketCanOptions::default() };
    open_socketcan(interface, &options)
}

/// The report, as it is printed.
#[derive(Serialize)]
struct Printed<'a> {
    period_ns: u64,
    cycles: u32,
    interface: Option<&'a str>,
    sleep_only: Run,
    sleep_then_spin: Run,
    realtime: RealtimeReport,
}

#[derive(Serialize)]
struct Run {
    guard_ns: u64,
    missed_slots: u64,
    /// How late the timer was.
    wake_ns: LatencyReport,
    /// How late SYNC was released, against the grid.
    release_ns: LatencyReport,
}

impl Run {
    fn new(run: &JitterRun) -> Self {
        Self {
            guard_ns: run.guard_ns,
            missed_slots: run.missed_slots,
            wake_ns: LatencyReport::new(&run.wake),
            release_ns: LatencyReport::new(&run.release),
        }
    }
}

impl<'a> Printed<'a> {
    fn new(arguments: &'a Arguments, report: &JitterReport) -> Self {
        let faults = [&report.sleep_only, &report.sleep_then_spin].map(|run| run.page_faults);
        let faults = faults.iter().map(|faults| faults.minor + faults.major).sum();
        Self {
            period_ns: arguments.period_us * 1_000,
            cycles: arguments.cycles,
            interface: arguments.bus.as_deref(),
            sleep_only: Run::new(&report.sleep_only),
            sleep_then_spin: Run::new(&report.sleep_then_spin),
            realtime: RealtimeReport::new(&report.thread, report.sleep_then_spin.guard_ns, faults),
        }
    }

    fn json(&self) -> Exit {
        match serde_json::to_string(self) {
            Ok(json) => {
                println!("{json}");
                Exit::Done
            }
            Err(error) => {
                eprintln!("takt: the figures cannot be written as JSON: {error}");
                Exit::Stopped
            }
        }
    }

    fn text(&self) -> Exit {
        let mut table =
            Table::new(["µs", ">guard", ">min", ">median", ">99 %", ">99.9 %", ">max", ">missed"]);
        for (name, run) in [("sleep only", &self.sleep_only), ("sleep, then spin", &self.sleep_then_spin)] {
            for (what, latency) in [("wake-up", &run.wake_ns), ("SYNC release", &run.release_ns)] {
                let [min, median, p99, p999, max] =
                    [latency.min, latency.p50, latency.p99, latency.p999, latency.max].map(microseconds);
                let guard = microseconds(run.guard_ns);
                let name = format!("{name}: {what}");
                table.row([name, guard, min, median, p99, p999, max, run.missed_slots.to_string()]);
            }
        }
        print!("{table}");
        for (name, run) in [("sleep only", &self.sleep_only), ("sleep, then spin", &self.sleep_then_spin)] {
            println!();
            let title = format!("SYNC release error, {name} (cycles, logarithmic)");
            run.release_ns.picture(&title).iter().for_each(|line| println!("{}", line.trim_end()));
        }
        println!();
        self.realtime.refused.iter().for_each(|refused| println!("refused: {refused}"));
        self.realtime.grant_with.iter().for_each(|command| println!("grant it with: {command}"));
        if !self.realtime.preempt_rt {
            println!("this kernel is not PREEMPT_RT: its latency has no bound");
        }
        Exit::Done
    }
}

fn microseconds(ns: u64) -> String {
    format!("{:.2}", ns as f64 * 1e-3)
}
