//! Stores parameters, and changes stored settings: multi-turn zero, node address, bit rate (manual V.2, V.3.B, 5.04,
//! 5.13).

use takt_rt::Nanoseconds;
use takt_wire::canopen::objects::*;

use super::enabling::refuse_enabled;
use super::objects::*;
use super::reading;
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::scan;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::yz_aim::Alarm;

/// Timeout of storing; the manual gives no time.
const STORING_NS: Nanoseconds = 10_000_000_000;
/// Longest time until 260A has its stored value again and the position is zero.
const ZEROING_NS: Nanoseconds = 1_000_000_000;
/// Number of times the two keys are written.
const ZERO_ATTEMPTS: u8 = 3;
/// Positions that count as zero: "0 or plus a single digit" (manual).
const ZERO_COUNTS: std::ops::RangeInclusive<i64> = 0..=9;

/// Starts storing (2614 = 1) and waits for its end (2614 = 2).
pub async fn store(c: &SdoSession) -> Result<(), Failure> {
    c.step("store");
    c.write(&SAVE_FLAG, 1).await?;
    c.wait_for(&SAVE_FLAG, "stored (2)", STORING_NS, |flag| flag == 2).await.map(|_| ())
}

/// `save`
pub async fn save(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    refuse_enabled(c).await?;
    store(c).await?;
    let mut report = Report::new();
    report.add("stored", "stored", true, "the parameters that can be stored");
    Ok(report)
}

/// `zero`
pub async fn zero(c: &SdoSession, s: &TargetDrive, is_confirmed: bool) -> Result<Report, Failure> {
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this makes the current position the multi-turn zero: every stored position changes its \
                          meaning",
            option: "--yes",
        });
    }
    contact::connect_family(c, s).await?;
    refuse_enabled(c).await?;
    set_zero(c).await
}

/// Writes 60006 and 60016 to 260A. It succeeded when 260A has its stored value again and the position is zero.
pub async fn set_zero(c: &SdoSession) -> Result<Report, Failure> {
    let before = c.read(&POSITION_ACTUAL_VALUE).await?;
    let numerator = c.read(&GEAR_NUMERATOR).await?;
    for attempt in 1..=ZERO_ATTEMPTS {
        c.step("multi-turn zero");
        c.write(&GEAR_NUMERATOR, 60_006).await?;
        c.write(&GEAR_NUMERATOR, 60_016).await?;
        c.step("verification");
        let back = c.wait_for(&GEAR_NUMERATOR, "the numerator", ZEROING_NS, |value| value == numerator);
        let is_back = match back.await {
            Ok(_) => true,
            Err(Failure::NotInTime { .. }) => false,
            Err(failure) => return Err(failure),
        };
        let after = c.read(&POSITION_ACTUAL_VALUE).await?;
        let alarm = reading::alarm(c).await?;
        if is_back && ZERO_COUNTS.contains(&after) && alarm != Alarm::Battery {
            let mut report = Report::new();
            report.add("before_counts", "before", before, format!("{before} counts"));
            report.add("after_counts", "after", after, format!("{after} counts"));
            return Ok(report);
        }
        if attempt < ZERO_ATTEMPTS {
            c.note(format!("the position is {after} counts, the alarm is {alarm}: repeating"));
        }
    }
    if c.read(&GEAR_NUMERATOR).await? != numerator {
        c.write(&GEAR_NUMERATOR, numerator).await?;
    }
    Err(Failure::Contradicted(format!(
        "the drive did not set the multi-turn zero in {ZERO_ATTEMPTS} attempts: check that this model has a battery"
    )))
}

/// `set-id`
pub async fn set_id(c: &SdoSession, s: &TargetDrive, node: u8) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    refuse_enabled(c).await?;
    let others = scan::others(c).await?;
    if !others.is_empty() {
        let nodes: Vec<String> = others.iter().map(u8::to_string).collect();
        return Err(Failure::Unsuitable(format!(
            "there are other nodes on this bus ({}): connect this drive alone, since two drives with the same node ID \
             cannot be told apart",
            nodes.join(", ")
        )));
    }
    c.step("node address");
    c.write_and_check(&NODE_ADDRESS, node.into()).await?;
    store(c).await?;
    let mut report = Report::new();
    report.add("node", "node after a power cycle", node, node.to_string());
    c.note(format!("power-cycle the drive: until then it is node {}, afterwards node {node}", s.node));
    Ok(report)
}

/// The bit rates and their codes.
const BIT_RATES: [(u32, i64); 4] = [(1_000_000, 803), (500_000, 802), (250_000, 801), (125_000, 800)];

/// `set-bitrate`: four writes in this order, then a power cycle. The manual does not ask for storing.
pub async fn set_bit_rate(c: &SdoSession, s: &TargetDrive, bit_rate: u32) -> Result<Report, Failure> {
    let Some((_, code)) = BIT_RATES.iter().find(|(known, _)| *known == bit_rate) else {
        return Err(Failure::Unsupported {
            what: format!("this drive has no bit rate of {bit_rate} bit/s"),
            instead: "it has 1 Mbit/s, 500, 250 and 125 kbit/s".to_owned(),
        });
    };
    contact::connect_family(c, s).await?;
    refuse_enabled(c).await?;
    c.step("read the key objects");
    let mut before = vec![];
    for object in [ACCELERATION, FLUX_WEAKENING_ANGLE, MODBUS_ENABLE] {
        before.push((object, c.read(&object).await?));
    }
    c.step("bit rate");
    for (object, value) in
        [(MODBUS_ENABLE, 1), (ACCELERATION, *code), (FLUX_WEAKENING_ANGLE, 129), (MODBUS_ENABLE, 506)]
    {
        c.write(&object, value).await?;
    }
    let mut report = Report::new();
    report.add("bit_rate", "bit rate after a power cycle", bit_rate, format!("{bit_rate} bit/s"));
    let values: Vec<String> =
        before.iter().map(|(object, value)| format!("{} = {value}", object.address)).collect();
    c.note(format!(
        "power-cycle the drive, then read these objects ({}) and write back what has changed",
        values.join(", ")
    ));
    Ok(report)
}
