//! `--set KEY=VALUE`: a drive without a configuration that is known by the keys of an axis.

use std::str::FromStr;

use takt::config::Config;
use takt::family::Family;

use super::super::usage_error::UsageError;

/// One key of an axis, as it would stand in a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisKey {
    key: String,
    /// In TOML.
    value: String,
}

/// What other options say.
const ELSEWHERE: [(&str, &str); 4] =
    [("drive", "--family"), ("node", "--node"), ("bus", "--bus"), ("name", "the node ID")];

impl FromStr for AxisKey {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| "write it as KEY=VALUE, for example torque_constant=0.23".to_owned())?;
        let (key, value) = (key.trim(), value.trim());
        let is_key = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
        if key.is_empty() || !key.chars().all(is_key) {
            return Err(format!("`{key}` is no key of an axis"));
        }
        if let Some((_, option)) = ELSEWHERE.iter().find(|(other, _)| *other == key) {
            return Err(format!("`{key}` is said by {option}"));
        }
        // A shell takes the quotes of a text away.
        let is_toml = !value.contains(['\n', '\r'])
            && toml::from_str::<toml::Table>(&format!("value = {value}")).is_ok();
        let value =
            if is_toml { value.to_owned() } else { toml::Value::String(value.to_owned()).to_string() };
        Ok(Self { key: key.to_owned(), value })
    }
}

/// Where the drive is.
pub struct BusOfKeys<'a> {
    /// As `interface` has it in a configuration.
    pub interface: &'a str,
    /// bit/s
    pub bit_rate: u32,
    /// bit/s of the data phase, on a bus for CAN FD.
    pub data_bit_rate: Option<u32>,
}

/// A configuration of this one drive, and whether the keys say its limits.
pub fn config_of(
    family: &dyn Family,
    node: u8,
    bus: &BusOfKeys<'_>,
    keys: &[AxisKey],
) -> Result<(Config, bool), UsageError> {
    let has_limits = keys.iter().any(|key| key.key == "limits" || key.key.starts_with("limits."));
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let mut text = format!(
        "name = \"drive\"\n[[bus]]\nname = \"bus\"\ninterface = {}\nbit_rate = {}\n",
        quoted(bus.interface),
        bus.bit_rate
    );
    if let Some(rate) = bus.data_bit_rate {
        text.push_str(&format!("data_bit_rate = {rate}\n"));
    }
    text.push_str(&format!(
        "[[axis]]\nname = \"node-{node}\"\nbus = \"bus\"\nnode = {node}\ndrive = {}\n",
        quoted(family.word())
    ));
    for AxisKey { key, value } in keys {
        text.push_str(&format!("{key} = {value}\n"));
    }
    if !has_limits {
        // Nothing moves without limits: these are for the reader of configurations alone.
        text.push_str(
            "limits = { position = [-1e-3, 1e-3], velocity = 1e-3, acceleration = 1e-3, torque = 1e-3 }\n",
        );
    }
    Ok((Config::parse("--set", &text)?, has_limits))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(text: &str) -> Result<(String, String), String> {
        text.parse::<AxisKey>().map(|AxisKey { key, value }| (key, value))
    }

    #[test]
    fn a_value_is_toml_or_a_text_whose_quotes_the_shell_has_taken() {
        let is = |text: &str, value: &str| assert_eq!(key(text).unwrap().1, value, "{text}");
        is("master_id=0x65", "0x65");
        is("kp = 200", "200");
        is("extended=true", "true");
        is("velocity_full_scale=58.6 rad/s", "\"58.6 rad/s\"");
        is("velocity_full_scale=\"58.6 rad/s\"", "\"58.6 rad/s\"");
        is("limits.position=[\"-1 rad\", \"1 rad\"]", "[\"-1 rad\", \"1 rad\"]");
        is("description=/tmp/a.toml", "\"/tmp/a.toml\"");
    }

    #[test]
    fn what_is_no_key_or_is_said_elsewhere_is_refused() {
        assert!(key("kp").unwrap_err().contains("KEY=VALUE"));
        assert!(key("k p=1").unwrap_err().contains("no key"));
        assert!(key("node=3").unwrap_err().contains("--node"));
    }
}
