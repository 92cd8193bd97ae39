//! Dimensions: exponents of the base units.

use std::fmt;

/// Exponents of metre, kilogram, second and radian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension {
    /// Exponent of the metre.
    pub length: i32,
    /// Exponent of the kilogram.
    pub mass: i32,
    /// Exponent of the second.
    pub time: i32,
    /// Exponent of the radian.
    pub angle: i32,
}

impl Dimension {
    /// The dimension with these exponents of metre, kilogram, second and radian.
    pub const fn new(length: i32, mass: i32, time: i32, angle: i32) -> Dimension {
        Dimension {
            length,
            mass,
            time,
            angle,
        }
    }

    /// The product of this and `other` to the power `power`; `None` when an exponent exceeds any physical range.
    pub fn times(self, other: Dimension, power: i32) -> Option<Dimension> {
        let add = |a: i32, b: i32| {
            b.checked_mul(power)
                .and_then(|b| a.checked_add(b))
                .filter(|sum| sum.abs() <= 64)
        };
        Some(Dimension {
            length: add(self.length, other.length)?,
            mass: add(self.mass, other.mass)?,
            time: add(self.time, other.time)?,
            angle: add(self.angle, other.angle)?,
        })
    }

    /// Whether both are the same apart from the angle, which mechanics conventionally writes or omits.
    pub fn same_but_for_angle(self, other: Dimension) -> bool {
        (self.length, self.mass, self.time) == (other.length, other.mass, other.time)
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let factors = [
            ("kg", self.mass),
            ("m", self.length),
            ("rad", self.angle),
            ("s", self.time),
        ];
        let mut written = false;
        for (symbol, power) in factors.into_iter().filter(|(_, power)| *power != 0) {
            let space = if written { " " } else { "" };
            match power {
                1 => write!(f, "{space}{symbol}")?,
                _ => write!(f, "{space}{symbol}^{power}")?,
            }
            written = true;
        }
        if written { Ok(()) } else { f.write_str("1") }
    }
}
