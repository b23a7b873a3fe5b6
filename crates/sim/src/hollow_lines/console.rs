//! The serial console of a motor.
//!
//! The manual prints the items of the menus, not their text. This console types the items in the order of the manual, and takes
//! what [`ConsoleCommand`] assumes.

use takt_rt::Nanoseconds;
use takt_wire::hollow_lines::console::{
    ConsoleCommand, ConsoleReader, PARAMETERS, Parameter, ParameterAccess, TERMINATOR, ZeroPoint,
};
use takt_wire::hollow_lines::motor_data::{COUNTS_PER_TURN, MotorCommand, MotorMode, MotorRun};

use super::motor::Motor;
use crate::serial_device::SerialDevice;

/// 10 Hz of electrical frequency in position mode.
const POSITION_VELOCITY: i32 = 83_886;
/// The code of 1 Hz.
const ONE_HZ: f64 = 8_388.608;
/// The code of 1 A.
const ONE_AMPERE: f64 = 327.68;
/// 1 A, the limit in velocity mode.
const VELOCITY_CURRENT: i16 = 328;

/// The menu that the next line belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Menu {
    Main,
    Mode,
    Parameters,
    /// The value of a parameter comes next.
    Value(Parameter),
    /// The value of STEP_CONFIG comes next.
    StepConfig,
}

/// A motor with its console.
pub struct Console {
    reader: ConsoleReader,
    menu: Menu,
    motor: Motor,
    mode: MotorMode,
    /// The values of the parameters, in the order of the menu.
    values: [u16; PARAMETERS.len()],
    zero: Option<ZeroPoint>,
    /// What the pins for encoder pulses are used for, in degrees; 0 for an input.
    step_config: u16,
}

impl Default for Console {
    /// The console of a motor with the settings of the factory.
    fn default() -> Self {
        let values = [500, 0, 20, 20, 1, 0, 1, 100, 0];
        let (reader, motor) = (ConsoleReader::default(), Motor::new(1));
        Self {
            reader,
            menu: Menu::Main,
            motor,
            mode: MotorMode::Position,
            values,
            zero: None,
            step_config: 0,
        }
    }
}

impl Console {
    fn obey(&mut self, now_ns: Nanoseconds, line: &str) -> String {
        let command = match ConsoleCommand::decode(line) {
            Ok(command) => command,
            Err(error) => return say(&error.to_string()),
        };
        match (self.menu, command) {
            (_, ConsoleCommand::Stop) => {
                self.motor.obey(now_ns, MotorCommand::default());
                self.menu = Menu::Main;
                say("free")
            }
            (Menu::Main, ConsoleCommand::Drive { is_forward, value }) => {
                self.drive(now_ns, if is_forward { value } else { -value });
                say("running")
            }
            (_, ConsoleCommand::ModeMenu) => {
                self.menu = Menu::Mode;
                say("a) torque") + &say("b) velocity") + &say("c) position")
            }
            (_, ConsoleCommand::ParameterMenu) => {
                self.menu = Menu::Parameters;
                self.parameters()
            }
            (Menu::Mode, ConsoleCommand::Item(item @ 'a'..='c')) => {
                self.menu = Menu::Main;
                let [torque, velocity, position] =
                    [MotorMode::Torque, MotorMode::Velocity, MotorMode::Position];
                self.mode = match item {
                    'a' => torque,
                    'b' => velocity,
                    _ => position,
                };
                say("mode set")
            }
            (Menu::Parameters, ConsoleCommand::Item(item)) => match Parameter::of(item) {
                Some(parameter) if parameter.access != ParameterAccess::ReadOnly => {
                    self.menu = Menu::Value(parameter);
                    say(parameter.name)
                }
                _ => say("not open"),
            },
            (Menu::Value(parameter), ConsoleCommand::Value(value)) => self.set(parameter, value),
            (_, ConsoleCommand::StepConfig) => {
                self.menu = Menu::StepConfig;
                say("STEP_CONFIG")
            }
            (Menu::StepConfig, ConsoleCommand::Value(value)) => {
                self.menu = Menu::Parameters;
                if value.fract() == 0.0 && (0.0..=360.0).contains(&value) {
                    self.step_config = value as u16;
                }
                self.parameters()
            }
            (_, ConsoleCommand::SetZeroPoint) => self.set_zero(),
            (_, ConsoleCommand::ClearZeroPoint) => {
                self.zero = None;
                self.parameters()
            }
            _ => say("?"),
        }
    }

    fn drive(&mut self, now_ns: Nanoseconds, value: f64) {
        let run = MotorCommand { mode: self.mode, run: MotorRun::Run, ..MotorCommand::default() };
        let command = match self.mode {
            MotorMode::Position => MotorCommand {
                position: (value / 360.0 * COUNTS_PER_TURN).round() as i64,
                velocity: POSITION_VELOCITY,
                ..run
            },
            MotorMode::Velocity => {
                MotorCommand { velocity: (value * ONE_HZ) as i32, current: VELOCITY_CURRENT, ..run }
            }
            MotorMode::Torque => MotorCommand { current: (value * ONE_AMPERE) as i16, ..run },
        };
        self.motor.obey(now_ns, command);
    }

    fn set(&mut self, parameter: Parameter, value: f64) -> String {
        self.menu = Menu::Parameters;
        let place = PARAMETERS.iter().position(|known| known.item == parameter.item);
        match (parameter.check(value), place.and_then(|place| self.values.get_mut(place))) {
            (Ok(value), Some(place)) => {
                *place = value;
                self.parameters()
            }
            (Err(error), _) => say(&error.to_string()),
            (Ok(_), None) => say("?"),
        }
    }

    /// A zero point that is not kept leaves the one that there was: the menu shows it.
    fn set_zero(&mut self) -> String {
        let turns = self.motor.reply().position as f64 / COUNTS_PER_TURN;
        let before = self.zero.map_or(0.0, ZeroPoint::degrees);
        self.zero = ZeroPoint::new((turns * 360.0 + before).rem_euclid(360.0)).ok().or(self.zero);
        self.parameters()
    }

    fn parameters(&self) -> String {
        let lines = PARAMETERS.iter().zip(self.values);
        let lines =
            lines.map(|(parameter, value)| say(&format!("{}) {} {value}", parameter.item, parameter.name)));
        let zero = self.zero.map_or(0.0, ZeroPoint::degrees);
        lines.collect::<String>()
            + &say(&format!("STEP_CONFIG {}", self.step_config))
            + &say(&format!("SetZeroPoint {zero:.2}"))
            + &say("ClrZeroPoint")
    }
}

/// A line of the console.
fn say(text: &str) -> String {
    format!("{text}{TERMINATOR}")
}

impl SerialDevice for Console {
    fn receive(&mut self, now_ns: Nanoseconds, byte: u8, answer: &mut Vec<u8>) {
        self.motor.advance(now_ns);
        if let Some(line) = self.reader.push(byte) {
            let text = self.obey(now_ns, &line);
            answer.extend(text.into_bytes());
        }
    }

    fn advance(&mut self, now_ns: Nanoseconds, _answer: &mut Vec<u8>) -> Nanoseconds {
        self.motor.advance(now_ns);
        Nanoseconds::MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: Nanoseconds = 1_000_000_000;

    /// What the console answers to these lines, one second after the other.
    fn told(console: &mut Console, from_s: u64, lines: &[&str]) -> String {
        let mut answer = vec![];
        for (second, line) in (from_s..).zip(lines) {
            answer.clear();
            let bytes = line.bytes().chain(TERMINATOR.bytes());
            bytes.for_each(|byte| console.receive(second * SECOND_NS, byte, &mut answer));
        }
        String::from_utf8(answer).unwrap()
    }

    #[test]
    fn a_motor_is_moved_in_the_mode_that_is_set() {
        let mut console = Console::default();
        told(&mut console, 0, &["m10.0", "p"]);
        let degrees = console.motor.reply().position as f64 / COUNTS_PER_TURN * 360.0;
        assert!((degrees - 10.0).abs() < 1e-3, "{degrees}");
        told(&mut console, 2, &["b", "b14.0", "p"]);
        assert!(console.motor.reply().velocity < 0, "{:?}", console.motor);
        assert_eq!(told(&mut console, 5, &["r"]), "free\n\r");
        assert!(!console.motor.reply().is_running);
        assert!(told(&mut console, 6, &["m10"]).contains("has no decimal point"));
    }

    #[test]
    fn parameters_are_set_within_their_ranges() {
        let mut console = Console::default();
        let shown = told(&mut console, 0, &["s", "a", "1000.0"]);
        assert!(shown.starts_with("a) current loop bandwidth 1000\n\r"), "{shown}");
        assert!(told(&mut console, 9, &["a", "2001.0"]).contains("cannot be 2001"));
        assert_eq!(told(&mut console, 11, &["b"]), "not open\n\r");
    }

    #[test]
    fn a_zero_point_near_the_zero_of_the_factory_is_not_kept() {
        let mut console = Console::default();
        let shown = told(&mut console, 0, &["m2.0", "setzeropoint"]);
        assert!(shown.contains("SetZeroPoint 0.00"), "{shown}");
        let shown = told(&mut console, 2, &["m90.0", "setzeropoint"]);
        assert!(shown.contains("SetZeroPoint 90.00"), "{shown}");
        assert!(told(&mut console, 4, &["clrzeropoint"]).contains("SetZeroPoint 0.00"));
    }
}
