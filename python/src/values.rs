//! TOML and JSON values as Python values.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use toml::Value;

/// `value` as Python's `tomllib` would return it; a date or a time is returned as its text.
pub(crate) fn of_toml<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::String(text) => text.into_pyobject(py)?.into_any(),
        Value::Integer(whole) => whole.into_pyobject(py)?.into_any(),
        Value::Float(number) => number.into_pyobject(py)?.into_any(),
        Value::Boolean(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
        Value::Datetime(time) => time.to_string().into_pyobject(py)?.into_any(),
        Value::Array(items) => {
            let list = PyList::empty(py);
            for item in items {
                list.append(of_toml(py, item)?)?;
            }
            list.into_any()
        }
        Value::Table(table) => {
            let all = PyDict::new(py);
            for (key, value) in table {
                all.set_item(key, of_toml(py, value)?)?;
            }
            all.into_any()
        }
    })
}

/// Converts `value` through its text.
pub(crate) fn of_json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}
