//! `takt drive … info | read | write | watch`

use std::time::Duration;

use clap::{Args, Subcommand};

use crate::canopen::object::{DataType, Object};
use crate::commission::dictionary::{self, SelectedObject};
use crate::commission::{Failure, ReadObject, TargetDrive, Task};

use super::super::configuration;

/// Reading from a drive.
#[derive(Subcommand, Debug)]
pub enum Action {
    /// Show the identity, the state and the errors of the drive
    Info,
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
            Self::Read(_) => "read",
            Self::Write(_) => "write",
            Self::Watch(_) => "watch",
        }
    }

    /// The task to the drive.
    pub fn task(&self, target: &TargetDrive, is_raw: bool) -> Result<Task, Failure> {
        match self {
            Self::Info => Ok(Task::Info),
            Self::Read(read) => read.task(target),
            Self::Write(write) => write.task(target, is_raw),
            Self::Watch(watch) => Ok(Task::Watch {
                every_ns: watch.interval.as_nanos() as u64,
                duration_ns: watch.duration.map(|duration| duration.as_nanos() as u64),
            }),
        }
    }
}

impl Read {
    fn task(&self, target: &TargetDrive) -> Result<Task, Failure> {
        let objects = self.objects.iter().map(|text| {
            Ok(match dictionary::find(&target.drive, text)? {
                SelectedObject::Known(entry) => ReadObject {
                    address: entry.object.address,
                    entry: Some(entry),
                    data_type: self.data_type,
                },
                SelectedObject::Unknown(address) => {
                    ReadObject { address, entry: None, data_type: self.data_type }
                }
            })
        });
        Ok(Task::Read { objects: objects.collect::<Result<_, Failure>>()? })
    }
}

impl Write {
    fn task(&self, target: &TargetDrive, is_raw: bool) -> Result<Task, Failure> {
        let found = dictionary::find(&target.drive, &self.object)?;
        let (object, entry) = match (found, self.data_type) {
            (SelectedObject::Known(entry), None) => (entry.object, Some(entry)),
            (SelectedObject::Known(entry), Some(data_type)) if data_type == entry.object.data_type => {
                (entry.object, Some(entry))
            }
            (SelectedObject::Known(entry), Some(_)) => {
                return Err(Failure::Unsuitable(format!(
                    "{} is {:?}, not what --type says",
                    entry.object, entry.object.data_type
                )));
            }
            (SelectedObject::Unknown(address), Some(data_type)) => {
                (Object { address, data_type, name: "object" }, None)
            }
            (SelectedObject::Unknown(address), None) => {
                return Err(Failure::Unsuitable(format!(
                    "nothing is known of {address}: say its type with --type (u8, i8, u16, i16, u32, i32)"
                )));
            }
        };
        let value = match entry {
            Some(entry) => entry.parse(target, &self.value, is_raw)?,
            None => dictionary::integer(&self.value)
                .ok_or_else(|| Failure::Unsuitable(format!("`{}` is no whole number", self.value)))?,
        };
        Ok(Task::Write { object, value, entry })
    }
}
