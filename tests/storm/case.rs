//! A case: everything that its seed decides.

use takt::config::{Config, Control, OnViolation, ProgramMove, ProgramTarget};
use takt::controller::Interrupt;
use takt::faults::Scenario;

use crate::dice::Dice;
use crate::machine;
use crate::weather::{KINDS, NEEDS_EROB, fault, when};

pub struct Case {
    pub config: Config,
    /// The scenario as a user would write it.
    pub text: String,
    pub scenario: Scenario,
    /// Whether clients command the group, and a stop is theirs to deal with; otherwise a program does, and a stop ends it.
    pub is_serving: bool,
    /// So many ask for moves and stops, beside the program if there is one.
    pub clients: usize,
    /// How long it rages after the axes are enabled, in cycles.
    pub length: u64,
    /// How it is ended then.
    pub interrupt: Interrupt,
    /// The cycle in which it is interrupted all the same, enabled or not.
    pub broken_off: Option<u64>,
    pub dice: Dice,
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
        let mut dice = Dice::new(seed);
        // Every kind has its turn; some storms are calm, and in most there is more than one fault.
        let first = KINDS[(seed % KINDS.len() as u64) as usize];
        let faults = dice.pick(&[0, 1, 1, 1, 2, 2, 3, 4, 6]);
        let mut config = machine::any(&mut dice, faults > 0 && NEEDS_EROB.contains(&first));
        if dice.chance(0.2) {
            config.axes.iter_mut().for_each(|axis| axis.on_violation = OnViolation::Clamp);
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
        Self { config, text, scenario, is_serving, clients, length, interrupt, broken_off, dice }
    }
}

/// Random moves; beside a client the program holds still where the axes are.
fn vary_program(dice: &mut Dice, config: &mut Config, has_client: bool) {
    let here = config.axes.iter().map(|axis| axis.simulated.initial_position).collect();
    config.program.repeat = 1;
    config.program.moves = match has_client {
        true => vec![ProgramMove { dwell_s: 3600.0, ..random_move(dice, ProgramTarget::Position(here)) }],
        false => {
            let count = 1 + dice.below(4);
            let target = |dice: &mut Dice| random_target(dice, config);
            (0..count)
                .map(|_| target(dice))
                .collect::<Vec<_>>()
                .into_iter()
                .map(|to| random_move(dice, to))
                .collect()
        }
    };
}

fn random_move(dice: &mut Dice, target: ProgramTarget) -> ProgramMove {
    ProgramMove {
        target,
        velocity_scale: dice.between(0.2, 1.0),
        acceleration_scale: dice.between(0.2, 1.0),
        minimum_duration_s: if dice.chance(0.2) { dice.between(0.0, 2.0) } else { 0.0 },
        dwell_s: dice.between(0.0, 0.3),
    }
}

fn random_target(dice: &mut Dice, config: &Config) -> ProgramTarget {
    let axes = &config.axes;
    let are_driven = |control: Control| axes.iter().any(|axis| axis.control == control);
    let duration_s = dice.between(0.1, 1.0);
    if are_driven(Control::ProfileVelocity) && dice.chance(0.6) {
        let speed = |axis: &takt::config::Axis, dice: &mut Dice| match axis.control {
            Control::ProfileVelocity => dice.between(-1.0, 1.0) * axis.limits.velocity,
            _ => 0.0,
        };
        return ProgramTarget::Velocity {
            velocity: axes.iter().map(|axis| speed(axis, dice)).collect(),
            duration_s,
        };
    }
    if are_driven(Control::ProfileTorque) && dice.chance(0.6) {
        let torque = |axis: &takt::config::Axis, dice: &mut Dice| match axis.control {
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
    for _ in 0..1000 {
        let kind = kind.unwrap_or_else(|| dice.pick(&KINDS));
        let text = fault(dice, config, kind, when);
        if Scenario::parse("storm", &text, config).is_ok() {
            return text;
        }
    }
    panic!("no axis of {} can have {kind:?}", config.name)
}
