//! `takt plan`: trajectories for problems in JSON lines, without any drive.

mod answer;
mod plot;
mod question;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};

use clap::Args;
use takt_rt::plan::Profile;

use super::columns::paragraph;
use super::exit::Exit;
use super::print;
use super::usage_error::UsageError;
use answer::Answer;
use question::Question;

/// Plan trajectories: one problem a line in JSON, one answer a line out
#[derive(Args, Clone, Debug)]
#[command(after_long_help = format())]
pub struct Arguments {
    /// Where the problems are; standard input when there is none
    problems: Option<PathBuf>,
    /// Draw position, velocity, acceleration and jerk of the first trajectory, with their limits
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// The keys of a problem, with their meaning.
const OF_PROBLEM: [(&str, &str); 12] = [
    (
        "p0, v0, a0",
        "position, velocity and acceleration at the start; p0 is required, the others are 0 when left out",
    ),
    ("pf, vf, af", "the same at the target, 0 when left out"),
    ("vmax, amax", "highest velocity and acceleration, required"),
    ("vmin, amin", "the lowest ones, below 0; -vmax and -amax when left out"),
    ("jmax", "highest jerk; null or left out: no limit"),
    ("pmin, pmax", "position limits; null or left out: none"),
    ("interface", "\"position\" (default), or \"velocity\": reach vf and af wherever that is"),
    (
        "sync",
        "\"time\" (default): all axes arrive together; \"phase\": on a straight line where that is possible; \"straight\": on a straight \
         line or not at all; \"none\": each as soon as it can",
    ),
    ("dt", "the duration is a multiple of this (s), and the answer has a sample at each multiple"),
    ("t", "the sample times (s), for others than those"),
    ("min_duration", "the trajectory takes at least so long (s)"),
    ("id", "anything; the answer repeats it"),
];

/// The keys of an answer.
const OF_ANSWER: [(&str, &str); 5] = [
    ("id, result", "result is \"ok\" or the name of what is wrong, which `message` says in words"),
    ("duration", "of the trajectory (s)"),
    ("t_min", "how soon each axis could arrive by itself (s)"),
    (
        "t, p, v, a",
        "sample times (s), and one list an axis at each of them; 16 samples from start to end without t and dt",
    ),
    ("pmin, pmax", "the lowest and the highest position of each axis on its way"),
];

/// For the help: what a problem and an answer look like.
fn format() -> String {
    const MEANING_AT: usize = 17;
    let lines = |keys: &[(&str, &str)]| {
        let line = |(key, meaning): &(&str, &str)| paragraph(&format!("  {key:<13}  {meaning}"), MEANING_AT);
        keys.iter().map(line).collect::<Vec<_>>().join("\n")
    };
    let problem = paragraph(
        "A problem is one object in one line. Each list has one number an axis; any unit will do, as long as it is the same throughout:",
        0,
    );
    format!(
        "{problem}\n\n  echo '{{\"p0\": [0], \"pf\": [1], \"vmax\": [2], \"amax\": [8]}}' |\n    takt plan --plot trajectory.svg\n\n{}\n\n\
         An answer is one object in one line:\n\n{}",
        lines(&OF_PROBLEM),
        lines(&OF_ANSWER)
    )
}

/// Answers every line. The exit code is 2 when a line is no problem or the file cannot be read, 1 when an answer or the
/// plot cannot be written, else 0: a problem without a solution is a valid answer.
pub fn run(arguments: &Arguments) -> Exit {
    match answer_all(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(false),
    }
}

fn answer_all(arguments: &Arguments) -> Result<Exit, UsageError> {
    let name = arguments.problems.as_ref().map_or("standard input".into(), |path| path.to_string_lossy());
    let unreadable = |error: io::Error| format!("{name} cannot be read: {error}");
    let input: Box<dyn BufRead> = match &arguments.problems {
        Some(path) => Box::new(BufReader::new(File::open(path).map_err(unreadable)?)),
        None => Box::new(io::stdin().lock()),
    };
    let mut exit = Exit::Done;
    let mut plot = arguments.plot.as_deref();
    for (index, line) in lines(input).enumerate() {
        let line = line.map_err(unreadable)?;
        if line.trim_ascii().is_empty() {
            continue;
        }
        let text = str::from_utf8(line.trim_ascii_end()).map_err(|error| format!("this is no text: {error}"));
        let answer = match text.and_then(Question::parse) {
            Ok(question) => {
                let (answer, trajectory) = question.solve();
                if let (Some(path), Some(trajectory)) = (plot, trajectory) {
                    plot = None;
                    if !draw(path, &question, &trajectory) {
                        exit = exit.and_failed();
                    }
                }
                answer
            }
            Err(message) => {
                exit = Exit::Usage;
                Answer::malformed(index + 1, message)
            }
        };
        // A program that asks one problem after the other waits for each answer.
        let json = serde_json::to_string(&answer).map_err(io::Error::from);
        match json.and_then(|json| print::write(&format!("{json}\n"))) {
            Ok(true) => {}
            Ok(false) => return Ok(exit),
            Err(error) => return Ok(print::unwritten(&error, exit)),
        }
    }
    if let Some(path) = plot {
        say!("takt: {} is not written: there is no trajectory to plot", path.display());
    }
    Ok(exit)
}

/// The longest line that is read.
const LONGEST_LINE: u64 = 64 << 20;

fn lines(mut input: impl BufRead) -> impl Iterator<Item = io::Result<Vec<u8>>> {
    std::iter::from_fn(move || {
        let mut line = Vec::new();
        match input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) => None,
            Ok(read) if read as u64 == LONGEST_LINE => Some(Err(io::Error::other("a line does not end"))),
            Ok(_) => Some(Ok(line)),
            Err(error) => Some(Err(error)),
        }
    })
}

fn draw(path: &Path, question: &Question, trajectory: &[Profile]) -> bool {
    let written = std::fs::write(path, plot::draw(&question.problems(), trajectory));
    if let Err(error) = &written {
        say!("takt: {} cannot be written: {error}", path.display());
    }
    written.is_ok()
}
