//! Scaling of a number along its path: units, factors and offsets of all connections combined into one factor and one offset.

use fmu::{Conversion, Unit};
use lockstep::units::convert;
use toml::Value;

use crate::transform::Transformation;

/// The tolerance within which two factors count as equal: unit definitions are written with ten or more digits.
const NEAR: f64 = 1e-9;
/// The index of the radian among the base units. Mechanics includes it in some units and omits it in others.
const RADIAN: usize = 7;

/// value = scale · source + shift, in the unit that the value has at this point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scaling {
    scale: f64,
    shift: f64,
    /// The part of the scale that comes from transformations, not from units.
    factor: f64,
    /// Whether the value is a difference of two quantities, for which the offsets of units do not apply.
    relative: bool,
}

impl Scaling {
    /// The identity: the value is the source.
    pub const fn new() -> Scaling {
        Scaling {
            scale: 1.0,
            shift: 0.0,
            factor: 1.0,
            relative: false,
        }
    }

    /// The identity, for a relative quantity or for any other one.
    pub const fn of(relative: bool) -> Scaling {
        Scaling {
            relative,
            ..Scaling::new()
        }
    }

    /// Whether the value is the source.
    pub fn is_identity(&self) -> bool {
        *self == Scaling::of(self.relative)
    }

    /// The value for a given source.
    pub fn at(&self, source: f64) -> f64 {
        if self.is_identity() {
            return source;
        }
        self.scale * source + self.shift
    }

    /// Converts the value from one unit to another, if both are known.
    ///
    /// # Errors
    /// When they cannot be converted.
    pub fn convert(&mut self, from: Option<&Unit>, to: Option<&Unit>) -> Result<(), String> {
        let (Some(from), Some(to)) = (from, to) else {
            return Ok(());
        };
        let (ours, theirs) = match (&from.base, &to.base) {
            (Some(ours), Some(theirs)) => (ours, theirs),
            _ if from.name == to.name => return Ok(()),
            (None, _) => return Err(undefined(&from.name)),
            (_, None) => return Err(undefined(&to.name)),
        };
        let exponents = ours.exponents.iter().zip(&theirs.exponents);
        if exponents.take(RADIAN).any(|(ours, theirs)| ours != theirs) {
            return Err(format!(
                "`{}` is no `{}`: they are {} and {} in base units; give the connectors units of one dimension, or say \
                 suppressUnitConversion",
                from.name,
                to.name,
                ours.text(),
                theirs.text()
            ));
        }
        let offsets = match self.relative {
            true => (0.0, 0.0),
            false => (ours.offset, theirs.offset),
        };
        if (ours.factor, offsets.0) != (theirs.factor, offsets.1) {
            self.scale *= ours.factor / theirs.factor;
            self.shift = (ours.factor * self.shift + offsets.0 - offsets.1) / theirs.factor;
        }
        Ok(())
    }

    /// Applies a transformation to the value.
    pub fn transform(&mut self, by: &Transformation) {
        self.scale *= by.factor;
        self.factor *= by.factor;
        self.shift = by.factor * self.shift + by.offset;
    }

    /// Factor and offset of a connection between the fields of two ports. `from` converts the values of the source on their way into its
    /// port, `to` those of the input. The conversion that follows from the units of the fields is left out.
    ///
    /// # Errors
    /// When the framework cannot convert the unit of one field into that of the other.
    pub fn between(&self, from: &Conversion, to: &Conversion) -> Result<(Option<Value>, Option<Value>), String> {
        let scale = to.factor * self.scale / from.factor;
        let parts = [to.factor * self.shift, to.offset, -scale * from.offset];
        let offset: f64 = parts.iter().sum();
        let negligible = offset.abs() <= NEAR * parts.iter().fold(0.0, |sum: f64, part| sum.max(part.abs()));
        let offset = (!negligible).then(|| number(offset, &to.unit));
        let natural = match from.unit == to.unit {
            true => Ok(1.0),
            false => convert(&format!("1 {}", from.unit), &to.unit).map(|(numbers, _)| numbers[0]),
        };
        let Ok(natural) = natural else {
            let made = if to.unit == "1" { "" } else { &to.unit };
            let text = format!("{scale:?} {}", format!("{made} {}", inverse(&from.unit)).trim());
            return match convert(&format!("{text} {}", from.unit), &to.unit) {
                Ok(_) => Ok((Some(Value::String(text)), offset)),
                Err(error) => Err(error.to_string()),
            };
        };
        let mut factor = scale / natural;
        if (factor - self.factor).abs() <= NEAR * self.factor.abs() {
            factor = self.factor;
        }
        Ok(((factor != 1.0).then_some(Value::Float(factor)), offset))
    }
}

fn undefined(name: &str) -> String {
    format!("the unit `{name}` has no definition by base units, so nothing can be converted to or from it")
}

/// A number in a unit, as a scenario writes it.
fn number(value: f64, unit: &str) -> Value {
    if unit == "1" {
        Value::Float(value)
    } else {
        Value::String(format!("{value:?} {unit}"))
    }
}

/// The unit that divides by another one: `s m^-1` for `m/s`; none for a pure number.
fn inverse(unit: &str) -> String {
    let mut all = Vec::new();
    for part in unit.split(' ') {
        for (place, factor) in part.split('/').enumerate() {
            let (symbol, power) = factor.split_once('^').unwrap_or((factor, "1"));
            let power = power.parse::<i32>().unwrap_or(1) * if place == 0 { -1 } else { 1 };
            if !matches!(symbol, "" | "1") {
                all.push(format!("{symbol}^{power}"));
            }
        }
    }
    all.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu::BaseUnit;

    fn unit(name: &str, exponents: [i32; 8], factor: f64, offset: f64) -> Unit {
        let base = Some(BaseUnit {
            exponents,
            factor,
            offset,
        });
        Unit {
            name: name.into(),
            base,
        }
    }

    fn linear(factor: f64, offset: f64) -> Transformation {
        Transformation {
            factor,
            offset,
            ..Transformation::none()
        }
    }

    const LENGTH: [i32; 8] = [0, 1, 0, 0, 0, 0, 0, 0];
    const HEAT: [i32; 8] = [0, 0, 0, 0, 1, 0, 0, 0];

    #[test]
    fn unit_known_to_framework_needs_no_factor() {
        let (mm, m) = (unit("mm", LENGTH, 1e-3, 0.0), unit("m", LENGTH, 1.0, 0.0));
        let mut scaling = Scaling::new();
        scaling.convert(Some(&mm), Some(&m)).unwrap();
        assert_eq!(scaling.between(&mm.of_port(), &m.of_port()), Ok((None, None)));
        scaling.transform(&linear(2.0, 0.5));
        let expected = (Some(Value::Float(2.0)), Some(Value::String("0.5 m".into())));
        assert_eq!(scaling.between(&mm.of_port(), &m.of_port()), Ok(expected));
        assert_eq!(scaling.at(250.0), 1.0);
    }

    #[test]
    fn unit_offsets_combine_with_factors() {
        // Ports use kelvin; 2 x + 10 applies to degrees Celsius.
        let celsius = unit("degC", HEAT, 1.0, 273.15);
        let kelvin = unit("K", HEAT, 1.0, 0.0);
        let mut scaling = Scaling::new();
        scaling.convert(Some(&celsius), Some(&celsius)).unwrap();
        assert_eq!(
            scaling.between(&celsius.of_port(), &celsius.of_port()),
            Ok((None, None))
        );
        scaling.transform(&linear(2.0, 10.0));
        let (factor, offset) = scaling.between(&celsius.of_port(), &celsius.of_port()).unwrap();
        assert_eq!(factor, Some(Value::Float(2.0)));
        let text = offset.unwrap();
        let offset: f64 = text
            .as_str()
            .and_then(|text| text.strip_suffix(" K"))
            .unwrap()
            .parse()
            .unwrap();
        // 20 degC is 293.15 K, and becomes 50 degC.
        assert!((2.0 * 293.15 + offset - 323.15).abs() < 1e-9, "{offset}");
        let mut scaling = Scaling::new();
        scaling.convert(Some(&celsius), Some(&kelvin)).unwrap();
        assert_eq!(scaling.at(20.0), 293.15);
        assert_eq!(scaling.between(&celsius.of_port(), &kelvin.of_port()), Ok((None, None)));
    }

    #[test]
    fn relative_quantity_has_no_offset() {
        // 10 K are 10 degrees Celsius, where both are differences; a connector of a system may state either.
        let celsius = unit("degC", HEAT, 1.0, 273.15);
        let difference = celsius.of_differences().unwrap();
        let kelvin = unit("K", HEAT, 1.0, 0.0);
        let mut scaling = Scaling::of(true);
        for (from, to) in [(&celsius, &kelvin), (&kelvin, &celsius), (&celsius, &difference)] {
            scaling.convert(Some(from), Some(to)).unwrap();
        }
        assert_eq!(scaling.at(10.0), 10.0);
        assert_eq!(
            scaling.between(&kelvin.of_port(), &difference.of_port()),
            Ok((None, None))
        );
    }

    #[test]
    fn unconverted_value_gets_factor_with_unit() {
        let m = unit("m", LENGTH, 1.0, 0.0).of_port();
        let speed = unit("m/s", [0, 1, -1, 0, 0, 0, 0, 0], 1.0, 0.0).of_port();
        let pure = Conversion::none("1");
        for (from, to) in [(&m, &speed), (&speed, &m), (&pure, &m), (&m, &pure)] {
            let (factor, offset) = Scaling::new().between(from, to).unwrap();
            let factor = factor.unwrap();
            let product = format!("{} {}", factor.as_str().unwrap(), from.unit);
            assert_eq!(convert(&product, &to.unit).unwrap().0, [1.0], "{product}");
            assert_eq!(offset, None);
        }
    }

    #[test]
    fn units_of_other_dimensions_are_refused() {
        let (m, kelvin) = (unit("m", LENGTH, 1.0, 0.0), unit("K", HEAT, 1.0, 0.0));
        let refused = Scaling::new().convert(Some(&m), Some(&kelvin)).unwrap_err();
        assert!(
            refused.contains("`m` is no `K`") && refused.contains("suppressUnitConversion"),
            "{refused}"
        );
        // The radian is dimensionless.
        let rate = unit("1/s", [0, 0, -1, 0, 0, 0, 0, 0], 1.0, 0.0);
        let turning = unit("rad/s", [0, 0, -1, 0, 0, 0, 0, 1], 1.0, 0.0);
        assert_eq!(Scaling::new().convert(Some(&rate), Some(&turning)), Ok(()));
        let odd = Unit {
            name: "furlong".into(),
            base: None,
        };
        assert!(
            Scaling::new()
                .convert(Some(&odd), Some(&m))
                .unwrap_err()
                .contains("furlong")
        );
    }
}
