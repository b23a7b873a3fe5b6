//! Configurations: from a file, a text, or a dictionary.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use takt::Config;
use toml::Value;

use crate::error::{raise, raise_config};

/// The configuration that is meant: the path of a file, a text of several lines, or a dictionary with the same keys. `buses` connects
/// buses to other interfaces; `is_simulated` connects all others to the simulator.
pub fn config(
    source: &Bound<'_, PyAny>,
    buses: Option<BTreeMap<String, String>>,
    is_simulated: bool,
) -> PyResult<Config> {
    let py = source.py();
    let mut config = read(source)?.map_err(|error| raise_config(py, &error))?;
    let buses = buses.unwrap_or_default();
    if is_simulated {
        let others = config.buses.iter().filter(|bus| !buses.contains_key(&bus.name));
        let others: Vec<String> = others.map(|bus| bus.name.clone()).collect();
        for bus in others {
            connect(py, &mut config, &bus, "sim")?;
        }
    }
    for (bus, interface) in &buses {
        connect(py, &mut config, bus, interface)?;
    }
    Ok(config)
}

fn connect(py: Python<'_>, config: &mut Config, bus: &str, interface: &str) -> PyResult<()> {
    let connected = config.override_interface(bus, interface);
    connected.map_err(|error| raise(py, "ConfigError", &error.to_string(), &[]))
}

fn read(source: &Bound<'_, PyAny>) -> PyResult<Result<Config, takt::ConfigError>> {
    let py = source.py();
    if let Ok(keys) = source.cast::<PyDict>() {
        let text = toml::to_string_pretty(&value(keys, "the configuration", 0)?);
        let text = text.map_err(|error| PyTypeError::new_err(error.to_string()))?;
        return Ok(py.detach(|| Config::parse("the dictionary, as TOML", &text)));
    }
    if let Ok(text) = source.cast::<PyString>() {
        // No path has two lines, and no configuration has one.
        let text = text.to_cow()?;
        if text.contains('\n') {
            return Ok(py.detach(|| Config::parse("the text", &text)));
        }
    }
    let path: PathBuf = source.extract().map_err(|_| {
        PyTypeError::new_err(
            "a configuration is the path of a TOML file, the text of one, or a dictionary with its keys",
        )
    })?;
    Ok(py.detach(|| Config::load(&path)))
}

/// Deepest nesting of a configuration; none has half of it.
const DEEPEST: usize = 16;

/// What TOML has for it, so many levels below the top.
fn value(of: &Bound<'_, PyAny>, key: &str, depth: usize) -> PyResult<Value> {
    if depth > DEEPEST {
        let words = format!("{key}: nested more than {DEEPEST} deep; does it contain itself?");
        return Err(PyTypeError::new_err(words));
    }
    if let Ok(table) = of.cast::<PyDict>() {
        let entry = |(name, of): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let name: String = name.extract()?;
            let value = value(&of, &format!("{key}.{name}"), depth + 1)?;
            Ok((name, value))
        };
        return Ok(Value::Table(table.iter().map(entry).collect::<PyResult<_>>()?));
    }
    // A truth value is a whole number of Python as well.
    if of.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(of.extract()?));
    }
    if of.is_instance_of::<PyInt>() {
        return Ok(Value::Integer(of.extract()?));
    }
    if of.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(of.extract()?));
    }
    if of.is_instance_of::<PyString>() {
        return Ok(Value::String(of.extract()?));
    }
    if of.is_instance_of::<PyList>() || of.is_instance_of::<PyTuple>() {
        let values = of.try_iter()?.map(|of| value(&of?, key, depth + 1)).collect::<PyResult<_>>()?;
        return Ok(Value::Array(values));
    }
    // The numbers of numpy.
    match of.extract() {
        Ok(number) => Ok(Value::Float(number)),
        Err(_) => {
            Err(PyTypeError::new_err(format!("{key}: a configuration has nothing like {}", of.get_type())))
        }
    }
}
