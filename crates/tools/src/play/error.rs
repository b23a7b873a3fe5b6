//! What is wrong with a file of points.

use std::fmt;

/// A problem of a file of points, and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayFileError {
    /// The line, from 1.
    pub line: usize,
    /// The letter in the line, from 1; `None` where the whole line is meant.
    pub column: Option<usize>,
    /// What is wrong there.
    pub problem: FileProblem,
}

/// What is wrong with a file of points.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FileProblem {
    /// There is nothing in it.
    Empty,
    /// It is not text in UTF-8.
    NotText,
    /// It has a header and no row.
    NoRow,
    /// A quote is not closed.
    UnclosedQuote,
    /// Something follows a closing quote before the next comma.
    BehindQuote,
    /// The header lacks a column.
    MissingColumn {
        /// Its name.
        name: &'static str,
    },
    /// The header has no column with a position of a joint.
    NoJoint {
        /// The names of the joints.
        joints: Vec<String>,
    },
    /// A column of the header is not known.
    UnknownColumn {
        /// Its name.
        name: String,
        /// The names of the joints.
        joints: Vec<String>,
    },
    /// A column comes twice.
    RepeatedColumn {
        /// Its name.
        name: String,
    },
    /// A joint has a column of its velocity, acceleration or torque, and none of its position, or an acceleration without a
    /// velocity.
    WithoutColumn {
        /// The column.
        name: String,
        /// The one that is missing.
        needed: String,
    },
    /// The drive of a joint plans its own profile, and follows no set-points.
    OwnProfile {
        /// The joint.
        joint: String,
    },
    /// A row has more or fewer cells than the header.
    CellCount {
        /// How many it has.
        cells: usize,
        /// How many the header has.
        columns: usize,
    },
    /// A cell that must have a number has none.
    EmptyCell {
        /// The name of its column.
        name: String,
    },
    /// A cell is not a finite number.
    NotANumber {
        /// The name of its column.
        name: String,
        /// What it is.
        text: String,
    },
    /// A time is out of the range that is possible.
    Time {
        /// The name of its column.
        name: &'static str,
        /// The time.
        time_s: f64,
    },
    /// A row arrives before the one above it.
    ArrivalOrder {
        /// When it arrives.
        arrive_s: f64,
        /// When the one above it arrives.
        previous_s: f64,
    },
    /// The number of a chunk is not a whole number.
    Chunk {
        /// What it is.
        text: String,
    },
    /// It has the time from the start of a trajectory and another one.
    TwoTimes {
        /// The other column.
        name: String,
    },
    /// A message of ROS cannot be read.
    Message {
        /// Why not.
        words: String,
    },
    /// The rows cannot be played.
    Rows {
        /// The name of the joint concerned.
        joint: Option<String>,
        /// Why not.
        words: String,
    },
}

impl fmt::Display for FileProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str(
                "the file is empty; it needs a header such as `arrive,at,JOINT`, and rows below it",
            ),
            Self::NotText => f.write_str("the file is not text in UTF-8"),
            Self::NoRow => f.write_str("there is no row below the header"),
            Self::UnclosedQuote => f.write_str("this quote is not closed"),
            Self::BehindQuote => f.write_str("a comma must follow the closing quote"),
            Self::MissingColumn { name } => {
                write!(
                    f,
                    "the header needs a column `{name}`: `arrive,at,JOINT…`, times in seconds from the start"
                )
            }
            Self::NoJoint { joints } => {
                write!(f, "the header names no joint; the joints are {}", joints.join(", "))
            }
            Self::UnknownColumn { name, joints } => write!(
                f,
                "the column `{name}` is not known; the joints are {}, each with .velocity, .acceleration and .torque beside it",
                joints.join(", ")
            ),
            Self::RepeatedColumn { name } => write!(f, "the column `{name}` comes twice"),
            Self::WithoutColumn { name, needed } => write!(f, "the column `{name}` needs one of `{needed}`"),
            Self::OwnProfile { joint } => write!(
                f,
                "`{joint}` is in a profile mode, in which its drive follows no set-points: use mode csp, csv, cst or ip"
            ),
            Self::CellCount { cells, columns } => {
                write!(f, "this row has {cells} cells, and the header has {columns} columns")
            }
            Self::EmptyCell { name } => write!(f, "`{name}` has no value"),
            Self::NotANumber { name, text } => write!(f, "`{name}` is not a finite number: `{text}`"),
            Self::Time { name: "arrive", time_s } => {
                write!(f, "`arrive` is {time_s} s; it is a time after the start, 1e9 s at most")
            }
            Self::Time { name, time_s } => write!(f, "`{name}` is {time_s} s; 1e9 s either way are possible"),
            Self::ArrivalOrder { arrive_s, previous_s } => write!(
                f,
                "rows stand in the order of their arrival: this one arrives at {arrive_s} s, and the one above it at {previous_s} s"
            ),
            Self::Chunk { text } => write!(f, "the number of a chunk is a whole number: `{text}`"),
            Self::TwoTimes { name } => {
                write!(f, "`time_from_start` and `{name}` are two times: leave one of them out")
            }
            Self::Message { words } => write!(f, "JointTrajectory: {words}"),
            Self::Rows { joint: Some(joint), words } => write!(f, "{joint}: {words}"),
            Self::Rows { joint: None, words } => f.write_str(words),
        }
    }
}

impl fmt::Display for PlayFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}", self.line)?;
        if let Some(column) = self.column {
            write!(f, ", column {column}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl std::error::Error for PlayFileError {}
