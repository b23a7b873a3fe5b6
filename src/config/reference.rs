//! `configs/reference.toml`: every key of a configuration with its default, written from the rows of `keys`.

use std::fmt::Write;

use takt_rt::Rule;
use takt_wire::bit_fields::Setting;

use super::axis_ranges::AxisRanges;
use super::bounds::Bounds;
use super::key::{Key, Literal, Shown, Table, Values};
use super::keys::{self, TABLES};

/// Head of the file, before the ranges.
const HEAD: &str = r##"# Every key that a configuration can have. A line that ends in "# default" states what holds without it, so that it
# may be left out.
#
# Quantities are bare numbers in SI units (rad, m, s, N·m, N, kg, bit/s) or texts with a unit:
#   times        "1 ms"  "500 us"  "2 s"
#   rotary       "170 deg"  "0.5 turn"  "137 deg/s"  "20 rpm"  "8 rad/s^2"  "87 Nm"  "2.5 kg m^2"
#   linear       "0.5 m"  "250 mm/s"  "2 m/s^2"  "400 N"  "12 kg"
#   others       "1 Mbit/s"  "80 %"  "30 1/s"
# A linear axis takes lengths where a rotary one takes angles, forces where it takes torques, and so on.
#
# Values far beyond what machines have are refused, since they come from a wrong unit or a wrong power of ten:
#                              rotary axis                       linear axis
"##;

/// End of the head, behind the ranges.
const TAIL: &str = r#"# A range of positions is a count of the drive at least. A stop from the highest speed takes 10 s at most: this is what a low
# deceleration or jerk is measured by. The loops of "csv" and "cst" must be stable at the period of their bus, with a damping
# ratio of 0.3 at least.

"#;

/// A row of the ranges: its words, the range of an axis, and its units.
type RangeRow = (&'static str, fn(&AxisRanges) -> Bounds, [&'static str; 2]);

const RANGES: [RangeRow; 10] = [
    ("velocity", |ranges| ranges.velocity, ["rad/s", "m/s"]),
    ("acceleration, deceleration", |ranges| ranges.acceleration, ["rad/s^2", "m/s^2"]),
    ("jerk", |ranges| ranges.jerk, ["rad/s^3", "m/s^3"]),
    ("torque, force", |ranges| ranges.effort, ["Nm", "N"]),
    ("tolerances", |ranges| ranges.deviation, ["rad", "m"]),
    ("inertia, mass", |ranges| ranges.inertia, ["kg m^2", "kg"]),
    ("viscous_friction", |ranges| ranges.viscous_friction, ["Nm s/rad", "N s/m"]),
    ("coulomb_friction, gravity", |ranges| ranges.friction, ["Nm", "N"]),
    ("stiffness", |ranges| ranges.stiffness, ["Nm/rad", "N/m"]),
    ("damping", |ranges| ranges.damping, ["Nm s/rad", "N s/m"]),
];

/// Returns the text of `configs/reference.toml`: every key of a configuration with its default.
pub fn reference() -> String {
    let mut text = HEAD.to_owned();
    for (words, range, [rotary, linear]) in RANGES {
        let cells = [(AxisRanges::ROTARY, rotary), (AxisRanges::LINEAR, linear)]
            .map(|(ranges, unit)| show(range(&ranges), unit));
        let _ = writeln!(text, "#   {words:26} {:33} {}", cells[0], cells[1]);
    }
    for (key, unit) in [
        (&keys::program_move::VELOCITY, "of the limits, in a move; so the acceleration"),
        (&keys::axis::COUNTS_PER_TURN, ""),
        (&keys::axis::GEAR_RATIO, ""),
        (&keys::axis::LEAD, "m"),
        (&keys::torque_loop::BANDWIDTH, "1/s"),
        (&keys::velocity_loop::POSITION_GAIN, "1/s"),
    ] {
        let _ = writeln!(text, "#   {:26} {}", key.name, show(key.bounds(), unit));
    }
    text += TAIL;
    for (index, table) in TABLES.iter().enumerate() {
        write_table(table, index > 0, &mut text);
        match table.header {
            header if header == keys::stream::TABLE.header => write_stops(&mut text),
            header if header == keys::family::TABLE.header => {
                settings().iter().for_each(|key| key.write_to(&mut text));
            }
            _ => {}
        }
    }
    text
}

fn write_table(table: &Table, has_header: bool, text: &mut String) {
    if has_header {
        write_header(table.header, table.sentence, text);
    }
    table.keys.iter().for_each(|key| key.write_to(text));
}

fn write_header(header: &str, sentence: &str, text: &mut String) {
    match sentence {
        "" => _ = writeln!(text, "\n{header}"),
        sentence => _ = writeln!(text, "\n{header:41} # {sentence}"),
    }
}

/// `[stops]`, whose keys are the rules of `takt_rt`.
fn write_stops(text: &mut String) {
    write_header(
        "[stops]",
        "categories of IEC 60204-1: 2 = decelerate and hold, 1 = decelerate and disable, 0 = disable at once",
        text,
    );
    stops().iter().for_each(|key| key.write_to(text));
}

/// Returns the keys for numbers from the data sheet of a drive of bit fields.
pub fn settings() -> Vec<Key> {
    let key = |(name, setting): (&'static str, Setting)| {
        let (sentence, example) =
            setting.says().split_once(&format!(": {name} = ")).unwrap_or((setting.says(), "1.0"));
        Key { name, values: Values::AnyNumber, word: None, shown: Shown::Comment(example), sentence }
    };
    Setting::ALL.into_iter().map(key).collect()
}

/// Returns the keys of `[stops]`.
pub fn stops() -> Vec<Key> {
    let rules = Rule::ALL.into_iter().filter(|rule| *rule != Rule::Requested);
    let key = |rule: Rule| Key {
        name: rule.key(),
        values: Values::Category,
        word: None,
        shown: Shown::Default(Literal::Integer(rule.default_category() as i64)),
        sentence: rule.sentence(),
    };
    rules.map(key).collect()
}

/// Returns a number in the shorter of its two forms.
fn shortest(number: f64) -> String {
    let (plain, exponential) = (number.to_string(), format!("{number:e}"));
    if plain.len() <= exponential.len() { plain } else { exponential }
}

fn show(bounds: Bounds, unit: &str) -> String {
    let range = |low, high| format!("{} to {} {unit}", shortest(low), shortest(high)).trim_end().to_owned();
    match bounds {
        Bounds::Between(low, high) | Bounds::Plausible { low, high, .. } => range(low, high),
        Bounds::PlausibleOrInfinite { low, high, .. } => format!("{}, or inf", range(low, high)),
        Bounds::PlausibleOrZero { low, high, .. } => format!("0, or {}", range(low, high)),
        Bounds::Share | Bounds::Finite => String::new(),
    }
}
