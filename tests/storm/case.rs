//! A case: everything that its seed decides.

use std::path::Path;

use takt::config::{Config, DriveFamily, Feedback, OnViolation, ProgramMove, ProgramTarget};
use takt::faults::Scenario;

use crate::dice::Dice;
use crate::weather::{KINDS, fault};

const CONFIGURATIONS: [&str; 15] = [
    "arm6-erob",
    "arm6-erob",
    "arm6-erob-csv",
    "arm6-erob-cst",
    "gantry-yz-aim",
    "gantry-yz-aim",
    "mixed-arm",
    "mixed-arm",
    "erob-modes/erob-csp",
    "erob-modes/erob-cst",
    "erob-modes/erob-csv",
    "erob-modes/erob-ip",
    "erob-modes/erob-pp",
    "erob-modes/erob-pt",
    "erob-modes/erob-pv",
];

pub struct Case {
    pub name: &'static str,
    pub config: Config,
    /// The scenario as a user would write it.
    pub text: String,
    pub scenario: Scenario,
    /// Whether somebody asks for moves and stops beside the program.
    pub has_client: bool,
    /// How long it rages after the axes are enabled, in cycles.
    pub length: u64,
    pub is_cut: bool,
    pub dice: Dice,
}

pub fn load(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/{name}.toml"));
    let mut config = Config::load(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
    for axis in &mut config.axes {
        axis.simulated.power_up_ns = 5_000_000;
        if axis.drive == DriveFamily::ErobCanopen {
            axis.feedback = vec![Feedback::OperationMode];
        }
    }
    config
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
        let name = dice.pick(&CONFIGURATIONS);
        let mut config = load(name);
        if dice.chance(0.3) {
            config.axes.iter_mut().for_each(|axis| axis.on_violation = OnViolation::Clamp);
        }
        let has_client = dice.chance(0.7);
        vary_program(&mut dice, &mut config, has_client);
        let mut text = String::new();
        for _ in 0..dice.below(4) {
            text.push_str(&possible_fault(&mut dice, &config));
        }
        let scenario = scenario(&text, &config);
        let length = 300 + dice.below(1700) as u64;
        let is_cut = dice.chance(0.15);
        Self { name, config, text, scenario, has_client, length, is_cut, dice }
    }
}

/// Random moves; beside a client the program holds still where the axes are.
fn vary_program(dice: &mut Dice, config: &mut Config, has_client: bool) {
    let is_positioned =
        config.program.moves.iter().all(|present| matches!(present.target, ProgramTarget::Position(_)));
    if !is_positioned && !has_client {
        return;
    }
    let random = |dice: &mut Dice, config: &Config| {
        let axes = config.axes.iter();
        let to = axes.map(|axis| dice.between(axis.limits.position_min, axis.limits.position_max)).collect();
        ProgramMove {
            target: ProgramTarget::Position(to),
            velocity_scale: dice.between(0.2, 1.0),
            acceleration_scale: dice.between(0.2, 1.0),
            minimum_duration_s: 0.0,
            dwell_s: dice.between(0.0, 0.3),
        }
    };
    let moves = if has_client {
        let here = config.axes.iter().map(|axis| axis.simulated.initial_position).collect();
        vec![ProgramMove { target: ProgramTarget::Position(here), dwell_s: 3600.0, ..random(dice, config) }]
    } else {
        (0..1 + dice.below(4)).map(|_| random(dice, config)).collect()
    };
    config.program.repeat = 1;
    config.program.moves = moves;
}

/// The simulated YZ-AIM cannot be broken in every way.
fn possible_fault(dice: &mut Dice, config: &Config) -> String {
    loop {
        let kind = dice.pick(&KINDS);
        let text = fault(dice, config, kind, None);
        if Scenario::parse("storm", &text, config).is_ok() {
            return text;
        }
    }
}
