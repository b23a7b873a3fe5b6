//! What a bus is connected to, as people write it.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::model::Interface;
use crate::printable::excerpt;

/// The longest name of a network interface of Linux (IFNAMSIZ less the final zero).
const LONGEST_NAME: usize = 15;

impl FromStr for Interface {
    type Err = InterfaceError;

    /// `sim`, or the name of a SocketCAN interface: `can0`, `vcan0`.
    fn from_str(text: &str) -> Result<Self, InterfaceError> {
        if text == "sim" {
            return Ok(Self::Simulated);
        }
        if let Some(device) = text.strip_prefix("slcan:") {
            return Err(InterfaceError::SerialLine { device: excerpt(device) });
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

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Simulated => f.write_str("sim"),
            Self::SocketCan(name) => f.write_str(name),
        }
    }
}

/// What is wrong with the name of an interface.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum InterfaceError {
    /// A serial-line adapter, which takt does not open itself.
    #[error("takt does not open the serial adapter {device:?} itself")]
    SerialLine {
        /// The device.
        device: String,
    },
    /// Not a name that a network interface of Linux can have.
    #[error("{name:?} cannot be the name of a network interface")]
    Name {
        /// The name.
        name: String,
    },
}

impl InterfaceError {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::SerialLine { device } => format!(
                "make a network interface of it and name that one: `slcand -o -c -s8 {device} slcan0 && ip link set \
                 slcan0 up`, then \"slcan0\""
            ),
            Self::Name { .. } => {
                "\"sim\", or a name of at most 15 letters, digits and -_. as `ip link` shows it \
                                  (\"can0\", \"vcan0\")"
                    .to_owned()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interfaces_are_read_and_shown_alike() {
        for text in ["sim", "can0", "vcan12", "slcan0", "can-left_1.0"] {
            assert_eq!(text.parse::<Interface>().unwrap().to_string(), text);
        }
        assert_eq!("sim".parse(), Ok(Interface::Simulated));
    }

    #[test]
    fn a_serial_adapter_is_refused_with_the_way_to_make_an_interface_of_it() {
        let refused = "slcan:/dev/ttyACM0".parse::<Interface>().unwrap_err();
        assert_eq!(refused, InterfaceError::SerialLine { device: "/dev/ttyACM0".to_owned() });
        assert!(refused.help().contains("slcand -o -c -s8 /dev/ttyACM0 slcan0"));
    }

    #[test]
    fn what_linux_would_not_take_as_a_name_is_refused() {
        for name in ["", "a name", "can0/1", "interface-of-too-many-letters", "..", "can0:1"] {
            assert_eq!(name.parse::<Interface>(), Err(InterfaceError::Name { name: name.to_owned() }));
        }
    }
}
