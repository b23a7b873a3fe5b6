//! The mode of an axis, and the loops that the controller closes for it.

use super::section::Section;
use crate::config::defaults;
use crate::config::drive_family::DriveFacts;
use crate::config::key::Key;
use crate::config::keys::torque_loop::{
    BANDWIDTH, COULOMB_FRICTION, DAMPING, DAMPING_MAX, INERTIA, STIFFNESS, STIFFNESS_MAX, TORQUE_RISE,
    VISCOUS_FRICTION,
};
use crate::config::keys::velocity_loop::POSITION_GAIN;
use crate::config::model::{Compliance, Control, Joint};
use crate::config::quantities::Quantities;
use crate::config::rules;
use crate::config::rules::loops::{self, Origin, Surroundings, TorqueLoop};

/// How an axis is commanded.
pub struct Modes {
    /// The mode that it starts in, with the gains of the loop that it needs.
    pub control: Control,
    /// Those that it may be changed to.
    pub others: Vec<Control>,
    /// What a source may ask of the torque loop.
    pub compliance: Compliance,
}

impl Modes {
    /// All of them.
    pub fn all(&self) -> Vec<Control> {
        std::iter::once(self.control).chain(self.others.clone()).collect()
    }
}

/// The modes. The gains of loops that none of them needs are read and not used, so that the mode can be changed in one line.
/// Without the surroundings, whose period could not be read, no loop is judged.
pub fn modes(
    section: &mut Section<'_>,
    drive: Option<&DriveFacts>,
    q: Quantities,
    joint: &Joint,
    surroundings: Option<&Surroundings>,
) -> Option<Modes> {
    let period_s =
        surroundings.map_or(defaults::PERIOD_NS, |surroundings| surroundings.period_ns) as f64 / 1e9;
    let mut velocity_section = section.section("velocity_loop");
    let mut torque_section = section.section("torque_loop");
    let velocity_loop = velocity_loop(&mut velocity_section, period_s);
    let (torque_loop, origin) = torque_loop(&mut torque_section, q, joint, period_s).unzip();
    let asked = AskedCompliance::read(&mut torque_section, q);
    let modes = [
        ("csp", Some(Control::Position)),
        ("csv", velocity_loop),
        ("cst", torque_loop),
        ("ip", Some(Control::Interpolated)),
        ("pp", Some(Control::ProfilePosition)),
        ("pv", Some(Control::ProfileVelocity)),
        ("pt", Some(Control::ProfileTorque)),
    ];
    let control = match (section.get("mode"), drive) {
        (Some(entry), drive) => {
            // A loop whose gains are wrong has been reported; its mode may be chosen.
            let is_own = |control: &Option<Control>| {
                drive.zip(control.as_ref()).is_none_or(|(drive, control)| drive.has_mode(control))
            };
            let own: Vec<_> = modes.into_iter().filter(|(_, control)| is_own(control)).collect();
            entry.choice(&own).flatten()
        }
        (None, drive) => Some(drive.map_or(Control::Position, |drive| drive.usual_mode)),
    };
    let others = others(section, drive, control, &modes);
    for law in control.iter().chain(&others) {
        let Some(surroundings) = surroundings else { break };
        match *law {
            Control::Velocity { position_gain } => {
                loops::velocity_loop(&velocity_section.spot(POSITION_GAIN.name), position_gain, surroundings);
            }
            Control::Torque { stiffness, damping, inertia, .. } => {
                let gains = TorqueLoop { stiffness, damping, inertia, simulated_inertia: joint.inertia() };
                let origin = origin.unwrap_or(Origin::Gains);
                gains.check(q, surroundings, |key| torque_section.spot(key), origin);
                if asked.has_gains() {
                    // The stiffest spring that a stream may ask for must not swing either.
                    let Compliance { stiffness_max, damping_max, .. } = asked.of(&[*law]);
                    let gains = TorqueLoop { stiffness: stiffness_max, damping: damping_max, ..gains };
                    let at = |key| torque_section.spot(AskedCompliance::key_of(key));
                    gains.check(q, surroundings, at, Origin::Gains);
                }
            }
            _ => {}
        }
    }
    velocity_section.finish();
    torque_section.finish();
    let control = control?;
    let controls: Vec<Control> = std::iter::once(control).chain(others.clone()).collect();
    Some(Modes { control, others, compliance: asked.of(&controls) })
}

/// The modes that the axis may be changed to, without the one that it starts in. A loop whose gains are wrong is left out: they have
/// been reported.
fn others(
    section: &mut Section<'_>,
    drive: Option<&DriveFacts>,
    control: Option<Control>,
    modes: &[(&'static str, Option<Control>)],
) -> Vec<Control> {
    let Some(entry) = section.get("modes") else { return vec![] };
    if let (Some(drive), Some(control)) = (drive, control)
        && !rules::axis::has_other_modes(&entry.spot, drive, control)
    {
        return vec![];
    }
    let own = control.map(|control| control.operation_mode());
    let mut seen = vec![];
    let mut others = vec![];
    for entry in entry.list().into_iter().flatten() {
        let Some(mode) = entry.choice(&rules::axis::CHANGEABLE_MODES) else { continue };
        let of_mode = modes.iter().find(|(word, _)| entry.is_word(word));
        if seen.contains(&mode) {
            rules::axis::repeated_mode(&entry.spot, mode);
        } else if let Some((_, Some(law))) = of_mode
            && own != Some(mode)
        {
            others.push(*law);
        }
        seen.push(mode);
    }
    others
}

/// The limits of what a source may ask of the torque loop, as far as the file gives them.
struct AskedCompliance {
    stiffness_max: Option<f64>,
    damping_max: Option<f64>,
    torque_rise_ns: Option<u64>,
}

impl AskedCompliance {
    fn read(section: &mut Section<'_>, q: Quantities) -> Self {
        Self {
            stiffness_max: section.quantity(&STIFFNESS_MAX, q),
            damping_max: section.quantity(&DAMPING_MAX, q),
            torque_rise_ns: section.nanoseconds(&TORQUE_RISE),
        }
    }

    fn has_gains(&self) -> bool {
        self.stiffness_max.is_some() || self.damping_max.is_some()
    }

    /// The key of the highest value of a gain.
    fn key_of(gain: &'static str) -> &'static str {
        match gain {
            "stiffness" => STIFFNESS_MAX.name,
            "damping" => DAMPING_MAX.name,
            other => other,
        }
    }

    fn of(&self, controls: &[Control]) -> Compliance {
        let default = defaults::compliance(controls);
        Compliance {
            stiffness_max: self.stiffness_max.unwrap_or(default.stiffness_max),
            damping_max: self.damping_max.unwrap_or(default.damping_max),
            torque_rise_ns: self.torque_rise_ns.unwrap_or(default.torque_rise_ns),
        }
    }
}

/// `None` where a gain is wrong.
fn velocity_loop(section: &mut Section<'_>, period_s: f64) -> Option<Control> {
    let gain = section.keyed(&POSITION_GAIN).map(|entry| entry.quantity(Quantities::ROTARY));
    let position_gain = gain.unwrap_or_else(|| Some(defaults::position_gain(period_s)))?;
    Some(Control::Velocity { position_gain })
}

/// `None` where a gain is wrong. The keys that the gains come from are those to name when they do not suit the loop.
fn torque_loop(
    section: &mut Section<'_>,
    q: Quantities,
    joint: &Joint,
    period_s: f64,
) -> Option<(Control, Origin)> {
    let mut value = |key: &'static Key, default: Option<f64>| match section.keyed(key) {
        Some(entry) => entry.quantity(q),
        None => default,
    };
    let default_bandwidth = Some(defaults::torque_loop_bandwidth(period_s));
    let bandwidth = value(&BANDWIDTH, default_bandwidth);
    let inertia = value(&INERTIA, Some(joint.inertia()));
    let by_bandwidth = |gain: fn(f64, f64) -> f64| Some(gain(inertia?, bandwidth?));
    let default_stiffness = by_bandwidth(|inertia, bandwidth| inertia * bandwidth * bandwidth);
    let default_damping = by_bandwidth(|inertia, bandwidth| 2.0 * inertia * bandwidth);
    let stiffness = value(&STIFFNESS, default_stiffness);
    let damping = value(&DAMPING, default_damping);
    let viscous_friction = value(&VISCOUS_FRICTION, Some(joint.viscous_friction()));
    let coulomb_friction = value(&COULOMB_FRICTION, Some(joint.coulomb_friction()));
    let are_given = [stiffness != default_stiffness, damping != default_damping];
    let origin = match bandwidth {
        Some(bandwidth) if are_given == [false; 2] => Origin::Bandwidth(bandwidth),
        _ => Origin::Gains,
    };
    let law = Control::Torque {
        stiffness: stiffness?,
        damping: damping?,
        inertia: inertia?,
        viscous_friction: viscous_friction?,
        coulomb_friction: coulomb_friction?,
    };
    Some((law, origin))
}
