//! What a bus is connected to, as people write it.

use std::fmt;
use std::str::FromStr;

use takt_wire::printable::excerpt;

use super::interface_error::{BAUD_RATES, InterfaceError, USUAL_BAUD_RATE};
use super::model::{CanLine, Interface, SerialDevice};

/// The longest name of a network interface of Linux (IFNAMSIZ less the final zero).
const LONGEST_NAME: usize = 15;
/// The longest path of Linux (PATH_MAX less the final zero).
const LONGEST_PATH: usize = 4_095;
impl FromStr for Interface {
    type Err = InterfaceError;

    /// `sim`, the name of a SocketCAN interface (`can0`, `vcan0`), an SLCAN adapter (`slcan:/dev/ttyACM0`,
    /// `slcan:/dev/ttyUSB0@2000000`), a transparent converter (`rs485-canfd:/dev/ttyUSB0`), or a serial line with drives on it
    /// (`serial:/dev/ttyUSB0`, `serial:/dev/ttyUSB0@19200`).
    fn from_str(text: &str) -> Result<Self, InterfaceError> {
        if text == "sim" {
            return Ok(Self::Simulated);
        }
        if let Some(line) = text.strip_prefix("slcan:") {
            return line.parse().map(Self::Slcan);
        }
        if let Some(line) = text.strip_prefix("rs485-canfd:") {
            return line.parse().map(Self::Converter);
        }
        if let Some(line) = text.strip_prefix("serial:") {
            return line.parse().map(Self::Serial);
        }
        let is_sound = (1..=LONGEST_NAME).contains(&text.len())
            && !matches!(text, "." | "..")
            && text.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'));
        if is_sound {
            Ok(Self::SocketCan(text.to_owned()))
        } else {
            Err(InterfaceError::Name { name: excerpt(text) })
        }
    }
}

impl Interface {
    /// Why frames of CANopen cannot pass; `None` where every frame can.
    pub fn lacks_canopen(&self) -> Option<String> {
        matches!(self, Self::Converter(_)).then(|| {
            format!("{self} carries CAN FD frames of 16 bytes alone, those of drives of bit fields: name a CAN bus")
        })
    }
}

impl FromStr for CanLine {
    type Err = InterfaceError;

    /// `/dev/ttyACM0`, or with a baud rate `/dev/ttyUSB0@2000000`.
    fn from_str(text: &str) -> Result<Self, InterfaceError> {
        let (device, baud_rate) = device_and_rate(text)?;
        Ok(Self { device, baud_rate: baud_rate.unwrap_or(USUAL_BAUD_RATE) })
    }
}

impl FromStr for SerialDevice {
    type Err = InterfaceError;

    /// `/dev/ttyUSB0`, or with a bit rate `/dev/ttyUSB0@19200`.
    fn from_str(text: &str) -> Result<Self, InterfaceError> {
        let (device, bit_rate) = device_and_rate(text)?;
        Ok(Self { device, bit_rate })
    }
}

/// The path of a device, and the baud rate behind it.
fn device_and_rate(text: &str) -> Result<(String, Option<u32>), InterfaceError> {
    let (device, baud_rate) = match text.rsplit_once('@') {
        Some((device, rate)) => {
            let baud_rate = rate.parse().ok().filter(|rate| BAUD_RATES.contains(rate));
            (device, Some(baud_rate.ok_or_else(|| InterfaceError::BaudRate { given: excerpt(rate) })?))
        }
        None => (text, None),
    };
    let is_sound = device.starts_with('/')
        && !device.ends_with('/')
        && device.len() <= LONGEST_PATH
        && !device.contains(|c: char| c.is_control() || c == '@');
    if is_sound {
        Ok((device.to_owned(), baud_rate))
    } else {
        Err(InterfaceError::Device { given: excerpt(device) })
    }
}

impl fmt::Display for SerialDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.device)?;
        self.bit_rate.map_or(Ok(()), |rate| write!(f, "@{rate}"))
    }
}

impl fmt::Display for CanLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.device)?;
        if self.baud_rate == USUAL_BAUD_RATE { Ok(()) } else { write!(f, "@{}", self.baud_rate) }
    }
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Simulated => f.write_str("sim"),
            Self::SocketCan(name) => f.write_str(name),
            Self::Slcan(line) => write!(f, "slcan:{line}"),
            Self::Converter(line) => write!(f, "rs485-canfd:{line}"),
            Self::Serial(line) => write!(f, "serial:{line}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interfaces_are_read_and_shown_alike() {
        for text in [
            "sim",
            "can0",
            "slcan0",
            "can-left_1.0",
            "slcan:/dev/ttyACM0",
            "slcan:/dev/ttyS1@9600",
            "serial:/dev/a@19200",
        ] {
            assert_eq!(text.parse::<Interface>().unwrap().to_string(), text);
        }
        assert_eq!("sim".parse(), Ok(Interface::Simulated));
    }

    #[test]
    fn an_adapter_is_named_by_its_device_and_where_it_matters_its_baud_rate() {
        let line =
            |device: &str, baud_rate| Interface::Slcan(CanLine { device: device.to_owned(), baud_rate });
        assert_eq!("slcan:/dev/ttyACM0".parse(), Ok(line("/dev/ttyACM0", 1_000_000)));
        assert_eq!("slcan:/dev/ttyUSB0@2000000".parse(), Ok(line("/dev/ttyUSB0", 2_000_000)));
    }

    #[test]
    fn a_line_with_drives_is_named_by_its_device_and_may_name_its_bit_rate() {
        let line = |bit_rate| Interface::Serial(SerialDevice { device: "/dev/ttyUSB0".to_owned(), bit_rate });
        assert_eq!("serial:/dev/ttyUSB0".parse(), Ok(line(None)));
        assert_eq!("serial:/dev/ttyUSB0@19200".parse(), Ok(line(Some(19_200))));
        assert!(matches!("serial:ttyUSB0".parse::<Interface>(), Err(InterfaceError::Device { .. })));
        assert!(matches!("serial:/dev/a@x".parse::<Interface>(), Err(InterfaceError::BaudRate { .. })));
    }

    #[test]
    fn what_is_no_path_of_a_device_and_no_baud_rate_is_refused() {
        for given in ["", "ttyACM0", "/dev/", "/dev/tty\nACM0", "dev/ttyACM0", "/dev/a@b"] {
            let refused = format!("slcan:{given}@1000000").parse::<Interface>();
            assert!(matches!(refused, Err(InterfaceError::Device { .. })), "{given:?}: {refused:?}");
        }
        for given in ["", "fast", "0", "9599", "12000001", "-1", "1e6"] {
            let refused = format!("slcan:/dev/ttyACM0@{given}").parse::<Interface>();
            assert_eq!(refused, Err(InterfaceError::BaudRate { given: given.to_owned() }));
        }
    }

    #[test]
    fn what_linux_would_not_take_as_a_name_is_refused() {
        for name in ["", "a name", "can0/1", "interface-of-too-many-letters", "..", "can0:1"] {
            assert_eq!(name.parse::<Interface>(), Err(InterfaceError::Name { name: name.to_owned() }));
        }
    }
}
