//! What the storms have gone through: which faults, when, and what became of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use takt_rt::Phase;

use crate::case::Case;
use crate::run::Done;
use crate::weather::KINDS;

/// How often a kind of fault came in each situation, and what it led to.
#[derive(Clone, Debug, Default)]
struct Situations {
    /// Before the axes were enabled for the first time.
    bringing_up: u64,
    /// While they were being enabled, held still, moved, and came to rest or were off.
    enabling: u64,
    holding: u64,
    moving: u64,
    ending: u64,
    reactions: BTreeMap<&'static str, u64>,
}

impl Situations {
    fn all(&self) -> u64 {
        self.bringing_up + self.enabling + self.holding + self.moving + self.ending
    }
}

#[derive(Clone, Debug, Default)]
pub struct Coverage {
    pub cycles: u64,
    pub cases: u64,
    situations: BTreeMap<&'static str, Situations>,
    /// Family, mode, and the period of the bus in µs.
    drives: BTreeMap<(&'static str, u8, u64), u64>,
    serving: u64,
    several_clients: u64,
    several_faults: u64,
    several_groups: u64,
    coupled_groups: u64,
    /// How often a callback, and a checked trajectory, has begun to lead a group.
    callbacks: u64,
    trajectories: u64,
}

impl Coverage {
    pub fn take(&mut self, case: &Case, done: &Done) {
        self.cycles += done.cycles;
        self.cases += 1;
        self.serving += u64::from(case.is_serving);
        self.several_clients += u64::from(case.clients > 1);
        self.several_faults += u64::from(done.outcomes.len() > 1);
        self.several_groups += u64::from(case.config.groups.len() > 1);
        let are_coupled = case.config.groups.iter().any(|group| !group.stops_with.is_empty());
        self.coupled_groups += u64::from(are_coupled);
        self.callbacks += done.callbacks;
        self.trajectories += done.trajectories;
        for axis in &case.config.axes {
            let period_us =
                case.config.cycle.period_ns * u64::from(case.config.buses[axis.bus].divider) / 1000;
            let mode = axis.control.operation_mode() as u8;
            *self.drives.entry((axis.drive.word, mode, period_us)).or_default() += 1;
        }
        for outcome in &done.outcomes {
            let situations = self.situations.entry(case.scenario.faults[outcome.fault].kind).or_default();
            let count = match outcome.phase {
                Phase::Enabling => &mut situations.enabling,
                _ if !outcome.is_brought_up => &mut situations.bringing_up,
                Phase::Holding => &mut situations.holding,
                Phase::Moving | Phase::Streaming => &mut situations.moving,
                Phase::Passive | Phase::Disabled | Phase::Stopping | Phase::Disabling => {
                    &mut situations.ending
                }
            };
            *count += 1;
            let reaction = match outcome.stop {
                Some(rule) => rule.key(),
                None if done.is_bring_up_failed && !outcome.is_brought_up => "no bring-up",
                None => "tolerated",
            };
            *situations.reactions.entry(reaction).or_default() += 1;
        }
    }

    pub fn add(&mut self, other: &Self) {
        self.cycles += other.cycles;
        self.cases += other.cases;
        self.serving += other.serving;
        self.several_clients += other.several_clients;
        self.several_faults += other.several_faults;
        self.several_groups += other.several_groups;
        self.coupled_groups += other.coupled_groups;
        self.callbacks += other.callbacks;
        self.trajectories += other.trajectories;
        for (kind, situations) in &other.situations {
            let sum = self.situations.entry(kind).or_default();
            sum.bringing_up += situations.bringing_up;
            sum.enabling += situations.enabling;
            sum.holding += situations.holding;
            sum.moving += situations.moving;
            sum.ending += situations.ending;
            situations
                .reactions
                .iter()
                .for_each(|(rule, count)| *sum.reactions.entry(rule).or_default() += count);
        }
        other.drives.iter().for_each(|(drive, count)| *self.drives.entry(*drive).or_default() += count);
    }

    /// What has not occurred and should have.
    pub fn gaps(&self) -> Vec<String> {
        let mut gaps = vec![];
        for kind in KINDS {
            let situations = self.situations.get(kind).cloned().unwrap_or_default();
            for (count, when) in [
                (situations.bringing_up, "before the axes are enabled"),
                (situations.holding + situations.moving, "with the axes enabled"),
                (situations.moving, "in motion"),
            ] {
                if count == 0 {
                    gaps.push(format!("{kind} {when}"));
                }
            }
        }
        let drives: BTreeSet<(&str, u8)> = self.drives.keys().map(|(word, mode, _)| (*word, *mode)).collect();
        let all = [("erob-canopen", &[1, 3, 4, 7, 8, 9, 10][..]), ("yz-aim", &[1, 3, 7][..])];
        for (family, modes) in all {
            let missing = modes.iter().filter(|mode| !drives.contains(&(family, **mode)));
            gaps.extend(missing.map(|mode| format!("{family} in mode {mode}")));
        }
        for (count, what) in [
            (self.serving, "a group that clients command"),
            (self.several_clients, "several clients"),
            (self.several_faults, "several faults"),
            (self.several_groups, "several groups"),
            (self.coupled_groups, "groups that stop with others"),
            (self.callbacks, "a callback that leads a group"),
            (self.trajectories, "a checked trajectory"),
            (
                self.situations.values().map(|situations| situations.enabling).sum(),
                "a fault while the axes are being enabled",
            ),
        ] {
            if count == 0 {
                gaps.push(what.to_owned());
            }
        }
        gaps
    }

    pub fn table(&self) -> String {
        let mut text = format!(
            "{} cycles, {} cases: {} with clients in charge, {} with several clients, {} with several faults, \
             {} with several groups ({} coupled); {} callbacks, {} trajectories\n\n\
             | Fault | Cases | Bring-up | Enabling | Holding | Moving | Ending | Reactions |\n\
             |---|---|---|---|---|---|---|---|\n",
            self.cycles,
            self.cases,
            self.serving,
            self.several_clients,
            self.several_faults,
            self.several_groups,
            self.coupled_groups,
            self.callbacks,
            self.trajectories,
        );
        for kind in KINDS {
            let situations = self.situations.get(kind).cloned().unwrap_or_default();
            let mut reactions: Vec<_> = situations.reactions.iter().collect();
            reactions.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
            let reactions: Vec<String> =
                reactions.iter().map(|(rule, count)| format!("{rule} {count}")).collect();
            let _ = writeln!(
                text,
                "| {kind} | {} | {} | {} | {} | {} | {} | {} |",
                situations.all(),
                situations.bringing_up,
                situations.enabling,
                situations.holding,
                situations.moving,
                situations.ending,
                reactions.join(", "),
            );
        }
        text.push_str("\n| Drive | Mode | Period of its bus | Axes |\n|---|---|---|---|\n");
        for ((family, mode, period_us), count) in &self.drives {
            let _ = writeln!(text, "| {family} | {mode} | {period_us} µs | {count} |");
        }
        text
    }
}
