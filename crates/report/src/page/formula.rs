//! What the rows of the table compute from the fields of a record.

use lockstep::port::Field;

use super::momenta::{Momenta, Share};
use super::table::{Formula, Names};
use tape::StreamSpec;

/// A formula bound to the fields of a stream.
pub(super) enum Evaluate {
    Part(Field, usize),
    Norm(Field),
    Distance(Field, Field),
    Angle(Field, Field),
    PositionIn(Field, Field, Field),
    AttitudeIn(Field, Field),
    RotationVector(Field),
    Bodies(Box<Momenta>, Vec<Share>),
}

impl Evaluate {
    /// The curves of one record into `out`.
    pub(super) fn run(&self, payload: &[u8], out: &mut [f64]) {
        let quaternion = |field: &Field| std::array::from_fn::<f64, 4, _>(|i| field.value(payload, i));
        match self {
            Evaluate::Part(field, from) => {
                for (i, y) in out.iter_mut().enumerate() {
                    *y = field.value(payload, from + i);
                }
            }
            Evaluate::Norm(field) => {
                let squares = (0..field.len()).map(|i| field.value(payload, i).powi(2));
                out[0] = squares.sum::<f64>().sqrt();
            }
            Evaluate::Distance(a, b) => {
                let squares = (0..a.len()).map(|i| (a.value(payload, i) - b.value(payload, i)).powi(2));
                out[0] = squares.sum::<f64>().sqrt();
            }
            Evaluate::Angle(a, b) => {
                let vector = rotation_vector(product(conjugate(quaternion(a)), quaternion(b)));
                out[0] = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
            }
            Evaluate::PositionIn(p, origin, axes) => {
                let apart = std::array::from_fn(|i| p.value(payload, i) - origin.value(payload, i));
                out.copy_from_slice(&turned_back(quaternion(axes), apart));
            }
            Evaluate::AttitudeIn(attitude, axes) => {
                let [w, x, y, z] = product(conjugate(quaternion(axes)), quaternion(attitude));
                // Both signs are the same attitude; the shorter turn has a scalar part that is not negative.
                let sign = if w < 0.0 { -1.0 } else { 1.0 };
                out.copy_from_slice(&[x, y, z].map(|part| sign * part));
            }
            Evaluate::Bodies(momenta, shares) => momenta.values(shares, payload, out),
            Evaluate::RotationVector(field) => out.copy_from_slice(&rotation_vector(quaternion(field))),
        }
    }
}

fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// A vector with world components as components in the frame of this attitude.
fn turned_back(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
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

/// Axis times angle of the shorter turn, rad. The arctangent of two arguments keeps small angles exact, where the
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

/// The field of `spec` under one of its names, with at least `least` elements.
pub(crate) fn find(spec: &StreamSpec, names: Names, least: usize) -> Option<&Field> {
    let mut found = names.iter().filter_map(|name| spec.descriptor.field(name));
    found.find(|field| field.len() >= least)
}

/// What a formula needs of `spec`, how many curves it gives, and where they come from; `None` when a field is missing.
pub(super) fn bind(spec: &StreamSpec, formula: Formula) -> Option<(Evaluate, usize, String)> {
    let named = |field: &Field| format!("{}.{}", spec.name(), field.name);
    Some(match formula {
        Formula::Each(names) => {
            let field = find(spec, names, 1)?;
            (Evaluate::Part(field.clone(), 0), field.len(), named(field))
        }
        Formula::Part(names, from, to) => {
            let field = find(spec, names, to)?;
            (Evaluate::Part(field.clone(), from), to - from, named(field))
        }
        Formula::Norm(names) => {
            let field = find(spec, names, 1)?;
            (Evaluate::Norm(field.clone()), 1, named(field))
        }
        Formula::Distance(a, b) => {
            let (a, b) = (find(spec, a, 3)?, find(spec, b, 3)?);
            let origin = format!("{}, {}", named(a), b.name);
            (a.len() == b.len()).then(|| (Evaluate::Distance(a.clone(), b.clone()), 1, origin))?
        }
        Formula::Angle(a, b) => {
            let (a, b) = (find(spec, a, 4)?, find(spec, b, 4)?);
            let origin = format!("{}, {}", named(a), b.name);
            (Evaluate::Angle(a.clone(), b.clone()), 1, origin)
        }
        Formula::PositionIn(p, origin, axes) => {
            let (p, origin, axes) = (find(spec, p, 3)?, find(spec, origin, 3)?, find(spec, axes, 4)?);
            let names = format!("{}, {}, {}", named(p), origin.name, axes.name);
            (Evaluate::PositionIn(p.clone(), origin.clone(), axes.clone()), 3, names)
        }
        Formula::AttitudeIn(attitude, axes) => {
            let (attitude, axes) = (find(spec, attitude, 4)?, find(spec, axes, 4)?);
            let names = format!("{}, {}", named(attitude), axes.name);
            (Evaluate::AttitudeIn(attitude.clone(), axes.clone()), 3, names)
        }
        Formula::RotationVector(names) => {
            let field = find(spec, names, 4)?;
            (Evaluate::RotationVector(field.clone()), 3, named(field))
        }
        // Bound all together.
        Formula::Bodies(_) => return None,
    })
}

/// One label for each of `count` curves.
pub(super) fn labels(given: &[&str], count: usize) -> Vec<String> {
    let axes = ["x", "y", "z"];
    (0..count)
        .map(|i| match given.get(i) {
            Some(label) => (*label).to_owned(),
            None if count == 3 => axes[i].to_owned(),
            None if count == 1 => String::new(),
            None => format!("{}", i + 1),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_angles_keep_their_digits() {
        let angle = 1e-9_f64;
        let q = [(angle / 2.0).cos(), 0.0, (angle / 2.0).sin(), 0.0];
        assert!((rotation_vector(q)[1] - angle).abs() < 1e-24);
        assert!((rotation_vector(q.map(|x| -x))[1] - angle).abs() < 1e-24);
        assert_eq!(rotation_vector([1.0, 0.0, 0.0, 0.0]), [0.0; 3]);
    }

    #[test]
    fn quarter_turn_about_z_swaps_the_axes() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let quarter = [half, 0.0, 0.0, half];
        let seen = turned_back(quarter, [3.0, 0.0, 5.0]);
        let expected = [0.0, -3.0, 5.0];
        assert!(
            seen.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15),
            "{seen:?}"
        );
    }
}
