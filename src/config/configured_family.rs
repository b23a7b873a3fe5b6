//! A family of drives, as far as the reader of configurations needs to know it.

use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;

use super::bounds::Bounds;
use super::drive_family::DriveFamily;
use super::keys;
use super::quantity::Quantity;
use super::read::section::Section;

/// A family as the reader of configurations knows it.
pub trait ConfiguredFamily: Sync {
    /// The word for it: `drive = "WORD"`.
    fn word(&self) -> &'static str;

    /// The drive of an axis. A family with keys of its own reads them here; what is wrong with them is reported to `keys`, and
    /// the answer is `None`.
    fn read(&self, keys: &mut FamilyKeys<'_, '_>) -> Option<DriveFamily>;

    /// Returns `true` if its drives are on a serial line, and not on a CAN bus.
    fn is_on_serial_line(&self) -> bool {
        false
    }
}

/// The table of an axis, for the keys that belong to the family of its drive.
pub struct FamilyKeys<'s, 'a> {
    section: &'s mut Section<'a>,
    /// The table of what stands in on a simulated bus.
    simulated: &'s mut Section<'a>,
}

impl<'s, 'a> FamilyKeys<'s, 'a> {
    pub(super) fn of(section: &'s mut Section<'a>, simulated: &'s mut Section<'a>) -> Self {
        Self { section, simulated }
    }

    /// `true` or `false` in the table `simulated`; `false` where the key is not there. `None` if it is something else, which is
    /// reported.
    pub fn simulated_flag(&mut self, key: &'static str) -> Option<bool> {
        self.simulated.get(key).map_or(Some(false), |entry| entry.boolean())
    }

    /// A file that the key names, relative to the configuration. `None` if the key is not there, or is no text.
    pub fn path(&mut self, key: &'static str) -> Option<PathBuf> {
        self.section.get(key).and_then(|entry| entry.path_from_file())
    }

    /// A text. `None` if the key is not there, or is something else, which is reported.
    pub fn text(&mut self, key: &'static str) -> Option<String> {
        self.section.get(key).and_then(|entry| entry.text().map(str::to_owned))
    }

    /// The number of the axis among those of its node, `node_axis`; 1 where the key is not there. `None` if it is no such number,
    /// which is reported.
    pub fn node_axis(&mut self) -> Option<u8> {
        match self.section.keyed(&keys::family::NODE_AXIS) {
            None => Some(1),
            Some(entry) => entry.integer(),
        }
    }

    /// A number without a unit. `None` if the key is not there, or is something else, which is reported.
    pub fn number(&mut self, key: &'static str, allowed: RangeInclusive<f64>) -> Option<f64> {
        let bounds = Bounds::Between(*allowed.start(), *allowed.end());
        self.section.get(key).and_then(|entry| entry.number(bounds))
    }

    /// A whole number. `None` if the key is not there, or is something else, which is reported.
    pub fn integer(&mut self, key: &'static str, allowed: Range<i64>) -> Option<i64> {
        self.section.get(key).and_then(|entry| entry.integer(allowed))
    }

    /// A quantity, in SI units. `None` if the key is not there, or is something else, which is reported.
    pub fn quantity(
        &mut self,
        key: &'static str,
        quantity: Quantity,
        allowed: RangeInclusive<f64>,
    ) -> Option<f64> {
        let bounds = Bounds::Between(*allowed.start(), *allowed.end());
        self.section.get(key).and_then(|entry| entry.quantity(quantity, bounds))
    }

    /// `true` or `false`; `false` where the key is not there. `None` if it is something else, which is reported.
    pub fn boolean(&mut self, key: &'static str) -> Option<bool> {
        match self.section.get(key) {
            None => Some(false),
            Some(entry) => entry.boolean(),
        }
    }

    /// Leaves a key alone that may be right.
    pub fn pass_over(&mut self, key: &'static str) {
        let _ = self.section.get(key);
    }

    /// Reports that the key, for which `says` tells what it is, is missing, unless it is there.
    pub fn require(&mut self, key: &'static str, says: &'static str) {
        self.section.require(key, says);
    }

    /// Reports what is wrong with the value of a key.
    pub fn refuse(&mut self, key: &'static str, given: impl Into<String>, allowed: impl Into<String>) {
        self.section.spot(key).report_range(given.into(), allowed.into());
    }
}
