//! What is wrong with a file: each kind of problem, and what is made of it.

use std::fmt;
use std::ops::Range;

use miette::{Diagnostic, LabeledSpan};
use thiserror::Error;

use super::data_type::DataType;
use super::number::Oddity;

/// Whether a problem could be repaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// It was repaired; the file is usable.
    Warning,
    /// The file is not usable.
    Error,
}

/// One problem.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{kind}")]
pub struct Problem {
    /// What is wrong.
    pub kind: ProblemKind,
    /// The bytes of the file (decoded to UTF-8) that are wrong.
    pub span: Range<usize>,
    /// The line that this one contradicts or repeats, counted from 1.
    pub first_line: Option<usize>,
}

impl Diagnostic for Problem {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.kind.severity() {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.kind.help()))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let text = self.first_line.map_or("here".to_owned(), |line| format!("here; first in line {line}"));
        let is_somewhere = !matches!(self.kind, ProblemKind::Unreadable { .. } | ProblemKind::NoObjects);
        Some(Box::new(is_somewhere.then(|| LabeledSpan::at(self.span.clone(), text)).into_iter()))
    }
}

/// The kinds of problems.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ProblemKind {
    /// The file cannot be read.
    #[error("the file cannot be read: {reason}")]
    Unreadable {
        /// What the operating system said.
        reason: String,
    },
    /// No section describes an object.
    #[error("no section of this file describes an object")]
    NoObjects,
    /// A text that is no number.
    #[error("`{key}` is no number: {given:?}")]
    NotANumber {
        /// The key.
        key: String,
        /// The text.
        given: String,
    },
    /// A text that is no list of bytes.
    #[error("`{key}` is no row of bytes in hexadecimal: {given:?}")]
    NotBytes {
        /// The key.
        key: String,
        /// The text.
        given: String,
    },
    /// A number outside the object's type.
    #[error("`{key}` is {value}, which {data_type} cannot be")]
    DoesNotFit {
        /// The key.
        key: String,
        /// The number.
        value: i128,
        /// The type.
        data_type: DataType,
    },
    /// A data type that does not exist.
    #[error("{given:?} is no data type")]
    UnknownDataType {
        /// The text.
        given: String,
    },
    /// A value to be written to the device that is there twice and differs.
    #[error("`{key}` is there twice, with different values")]
    Contradiction {
        /// The key.
        key: String,
    },
    /// A number that something must be in a range of.
    #[error("`{key}` is {value}, and may be {allowed}")]
    OutOfRange {
        /// The key.
        key: String,
        /// The number.
        value: i128,
        /// The range.
        allowed: &'static str,
    },

    /// A line before the first section.
    #[error("this line stands before the first section")]
    OutsideSections,
    /// A line that is neither a section, nor a key with a value, nor a comment.
    #[error("this line is no section, no `key=value` and no comment")]
    NotALine,
    /// A section header without its closing bracket.
    #[error("the closing bracket of this section is missing")]
    UnclosedHeader,
    /// A section that is there already.
    #[error("the section [{name}] is there twice")]
    RepeatedSection {
        /// Its name.
        name: String,
    },
    /// A key that is there already, with the same value.
    #[error("`{key}` is there twice")]
    RepeatedKey {
        /// The key.
        key: String,
    },
    /// A key that is there already, with another value.
    #[error("`{key}` is there twice, with different values")]
    RepeatedKeyDiffers {
        /// The key.
        key: String,
        /// The value that counts.
        counts: String,
    },
    /// A section that is not known, and is much like one that is.
    #[error("the section [{name}] means nothing")]
    UnknownSection {
        /// Its name.
        name: String,
        /// What was probably meant.
        nearest: Option<&'static str>,
    },
    /// A key that is not known, and is much like one that is.
    #[error("`{key}` means nothing here")]
    UnknownKey {
        /// The key.
        key: String,
        /// What was probably meant.
        nearest: &'static str,
    },
    /// A spelling of a number.
    #[error("{}", oddity_words(*.oddity, .given))]
    OddNumber {
        /// The text.
        given: String,
        /// What is odd.
        oddity: Oddity,
    },
    /// A key without which an object is incomplete.
    #[error("`{key}` of {object} is missing")]
    MissingKey {
        /// The key.
        key: &'static str,
        /// The object.
        object: String,
        /// What is made of it.
        repair: String,
    },
    /// A word that is not one of those that may stand there.
    #[error("`{key}` cannot be {given:?}")]
    UnknownWord {
        /// The key.
        key: String,
        /// The word.
        given: String,
        /// What is made of it.
        repair: &'static str,
    },
    /// A data type given by its name.
    #[error("the data type is given by its name, {data_type}")]
    NamedDataType {
        /// The type.
        data_type: DataType,
    },
    /// An object type that the sections contradict.
    #[error("object {index:04X} is called {declared}, and is {found}")]
    WrongObjectType {
        /// The object.
        index: u16,
        /// What the file says.
        declared: &'static str,
        /// What the sections say.
        found: &'static str,
    },
    /// Sub-objects without their object.
    #[error("there are sub-objects of {index:04X}, and no section [{index:04X}]")]
    MissingObject {
        /// The object.
        index: u16,
    },
    /// A count that disagrees with what is counted.
    #[error("`{key}` says {stated}, and there are {found}")]
    Count {
        /// The key.
        key: String,
        /// What the file says.
        stated: i128,
        /// What was counted.
        found: usize,
    },
    /// An object that a list names and no section describes.
    #[error("object {index:04X} is listed, and no section describes it")]
    ListedOnly {
        /// The object.
        index: u16,
    },
    /// An object that no list names.
    #[error("object {index:04X} is in none of the lists of objects")]
    NotListed {
        /// The object.
        index: u16,
    },
    /// An object that two lists name, or one twice.
    #[error("object {index:04X} is listed twice")]
    ListedTwice {
        /// The object.
        index: u16,
    },
    /// An index in a list without its `0x`.
    #[error("{given:?} is meant in hexadecimal")]
    DecimalIndex {
        /// The text.
        given: String,
        /// The object.
        index: u16,
    },
    /// A limit that cannot be, or limits that leave nothing.
    #[error("{reason}")]
    BadLimit {
        /// Why.
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
    /// A compact object that is described in full as well.
    #[error("sub-object {index:04X}:{subindex:02X} is described twice, compactly and in full")]
    CompactAndFull {
        /// The object.
        index: u16,
        /// The sub-index.
        subindex: u8,
    },
    /// A mapped object that is not there, cannot be mapped, or has another length.
    #[error("{mapping} maps {mapped}: {reason}")]
    BadMapping {
        /// The mapping parameter.
        mapping: String,
        /// What it maps.
        mapped: String,
        /// What is wrong.
        reason: String,
    },
}

fn oddity_words(oddity: Oddity, given: &str) -> String {
    match oddity {
        Oddity::Octal => format!("{given} has a leading zero and is octal"),
        Oddity::NotOctal => format!("{given} has a leading zero and digits that octal does not have"),
        Oddity::Suffix => format!("{given} is not how a hexadecimal number is written"),
        Oddity::NoDollar => format!("{given} is not how the node number is written"),
        Oddity::Comment => format!("there is a comment behind the number: {given}"),
        Oddity::Word => format!("{given} stands where a number belongs"),
    }
}

impl ProblemKind {
    /// Whether it could be repaired.
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Unreadable { .. }
            | Self::NoObjects
            | Self::NotANumber { .. }
            | Self::NotBytes { .. }
            | Self::DoesNotFit { .. }
            | Self::UnknownDataType { .. }
            | Self::Contradiction { .. }
            | Self::OutOfRange { .. } => Severity::Error,
            _ => Severity::Warning,
        }
    }

    /// What was made of it, or what to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::Unreadable { .. } => "give the path of an EDS or DCF".into(),
            Self::NoObjects => "objects are described in sections like [1000] and [1018sub1]".into(),
            Self::NotANumber { given, .. } if given.contains('$') => {
                "the node number is written $NODEID, as in $NODEID+0x200".into()
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
            Self::Contradiction { .. } => "leave the wrong one out: it would be written to the device".into(),
            Self::OutOfRange { .. } => "correct it".into(),
            Self::OutsideSections | Self::NotALine => "it was passed over".into(),
            Self::UnclosedHeader => "the name was taken up to the end of the line".into(),
            Self::RepeatedSection { .. } => "both were taken as one".into(),
            Self::RepeatedKey { .. } => "the values are the same".into(),
            Self::RepeatedKeyDiffers { counts, .. } => format!("the first one counts: {counts:?}"),
            Self::UnknownSection { nearest: Some(nearest), .. } => {
                format!("it was passed over; did you mean [{nearest}]?")
            }
            Self::UnknownSection { nearest: None, .. } => {
                "it was passed over; objects are four hexadecimal digits, as in [1018] and [1018sub1]".into()
            }
            Self::UnknownKey { nearest, .. } => format!("it was passed over; did you mean `{nearest}`?"),
            Self::OddNumber { oddity, .. } => match oddity {
                Oddity::Octal => "write it without the zero if it is meant in decimal, or with 0x".into(),
                Oddity::NotOctal => "it was taken as decimal".into(),
                Oddity::Suffix => "it was taken as hexadecimal: write 0x before it".into(),
                Oddity::NoDollar => "it was taken as $NODEID".into(),
                Oddity::Comment => "it was left out: comments have lines of their own".into(),
                Oddity::Word => "it was taken as 1 or 0".into(),
            },
            Self::MissingKey { repair, .. } => repair.clone(),
            Self::UnknownWord { repair, .. } => (*repair).into(),
            Self::NamedDataType { data_type } => format!("write its code, 0x{:04X}", data_type.0),
            Self::WrongObjectType { found, .. } => format!("it was taken as {found}"),
            Self::MissingObject { .. } => "it was taken as a RECORD without a name".into(),
            Self::Count { .. } => "what is there counts".into(),
            Self::ListedOnly { .. } => "the object does not exist".into(),
            Self::NotListed { .. } => "the object exists nevertheless".into(),
            Self::ListedTwice { .. } => "it exists once".into(),
            Self::DecimalIndex { index, .. } => format!("write 0x{index:04X}"),
            Self::BadLimit { .. } => "the limit was left out".into(),
            Self::OutsideLimits { .. } => "the value was kept".into(),
            Self::CompactAndFull { .. } => "the full description counts".into(),
            Self::BadMapping { .. } => "the mapping was kept as it is".into(),
        }
    }
}
