//! Gains, electronic gear, motion at power-up, and the set-up for interpolation.

use super::enabling::refuse_enabled;
use super::objects::*;
use super::storing::store;
use super::words;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::yz_aim::NO_RAMP;

/// 2619 = 6: return to the multi-turn zero at power-up.
const RETURN_TO_ZERO: i64 = 6;
/// 2619 = 7: interpolation.
const INTERPOLATION: i64 = 7;

/// `gains`
pub async fn gains(
    c: &SdoSession,
    s: &TargetDrive,
    position_proportional: Option<i64>,
    velocity_proportional: Option<i64>,
    velocity_integration: Option<i64>,
) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    let wanted = [
        ("position_proportional", POSITION_PROPORTIONAL, position_proportional),
        ("velocity_proportional", VELOCITY_PROPORTIONAL, velocity_proportional),
        ("velocity_integration_ms", VELOCITY_INTEGRATION, velocity_integration),
    ];
    let is_changed = wanted.iter().any(|(_, _, value)| value.is_some());
    let mut report = Report::new();
    for (key, object, value) in wanted {
        c.step(object.name);
        if let Some(value) = value {
            c.write_and_check(&object, value).await?;
        }
        let value = c.read(&object).await?;
        report.add(key, object.name, value, value.to_string());
    }
    if position_proportional.is_some() {
        c.note(
            "the last digit of the position gain is the polarity of the alarm output: even opens, odd closes",
        );
    }
    if velocity_proportional.is_some() {
        c.note("the last digit of the velocity gain is the active edge of the pulse input: even off, odd on");
    }
    if is_changed {
        c.note("this is lost at power-off unless it is stored with `save`");
    }
    Ok(report)
}

/// `gear`: the electronic gear of the pulse input. The manual does not say whether it also scales positions on the bus.
pub async fn gear(c: &SdoSession, s: &TargetDrive, ratio: Option<(u16, u16)>) -> Result<Report, Failure> {
    if let Some((numerator, _)) = ratio
        && let Some(key) = words::gear_key(numerator.into())
    {
        return Err(Failure::Unsuitable(format!("{numerator} is not a numerator but a command key: {key}")));
    }
    contact::connect_family(c, s).await?;
    c.step("electronic gear");
    if let Some((numerator, denominator)) = ratio {
        c.write_and_check(&GEAR_NUMERATOR, numerator.into()).await?;
        c.write_and_check(&GEAR_DENOMINATOR, denominator.into()).await?;
        if greatest_common_divisor(numerator, denominator) > 1 {
            c.note("reduce the ratio: a large numerator degrades following");
        }
        c.note("this is lost at power-off unless it is stored with `save`");
    }
    let (numerator, denominator) = (c.read(&GEAR_NUMERATOR).await?, c.read(&GEAR_DENOMINATOR).await?);
    let mut report = Report::new();
    report.add("numerator", "numerator", numerator, numerator.to_string());
    report.add("denominator", "denominator", denominator, denominator.to_string());
    if numerator > 0 {
        let pulses = 32_768.0 * denominator as f64 / numerator as f64;
        report.add("pulses_per_turn", "pulses per turn of the motor", pulses, pulses.to_string());
    }
    Ok(report)
}

fn greatest_common_divisor(a: u16, b: u16) -> u16 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// `auto-home`
pub async fn auto_home(
    c: &SdoSession,
    s: &TargetDrive,
    is_on: bool,
    is_confirmed: bool,
) -> Result<Report, Failure> {
    if is_on && !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "the motor will move to its multi-turn zero by itself whenever its supply comes on",
            option: "--yes",
        });
    }
    contact::connect_family(c, s).await?;
    refuse_enabled(c).await?;
    c.step("special function");
    let before = c.read(&SPECIAL_FUNCTION).await?;
    if before == INTERPOLATION {
        c.note("interpolation (7) is turned off: the drive has one special function at a time");
    }
    let function = if is_on { RETURN_TO_ZERO } else { 0 };
    c.write_and_check(&SPECIAL_FUNCTION, function).await?;
    store(c).await?;
    let mut report = special_function(before, function);
    if is_on {
        let digit = c.read(&ACCELERATION).await? % 10;
        let speed = (digit + 1) * 100;
        report.add("return_speed_rpm", "speed of the return", speed, format!("{speed} r/min"));
        c.note("the speed is the last digit of 6083: 0 to 9 for 100 to 1000 r/min");
    }
    Ok(report)
}

/// `interpolation`
pub async fn interpolation(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    refuse_enabled(c).await?;
    c.step("special function");
    let before = c.read(&SPECIAL_FUNCTION).await?;
    if before == RETURN_TO_ZERO {
        c.note(
            "the return to zero at power-up (6) is turned off: the drive has one special function at a time",
        );
    }
    c.write_and_check(&SPECIAL_FUNCTION, INTERPOLATION).await?;
    c.step("no acceleration ramp");
    let acceleration = c.read(&ACCELERATION).await?;
    if acceleration < NO_RAMP {
        c.write_and_check(&ACCELERATION, NO_RAMP).await?;
    }
    store(c).await?;
    let mut report = special_function(before, INTERPOLATION);
    let acceleration = c.read(&ACCELERATION).await?;
    report.add("acceleration", "acceleration", acceleration, format!("{acceleration}: no ramp in the drive"));
    c.note("power-cycle the drive: the special function must be stored before it is used");
    Ok(report)
}

fn special_function(before: i64, after: i64) -> Report {
    let mut report = Report::new();
    for (key, label, value) in [("before", "before", before), ("special_function", "special function", after)]
    {
        report.add(key, label, value, format!("{value}: {}", words::special_function(value)));
    }
    report
}
