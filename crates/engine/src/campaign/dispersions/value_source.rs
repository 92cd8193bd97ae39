//! Sources of a dispersion's values: distributions, lists, files and formulas.

use sampling::distribution::{
    Correlated, Inertia, Quaternion, Scalar, Weights, compose, from_roll_pitch_yaw, in_cone, misalignment, on_sphere,
    random_rotation, roll_pitch_yaw, rotate, rotation_from_vector,
};
use toml::Value;

use super::formula::Formula;
use super::quantity::Quantity;

/// Representation of an attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AttitudeFormat {
    /// Four numbers, the scalar first.
    Quaternion,
    /// Turns about the fixed axes x, y and z in this order, in the dispersion's unit; `per_rad` of it are one radian.
    RollPitchYaw {
        /// Number of its units in one radian.
        per_rad: f64,
    },
    /// A vector to be rotated.
    Direction,
}

/// A source of values.
#[derive(Debug, Clone)]
pub enum ValueSource {
    /// A distribution of one number.
    Scalar(Scalar),
    /// Choices from a list of numbers.
    Numbers(Vec<f64>, Weights),
    /// Choices from a list of any values, with their labels in the table.
    Values(Vec<(Value, String)>, Weights),
    /// The rows of a file's column, one after the other.
    Sequence(Vec<f64>),
    /// The same with rows of text.
    TextSequence(Vec<String>),
    /// A value for all points.
    Constant(Value),
    /// A number for all points.
    Number(f64),
    /// Computed from other dispersions; the result is divided by `per_si` to be in the dispersion's unit.
    Formula(Formula, f64),
    /// Normal numbers with correlations.
    Correlated(Correlated),
    /// A vector of this length, with a uniformly random direction.
    Sphere(f64),
    /// A vector of this length within an angle (rad) of an axis.
    Cone {
        /// The length.
        length: f64,
        /// The axis.
        axis: [f64; 3],
        /// The angle, rad.
        half_angle: f64,
    },
    /// A uniformly random attitude.
    Rotation(AttitudeFormat),
    /// The scenario's own attitude or direction, rotated slightly: the standard deviation about each axis, rad.
    Misalignment(f64, AttitudeFormat),
    /// The scenario's own inertia, changed to that of another body.
    Inertia(Inertia),
}

/// The result of a draw.
#[derive(Debug, Clone, PartialEq)]
pub enum SampledValue {
    /// Numbers in the dispersion's unit.
    Numbers(Vec<f64>),
    /// Any value, with its label in the table.
    Value(Value, String),
}

impl ValueSource {
    /// Number of coordinates in (0, 1) that a draw takes.
    pub fn coordinate_count(&self) -> usize {
        match self {
            ValueSource::Scalar(_) | ValueSource::Numbers(..) | ValueSource::Values(..) => 1,
            ValueSource::Sequence(_)
            | ValueSource::TextSequence(_)
            | ValueSource::Constant(_)
            | ValueSource::Number(_)
            | ValueSource::Formula(..) => 0,
            ValueSource::Correlated(correlated) => correlated.len(),
            ValueSource::Sphere(_) | ValueSource::Cone { .. } => 2,
            ValueSource::Rotation(_) | ValueSource::Misalignment(..) => 3,
            ValueSource::Inertia(inertia) => {
                if inertia.rotation_deviation > 0.0 {
                    6
                } else {
                    3
                }
            }
        }
    }

    /// Whether it differs between points by itself.
    pub fn varies(&self) -> bool {
        self.coordinate_count() > 0 || matches!(self, ValueSource::Sequence(_) | ValueSource::TextSequence(_))
    }

    /// The number of elements that it sets at a key, where that does not depend on the key's own value; `None` for any values.
    pub fn number_count(&self) -> Option<usize> {
        match self {
            ValueSource::Values(..) | ValueSource::TextSequence(_) | ValueSource::Constant(_) => None,
            ValueSource::Correlated(correlated) => Some(correlated.len()),
            ValueSource::Sphere(_) | ValueSource::Cone { .. } => Some(3),
            ValueSource::Rotation(frame) | ValueSource::Misalignment(_, frame) => match frame {
                AttitudeFormat::Quaternion => Some(4),
                _ => Some(3),
            },
            ValueSource::Inertia(inertia) if inertia.rotation_deviation > 0.0 => Some(6),
            ValueSource::Inertia(_) => Some(3),
            _ => Some(1),
        }
    }

    /// Whether its numbers are written in brackets.
    pub fn is_list(&self) -> bool {
        self.number_count().is_some_and(|count| count > 1)
    }

    /// Whether it transforms the key's own value in a special way.
    pub fn transforms_value(&self) -> bool {
        matches!(self, ValueSource::Misalignment(..) | ValueSource::Inertia(_))
    }

    /// Number of values on a grid.
    pub fn choice_count(&self) -> Option<usize> {
        match self {
            ValueSource::Numbers(values, _) => Some(values.len()),
            ValueSource::Values(values, _) => Some(values.len()),
            _ => None,
        }
    }

    /// Value number `at` of a list.
    pub fn choice(&self, at: usize) -> Option<SampledValue> {
        match self {
            ValueSource::Numbers(values, _) => values.get(at).map(|value| SampledValue::Numbers(vec![*value])),
            ValueSource::Values(values, _) => {
                let (value, label) = values.get(at)?.clone();
                Some(SampledValue::Value(value, label))
            }
            _ => None,
        }
    }

    /// The draw of point `k`, with the coordinates `u`. `formula` returns the value of a formula.
    pub fn sample(&self, u: &[f64], k: u64, formula: &dyn Fn(&Formula) -> f64) -> SampledValue {
        let three = |from: usize| [u[from], u[from + 1], u[from + 2]];
        SampledValue::Numbers(match self {
            ValueSource::Scalar(scalar) => vec![scalar.quantile(u[0])],
            ValueSource::Numbers(values, weights) => vec![values[weights.choice(u[0])]],
            ValueSource::Values(values, weights) => {
                let (value, label) = values[weights.choice(u[0])].clone();
                return SampledValue::Value(value, label);
            }
            ValueSource::Sequence(values) => vec![values[(k % values.len() as u64) as usize]],
            ValueSource::TextSequence(values) => {
                let text = values[(k % values.len() as u64) as usize].clone();
                return SampledValue::Value(crate::scenario::value(&text), text);
            }
            ValueSource::Constant(value) => return SampledValue::Value(value.clone(), label_of(value)),
            ValueSource::Number(number) => vec![*number],
            ValueSource::Formula(read, per_si) => vec![formula(read) / per_si],
            ValueSource::Correlated(correlated) => correlated.quantile(u),
            ValueSource::Sphere(length) => on_sphere([u[0], u[1]]).map(|x| length * x).to_vec(),
            ValueSource::Cone {
                length,
                axis,
                half_angle,
            } => in_cone(*axis, *half_angle, [u[0], u[1]]).map(|x| length * x).to_vec(),
            ValueSource::Rotation(frame) => format_attitude(random_rotation(three(0)), *frame),
            ValueSource::Misalignment(deviation, _) => misalignment(*deviation, three(0)).to_vec(),
            // How the draw is applied depends on the body.
            ValueSource::Inertia(_) => u.to_vec(),
        })
    }

    /// The value that a draw makes of the key's own one, where the draw rotates it.
    pub fn transformed(&self, current: &Quantity, draw: &[f64]) -> Option<Vec<f64>> {
        let three = |of: &[f64]| [of[0], of[1], of[2]];
        match self {
            ValueSource::Misalignment(_, frame) => {
                let turn = rotation_from_vector(three(draw));
                Some(match frame {
                    AttitudeFormat::Direction => rotate(turn, three(&current.numbers)).to_vec(),
                    _ => format_attitude(compose(turn, parse_attitude(&current.numbers, *frame)), *frame),
                })
            }
            ValueSource::Inertia(inertia) if current.numbers.len() == 6 => {
                let six: [f64; 6] = std::array::from_fn(|at| current.numbers[at]);
                // Without a rotation there are three numbers; the median of a rotation is the identity.
                let u: [f64; 6] = std::array::from_fn(|at| draw.get(at).copied().unwrap_or(0.5));
                Some(inertia.matrix(six, u).to_vec())
            }
            ValueSource::Inertia(inertia) => Some(inertia.moments(three(&current.numbers), three(draw)).to_vec()),
            _ => None,
        }
    }
}

/// Writes an attitude in its representation.
fn format_attitude(q: Quaternion, frame: AttitudeFormat) -> Vec<f64> {
    match frame {
        AttitudeFormat::RollPitchYaw { per_rad } => roll_pitch_yaw(q).map(|angle| angle * per_rad).to_vec(),
        _ => q.to_vec(),
    }
}

/// Reads an attitude from its representation.
fn parse_attitude(numbers: &[f64], frame: AttitudeFormat) -> Quaternion {
    match frame {
        AttitudeFormat::RollPitchYaw { per_rad } => {
            from_roll_pitch_yaw([numbers[0] / per_rad, numbers[1] / per_rad, numbers[2] / per_rad])
        }
        _ => [numbers[0], numbers[1], numbers[2], numbers[3]],
    }
}

/// The label of a value in the table: texts without quotes.
pub fn label_of(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
