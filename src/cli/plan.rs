//! `takt plan`: trajectories for problems in JSON lines, without any drive.

mod answer;
mod plot;
mod question;

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;

use clap::Args;

use super::exit::Exit;
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

/// Answers every line. The exit code is 2 when a line is no problem or a file cannot be used, else 0: that a problem
/// has no answer is an answer.
pub fn run(arguments: &Arguments) -> Exit {
    match answer_all(arguments) {
        Ok(exit) => exit,
        Err(message) => {
            say!("{message}");
            Exit::Usage
        }
    }
}

fn answer_all(arguments: &Arguments) -> Result<Exit, String> {
    let name = arguments.problems.as_ref().map_or("standard input".into(), |path| path.to_string_lossy());
    let unreadable = |error: std::io::Error| format!("takt: {name} cannot be read: {error}");
    let input: Box<dyn BufRead> = match &arguments.problems {
        Some(path) => Box::new(BufReader::new(File::open(path).map_err(unreadable)?)),
        None => Box::new(std::io::stdin().lock()),
    };
    let mut output = std::io::BufWriter::new(std::io::stdout().lock());
    let mut exit = Exit::Done;
    let mut plot = arguments.plot.as_ref();
    for (index, line) in input.split(b'\n').enumerate() {
        let line = line.map_err(unreadable)?;
        if line.trim_ascii().is_empty() {
            continue;
        }
        let text = str::from_utf8(&line).map_err(|error| format!("this is no text: {error}"));
        let answer = match text.and_then(Question::parse) {
            Ok(question) => {
                let (answer, trajectory) = question.solve();
                if let (Some(path), Some(trajectory)) = (plot, trajectory) {
                    std::fs::write(path, plot::draw(&question.problems(), &trajectory))
                        .map_err(|error| format!("takt: {} cannot be written: {error}", path.display()))?;
                    plot = None;
                }
                answer
            }
            Err(message) => {
                exit = Exit::Usage;
                Answer::malformed(index + 1, message)
            }
        };
        let written = serde_json::to_writer(&mut output, &answer)
            .map_err(std::io::Error::from)
            .and_then(|()| output.write_all(b"\n"));
        if written.is_err() {
            // A reader that has seen enough (`| head`) is no failure.
            return Ok(exit);
        }
    }
    let _ = output.flush();
    Ok(exit)
}
