//! Targets of drives in profile modes.

use takt_rt::{MotionState, ProfileMove, ProfileTarget, Request, RequestId};

use crate::drive_modes::wire::MILLISECOND_NS;
use crate::drive_modes::world::World;

impl World {
    /// Returns `true` if a target that [`World::drive_to`] has given is reached.
    pub fn is_reached(&self, motion: RequestId) -> bool {
        self.run.snapshot().motions.of(motion) == Some(MotionState::Finished)
    }

    /// Gives an axis in a profile mode a target that stays valid for an hour.
    pub fn drive_to(&mut self, axis: u8, target: ProfileTarget) -> RequestId {
        let valid_until_ns = self.run.snapshot().at_ns + 3_600_000 * MILLISECOND_NS;
        self.request(Request::SetProfileTarget(ProfileMove { axis, target, valid_until_ns }))
    }
}
