//! `takt drive … pulse-width`: what a pulse at the PWM input of a drive means, by the tables of its manual.

use clap::Args;

use takt::config::Quantity;
use takt::family::Family;
use takt_tools::commission::{Failure, PulseQuantity, PulseWidth, Report};

use super::super::exit::Exit;
use super::super::print;
use super::super::usage_error::UsageError;
use super::output::render;

/// Calculate the pulse at the PWM input for a value, or what a pulse means; needs no bus (some drives)
#[derive(Args, Debug)]
pub struct Arguments {
    /// The model, as the manual's table has it: HO6213, "HO7213 high speed" …
    model: String,
    #[command(flatten)]
    asked: Asked,
}

#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
struct Asked {
    /// The pulse for this position: "90 deg"
    #[arg(long, value_name = "P", allow_hyphen_values = true)]
    position: Option<String>,
    /// The pulse for this velocity, in Hz as the table has it: -30
    #[arg(long, value_name = "HZ", allow_hyphen_values = true)]
    velocity: Option<f64>,
    /// The pulse for this current, in A: 0.5
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    current: Option<f64>,
    /// What a pulse of this width in µs means: 1600
    #[arg(long, value_name = "US")]
    width: Option<f64>,
}

impl Asked {
    fn pulse(&self) -> Result<PulseWidth, UsageError> {
        let of = |quantity, value| PulseWidth::Of { quantity, value };
        if let Some(text) = &self.position {
            let position = Quantity::ANGLE.parse(text);
            let position =
                position.map_err(|_| format!("`{text}` is no angle: write for example \"90 deg\""))?;
            return Ok(of(PulseQuantity::Position, position));
        }
        let velocity = self.velocity.map(|velocity| of(PulseQuantity::Velocity, velocity));
        let current = self.current.map(|current| of(PulseQuantity::Current, current));
        let width = self.width.map(|width_us| PulseWidth::Means { width_us });
        velocity.or(current).or(width).ok_or_else(|| "say a value or a width".into())
    }
}

/// Calculates it.
pub fn run(arguments: &Arguments, family: Result<&dyn Family, UsageError>, is_json: bool) -> Exit {
    match report(arguments, family) {
        Ok(report) if is_json => print::json(&report, Exit::Done),
        Ok(report) => print::text(&render(&report), Exit::Done),
        Err(error) => error.print(is_json),
    }
}

fn report(arguments: &Arguments, family: Result<&dyn Family, UsageError>) -> Result<Report, UsageError> {
    let (family, asked) = (family?, arguments.asked.pulse()?);
    let report = family.pulse_width(&arguments.model, &asked);
    let report: Result<Report, Failure> =
        report.ok_or_else(|| format!("the family {} has no table of pulses", family.word()))?;
    report.map_err(|failure| failure.to_string().into())
}
