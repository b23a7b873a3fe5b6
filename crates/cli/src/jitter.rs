//! `takt jitter`: how evenly this machine paces the loop.

mod histograms;

use std::fs;
use std::io::{IsTerminal, stderr};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use takt::config::Interface;
use takt_tools::jitter::{self, JitterOptions, JitterReport, Measurement, Pacing};

use super::exit::Exit;
use super::interruption;
use super::print;
use super::usage_error::UsageError;

/// Measure how evenly this machine paces the loop: sleeping only, and sleeping, then spinning.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Send SYNC to this interface in every slot: can0, vcan0, slcan:/dev/ttyACM0, sim. Drives on it that are enabled will see it
    #[arg(long, value_name = "INTERFACE", value_parser = interface)]
    bus: Option<Interface>,
    /// Period of the cycle, in whole microseconds
    #[arg(long, value_name = "N", default_value_t = 1_000, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(250..=100_000))]
    period_us: u64,
    /// Cycles to measure for each kind of pacing
    #[arg(long, value_name = "N", default_value_t = 10_000, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..))]
    cycles: u64,
    /// SCHED_FIFO priority; 0 stays in the normal class
    #[arg(long, value_name = "P", default_value_t = 80, allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// The CPU to run on [default: the last one, with SCHED_FIFO]
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    cpu: Option<usize>,
    /// Draw the histograms into this file
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

fn interface(text: &str) -> Result<Interface, String> {
    let interface: Interface =
        text.parse().map_err(|error: takt::config::InterfaceError| format!("{error}: {}", error.help()))?;
    interface.lacks_canopen().map_or(Ok(interface), Err)
}

impl Arguments {
    fn options(&self) -> JitterOptions {
        let mut options = JitterOptions {
            period_ns: self.period_us * 1_000,
            cycles: self.cycles,
            interface: self.bus.clone(),
            ..JitterOptions::default()
        };
        options.realtime.priority = (self.priority > 0).then_some(self.priority);
        options.realtime.cpu = self.cpu;
        options
    }
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let options = arguments.options();
    let mut measurements = Vec::new();
    for pacing in [Pacing::Sleep, Pacing::SleepThenSpin] {
        match measure(&options, pacing, &interrupted) {
            Ok(measurement) => measurements.push(measurement),
            Err(error) => return UsageError::from(error.to_string()).print(arguments.json),
        }
        if is_broken_off(&measurements) {
            break;
        }
    }
    let is_drawn = arguments.svg.as_ref().is_none_or(|path| draw(path, &options, &measurements));
    let exit = match (is_broken_off(&measurements), is_drawn) {
        (true, _) => Exit::Interrupted,
        (false, true) => Exit::Done,
        (false, false) => Exit::Stopped,
    };
    match JitterReport::new(&options, &measurements) {
        Some(report) if arguments.json => print::json(&report, exit),
        Some(report) => print::text(&report.render(print::emphasis()), exit),
        None => exit,
    }
}

/// Returns `true` if Ctrl-C, or another process that takes the interface over, has ended the measurement.
fn is_broken_off(measurements: &[Measurement]) -> bool {
    measurements.iter().any(|measurement| !measurement.is_whole)
}

fn measure(
    options: &JitterOptions,
    pacing: Pacing,
    interrupted: &AtomicBool,
) -> Result<Measurement, jitter::JitterError> {
    let bar = progress_bar(options.cycles, pacing);
    let measurement = jitter::measure(options, pacing, |cycles| {
        bar.set_position(cycles);
        !interrupted.load(Ordering::Relaxed)
    });
    bar.finish_and_clear();
    measurement
}

fn progress_bar(cycles: u64, pacing: Pacing) -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(cycles);
    if let Ok(style) = ProgressStyle::with_template("{prefix:<16}  [{bar:40}]  {pos} of {len} cycles") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_prefix(match pacing {
        Pacing::Sleep => "sleep only",
        Pacing::SleepThenSpin => "sleep, then spin",
    });
    bar
}

fn draw(path: &PathBuf, options: &JitterOptions, measurements: &[Measurement]) -> bool {
    let bus = options.interface.as_ref().map_or_else(String::new, |bus| format!(", SYNC on {bus}"));
    let title = format!("{} cycles of {} µs{bus}", options.cycles, options.period_ns / 1_000);
    let written = fs::write(path, histograms::draw(&title, measurements));
    if let Err(error) = &written {
        say!("takt: {} cannot be written: {error}", path.display());
    }
    written.is_ok()
}
