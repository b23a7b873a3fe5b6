//! Nothing is enabled, reset or moved that should not be.

use takt::config::{Axis, Config};
use takt_rt::{DriveState, Event, EventKind, Phase, Rule};

use super::{REST, Seen};
use crate::bounds;
use takt::sim::{NodeState, Observation};

/// Bit 7 of a controlword.
const FAULT_RESET: u16 = 0x80;
/// The level that switches a drive on: the same in both families.
const SWITCHED_ON: u8 = 2;
/// Cycles from a controlword on the wire to a drive that has taken it.
const OBEYING_CYCLES: u64 = 12;
/// Cycles in which torque in a disabled group must be noticed: some reports of a bus with a long cycle.
const NOTICING_CYCLES: u64 = 100;

/// 0 no voltage, 1 ready to switch on, 2 switched on, 3 operation enabled.
const fn level(controlword: u16) -> u8 {
    match controlword & 0xF {
        0xF => 3,
        0x7 => SWITCHED_ON,
        0x6 | 0xE => 1,
        _ => 0,
    }
}

#[derive(Clone, Copy, Default)]
struct Watched {
    level: u8,
    truth: Option<Observation>,
    /// Cycles for which it has had torque in a disabled group without a fault.
    unexplained: u64,
}

pub struct Power {
    axes: Vec<Watched>,
    groups: Vec<WatchedGroup>,
}

struct WatchedGroup {
    axes: Vec<Axis>,
    has_enabled: bool,
    since_enabling: u64,
    /// Cycles for which the group has been disabled.
    disabled: u64,
    /// True if a reset has been granted since the last fault came up. On a bus that is busy its controlwords wait.
    is_reset_awaited: bool,
}

impl WatchedGroup {
    fn new(config: &Config, group: usize) -> Self {
        Self {
            axes: config.axes_of_group(group).iter().map(|axis| config.axes[*axis].clone()).collect(),
            has_enabled: false,
            since_enabling: u64::MAX,
            disabled: 0,
            is_reset_awaited: false,
        }
    }

    fn observe(&mut self, seen: &Seen<'_>, group: usize) {
        let phase = seen.record.groups()[group].phase;
        // The life cycle's own reset comes before that, and may not be over when a client is quicker to ask for the rest.
        self.has_enabled |= !matches!(phase, Phase::Passive | Phase::Disabled | Phase::Enabling);
        let is_enabling = phase == Phase::Enabling;
        self.since_enabling = if is_enabling { 0 } else { self.since_enabling.saturating_add(1) };
        let is_fault =
            |event: &Event| matches!(event.kind, EventKind::Stop(reason) if reason.rule() != Rule::Requested);
        if seen.events_of(group).any(is_fault) {
            self.is_reset_awaited = false;
        } else if seen.asked[group].has_reset {
            self.is_reset_awaited = true;
        }
        let is_disabled = matches!(phase, Phase::Disabled | Phase::Passive);
        self.disabled = if is_disabled { self.disabled + 1 } else { 0 };
    }
}

impl Power {
    pub fn new(config: &Config) -> Self {
        let groups = 0..config.groups.len().max(1);
        Self {
            axes: vec![Watched::default(); config.axes.len()],
            groups: groups.map(|group| WatchedGroup::new(config, group)).collect(),
        }
    }

    pub fn check(&mut self, seen: &Seen<'_>) -> Result<(), String> {
        for (number, group) in self.groups.iter_mut().enumerate() {
            group.observe(seen, number);
        }
        for index in 0..self.axes.len() {
            let checked = self
                .check_controlword(seen, index)
                .and_then(|()| self.check_disabled(seen, index))
                .and_then(|()| self.check_confirmed(seen, index))
                .and_then(|()| self.check_powerless(seen, index));
            checked.map_err(|wrong| format!("{}: {wrong}", seen.config.axes[index].name))?;
            self.axes[index].truth = Some(seen.truth[index]);
        }
        Ok(())
    }

    /// A drive is enabled only while the group is being enabled, and reset only when that was asked for.
    fn check_controlword(&mut self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let Some(word) = seen.sent[index].controlword else { return Ok(()) };
        let (group, phase, new) = (&self.groups[seen.groups[index]], seen.phase_of(index), level(word));
        let last = std::mem::replace(&mut self.axes[index].level, new);
        // The last of them may follow the phase: it ends as soon as the drives show that they are enabled.
        if new >= SWITCHED_ON && new > last && group.since_enabling > OBEYING_CYCLES {
            return Err(format!("enabled by controlword {word:#06x} in phase {phase:?}"));
        }
        if new >= SWITCHED_ON && matches!(phase, Phase::Disabled | Phase::Passive) {
            return Err(format!("controlword {word:#06x} in a disabled group"));
        }
        let is_reset = word & FAULT_RESET != 0;
        let is_asked_for = group.is_reset_awaited || seen.asked[seen.groups[index]].has_reset_lately;
        match is_reset && group.has_enabled && !is_asked_for {
            true => Err(format!("reset by controlword {word:#06x}, which was not asked for")),
            false => Ok(()),
        }
    }

    /// A disabled group has no enabled drive, and soon no joint that moves.
    fn check_disabled(&self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let (concern, truth) = (&seen.concerns[index], &seen.truth[index]);
        let group = &self.groups[seen.groups[index]];
        if concern.is_present || group.disabled <= OBEYING_CYCLES {
            return Ok(());
        }
        if truth.state == DriveState::OperationEnabled {
            return Err(format!("enabled, {} cycles after the group was disabled", group.disabled));
        }
        let to_rest_s = bounds::to_rest_s(&group.axes) + bounds::coasting_s(&seen.config.axes[index]);
        let is_late = group.disabled > bounds::cycles(seen.config, to_rest_s);
        match is_late && truth.velocity.abs() > REST {
            true => Err(format!("{} in a disabled group", truth.velocity)),
            false => Ok(()),
        }
    }

    /// A disabled group has no drive with torque, or a latched fault says so.
    fn check_confirmed(&mut self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let (concern, group) = (&seen.concerns[index], seen.group_of(index));
        // Outside of NMT operational it sends no PDOs, and on a bus that is too slow they are late in every cycle.
        let is_reporting = seen.truth[index].nmt == NodeState::Operational
            && !seen.overloaded_buses[seen.config.axes[index].bus];
        let is_heard = is_reporting
            && !(concern.is_misreported
                || concern.is_crowded
                || concern.has_paused
                || concern.is_neglected
                || concern.unreachable_since_ns.is_some());
        let is_explained = group.stop.is_some_and(|stop| stop.rule() != Rule::Requested);
        let has_torque = seen.truth[index].state == DriveState::OperationEnabled;
        let is_unexplained = is_heard && has_torque && group.phase == Phase::Disabled && !is_explained;
        let unexplained = &mut self.axes[index].unexplained;
        *unexplained = if is_unexplained { *unexplained + 1 } else { 0 };
        match *unexplained > NOTICING_CYCLES {
            true => Err(format!("torque in a disabled group without a fault: {:?}", seen.truth[index])),
            false => Ok(()),
        }
    }

    /// A joint without torque at either look does not speed up, and one that is braked and stands stays.
    fn check_powerless(&self, seen: &Seen<'_>, index: usize) -> Result<(), String> {
        let now = &seen.truth[index];
        let Some(before) = self.axes[index].truth else { return Ok(()) };
        if seen.concerns[index].is_driven_by_others {
            return Ok(());
        }
        let was_powerless = !before.state.has_torque() && !now.state.has_torque();
        // What a drive had when its state was taken from it acts until its next step.
        let had_torque = before.torque != 0.0 || now.torque != 0.0;
        // A corrupted command enables a drive for less than a cycle where the next one disables it.
        let may_have_had_torque = had_torque || seen.concerns[index].is_misled;
        if was_powerless && !may_have_had_torque && now.velocity.abs() > before.velocity.abs() + 1e-9 {
            return Err(format!("without torque from {before:?} to {now:?}"));
        }
        let stood = was_powerless && before.is_braked && now.is_braked && before.velocity == 0.0;
        match stood && now.position != before.position {
            true => Err(format!("braked, but moves from {before:?} to {now:?}")),
            false => Ok(()),
        }
    }
}
