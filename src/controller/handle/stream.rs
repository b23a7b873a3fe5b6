//! Streams of set-points.

use std::sync::PoisonError;
use std::time::Duration;

use takt_rt::plan::State;
use takt_rt::{MAX_AXES, Request, StreamCommand};

use super::Handle;
use super::commands::expiry_ns;
use super::error::CommandError;

impl Handle {
    /// Begins to follow [`Handle::stream`]. The first set-points must come within the enable time-out, and must be near
    /// the present positions.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless the group holds its position and is punctual, [`CommandError::Full`], [`CommandError::Ended`].
    pub fn begin_stream(&self) -> Result<(), CommandError> {
        self.request(Request::Stream)
    }

    /// Replaces the streamed set-points, one for each axis. The real-time thread uses the newest ones. They expire after
    /// `valid_for`; then the group decelerates and holds.
    ///
    /// # Errors
    /// [`CommandError::Count`], [`CommandError::Ended`].
    pub fn stream(&self, set_points: &[State], valid_for: Duration) -> Result<(), CommandError> {
        if set_points.len() != self.axes().len() {
            return Err(CommandError::Count { given: set_points.len(), axes: self.axes().len() });
        }
        if self.0.life.is_ending() {
            return Err(CommandError::Ended);
        }
        let mut all = [State::default(); MAX_AXES];
        all.iter_mut().zip(set_points).for_each(|(to, from)| *to = *from);
        // A panic of another holder of the lock leaves the mailbox consistent.
        let mut streamer = self.0.streamer.lock().unwrap_or_else(PoisonError::into_inner);
        streamer.stream(&StreamCommand { valid_until_ns: expiry_ns(valid_for), set_points: all });
        Ok(())
    }
}
