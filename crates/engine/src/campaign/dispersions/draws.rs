//! Where the values of a dispersion come from: distributions, lists, files and formulas.

use sampling::distribution::{
    Correlated, Inertia, Quaternion, Scalar, Weights, compose, from_roll_pitch_yaw, in_cone, misalignment, on_sphere,
    random_rotation, roll_pitch_yaw, rotate, small_rotation,
};
use toml::Value;

use super::formula::Formula;
use super::quantity::Quantity;

/// How an attitude is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Frame {
    /// Four numbers, the scalar first.
    Quaternion,
    /// Turns about the fixed axes x, y and z in this order, in the dispersion's unit; `per_rad` of it are one radian.
    RollPitchYaw {
        /// How many of its units are one radian.
        per_rad: f64,
    },
    /// A vector that is turned.
    Direction,
}

/// Where values come from.
#[derive(Debug, Clone)]
pub enum Draws {
    /// A distribution of one number.
    Scalar(Scalar),
    /// Some of a list: numbers.
    Numbers(Vec<f64>, Weights),
    /// Some of a list: any values, with what the table calls them.
    Values(Vec<(Value, String)>, Weights),
    /// The rows of a file's column one after the other.
    InTurn(Vec<f64>),
    /// The same with rows that are texts.
    TextsInTurn(Vec<String>),
    /// A value for all points.
    Constant(Value),
    /// A number for all points.
    Number(f64),
    /// Computed from other dispersions; the result is divided by `per_si` to be in the dispersion's unit.
    Formula(Formula, f64),
    /// Normal numbers with correlations.
    Correlated(Correlated),
    /// A vector of this length, in any direction.
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
    /// Any attitude.
    Rotation(Frame),
    /// The scenario's own attitude or direction, turned a little: the standard deviation about each axis, rad.
    Misalignment(f64, Frame),
    /// The scenario's own inertia, of another body.
    Inertia(Inertia),
}

/// What was drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Drawn {
    /// Numbers in the dispersion's unit.
    Numbers(Vec<f64>),
    /// Any value, with what the table calls it.
    Value(Value, String),
}

impl Draws {
    /// How many numbers in (0, 1) a draw takes.
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

    /// Whether points differ in it by themselves.
    pub fn varies(&self) -> bool {
        self.coordinates() > 0 || matches!(self, Draws::InTurn(_) | Draws::TextsInTurn(_))
    }

    /// How many numbers it gives a key, where that does not depend on the key's own value; `None` for any values.
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

    /// Whether its numbers stand in brackets.
    pub fn listed(&self) -> bool {
        self.numbers().is_some_and(|numbers| numbers > 1)
    }

    /// Whether it is made of the key's own value in a way of its own.
    pub fn turns(&self) -> bool {
        matches!(self, Draws::Misalignment(..) | Draws::Inertia(_))
    }

    /// How many values it takes on a grid.
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

    /// The draw of point `k`, which the numbers `u` belong to. `formula` gives the value of a formula.
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
            // What becomes of it depends on the body.
            Draws::Inertia(_) => u.to_vec(),
        })
    }

    /// The value that a draw makes of the key's own one, where it turns that.
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
                // Without a turn there are three numbers; the median of a turn is none.
                let u: [f64; 6] = std::array::from_fn(|at| draw.get(at).copied().unwrap_or(0.5));
                Some(inertia.matrix(six, u).to_vec())
            }
            Draws::Inertia(inertia) => Some(inertia.moments(three(&own.numbers), three(draw)).to_vec()),
            _ => None,
        }
    }
}

/// An attitude as it is written.
fn written(q: Quaternion, frame: Frame) -> Vec<f64> {
    match frame {
        Frame::RollPitchYaw { per_rad } => roll_pitch_yaw(q).map(|angle| angle * per_rad).to_vec(),
        _ => q.to_vec(),
    }
}

/// What was written, as an attitude.
fn attitude(numbers: &[f64], frame: Frame) -> Quaternion {
    match frame {
        Frame::RollPitchYaw { per_rad } => {
            from_roll_pitch_yaw([numbers[0] / per_rad, numbers[1] / per_rad, numbers[2] / per_rad])
        }
        _ => [numbers[0], numbers[1], numbers[2], numbers[3]],
    }
}

/// A value as the table calls it: texts without quotes.
pub fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
