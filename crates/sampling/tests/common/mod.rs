//! Reference values computed with SciPy.
#![allow(dead_code, reason = "each test uses some of it")]

use serde_json::Value;

pub fn scipy() -> Value {
    serde_json::from_str(include_str!("../data/scipy.json")).unwrap()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one.as_f64().unwrap())
        .collect()
}
