//! Sources of a dispersion's values: distributions, lists, files and formulas.

use sampling::distribution::{
    Correlated, Inertia, Quaternion, Scalar, Weights, compose, from_roll_pitch_yaw, in_cone, misalignment, on_sphere,
    random_rotation, roll_pitch_yaw, rotate, small_rotation,
};
use toml::Value;

use super::formula::Formula;
use super::quantity::Quantity;

/// Representation of an attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Frame {
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
pub enum Draws {
    /// A distribution of one number.
    Scalar(Scalar),
    /// Choices from a list of numbers.
    Numbers(Vec<f64>, Weights),
    /// Choices from a list of any values, with their labels in the table.
    Values(Vec<(Value, String)>, Weights),
    /// The rows of a file's column, one after the other.
    InTurn(Vec<f64>),
    /// The same with rows of text.
    TextsInTurn(Vec<String>),
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
    Rotation(Frame),
    /// The scenario's own attitude or direction, rotated slightly: the standard deviation about each axis, rad.
    Misalignment(f64, Frame),
    /// The scenario's own inertia, changed to that of another body.
    Inertia(Inertia),
}

/// The result of a draw.
#[derive(Debug, Clone, PartialEq)]
pub enum Drawn {
    /// Numbers in the dispersion's unit.
    Numbers(Vec<f64>),
    /// Any value, with its label in the table.
    Value(Value, String),
}

impl Draws {
    /// Number of coordinates in (0, 1) that a draw takes.
    pub fn coordinates(&self) -> usize {
        match self {
            Draws::Scalar(_) | Draws::Numbers(..) | Draws::Values(..) => 1,
            Draws::InTurn(_) | Draws::TextsInTurn(_) | Draws::Constant(_) | Draws::Number(_) | Draws::Formula(..) => 0,
            Draws::Correlated(correlated) => correlated.len(),
            Draws::Sphere(_) | Draws::Cone { .. } => 2,
            Draws::Rotation(_) | Draws::Misalignment(..) => 3,
            Draws::Inertia(inertia) => {
                if inertia.turn > 0.0 {
                    6
                } else {
                    3
                }
            }
        }
    }

    /// Whether it differs between points by itself.
    pub fn varies(&self) -> bool {
        self.coordinates() > 0 || matches!(self, Draws::InTurn(_) | Draws::TextsInTurn(_))
    }

    /// The number of numbers that it gives a key, where that does not depend on the key's own value; `None` for any values.
    pub fn numbers(&self) -> Option<usize> {
        match self {
            Draws::Values(..) | Draws::TextsInTurn(_) | Draws::Constant(_) => None,
            Draws::Correlated(correlated) => Some(correlated.len()),
            Draws::Sphere(_) | Draws::Cone { .. } => Some(3),
            Draws::Rotation(frame) | Draws::Misalignment(_, frame) => match frame {
                Frame::Quaternion => Some(4),
                _ => Some(3),
            },
            Draws::Inertia(inertia) if inertia.turn > 0.0 => Some(6),
            Draws::Inertia(_) => Some(3),
            _ => Some(1),
        }
    }

    /// Whether its numbers are written in brackets.
    pub fn listed(&self) -> bool {
        self.numbers().is_some_and(|numbers| numbers > 1)
    }

    /// Whether it transforms the key's own value in a special way.
    pub fn turns(&self) -> bool {
        matches!(self, Draws::Misalignment(..) | Draws::Inertia(_))
    }

    /// Number of values on a grid.
    pub fn choices(&self) -> Option<usize> {
        match self {
            Draws::Numbers(values, _) => Some(values.len()),
            Draws::Values(values, _) => Some(values.len()),
            _ => None,
        }
    }

    /// Value number `at` of a list.
    pub fn choice(&self, at: usize) -> Option<Drawn> {
        match self {
            Draws::Numbers(values, _) => values.get(at).map(|value| Drawn::Numbers(vec![*value])),
            Draws::Values(values, _) => {
                let (value, label) = values.get(at)?.clone();
                Some(Drawn::Value(value, label))
            }
            _ => None,
        }
    }

    /// The draw of point `k`, with the coordinates `u`. `formula` returns the value of a formula.
    pub fn draw(&self, u: &[f64], k: u64, formula: &dyn Fn(&Formula) -> f64) -> Drawn {
        let three = |from: usize| [u[from], u[from + 1], u[from + 2]];
        Drawn::Numbers(match self {
            Draws::Scalar(scalar) => vec![scalar.quantile(u[0])],
            Draws::Numbers(values, weights) => vec![values[weights.choice(u[0])]],
            Draws::Values(values, weights) => {
                let (value, label) = values[weights.choice(u[0])].clone();
                return Drawn::Value(value, label);
            }
            Draws::InTurn(values) => vec![values[(k % values.len() as u64) as usize]],
            Draws::TextsInTurn(values) => {
                let text = values[(k % values.len() as u64) as usize].clone();
                return Drawn::Value(crate::scenario::value(&text), text);
            }
            Draws::Constant(value) => return Drawn::Value(value.clone(), plain(value)),
            Draws::Number(number) => vec![*number],
            Draws::Formula(read, per_si) => vec![formula(read) / per_si],
            Draws::Correlated(correlated) => correlated.quantile(u),
            Draws::Sphere(length) => on_sphere([u[0], u[1]]).map(|x| length * x).to_vec(),
            Draws::Cone {
                length,
                axis,
                half_angle,
            } => in_cone(*axis, *half_angle, [u[0], u[1]]).map(|x| length * x).to_vec(),
            Draws::Rotation(frame) => written(random_rotation(three(0)), *frame),
            Draws::Misalignment(deviation, _) => misalignment(*deviation, three(0)).to_vec(),
            // How the draw is applied depends on the body.
            Draws::Inertia(_) => u.to_vec(),
        })
    }

    /// The value that a draw makes of the key's own one, where the draw rotates it.
    pub fn turned(&self, own: &Quantity, draw: &[f64]) -> Option<Vec<f64>> {
        let three = |of: &[f64]| [of[0], of[1], of[2]];
        match self {
            Draws::Misalignment(_, frame) => {
                let turn = small_rotation(three(draw));
                Some(match frame {
                    Frame::Direction => rotate(turn, three(&own.numbers)).to_vec(),
                    _ => written(compose(turn, attitude(&own.numbers, *frame)), *frame),
                })
            }
            Draws::Inertia(inertia) if own.numbers.len() == 6 => {
                let six: [f64; 6] = std::array::from_fn(|at| own.numbers[at]);
                // Without a rotation there are three numbers; the median of a rotation is the identity.
                let u: [f64; 6] = std::array::from_fn(|at| draw.get(at).copied().unwrap_or(0.5));
                Some(inertia.matrix(six, u).to_vec())
            }
            Draws::Inertia(inertia) => Some(inertia.moments(three(&own.numbers), three(draw)).to_vec()),
            _ => None,
        }
    }
}

/// Writes an attitude in its representation.
fn written(q: Quaternion, frame: Frame) -> Vec<f64> {
    match frame {
        Frame::RollPitchYaw { per_rad } => roll_pitch_yaw(q).map(|angle| angle * per_rad).to_vec(),
        _ => q.to_vec(),
    }
}

/// Reads an attitude from its representation.
fn attitude(numbers: &[f64], frame: Frame) -> Quaternion {
    match frame {
        Frame::RollPitchYaw { per_rad } => {
            from_roll_pitch_yaw([numbers[0] / per_rad, numbers[1] / per_rad, numbers[2] / per_rad])
        }
        _ => [numbers[0], numbers[1], numbers[2], numbers[3]],
    }
}

/// The label of a value in the table: texts without quotes.
pub fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
