//! Reading a configuration for a subcommand, and the options that change it.

use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use takt::config::Config;

use super::exit::Exit;

/// `--bus NAME=INTERFACE`
#[derive(Clone, Debug)]
pub struct BusOverride {
    name: String,
    interface: String,
}

impl FromStr for BusOverride {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('=') {
            Some((name, interface)) if !name.is_empty() && !interface.is_empty() => {
                Ok(Self { name: name.to_owned(), interface: interface.to_owned() })
            }
            _ => Err("write it as NAME=INTERFACE, for example base=can0".to_owned()),
        }
    }
}

/// Reads a configuration and applies the overrides. What is wrong is printed.
pub fn load(path: &Path, buses: &[BusOverride]) -> Result<Config, Exit> {
    let mut config = Config::load(path).map_err(|error| {
        say!("{:?}", miette::Report::new(error));
        Exit::Usage
    })?;
    for bus in buses {
        config.override_interface(&bus.name, &bus.interface).map_err(|error| {
            say!("takt: --bus {}={}: {error}", bus.name, bus.interface);
            Exit::Usage
        })?;
    }
    Ok(config)
}

/// A positive number of seconds.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of seconds"))?;
    match Duration::try_from_secs_f64(number) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err("a duration is a finite number of seconds, longer than 0".to_owned()),
    }
}
