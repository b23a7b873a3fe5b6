//! `takt top`: a view of a running controller in the terminal, and a hand on it.
//!
//! - `model`: what is known, and what a key leads to; without I/O.
//! - `jog`: the dead-man of a held key.
//! - `view`: draws the model.
//! - `terminal`: keys in, pictures out, requests to the controller.

mod jog;
mod model;
mod request;
mod terminal;
mod view;

#[cfg(test)]
mod tests;

use std::io::{IsTerminal, stdin, stdout};

use clap::Args;

use super::exit::Exit;
use super::usage_error::UsageError;
use takt_remote::{ConnectError, connect, names_in_use};

/// Show a running controller in the terminal: axes, timing, buses, events; jog and stop by keys
///
/// The controller is one that another process serves: `takt run CONFIG --serve NAME`. To look at it needs no lease and changes nothing. `?` shows
/// the keys.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The name by which the controller is served; not needed where one is
    name: Option<String>,
    /// Print the names of the controllers that are served on this computer, and end
    #[arg(long, conflicts_with = "name")]
    list: bool,
}

const NONE_SERVED: &str =
    "no controller is served on this computer; serve one with: takt run CONFIG --serve NAME";

/// Shows it until `q` is pressed. The exit code is 2 without a terminal, or without a controller.
pub fn run(arguments: &Arguments) -> Exit {
    if arguments.list {
        let names = names_in_use();
        if names.is_empty() {
            say!("takt: {NONE_SERVED}");
        }
        return super::print::text(
            &names.iter().map(|name| format!("{name}\n")).collect::<String>(),
            Exit::Done,
        );
    }
    if !(stdin().is_terminal() && stdout().is_terminal()) {
        let words = "`takt top` needs a terminal for its keys and its picture; `takt run --json` and `takt run --metrics` tell programs";
        return UsageError::from(words.to_owned()).print(false);
    }
    let client = named(arguments.name.as_deref()).and_then(|name| {
        let client = connect(&name).map_err(|error| refusal(&error))?;
        Ok((name, client))
    });
    match client {
        Ok((name, client)) => terminal::show(&name, client),
        Err(words) => UsageError::from(words).print(false),
    }
}

/// The name that was given, or the only one that is served.
fn named(name: Option<&str>) -> Result<String, String> {
    match name {
        Some(name) => Ok(name.to_owned()),
        None => only(names_in_use()),
    }
}

fn only(mut names: Vec<String>) -> Result<String, String> {
    match (names.pop(), names.len()) {
        (None, _) => Err(NONE_SERVED.to_owned()),
        (Some(name), 0) => Ok(name),
        (Some(last), _) => {
            names.push(last);
            Err(format!("several controllers are served; name one of them: {}", names.join(", ")))
        }
    }
}

fn refusal(error: &ConnectError) -> String {
    let names = names_in_use();
    match error {
        ConnectError::NotServed { .. } if !names.is_empty() => {
            format!("{error}; served are: {}", names.join(", "))
        }
        _ => error.to_string(),
    }
}
