//! The torque that is commanded, over everything that it has been made of.

use crate::control::{ControlLaw, LoopInput, TorqueDemand};

/// What the torque is made of, and what is left of what it was made of before.
///
/// A change of the demand takes effect at a limited rate: what the new one leaves out or adds goes into an offset, which fades.
/// What the loop makes of the motion of the joint is not held up by that.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct TorqueLoop {
    demand: TorqueDemand,
    /// The demand of the last command.
    commanded: TorqueDemand,
    /// What is left of earlier demands: N·m (N).
    offset: f64,
    /// The torque of the last command: N·m (N).
    torque: f64,
    /// True if the set-point has begun anew since: the torque goes on from where it was.
    is_resumed: bool,
    /// True if what was to be the last command was not a number.
    is_undefined: bool,
}

impl TorqueLoop {
    pub(super) const fn demand(&self) -> &TorqueDemand {
        &self.demand
    }

    /// Returns `true` if the joint need not be where its set-point is.
    pub(super) const fn is_compliant(&self) -> bool {
        !matches!(self.demand, TorqueDemand::Law { .. })
    }

    /// Returns `true` if the set-point follows the joint, and not the joint the set-point.
    pub(super) const fn is_torque(&self) -> bool {
        matches!(self.demand, TorqueDemand::Torque(_))
    }

    pub(super) fn set(&mut self, demand: TorqueDemand) {
        self.demand = demand;
    }

    /// The loop begins to drive a joint that stands, with a torque that is fed forward from the first command on.
    pub(super) fn begin_holding(&mut self, torque: f64) {
        let demand = TorqueDemand::Law { torque };
        *self = Self { demand, commanded: demand, torque, ..Self::default() };
    }

    /// The set-point begins anew: whatever the loop makes of that, the torque goes on from where it was.
    pub(super) fn resume(&mut self) {
        self.is_resumed = true;
    }

    /// Returns `true` if what the last command was made of gave no number: gains so large that their products are infinite.
    pub(super) const fn is_undefined(&self) -> bool {
        self.is_undefined
    }

    /// The torque of the next command, of at most `limit`. Of the offset `fade` goes away. Where it would not be a number, it stays as
    /// it was, and goes on from there.
    pub(super) fn next(&mut self, law: &ControlLaw, input: &LoopInput, limit: f64, fade: f64) -> f64 {
        let wanted = law.torque(input, &self.demand);
        if self.is_resumed {
            self.offset = self.torque - wanted;
            self.is_resumed = false;
        } else if self.demand != self.commanded {
            let before = law.torque(input, &self.commanded) + self.offset;
            self.offset = before.clamp(-limit, limit) - wanted;
        }
        self.commanded = self.demand;
        self.offset -= self.offset.clamp(-fade, fade);
        let torque = (wanted + self.offset).clamp(-limit, limit);
        self.is_undefined = torque.is_nan();
        if self.is_undefined {
            self.resume();
        } else {
            self.torque = torque;
        }
        self.torque
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::TrackingError;
    use crate::plan::State;
    use proptest::prelude::*;

    const LAW: ControlLaw = ControlLaw::Torque {
        stiffness: 1000.0,
        damping: 10.0,
        inertia: 0.0,
        viscous_friction: 0.0,
        coulomb_friction: 0.0,
    };

    fn input(error: f64) -> LoopInput {
        let set = State::rest(error);
        LoopInput { set, error: TrackingError { position: error, velocity: 0.0 } }
    }

    fn demand() -> impl Strategy<Value = TorqueDemand> {
        prop_oneof![
            (-80.0f64..80.0).prop_map(|torque| TorqueDemand::Law { torque }),
            (-80.0f64..80.0).prop_map(TorqueDemand::Torque),
            (0.0f64..2000.0, 0.0f64..20.0, -80.0f64..80.0).prop_map(|(stiffness, damping, torque)| {
                TorqueDemand::Impedance { stiffness, damping, torque }
            }),
        ]
    }

    proptest! {
        #[test]
        fn whatever_is_demanded_the_torque_keeps_its_limit_and_changes_at_its_rate(
            demands in prop::collection::vec((demand(), 1usize..100, prop::bool::ANY), 1..20),
            error in -0.03f64..0.03,
        ) {
            let (mut torque_loop, mut last) = (TorqueLoop::default(), None);
            for (demand, cycles, is_resumed) in demands {
                torque_loop.set(demand);
                if is_resumed {
                    torque_loop.resume();
                }
                for _ in 0..cycles {
                    let torque = torque_loop.next(&LAW, &input(error), 40.0, 0.5);
                    prop_assert!(torque.abs() <= 40.0);
                    prop_assert!(last.is_none_or(|last: f64| (torque - last).abs() <= 0.5 + 1e-9));
                    last = last.map(|_| torque).or(Some(torque));
                }
            }
        }
    }

    #[test]
    fn a_torque_beyond_the_limit_is_taken_back_at_once() {
        let mut torque_loop = TorqueLoop::default();
        torque_loop.set(TorqueDemand::Torque(1000.0));
        (0..3000).for_each(|_| {
            torque_loop.next(&LAW, &input(0.0), 40.0, 0.5);
        });
        torque_loop.set(TorqueDemand::Torque(0.0));
        assert_eq!(torque_loop.next(&LAW, &input(0.0), 40.0, 0.5), 39.5);
    }

    #[test]
    fn what_the_loop_makes_of_the_joint_is_not_held_up() {
        let mut torque_loop = TorqueLoop::default();
        torque_loop.set(TorqueDemand::Law { torque: 5.0 });
        assert_eq!(torque_loop.next(&LAW, &input(0.0), 40.0, 0.5), 0.5);
        assert_eq!(torque_loop.next(&LAW, &input(0.02), 40.0, 0.5), 21.0);
        (0..20).for_each(|_| {
            torque_loop.next(&LAW, &input(0.02), 40.0, 0.5);
        });
        assert_eq!(torque_loop.next(&LAW, &input(0.02), 40.0, 0.5), 25.0);
    }
}
