//! Playing points from a file into the arm: `takt play`.

mod error;
mod file;
mod table;

pub use error::{FileProblem, PlayFileError};
pub use file::{JointColumns, JointPoint, PlayFile, PlayRow};
