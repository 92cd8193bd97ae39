//! Evaluation of formulas on the records of their streams.

use std::sync::Arc;

use super::Computed;
use super::signal::Slice;

/// Elements of a field, and the index of their stream among those of the binding.
pub(crate) type Operand = (usize, Slice);

/// A formula bound to the fields of streams.
#[derive(Clone)]
pub(crate) enum Evaluate {
    Each(Operand),
    Difference(Operand, Operand),
    Norm(Operand),
    Distance(Operand, Operand),
    Angle(Operand, Operand),
    PositionIn(Operand, Operand, Operand),
    AttitudeIn(Operand, Operand),
    RotationVector(Operand),
    Computed(Arc<dyn Computed>),
}

impl Evaluate {
    /// Writes the curves at one instant to `out`, from the payloads of the streams there; NaN where a stream has none yet.
    pub(crate) fn run(&self, payloads: &[Option<&[u8]>], out: &mut [f64]) {
        if self.values(payloads, out).is_none() {
            out.fill(f64::NAN);
        }
    }

    fn values(&self, payloads: &[Option<&[u8]>], out: &mut [f64]) -> Option<()> {
        let payload = |operand: &Operand| payloads.get(operand.0).copied().flatten();
        let list = |operand: &Operand| {
            let payload = payload(operand)?;
            Some(
                (0..operand.1.len)
                    .map(|i| operand.1.value(payload, i))
                    .collect::<Vec<f64>>(),
            )
        };
        let quaternion = |operand: &Operand| Some(operand.1.four(payload(operand)?));
        match self {
            Evaluate::Each(a) => {
                let payload = payload(a)?;
                for (i, y) in out.iter_mut().enumerate() {
                    *y = a.1.value(payload, i);
                }
            }
            Evaluate::Difference(a, b) => {
                let (pa, pb) = (payload(a)?, payload(b)?);
                for (i, y) in out.iter_mut().enumerate() {
                    *y = a.1.value(pa, i) - b.1.value(pb, i);
                }
            }
            Evaluate::Norm(a) => {
                let squares = list(a)?.into_iter().map(|x| x.powi(2));
                out[0] = squares.sum::<f64>().sqrt();
            }
            Evaluate::Distance(a, b) => {
                let squares = list(a)?.into_iter().zip(list(b)?).map(|(a, b)| (a - b).powi(2));
                out[0] = squares.sum::<f64>().sqrt();
            }
            Evaluate::Angle(a, b) => {
                let vector = rotation_vector(product(conjugate(quaternion(a)?), quaternion(b)?));
                out[0] = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
            }
            Evaluate::PositionIn(p, origin, axes) => {
                let (p, origin) = (list(p)?, list(origin)?);
                let apart = std::array::from_fn(|i| p[i] - origin[i]);
                out.copy_from_slice(&rotate_inverse(quaternion(axes)?, apart));
            }
            Evaluate::AttitudeIn(attitude, axes) => {
                let [w, x, y, z] = product(conjugate(quaternion(axes)?), quaternion(attitude)?);
                // q and -q are the same attitude; the shorter rotation has a non-negative scalar part.
                let sign = if w < 0.0 { -1.0 } else { 1.0 };
                out.copy_from_slice(&[x, y, z].map(|part| sign * part));
            }
            Evaluate::Computed(computed) => computed.values(payloads.first().copied().flatten()?, out),
            Evaluate::RotationVector(a) => out.copy_from_slice(&rotation_vector(quaternion(a)?)),
        }
        Some(())
    }

    /// Maps the operands to the indices of their streams in another binding.
    pub(crate) fn remap_streams(&mut self, indices: &[usize]) {
        let operands: Vec<&mut Operand> = match self {
            Evaluate::Each(a) | Evaluate::Norm(a) | Evaluate::RotationVector(a) => vec![a],
            Evaluate::Difference(a, b)
            | Evaluate::Distance(a, b)
            | Evaluate::Angle(a, b)
            | Evaluate::AttitudeIn(a, b) => vec![a, b],
            Evaluate::PositionIn(a, b, c) => vec![a, b, c],
            Evaluate::Computed(_) => Vec::new(),
        };
        for operand in operands {
            operand.0 = indices[operand.0];
        }
    }

    /// Whether it is so expensive that a long stream is evaluated at some instants only.
    pub(crate) fn is_slow(&self) -> bool {
        matches!(self, Evaluate::Computed(_))
    }
}

fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// Transforms a vector from world components to components in the frame of this attitude.
fn rotate_inverse(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [_, x, y, z] = product(product(conjugate(q), [0.0, x, y, z]), q);
    [x, y, z]
}

fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The rotation vector of the shorter rotation, rad. The two-argument arctangent keeps small angles exact, where the
/// arccosine of the scalar part would lose half the digits.
fn rotation_vector(q: [f64; 4]) -> [f64; 3] {
    let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
    let sine = (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let factor = if sine == 0.0 {
        0.0
    } else {
        2.0 * sine.atan2(q[0].abs()) / sine
    };
    [q[1], q[2], q[3]].map(|x| sign * factor * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vector_keeps_digits_of_small_angles() {
        let angle = 1e-9_f64;
        let q = [(angle / 2.0).cos(), 0.0, (angle / 2.0).sin(), 0.0];
        assert!((rotation_vector(q)[1] - angle).abs() < 1e-24);
        assert!((rotation_vector(q.map(|x| -x))[1] - angle).abs() < 1e-24);
        assert_eq!(rotation_vector([1.0, 0.0, 0.0, 0.0]), [0.0; 3]);
    }

    #[test]
    fn inverse_rotation_by_quarter_turn_swaps_axes() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let quarter = [half, 0.0, 0.0, half];
        let seen = rotate_inverse(quarter, [3.0, 0.0, 5.0]);
        let expected = [0.0, -3.0, 5.0];
        assert!(
            seen.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15),
            "{seen:?}"
        );
    }
}
