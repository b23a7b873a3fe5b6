//! `takt check`: everything that can be known before motion.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use takt::bus::schedule::text::{message_name, microseconds, remedy, shortfall, sums};
use takt::bus::schedule::{self, BusSchedule, MessageSchedule};
use takt::config::{Axis, Bus, Config, ConfigError, Control, Travel};

use super::exit::Exit;
use super::table::Table;

/// Check a configuration: limits, units, bus load, and the worst-case response time of every message
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The configuration
    config: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

/// Checks a configuration and tells the result. The exit code is 0 when it can be run, else 2.
pub fn run(arguments: &Arguments) -> Exit {
    let config = match Config::load(&arguments.config) {
        Ok(config) => config,
        Err(error) => return refuse(error, arguments.json),
    };
    let check = Check::of(&config);
    if arguments.json {
        print_json(&check)
    } else {
        print(&check.to_text(&config))
    }
    if check.fits { Exit::Done } else { Exit::Usage }
}

fn refuse(error: ConfigError, is_json: bool) -> Exit {
    if is_json {
        print_json(&Refusal::of(&error));
    } else {
        // Nothing can be done about a closed standard error.
        let _ = writeln!(std::io::stderr(), "{:?}", miette::Report::new(error));
    }
    Exit::Usage
}

fn print(text: &str) {
    // A reader that has seen enough (`| head`) is no failure of the check.
    let _ = std::io::stdout().write_all(text.as_bytes());
}

fn print_json(value: &impl Serialize) {
    match serde_json::to_string_pretty(value) {
        Ok(text) => print(&format!("{text}\n")),
        Err(error) => print(&format!("{{\"error\": {:?}}}\n", error.to_string())),
    }
}

/// A configuration that could not be read, for `--json`.
#[derive(Serialize)]
struct Refusal {
    error: String,
    problems: Vec<RefusalProblem>,
}

#[derive(Serialize)]
struct RefusalProblem {
    line: Option<usize>,
    message: String,
    help: String,
}

impl Refusal {
    fn of(error: &ConfigError) -> Self {
        let problems = error
            .problems()
            .iter()
            .map(|problem| RefusalProblem {
                line: error.line(problem),
                message: problem.to_string(),
                help: problem.kind.help(),
            })
            .collect();
        Self { error: error.to_string(), problems }
    }
}

/// What was found out.
#[derive(Serialize)]
struct Check {
    name: String,
    fits: bool,
    cycle_ns: u64,
    command_phase_ns: u64,
    axes: Vec<AxisCheck>,
    buses: Vec<BusSchedule>,
}

/// Limits and units of an axis, in rad (m), seconds and N·m (N).
#[derive(Serialize)]
struct AxisCheck {
    name: String,
    bus: String,
    node: u8,
    mode: &'static str,
    is_linear: bool,
    position_min: f64,
    position_max: f64,
    velocity: f64,
    acceleration: f64,
    deceleration: f64,
    /// `None` when it is not limited.
    jerk: Option<f64>,
    torque: f64,
    following_error: f64,
    following_error_time_ns: u64,
    counts_per_unit: f64,
    /// What one count is.
    resolution: f64,
    /// How far the axis goes in one cycle at its highest speed.
    counts_per_cycle: f64,
    /// The lowest and the highest count within the limits.
    counts_range: [f64; 2],
}

impl Check {
    fn of(config: &Config) -> Self {
        let buses = schedule::analyse(config);
        Self {
            name: config.name.clone(),
            fits: buses.iter().all(BusSchedule::fits),
            cycle_ns: config.cycle.period_ns,
            command_phase_ns: config.cycle.command_phase_ns,
            axes: config.axes.iter().map(|axis| AxisCheck::of(axis, config)).collect(),
            buses,
        }
    }

    fn to_text(&self, config: &Config) -> String {
        let mut text = format!(
            "{}: {} axes on {} buses, a cycle of {} µs with the command phase at {} µs\n\nLimits\n{}\nUnits\n{}",
            self.name,
            self.axes.len(),
            self.buses.len(),
            microseconds(self.cycle_ns),
            microseconds(self.command_phase_ns),
            limits_table(&self.axes),
            units_table(&self.axes),
        );
        for (schedule, bus) in self.buses.iter().zip(&config.buses) {
            text.push('\n');
            text.push_str(&bus_text(schedule, bus));
        }
        let verdict = if self.fits {
            "Every bus carries its traffic"
        } else {
            "REFUSED: not every bus carries its traffic"
        };
        let _ = writeln!(text, "\n{verdict} in the worst case.");
        text
    }
}

impl AxisCheck {
    fn of(axis: &Axis, config: &Config) -> Self {
        let travel_per_turn = match axis.travel {
            Travel::Rotary => TAU,
            Travel::Linear { lead_m } => lead_m,
        };
        let counts_per_unit = axis.counts_per_turn * axis.gear_ratio / travel_per_turn;
        let direction = if axis.reversed { -1.0 } else { 1.0 };
        let counts =
            |position: f64| (direction * position * counts_per_unit + f64::from(axis.zero_counts)).round();
        let (first, second) = (counts(axis.limits.position_min), counts(axis.limits.position_max));
        let mode = match axis.control {
            Control::Position => "csp",
            Control::Velocity { .. } => "csv",
            Control::Torque { .. } => "cst",
        };
        Self {
            name: axis.name.clone(),
            bus: config.buses.get(axis.bus).map(|bus| bus.name.clone()).unwrap_or_default(),
            node: axis.node,
            mode,
            is_linear: axis.travel != Travel::Rotary,
            position_min: axis.limits.position_min,
            position_max: axis.limits.position_max,
            velocity: axis.limits.velocity,
            acceleration: axis.limits.acceleration,
            deceleration: axis.limits.deceleration,
            jerk: Some(axis.limits.jerk).filter(|jerk| jerk.is_finite()),
            torque: axis.limits.torque,
            following_error: axis.following_error.limit,
            following_error_time_ns: axis.following_error.time_ns,
            counts_per_unit,
            resolution: 1.0 / counts_per_unit,
            counts_per_cycle: axis.limits.velocity * counts_per_unit * config.cycle.period_ns as f64 / 1e9,
            counts_range: [first.min(second), first.max(second)],
        }
    }

    fn unit(&self) -> &'static str {
        if self.is_linear { "m" } else { "rad" }
    }
}

fn limits_table(axes: &[AxisCheck]) -> Table {
    let mut table = Table::new([
        "axis",
        "bus",
        ">node",
        "mode",
        "unit",
        ">lowest",
        ">highest",
        ">velocity",
        ">acceleration",
        ">deceleration",
        ">jerk",
        ">torque",
        "following error",
    ]);
    for axis in axes {
        table.row([
            axis.name.clone(),
            axis.bus.clone(),
            axis.node.to_string(),
            axis.mode.to_owned(),
            axis.unit().to_owned(),
            format!("{:.4}", axis.position_min),
            format!("{:.4}", axis.position_max),
            format!("{:.4}", axis.velocity),
            format!("{:.2}", axis.acceleration),
            format!("{:.2}", axis.deceleration),
            axis.jerk.map_or("none".to_owned(), |jerk| format!("{jerk:.1}")),
            format!("{:.1} {}", axis.torque, if axis.is_linear { "N" } else { "Nm" }),
            format!("{:.4} for {} ms", axis.following_error, axis.following_error_time_ns as f64 / 1e6),
        ]);
    }
    table
}

fn units_table(axes: &[AxisCheck]) -> Table {
    let mut table =
        Table::new(["axis", "counts per unit", "one count", "counts per cycle at full speed", "counts"]);
    for axis in axes {
        let [lowest, highest] = axis.counts_range;
        table.row([
            axis.name.clone(),
            format!("{:.3} per {}", axis.counts_per_unit, axis.unit()),
            format!("{:.3} µ{}", axis.resolution * 1e6, axis.unit()),
            format!("{:.1}", axis.counts_per_cycle),
            format!("{lowest} to {highest}"),
        ]);
    }
    table
}

fn bus_text(schedule: &BusSchedule, bus: &Bus) -> String {
    let mut text = format!(
        "Bus {} on {}, {} kbit/s, load {:.1} % (times in µs)\n{}",
        schedule.name,
        bus.interface,
        f64::from(schedule.bit_rate) / 1e3,
        schedule.load_percent,
        message_table(&schedule.messages),
    );
    for line in sums(schedule) {
        let _ = writeln!(text, "  {line}");
    }
    if let Some((earliest, latest)) = schedule.slot.command_phases_ns {
        let _ = writeln!(
            text,
            "  command phase may lie from {} to {} µs",
            microseconds(earliest),
            microseconds(latest)
        );
    }
    if schedule.fits() {
        text.push_str("  fits\n");
    }
    for line in schedule.shortfalls.iter().map(shortfall) {
        let _ = writeln!(text, "  DOES NOT FIT: {line}");
    }
    for line in schedule.remedies.iter().map(remedy) {
        let _ = writeln!(text, "  what would fit: {line}");
    }
    text
}

fn message_table(messages: &[MessageSchedule]) -> Table {
    let mut table = Table::new([
        "id",
        "message",
        "axis",
        ">bytes",
        ">bits",
        ">period",
        ">jitter",
        ">on the wire",
        ">response",
        ">with emergency",
        ">due",
    ]);
    for message in messages {
        let bound = |ns: Option<u64>| match ns {
            Some(ns) => microseconds(ns),
            None if message.is_sent_while_enabled => "no bound".to_owned(),
            None => "-".to_owned(),
        };
        table.row([
            format!("{:03X}", message.id),
            message_name(message.kind).to_owned(),
            message.axis.clone().unwrap_or_default(),
            message.length.to_string(),
            message.bits.to_string(),
            if message.is_sent_while_enabled {
                microseconds(message.period_ns)
            } else {
                "while disabled".to_owned()
            },
            microseconds(message.jitter_ns),
            microseconds(message.transmission_ns),
            bound(message.response_ns),
            bound(message.response_with_emergency_ns),
            message.deadline_ns.map_or("-".to_owned(), microseconds),
        ]);
    }
    table
}
