//! The drives on a bus without a configuration, and its bit rates.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use crate::usage_error::UsageError;
use takt::config::{DriveFamily, Quantity};
use takt::family;
use takt::family::cia402::{self, Device};
use takt_tools::monitor::NamedDrive;

/// What a bus is without a configuration.
#[derive(Args, Clone, Debug)]
pub struct DriveOptions {
    /// The family of the drives without a configuration, as `drive` names it there; N=FAMILY for one node (repeatable)
    #[arg(long = "family", value_name = "FAMILY")]
    families: Vec<OfNode<FamilyName>>,
    /// The data sheet (EDS or DCF) of the drives without a configuration; N=FILE for one node (repeatable)
    #[arg(long = "eds", value_name = "FILE")]
    sheets: Vec<OfNode<PathBuf>>,
    /// The bit rate of the bus without a configuration
    #[arg(long, value_name = "RATE", value_parser = bit_rate, default_value = "1 Mbit/s")]
    pub bit_rate: u32,
    /// The bit rate of the data phase of CAN FD without a configuration
    #[arg(long, value_name = "RATE", value_parser = bit_rate)]
    pub data_bit_rate: Option<u32>,
}

/// A bit rate of an interface.
pub fn bit_rate(text: &str) -> Result<u32, String> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (10_000.0..=8_000_000.0).contains(rate));
    rate.map(|rate| rate as u32).ok_or_else(|| "write it as \"500 kbit/s\", at most 8 Mbit/s".to_owned())
}

/// Something of one node, or of all the others.
#[derive(Clone, Debug)]
struct OfNode<T> {
    node: Option<u8>,
    what: T,
}

impl<T: FromStr<Err: ToString>> FromStr for OfNode<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_number = |text: &str| !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit());
        let (node, what) = match text.split_once('=').filter(|(node, _)| is_number(node)) {
            Some((node, what)) => {
                let node = node.parse().ok().filter(|node| (1..=127).contains(node));
                (Some(node.ok_or("a node ID is a number from 1 to 127")?), what)
            }
            None => (None, text),
        };
        Ok(Self { node, what: what.parse().map_err(|error: T::Err| error.to_string())? })
    }
}

/// A family that needs no configuration.
#[derive(Clone, Debug)]
struct FamilyName(DriveFamily);

impl FromStr for FamilyName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unconfigured = family::named(text).and_then(|family| family.unconfigured());
        unconfigured.map(Self).ok_or_else(|| {
            let known = family::all().into_iter().filter(|family| family.unconfigured().is_some());
            let words: Vec<&str> = known.map(|family| family.word()).collect();
            let words = words.join(", ");
            format!("the families are {words}; another drive is known from its data sheet (--eds FILE) or a configuration")
        })
    }
}

impl DriveOptions {
    /// Returns `true` if any drive is named.
    pub fn names_some(&self) -> bool {
        !self.families.is_empty() || !self.sheets.is_empty()
    }

    /// The drives that are named.
    pub fn named(&self) -> Result<Vec<NamedDrive>, UsageError> {
        let families = self
            .families
            .iter()
            .map(|OfNode { node, what: FamilyName(drive) }| NamedDrive { node: *node, drive: drive.clone() });
        let mut drives: Vec<NamedDrive> = families.collect();
        for OfNode { node, what } in &self.sheets {
            let device =
                Device::load(what, None).map_err(|reason| format!("--eds {}: {reason}", what.display()))?;
            drives.push(NamedDrive { node: *node, drive: cia402::drive(device) });
        }
        for (place, NamedDrive { node, .. }) in drives.iter().enumerate() {
            if drives.iter().take(place).any(|earlier| earlier.node == *node) {
                let which = node.map_or("all nodes".to_owned(), |node| format!("node {node}"));
                return Err(format!("--family and --eds: {which} is named twice").into());
            }
        }
        Ok(drives)
    }
}
