//! Signals: from payloads to numbers.

use lockstep::fault::Slot;

/// Elements of the payload of a stream.
#[derive(Debug, Clone)]
pub struct Reading {
    /// The stream's number.
    pub stream: usize,
    /// The elements.
    pub slots: Vec<Slot>,
    /// The value of an enumeration to compare with: an element is then 1 where it has this value, and 0 elsewhere.
    pub is: Option<f64>,
}

impl Reading {
    /// Appends the elements of `payload` to `out`. Integers become doubles: those beyond 2^53 are rounded.
    pub(super) fn read(&self, payload: &[u8], out: &mut impl Extend<f64>) {
        let value = |slot: &Slot| match self.is {
            Some(is) => f64::from(u8::from(slot.value(payload) == is)),
            None => slot.value(payload),
        };
        out.extend(self.slots.iter().map(value));
    }
}

/// The reduction of the elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Through {
    /// Each is a signal of its own.
    Elements,
    /// The Euclidean norm of all.
    Norm,
    /// The rotation angle of an attitude (a quaternion, scalar first), or between two of them, rad.
    Angle,
}

/// The signals at one instant, from the elements `of`, less `minus` times `factor` where given; written to `out`.
pub(super) fn evaluate(through: Through, of: &[f64], minus: Option<(&[f64], f64)>, out: &mut Vec<f64>) {
    out.clear();
    if through == Through::Angle {
        let identity = [1.0, 0.0, 0.0, 0.0];
        let other = minus.map_or(&identity[..], |(minus, _)| minus);
        out.push(angle(of, other));
        return;
    }
    match minus {
        Some((minus, factor)) => out.extend(of.iter().zip(minus).map(|(x, y)| x - y * factor)),
        None => out.extend(of),
    }
    if through == Through::Norm {
        let squares: f64 = out.iter().map(|x| x * x).sum();
        out.clear();
        out.push(squares.sqrt());
    }
}

/// The angle between two attitudes, at most pi; NaN for quaternions that are zero or not finite, which are no rotations.
/// The quaternions need not be normalised.
fn angle(p: &[f64], q: &[f64]) -> f64 {
    // Infinite products would yield an angle.
    if p.iter().chain(q).any(|x| !x.is_finite()) {
        return f64::NAN;
    }
    let ([p0, p1, p2, p3], [q0, q1, q2, q3]) = ([p[0], p[1], p[2], p[3]], [q[0], q[1], q[2], q[3]]);
    // The product of the conjugate of p with q.
    let scalar = p0 * q0 + p1 * q1 + p2 * q2 + p3 * q3;
    let vector = [
        p0 * q1 - p1 * q0 - p2 * q3 + p3 * q2,
        p0 * q2 - p2 * q0 - p3 * q1 + p1 * q3,
        p0 * q3 - p3 * q0 - p1 * q2 + p2 * q1,
    ];
    let sine = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if scalar == 0.0 && sine == 0.0 {
        return f64::NAN;
    }
    // An attitude and its negative are the same rotation.
    2.0 * libm::atan2(sine, scalar.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(through: Through, of: &[f64], minus: Option<&[f64]>) -> Vec<f64> {
        let mut out = Vec::new();
        evaluate(through, of, minus.map(|minus| (minus, 1.0)), &mut out);
        out
    }

    #[test]
    fn signal_of_difference_and_norm_is_exact() {
        assert_eq!(one(Through::Elements, &[3.0, 4.0], Some(&[1.0, 1.0])), [2.0, 3.0]);
        assert_eq!(one(Through::Norm, &[3.0, 4.0], None), [5.0]);
        let mut out = Vec::new();
        // 2 m less 500 mm
        evaluate(Through::Elements, &[2.0], Some((&[500.0], 1e-3)), &mut out);
        assert_eq!(out, [1.5]);
    }

    #[test]
    fn signal_of_attitudes_is_their_rotation_angle() {
        let about = |axis: usize, angle: f64| {
            let mut q = [(angle / 2.0).cos(), 0.0, 0.0, 0.0];
            q[axis] = (angle / 2.0).sin();
            q
        };
        for axis in 1..4 {
            for (a, b) in [(0.3, 0.1), (1e-9, 0.0), (2.0, -1.0), (3.0, 0.0)] {
                let (p, q) = (about(axis, a), about(axis, b));
                let negative = q.map(|x| -2.0 * x);
                for other in [q, negative] {
                    let found = one(Through::Angle, &p, Some(&other))[0];
                    assert!((found - (a - b).abs()).abs() < 1e-15 * 4.0, "{found} {a} {b}");
                }
            }
        }
        // a quarter turn about x, then one about y: a third of a turn
        let half = 0.5_f64.sqrt();
        let found = one(Through::Angle, &[half, half, 0.0, 0.0], Some(&[half, 0.0, half, 0.0]))[0];
        assert!((found - std::f64::consts::PI * 2.0 / 3.0).abs() < 1e-15, "{found}");
        assert!(one(Through::Angle, &[0.0; 4], None)[0].is_nan());
        // the value after a bit flip in the exponent
        let broken = [f64::INFINITY, 0.0, 0.5, 0.0];
        assert!(one(Through::Angle, &broken, None)[0].is_nan());
        assert!(one(Through::Angle, &[half, half, 0.0, 0.0], Some(&broken))[0].is_nan());
    }
}
