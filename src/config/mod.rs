//! The configuration of a controller: what the TOML file says, checked, in SI units.
//!
//! [`Config::load`] reads a file and either gives a configuration in which every value is possible, or a
//! [`ConfigError`] with every problem of the file, each with its line and a way out. Quantities are bare numbers in SI
//! units or texts with a unit (`"137 deg/s"`). `configs/reference.toml` is the description of the format: [`reference()`].

mod axis_ranges;
#[doc(hidden)]
pub mod bit_fields;
pub(crate) mod bounds;
mod configured_family;
mod data_file;
pub(crate) mod defaults;
#[cfg(feature = "miette")]
mod diagnostic;
mod drive_family;
mod error;
mod error_control;
pub(crate) mod identifiers;
mod identity;
mod in_code;
mod interface;
mod interface_error;
mod key;
pub(crate) mod keys;
mod mode_words;
mod model;
mod position_unit;
mod problem_kind;
pub(crate) mod quantities;
pub(crate) mod quantity;
pub mod quirks;
pub(crate) mod read;
mod reference;
mod rules;
mod scale;
mod schema;
mod sources;
mod spelling;
pub(crate) mod spot;
mod supervision;
mod travel;
pub(crate) mod urdf;
mod urdf_error;
mod urdf_limits;

use std::fmt;
use std::path::Path;

pub use configured_family::{ConfiguredFamily, FamilyKeys};
pub use drive_family::{
    DriveFacts, DriveFamily, ModeChangeRule, ModeSet, OwnIdentifiers, Plausible, Protocol, VelocityUnit,
};
pub use error::{ConfigError, Location, Problem};
pub use error_control::ErrorControl;
pub use interface_error::InterfaceError;
pub use mode_words::{MODES, mode_word};
pub use model::*;
pub use position_unit::PositionUnit;
pub use problem_kind::ProblemKind;
pub use quantity::{Dimension, Quantity, QuantityError};
pub(crate) use read::{Knowledge, PhaseChoice, parse};
pub use reference::reference;
pub use schema::schema;
pub use sources::{ConfigSources, SourcesError};
pub use supervision::Supervision;
pub use urdf::{Urdf, UrdfJoint};
pub use urdf_error::UrdfError;
pub use urdf_limits::{LimitOrigin, UrdfLimits};

use takt_wire::printable::printable_path;
use thiserror::Error;

/// Reads a file and checks it, as [`read::parse`] does its text.
pub(crate) fn load(path: &Path, knowledge: &Knowledge<'_>) -> Result<Config, ConfigError> {
    let name = printable_path(path);
    match takt_wire::text_file::read(path) {
        Ok(bytes) => parse(&name, &ConfigError::text_of(&name, bytes)?, knowledge),
        Err(error) => Err(ConfigError::unreadable(&name, error.to_string())),
    }
}

impl Config {
    /// Connects a bus to another interface than the file says, as `--bus NAME=INTERFACE` does.
    pub fn override_interface(&mut self, name: &str, interface: &str) -> Result<(), OverrideError> {
        let interface: Interface = interface.parse()?;
        let is_its_owner =
            |bus: &&Bus| rules::bus::is_same_device(&bus.interface, &interface) && bus.name != name;
        if let Some(owner) = self.buses.iter().find(is_its_owner) {
            return Err(OverrideError::InterfaceTaken { interface, bus: owner.name.clone() });
        }
        let known = || self.buses.iter().map(|bus| bus.name.as_str()).collect::<Vec<_>>().join(", ");
        match self.buses.iter().position(|bus| bus.name == name) {
            None => Err(OverrideError::UnknownBus { name: name.to_owned(), known: known() }),
            Some(bus) => {
                if matches!(interface, Interface::Converter(_))
                    && let Some(reason) = rules::converter::reason(self, bus)
                {
                    return Err(OverrideError::NotCarried { interface, reason });
                }
                if let Some(bus) = self.buses.get_mut(bus) {
                    if let Interface::Serial(SerialDevice { bit_rate: Some(rate), .. }) = &interface {
                        bus.bit_rate = *rate;
                    }
                    bus.interface = interface;
                }
                Ok(())
            }
        }
    }
}

/// The reason for which a bus cannot be connected to another interface.
#[derive(Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum OverrideError {
    /// There is no such bus.
    #[error("there is no bus called {name:?}; the buses are: {known}")]
    UnknownBus {
        /// The name.
        name: String,
        /// The buses that are there.
        known: String,
    },
    /// There is no such interface.
    #[error("{reason}: {}", reason.help())]
    Interface {
        /// Why.
        #[from]
        reason: InterfaceError,
    },
    /// It does not carry the frames of an axis of the bus.
    #[error("{interface} does not carry the frames of this bus: {reason}")]
    NotCarried {
        /// The interface.
        interface: Interface,
        /// The axis, and why.
        reason: String,
    },
    /// Another bus is connected to it.
    #[error("the interface {interface} already belongs to the bus {bus:?}")]
    InterfaceTaken {
        /// The interface.
        interface: Interface,
        /// The bus that it belongs to.
        bus: String,
    },
}

impl fmt::Debug for OverrideError {
    /// For `main`: the sentence.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}
