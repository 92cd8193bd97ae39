//! Units of an FMU, converted to those of the framework.

use lockstep::units::UnitError;
use lockstep::units::convert;

/// The definition of a unit by the base units of the SI and the radian: base value = factor · value + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseUnit {
    /// Exponents of kg, m, s, A, K, mol, cd, rad.
    pub exponents: [i32; 8],
    /// See above.
    pub factor: f64,
    /// See above.
    pub offset: f64,
}

/// The symbols of the base units, in the order of [`BaseUnit::exponents`].
pub const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

impl BaseUnit {
    /// The base unit as text: `kg m^2 s^-2`, or `1`.
    pub fn text(&self) -> String {
        let factors = BASE.iter().zip(self.exponents).filter(|(_, power)| *power != 0);
        let words: Vec<String> = factors
            .map(|(symbol, power)| match power {
                1 => (*symbol).to_owned(),
                power => format!("{symbol}^{power}"),
            })
            .collect();
        if words.is_empty() {
            "1".to_owned()
        } else {
            words.join(" ")
        }
    }
}

/// A unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Its name in the FMU.
    pub name: String,
    /// Its definition, where there is one.
    pub base: Option<BaseUnit>,
}

/// The conversion of an FMU's value for a port: factor · value + offset, in `unit`.
#[derive(Debug, Clone, PartialEq)]
pub struct Conversion {
    /// The unit of the port.
    pub unit: String,
    /// See above; 1 where the values are copied unchanged.
    pub factor: f64,
    /// See above.
    pub offset: f64,
}

impl Conversion {
    /// The values are copied unchanged.
    pub fn none(unit: impl Into<String>) -> Conversion {
        Conversion {
            unit: unit.into(),
            factor: 1.0,
            offset: 0.0,
        }
    }

    /// Whether values are copied unchanged.
    pub fn is_none(&self) -> bool {
        self.factor == 1.0 && self.offset == 0.0
    }
}

impl Unit {
    /// Whether its values are numbers that need no unit: copied unchanged, without a dimension.
    pub fn is_pure(&self) -> bool {
        self.of_port() == Conversion::none("1")
    }

    /// The unit of differences, which has no offset; none where this unit has none either.
    pub fn of_differences(&self) -> Option<Unit> {
        let base = self.base.filter(|base| base.offset != 0.0)?;
        Some(Unit {
            name: self.name.clone(),
            base: Some(BaseUnit { offset: 0.0, ..base }),
        })
    }

    /// The unit of a port for values in this unit, and the conversion: the FMU's own unit where the framework knows it with
    /// the same definition, else its base units.
    pub fn of_port(&self) -> Conversion {
        let spelt = normalised_spelling(&self.name);
        match (&self.base, is_known(&spelt)) {
            (None, true) => Conversion::none(spelt),
            (None, false) => Conversion::none(self.name.as_str()),
            (Some(base), true) if self.agrees(&spelt, base) => Conversion::none(spelt),
            (Some(base), _) => Conversion {
                unit: base.text(),
                factor: base.factor,
                offset: base.offset,
            },
        }
    }

    fn agrees(&self, spelt: &str, base: &BaseUnit) -> bool {
        let value = convert(&format!("1 {spelt}"), &base.text());
        let near = |value: f64| (value - base.factor).abs() <= 1e-9 * base.factor.abs();
        base.offset == 0.0 && value.is_ok_and(|(values, _)| near(values[0]))
    }

    /// The conversion to `wanted`, a unit that the user names.
    ///
    /// # Errors
    /// When it has another dimension.
    pub fn to(&self, wanted: &str) -> Result<Conversion, String> {
        let own = self.of_port();
        if own.unit == wanted {
            return Ok(own);
        }
        let (factors, _) = convert(&format!("1 {}", own.unit), wanted).map_err(|error| error.to_string())?;
        Ok(Conversion {
            unit: wanted.to_owned(),
            factor: own.factor * factors[0],
            offset: own.offset * factors[0],
        })
    }
}

/// A unit's name as Modelica and FMUs write it, converted to the framework's spelling: `N.m/s2` is `N m/s^2`.
fn normalised_spelling(name: &str) -> String {
    let mut text = String::new();
    let mut before = ' ';
    for letter in name.trim().chars() {
        match letter {
            '.' | '*' => text.push(' '),
            digit @ ('0'..='9' | '-') if before.is_alphabetic() => {
                text.push('^');
                text.push(digit);
            }
            other => text.push(other),
        }
        before = letter;
    }
    if text.is_empty() { "1".to_owned() } else { text }
}

fn is_known(unit: &str) -> bool {
    // A unit known with another dimension.
    !matches!(convert(&format!("1 {unit}"), "1"), Err(UnitError::Symbol { .. }))
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn unit_known_to_framework_keeps_values_bitwise() {
        for (name, exponents, factor, port) in [
            ("m/s2", [0, 1, -2, 0, 0, 0, 0, 0], 1.0, "m/s^2"),
            ("N.m", [1, 2, -2, 0, 0, 0, 0, 0], 1.0, "N m"),
            ("deg", [0, 0, 0, 0, 0, 0, 0, 1], 0.0174532925199433, "deg"),
            ("mm", [0, 1, 0, 0, 0, 0, 0, 0], 1e-3, "mm"),
        ] {
            assert_eq!(
                unit(name, exponents, factor, 0.0).of_port(),
                Conversion::none(port),
                "{name}"
            );
        }
    }

    #[test]
    fn unknown_or_contradicted_unit_becomes_base_units() {
        let celsius = unit("degC", [0, 0, 0, 0, 1, 0, 0, 0], 1.0, 273.15).of_port();
        assert_eq!((celsius.unit.as_str(), celsius.offset), ("K", 273.15));
        let bar = unit("bar", [1, -1, -2, 0, 0, 0, 0, 0], 1e5, 0.0).of_port();
        assert_eq!((bar.unit.as_str(), bar.factor), ("kg m^-1 s^-2", 1e5));
        // In the framework, `h` is the hour.
        let planck = unit("h", [1, 2, -1, 0, 0, 0, 0, 0], 6.62607015e-34, 0.0).of_port();
        assert_eq!((planck.unit.as_str(), planck.factor), ("kg m^2 s^-1", 6.62607015e-34));
        let odd = Unit {
            name: "furlong".into(),
            base: None,
        };
        assert_eq!(odd.of_port(), Conversion::none("furlong"));
    }

    #[test]
    fn conversion_accepts_other_unit_of_same_dimension() {
        let degrees = unit("deg", [0, 0, 0, 0, 0, 0, 0, 1], 0.0174532925199433, 0.0);
        let to = degrees.to("rad").unwrap();
        assert!((to.factor - std::f64::consts::PI / 180.0).abs() < 1e-18 && to.offset == 0.0);
        assert!(degrees.to("m").unwrap_err().contains("dimension"));
    }
}
