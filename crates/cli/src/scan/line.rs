//! A serial line with Modbus slaves.

use std::cell::Cell;

use super::super::usage_error::UsageError;
use super::arguments::Arguments;
use super::interruption::Interruption;
use super::output::Watcher;
use takt::config::SerialDevice;
use takt::family::scan::{LineScan, PlaceOfScan, Scanned, scan_line};
use takt::link::RealInterface;
use takt::link::modbus_line::ModbusLine;
use takt::link::serial_line::SerialSettings;
use takt_tools::commission::line_session;

/// The bit rate of a line that says none.
const USUAL_RATE: u32 = 115_200;

/// Scans the line at each of its bit rates.
pub fn scan(
    arguments: &Arguments,
    device: &SerialDevice,
    interruption: &Interruption,
    watcher: &Watcher,
) -> Result<(PlaceOfScan, Scanned), UsageError> {
    let mut rates = arguments.line_rate.clone();
    if rates.is_empty() {
        rates.push(device.bit_rate.unwrap_or(USUAL_RATE));
    }
    let mut all = Scanned::default();
    let mut first_rate = None;
    let is_told = Cell::new(false);
    for rate in rates.iter().copied() {
        let mut line = ModbusLine::open(&device.device, &SerialSettings::new(rate))
            .map_err(|error| format!("--bus serial:{}: {error}", device.device))?;
        let what = LineScan { nodes: arguments.from..=arguments.to, bit_rate: rate, wait_ns: arguments.wait };
        let is_interrupted = || interruption.has_come() && !is_told.replace(true);
        let see = |at_ns, event: line_session::LineEvent<'_>| watcher.see_line(at_ns, rate, &event);
        match line_session::run(Box::new(scan_line(what)), &mut line, is_interrupted, see) {
            Ok(Ok(found)) => {
                if !found.devices.is_empty() {
                    first_rate.get_or_insert(rate);
                }
                all.devices.extend(found.devices);
                let at_rate =
                    |remark| if rates.len() > 1 { format!("at {rate} bit/s: {remark}") } else { remark };
                all.remarks.extend(found.remarks.into_iter().map(at_rate));
                all.is_interrupted = found.is_interrupted;
            }
            Ok(Err(error)) => all.remarks.push(error.to_string()),
            // What was found at other rates is shown all the same.
            Err(error) => {
                all.remarks.push(format!("the line does not work any more: {error}"));
                all.is_interrupted = true;
            }
        }
        if all.is_interrupted {
            break;
        }
    }
    let rate = first_rate.or(rates.first().copied()).unwrap_or(USUAL_RATE);
    let named = SerialDevice { device: device.device.clone(), bit_rate: None };
    let interface = RealInterface::Serial(named).to_string();
    Ok((PlaceOfScan { interface, bit_rate: rate, data_bit_rate: None }, all))
}
