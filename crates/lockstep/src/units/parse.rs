//! Parsing of numbers with units.

use super::Dimension;

/// Why a text is not the quantity that is needed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// The text does not start with a number or a list of numbers.
    #[error("`{text}` does not start with a number; write for example \"{example}\"")]
    Number {
        /// The text.
        text: String,
        /// A valid example.
        example: &'static str,
    },
    /// A number that is infinite or not a number.
    #[error("`{text}` is not finite; write for example \"{example}\"")]
    NotFinite {
        /// The text.
        text: String,
        /// A valid example.
        example: &'static str,
    },
    /// A number without unit.
    #[error("`{text}` has no unit, but {words} is needed; write for example \"{example}\"")]
    NoUnit {
        /// The text.
        text: String,
        /// What is needed.
        words: &'static str,
        /// A valid example.
        example: &'static str,
    },
    /// An unknown unit symbol.
    #[error("`{symbol}` in `{text}` is not a unit; known are {}", known_symbols())]
    Symbol {
        /// The text.
        text: String,
        /// The symbol.
        symbol: String,
    },
    /// A unit of another dimension.
    #[error("`{text}` has the dimension {found}, but {words} ({needed}) is needed; write for example \"{example}\"")]
    Dimension {
        /// The text.
        text: String,
        /// Its dimension.
        found: Dimension,
        /// What is needed.
        words: &'static str,
        /// The dimension that is needed.
        needed: Dimension,
        /// A valid example.
        example: &'static str,
    },
    /// An invalid value for a unit that is known only at run time.
    #[error("`{text}` is not a value in {unit}: {reason}; write for example \"0.5 {unit}\"")]
    Unit {
        /// The text.
        text: String,
        /// The unit that is needed.
        unit: String,
        /// What is wrong.
        reason: String,
    },
    /// A list of the wrong length, a list where one number belongs, or one number where a list belongs.
    #[error("`{text}` has {found}, but {needed} needed; write for example \"{example}\"")]
    Count {
        /// The text.
        text: String,
        /// What the text has.
        found: String,
        /// How many there should be.
        needed: String,
        /// A valid example.
        example: String,
    },
}

const M: Dimension = Dimension::new(1, 0, 0, 0);
const KG: Dimension = Dimension::new(0, 1, 0, 0);
const S: Dimension = Dimension::new(0, 0, 1, 0);
const RAD: Dimension = Dimension::new(0, 0, 0, 1);
const HZ: Dimension = Dimension::new(0, 0, -1, 0);
const N: Dimension = Dimension::new(1, 1, -2, 0);
const NM: Dimension = Dimension::new(2, 1, -2, 0);
const NMS: Dimension = Dimension::new(2, 1, -1, 0);
const W: Dimension = Dimension::new(2, 1, -3, 0);
const ONE: Dimension = Dimension::new(0, 0, 0, 0);

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Symbol, factor to SI, dimension. Symbols are matched as a whole: prefixes cannot be combined freely.
const SYMBOLS: [(&str, f64, Dimension); 36] = [
    ("1", 1.0, ONE),
    ("m", 1.0, M),
    ("km", 1e3, M),
    ("cm", 1e-2, M),
    ("mm", 1e-3, M),
    ("um", 1e-6, M),
    ("µm", 1e-6, M),
    ("kg", 1.0, KG),
    ("g", 1e-3, KG),
    ("t", 1e3, KG),
    ("s", 1.0, S),
    ("ms", 1e-3, S),
    ("us", 1e-6, S),
    ("µs", 1e-6, S),
    ("min", 60.0, S),
    ("h", 3600.0, S),
    ("Hz", 1.0, HZ),
    ("kHz", 1e3, HZ),
    ("rad", 1.0, RAD),
    ("mrad", 1e-3, RAD),
    ("urad", 1e-6, RAD),
    ("µrad", 1e-6, RAD),
    ("deg", DEGREE, RAD),
    ("°", DEGREE, RAD),
    ("arcmin", DEGREE / 60.0, RAD),
    ("arcsec", DEGREE / 3600.0, RAD),
    ("N", 1.0, N),
    ("kN", 1e3, N),
    ("mN", 1e-3, N),
    ("Nm", 1.0, NM),
    ("mNm", 1e-3, NM),
    ("Nms", 1.0, NMS),
    ("J", 1.0, NM),
    ("mJ", 1e-3, NM),
    ("W", 1.0, W),
    ("rpm", std::f64::consts::PI / 30.0, Dimension::new(0, 0, -1, 1)),
];

/// The unit symbols, for messages.
pub fn known_symbols() -> String {
    let names: Vec<&str> = SYMBOLS.iter().map(|(name, ..)| *name).collect();
    names.join(", ")
}

/// Reads `text` as numbers in a unit of `dimension` and passes each, in SI units, to `put` with its index.
///
/// Returns the count of numbers, and whether they were in brackets. `words` and `example` are used in the messages.
///
/// # Errors
/// Names the text, what is needed and a valid example.
pub fn parse(
    text: &str,
    dimension: Dimension,
    words: &'static str,
    example: &'static str,
    mut put: impl FnMut(usize, f64),
) -> Result<(usize, bool), UnitError> {
    let no_number = || UnitError::Number {
        text: text.to_owned(),
        example,
    };
    let (numbers, unit, listed) = split(text.trim()).ok_or_else(no_number)?;
    if numbers.split(',').any(|number| number.trim().parse::<f64>().is_err()) {
        return Err(no_number());
    }
    if unit.trim().is_empty() {
        return Err(UnitError::NoUnit {
            text: text.to_owned(),
            words,
            example,
        });
    }
    let (factor, found) = unit_of(unit, text)?;
    let angle_matters = found.angle != dimension.angle && (factor.1 || (dimension.angle != 0 && is_angle(dimension)));
    if !found.same_but_for_angle(dimension) || angle_matters {
        return Err(UnitError::Dimension {
            text: text.to_owned(),
            found,
            words,
            needed: dimension,
            example,
        });
    }
    let mut count = 0;
    for number in numbers.split(',') {
        let value: f64 = number.trim().parse().map_err(|_| no_number())?;
        let value = value * factor.0;
        if !value.is_finite() {
            return Err(UnitError::NotFinite {
                text: text.to_owned(),
                example,
            });
        }
        put(count, value);
        count += 1;
    }
    Ok((count, listed))
}

/// Reads `text` as numbers and returns them in the unit called `unit`, with whether they were in brackets. A unit that this module does
/// not know, of a foreign message, must be written in `text` by the same name.
///
/// # Errors
/// Names the text, the unit that is needed and a valid example.
pub fn convert(text: &str, unit: &str) -> Result<(Vec<f64>, bool), UnitError> {
    let refuse = |reason: String| UnitError::Unit {
        text: text.to_owned(),
        unit: unit.to_owned(),
        reason,
    };
    let (numbers, own, listed) =
        split(text.trim()).ok_or_else(|| refuse("it does not start with a number".to_owned()))?;
    if !listed && numbers.parse::<f64>().is_err() {
        return Err(refuse("it does not start with a number".to_owned()));
    }
    let own = own.trim();
    let factor = if own.is_empty() {
        return Err(refuse("it has no unit".to_owned()));
    } else if own == unit {
        1.0
    } else {
        let ((factor, odd_angle), found) = unit_of(own, text)?;
        let Ok(((scale, _), needed)) = unit_of(unit, unit) else {
            return Err(refuse(format!("`{own}` is another unit")));
        };
        let angle_matters = found.angle != needed.angle && (odd_angle || is_angle(needed));
        if !found.same_but_for_angle(needed) || angle_matters {
            return Err(refuse(format!("it has the dimension {found}, not {needed}")));
        }
        factor / scale
    };
    let number = |number: &str| {
        let value = number.trim().parse::<f64>();
        let value = value.map_err(|_| refuse(format!("`{}` is not a number", number.trim())))? * factor;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(refuse("it is not finite".to_owned()))
        }
    };
    Ok((numbers.split(',').map(number).collect::<Result<_, _>>()?, listed))
}

/// The factor from the unit called `unit` to SI units and radians, and its dimension.
///
/// # Errors
/// Names an unknown unit symbol.
pub fn unit_factor(unit: &str) -> Result<(f64, Dimension), UnitError> {
    let ((factor, _), dimension) = unit_of(unit, unit)?;
    Ok((factor, dimension))
}

/// The unit after a number or a list of numbers in `text`, as written.
pub fn unit_in(text: &str) -> Option<&str> {
    let (_, unit, _) = split(text.trim())?;
    Some(unit.trim()).filter(|unit| !unit.is_empty())
}

/// Numbers, unit, and whether the numbers are in brackets.
fn split(text: &str) -> Option<(&str, &str, bool)> {
    match text.strip_prefix('[') {
        Some(rest) => rest.split_once(']').map(|(inside, unit)| (inside, unit, true)),
        None => {
            let end = number_end(text);
            Some((&text[..end], &text[end..], false))
        }
    }
}

/// Angles, and rates of angles, for which a missing `rad` is a likely mistake.
fn is_angle(dimension: Dimension) -> bool {
    dimension.length == 0 && dimension.mass == 0
}

/// The end of the number at the start of `text`.
fn number_end(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let exponent = matches!(bytes[at], b'e' | b'E')
            && at > 0
            && bytes
                .get(at + 1)
                .is_some_and(|next| next.is_ascii_digit() || matches!(next, b'+' | b'-'));
        if !(bytes[at].is_ascii_digit() || matches!(bytes[at], b'+' | b'-' | b'.') || exponent) {
            break;
        }
        at += 1;
    }
    at
}

/// Factor to SI, whether it contains an angle unit other than the radian, and dimension.
fn unit_of(unit: &str, text: &str) -> Result<((f64, bool), Dimension), UnitError> {
    let unit = unit.replace(['·', '*'], " ").replace('²', "^2").replace('³', "^3");
    // The Greek letter looks like the sign for micro, and keyboards have either.
    let unit = unit.replace('\u{3bc}', "\u{b5}");
    let spaced = unit.replace('/', " / ");
    let (mut factor, mut dimension, mut odd_angle) = (1.0, Dimension::default(), false);
    let mut sign = 1;
    let mut dangling = false;
    for term in spaced.split_whitespace() {
        let refuse = || UnitError::Symbol {
            text: text.to_owned(),
            symbol: term.to_owned(),
        };
        if term == "/" {
            if dangling {
                return Err(refuse());
            }
            (sign, dangling) = (-1, true);
            continue;
        }
        let (symbol, power) = split_power(term).ok_or_else(refuse)?;
        let (_, scale, own) = SYMBOLS.iter().find(|(name, ..)| *name == symbol).ok_or_else(refuse)?;
        let power = power * sign;
        factor *= integer_power(*scale, power);
        odd_angle |= own.angle != 0 && *scale != 1.0;
        dimension = dimension.times(*own, power).ok_or_else(refuse)?;
        (sign, dangling) = (1, false);
    }
    if dangling {
        return Err(UnitError::Symbol {
            text: text.to_owned(),
            symbol: "/".to_owned(),
        });
    }
    Ok(((factor, odd_angle), dimension))
}

/// `m2`, `m^2` and `s^-1` to symbol and power.
fn split_power(term: &str) -> Option<(&str, i32)> {
    if let Some((symbol, power)) = term.split_once('^') {
        return Some((symbol, power.parse().ok().filter(|power: &i32| power.abs() <= 9)?));
    }
    let symbol = term.trim_end_matches(|c: char| c.is_ascii_digit());
    match &term[symbol.len()..] {
        _ if symbol.is_empty() => Some((term, 1)),
        "" => Some((term, 1)),
        power => Some((symbol, power.parse().ok().filter(|power| *power <= 9)?)),
    }
}

/// By repeated multiplication: `powi` may round differently between targets.
fn integer_power(base: f64, power: i32) -> f64 {
    let product = (0..power.abs()).fold(1.0, |product, _| product * base);
    if power < 0 { 1.0 / product } else { product }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(text: &str, dimension: Dimension) -> Result<Vec<f64>, UnitError> {
        let mut values = Vec::new();
        parse(text, dimension, "a thing", "1 m", |_, value| values.push(value)).map(|_| values)
    }

    #[test]
    fn parser_converts_quantities_to_si() {
        let inertia = Dimension::new(2, 1, 0, 0);
        for (text, dimension, expected) in [
            ("0.5 m", M, 0.5),
            ("-2.5e-3 km", M, -2.5),
            ("10ms", S, 0.01),
            ("10 \u{b5}s", S, 1e-5),
            ("10 \u{3bc}s", S, 1e-5),
            ("0.2 N m", NM, 0.2),
            ("0.2 N*m", NM, 0.2),
            ("0.2 Nm", NM, 0.2),
            ("0.1 kg m^2", inertia, 0.1),
            ("0.1 kg m2", inertia, 0.1),
            ("0.1 kg·m²", inertia, 0.1),
            ("0.0131 kg m^2/s", Dimension::new(2, 1, -1, -1), 0.0131),
            ("0.0131 N m s/rad", Dimension::new(2, 1, -1, -1), 0.0131),
            ("180 deg", RAD, std::f64::consts::PI),
            ("0.3 1/s", Dimension::new(0, 0, -1, 0), 0.3),
            ("2 m s^-1", Dimension::new(1, 0, -1, 0), 2.0),
            ("36 km/h", Dimension::new(1, 0, -1, 0), 10.0),
        ] {
            let value = si(text, dimension).unwrap_or_else(|error| panic!("{text}: {error}"))[0];
            assert!((value - expected).abs() <= 1e-15 * expected.abs(), "{text}: {value}");
        }
        assert_eq!(si("[-0.42, 0, -2.85] m", M).unwrap(), [-0.42, 0.0, -2.85]);
    }

    #[test]
    fn conversion_returns_values_in_requested_unit() {
        for (text, unit, expected) in [
            ("0.1 rad", "rad", 0.1),
            ("180 deg", "rad", std::f64::consts::PI),
            ("2 mm", "m", 0.002),
            ("90 deg", "deg", 90.0),
            ("0.5 rad", "mrad", 500.0),
            ("3 V", "V", 3.0),
            ("0.1 m/s^2", "m/s/s", 0.1),
            ("4 1", "1", 4.0),
            ("2 1/s", "1/s", 2.0),
        ] {
            let (values, listed) = convert(text, unit).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert!(
                (values[0] - expected).abs() <= 1e-15 * expected.abs() && !listed,
                "{text}: {values:?}"
            );
        }
        assert_eq!(convert("[1, 2] mm", "mm").unwrap(), (vec![1.0, 2.0], true));
        for (text, unit, part) in [
            ("0.1", "rad", "no unit"),
            ("0.1 m", "rad", "dimension m"),
            ("0.1 1", "rad", "dimension 1"),
            ("0.1 mV", "V", "`mV`"),
            ("0.1 m", "V", "another unit"),
            ("much rad", "rad", "start with a number"),
            ("[1, x] rad", "rad", "`x` is not a number"),
            ("1e999 rad", "rad", "not finite"),
        ] {
            let message = convert(text, unit).expect_err(text).to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn parser_rejects_other_quantities_with_remedy() {
        for (text, dimension, part) in [
            ("0.5", M, "has no unit"),
            ("[1, 2, 3]", M, "has no unit"),
            ("0.5 furlong", M, "`furlong` in `0.5 furlong` is not a unit"),
            ("0.5 s", M, "dimension s"),
            ("10 deg/s", HZ, "dimension"),
            ("0.2 1/s", Dimension::new(0, 0, -1, 1), "dimension s^-1"),
            ("0.2 1", RAD, "dimension 1"),
            ("fast m/s", Dimension::new(1, 0, -1, 0), "start with a number"),
            ("[1, x, 3] m", M, "start with a number"),
            ("[1, 2 m", M, "start with a number"),
            ("1e999 m", M, "not finite"),
            ("1 m/", M, "`/`"),
            ("1 m//s", M, "`/`"),
            ("1 m^99", M, "m^99"),
            ("", M, "start with a number"),
        ] {
            let message = si(text, dimension).expect_err(text).to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
