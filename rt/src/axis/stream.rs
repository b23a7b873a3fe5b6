//! What a stream, or any other source of targets, wants of an axis, and the set-points that come of it.
//!
//! | wanted | set-point | joint |
//! | --- | --- | --- |
//! | position | led to it within the limits | follows the set-point |
//! | velocity | led by it within the limits, those of the position included | follows the set-point |
//! | impedance | led to it within the limits | is pulled to the set-point by a spring and a damper |
//! | torque | follows the joint | is driven by the torque |
//!
//! Where the joint need not be on its set-point, no following error is a fault: the torque limit bounds what comes of it, and the
//! guard watches the joint itself (its velocity, and its braking distance before the position limits). What comes after a torque
//! or an impedance begins where the joint is.

use super::Axis;
use crate::control::{ControlLaw, TorqueDemand};
use crate::fault::Fault;
use crate::guard::braking_distance;
use crate::plan::{PlanError, State};
use crate::source::{AxisTarget, Follow, follow, follow_velocity};

impl Axis {
    /// The next set-point on the way to what a source wants at the end of this cycle. What it wants of the torque takes effect
    /// with it.
    ///
    /// # Errors
    /// What is no number; a torque or an impedance that the axis does not have in its mode; gains beyond their limits; and where
    /// the stream is to be followed exactly, the limit that it breaks.
    pub fn streamed(&mut self, target: &AxisTarget, period_s: f64) -> Result<State, Fault> {
        match *target {
            AxisTarget::Position { ref state, torque } => {
                self.set_demand(self.fed_forward(torque), period_s)?;
                self.led_to(state, period_s)
            }
            AxisTarget::Impedance { ref state, stiffness, damping, torque } => {
                self.set_demand(TorqueDemand::Impedance { stiffness, damping, torque }, period_s)?;
                self.led_to(state, period_s)
            }
            AxisTarget::Velocity { velocity, acceleration } => {
                self.set_demand(TorqueDemand::default(), period_s)?;
                self.led_by(velocity, acceleration, period_s)
            }
            AxisTarget::Torque(torque) => {
                self.set_demand(TorqueDemand::Torque(torque), period_s)?;
                self.begin_on_joint(period_s);
                Ok(self.set_point())
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
    pub fn resting(&mut self, period_s: f64) -> Result<State, Fault> {
        self.followed(&State::rest(self.stream_rest), period_s)
    }

    /// A stream has run dry, with this as its last point. At a position the axis rests, or where it can stop before if it cannot
    /// stop so early: it does not come back. Behind a velocity or a torque it rests where it can stop, held by the position
    /// loop. The gains of an impedance, and the torque that is fed forward, stay.
    ///
    /// # Errors
    /// As [`Axis::streamed`].
    pub fn begin_rest(&mut self, last: &AxisTarget, period_s: f64) -> Result<(), Fault> {
        self.derive_from_steps(period_s);
        let (demand, last) = match *last {
            AxisTarget::Position { state, torque } => (self.fed_forward(torque), Some(state.position)),
            AxisTarget::Impedance { state, stiffness, damping, torque } => {
                (TorqueDemand::Impedance { stiffness, damping, torque }, Some(state.position))
            }
            AxisTarget::Velocity { .. } | AxisTarget::Torque(_) => (TorqueDemand::default(), None),
        };
        self.set_demand(demand, period_s)?;
        let State { position, velocity, acceleration } = self.set_point();
        // As `follow` stops it where no position limit asks for more.
        let limits = &self.parameters.limits.both_ways();
        let ahead = position + braking_distance(limits, velocity, acceleration);
        let back = position - braking_distance(limits, -velocity, -acceleration);
        let wanted = last.unwrap_or(position);
        self.stream_rest = if velocity > 0.0 {
            wanted.max(ahead)
        } else if velocity < 0.0 {
            wanted.min(back)
        } else {
            wanted
        };
        Ok(())
    }

    /// No source leads the axis any longer: the loop of its law holds it. What is planned from now on begins where the joint is, if
    /// it need not have been on its set-point.
    pub fn end_stream(&mut self, period_s: f64) {
        if self.is_enabled() && self.torque_loop.is_compliant() {
            self.give_up_compliance(period_s);
        }
        self.torque_loop.set(TorqueDemand::default());
    }

    /// The law with a torque beside it, where that goes anywhere. What is no number is left to the check.
    fn fed_forward(&self, torque: f64) -> TorqueDemand {
        let is_taken = matches!(self.parameters.law, ControlLaw::Torque { .. })
            || self.parameters.feed_forward.has_torque();
        TorqueDemand::Law { torque: if is_taken || !torque.is_finite() { torque } else { 0.0 } }
    }

    fn set_demand(&mut self, demand: TorqueDemand, period_s: f64) -> Result<(), Fault> {
        if demand == *self.torque_loop.demand() {
            return Ok(());
        }
        self.check_demand(&demand)?;
        if matches!(demand, TorqueDemand::Law { .. }) && self.torque_loop.is_compliant() {
            self.give_up_compliance(period_s);
        } else if matches!(demand, TorqueDemand::Torque(_)) && !self.torque_loop.is_torque() {
            // The set-point leaves for the joint, and with it goes what the loop has made of their distance.
            self.torque_loop.resume();
        }
        self.torque_loop.set(demand);
        Ok(())
    }

    /// The joint is held on its set-point from now on, which begins where the joint is.
    fn give_up_compliance(&mut self, period_s: f64) {
        self.begin_on_joint(period_s);
        self.torque_loop.resume();
    }

    fn check_demand(&self, demand: &TorqueDemand) -> Result<(), Fault> {
        let finite = |value: f64| {
            if value.is_finite() { Ok(()) } else { Err(Fault::NotFinite { position: value }) }
        };
        let has_torque = || match self.parameters.law {
            ControlLaw::Torque { .. } => Ok(()),
            law => Err(Fault::NoTorqueInMode { mode: law.operation_mode() }),
        };
        match *demand {
            TorqueDemand::Law { torque } => finite(torque),
            TorqueDemand::Torque(torque) => finite(torque).and_then(|()| has_torque()),
            TorqueDemand::Impedance { stiffness, damping, torque } => {
                let limits = &self.parameters.torque_limits;
                finite(torque).and_then(|()| finite(stiffness)).and_then(|()| finite(damping))?;
                has_torque()?;
                if !(0.0..=limits.stiffness).contains(&stiffness) {
                    return Err(Fault::StiffnessLimit { stiffness, limit: limits.stiffness });
                }
                if !(0.0..=limits.damping).contains(&damping) {
                    return Err(Fault::DampingLimit { damping, limit: limits.damping });
                }
                Ok(())
            }
        }
    }

    fn led_to(&self, wanted: &State, period_s: f64) -> Result<State, Fault> {
        match self.follow {
            Follow::Smooth => self.followed(wanted, period_s),
            Follow::Exact => self.exact(wanted, period_s),
        }
    }

    fn led_by(&self, velocity: f64, acceleration: f64, period_s: f64) -> Result<State, Fault> {
        let here = self.set_point();
        match self.follow {
            Follow::Smooth => {
                follow_velocity(&here, velocity, acceleration, &self.parameters.limits, period_s)
                    .map_err(|error| fault_of(&error, velocity))
            }
            // The velocity of a step is that of its middle.
            Follow::Exact => {
                let position = here.position + period_s * (velocity - 0.5 * acceleration * period_s);
                self.exact(&State { position, velocity, acceleration }, period_s)
            }
        }
    }

    fn exact(&self, wanted: &State, period_s: f64) -> Result<State, Fault> {
        self.check(wanted, period_s)?;
        self.check_stream(wanted, period_s)?;
        Ok(self.agreeing(wanted, period_s))
    }

    fn followed(&self, wanted: &State, period_s: f64) -> Result<State, Fault> {
        follow(&self.set_point(), wanted, &self.parameters.limits, period_s)
            .map_err(|error| fault_of(&error, wanted.position))
    }
}

fn fault_of(error: &PlanError, wanted: f64) -> Fault {
    match error {
        PlanError::NotFinite { .. } => Fault::NotFinite { position: wanted },
        _ => Fault::NoTrajectory,
    }
}
