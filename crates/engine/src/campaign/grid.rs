//! Grids of the command line: `KEY=VALUES`, with lists and ranges of exact quantities.

use std::collections::HashSet;

use super::{Column, POINTS_MAX};

/// A mistake in a `--vary`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("--vary {text}: {reason}")]
pub struct GridError {
    /// The argument.
    pub text: String,
    /// The mistake, and the remedy.
    pub reason: String,
}

fn refuse(text: &str, reason: impl Into<String>) -> GridError {
    GridError {
        text: text.to_owned(),
        reason: reason.into(),
    }
}

/// A key and the values that it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The dotted key.
    pub key: String,
    /// The values as `--set` takes them.
    pub values: Vec<String>,
    /// The values as numbers, where all of them are numbers of one unit.
    pub numbers: Option<Vec<f64>>,
    /// That unit; empty for pure numbers and texts.
    pub unit: String,
    /// The values where all of them are whole numbers without a unit.
    pub whole: Option<Vec<i64>>,
}

impl std::str::FromStr for Axis {
    type Err = GridError;

    /// Reads `key=1ms,5ms`, `key=0ms..200ms:10ms`, `seed=1..100` or `key=text,other`.
    fn from_str(text: &str) -> Result<Axis, GridError> {
        let (key, list) = text.split_once('=').ok_or_else(|| {
            refuse(
                text,
                "takes KEY.PATH=VALUES, such as connections.measured.delay=0ms..200ms:10ms or seed=1..100",
            )
        })?;
        let (key, mut values) = (key.trim(), Vec::new());
        if key.is_empty() {
            return Err(refuse(text, "names no key"));
        }
        for item in split_items(list) {
            let item = item.trim();
            if item.is_empty() {
                return Err(refuse(text, "has an empty value: write for example 5ms,10ms"));
            }
            match parse_range(item).map_err(|reason| refuse(text, reason))? {
                Some(range) => values.extend(range),
                None => values.push(normalised(item)),
            }
            if values.len() > POINTS_MAX {
                return Err(refuse(text, format!("has more than {POINTS_MAX} values")));
            }
        }
        // If one of the numbers is a decimal, all are read as decimals: 0, 0.1, 0.2.
        if values
            .iter()
            .any(|value| is_unitless_number(value) && value.contains('.'))
        {
            for value in values
                .iter_mut()
                .filter(|value| is_unitless_number(value) && !value.contains('.'))
            {
                value.push_str(".0");
            }
        }
        let mut known = HashSet::new();
        if let Some(twice) = values.iter().find(|value| !known.insert(value.as_str())) {
            return Err(refuse(text, format!("has the value `{twice}` twice")));
        }
        let (numbers, unit) = common_unit(&values);
        let whole = values.iter().map(|value| value.parse().ok()).collect();
        Ok(Axis {
            key: key.to_owned(),
            values,
            numbers,
            unit,
            whole,
        })
    }
}

/// `count` seeds starting at `first`.
pub fn range_of_seeds(first: u64, count: u64) -> Result<Axis, GridError> {
    let text = format!("seed={first}..{}", first.saturating_add(count.saturating_sub(1)));
    if count == 0 || count > POINTS_MAX as u64 {
        return Err(refuse(&text, format!("--seeds takes 1 to {POINTS_MAX}, not {count}")));
    }
    text.parse()
}

/// All combinations, the first axis slowest: columns for the table, and the changes of each point.
pub fn grid(axes: &[Axis]) -> Result<(Vec<Column>, Vec<Vec<String>>), GridError> {
    for (at, axis) in axes.iter().enumerate() {
        if axes[..at].iter().any(|other| other.key == axis.key) {
            return Err(refuse(
                &axis.key,
                "is varied twice: give all of its values in one --vary",
            ));
        }
    }
    let count = axes
        .iter()
        .try_fold(1_usize, |count, axis| count.checked_mul(axis.values.len()));
    let count = count.filter(|count| *count <= POINTS_MAX).ok_or_else(|| {
        let sizes: Vec<String> = axes.iter().map(|axis| axis.values.len().to_string()).collect();
        refuse(
            &axes.iter().map(|axis| axis.key.clone()).collect::<Vec<_>>().join(" x "),
            format!("{} points are more than {POINTS_MAX}: vary less", sizes.join(" x ")),
        )
    })?;
    let mut columns = Vec::new();
    let mut points = vec![Vec::new(); count];
    let mut every = count;
    for axis in axes {
        every /= axis.values.len();
        let at = |point: usize| point / every % axis.values.len();
        for (number, changes) in points.iter_mut().enumerate() {
            changes.push(format!("{}={}", axis.key, axis.values[at(number)]));
        }
        columns.push(Column {
            name: axis.key.clone(),
            unit: axis.unit.clone(),
            texts: (0..count).map(|point| axis.values[at(point)].clone()).collect(),
            numbers: axis
                .numbers
                .as_ref()
                .map(|numbers| (0..count).map(|point| numbers[at(point)]).collect()),
            whole: axis
                .whole
                .as_ref()
                .map(|whole| (0..count).map(|point| whole[at(point)]).collect()),
        });
    }
    Ok((columns, points))
}

/// The parts between commas outside brackets and quotes.
fn split_items(list: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth, mut quote) = (Vec::new(), 0, 0_i32, None);
    for (at, letter) in list.char_indices() {
        match (quote, letter) {
            (Some(mark), letter) if letter == mark => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(letter),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth -= 1,
            (None, ',') if depth == 0 => {
                parts.push(&list[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&list[start..]);
    parts
}

/// The values of `a..b:step` or, for whole numbers, `a..b`; `None` for text that is not a range.
fn parse_range(item: &str) -> Result<Option<Vec<String>>, String> {
    if item.starts_with(['[', '{', '"', '\'']) {
        return Ok(None);
    }
    let Some((first, rest)) = item.split_once("..") else {
        return Ok(None);
    };
    let (last, step) = match rest.split_once(':') {
        Some((last, step)) => (last, Some(step)),
        None => (rest, None),
    };
    // A path such as ../laws contains two dots as well; a value that does not start with a number is text.
    let Some(first) = ExactDecimal::parse(first) else {
        return Ok(None);
    };
    let number =
        |text: &str| ExactDecimal::parse(text).ok_or_else(|| format!("`{}` is not a number with a unit", text.trim()));
    let last = number(last)?;
    let step = match step {
        Some(step) => number(step)?,
        None if first.is_whole() && last.is_whole() => ExactDecimal {
            digits: 1,
            places: 0,
            unit: first.unit.clone(),
            point: false,
        },
        None => {
            return Err(format!(
                "`{item}` has no step: write FIRST..LAST:STEP, such as 0ms..200ms:10ms"
            ));
        }
    };
    let unit = step.unit.clone();
    let places = |number: &ExactDecimal| -> Result<ExactDecimal, String> {
        number
            .in_unit(&unit)
            .ok_or_else(|| format!("`{item}` mixes units: write all three in `{unit}`"))
    };
    let (first, last) = (places(&first)?, places(&last)?);
    let finest = first.places.max(last.places).max(step.places);
    let scaled = |number: &ExactDecimal| {
        10_i128
            .checked_pow(finest - number.places)
            .and_then(|factor| number.digits.checked_mul(factor))
            .ok_or_else(|| format!("`{item}` has too many digits"))
    };
    let point = first.point || last.point || step.point;
    let (first, last, step) = (scaled(&first)?, scaled(&last)?, scaled(&step)?);
    if step == 0 || (last - first).signum() * step.signum() < 0 {
        return Err(format!("`{item}` never gets to its end with this step"));
    }
    let count = (last - first) / step + 1;
    if count > POINTS_MAX as i128 {
        return Err(format!("`{item}` has {count} values, more than {POINTS_MAX}"));
    }
    let values = (0..count).map(|k| {
        ExactDecimal {
            digits: first + k * step,
            places: finest,
            unit: unit.clone(),
            point,
        }
        .text()
    });
    Ok(Some(values.collect()))
}

/// One value: a number gets one space before its unit, other values are unchanged.
fn normalised(item: &str) -> String {
    match ExactDecimal::parse(item) {
        Some(number) if number.unit.chars().next().is_none_or(char::is_alphabetic) => number.text(),
        _ => item.to_owned(),
    }
}

/// Whether it is a number without a unit.
fn is_unitless_number(value: &str) -> bool {
    ExactDecimal::parse(value).is_some_and(|number| number.unit.is_empty())
}

fn common_unit(values: &[String]) -> (Option<Vec<f64>>, String) {
    let numbers: Option<Vec<ExactDecimal>> = values.iter().map(|value| ExactDecimal::parse(value)).collect();
    let Some(numbers) = numbers else {
        return (None, String::new());
    };
    let Some(unit) = numbers.first().map(|number| number.unit.clone()) else {
        return (None, String::new());
    };
    let plain = unit
        .chars()
        .all(|letter| letter.is_alphanumeric() || " ^/*·²³°µ-".contains(letter));
    let same: Option<Vec<f64>> = numbers
        .iter()
        .map(|number| number.in_unit(&unit).and_then(|number| number.value()))
        .collect();
    match same {
        Some(same) if plain => (Some(same), unit),
        _ => (None, String::new()),
    }
}

/// An exact decimal with a unit: `digits` · 10^-`places`.
#[derive(Debug, Clone, PartialEq, Eq)]
struct ExactDecimal {
    digits: i128,
    places: u32,
    unit: String,
    /// Whether it was written with a point or an exponent.
    point: bool,
}

impl ExactDecimal {
    fn parse(text: &str) -> Option<ExactDecimal> {
        let text = text.trim();
        let end = text
            .char_indices()
            .find(|&(at, letter)| !(letter.is_ascii_digit() || letter == '.' || (at == 0 && "+-".contains(letter))))
            .map_or(text.len(), |(at, _)| at);
        let (number, mut unit) = (&text[..end], text[end..].trim());
        let mut power = 0_i32;
        if let Some(rest) = text[end..].strip_prefix(['e', 'E']) {
            let sign = usize::from(rest.starts_with(['+', '-']));
            let length = rest[sign..].chars().take_while(char::is_ascii_digit).count();
            if length > 0 {
                power = rest[..sign + length].parse().ok()?;
                unit = rest[sign + length..].trim();
            }
        }
        let (negative, digits) = match number.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, number.strip_prefix('+').unwrap_or(number)),
        };
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        if fraction.contains('.') || (whole.is_empty() && fraction.is_empty()) || whole.len() + fraction.len() > 30 {
            return None;
        }
        let digits: i128 = format!("{whole}{fraction}").parse().ok()?;
        let places = i32::try_from(fraction.len()).ok()? - power;
        let (digits, places) = if places < 0 {
            (digits.checked_mul(10_i128.checked_pow(places.unsigned_abs())?)?, 0)
        } else {
            (digits, places.unsigned_abs())
        };
        (places <= 30).then(|| ExactDecimal {
            digits: if negative { -digits } else { digits },
            places,
            unit: unit.to_owned(),
            point: number.contains('.') || text[end..].starts_with(['e', 'E']),
        })
    }

    fn is_whole(&self) -> bool {
        self.places == 0 && self.unit.is_empty()
    }

    /// The same quantity in `unit`: units of time are converted, zero needs no unit, others must be the same.
    fn in_unit(&self, unit: &str) -> Option<ExactDecimal> {
        if self.unit == unit || (self.digits == 0 && self.unit.is_empty()) {
            return Some(ExactDecimal {
                unit: unit.to_owned(),
                ..self.clone()
            });
        }
        let power = |unit: &str| match unit {
            "s" => Some(0_i32),
            "ms" => Some(-3),
            "us" | "\u{b5}s" | "\u{3bc}s" => Some(-6),
            "ns" => Some(-9),
            _ => None,
        };
        let places = i32::try_from(self.places).ok()? - (power(&self.unit)? - power(unit)?);
        let (digits, places) = if places < 0 {
            (self.digits.checked_mul(10_i128.checked_pow(places.unsigned_abs())?)?, 0)
        } else {
            (self.digits, places.unsigned_abs())
        };
        Some(ExactDecimal {
            digits,
            places,
            unit: unit.to_owned(),
            point: self.point,
        })
    }

    /// The decimal text without the unit and without trailing zeros.
    fn decimal(&self) -> String {
        let (mut digits, mut places) = (self.digits, self.places);
        while places > 0 && digits % 10 == 0 {
            (digits, places) = (digits / 10, places - 1);
        }
        let sign = if digits < 0 { "-" } else { "" };
        let places = places as usize;
        let text = format!("{:0>width$}", digits.unsigned_abs(), width = places + 1);
        let (whole, fraction) = text.split_at(text.len() - places);
        if fraction.is_empty() {
            format!("{sign}{whole}")
        } else {
            format!("{sign}{whole}.{fraction}")
        }
    }

    fn text(&self) -> String {
        if self.unit.is_empty() {
            let mut text = self.decimal();
            if self.point && !text.contains('.') {
                text += ".0";
            }
            text
        } else {
            format!("{} {}", self.decimal(), self.unit)
        }
    }

    fn value(&self) -> Option<f64> {
        self.decimal().parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Vec<String> {
        text.parse::<Axis>().unwrap().values
    }

    #[test]
    fn axis_range_is_exact_and_includes_both_ends() {
        assert_eq!(values("d=0ms..30ms:10ms"), ["0 ms", "10 ms", "20 ms", "30 ms"]);
        assert_eq!(values("d=0..0.3 s:100ms"), ["0 ms", "100 ms", "200 ms", "300 ms"]);
        assert_eq!(values("f=0.1 N..0.3 N:0.1 N"), ["0.1 N", "0.2 N", "0.3 N"]);
        assert_eq!(values("f=1..0.4:-0.3"), ["1.0", "0.7", "0.4"]);
        assert_eq!(values("f=0ms..25ms:10ms"), ["0 ms", "10 ms", "20 ms"]);
        assert_eq!(values("seed=3..6"), ["3", "4", "5", "6"]);
        assert_eq!(values("d=1ms,5ms..15ms:5ms"), ["1 ms", "5 ms", "10 ms", "15 ms"]);
        assert_eq!(values("x=1e-3..3e-3:1e-3"), ["0.001", "0.002", "0.003"]);
        let axis: Axis = "d=0ms..200ms:0.1ms".parse().unwrap();
        assert_eq!(axis.values.len(), 2001);
        assert_eq!((axis.numbers.unwrap()[7], &*axis.unit), (0.7, "ms"));
    }

    #[test]
    fn axis_list_takes_texts_vectors_tables_and_paths() {
        assert_eq!(values("law=hierarchical,reference"), ["hierarchical", "reference"]);
        assert_eq!(values("p=[1, 2] m,[3,4] m"), ["[1, 2] m", "[3,4] m"]);
        let files = "g={ file = \"../laws/a.toml\" },{ file = \"../laws/b,c.toml\" }";
        assert_eq!(
            values(files),
            ["{ file = \"../laws/a.toml\" }", "{ file = \"../laws/b,c.toml\" }"]
        );
        assert_eq!(values("period=1/300 s,10ms"), ["1/300 s", "10 ms"]);
        assert_eq!("period=1/300 s,10ms".parse::<Axis>().unwrap().numbers, None);
        let mixed: Axis = "d=500us,1ms".parse().unwrap();
        assert_eq!((mixed.numbers, &*mixed.unit), (Some(vec![500.0, 1000.0]), "us"));
    }

    #[test]
    fn axis_parser_rejects_invalid_text_with_remedy() {
        for (text, part) in [
            ("seed", "takes KEY.PATH=VALUES"),
            ("=1", "names no key"),
            ("d=1ms,,2ms", "empty value"),
            ("d=", "empty value"),
            ("d=0ms..10ms", "has no step"),
            ("d=0ms..10ms:0ms", "never gets to its end"),
            ("d=10ms..0ms:1ms", "never gets to its end"),
            ("d=0 N..10 m:1 N", "mixes units"),
            ("d=1ms,1.0ms", "twice"),
            ("d=0ms..1s:1us", "more than 100000"),
            ("d=1ms..x:1ms", "`x` is not a number"),
        ] {
            let error = text.parse::<Axis>().unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
        let axes = ["a=1..1000", "b=1..1000"].map(|text| text.parse().unwrap());
        assert!(grid(&axes).unwrap_err().to_string().contains("1000 x 1000 points"));
        let axes = ["a=1", "a=2"].map(|text| text.parse().unwrap());
        assert!(grid(&axes).unwrap_err().to_string().contains("varied twice"));
        assert!(range_of_seeds(1, 0).is_err());
    }

    #[test]
    fn decimal_axis_stays_decimal_at_its_whole_numbers() {
        assert_eq!(values("x=0..0.2:0.1"), ["0.0", "0.1", "0.2"]);
        assert_eq!(values("x=-0.5,0,3"), ["-0.5", "0.0", "3.0"]);
        assert_eq!(values("x=1.0,2.0"), ["1.0", "2.0"]);
        assert_eq!(values("x=1.0..3.0:1.0"), ["1.0", "2.0", "3.0"]);
        assert_eq!(values("x=1e20,2"), ["100000000000000000000.0", "2.0"]);
        assert_eq!(values("x=0..2:1"), ["0", "1", "2"]);
        assert_eq!(values("x=0.0 m,1 m"), ["0 m", "1 m"]);
        assert!("x=1,1.0".parse::<Axis>().unwrap_err().reason.contains("twice"));
    }

    #[test]
    fn axis_integers_keep_all_of_their_digits() {
        let axis = "seed=9007199254740993..9007199254740995".parse::<Axis>().unwrap();
        assert_eq!(
            axis.whole,
            Some(vec![
                9_007_199_254_740_993,
                9_007_199_254_740_994,
                9_007_199_254_740_995
            ])
        );
        let axis = range_of_seeds(u64::MAX - 1, 2).unwrap();
        assert_eq!(axis.values, ["18446744073709551614", "18446744073709551615"]);
        assert_eq!((axis.whole, axis.unit.as_str()), (None, ""));
    }

    #[test]
    fn grid_varies_first_key_slowest() {
        let axes = ["a=1,2", "b=x,y"].map(|text| text.parse().unwrap());
        let (columns, points) = grid(&axes).unwrap();
        assert_eq!(points, [["a=1", "b=x"], ["a=1", "b=y"], ["a=2", "b=x"], ["a=2", "b=y"]]);
        assert_eq!(columns[1].texts, ["x", "y", "x", "y"]);
        assert_eq!(columns[0].numbers, Some(vec![1.0, 1.0, 2.0, 2.0]));
    }
}
