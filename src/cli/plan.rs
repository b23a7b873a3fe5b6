//! `takt plan`: trajectories for problems in JSON lines, without any drive.

mod answer;
mod plot;
mod question;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};

use clap::Args;
use takt_rt::plan::Profile;

use super::exit::Exit;
use super::print;
use super::usage_error::UsageError;
use answer::Answer;
use question::Question;

/// Plan trajectories: one problem a line in JSON, one answer a line out
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// Where the problems are; standard input when there is none
    problems: Option<PathBuf>,
    /// Draw position, velocity, acceleration and jerk of the first trajectory, with their limits
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
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
