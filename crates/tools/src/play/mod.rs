//! Playing points from a file into the arm: `takt play`.
//!
//! [`PlayFile`] is what the file says. [`FileTrajectory`] makes one checked trajectory of it. A [`Stage`] is an arm in virtual time
//! or in real time, and [`execute`] leads it to the first point and through the file. [`SetPointLog`] keeps what was commanded.

mod error;
mod file;
mod groups;
mod in_real_time;
mod in_virtual_time;
mod joint_trajectory;
mod performance;
mod points;
mod set_points;
mod stream;
mod table;
mod trajectory;

pub use error::PlayFileError;
pub use file::read;
pub use groups::PlayedGroup;
pub use in_real_time::{RealStage, SharedSetPointLog};
pub use in_virtual_time::VirtualStage;
pub use performance::{PlayError, Stage, StreamSummary, execute, stream};
pub use points::PlayFile;
pub use set_points::{ArmedFrom, AxisMaxima, SetPointLog};
pub use stream::FileStream;
pub use trajectory::FileTrajectory;
