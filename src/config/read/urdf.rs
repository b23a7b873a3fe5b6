//! `urdf` and `urdf_joint`: the joint of an axis in a robot description.

use takt_wire::printable::printable_path;

use super::entry::Entry;
use super::section::Section;
use crate::config::model::Travel;
use crate::config::problem_kind::ProblemKind;
use crate::config::spot::Spot;
use crate::config::urdf::{Urdf, UrdfJoint};

/// The robot description of a configuration.
pub enum Description {
    /// It has none.
    None,
    /// It cannot be used, which was reported.
    Unusable,
    /// This one.
    Read(Box<Urdf>),
}

impl Description {
    /// Reads the file that `urdf` names.
    pub fn read(entry: Option<Entry<'_>>) -> Self {
        let Some(entry) = entry else { return Self::None };
        let read = entry.path_from_file().and_then(|path| {
            Urdf::load(&path).map_err(|reason| entry.report(ProblemKind::Urdf { reason })).ok()
        });
        read.map_or(Self::Unusable, |urdf| Self::Read(Box::new(urdf)))
    }
}

/// What a robot description says of an axis.
pub enum DescribedJoint<'a> {
    /// Nothing: the configuration has every limit.
    Not,
    /// It cannot be known, which was reported.
    Unknown,
    /// This, at a place of the configuration that names the joint.
    Is(UrdfJoint, Spot<'a>),
}

impl<'a> DescribedJoint<'a> {
    /// Looks up the joint of an axis: that of its name, unless `urdf_joint` says otherwise.
    pub fn of(
        section: &mut Section<'a>,
        description: &Description,
        axis: Option<&str>,
        travel: Option<Travel>,
    ) -> Self {
        let own = section.own("urdf_joint");
        let urdf = match description {
            Description::None => {
                if let Some(own) = own {
                    let says = "the robot description, before the first table: urdf = \"arm.urdf\"".into();
                    own.report(ProblemKind::MissingKey { key: "urdf".to_owned(), says });
                }
                return Self::Not;
            }
            Description::Unusable => return Self::Unknown,
            Description::Read(urdf) => urdf,
        };
        if own.as_ref().is_some_and(|entry| entry.is_word("off")) {
            return Self::Not;
        }
        let (name, spot) = match &own {
            Some(own) => (own.text(), own.spot.clone()),
            None => (axis, section.spot("name")),
        };
        let Some((name, travel)) = name.zip(travel) else { return Self::Unknown };
        match urdf.joint(name, travel) {
            Ok(joint) => Self::Is(joint, spot),
            Err(reason) => {
                spot.report(ProblemKind::Urdf { reason });
                Self::Unknown
            }
        }
    }

    /// The joint.
    pub fn joint(&self) -> Option<&UrdfJoint> {
        match self {
            Self::Not | Self::Unknown => None,
            Self::Is(joint, _) => Some(joint),
        }
    }

    /// Where what is wrong with one of its limits is reported.
    pub fn spot(&self, limit: &str) -> Option<Spot<'a>> {
        let Self::Is(joint, spot) = self else { return None };
        let key = format!("{limit} of the joint {:?} in {}", joint.name, printable_path(&joint.file));
        let mut spot = spot.clone();
        spot.key = key;
        Some(spot)
    }

    /// What the configuration says of a limit. It must say it where the description does not: `says` how.
    pub fn entry<'s>(
        &self,
        section: &mut Section<'s>,
        key: &'static str,
        says: &'static str,
        is_described: bool,
    ) -> Option<Entry<'s>> {
        match self {
            Self::Not => section.require(key, says),
            Self::Unknown => section.get(key),
            Self::Is(..) if is_described => section.get(key),
            Self::Is(joint, _) => {
                let (joint, file) = (&joint.name, printable_path(&joint.file));
                section.require(key, format!("{says}; the joint {joint:?} of {file} has no such limit"))
            }
        }
    }
}
