//! `takt sim --serial`: simulated drives on a serial line, behind a pseudo-terminal.

use std::str::FromStr;

use crate::exit::Exit;
use crate::interruption;
use crate::usage_error::UsageError;
use takt::family;
use takt_sim::pseudo_terminal::PseudoTerminal;
use takt_sim::serial_host;
use takt_sim::serial_line::DevicesOnLine;

use super::adapters::AdapterLink;

/// The drives of a line: their family, and the address of each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineDrives {
    family: String,
    addresses: Vec<u8>,
}

impl FromStr for LineDrives {
    type Err = String;

    /// `FAMILY:ADDRESS`, `FAMILY:ADDRESS,ADDRESS`.
    fn from_str(text: &str) -> Result<Self, String> {
        let shape = || format!("{text:?}: write it as FAMILY:ADDRESS, with more addresses behind commas");
        let (family, addresses) = text.split_once(':').ok_or_else(shape)?;
        let addresses: Result<Vec<u8>, _> = addresses.split(',').map(str::parse).collect();
        Ok(Self { family: family.to_owned(), addresses: addresses.map_err(|_| shape())? })
    }
}

/// Lets the drives live until the program is asked to stop.
pub fn host(drives: &LineDrives, links: &[AdapterLink]) -> Exit {
    let (mut line, mut terminal) = match open(drives, links) {
        Ok(opened) => opened,
        Err(error) => return error.print(false),
    };
    let is_stopped = match interruption::watch() {
        Ok(is_stopped) => is_stopped,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let path = terminal.linked_path().unwrap_or(terminal.path()).display().to_string();
    let LineDrives { family, addresses } = drives;
    let addresses: Vec<String> = addresses.iter().map(u8::to_string).collect();
    say!("{path}: {family}, addresses {}; Ctrl-C ends them", addresses.join(", "));
    say!("takt drive --bus serial:{path} --family {family} --node {} info", addresses[0]);
    match serial_host::host(line.as_mut(), &mut terminal, &is_stopped) {
        Ok(()) => Exit::Done,
        Err(error) => {
            say!("takt: {path}: {error}");
            Exit::Stopped
        }
    }
}

fn open(
    drives: &LineDrives,
    links: &[AdapterLink],
) -> Result<(Box<dyn DevicesOnLine>, PseudoTerminal), UsageError> {
    let LineDrives { family, addresses } = drives;
    let known = family::named(family).ok_or_else(|| format!("--serial: there is no family {family:?}"))?;
    let line = known.simulated_line(addresses);
    let line = line.ok_or_else(|| format!("--serial: {family} is no family of drives on a serial line"))?;
    let line = line.map_err(|reason| format!("--serial: {reason}"))?;
    let mut terminal =
        PseudoTerminal::open().map_err(|error| format!("opening a pseudo-terminal: {error}"))?;
    for link in links.iter().filter_map(AdapterLink::link) {
        let named = |error| format!("naming its pseudo-terminal {}: {error}", link.display());
        terminal.link(link).map_err(named)?;
    }
    Ok((line, terminal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_named_by_its_family_and_its_addresses() {
        let line = |family: &str, addresses: &[u8]| {
            Ok(LineDrives { family: family.to_owned(), addresses: addresses.to_vec() })
        };
        assert_eq!("a-family:2".parse(), line("a-family", &[2]));
        assert_eq!("a-family:2,3".parse(), line("a-family", &[2, 3]));
        for text in ["a-family", "a-family:", "a-family:2,", "a-family:256", "a-family:x"] {
            assert!(text.parse::<LineDrives>().is_err(), "{text}");
        }
    }
}
