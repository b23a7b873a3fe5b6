//! Changed values of a configuration, by the path of their key: `axes.wrist.limits.jerk=200`.

use std::str::FromStr;

use toml::{Table, Value};

use takt::config::ConfigSources;

/// A changed value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    path: Vec<String>,
    value: Value,
}

/// Why a value cannot be changed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// There is no `=`, or nothing before it.
    #[error("write it as KEY=VALUE, for example axes.wrist.limits.jerk=200")]
    Form,
    /// There is no table with this name.
    #[error("{path}: there is no {name:?} here; there is: {known}")]
    Unknown {
        /// The whole path.
        path: String,
        /// The part that there is not.
        name: String,
        /// What there is.
        known: String,
    },
    /// What stands there is no table.
    #[error("{path}: {name:?} is a value, which has no keys")]
    Value {
        /// The whole path.
        path: String,
        /// The part.
        name: String,
    },
    /// The file of the configuration is no TOML any more.
    #[error("the configuration cannot be read as TOML: {0}")]
    Toml(String),
}

impl FromStr for Setting {
    type Err = SettingError;

    /// `KEY=VALUE`. A value that is no TOML is a text: `5 rad/s` needs no quotes.
    fn from_str(text: &str) -> Result<Self, SettingError> {
        let (path, value) = text.split_once('=').ok_or(SettingError::Form)?;
        let path: Vec<String> = path.trim().split('.').map(str::to_owned).collect();
        if path.iter().any(String::is_empty) {
            return Err(SettingError::Form);
        }
        let value = value.trim();
        let read =
            format!("value = {value}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
        Ok(Self { path, value: read.unwrap_or_else(|| Value::String(value.to_owned())) })
    }
}

/// The plurals that a path may have, with the key of the file.
const PLURALS: [(&str, &str); 3] = [("axes", "axis"), ("buses", "bus"), ("groups", "group")];

/// Changes values in the file of a configuration.
///
/// # Errors
/// See [`SettingError`]; nothing has changed then.
pub fn apply(settings: &[Setting], sources: &mut ConfigSources) -> Result<(), SettingError> {
    let main = sources.main.clone();
    let file = sources.files.iter_mut().find(|(path, _)| Some(path) == main.as_ref());
    let Some((_, bytes)) = file.filter(|_| !settings.is_empty()) else { return Ok(()) };
    let text = String::from_utf8_lossy(bytes);
    let mut table: Table =
        text.parse().map_err(|error: toml::de::Error| SettingError::Toml(error.to_string()))?;
    for setting in settings {
        setting.put(&mut table)?;
    }
    *bytes = table.to_string().into_bytes();
    Ok(())
}

impl Setting {
    fn put(&self, table: &mut Table) -> Result<(), SettingError> {
        let Some((last, folders)) = self.path.split_last() else { return Err(SettingError::Form) };
        let mut now = table;
        let mut names = folders.iter();
        while let Some(name) = names.next() {
            let list = PLURALS.iter().find(|(plural, _)| plural == name).map(|(_, key)| *key);
            now = match list.filter(|key| now.get(*key).is_some_and(Value::is_array)) {
                Some(key) => {
                    let wanted = names.next().ok_or(SettingError::Form)?;
                    self.named(now.get_mut(key), wanted)?
                }
                None => {
                    let entry = now.entry(name.as_str()).or_insert_with(|| Value::Table(Table::new()));
                    let value = || SettingError::Value { path: self.path.join("."), name: name.clone() };
                    entry.as_table_mut().ok_or_else(value)?
                }
            };
        }
        now.insert(last.clone(), self.value.clone());
        Ok(())
    }

    fn named<'a>(&self, list: Option<&'a mut Value>, wanted: &str) -> Result<&'a mut Table, SettingError> {
        let entries = list.and_then(Value::as_array_mut).map_or(&mut [][..], Vec::as_mut_slice);
        let name_of = |entry: &Value| entry.get("name").and_then(Value::as_str).map(str::to_owned);
        let place = entries.iter().position(|entry| name_of(entry).as_deref() == Some(wanted));
        let known = entries.iter().filter_map(name_of).collect::<Vec<_>>().join(", ");
        let unknown = || SettingError::Unknown { path: self.path.join("."), name: wanted.to_owned(), known };
        match place.and_then(|place| entries.get_mut(place)) {
            Some(Value::Table(table)) => Ok(table),
            _ => Err(unknown()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    const ARM: &str = "name = \"arm\"\n[[axis]]\nname = \"wrist\"\n[axis.limits]\njerk = 100.0\n[[axis]]\nname = \"elbow\"\n";

    fn changed(settings: &[&str]) -> Result<Table, SettingError> {
        let settings: Vec<Setting> = settings.iter().map(|text| text.parse().unwrap()).collect();
        let main = PathBuf::from("arm.toml");
        let mut sources = ConfigSources {
            main: Some(main.clone()),
            files: vec![(main, ARM.as_bytes().to_vec())],
            ..ConfigSources::default()
        };
        apply(&settings, &mut sources)?;
        Ok(String::from_utf8(sources.files.remove(0).1).unwrap().parse().unwrap())
    }

    #[test]
    fn a_value_is_changed_by_the_name_of_its_axis() {
        let table = changed(&["axes.wrist.limits.jerk=200", "axes.elbow.limits.velocity=5 rad/s"]).unwrap();
        assert_eq!(table["axis"][0]["limits"]["jerk"].as_integer(), Some(200));
        assert_eq!(table["axis"][1]["limits"]["velocity"].as_str(), Some("5 rad/s"));
    }

    #[test]
    fn a_key_of_a_table_that_is_not_there_is_added() {
        assert_eq!(changed(&["stream.delay=20 ms"]).unwrap()["stream"]["delay"].as_str(), Some("20 ms"));
    }

    #[test]
    fn an_axis_that_there_is_not_is_refused_with_those_that_there_are() {
        let error = changed(&["axes.hand.limits.jerk=1"]).unwrap_err().to_string();
        assert_eq!(error, "axes.hand.limits.jerk: there is no \"hand\" here; there is: wrist, elbow");
        assert_eq!("jerk".parse::<Setting>(), Err(SettingError::Form));
        assert_eq!("a..b=1".parse::<Setting>(), Err(SettingError::Form));
    }
}
