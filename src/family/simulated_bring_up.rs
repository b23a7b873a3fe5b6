//! Bring-up of simulated drives, which shows what a data sheet makes impossible.

use takt_rt::{BusPort, Nanoseconds, ReceiveBatch};

use super::bring_up::{AxisFailure, BringUp, FailureCause};
use super::{registry, simulated_bus};
use crate::config::Config;
use takt_sim::SimulatedBus;

/// Time from one look at the buses to the next.
const STEP_NS: Nanoseconds = 500_000;
/// Longest bring-up, in virtual time.
const AT_MOST_NS: Nanoseconds = 60_000_000_000;

/// Returns how bring-up fails with drives that are as their data sheets say. Drives without a data sheet are not looked at, nor is a
/// mapping that the user has stored in a drive, which its data sheet does not have.
pub fn refused_by_data_sheets(config: &Config) -> Vec<AxisFailure> {
    let has_sheet = |index: &usize| {
        config
            .axes
            .get(*index)
            .is_some_and(|axis| registry::of(&axis.drive).data_sheet(&axis.drive).is_some())
    };
    let axes: Vec<usize> = (0..config.axes.len()).filter(has_sheet).collect();
    if axes.is_empty() {
        return vec![];
    }
    let mut failures = simulated(config, &axes);
    failures.retain(|failure| {
        let is_fixed = config.axes.get(failure.axis).is_none_or(|axis| axis.drive.has_fixed_process_data);
        is_fixed || !matches!(failure.cause, FailureCause::Mapping(_))
    });
    failures
}

/// Brings these axes up on simulated buses, in virtual time. One that never ends fails nothing: the real one says what it waits for.
fn simulated(config: &Config, axes: &[usize]) -> Vec<AxisFailure> {
    let mut buses: Vec<SimulatedBus> =
        (0..config.buses.len()).map(|bus| simulated_bus(config, bus)).collect();
    let mut bring_up = BringUp::of(config, axes);
    let mut batch = ReceiveBatch::new();
    let mut now_ns = STEP_NS;
    while now_ns < AT_MOST_NS {
        if let Some(outcome) = bring_up.outcome() {
            return outcome.err().map(|error| error.failures).unwrap_or_default();
        }
        bring_up.poll(now_ns, &mut |bus, frame| {
            if let Some(bus) = buses.get_mut(bus) {
                bus.send(now_ns, &[frame]);
            }
        });
        now_ns += STEP_NS;
        for (index, bus) in buses.iter_mut().enumerate() {
            batch.clear();
            bus.receive(now_ns, &mut batch);
            for received in batch.iter() {
                bring_up.receive(index, &received.frame);
            }
        }
    }
    vec![]
}
