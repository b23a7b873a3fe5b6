//! Arrays of numpy, in and out. They cross the border as bytes, by `numpy.ascontiguousarray` and `numpy.frombuffer`: a copy of a few
//! hundred bytes, and no dependence on the version of numpy.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyByteArray, PyBytes};

static NUMPY: PyOnceLock<Py<PyModule>> = PyOnceLock::new();

fn numpy(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    let module = NUMPY.get_or_try_init(py, || py.import("numpy").map(Bound::unbind))?;
    Ok(module.bind(py))
}

/// Numbers in rows of equal length.
pub struct Table {
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f64>,
}

impl Table {
    /// The rows.
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        // A table without columns has empty rows.
        (0..self.rows).map(|row| self.values.get(row * self.columns..(row + 1) * self.columns).unwrap_or(&[]))
    }
}

/// Anything that numpy takes for an array of numbers, with its shape.
fn numbers(value: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f64>)> {
    let array = numpy(value.py())?.call_method1("ascontiguousarray", (value, "f8"))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let bytes = array.call_method0("tobytes")?;
    let bytes = bytes.cast::<PyBytes>()?.as_bytes();
    let (numbers, _) = bytes.as_chunks::<8>();
    Ok((shape, numbers.iter().map(|number| f64::from_ne_bytes(*number)).collect()))
}

/// A number for each axis. How many there are is checked by whoever takes them.
pub fn vector(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    match numbers(value)? {
        (shape, values) if shape.len() == 1 => Ok(values),
        (shape, _) => Err(PyValueError::new_err(format!(
            "{what} is one number for each axis, and has the shape {shape:?}"
        ))),
    }
}

/// A number for each of so many axes, or one for all of them.
pub fn vector_or_one(what: &str, value: &Bound<'_, PyAny>, axes: usize) -> PyResult<Vec<f64>> {
    match vector(what, value)? {
        values if values.len() == axes => Ok(values),
        values => match values[..] {
            [one] => Ok(vec![one; axes]),
            _ => Err(PyValueError::new_err(format!("{what} has {} values for {axes} axes", values.len()))),
        },
    }
}

/// A row for each point, with a number for each axis.
pub fn table(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Table> {
    let (shape, values) = numbers(value)?;
    match shape[..] {
        [rows, columns] => Ok(Table { rows, columns, values }),
        _ => Err(PyValueError::new_err(format!(
            "{what} has a row for each point and a column for each axis; it has the shape {shape:?}"
        ))),
    }
}

/// An array of numbers of its own.
pub fn array<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    // Only a byte array gives an array that may be written to.
    let bytes = PyByteArray::new_with(py, size_of_val(values), |bytes| {
        for (place, value) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(values) {
            *place = value.to_ne_bytes();
        }
        Ok(())
    })?;
    from_buffer(py, bytes, "f8")
}

/// An array of so many rows of equal length.
pub fn array_of_rows<'py>(py: Python<'py>, values: &[f64], columns: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len().checked_div(columns).unwrap_or(0);
    array(py, values)?.call_method1("reshape", (rows, columns))
}

/// An array of truth values.
pub fn array_of_bools<'py>(py: Python<'py>, values: &[bool]) -> PyResult<Bound<'py, PyAny>> {
    let values: Vec<u8> = values.iter().map(|value| u8::from(*value)).collect();
    from_buffer(py, PyByteArray::new(py, &values), "?")
}

fn from_buffer<'py>(
    py: Python<'py>,
    bytes: Bound<'py, PyByteArray>,
    kind: &str,
) -> PyResult<Bound<'py, PyAny>> {
    numpy(py)?.call_method1("frombuffer", (bytes, kind))
}
