//! The arguments of `takt run`, as far as the laboratory gives them.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;

use takt::{Config, RecordingDestination, SessionOptions};

/// The configuration with its interfaces, what a session needs, and how long it shall last.
pub fn arguments() -> Result<(Config, SessionOptions, Duration), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("usage: CONFIG [--bus NAME=INTERFACE]... [--duration S]")?;
    let mut config = Config::load(Path::new(&path))?;
    let (mut options, mut lasting) = (SessionOptions::default(), Duration::from_secs(2));
    while let Some(option) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{option} needs a value"));
        match option.as_str() {
            "--bus" => {
                let value = value()?;
                let (name, interface) = value.split_once('=').ok_or("--bus NAME=INTERFACE")?;
                config.override_interface(name, interface)?;
            }
            "--duration" => lasting = Duration::from_secs_f64(value()?.parse()?),
            "--record" => options.recording = Some(RecordingDestination::File(PathBuf::from(value()?))),
            "--require-realtime" => options.is_realtime_required = true,
            _ => return Err(format!("there is no option {option}").into()),
        }
    }
    Ok((config, options, lasting))
}
