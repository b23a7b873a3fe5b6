//! `takt drive … info | read | write | watch`

use std::time::Duration;

use clap::{Args, Subcommand};
use takt_wire::canopen::object::DataType;

use takt_tools::commission::{Task, ValueText, dictionary};

use super::super::configuration;

/// Reading from a drive.
#[derive(Subcommand, Debug)]
pub enum Action {
    /// Show the identity, the state and the errors of the drive
    Info,
    /// Find the drives on the bus that speak the same protocol
    Scan,
    /// Read objects, by index:subindex or by name
    Read(Read),
    /// Write an object and read it back
    Write(Write),
    /// Show position, velocity, torque and status until Ctrl-C
    Watch(Watch),
}

#[derive(Args, Debug)]
pub struct Read {
    /// 6064, 1018:01, "position actual value" …
    #[arg(required = true, value_name = "OBJECT")]
    objects: Vec<String>,
    /// Read as this type: u8, i8, u16, i16, u32, i32
    #[arg(long = "type", value_name = "TYPE", value_parser = data_type)]
    data_type: Option<DataType>,
}

#[derive(Args, Debug)]
pub struct Write {
    /// 6081, "profile velocity" …
    #[arg(value_name = "OBJECT")]
    object: String,
    /// With a unit where the object has one ("20 deg/s"), else a whole number, also in hexadecimal (0x…)
    #[arg(allow_hyphen_values = true)]
    value: String,
    /// The type of an object that is not known: u8, i8, u16, i16, u32, i32
    #[arg(long = "type", value_name = "TYPE", value_parser = data_type)]
    data_type: Option<DataType>,
}

#[derive(Args, Debug)]
pub struct Watch {
    /// Seconds between two readings
    #[arg(long, value_name = "S", default_value = "0.1", allow_negative_numbers = true, value_parser = configuration::seconds)]
    interval: Duration,
    /// End after this many seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
}

fn data_type(text: &str) -> Result<DataType, String> {
    dictionary::data_type(text).ok_or_else(|| "the types are u8, i8, u16, i16, u32, i32".to_owned())
}

impl Action {
    /// Its name on the command line.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Scan => "scan",
            Self::Read(_) => "read",
            Self::Write(_) => "write",
            Self::Watch(_) => "watch",
        }
    }

    /// The task to the drive.
    pub fn task(&self, is_raw: bool) -> Task {
        match self {
            Self::Info => Task::Info,
            Self::Scan => Task::Scan,
            Self::Read(read) => Task::Read { names: read.objects.clone(), data_type: read.data_type },
            Self::Write(write) => Task::Write {
                name: write.object.clone(),
                value: ValueText { text: write.value.clone(), is_raw },
                data_type: write.data_type,
            },
            Self::Watch(watch) => Task::Watch {
                every_ns: watch.interval.as_nanos() as u64,
                duration_ns: watch.duration.map(|duration| duration.as_nanos() as u64),
            },
        }
    }
}
