//! Exact instants and durations as fractions of a second.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// An instant or a duration in seconds, exactly: `numerator / denominator` in lowest terms, denominator positive.
///
/// Simulated time is never a sum of rounded doubles. A period of `1/300 s` or a rate of `30 Hz` stays exactly what the user wrote, after
/// any number of steps.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rational {
    numerator: i64,
    denominator: i64,
}

/// Why a text is not a valid time.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TimeError {
    /// The text has no number or no unit of time.
    #[error("`{text}` is not a time: write a number and a unit, for example \"10 ms\", \"1/300 s\" or \"30 Hz\"")]
    Syntax {
        /// What was written.
        text: String,
    },
    /// The unit is not one of time.
    #[error(
        "`{text}` has the unit `{unit}`, which is not one of time: use ns, us, ms, s, min, h, or Hz, kHz for a rate"
    )]
    Unit {
        /// What was written.
        text: String,
        /// The part taken for a unit.
        unit: String,
    },
    /// The fraction has the denominator zero.
    #[error("`{text}` has the denominator zero: write another one, for example \"1/300 s\"")]
    ZeroDenominator {
        /// What was written.
        text: String,
    },
    /// A rate is zero or negative, so it has no period.
    #[error("`{text}` is not a rate above zero: write a rate such as \"30 Hz\", or a period such as \"10 ms\"")]
    Rate {
        /// What was written.
        text: String,
    },
    /// The value does not fit a 64-bit fraction.
    #[error(
        "`{text}` needs a fraction of seconds with more than 63 bits: write a value between 1e-18 s and 9e18 s, with fewer digits"
    )]
    Range {
        /// What was written.
        text: String,
    },
}

pub(crate) fn gcd(a: i128, b: i128) -> i128 {
    let (mut a, mut b) = (a.abs(), b.abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

impl Rational {
    /// Zero seconds.
    pub const ZERO: Rational = Rational {
        numerator: 0,
        denominator: 1,
    };

    /// `numerator / denominator` seconds in lowest terms; `None` when the denominator is zero or 63 bits do not suffice.
    pub fn new(numerator: i128, denominator: i128) -> Option<Rational> {
        if denominator == 0 {
            return None;
        }
        let common = gcd(numerator, denominator).max(1) * denominator.signum();
        Some(Rational {
            numerator: i64::try_from(numerator / common).ok()?,
            denominator: i64::try_from(denominator / common).ok()?,
        })
    }

    /// A whole number of nanoseconds.
    pub fn from_nanos(nanos: i64) -> Rational {
        Rational::new(i128::from(nanos), 1_000_000_000).expect("a 64-bit count of nanoseconds fits")
    }

    /// A whole number of milliseconds.
    pub fn from_millis(millis: i64) -> Rational {
        Rational::new(i128::from(millis), 1000).expect("a 64-bit count of milliseconds fits")
    }

    /// The numerator in lowest terms, s.
    #[inline]
    pub fn numerator(self) -> i64 {
        self.numerator
    }

    /// The denominator in lowest terms, always positive.
    #[inline]
    pub fn denominator(self) -> i64 {
        self.denominator
    }

    /// True above zero.
    pub fn is_positive(self) -> bool {
        self.numerator > 0
    }

    /// True below zero.
    pub fn is_negative(self) -> bool {
        self.numerator < 0
    }

    /// The double nearest to the value, s.
    pub fn seconds(self) -> f64 {
        nearest_double(i128::from(self.numerator), i128::from(self.denominator))
    }

    /// The sum; `None` when it needs more than 63 bits.
    pub fn checked_add(self, other: Rational) -> Option<Rational> {
        let (a, b) = (i128::from(self.numerator), i128::from(self.denominator));
        let (c, d) = (i128::from(other.numerator), i128::from(other.denominator));
        Rational::new(a.checked_mul(d)?.checked_add(c.checked_mul(b)?)?, b.checked_mul(d)?)
    }

    /// An integer multiple; `None` when it needs more than 63 bits.
    pub fn checked_mul(self, factor: i64) -> Option<Rational> {
        Rational::new(
            i128::from(self.numerator).checked_mul(i128::from(factor))?,
            i128::from(self.denominator),
        )
    }

    /// The largest duration of which both are integer multiples; `None` when it needs more than 63 bits.
    pub fn common_measure(self, other: Rational) -> Option<Rational> {
        let (a, b) = (i128::from(self.numerator), i128::from(self.denominator));
        let (c, d) = (i128::from(other.numerator), i128::from(other.denominator));
        let denominators = b / gcd(b, d) * d;
        let numerators = gcd(a.checked_mul(denominators / b)?, c.checked_mul(denominators / d)?);
        Rational::new(numerators, denominators)
    }
}

/// The double nearest to `numerator / denominator` (ties to even), for a positive denominator.
pub(crate) fn nearest_double(numerator: i128, denominator: i128) -> f64 {
    if let (Ok(n), Ok(d)) = (i64::try_from(numerator), i64::try_from(denominator))
        && let Some(exact) = quotient(n, d)
    {
        return exact;
    }
    let magnitude = long_division(numerator.unsigned_abs(), denominator.unsigned_abs());
    if numerator < 0 { -magnitude } else { magnitude }
}

/// The same where both are exactly representable as doubles, so that the one division is the only rounding. Almost every time of a run is
/// of this kind, and 64-bit conversions are one instruction each.
#[inline]
pub(super) fn quotient(numerator: i64, denominator: i64) -> Option<f64> {
    const EXACT: u64 = 1 << 53;
    let exact = numerator.unsigned_abs() <= EXACT && denominator.unsigned_abs() <= EXACT;
    exact.then(|| numerator as f64 / denominator as f64)
}

fn long_division(n: u128, d: u128) -> f64 {
    let (mut quotient, mut remainder, mut exponent) = (n / d, n % d, 0);
    // Binary long division until there are 64 significant bits. The denominator stays below 2^127, so doubling the remainder cannot
    // overflow.
    while quotient < 1 << 63 && n != 0 {
        remainder <<= 1;
        quotient <<= 1;
        if remainder >= d {
            remainder -= d;
            quotient |= 1;
        }
        exponent -= 1;
    }
    if remainder != 0 {
        quotient |= 1; // sticky: decides ties
    }
    // The conversion rounds once, to nearest even; the scale is a power of two.
    quotient as f64 * f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> Ordering {
        let left = i128::from(self.numerator) * i128::from(other.denominator);
        let right = i128::from(other.numerator) * i128::from(self.denominator);
        left.cmp(&right)
    }
}

/// Units of time, largest factor last tried: name, numerator and denominator of its length in seconds.
const UNITS: [(&str, i128, i128); 7] = [
    ("ns", 1, 1_000_000_000),
    ("us", 1, 1_000_000),
    ("µs", 1, 1_000_000),
    ("ms", 1, 1000),
    ("s", 1, 1),
    ("min", 60, 1),
    ("h", 3600, 1),
];

impl FromStr for Rational {
    type Err = TimeError;

    /// Reads `"10 ms"`, `"1/300 s"`, `"0.25 s"`, `"1.5e-3 s"`; a rate such as `"30 Hz"` is read as its period.
    fn from_str(text: &str) -> Result<Rational, TimeError> {
        let syntax = || TimeError::Syntax { text: text.to_owned() };
        let range = || TimeError::Range { text: text.to_owned() };
        let trimmed = text.trim();
        let split = trimmed
            .char_indices()
            .find(|&(at, c)| c.is_alphabetic() && !is_exponent(trimmed, at, c))
            .map_or(trimmed.len(), |(at, _)| at);
        let (value, unit) = (trimmed[..split].trim(), trimmed[split..].trim());
        let number = |text: &str| match decimal(text) {
            Ok(number) => Ok(number),
            Err(DecimalError::NotANumber) => Err(syntax()),
            Err(DecimalError::OutOfRange) => Err(range()),
        };
        let (numerator, denominator) = match value.split_once('/') {
            None => number(value)?,
            Some((above, below)) => {
                let ((a, b), (c, d)) = (number(above.trim())?, number(below.trim())?);
                if c == 0 {
                    return Err(TimeError::ZeroDenominator { text: text.to_owned() });
                }
                (a.checked_mul(d).ok_or_else(range)?, b.checked_mul(c).ok_or_else(range)?)
            }
        };
        let scaled = |n: i128, d: i128| -> Option<Rational> {
            let (n, d) = (numerator.checked_mul(n)?, denominator.checked_mul(d)?);
            Rational::new(n, d)
        };
        let rate = |per_second: i128| -> Result<Rational, TimeError> {
            let hertz = scaled(per_second, 1).ok_or_else(range)?;
            if !hertz.is_positive() {
                return Err(TimeError::Rate { text: text.to_owned() });
            }
            Rational::new(i128::from(hertz.denominator), i128::from(hertz.numerator)).ok_or_else(range)
        };
        // The Greek letter looks like the sign for micro, and keyboards have either.
        match unit.replace('\u{3bc}', "\u{b5}").as_str() {
            "Hz" => rate(1),
            "kHz" => rate(1000),
            "" => Err(syntax()),
            known => {
                let &(_, n, d) = UNITS
                    .iter()
                    .find(|(name, ..)| *name == known)
                    .ok_or_else(|| TimeError::Unit {
                        text: text.to_owned(),
                        unit: unit.to_owned(),
                    })?;
                scaled(n, d).ok_or_else(range)
            }
        }
    }
}

fn is_exponent(text: &str, at: usize, c: char) -> bool {
    let after = text[at..].chars().nth(1);
    (c == 'e' || c == 'E')
        && text[..at].ends_with(|d: char| d.is_ascii_digit() || d == '.')
        && after.is_some_and(|d| d.is_ascii_digit() || d == '-' || d == '+')
}

/// Why a text is not read as a decimal number.
enum DecimalError {
    NotANumber,
    /// It is a number, but its fraction does not fit.
    OutOfRange,
}

/// A decimal number as an exact fraction.
fn decimal(text: &str) -> Result<(i128, i128), DecimalError> {
    let signed = |text: &str| -> (bool, String) {
        let negative = text.strip_prefix('-');
        let rest = negative.unwrap_or_else(|| text.strip_prefix('+').unwrap_or(text));
        (negative.is_some(), rest.to_owned())
    };
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    if !digits(&signed(exponent).1) {
        return Err(DecimalError::NotANumber);
    }
    let (negative, unsigned) = signed(mantissa);
    let (whole, fraction) = unsigned.split_once('.').unwrap_or((&unsigned, ""));
    let all = format!("{whole}{fraction}");
    if !digits(&all) {
        return Err(DecimalError::NotANumber);
    }
    if all.bytes().all(|b| b == b'0') {
        return Ok((0, 1));
    }
    let fraction = || -> Option<(i128, i128)> {
        let value: i128 = Some(&all).filter(|all| all.len() <= 30)?.parse().ok()?;
        let value = if negative { -value } else { value };
        let power = exponent
            .parse::<i32>()
            .ok()?
            .checked_sub(i32::try_from(fraction.len()).ok()?)?;
        let scale = 10_i128.checked_pow(power.unsigned_abs())?;
        if power < 0 {
            Some((value, scale))
        } else {
            Some((value.checked_mul(scale)?, 1))
        }
    };
    let (n, d) = fraction().ok_or(DecimalError::OutOfRange)?;
    let common = gcd(n, d).max(1);
    Ok((n / common, d / common))
}

impl fmt::Display for Rational {
    /// The shortest exact text: `"10 ms"`, `"1/300 s"`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.denominator == 1 {
            return write!(f, "{} s", self.numerator);
        }
        for (name, n, d) in [("ms", 1, 1000), ("us", 1, 1_000_000), ("ns", 1, 1_000_000_000)] {
            let scaled = i128::from(self.numerator) * d;
            if scaled % (i128::from(self.denominator) * n) == 0 {
                return write!(f, "{} {name}", scaled / (i128::from(self.denominator) * n));
            }
        }
        write!(f, "{}/{} s", self.numerator, self.denominator)
    }
}

impl fmt::Debug for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Serialize for Rational {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Rational {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check(text: &str, numerator: i128, denominator: i128) {
        assert_eq!(
            text.parse::<Rational>().unwrap(),
            Rational::new(numerator, denominator).unwrap(),
            "{text}"
        );
    }

    #[test]
    fn time_parser_accepts_common_notations() {
        check("10 ms", 1, 100);
        check("10ms", 1, 100);
        check("30 Hz", 1, 30);
        check("1/300 s", 1, 300);
        check("1.5e-3 s", 3, 2000);
        check("2e3us", 1, 500);
        check("0.1 kHz", 1, 100);
        check("-3 s", -3, 1);
        check("2 min", 120, 1);
        check("1/3 ms", 1, 3000);
        check("250 \u{b5}s", 1, 4000);
        check("250 \u{3bc}s", 1, 4000);
        check("0e400 s", 0, 1);
        check("+1.50e+1 s", 15, 1);
    }

    #[test]
    fn time_parser_rejects_other_texts() {
        for text in [
            "", "10", "ms", "ten ms", "10 m", "1/0 s", "0 Hz", "-2 Hz", "1 2 s", "1e99 s", "0.2 deg",
        ] {
            assert!(text.parse::<Rational>().is_err(), "{text}");
        }
    }

    #[test]
    fn time_error_names_text_and_defect() {
        for (text, part) in [
            ("1/0 s", "denominator zero"),
            ("0/0 ms", "denominator zero"),
            ("1/0.0 Hz", "denominator zero"),
            ("0 Hz", "not a rate above zero"),
            ("-2 kHz", "not a rate above zero"),
            ("1/2", "write a number and a unit"),
            ("1 deg", "the unit `deg`"),
            ("1e30 s", "more than 63 bits"),
            ("1e300 s", "more than 63 bits"),
            ("-1e-300 s", "more than 63 bits"),
            ("1e99999999999 s", "more than 63 bits"),
            ("1.2345678901234567890123456789012345 s", "with fewer digits"),
            ("--1 s", "write a number and a unit"),
        ] {
            let error = text.parse::<Rational>().unwrap_err().to_string();
            assert!(error.starts_with(&format!("`{text}`")), "{error}");
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    /// 2^53 + 1 over a power of two: the integer is not a double, and lies in the middle between two.
    #[test]
    fn nearest_double_rounds_ties_to_even() {
        assert_eq!(nearest_double((1 << 53) + 1, 4096), 2.0_f64.powi(41));
        assert_eq!(nearest_double((1 << 53) + 3, 4096), (2.0_f64.powi(53) + 4.0) / 4096.0);
    }

    proptest! {
        #[test]
        fn time_text_round_trips(n in -1_000_000_i128..1_000_000, d in 1_i128..1_000_000) {
            let value = Rational::new(n, d).unwrap();
            prop_assert_eq!(value.to_string().parse::<Rational>().unwrap(), value);
        }

        #[test]
        fn common_measure_divides_both_times(a in 1_i128..100_000, b in 1_i128..100_000, c in 1_i128..100_000, d in 1_i128..100_000) {
            let (x, y) = (Rational::new(a, b).unwrap(), Rational::new(c, d).unwrap());
            let measure = x.common_measure(y).unwrap();
            for value in [x, y] {
                let ratio = Rational::new(
                    i128::from(value.numerator) * i128::from(measure.denominator),
                    i128::from(value.denominator) * i128::from(measure.numerator),
                ).unwrap();
                prop_assert_eq!(ratio.denominator, 1);
            }
        }

        /// The result is the closest double: neither neighbour is nearer. Distances are compared as exact integers.
        #[test]
        fn nearest_double_has_smallest_error(n in 1_i128 << 53..1 << 62, d in 1_i128 << 12..1 << 30) {
            let nearest = nearest_double(n, d);
            // |x - n/d| scaled by d * 2^shift; the quotient lies in [2^23, 2^50], so the mantissa always needs a shift
            let error = |x: f64| {
                let mantissa = i128::from(x.to_bits() & ((1 << 52) - 1) | 1 << 52);
                let shift = 1075 - (x.to_bits() >> 52) as i32;
                (mantissa * d - (n << shift)).unsigned_abs()
            };
            for neighbour in [nearest.next_up(), nearest.next_down()] {
                prop_assert!(error(nearest) <= error(neighbour) || nearest.to_bits() >> 52 != neighbour.to_bits() >> 52);
            }
        }
    }
}
