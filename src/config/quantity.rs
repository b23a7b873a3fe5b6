//! Numbers with units, as they are written in a file: `"137 deg/s"`, `"500 us"`, `"87 Nm"`, `"2.5 kg m^2"`.
//!
//! A unit is a product of known symbols with small exponents. It is reduced to a factor and a [`Dimension`], and the
//! dimension is compared with the one that the key asks for, so a velocity can never be taken for a position.

use std::f64::consts::TAU;
use std::fmt;

/// Exponents of kilogram, metre, second, radian and bit. The radian counts as a base unit here: an angle that is
/// taken for a bare number is the very mistake to be caught.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension {
    mass: i8,
    length: i8,
    time: i8,
    angle: i8,
    information: i8,
}

impl Dimension {
    const NONE: Self = Self::new(0, 0, 0, 0, 0);

    const fn new(mass: i8, length: i8, time: i8, angle: i8, information: i8) -> Self {
        Self { mass, length, time, angle, information }
    }

    /// `self · other^exponent`; `None` when an exponent grows beyond all use.
    fn times(self, other: Self, exponent: i8) -> Option<Self> {
        let sum = |a: i8, b: i8| b.checked_mul(exponent).and_then(|b| a.checked_add(b));
        Some(Self {
            mass: sum(self.mass, other.mass)?,
            length: sum(self.length, other.length)?,
            time: sum(self.time, other.time)?,
            angle: sum(self.angle, other.angle)?,
            information: sum(self.information, other.information)?,
        })
    }
}

/// A physical quantity that a key of the configuration asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Name.
    pub name: &'static str,
    /// Its SI unit, in which bare numbers are taken; empty for a bare ratio.
    pub unit: &'static str,
    /// An example as it is written in a file.
    pub example: &'static str,
    dimension: Dimension,
}

macro_rules! quantities {
    ($($(#[$doc:meta])* $id:ident = $name:literal, $unit:literal, $example:literal, [$($exponent:literal)*];)*) => {
        impl Quantity {
            $($(#[$doc])* pub const $id: Self = Self {
                name: $name, unit: $unit, example: $example, dimension: Dimension::new($($exponent),*),
            };)*
        }
    };
}

quantities! {
    /// s
    DURATION = "duration", "s", "1 ms", [0 0 1 0 0];
    /// A bare ratio, or per cent.
    FRACTION = "fraction", "", "80 %", [0 0 0 0 0];
    /// bit/s
    BIT_RATE = "bit rate", "bit/s", "1 Mbit/s", [0 0 -1 0 1];
    /// 1/s
    GAIN = "gain", "1/s", "30 1/s", [0 0 -1 0 0];
    /// rad
    ANGLE = "angle", "rad", "170 deg", [0 0 0 1 0];
    /// rad/s
    ANGULAR_VELOCITY = "angular velocity", "rad/s", "137 deg/s", [0 0 -1 1 0];
    /// rad/s²
    ANGULAR_ACCELERATION = "angular acceleration", "rad/s^2", "8 rad/s^2", [0 0 -2 1 0];
    /// rad/s³
    ANGULAR_JERK = "angular jerk", "rad/s^3", "200 rad/s^3", [0 0 -3 1 0];
    /// N·m
    TORQUE = "torque", "Nm", "87 Nm", [1 2 -2 0 0];
    /// kg·m²
    MOMENT_OF_INERTIA = "moment of inertia", "kg m^2", "2.5 kg m^2", [1 2 0 0 0];
    /// N·m/rad
    ANGULAR_STIFFNESS = "angular stiffness", "Nm/rad", "400 Nm/rad", [1 2 -2 -1 0];
    /// N·m·s/rad
    ANGULAR_DAMPING = "angular damping", "Nm s/rad", "20 Nm s/rad", [1 2 -1 -1 0];
    /// m
    LENGTH = "length", "m", "0.5 m", [0 1 0 0 0];
    /// m/s
    VELOCITY = "velocity", "m/s", "250 mm/s", [0 1 -1 0 0];
    /// m/s²
    ACCELERATION = "acceleration", "m/s^2", "2 m/s^2", [0 1 -2 0 0];
    /// m/s³
    JERK = "jerk", "m/s^3", "50 m/s^3", [0 1 -3 0 0];
    /// N
    FORCE = "force", "N", "400 N", [1 1 -2 0 0];
    /// kg
    MASS = "mass", "kg", "12 kg", [1 0 0 0 0];
    /// N/m
    STIFFNESS = "stiffness", "N/m", "5000 N/m", [1 0 -2 0 0];
    /// N·s/m
    DAMPING = "damping", "N s/m", "300 N s/m", [1 0 -1 0 0];
}

/// The quantity and the factor of a unit symbol.
struct Unit {
    symbol: &'static str,
    factor: f64,
    dimension: Dimension,
}

const fn unit(symbol: &'static str, factor: f64, dimension: [i8; 5]) -> Unit {
    let [mass, length, time, angle, information] = dimension;
    Unit { symbol, factor, dimension: Dimension::new(mass, length, time, angle, information) }
}

const MASS: [i8; 5] = [1, 0, 0, 0, 0];
const LENGTH: [i8; 5] = [0, 1, 0, 0, 0];
const TIME: [i8; 5] = [0, 0, 1, 0, 0];
const ANGLE: [i8; 5] = [0, 0, 0, 1, 0];
const FORCE: [i8; 5] = [1, 1, -2, 0, 0];
const TORQUE: [i8; 5] = [1, 2, -2, 0, 0];
const BIT: [i8; 5] = [0, 0, 0, 0, 1];
const BIT_RATE: [i8; 5] = [0, 0, -1, 0, 1];

const UNITS: &[Unit] = &[
    unit("%", 0.01, [0; 5]),
    unit("s", 1.0, TIME),
    unit("ms", 1e-3, TIME),
    unit("us", 1e-6, TIME),
    unit("µs", 1e-6, TIME),
    unit("μs", 1e-6, TIME),
    unit("ns", 1e-9, TIME),
    unit("min", 60.0, TIME),
    unit("Hz", 1.0, [0, 0, -1, 0, 0]),
    unit("rad", 1.0, ANGLE),
    unit("mrad", 1e-3, ANGLE),
    unit("deg", TAU / 360.0, ANGLE),
    unit("°", TAU / 360.0, ANGLE),
    unit("turn", TAU, ANGLE),
    unit("rev", TAU, ANGLE),
    unit("r", TAU, ANGLE),
    unit("rpm", TAU / 60.0, [0, 0, -1, 1, 0]),
    unit("m", 1.0, LENGTH),
    unit("dm", 1e-1, LENGTH),
    unit("cm", 1e-2, LENGTH),
    unit("mm", 1e-3, LENGTH),
    unit("um", 1e-6, LENGTH),
    unit("µm", 1e-6, LENGTH),
    unit("μm", 1e-6, LENGTH),
    unit("kg", 1.0, MASS),
    unit("g", 1e-3, MASS),
    unit("N", 1.0, FORCE),
    unit("mN", 1e-3, FORCE),
    unit("kN", 1e3, FORCE),
    unit("Nm", 1.0, TORQUE),
    unit("mNm", 1e-3, TORQUE),
    unit("kNm", 1e3, TORQUE),
    unit("bit", 1.0, BIT),
    unit("kbit", 1e3, BIT),
    unit("Mbit", 1e6, BIT),
    unit("bps", 1.0, BIT_RATE),
    unit("kbps", 1e3, BIT_RATE),
    unit("Mbps", 1e6, BIT_RATE),
];

/// The reason for which a text is not the wanted quantity.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum QuantityError {
    /// It does not begin with a number.
    NoNumber,
    /// It is a number without a unit.
    NoUnit,
    /// The unit contains a symbol that is not known.
    UnknownUnit {
        /// The symbol.
        symbol: String,
    },
    /// The unit belongs to another quantity.
    OtherQuantity {
        /// The unit as written.
        unit: String,
    },
}

impl Quantity {
    /// Reads a number with its unit and gives it in SI units.
    pub fn parse(self, text: &str) -> Result<f64, QuantityError> {
        let (number, unit) = split_number(text.trim());
        let number: f64 =
            number.replace('_', "").replace('−', "-").parse().map_err(|_| QuantityError::NoNumber)?;
        let unit = unit.trim();
        if unit.is_empty() && self.dimension != Dimension::NONE {
            return Err(QuantityError::NoUnit);
        }
        let (factor, dimension) = reduce(unit)?;
        if dimension == self.dimension {
            Ok(number * factor)
        } else {
            Err(QuantityError::OtherQuantity { unit: unit.to_owned() })
        }
    }

    /// The value with its unit, for people: times in the unit that suits them, angles also in degrees.
    pub fn show(self, value: f64) -> String {
        let (value, unit) = match self {
            Self::DURATION if value != 0.0 && value.abs() < 1e-3 => (value * 1e6, "µs"),
            Self::DURATION if value != 0.0 && value.abs() < 1.0 => (value * 1e3, "ms"),
            Self::FRACTION => (value * 100.0, "%"),
            Self::BIT_RATE if value >= 1e6 => (value / 1e6, "Mbit/s"),
            Self::BIT_RATE if value >= 1e3 => (value / 1e3, "kbit/s"),
            _ => (value, self.unit),
        };
        match self {
            Self::ANGLE | Self::ANGULAR_VELOCITY => {
                let degrees = unit.replace("rad", "deg");
                format!("{} {unit} ({} {degrees})", Short(value), Short(value.to_degrees()))
            }
            _ => format!("{} {unit}", Short(value)),
        }
    }
}

/// A number with at most six significant digits and no trailing zeros.
pub struct Short(pub f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        if value == 0.0 {
            // Without the sign of −0.
            return f.write_str("0");
        }
        if !value.is_finite() {
            return write!(f, "{value}");
        }
        let magnitude = value.abs().log10().floor();
        if !(-4.0..9.0).contains(&magnitude) {
            return write!(f, "{value:e}");
        }
        let decimals = (5.0 - magnitude).clamp(0.0, 9.0) as usize;
        let text = format!("{value:.decimals$}");
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        f.write_str(text)
    }
}

/// Splits after the number that a text begins with.
fn split_number(text: &str) -> (&str, &str) {
    let mut characters = text.char_indices().peekable();
    while let Some((at, character)) = characters.next() {
        let is_exponent = matches!(character, 'e' | 'E')
            && characters.peek().is_some_and(|(_, next)| next.is_ascii_digit() || matches!(next, '+' | '-'));
        if !(character.is_ascii_digit() || matches!(character, '.' | '_' | '+' | '-' | '−') || is_exponent)
        {
            return text.split_at(at);
        }
    }
    (text, "")
}

/// The factor and dimension of a unit such as `Nm s/rad`, `kg·m²` or `1/s`. Factors are taken from left to right;
/// a slash divides by the next one only.
fn reduce(unit: &str) -> Result<(f64, Dimension), QuantityError> {
    let unknown = |symbol: &str| QuantityError::UnknownUnit { symbol: symbol.to_owned() };
    let (mut factor, mut dimension, mut divides) = (1.0, Dimension::NONE, false);
    let mut rest = unit;
    while let Some(first) = rest.chars().next() {
        if first.is_whitespace() || matches!(first, '*' | '·' | '⋅') {
            rest = rest.get(first.len_utf8()..).unwrap_or("");
            continue;
        }
        if first == '/' {
            divides = true;
            rest = rest.get(1..).unwrap_or("");
            continue;
        }
        let end = rest.find(|c: char| !is_symbol(c)).unwrap_or(rest.len());
        let (symbol, after) = rest.split_at(end);
        if symbol.is_empty() {
            let one = rest.strip_prefix('1').filter(|after| after.trim_start().starts_with('/'));
            rest = one.ok_or_else(|| unknown(rest))?;
            continue;
        }
        let known = UNITS.iter().find(|unit| unit.symbol == symbol).ok_or_else(|| unknown(symbol))?;
        let (exponent, after) = split_exponent(after).ok_or_else(|| unknown(rest))?;
        let exponent = if divides { -exponent } else { exponent };
        factor *= known.factor.powi(exponent.into());
        dimension = dimension.times(known.dimension, exponent).ok_or_else(|| unknown(rest))?;
        divides = false;
        rest = after;
    }
    if divides { Err(unknown("/")) } else { Ok((factor, dimension)) }
}

fn is_symbol(character: char) -> bool {
    (character.is_alphabetic() || matches!(character, '%' | '°')) && superscript(character).is_none()
}

/// An exponent such as `^2`, `2`, `²` or `^-1`; 1 where there is none.
fn split_exponent(text: &str) -> Option<(i8, &str)> {
    let caret = text.strip_prefix('^');
    let body = caret.unwrap_or(text);
    let signed = body.strip_prefix(['-', '⁻']);
    let digits = signed.unwrap_or(body);
    let digit = digits.chars().next().and_then(|c| {
        let value = c.to_digit(10).or_else(|| superscript(c))?;
        Some((i8::try_from(value).ok()?, c.len_utf8()))
    });
    match digit {
        Some((value, length)) => {
            Some((if signed.is_some() { -value } else { value }, digits.get(length..).unwrap_or("")))
        }
        None if caret.is_none() && signed.is_none() => Some((1, text)),
        None => None,
    }
}

fn superscript(character: char) -> Option<u32> {
    "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|c| c == character).and_then(|value| u32::try_from(value).ok())
}

/// The unit that was probably meant by a symbol where this quantity is wanted: one of its own, or, of a quantity whose unit
/// is put together of several, any.
pub fn nearest_unit(symbol: &str, quantity: Quantity) -> Option<&'static str> {
    let nearest = |units: &mut dyn Iterator<Item = &Unit>| {
        super::spelling::nearest(symbol, units.map(|unit| unit.symbol))
    };
    let is_put_together = quantity.unit.contains(['/', ' ', '^']);
    let own = nearest(&mut UNITS.iter().filter(|unit| unit.dimension == quantity.dimension));
    own.or_else(|| is_put_together.then(|| nearest(&mut UNITS.iter())).flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn assert_close(quantity: Quantity, text: &str, expected: f64) {
        let value = quantity.parse(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
        assert!((value - expected).abs() <= expected.abs() * 1e-12, "{text} gave {value}, not {expected}");
    }

    #[test]
    fn quantities_are_read_into_si_units() {
        assert_close(Quantity::ANGULAR_VELOCITY, "2.39 rad/s", 2.39);
        assert_close(Quantity::ANGULAR_VELOCITY, "180 deg/s", TAU / 2.0);
        assert_close(Quantity::ANGULAR_VELOCITY, "60rpm", TAU);
        assert_close(Quantity::ANGULAR_VELOCITY, "60 r/min", TAU);
        assert_close(Quantity::ANGLE, "-90°", -TAU / 4.0);
        assert_close(Quantity::ANGLE, "−0.5 turn", -TAU / 2.0);
        assert_close(Quantity::DURATION, "1 ms", 1e-3);
        assert_close(Quantity::DURATION, "5e2 µs", 5e-4);
        assert_close(Quantity::BIT_RATE, "1 Mbit/s", 1e6);
        assert_close(Quantity::BIT_RATE, "500 kbps", 5e5);
        assert_close(Quantity::TORQUE, "50 N m", 50.0);
        assert_close(Quantity::TORQUE, "31_000 mNm", 31.0);
        assert_close(Quantity::MOMENT_OF_INERTIA, "2.5 kg·m²", 2.5);
        assert_close(Quantity::MOMENT_OF_INERTIA, "25e3 kg*cm^2", 2.5);
        assert_close(Quantity::ANGULAR_DAMPING, "20 Nm s/rad", 20.0);
        assert_close(Quantity::ANGULAR_ACCELERATION, "8 rad s^-2", 8.0);
        assert_close(Quantity::ACCELERATION, "200 mm/s2", 0.2);
        assert_close(Quantity::GAIN, "30 1/s", 30.0);
        assert_close(Quantity::FRACTION, "80 %", 0.8);
        assert_close(Quantity::FRACTION, "0.8", 0.8);
    }

    #[test]
    fn every_example_is_of_its_own_quantity() {
        for quantity in [
            Quantity::DURATION,
            Quantity::FRACTION,
            Quantity::BIT_RATE,
            Quantity::GAIN,
            Quantity::ANGLE,
            Quantity::ANGULAR_VELOCITY,
            Quantity::ANGULAR_ACCELERATION,
            Quantity::ANGULAR_JERK,
            Quantity::TORQUE,
            Quantity::MOMENT_OF_INERTIA,
            Quantity::ANGULAR_STIFFNESS,
            Quantity::ANGULAR_DAMPING,
            Quantity::LENGTH,
            Quantity::VELOCITY,
            Quantity::ACCELERATION,
            Quantity::JERK,
            Quantity::FORCE,
            Quantity::MASS,
            Quantity::STIFFNESS,
            Quantity::DAMPING,
        ] {
            assert!(quantity.parse(quantity.example).is_ok(), "{quantity:?}");
            assert_eq!(quantity.parse(&format!("1 {}", quantity.unit)), Ok(1.0), "{quantity:?}");
        }
    }

    #[test]
    fn the_unit_of_another_quantity_is_refused() {
        let other = |unit: &str| Err(QuantityError::OtherQuantity { unit: unit.to_owned() });
        assert_eq!(Quantity::ANGULAR_VELOCITY.parse("2 rad"), other("rad"));
        assert_eq!(Quantity::ANGLE.parse("2 %"), other("%"));
        assert_eq!(Quantity::TORQUE.parse("2 Nm/rad"), other("Nm/rad"));
        assert_eq!(Quantity::FRACTION.parse("2 deg"), other("deg"));
    }

    #[test]
    fn what_is_no_quantity_is_named() {
        let unknown = |symbol: &str| Err(QuantityError::UnknownUnit { symbol: symbol.to_owned() });
        assert_eq!(Quantity::ANGLE.parse("fast"), Err(QuantityError::NoNumber));
        assert_eq!(Quantity::ANGLE.parse(""), Err(QuantityError::NoNumber));
        assert_eq!(Quantity::ANGLE.parse("2"), Err(QuantityError::NoUnit));
        assert_eq!(Quantity::ANGLE.parse("2 furlong"), unknown("furlong"));
        assert_eq!(Quantity::ANGLE.parse("2 rad/"), unknown("/"));
        assert_eq!(Quantity::ANGLE.parse("2 rad^"), unknown("rad^"));
        assert_eq!(nearest_unit("dge", Quantity::ANGLE), Some("deg"));
        assert_eq!(nearest_unit("dge", Quantity::ANGULAR_VELOCITY), Some("deg"));
        assert_eq!(nearest_unit("h", Quantity::DURATION), None);
        assert_eq!(nearest_unit("mss", Quantity::DURATION), Some("ms"));
    }

    #[test]
    fn values_are_shown_as_people_write_them() {
        assert_eq!(Quantity::ANGLE.show(-0.0), "0 rad (0 deg)");
        assert_eq!(Quantity::DURATION.show(0.00055), "550 µs");
        assert_eq!(Quantity::DURATION.show(0.1), "100 ms");
        assert_eq!(Quantity::ANGLE.show(TAU / 4.0), "1.5708 rad (90 deg)");
        assert_eq!(Quantity::TORQUE.show(87.0), "87 Nm");
        assert_eq!(Quantity::FRACTION.show(0.8), "80 %");
        assert_eq!(Short(1e-9).to_string(), "1e-9");
        assert_eq!(Short(524_288.0).to_string(), "524288");
    }

    proptest! {
        #[test]
        fn any_text_is_answered_without_a_panic(text in ".*") {
            let _ = Quantity::ANGULAR_VELOCITY.parse(&text);
        }

        #[test]
        fn any_unit_is_answered_without_a_panic(unit in "[a-zN%°µ²³⁻^*/· 0-9-]{0,12}") {
            let _ = Quantity::TORQUE.parse(&format!("1 {unit}"));
        }
    }
}
