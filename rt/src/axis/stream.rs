//! The set-points of a stream.

use super::Axis;
use crate::fault::Fault;
use crate::guard::braking_distance;
use crate::plan::{PlanError, State};
use crate::source::{AxisTarget, Follow, follow};

impl Axis {
    /// The next set-point on the way to what a stream wants at the end of this cycle.
    ///
    /// # Errors
    /// What is no number; and where the stream is to be followed exactly, the limit that it breaks.
    pub fn streamed(&self, target: &AxisTarget, period_s: f64) -> Result<State, Fault> {
        let AxisTarget::Position(wanted) = target;
        match self.follow {
            Follow::Smooth => self.followed(wanted, period_s),
            Follow::Exact => {
                self.check(wanted, period_s)?;
                self.check_stream(wanted, period_s)?;
                Ok(self.agreeing(wanted, period_s))
            }
        }
    }

    /// From now on targets beyond the limits are treated so; `None` as it is configured.
    pub fn follow_as(&mut self, follow: Option<Follow>) {
        self.follow = follow.unwrap_or(self.parameters.follow);
    }

    /// The next set-point on the way to where the axis rests while a stream has run dry.
    ///
    /// # Errors
    /// As [`Axis::streamed`].
    pub fn resting(&self, period_s: f64) -> Result<State, Fault> {
        self.followed(&State::rest(self.stream_rest), period_s)
    }

    /// A stream has run dry, with this as its last point: the axis rests there, or where it can stop before if it cannot stop
    /// so early. It does not come back.
    pub fn begin_rest(&mut self, last: &AxisTarget, period_s: f64) {
        self.derive_from_steps(period_s);
        let AxisTarget::Position(last) = last;
        let State { position, velocity, acceleration } = self.set_point();
        let limits = &self.parameters.limits;
        let ahead = braking_distance(limits, velocity, acceleration);
        let back = braking_distance(limits, -velocity, -acceleration);
        self.stream_rest = if velocity > 0.0 && last.position < position + ahead {
            position + ahead
        } else if velocity < 0.0 && last.position > position - back {
            position - back
        } else {
            last.position
        };
    }

    fn followed(&self, wanted: &State, period_s: f64) -> Result<State, Fault> {
        follow(&self.set_point(), wanted, &self.parameters.limits, period_s).map_err(|error| match error {
            PlanError::NotFinite { .. } => Fault::NotFinite { position: wanted.position },
            _ => Fault::NoTrajectory,
        })
    }
}
