//! `takt drive … entries`: what can be read and written by its name.

use clap::Args;
use serde_json::json;

use takt::config::DriveFamily;
use takt::family::{self, NamedEntry};

use super::super::exit::Exit;
use super::super::print;
use super::super::usage_error::UsageError;

/// List what can be read and written by its name, with unit, range and meaning; needs no bus
#[derive(Args, Debug)]
pub struct Arguments {
    /// Only those with this in their name or address
    word: Option<String>,
}

/// Lists them.
pub fn run(arguments: &Arguments, drive: Result<DriveFamily, UsageError>, is_json: bool) -> Exit {
    let drive = match drive {
        Ok(drive) => drive,
        Err(error) => return error.print(is_json),
    };
    let wanted = arguments.word.as_deref().unwrap_or_default().to_lowercase();
    let mut entries = family::of(&drive).entries(&drive);
    entries.retain(|entry| {
        entry.name.to_lowercase().contains(&wanted) || entry.address.to_lowercase().contains(&wanted)
    });
    if is_json {
        let listed = entries.iter().map(|entry| {
            json!({
                "address": entry.address, "name": entry.name, "access": entry.access, "unit": entry.unit,
                "values": entry.values, "note": entry.note,
            })
        });
        let listed: Vec<_> = listed.collect();
        return print::json(&json!({ "family": drive.word, "entries": listed }), Exit::Done);
    }
    if entries.is_empty() {
        return UsageError::from(format!("no entry of a {} has `{wanted}` in its name", drive.name))
            .print(false);
    }
    let lines: String = entries.iter().map(shown).collect();
    print::text(&lines, Exit::Done)
}

/// An entry in one line, and below it its values and what else must be known.
fn shown(entry: &NamedEntry) -> String {
    let unit = if entry.unit.is_empty() { String::new() } else { format!(", {}", entry.unit) };
    let mut text = format!("{:<9} {} ({}{unit})\n", entry.address, entry.name, entry.access);
    for words in [&entry.values, entry.note].into_iter().filter(|words| !words.is_empty()) {
        for line in wrapped(words) {
            text.push_str(&format!("{:10}  {line}\n", ""));
        }
    }
    text
}

/// A text in lines that fit a terminal of 80 columns behind the indentation.
fn wrapped(text: &str) -> Vec<String> {
    const WIDTH: usize = 66;
    let mut lines: Vec<String> = vec![];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
