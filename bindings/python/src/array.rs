//! Arrays of numpy, in and out. They cross the border as bytes, by `numpy.ascontiguousarray` and `numpy.frombuffer`: a copy of a few
//! hundred bytes, and no dependence on the version of numpy.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyByteArray, PyBytes, PyTuple};

use crate::error::raise_argument;

/// The functions and types of numpy that are called, found once.
struct Numpy {
    ascontiguousarray: Py<PyAny>,
    frombuffer: Py<PyAny>,
    number: Py<PyAny>,
    truth: Py<PyAny>,
}

static NUMPY: PyOnceLock<Numpy> = PyOnceLock::new();

fn numpy(py: Python<'_>) -> PyResult<&Numpy> {
    NUMPY.get_or_try_init(py, || {
        let module = py.import("numpy")?;
        let function = |name| Ok::<_, PyErr>(module.getattr(name)?.unbind());
        let kind = |name| Ok::<_, PyErr>(module.call_method1("dtype", (name,))?.unbind());
        Ok(Numpy {
            ascontiguousarray: function("ascontiguousarray")?,
            frombuffer: function("frombuffer")?,
            number: kind("f8")?,
            truth: kind("?")?,
        })
    })
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
fn numbers(what: &str, value: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f64>)> {
    let py = value.py();
    let numpy = numpy(py)?;
    let array = numpy.ascontiguousarray.bind(py).call1((value, &numpy.number));
    let array = array.map_err(|error| {
        let is_of_the_value =
            error.is_instance_of::<PyValueError>(py) || error.is_instance_of::<PyTypeError>(py);
        // Numpy does not know which of the arguments it is.
        if is_of_the_value { raise_argument(py, &format!("{what}: {}", error.value(py))) } else { error }
    })?;
    let shape = array.getattr(intern!(py, "shape"))?;
    let shape = shape.cast::<PyTuple>()?.iter().map(|length| length.extract()).collect::<PyResult<_>>()?;
    let bytes = array.call_method0(intern!(py, "tobytes"))?;
    let bytes = bytes.cast::<PyBytes>()?.as_bytes();
    let (numbers, _) = bytes.as_chunks::<8>();
    Ok((shape, numbers.iter().map(|number| f64::from_ne_bytes(*number)).collect()))
}

/// A number for each axis. How many there are is checked by whoever takes them.
pub fn vector(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    match numbers(what, value)? {
        (shape, values) if shape.len() == 1 => Ok(values),
        (shape, _) => {
            let words = format!("{what} is one number for each axis, and has the shape {}", shown(&shape));
            Err(raise_argument(value.py(), &words))
        }
    }
}

/// A number for each of so many axes, or one for all of them.
pub fn vector_or_one(what: &str, value: &Bound<'_, PyAny>, axes: usize) -> PyResult<Vec<f64>> {
    match vector(what, value)? {
        values if values.len() == axes => Ok(values),
        values => match values[..] {
            [one] => Ok(vec![one; axes]),
            _ => {
                let words = format!("{what} has {} values for {axes} axes", values.len());
                Err(raise_argument(value.py(), &words))
            }
        },
    }
}

/// A row for each point, with a number for each axis.
pub fn table(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Table> {
    let (shape, values) = numbers(what, value)?;
    match shape[..] {
        [rows, columns] => Ok(Table { rows, columns, values }),
        _ => {
            let words = format!(
                "{what} has a row for each point and a column for each axis, and was given with the shape {}",
                shown(&shape)
            );
            Err(raise_argument(value.py(), &words))
        }
    }
}

/// A shape, as Python shows it.
fn shown(shape: &[usize]) -> String {
    match shape {
        [length] => format!("({length},)"),
        shape => {
            let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", lengths.join(", "))
        }
    }
}

/// An array of numbers of its own.
pub fn array<'py>(
    py: Python<'py>,
    values: impl ExactSizeIterator<Item = f64>,
) -> PyResult<Bound<'py, PyAny>> {
    // Only a byte array gives an array that may be written to.
    let bytes = PyByteArray::new_with(py, values.len() * size_of::<f64>(), |bytes| {
        for (place, value) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(values) {
            *place = value.to_ne_bytes();
        }
        Ok(())
    })?;
    from_buffer(py, bytes, &numpy(py)?.number)
}

/// An array of so many rows of equal length.
pub fn array_of_rows<'py>(py: Python<'py>, values: &[f64], columns: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len().checked_div(columns).unwrap_or(0);
    array(py, values.iter().copied())?.call_method1("reshape", (rows, columns))
}

/// An array of truth values.
pub fn array_of_bools<'py>(
    py: Python<'py>,
    values: impl Iterator<Item = bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let values: Vec<u8> = values.map(u8::from).collect();
    from_buffer(py, PyByteArray::new(py, &values), &numpy(py)?.truth)
}

fn from_buffer<'py>(
    py: Python<'py>,
    bytes: Bound<'py, PyByteArray>,
    kind: &Py<PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    numpy(py)?.frombuffer.bind(py).call1((bytes, kind))
}
