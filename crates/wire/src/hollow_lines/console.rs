//! The serial console of a motor: commands and parameters as text (section 2 of the manual).
//!
//! The manual prints the commands of the main menu. It does not print how parameters and modes are typed and how the zero point is
//! set. For these, [`ConsoleCommand`] assumes: the letter of the item in a line of its own, then the value in the next one, and the
//! names of the items of the zero point. The vendor asks users to use CAN in products.

use std::fmt;

use arrayvec::ArrayVec;
use thiserror::Error;

/// The baud rate of the console, which cannot be changed.
pub const BAUD_RATE: u32 = 19_200;
/// The end of every command: LF, then CR.
pub const TERMINATOR: &str = "\n\r";
/// The longest line that is kept.
const LINE_BYTES: usize = 128;
/// The largest number that is typed. It has nine digits at most, so nothing is rounded that matters.
const NUMBER_AT_MOST: f64 = 1e6;
/// Numbers are typed to thousandths.
const STEPS: f64 = 1_000.0;
/// Where the zero point may be, in degrees from the zero of the factory.
const ZERO_DEGREES: std::ops::RangeInclusive<f64> = 5.0..=355.0;

/// A command to the console.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConsoleCommand {
    /// `m10.0` or `b10.0`: move in the mode that is set, to degrees, with Hz, or with A.
    Drive {
        /// `m`, or otherwise `b`. The manual prints both and explains `m`: the positive direction.
        is_forward: bool,
        /// Degrees, Hz or A.
        value: f64,
    },
    /// `r`: no torque.
    Stop,
    /// `p`: the menu of the mode. Choose by [`ConsoleCommand::Item`] `a`, `b` or `c`: torque, velocity, position.
    ModeMenu,
    /// `s`: the menu of the parameters. Choose by [`ConsoleCommand::Item`].
    ParameterMenu,
    /// The item of a menu. Assumed.
    Item(char),
    /// The value of the item that was chosen. Assumed.
    Value(f64),
    /// The present position becomes the zero point. Assumed.
    SetZeroPoint,
    /// The zero of the factory counts again. Assumed.
    ClearZeroPoint,
    /// STEP_CONFIG, what the pins for encoder pulses are used for; its value comes next. Assumed.
    StepConfig,
}

/// A command that cannot be typed or read.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CommandError {
    /// A number that the console does not take.
    #[error("{value} cannot be typed: a number of at most {NUMBER_AT_MOST} in size")]
    Number {
        /// The number.
        value: f64,
    },
    /// A number without a decimal point.
    #[error("{given:?} has no decimal point: the console reads numbers with one alone")]
    NoDecimalPoint {
        /// What was typed.
        given: String,
    },
    /// Not a command.
    #[error("{given:?} is no command")]
    Unknown {
        /// What was typed.
        given: String,
    },
}

impl ConsoleCommand {
    /// The command as it is typed, with its terminator.
    ///
    /// # Errors
    /// [`CommandError`] for a number that the console does not take, or an item that no menu has.
    pub fn encode(self) -> Result<String, CommandError> {
        let text = match self {
            Self::Drive { is_forward, value } => {
                format!("{}{}", if is_forward { 'm' } else { 'b' }, number(value)?)
            }
            Self::Stop => "r".to_owned(),
            Self::ModeMenu => "p".to_owned(),
            Self::ParameterMenu => "s".to_owned(),
            Self::Item(letter @ 'a'..='i') => letter.to_string(),
            Self::Item(letter) => return Err(CommandError::Unknown { given: letter.to_string() }),
            Self::Value(value) => number(value)?,
            Self::SetZeroPoint => "setzeropoint".to_owned(),
            Self::ClearZeroPoint => "clrzeropoint".to_owned(),
            Self::StepConfig => "step_config".to_owned(),
        };
        Ok(text + TERMINATOR)
    }

    /// Reads a command without its terminator.
    ///
    /// # Errors
    /// See [`CommandError`].
    pub fn decode(line: &str) -> Result<Self, CommandError> {
        let unknown = || CommandError::Unknown { given: line.to_owned() };
        match line {
            "r" => Ok(Self::Stop),
            "p" => Ok(Self::ModeMenu),
            "s" => Ok(Self::ParameterMenu),
            "setzeropoint" => Ok(Self::SetZeroPoint),
            "clrzeropoint" => Ok(Self::ClearZeroPoint),
            "step_config" => Ok(Self::StepConfig),
            _ => {
                let mut characters = line.chars();
                match (characters.next().ok_or_else(unknown)?, characters.as_str()) {
                    (letter @ 'a'..='i', "") => Ok(Self::Item(letter)),
                    (letter @ ('m' | 'b'), value) if !value.is_empty() => {
                        Ok(Self::Drive { is_forward: letter == 'm', value: parsed(value)? })
                    }
                    ('0'..='9' | '-', _) => parsed(line).map(Self::Value),
                    _ => Err(unknown()),
                }
            }
        }
    }
}

/// A number with a decimal point, to thousandths.
fn number(value: f64) -> Result<String, CommandError> {
    if value.is_nan() || value.abs() > NUMBER_AT_MOST {
        return Err(CommandError::Number { value });
    }
    // Adding zero leaves no negative zero.
    let text = ((value * STEPS).round() / STEPS + 0.0).to_string();
    Ok(if text.contains('.') { text } else { text + ".0" })
}

fn parsed(text: &str) -> Result<f64, CommandError> {
    let unknown = || CommandError::Unknown { given: text.to_owned() };
    if !text.chars().all(|c| matches!(c, '0'..='9' | '-' | '.')) {
        return Err(unknown());
    }
    if !text.contains('.') {
        return Err(CommandError::NoDecimalPoint { given: text.to_owned() });
    }
    let value: f64 = text.parse().map_err(|_| unknown())?;
    if value.abs() <= NUMBER_AT_MOST { Ok(value) } else { Err(CommandError::Number { value }) }
}

/// A parameter of the menu `s`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its letter.
    pub item: char,
    /// What it is.
    pub name: &'static str,
    /// What a user may set.
    pub access: ParameterAccess,
    /// What it does.
    pub meaning: &'static str,
}

/// What a user may set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterAccess {
    /// A whole number of this range.
    Range {
        /// The smallest value.
        lowest: u16,
        /// The largest value.
        highest: u16,
    },
    /// Nothing.
    ReadOnly,
}

/// A value that a parameter does not take.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ParameterError {
    /// Out of range.
    #[error("parameter {item} ({name}) cannot be {value}: a whole number of {lowest} to {highest}")]
    OutOfRange {
        /// The letter.
        item: char,
        /// The name.
        name: &'static str,
        /// The value.
        value: f64,
        /// The smallest value.
        lowest: u16,
        /// The largest value.
        highest: u16,
    },
    /// The vendor does not let users set it.
    #[error("parameter {item} ({name}) is not open to users")]
    ReadOnly {
        /// The letter.
        item: char,
        /// The name.
        name: &'static str,
    },
}

const fn settable(
    item: char,
    name: &'static str,
    lowest: u16,
    highest: u16,
    meaning: &'static str,
) -> Parameter {
    Parameter { item, name, access: ParameterAccess::Range { lowest, highest }, meaning }
}

const fn read_only(item: char, name: &'static str, meaning: &'static str) -> Parameter {
    Parameter { item, name, access: ParameterAccess::ReadOnly, meaning }
}

/// The parameters of the menu, in its order.
pub const PARAMETERS: [Parameter; 9] = [
    settable('a', "current loop bandwidth", 100, 2_000, "proportional gain of the current loop"),
    read_only('b', "velocity loop bandwidth", "proportional gain of the velocity loop"),
    settable('c', "position loop gain", 0, 100, "proportional gain of the position loop"),
    settable('d', "position loop damping", 0, 100, "derivative gain of the position loop"),
    settable('e', "multi-turn setting Pmax", 1, 1, "the turns of the full scale; 1 for the hollow motors"),
    settable('f', "CAN FD", 0, 1, "1: CAN FD, 0: classic CAN"),
    settable('g', "CAN identifier", 0, 100, "the only identifier that the motor accepts; unique on its bus"),
    settable('h', "CAN identifier of the master", 0, 0x7FF, "the identifier of every reply; 100 by default"),
    read_only('i', "CW config", "the sequence of the phases"),
];

impl Parameter {
    /// The parameter of this letter.
    pub fn of(item: char) -> Option<Self> {
        PARAMETERS.into_iter().find(|parameter| parameter.item == item)
    }

    /// Whether it can have this value.
    ///
    /// # Errors
    /// See [`ParameterError`].
    pub fn check(&self, value: f64) -> Result<u16, ParameterError> {
        let Self { item, name, .. } = *self;
        match self.access {
            ParameterAccess::ReadOnly => Err(ParameterError::ReadOnly { item, name }),
            ParameterAccess::Range { lowest, highest } => {
                let is_sound =
                    value.fract() == 0.0 && (f64::from(lowest)..=f64::from(highest)).contains(&value);
                let refused = ParameterError::OutOfRange { item, name, value, lowest, highest };
                if is_sound { Ok(value as u16) } else { Err(refused) }
            }
        }
    }
}

/// A zero point, as the menu shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroPoint(f64);

/// A zero point that a motor does not keep. Read the menu after setting one: what it shows then counts.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "a zero point at {degrees} degrees from the zero of the factory is not kept: it must be at 5 to 355 degrees. Turn the \
     output by 10 degrees, fasten it there, and set the zero point again"
)]
pub struct ZeroPointError {
    /// Degrees from the zero of the factory.
    pub degrees: f64,
}

impl ZeroPoint {
    /// A zero point at these degrees from the zero of the factory.
    ///
    /// # Errors
    /// [`ZeroPointError`] outside of 5 to 355 degrees.
    pub fn new(degrees: f64) -> Result<Self, ZeroPointError> {
        if ZERO_DEGREES.contains(&degrees) { Ok(Self(degrees)) } else { Err(ZeroPointError { degrees }) }
    }

    /// Degrees from the zero of the factory.
    pub const fn degrees(self) -> f64 {
        self.0
    }
}

impl fmt::Display for ZeroPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} degrees", self.0)
    }
}

/// Cuts the bytes of the console into lines, in either direction. It holds one line, however many bytes come without an end.
#[derive(Clone, Debug, Default)]
pub struct ConsoleReader {
    line: ArrayVec<u8, LINE_BYTES>,
    is_overlong: bool,
}

impl ConsoleReader {
    /// Takes the next byte. Returns the line that it ends: LF and CR each end one, and empty and overlong lines are left out. What is no ASCII
    /// is shown as `?`.
    pub fn push(&mut self, byte: u8) -> Option<String> {
        match byte {
            b'\n' | b'\r' => {
                let is_sound = !std::mem::take(&mut self.is_overlong) && !self.line.is_empty();
                let shown =
                    |byte: u8| if byte.is_ascii_graphic() || byte == b' ' { byte.into() } else { '?' };
                let line: String = self.line.drain(..).map(shown).collect();
                is_sound.then_some(line)
            }
            byte => {
                self.is_overlong |= self.line.try_push(byte).is_err();
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_typed_with_a_decimal_point() {
        let forward = |value| ConsoleCommand::Drive { is_forward: true, value }.encode();
        assert_eq!(forward(10.0).unwrap(), "m10.0\n\r");
        assert_eq!(forward(0.1 + 0.2).unwrap(), "m0.3\n\r");
        assert_eq!(forward(-1e-9).unwrap(), "m0.0\n\r");
        assert_eq!(ConsoleCommand::Drive { is_forward: false, value: 2.5 }.encode().unwrap(), "b2.5\n\r");
        assert_eq!(ConsoleCommand::Value(100.0).encode().unwrap(), "100.0\n\r");
        for value in [f64::INFINITY, 1_000_000.1, -1_000_001.0] {
            assert_eq!(forward(value), Err(CommandError::Number { value }));
        }
        assert!(forward(f64::NAN).is_err());
        let whole = ConsoleCommand::decode("m10").unwrap_err();
        assert_eq!(
            whole.to_string(),
            "\"10\" has no decimal point: the console reads numbers with one alone"
        );
    }

    #[test]
    fn every_command_is_read_as_it_was_typed() {
        let commands = [
            ConsoleCommand::Drive { is_forward: true, value: -10.25 },
            ConsoleCommand::Stop,
            ConsoleCommand::ModeMenu,
            ConsoleCommand::ParameterMenu,
            ConsoleCommand::Item('a'),
            ConsoleCommand::Item('i'),
            ConsoleCommand::Value(-0.5),
            ConsoleCommand::SetZeroPoint,
            ConsoleCommand::ClearZeroPoint,
            ConsoleCommand::StepConfig,
        ];
        for command in commands {
            let text = command.encode().unwrap();
            assert_eq!(ConsoleCommand::decode(text.strip_suffix(TERMINATOR).unwrap()), Ok(command));
        }
        for given in ["", "m", "x", "R", "mm1.0", "m1.0.0", "1.0 ", "m1e3.0", "minf", "m-.", "sp"] {
            assert!(ConsoleCommand::decode(given).is_err(), "{given:?}");
        }
        assert!(ConsoleCommand::Item('z').encode().is_err());
    }

    #[test]
    fn parameters_take_what_the_manual_allows() {
        let check = |item, value| Parameter::of(item).unwrap().check(value);
        assert_eq!(check('a', 100.0), Ok(100));
        assert_eq!(check('a', 2_000.0), Ok(2_000));
        for (item, value) in
            [('a', 99.0), ('a', 2_001.0), ('c', 0.5), ('e', 2.0), ('f', 2.0), ('g', 101.0), ('d', -1.0)]
        {
            assert!(matches!(check(item, value), Err(ParameterError::OutOfRange { .. })), "{item} {value}");
        }
        for item in ['b', 'i'] {
            assert!(matches!(check(item, 1.0), Err(ParameterError::ReadOnly { .. })));
        }
        assert!(check('a', f64::NAN).is_err());
        assert_eq!(Parameter::of('j'), None);
    }

    #[test]
    fn a_zero_point_is_not_near_the_zero_of_the_factory() {
        for degrees in [5.0, 180.0, 355.0] {
            assert_eq!(ZeroPoint::new(degrees).map(ZeroPoint::degrees), Ok(degrees));
        }
        for degrees in [0.0, 4.99, 355.01, 360.0, -10.0] {
            assert_eq!(ZeroPoint::new(degrees), Err(ZeroPointError { degrees }));
        }
        assert!(ZeroPoint::new(f64::NAN).is_err());
    }

    fn lines(bytes: &[u8]) -> Vec<String> {
        let mut reader = ConsoleReader::default();
        bytes.iter().filter_map(|byte| reader.push(*byte)).collect()
    }

    #[test]
    fn lines_end_with_either_character_and_noise_is_bounded() {
        assert_eq!(lines(b"r\n\rm1.0\r\n\xFF\x07ok\n"), ["r", "m1.0", "??ok"]);
        let noise = [[b'a'; 10_000].as_slice(), b"\nr\n"].concat();
        assert_eq!(lines(&noise), ["r"]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_lines_of_printable_text_and_the_next_command_is_read(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            for line in lines(&bytes) {
                prop_assert!(line.chars().all(|c| c.is_ascii_graphic() || c == ' '));
                let _ = ConsoleCommand::decode(&line);
            }
            let then = [bytes.as_slice(), b"\nr\n\r"].concat();
            prop_assert_eq!(lines(&then).pop(), Some("r".to_owned()));
        }
    }
}
