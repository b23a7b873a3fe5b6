//! `takt doctor`: is this machine fit for the loop?

use std::io::{IsTerminal, stderr};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use takt_tools::doctor::{SelfTest, Source, Subject, Verdict, attempt, examine};
use takt_tools::jitter::{self, JitterOptions, Pacing};

use super::configuration;
use super::exit::Exit;
use super::interruption;
use super::print;

/// Say whether this machine is fit for the loop, and how to make it so. Ends with 1 when something forbids real time.
#[derive(Args, Debug)]
pub struct Arguments {
    /// A configuration: its priority, CPU, period and CAN interfaces are checked. Without it, the defaults and every CAN
    /// interface of this machine
    config: Option<PathBuf>,
    /// Run the loop for this many seconds and grade its timing; 0 skips the self-test
    #[arg(long, value_name = "S", default_value_t = 10, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(0..=86_400))]
    self_test_s: u64,
    /// Print what was found as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    let config = match arguments.config.as_deref().map(|path| configuration::load(path, &[])).transpose() {
        Ok(config) => config,
        Err(error) => return error.print(arguments.json),
    };
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let subject = Subject::new(config.as_ref());
    let Some(attempted) = attempt(&subject) else {
        say!("takt: no thread could be started to try out the real-time set-up");
        return Exit::Stopped;
    };
    let mut examination = examine(&Source::this_machine(), &subject, &attempted);
    if arguments.self_test_s > 0 {
        match self_test(&subject, arguments.self_test_s, &interrupted) {
            Ok(Some(result)) => examination = examination.with_self_test(result),
            Ok(None) => say!("takt: the self-test did not complete a single cycle"),
            Err(error) => say!("takt: no self-test: {error}"),
        }
    }
    let exit = if interrupted.load(Ordering::Relaxed) {
        Exit::Interrupted
    } else if examination.verdict == Verdict::ForbidsRealTime {
        Exit::Stopped
    } else {
        Exit::Done
    };
    if arguments.json {
        return print::json(&examination, exit);
    }
    print::text(&examination.render(print::emphasis()), exit)
}

/// Runs the loop of the subject, without a bus.
fn self_test(
    subject: &Subject,
    duration_s: u64,
    interrupted: &AtomicBool,
) -> Result<Option<SelfTest>, jitter::JitterError> {
    let cycles = (duration_s * 1_000_000_000).div_ceil(subject.period_ns);
    let options =
        JitterOptions { period_ns: subject.period_ns, cycles, interface: None, realtime: subject.realtime };
    let bar = progress_bar(cycles);
    let measurement = jitter::measure(&options, Pacing::SleepThenSpin, |done| {
        bar.set_position(done);
        !interrupted.load(Ordering::Relaxed)
    });
    bar.finish_and_clear();
    Ok(SelfTest::new(&measurement?, subject.period_ns))
}

fn progress_bar(cycles: u64) -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(cycles);
    if let Ok(style) = ProgressStyle::with_template("self-test  [{bar:40}]  {pos} of {len} cycles") {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar
}
