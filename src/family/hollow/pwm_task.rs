//! `takt drive … pulse-width`: the width of a pulse for a value, or the value of a width, by the tables of the manual.

use std::f64::consts::TAU;

use super::pwm::{MODELS, PwmModel, PwmQuantity};
use crate::config::Quantity;
use crate::family::commission::{Failure, PulseWidth, Report};

/// The report on a pulse.
///
/// # Errors
/// There is no such model, or it has no such value or width.
pub fn report(model: &str, asked: &PulseWidth) -> Result<Report, Failure> {
    let wanted = model.to_lowercase();
    let model = MODELS.iter().find(|model| model.name.to_lowercase() == wanted).ok_or_else(|| {
        let names: Vec<&str> = MODELS.iter().map(|model| model.name).collect();
        Failure::Unsuitable(format!("there is no model {model:?} in the table; it has: {}", names.join(", ")))
    })?;
    let unsuitable = |error: super::pwm::PwmError| Failure::Unsuitable(error.to_string());
    let mut report = Report::new();
    report.add("model", "model", model.name, model.name);
    match *asked {
        PulseWidth::Of { quantity, value } => {
            let width_us = model.width_us(quantity_of(quantity), value).map_err(unsuitable)?;
            report.add("width_us", "pulse width", width_us, format!("{width_us:.1} µs"));
        }
        PulseWidth::Means { width_us } => add_meanings(&mut report, model, width_us)?,
    }
    Ok(report)
}

fn add_meanings(report: &mut Report, model: &PwmModel, width_us: f64) -> Result<(), Failure> {
    let value =
        |quantity| model.value(quantity, width_us).map_err(|error| Failure::Unsuitable(error.to_string()));
    let (position, velocity, current) =
        (value(PwmQuantity::Position)?, value(PwmQuantity::Velocity)?, value(PwmQuantity::Current)?);
    let turns = position / TAU;
    report.add(
        "position",
        "position",
        position,
        format!("{} = {turns:.4} turn", Quantity::ANGLE.show(position)),
    );
    report.add("velocity_hz", "velocity", velocity, format!("{velocity:.3} Hz"));
    report.add("current_a", "current", current, format!("{current:.3} A"));
    Ok(())
}

const fn quantity_of(quantity: crate::family::commission::PulseQuantity) -> PwmQuantity {
    use crate::family::commission::PulseQuantity;
    match quantity {
        PulseQuantity::Position => PwmQuantity::Position,
        PulseQuantity::Velocity => PwmQuantity::Velocity,
        PulseQuantity::Current => PwmQuantity::Current,
    }
}
