//! The kinds of problems in a file, and how each is repaired.

use std::ops::Range;

use thiserror::Error;

use super::data_type::DataTypeCode;
use super::number::Anomaly;

/// Whether a problem could be repaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// It was repaired; the file is usable.
    Warning,
    /// The file cannot be used.
    Error,
}

/// One problem.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{kind}")]
pub struct EdsProblem {
    /// What is wrong.
    pub kind: EdsProblemKind,
    /// The position in the file, decoded to UTF-8, in bytes.
    pub span: Range<usize>,
    /// The line that this one contradicts or repeats, counted from 1.
    pub first_line: Option<usize>,
}

impl EdsProblem {
    /// What is written beside its place in the file; `None` where it has no place.
    pub(super) fn label(&self) -> Option<String> {
        match self.kind {
            EdsProblemKind::Unreadable { .. } | EdsProblemKind::NoObjects => None,
            _ => {
                Some(self.first_line.map_or("here".to_owned(), |line| format!("here; first in line {line}")))
            }
        }
    }
}

/// The kinds of problems.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EdsProblemKind {
    /// The file cannot be read.
    #[error("the file cannot be read: {reason}")]
    Unreadable {
        /// The operating system's reason.
        reason: String,
    },
    /// No section describes an object.
    #[error("no section of this file describes an object")]
    NoObjects,
    /// More than a file can have. The rest was not read.
    #[error("the file has more than {most} {items}")]
    TooMany {
        /// What there is too much of.
        items: &'static str,
        /// The largest number.
        most: usize,
    },
    /// A text that is not a number.
    #[error("`{key}` is not a number: {given:?}")]
    NotANumber {
        /// The key.
        key: String,
        /// The text.
        given: String,
    },
    /// A text that is not a list of bytes.
    #[error("`{key}` is not a list of bytes in hexadecimal: {given:?}")]
    NotBytes {
        /// The key.
        key: String,
        /// The text.
        given: String,
    },
    /// A number outside the range of its type.
    #[error("`{key}` is {value}, which is outside the range of {data_type}")]
    DoesNotFit {
        /// The key.
        key: String,
        /// The number.
        value: i128,
        /// The type.
        data_type: DataTypeCode,
    },
    /// A data type that does not exist.
    #[error("{given:?} is not a data type")]
    UnknownDataType {
        /// The text.
        given: String,
    },
    /// A value to be written to the device that appears twice with different values.
    #[error("`{key}` appears twice with different values")]
    Contradiction {
        /// The key.
        key: String,
    },
    /// A number outside an allowed range.
    #[error("`{key}` is {value}, but the allowed range is {allowed}")]
    OutOfRange {
        /// The key.
        key: String,
        /// The number.
        value: i128,
        /// The range.
        allowed: &'static str,
    },

    /// A part of the description of an object that takt does not use.
    #[error("{problem}")]
    Unused {
        /// What is wrong with it.
        problem: Box<EdsProblemKind>,
    },
    /// Two numbers of the vendor or of the product.
    #[error("`{key}` is 0x{stated:08X}, but {object} is 0x{number:08X}")]
    TwoIdentities {
        /// The key in `[DeviceInfo]`.
        key: String,
        /// Its number.
        stated: u32,
        /// The object.
        object: String,
        /// Its number.
        number: u32,
    },
    /// A line before the first section.
    #[error("this line is before the first section")]
    OutsideSections,
    /// A line that is neither a section, nor a key with a value, nor a comment.
    #[error("this line is neither a section, nor `key=value`, nor a comment")]
    NotALine,
    /// A section header without its closing bracket.
    #[error("the closing bracket of this section is missing")]
    UnclosedHeader,
    /// A section that has appeared before.
    #[error("the section [{name}] appears twice")]
    RepeatedSection {
        /// Its name.
        name: String,
    },
    /// A key that has appeared before with the same value.
    #[error("`{key}` appears twice")]
    RepeatedKey {
        /// The key.
        key: String,
    },
    /// A key that has appeared before with another value.
    #[error("`{key}` appears twice with different values")]
    RepeatedKeyDiffers {
        /// The key.
        key: String,
        /// The value that is used.
        counts: String,
    },
    /// An unknown section that resembles a known one.
    #[error("the section [{name}] is unknown")]
    UnknownSection {
        /// Its name.
        name: String,
        /// The name that was probably meant.
        nearest: Option<&'static str>,
    },
    /// An unknown key that resembles a known one.
    #[error("`{key}` is unknown here")]
    UnknownKey {
        /// The key.
        key: String,
        /// The key that was probably meant.
        nearest: &'static str,
    },
    /// An anomaly in the spelling of a number.
    #[error("{}", anomaly_words(*.anomaly, .given))]
    NumberAnomaly {
        /// The text.
        given: String,
        /// The anomaly.
        anomaly: Anomaly,
    },
    /// A key without which an object is incomplete.
    #[error("`{key}` of {object} is missing")]
    MissingKey {
        /// The key.
        key: &'static str,
        /// The object.
        object: String,
        /// The repair.
        repair: String,
    },
    /// A word that is not allowed here.
    #[error("`{key}` cannot be {given:?}")]
    UnknownWord {
        /// The key.
        key: String,
        /// The word.
        given: String,
        /// The repair.
        repair: &'static str,
    },
    /// A data type given by its name.
    #[error("the data type is given by its name, {data_type}")]
    NamedDataType {
        /// The type.
        data_type: DataTypeCode,
    },
    /// An object type that the sections contradict.
    #[error("object {index:04X} is declared as {declared}, but it is {found}")]
    WrongObjectType {
        /// The object.
        index: u16,
        /// The declared type.
        declared: &'static str,
        /// The type by the sections.
        found: &'static str,
    },
    /// Sub-objects without their object.
    #[error("there are sub-objects of {index:04X}, but no section [{index:04X}]")]
    MissingObject {
        /// The object.
        index: u16,
    },
    /// A count that disagrees with the counted items.
    #[error("`{key}` is {stated}, but there are {found}")]
    Count {
        /// The key.
        key: String,
        /// The count in the file.
        stated: i128,
        /// The counted number.
        found: usize,
    },
    /// An object in a list that no section describes.
    #[error("object {index:04X} is listed, but no section describes it")]
    ListedOnly {
        /// The object.
        index: u16,
    },
    /// An object in none of the lists.
    #[error("object {index:04X} is in none of the lists of objects")]
    NotListed {
        /// The object.
        index: u16,
    },
    /// An object that is listed twice.
    #[error("object {index:04X} is listed twice")]
    ListedTwice {
        /// The object.
        index: u16,
    },
    /// An index in a list without its `0x`.
    #[error("{given:?} should be hexadecimal")]
    DecimalIndex {
        /// The text.
        given: String,
        /// The object.
        index: u16,
    },
    /// An impossible limit, or limits without a value between them.
    #[error("{reason}")]
    BadLimit {
        /// The reason.
        reason: String,
    },
    /// A value outside the limits.
    #[error("`{key}` is {value}, outside the limits {low} to {high}")]
    OutsideLimits {
        /// The key.
        key: String,
        /// The value.
        value: i128,
        /// The lower limit.
        low: i128,
        /// The upper limit.
        high: i128,
    },
    /// A sub-object that is described both compactly and in full.
    #[error("sub-object {index:04X}:{subindex:02X} is described twice, compactly and in full")]
    CompactAndFull {
        /// The object.
        index: u16,
        /// The sub-index.
        subindex: u8,
    },
    /// A mapped object that does not exist, cannot be mapped, or has another length.
    #[error("{mapping} maps {mapped}: {reason}")]
    BadMapping {
        /// The mapping parameter.
        mapping: String,
        /// The mapped object.
        mapped: String,
        /// The reason.
        reason: String,
    },
}

fn anomaly_words(anomaly: Anomaly, given: &str) -> String {
    match anomaly {
        Anomaly::Octal => format!("{given} has a leading zero and is octal"),
        Anomaly::NotOctal => format!("{given} has a leading zero and digits that octal does not have"),
        Anomaly::Suffix => format!("{given} is not the notation of a hexadecimal number"),
        Anomaly::NoDollar => format!("{given} is not the notation of the node ID"),
        Anomaly::Comment => format!("there is a comment after the number: {given}"),
        Anomaly::CSuffix => format!("{given} has the suffix of a C literal"),
        Anomaly::Point => format!("{given} is a whole number with a decimal point"),
        Anomaly::Word => format!("{given} is a word instead of a number"),
    }
}

impl EdsProblemKind {
    /// Whether it could be repaired.
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Unreadable { .. }
            | Self::NoObjects
            | Self::TooMany { .. }
            | Self::NotANumber { .. }
            | Self::NotBytes { .. }
            | Self::DoesNotFit { .. }
            | Self::UnknownDataType { .. }
            | Self::Contradiction { .. }
            | Self::OutOfRange { .. } => Severity::Error,
            _ => Severity::Warning,
        }
    }

    /// The repair, or the remedy.
    pub fn help(&self) -> String {
        match self {
            Self::Unreadable { .. } => "give the path of an EDS or DCF".into(),
            Self::NoObjects => "objects are described in sections like [1000] and [1018sub1]".into(),
            Self::TooMany { .. } => "the rest was not read; check that this is an EDS or DCF".into(),
            Self::NotANumber { given, .. } if given.contains('$') => {
                "write the node ID as $NODEID, as in $NODEID+0x200".into()
            }
            Self::NotANumber { .. } => "write 42, 0x2A, or $NODEID+0x200".into(),
            Self::NotBytes { .. } => "write two digits a byte, as in 01 A0 FF".into(),
            Self::DoesNotFit { data_type, .. } => match data_type.range() {
                Some((low, high)) => format!("{data_type} is {low} to {high}: correct the value or the type"),
                None => "correct the value or the type".into(),
            },
            Self::UnknownDataType { .. } => {
                "write its code (CiA 301, table 44), as in 0x0007 for UNSIGNED32".into()
            }
            Self::Contradiction { .. } => {
                "remove the wrong one, because it would be written to the device".into()
            }
            Self::OutOfRange { .. } => "correct it".into(),
            Self::Unused { problem } => {
                format!("{}; until then it is ignored, because takt does not use this object", problem.help())
            }
            Self::TwoIdentities { object, .. } => format!("the drive is expected to have that of {object}"),
            Self::OutsideSections | Self::NotALine => "it was ignored".into(),
            Self::UnclosedHeader => "the name was read up to the end of the line".into(),
            Self::RepeatedSection { .. } => "both were merged".into(),
            Self::RepeatedKey { .. } => "the values are the same".into(),
            Self::RepeatedKeyDiffers { counts, .. } => format!("the first one is used: {counts:?}"),
            Self::UnknownSection { nearest: Some(nearest), .. } => {
                format!("it was ignored; did you mean [{nearest}]?")
            }
            Self::UnknownSection { nearest: None, .. } => {
                "it was ignored; objects are four hexadecimal digits, as in [1018] and [1018sub1]".into()
            }
            Self::UnknownKey { nearest, .. } => format!("it was ignored; did you mean `{nearest}`?"),
            Self::NumberAnomaly { anomaly, .. } => match anomaly {
                Anomaly::Octal => "write it without the zero if it is meant in decimal, or with 0x".into(),
                Anomaly::NotOctal => "it was read as decimal".into(),
                Anomaly::Suffix => "it was read as hexadecimal: write 0x before it".into(),
                Anomaly::NoDollar => "it was read as $NODEID".into(),
                Anomaly::Comment => "the comment was ignored: write comments on their own lines".into(),
                Anomaly::CSuffix | Anomaly::Point => "it was read as this number".into(),
                Anomaly::Word => "it was read as 1 or 0".into(),
            },
            Self::MissingKey { repair, .. } => repair.clone(),
            Self::UnknownWord { repair, .. } => (*repair).into(),
            Self::NamedDataType { data_type } => format!("write its code, 0x{:04X}", data_type.0),
            Self::WrongObjectType { found, .. } => format!("it was read as {found}"),
            Self::MissingObject { .. } => "it was read as a RECORD without a name".into(),
            Self::Count { .. } => "the counted number is used".into(),
            Self::ListedOnly { .. } => "the object does not exist".into(),
            Self::NotListed { .. } => "the object exists nevertheless".into(),
            Self::ListedTwice { .. } => "it was used once".into(),
            Self::DecimalIndex { index, .. } => format!("write 0x{index:04X}"),
            Self::BadLimit { .. } => "the limit was ignored".into(),
            Self::OutsideLimits { .. } => "the value was kept".into(),
            Self::CompactAndFull { .. } => "the full description is used".into(),
            Self::BadMapping { .. } => "the mapping was kept".into(),
        }
    }
}
