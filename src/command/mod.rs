//! What a program may ask of a running controller, and how it is refused: the same words for one in its own process (a
//! [`Handle`](crate::Handle)) and for one in another process (a `Client` of `takt-remote`).

mod axis_properties;
mod backend;
mod error;
mod events;
mod handle;
mod lease_holder;
pub mod motion;
mod point_check;
mod question;
mod recovery;
mod requests;
mod stream;

pub use axis_properties::AxisProperties;
pub use backend::{Backend, EventSource};
#[doc(hidden)]
pub use error::needed;
pub use error::{
    CommandError, LeaseError, MotionError, RecoveryError, Refused, Stopped, StreamError, WaitError,
};
pub use events::Events;
pub use handle::{AnyHandle, Handle, groups_in};
pub use lease_holder::LeaseHolder;
pub use motion::{MotionId, MoveOptions, TrajectoryProgress};
pub use point_check::{PointRefusal, check_point};
pub use question::QuestionError;
pub use requests::{Command, Reply};
pub use stream::StreamHandle;
