//! A case: everything that its seed decides.

use takt::Interrupt;
use takt::config::{Axis, Config, Control, Follow, Group, ProgramMove, ProgramTarget};
use takt::faults::Scenario;

use crate::dice::Dice;
use crate::machine;
use crate::overload::Overload;
use crate::weather::{KINDS, NEEDS_EROB, disobedience, fault, fault_of_own_protocol, fault_on_a_line, when};

pub struct Case {
    pub config: Config,
    /// The scenario as a user would write it.
    pub text: String,
    pub scenario: Scenario,
    /// True if clients command the group, and a stop is theirs to deal with; otherwise a program does, and a stop ends it.
    pub is_serving: bool,
    /// So many ask for moves and stops, beside the program if there is one.
    pub clients: usize,
    /// How long it rages after the axes are enabled, in cycles.
    pub length: u64,
    /// How it is ended then.
    pub interrupt: Interrupt,
    /// The cycle in which it is interrupted all the same, enabled or not.
    pub broken_off: Option<u64>,
    pub hardship: Hardship,
    pub overload: Overload,
    /// True if streams command velocities, torques and impedances, too.
    pub has_every_kind_of_point: bool,
    /// True if callbacks lead the groups, too.
    pub has_callbacks: bool,
    /// True if somebody changes modes of operation, too.
    pub has_mode_changes: bool,
    /// True if somebody has checked trajectories carried out.
    pub has_trajectories: bool,
    pub dice: Dice,
}

/// What makes a storm harder than its faults do.
#[derive(Clone, Debug, Default)]
pub struct Hardship {
    /// Cycles of the run, from power-up on, after which the next wake-up is so many nanoseconds too late.
    pub stalls: Vec<(u64, u64)>,
    /// Cycles from one look of the life cycle to the next; 0 as 1.
    pub neglect: u64,
    /// True if clients go on asking for things to the last cycle, though the run is on its way out.
    pub are_clients_stubborn: bool,
    /// True if streams are led near their limits and beyond, and say what they like of their velocity.
    pub are_streams_wild: bool,
}

pub fn scenario(text: &str, config: &Config) -> Scenario {
    if text.is_empty() {
        return Scenario::default();
    }
    Scenario::parse("storm", text, config).unwrap_or_else(|error| {
        let problems: Vec<String> = error.problems().iter().map(ToString::to_string).collect();
        panic!("{}: {text}: {problems:?}", config.name)
    })
}

impl Case {
    pub fn of(seed: u64) -> Self {
        let mut case = Self::in_overload(seed);
        let mut dice = Dice::new(seed).split(u64::MAX - 4);
        if case.config.axes.len() > 1 && dice.chance(0.3) {
            case.divide(&mut dice);
        }
        case.has_trajectories = dice.chance(0.3);
        case.has_callbacks = dice.chance(0.15);
        case.has_every_kind_of_point = dice.chance(0.2);
        case
    }

    /// One whose axes are one group, which nothing but moves and streams leads.
    pub fn in_overload(seed: u64) -> Self {
        let mut case = Self::in_hardship(seed);
        let mut dice = Dice::new(seed).split(u64::MAX - 1);
        if dice.chance(0.25) {
            case.overload = Overload::of(&mut dice, &case.config, case.length);
            if dice.chance(0.6) {
                (case.text, case.scenario) = (String::new(), Scenario::default());
            }
        }
        case
    }

    /// One on a machine that has time enough, whatever else makes it hard.
    pub fn in_hardship(seed: u64) -> Self {
        let mut hard = Dice::new(seed).split(u64::MAX);
        let crowd = hard.chance(0.003).then(machine::crowd);
        let mut case = Self::with(seed, crowd);
        if hard.chance(0.5) {
            case.harden(&mut hard);
        }
        case
    }

    /// One in which everything is as well as its faults let it be.
    pub fn plain(seed: u64) -> Self {
        Self::with(seed, None)
    }

    /// One on a machine whose drives are spoken to by bit fields.
    pub fn of_bit_fields(seed: u64) -> Self {
        let mut dice = Dice::new(seed).split(u64::MAX - 6);
        let mut case = Self::with(seed, Some(machine::of_bit_fields(&mut dice)));
        if dice.chance(0.5) {
            case.harden(&mut dice);
        }
        case
    }

    /// The same on a machine that has too little time.
    pub fn of_bit_fields_in_overload(seed: u64) -> Self {
        let mut case = Self::of_bit_fields(seed);
        let mut dice = Dice::new(seed).split(u64::MAX - 7);
        case.overload = Overload::of(&mut dice, &case.config, case.length);
        if dice.chance(0.6) {
            (case.text, case.scenario) = (String::new(), Scenario::default());
        }
        case
    }

    /// One on a machine with drives that are spoken to outside of the cycle.
    pub fn of_off_cycle(seed: u64) -> Self {
        let mut dice = Dice::new(seed).split(u64::MAX - 8);
        let mut case = Self::with(seed, Some(machine::of_off_cycle(&mut dice)));
        let length_ms = (case.length * case.config.cycle.period_ns / 1_000_000) as usize;
        for _ in 0..dice.pick(&[0, 1, 1, 2, 3]) {
            let when = when(&mut dice, length_ms);
            case.text.push_str(&fault_of_own_protocol(&mut dice, &case.config, &when));
        }
        case.scenario = scenario(&case.text, &case.config);
        if dice.chance(0.5) {
            case.harden(&mut dice);
        }
        case
    }

    /// One on a machine with drives that do not obey.
    pub fn of_disobedience(seed: u64) -> Self {
        let mut dice = Dice::new(seed).split(u64::MAX - 10);
        let mut case = Self::with(seed, Some(machine::any(&mut dice, true)));
        if dice.chance(0.5) {
            // Nothing else is wrong.
            case.text.clear();
        }
        let length_ms = (case.length * case.config.cycle.period_ns / 1_000_000) as usize;
        for _ in 0..dice.pick(&[1, 1, 2, 3]) {
            let when = when(&mut dice, length_ms);
            case.text.push_str(&disobedience(&mut dice, &case.config, &when));
        }
        case.scenario = scenario(&case.text, &case.config);
        if case.config.axes.len() > 1 && dice.chance(0.5) {
            case.divide(&mut dice);
        }
        if dice.chance(0.3) {
            case.harden(&mut dice);
        }
        case
    }

    /// One on a machine with a drive on a serial line.
    pub fn on_a_line(seed: u64) -> Self {
        let mut dice = Dice::new(seed).split(u64::MAX - 9);
        let mut case = Self::with(seed, Some(machine::on_a_line()));
        let length_ms = (case.length * case.config.cycle.period_ns / 1_000_000) as usize;
        for _ in 0..dice.pick(&[0, 1, 1, 2, 3]) {
            let when = when(&mut dice, length_ms);
            case.text.push_str(&fault_on_a_line(&mut dice, &case.config, &when));
        }
        case.scenario = scenario(&case.text, &case.config);
        if dice.chance(0.5) {
            case.harden(&mut dice);
        }
        case
    }

    fn with(seed: u64, crowd: Option<Config>) -> Self {
        let mut dice = Dice::new(seed);
        // Every kind has its turn; some storms are calm, and in most there is more than one fault.
        let first = KINDS[(seed % KINDS.len() as u64) as usize];
        let faults = dice.pick(&[0, 1, 1, 1, 2, 2, 3, 4, 6]);
        let mut config = machine::any(&mut dice, faults > 0 && NEEDS_EROB.contains(&first));
        config = crowd.unwrap_or(config);
        if dice.chance(0.2) {
            config.axes.iter_mut().for_each(|axis| axis.follow = Follow::Exact);
        }
        let is_serving = dice.chance(0.35);
        let clients = if is_serving || dice.chance(0.5) { dice.pick(&[1, 1, 2, 3]) } else { 0 };
        vary_program(&mut dice, &mut config, clients > 0);
        let length = 300 + dice.below(2200) as u64;
        let length_ms = (length * config.cycle.period_ns / 1_000_000) as usize;
        let are_at_once = dice.chance(0.2);
        let together = when(&mut dice, length_ms);
        let mut text = String::new();
        for number in 0..faults {
            let when = if are_at_once { together.clone() } else { when(&mut dice, length_ms) };
            text.push_str(&possible_fault(&mut dice, &config, (number == 0).then_some(first), &when));
        }
        let scenario = scenario(&text, &config);
        let interrupt = if dice.chance(0.15) { Interrupt::Immediate } else { Interrupt::Controlled };
        let broken_off = dice.chance(0.03).then(|| dice.below(1500) as u64);
        let hardship = Hardship::default();
        let overload = Overload::default();
        Self {
            config,
            text,
            scenario,
            is_serving,
            clients,
            length,
            interrupt,
            broken_off,
            hardship,
            overload,
            has_every_kind_of_point: false,
            has_callbacks: false,
            has_mode_changes: false,
            has_trajectories: false,
            dice,
        }
    }

    /// Divides the axes into groups, each with moves of its own; some of them stop with others.
    pub fn divide(&mut self, dice: &mut Dice) {
        let mut axes: Vec<usize> = (0..self.config.axes.len()).collect();
        for place in (1..axes.len()).rev() {
            axes.swap(place, dice.below(place + 1));
        }
        let count = if axes.len() > 2 { dice.pick(&[2, 2, 3]) } else { 2 };
        let (are_coupled, mut groups) = (dice.chance(0.4), vec![]);
        for (number, axis) in axes.drain(..count).enumerate() {
            let mut stops_with: Vec<usize> = (0..count).filter(|other| *other != number).collect();
            stops_with.retain(|_| are_coupled && dice.chance(0.5));
            groups.push(Group { name: format!("group{number}"), axes: vec![axis], stops_with });
        }
        for axis in axes {
            groups[dice.below(count)].axes.push(axis);
        }
        self.config.groups = groups;
        vary_program(dice, &mut self.config, self.clients > 0);
    }

    /// Returns `true` if torques and impedances are commanded.
    pub const fn are_torques_commanded(&self) -> bool {
        self.has_callbacks || self.has_every_kind_of_point
    }

    fn harden(&mut self, dice: &mut Dice) {
        let period_ns = self.config.cycle.period_ns as f64;
        let hardship = &mut self.hardship;
        for _ in 0..dice.pick(&[0, 0, 0, 1, 1, 2, 4]) {
            let cycle = dice.below(self.length as usize + 1500) as u64;
            let cycles = if dice.chance(0.1) { dice.between(12.0, 120.0) } else { dice.between(0.05, 12.0) };
            hardship.stalls.push((cycle, (cycles * period_ns) as u64));
        }
        hardship.neglect = dice.pick(&[1, 1, 1, 2, 5, 30]);
        hardship.are_clients_stubborn = dice.chance(0.3);
        hardship.are_streams_wild = dice.chance(0.5);
        let mut more = String::new();
        if dice.chance(0.3) {
            // In the very cycle of a change, or of another fault, or in the one after it.
            let cue = dice.pick(&["enabled", "moving", "moving", "stopping", "stopping"]);
            let when = format!("when = \"{cue}\"\nat = \"{} ms\"", dice.pick(&[0, 0, 1, 2]));
            for _ in 0..dice.pick(&[1, 1, 2]) {
                more.push_str(&possible_fault(dice, &self.config, None, &when));
            }
        }
        if self.config.axes.iter().any(|axis| axis.control == Control::ProfileTorque) && dice.chance(0.4) {
            let when = when(dice, 1500);
            more.push_str(&possible_fault(dice, &self.config, Some("load"), &when));
        }
        if !more.is_empty() {
            self.text.push_str(&more);
            self.scenario = scenario(&self.text, &self.config);
        }
    }
}

/// Random moves of each group; beside a client the program holds still where the axes are.
fn vary_program(dice: &mut Dice, config: &mut Config, has_client: bool) {
    config.program.repeat = 1;
    config.program.moves.clear();
    for group in 0..config.groups.len().max(1) {
        let axes: Vec<&Axis> = config.axes_of_group(group).iter().map(|axis| &config.axes[*axis]).collect();
        let moves = match has_client {
            true => {
                let here = axes.iter().map(|axis| axis.simulated.initial_position).collect();
                vec![ProgramMove {
                    dwell_s: 3600.0,
                    ..random_move(dice, group, ProgramTarget::Position(here))
                }]
            }
            false => {
                let count = 1 + dice.below(4);
                let targets: Vec<ProgramTarget> = (0..count).map(|_| random_target(dice, &axes)).collect();
                targets.into_iter().map(|target| random_move(dice, group, target)).collect()
            }
        };
        config.program.moves.extend(moves);
    }
}

fn random_move(dice: &mut Dice, group: usize, target: ProgramTarget) -> ProgramMove {
    ProgramMove {
        group,
        target,
        velocity_scale: dice.between(0.2, 1.0),
        acceleration_scale: dice.between(0.2, 1.0),
        minimum_duration_s: if dice.chance(0.2) { dice.between(0.0, 2.0) } else { 0.0 },
        dwell_s: dice.between(0.0, 0.3),
    }
}

fn random_target(dice: &mut Dice, axes: &[&Axis]) -> ProgramTarget {
    let are_driven = |control: Control| axes.iter().any(|axis| axis.control == control);
    let duration_s = dice.between(0.1, 1.0);
    if are_driven(Control::ProfileVelocity) && dice.chance(0.6) {
        let speed = |axis: &Axis, dice: &mut Dice| match axis.control {
            Control::ProfileVelocity => dice.between(-1.0, 1.0) * axis.limits.velocity,
            _ => 0.0,
        };
        return ProgramTarget::Velocity {
            velocity: axes.iter().map(|axis| speed(axis, dice)).collect(),
            duration_s,
        };
    }
    if are_driven(Control::ProfileTorque) && dice.chance(0.6) {
        let torque = |axis: &Axis, dice: &mut Dice| match axis.control {
            Control::ProfileTorque => dice.between(-0.1, 0.1) * axis.limits.torque,
            _ => 0.0,
        };
        return ProgramTarget::Torque {
            torque: axes.iter().map(|axis| torque(axis, dice)).collect(),
            duration_s,
        };
    }
    let to = axes.iter().map(|axis| dice.between(axis.limits.position_min, axis.limits.position_max));
    ProgramTarget::Position(to.collect())
}

/// A fault of this kind, or of any: not every simulated drive can be broken in every way.
fn possible_fault(dice: &mut Dice, config: &Config, kind: Option<&str>, when: &str) -> String {
    // No drive of some machines can have some faults.
    for attempt in 0..1000 {
        let kind = kind.filter(|_| attempt < 100).unwrap_or_else(|| dice.pick(&KINDS));
        let text = fault(dice, config, kind, when);
        if Scenario::parse("storm", &text, config).is_ok() {
            return text;
        }
    }
    panic!("no axis of {} can have {kind:?}", config.name)
}
