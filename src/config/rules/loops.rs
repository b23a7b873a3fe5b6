//! The loops that takt closes for an axis: their gains, and their stability at the period of the bus.

use super::Fields;
use super::loop_stability::{self, LEAST_DAMPING_RATIO, highest};
use crate::config::keys::{torque_loop as keys, velocity_loop::POSITION_GAIN};
use crate::config::model::Control;
use crate::config::quantities::Quantities;
use crate::config::quantity::Quantity;
use crate::config::spot::Spot;

/// What a loop is closed over.
#[derive(Clone, Copy)]
pub struct Surroundings {
    /// How often the drive reports and takes set-points.
    pub period_ns: u64,
    /// The inertia of the simulated joint; `None` where the joint is a real one.
    pub simulated_inertia: Option<f64>,
}

impl Surroundings {
    /// A drive that reports in every so many cycles closes its loop as seldom.
    pub fn new(
        bus_period_ns: u64,
        transmission_type: u8,
        simulated_inertia: f64,
        is_simulated: bool,
    ) -> Self {
        let cycles = if transmission_type <= 240 { transmission_type.max(1) } else { 1 };
        Self {
            period_ns: bus_period_ns.saturating_mul(cycles.into()),
            simulated_inertia: is_simulated.then_some(simulated_inertia),
        }
    }

    /// Returns `true` if the joint is a simulated one.
    pub const fn is_simulated(&self) -> bool {
        self.simulated_inertia.is_some()
    }

    fn period_s(&self) -> f64 {
        self.period_ns as f64 / 1e9
    }

    fn show_period(&self) -> String {
        Quantity::DURATION.show(self.period_s())
    }
}

pub fn validate(
    control: Control,
    q: Quantities,
    simulated_inertia: f64,
    surroundings: &Surroundings,
    axis: &Fields<'_>,
) {
    match control {
        Control::Velocity { position_gain } => {
            let fields = axis.within("velocity_loop");
            if fields.quantity(&POSITION_GAIN, q, position_gain).is_some() {
                velocity_loop(&fields.at(POSITION_GAIN.name), position_gain, surroundings);
            }
        }
        Control::Torque { stiffness, damping, inertia, viscous_friction, coulomb_friction } => {
            let fields = axis.within("torque_loop");
            let checks = [
                fields.quantity(&keys::STIFFNESS, q, stiffness),
                fields.quantity(&keys::DAMPING, q, damping),
                fields.quantity(&keys::INERTIA, q, inertia),
                fields.quantity(&keys::VISCOUS_FRICTION, q, viscous_friction),
                fields.quantity(&keys::COULOMB_FRICTION, q, coulomb_friction),
            ];
            if checks.iter().all(Option::is_some) && simulated_inertia > 0.0 {
                let gains = TorqueLoop { stiffness, damping, inertia, simulated_inertia };
                gains.check(q, surroundings, |key| fields.at(key), Origin::Gains);
            }
        }
        _ => {}
    }
}

/// Reports a position gain with which the loop would swing.
pub fn velocity_loop(spot: &Spot<'_>, position_gain: f64, surroundings: &Surroundings) {
    let ratio = |gain: f64| loop_stability::velocity_loop(gain, surroundings.period_s());
    if ratio(position_gain) >= LEAST_DAMPING_RATIO {
        return;
    }
    let highest = highest(1e-3, position_gain, ratio).unwrap_or(0.0);
    let allowed = format!(
        "at most {} at a period of {}: {}",
        Quantity::GAIN.show(highest),
        surroundings.show_period(),
        verdict(ratio(position_gain)),
    );
    spot.report_range(Quantity::GAIN.show(position_gain), allowed);
}

/// Which keys the gains of a torque loop come from.
#[derive(Clone, Copy, PartialEq)]
pub enum Origin {
    /// `bandwidth`, from which stiffness and damping follow.
    Bandwidth(f64),
    /// `stiffness` or `damping`.
    Gains,
}

/// The gains of a torque loop, and the inertias that it may turn.
#[derive(Clone, Copy)]
pub struct TorqueLoop {
    pub stiffness: f64,
    pub damping: f64,
    /// What is fed forward; 0 feeds nothing forward.
    pub inertia: f64,
    pub simulated_inertia: f64,
}

impl TorqueLoop {
    /// Reports gains with which the loop would swing.
    pub fn check<'a>(
        &self,
        q: Quantities,
        surroundings: &Surroundings,
        at: impl Fn(&'static str) -> Spot<'a>,
        origin: Origin,
    ) {
        let own = if self.inertia > 0.0 { self.inertia } else { self.simulated_inertia };
        let inertias = [Some(own), surroundings.simulated_inertia.filter(|inertia| *inertia != own)];
        for inertia in inertias.into_iter().flatten() {
            if !self.is_damped(q, inertia, surroundings, &at, origin) {
                return;
            }
        }
    }

    fn is_damped<'a>(
        &self,
        q: Quantities,
        inertia: f64,
        surroundings: &Surroundings,
        at: &impl Fn(&'static str) -> Spot<'a>,
        origin: Origin,
    ) -> bool {
        let period_s = surroundings.period_s();
        let ratio = |stiffness, damping| loop_stability::torque_loop(stiffness, damping, inertia, period_s);
        let present = ratio(self.stiffness, self.damping);
        if present >= LEAST_DAMPING_RATIO {
            return true;
        }
        let place = format!(
            "an inertia of {} and a period of {}",
            q.inertia.show(inertia),
            surroundings.show_period()
        );
        let verdict = verdict(present);
        if let Origin::Bandwidth(bandwidth) = origin {
            let own = if self.inertia > 0.0 { self.inertia } else { self.simulated_inertia };
            let of = |bandwidth: f64| ratio(own * bandwidth * bandwidth, 2.0 * own * bandwidth);
            if let Some(highest) = highest(1e-3, bandwidth, of) {
                let allowed = format!("at most {} with {place}: {verdict}", Quantity::GAIN.show(highest));
                at("bandwidth").report_range(Quantity::GAIN.show(bandwidth), allowed);
                return false;
            }
        }
        let softest = self.stiffness * 1e-6;
        match highest(softest, self.stiffness, |stiffness| ratio(stiffness, self.damping)) {
            Some(highest) => {
                let allowed = format!(
                    "at most {} with a damping of {}, {place}: {verdict}",
                    q.stiffness.show(highest),
                    q.damping.show(self.damping),
                );
                at("stiffness").report_range(q.stiffness.show(self.stiffness), allowed);
            }
            None => {
                let least = inertia / period_s * 1e-3;
                let most = highest(least, least.max(self.damping), |damping| {
                    ratio(softest.min(damping * damping / inertia * 1e-3), damping)
                });
                let allowed = match most.filter(|most| *most < self.damping) {
                    Some(most) => format!("at most {} with {place}: {verdict}", q.damping.show(most)),
                    None => {
                        format!("more, for a stiffness of {}: {verdict}", q.stiffness.show(self.stiffness))
                    }
                };
                at("damping").report_range(q.damping.show(self.damping), allowed);
            }
        }
        false
    }
}

fn verdict(damping_ratio: f64) -> String {
    if damping_ratio > 0.0 {
        format!(
            "the loop would swing for long, with a damping ratio of {damping_ratio:.2} where {LEAST_DAMPING_RATIO} is needed"
        )
    } else {
        "the loop would be unstable".to_owned()
    }
}
