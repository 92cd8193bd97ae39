//! Units with engineering prefixes.

use serde::Serialize;

/// A multiple of a unit: 10^`exponent` units are called `name`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Scale {
    pub(crate) exponent: i32,
    pub(crate) name: String,
}

const PREFIXES: [(i32, &str); 9] = [
    (-15, "f"),
    (-12, "p"),
    (-9, "n"),
    (-6, "µ"),
    (-3, "m"),
    (0, ""),
    (3, "k"),
    (6, "M"),
    (9, "G"),
];

/// Symbols that take small and large prefixes.
const BOTH: &[&str] = &[
    "m", "g", "N", "J", "W", "Pa", "V", "A", "Hz", "C", "F", "H", "T", "Ω", "ohm", "bar", "K", "mol", "lm", "cd",
];
/// Symbols that take small prefixes only.
const SMALL: &[&str] = &["s", "rad"];

/// The multiples in which values of `unit` are written, in ascending order. A unit that takes no prefix is preceded by a
/// power of ten; for a pure number it is the power alone.
pub(crate) fn scales(unit: &str) -> Vec<Scale> {
    let end = unit.find([' ', '/', '*', '·', '^']).unwrap_or(unit.len());
    let (symbol, rest) = unit.split_at(end);
    let powered = rest.starts_with('^');
    let name = |exponent: i32, prefix: &str| -> String {
        if exponent == 0 {
            return if unit == "1" { String::new() } else { unit.to_owned() };
        }
        let gram = symbol == "kg" && exponent < 0;
        if gram && !powered {
            let shifted = PREFIXES.iter().find(|(power, _)| *power == exponent + 3);
            return format!("{}g{rest}", shifted.map_or("", |(_, prefix)| prefix));
        }
        let takes = BOTH.contains(&symbol) || (SMALL.contains(&symbol) && exponent < 0);
        if takes && !powered {
            return format!("{prefix}{unit}");
        }
        let power: String = exponent.to_string().chars().map(superscript).collect();
        if unit == "1" {
            format!("10{power}")
        } else {
            format!("10{power} {unit}")
        }
    };
    PREFIXES
        .iter()
        .map(|&(exponent, prefix)| Scale {
            exponent,
            name: name(exponent, prefix),
        })
        .collect()
}

fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        other => char::from_u32('⁰' as u32 + other.to_digit(10).unwrap_or(0)).unwrap_or(other),
    }
}

/// The multiple that suits a value of this size: the unit itself from 0.1 to 10 000, else one that gives 0.1 to 100. The
/// page has the same rule.
pub(crate) fn best(scales: &[Scale], size: f64) -> (f64, &str) {
    let exponent = if size == 0.0 || !size.is_finite() || (0.1..1e4).contains(&size) {
        0
    } else {
        3 * ((size.log10() + 1.0 + 1e-9) / 3.0).floor() as i32
    };
    let (first, last) = (scales.first(), scales.last());
    let bounded = exponent.clamp(first.map_or(0, |s| s.exponent), last.map_or(0, |s| s.exponent));
    let scale = scales.iter().find(|scale| scale.exponent == bounded);
    scale.map_or((1.0, ""), |scale| (10_f64.powi(scale.exponent), &*scale.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_prefix_suits_size_of_value() {
        for (unit, size, expected) in [
            ("m", 1.0e-4, (1e-3, "mm")),
            ("m", 0.3, (1.0, "m")),
            ("m", 4.2e-7, (1e-6, "µm")),
            ("N m", 320.0, (1.0, "N m")),
            ("N m", 0.02, (1e-3, "mN m")),
            ("m/s", 2e-5, (1e-6, "µm/s")),
            ("W", 5e5, (1e6, "MW")),
            ("kg", 2e-3, (1e-3, "g")),
            ("kg m^2", 4e-6, (1e-6, "mg m^2")),
            ("s", 5e4, (1e3, "10³ s")),
            ("m^2/s", 2e-3, (1e-3, "10⁻³ m^2/s")),
            ("1/s", 2e-3, (1e-3, "10⁻³ 1/s")),
            ("1", 3e-9, (1e-9, "10⁻⁹")),
            ("1", 3.0, (1.0, "")),
            ("deg", 0.004, (1e-3, "10⁻³ deg")),
            ("rad", 0.0, (1.0, "rad")),
            ("m", f64::NAN, (1.0, "m")),
            ("m", 1e-30, (1e-15, "fm")),
        ] {
            let all = scales(unit);
            let (factor, name) = best(&all, size);
            assert_eq!(name, expected.1, "{size} {unit}");
            assert!((factor / expected.0 - 1.0).abs() < 1e-12, "{size} {unit}");
        }
    }
}
