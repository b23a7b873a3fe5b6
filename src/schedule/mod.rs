//! Whether the buses can carry what a configuration asks of them, in the worst case, before anything moves.
//!
//! Two questions are answered for each bus. How long can any message take, with everything else queued at the worst
//! moment (`response_time`)? And does the slot hold: all feedback there before the command phase, all set-points
//! sent before the next SYNC (`slot`)? The second decides about process data, since their moments in the slot are
//! known; the first about all else.
//!
//! Emergency messages are not part of the sums. A drive that sends one has stopped obeying or is about to, the group
//! stops, and one such frame does no harm: feedback that misses the command phase is one missed cycle of the several
//! that `missed_feedback_cycles` allows, and set-points that are pushed beyond the slot are sent before the SYNC that
//! then leaves late. To demand room for an emergency in every slot would cost every third drive its place on a bus at
//! 1 ms. What one does to a slot is shown beside the regular case ([`EmergencyEffect`]).
//!
//! The sums are those of a punctual controller, and what they leave is shown as its reserve; a fit with less than
//! [`WAKE_UP_RESERVE_NS`] (and [`COMPUTE_RESERVE_NS`] before the set-points) is called narrow, not refused, since what
//! is enough depends on the machine: `takt jitter` measures it.

mod analysis;
mod bound;
mod bus_schedule;
mod command_phase;
mod loading;
mod messages;
mod remedy;
#[doc(hidden)]
pub mod response_time;
mod send_phase;
mod slot;
#[doc(hidden)]
pub mod text;

use thiserror::Error;

use crate::config::Config;
use analysis::analyse_bus;

pub use bus_schedule::{
    BusSchedule, COMPUTE_RESERVE_NS, EmergencyEffect, MessageSchedule, Remedy, Shortfall, WAKE_UP_RESERVE_NS,
};
pub use messages::MessageKind;
pub use send_phase::send_phase_ns;
pub use slot::Slot;

/// Buses that cannot carry what a configuration asks of them. `Display` gives the sums and what would fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", text::refusal(.buses))]
pub struct ScheduleError {
    /// All buses of the configuration, those that fit too.
    pub buses: Vec<BusSchedule>,
}

/// Analyses every bus, in the order of the configuration.
pub fn analyse(config: &Config) -> Vec<BusSchedule> {
    (0..config.buses.len())
        .map(|index| {
            let mut schedule = analyse_bus(config, index);
            if !schedule.fits() {
                schedule.remedies = remedy::remedies(config, index);
            }
            schedule
        })
        .collect()
}

/// Analyses every bus and refuses a configuration with one that does not fit.
pub fn verify(config: &Config) -> Result<Vec<BusSchedule>, ScheduleError> {
    let buses = analyse(config);
    if buses.iter().all(BusSchedule::fits) { Ok(buses) } else { Err(ScheduleError { buses }) }
}

/// There is no command phase at which feedback and set-points of all buses are in time. `Display` gives the sums of
/// the buses that are the cause, and what would fit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", text::no_command_phase(.0))]
pub struct NoCommandPhase(
    /// The cause: each bus that has no command phase; where each has one, the one whose feedback is the last to
    /// arrive and the one whose set-points must leave first.
    pub Vec<BusSchedule>,
);

/// The command phase that `"auto"` stands for, in ns after the start of the slot, whatever the configuration says now.
///
/// # Errors
/// None is possible.
pub fn automatic_command_phase(config: &Config) -> Result<u64, NoCommandPhase> {
    let buses: Vec<_> = (0..config.buses.len()).map(|index| analyse_bus(config, index)).collect();
    let without: Vec<_> =
        (0..).zip(&buses).filter(|(_, schedule)| schedule.slot.command_phases_ns.is_none()).collect();
    if !without.is_empty() {
        let with_remedies = without.into_iter().map(|(index, schedule)| BusSchedule {
            remedies: remedy::remedies_at_any_phase(config, index),
            ..schedule.clone()
        });
        return Err(NoCommandPhase(with_remedies.collect()));
    }
    let phases = || buses.iter().filter_map(|schedule| Some((schedule, schedule.slot.command_phases_ns?)));
    let last = phases().max_by_key(|(_, (earliest, _))| *earliest);
    let first = phases().min_by_key(|(_, (_, latest))| *latest);
    let (Some((last, (earliest_ns, _))), Some((first, (_, latest_ns)))) = (last, first) else {
        // Without buses nothing has to be waited for.
        return Ok(config.cycle.command_phase_ns);
    };
    match command_phase::divide(config.cycle.period_ns, earliest_ns, latest_ns) {
        Some(command_phase_ns) => Ok(command_phase_ns),
        None => Err(NoCommandPhase(vec![last.clone(), first.clone()])),
    }
}
