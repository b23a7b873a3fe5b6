//! Reading a configuration for a subcommand, and the options that change it.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use takt::config::{Config, ConfigSources};

use super::usage_error::UsageError;

/// `--bus NAME=INTERFACE`, or the interface alone where the configuration has one bus.
#[derive(Clone, Debug)]
pub struct BusOverride {
    name: Option<String>,
    interface: String,
}

impl FromStr for BusOverride {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('=') {
            Some((name, interface)) if !name.is_empty() && !interface.is_empty() => {
                Ok(Self { name: Some(name.to_owned()), interface: interface.to_owned() })
            }
            None if !text.is_empty() => Ok(Self { name: None, interface: text.to_owned() }),
            _ => Err("write it as NAME=INTERFACE, for example base=can0".to_owned()),
        }
    }
}

impl fmt::Display for BusOverride {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.name {
            Some(name) => write!(f, "--bus {name}={}", self.interface),
            None => write!(f, "--bus {}", self.interface),
        }
    }
}

impl BusOverride {
    /// The name of the bus.
    fn name<'a>(&'a self, config: &'a Config) -> Result<&'a str, UsageError> {
        match (&self.name, config.buses.as_slice()) {
            (Some(name), _) => Ok(name),
            (None, [only]) => Ok(&only.name),
            (None, buses) => {
                let names: Vec<&str> = buses.iter().map(|bus| bus.name.as_str()).collect();
                let (interface, names) = (&self.interface, names.join(", "));
                Err(format!("{self}: the configuration has several buses ({names}): write NAME={interface}")
                    .into())
            }
        }
    }
}

/// Reads a configuration and applies the overrides.
pub fn load(path: &Path, buses: &[BusOverride]) -> Result<Config, UsageError> {
    load_with_sources(path, buses).map(|(config, _)| config)
}

/// The same, with the files that it was made of.
pub fn load_with_sources(path: &Path, buses: &[BusOverride]) -> Result<(Config, ConfigSources), UsageError> {
    let (mut config, mut sources) = ConfigSources::load(path)?;
    for bus in buses {
        let name = bus.name(&config)?.to_owned();
        if sources.interfaces.iter().any(|(earlier, _)| *earlier == name) {
            return Err(format!("{bus}: this bus has been connected already").into());
        }
        config.override_interface(&name, &bus.interface).map_err(|error| format!("{bus}: {error}"))?;
        sources.interfaces.push((name, bus.interface.clone()));
    }
    Ok((config, sources))
}

/// Longer than thirty years is a slip, and would not fit the clock in nanoseconds.
const LONGEST_S: f64 = 1e9;

/// A positive number of seconds.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of seconds"))?;
    match Duration::try_from_secs_f64(number) {
        Ok(duration) if !duration.is_zero() && number <= LONGEST_S => Ok(duration),
        _ => Err(format!("a duration is a number of seconds above 0, {LONGEST_S} at most")),
    }
}
