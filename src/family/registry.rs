//! The families that configurations may name.

use std::sync::{PoisonError, RwLock};

use super::{Family, bit_fields, cia402, erob_can, erob_modbus, hollow, yz_aim};
use crate::config::DriveFamily;

/// The families that come with takt.
static SHIPPED: [&dyn Family; 11] = [
    &cia402::EROB_CANOPEN,
    &yz_aim::YzAim,
    &cia402::BY_SHEET,
    &erob_can::ErobCan,
    &erob_modbus::ErobModbus,
    &hollow::CAN,
    &hollow::CAN_FD,
    &hollow::CONSOLE,
    &hollow::ENCODER,
    &hollow::PULSE,
    &bit_fields::FROM_FILE,
];
/// Those of the program that embeds takt.
static REGISTERED: RwLock<Vec<&dyn Family>> = RwLock::new(vec![]);

/// A family has a name that another one has already.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is a family \"{word}\" already")]
pub struct NameTaken {
    /// The name.
    pub word: &'static str,
}

/// Adds a family, so that configurations which are read after this may name it.
///
/// # Errors
/// There is a family of this name already.
pub fn register(family: &'static dyn Family) -> Result<(), NameTaken> {
    let mut registered = REGISTERED.write().unwrap_or_else(PoisonError::into_inner);
    let word = family.word();
    if SHIPPED.iter().chain(registered.iter()).any(|other| other.word() == word) {
        return Err(NameTaken { word });
    }
    registered.push(family);
    Ok(())
}

/// Every family, those that come with takt first.
pub fn all() -> Vec<&'static dyn Family> {
    let registered = REGISTERED.read().unwrap_or_else(PoisonError::into_inner);
    SHIPPED.iter().chain(registered.iter()).copied().collect()
}

/// The family with this word.
pub fn named(word: &str) -> Option<&'static dyn Family> {
    all().into_iter().find(|family| family.word() == word)
}

/// What takt knows of a family.
///
/// # Panics
/// Nobody has registered a family of this name: a program has made a [`DriveFamily`] for which there is no [`Family`].
pub fn of(drive: &DriveFamily) -> &'static dyn Family {
    named(drive.word).expect("the family of a drive is registered")
}
