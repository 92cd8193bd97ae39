//! Units as a model description defines them.

use lockstep::units;

/// The definition of a unit by the base units of the SI and the radian: base value = factor · value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Base {
    /// Symbol and exponent of each base unit whose exponent is not zero.
    pub exponents: [(&'static str, i32); 4],
    /// See above.
    pub factor: f64,
}

/// The definition of `unit`; none for one that the framework does not know.
pub fn base(unit: &str) -> Option<Base> {
    let (factor, own) = units::unit_factor(unit).ok()?;
    Some(Base {
        exponents: [("kg", own.mass), ("m", own.length), ("s", own.time), ("rad", own.angle)],
        factor,
    })
}

/// Whether a variable has a unit.
pub fn is_unit(unit: &str) -> bool {
    !matches!(unit, "" | "1")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definition_has_exponents_and_factor() {
        let torque = base("N m").unwrap();
        assert_eq!(
            (torque.exponents.map(|(_, power)| power), torque.factor),
            ([1, 2, -2, 0], 1.0)
        );
        let rate = base("deg/s").unwrap();
        assert_eq!(rate.exponents.map(|(_, power)| power), [0, 0, -1, 1]);
        assert!((rate.factor - std::f64::consts::PI / 180.0).abs() < 1e-18);
        assert_eq!(base("furlong"), None);
    }
}
