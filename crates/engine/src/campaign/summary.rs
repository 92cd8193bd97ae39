//! Summary of a campaign as text: counts, ranges, quantiles, and a character map.

use sampling::statistics::nearest_rank;

use super::Column;
use super::workers::point::{Outcome, Result as PointResult};

/// `84 points: 61 met, 23 not met`
pub fn verdicts(results: &[Option<PointResult>]) -> String {
    let all = [
        (Outcome::Met, "met"),
        (Outcome::NotMet, "not met"),
        (Outcome::Complete, "complete"),
        (Outcome::Refused, "refused"),
        (Outcome::Failed, "failed"),
        (Outcome::Crashed, "crashed"),
    ];
    let mut parts: Vec<String> = Vec::new();
    for (outcome, word) in all {
        let count = results
            .iter()
            .flatten()
            .filter(|result| result.outcome == outcome)
            .count();
        if count > 0 {
            parts.push(format!("{count} {word}"));
        }
    }
    let missing = results.iter().filter(|result| result.is_none()).count();
    if missing > 0 {
        parts.push(format!("{missing} not run"));
    }
    let plural = if results.len() == 1 { "" } else { "s" };
    format!("{} point{plural}: {}", results.len(), parts.join(", "))
}

/// Least, median, 95 % and greatest of the values that are present.
pub fn quantiles(values: impl Iterator<Item = f64>) -> Option<[f64; 4]> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    let at = |part: f64| values[nearest_rank(values.len(), part) - 1];
    Some([values[0], at(0.5), at(0.95), values[last]])
}

/// The ranges of the only varied key in which all points are good: `0 ms to 120 ms, 140 ms`. `None` where neighbours in the table are not
/// neighbours in value, as drawn ones are not.
pub fn met_ranges(column: &Column, results: &[Option<PointResult>]) -> Option<String> {
    let sorted_values = match &column.numbers {
        Some(numbers) => numbers.is_sorted_by(|a, b| a < b) || numbers.is_sorted_by(|a, b| a > b),
        None => distinct(&column.texts).len() == column.texts.len(),
    };
    if !sorted_values {
        return None;
    }
    let good = |at: usize| results[at].as_ref().is_some_and(|result| result.outcome.good());
    let (mut parts, mut at) = (Vec::new(), 0);
    while at < results.len() {
        if !good(at) {
            at += 1;
            continue;
        }
        let first = at;
        while at + 1 < results.len() && good(at + 1) {
            at += 1;
        }
        parts.push(if at > first {
            format!("{} to {}", column.texts[first], column.texts[at])
        } else {
            column.texts[first].clone()
        });
        at += 1;
    }
    Some(if parts.is_empty() {
        "nowhere".into()
    } else {
        parts.join(", ")
    })
}

/// A map over two columns, the second from top to bottom: `#` met (or complete, where there are no criteria), `.` not, `!` no result, `?` not
/// run. `None` where the points are not all combinations of their values, each once.
pub fn map(columns: &[Column], results: &[Option<PointResult>]) -> Option<String> {
    let [first, second] = columns else { return None };
    let (across, down) = (sorted_values(first), sorted_values(second));
    if across.len() * down.len() != results.len() || across.len() > 120 || down.len() > 60 {
        return None;
    }
    let mut cells = vec![None; results.len()];
    for (at, result) in results.iter().enumerate() {
        let column = across.iter().position(|text| **text == first.texts[at])?;
        let row = down.iter().position(|text| **text == second.texts[at])?;
        if cells[column * down.len() + row].replace(result).is_some() {
            return None;
        }
    }
    let width = down.iter().map(|text| text.chars().count()).max().unwrap_or(0);
    let mut out = String::new();
    for (row, name) in down.iter().enumerate() {
        let letters: String = (0..across.len())
            .map(
                |column| match cells[column * down.len() + row].and_then(Option::as_ref) {
                    Some(result) if result.outcome.good() => '#',
                    Some(result) if result.outcome.ran() => '.',
                    Some(_) => '!',
                    None => '?',
                },
            )
            .collect();
        out += &format!("  {name:>width$} {letters}\n");
    }
    let (from, to) = (across.first()?, across.last()?);
    out += &format!(
        "  {:>width$} {} from {from} to {to} (# {}, . not, ! no result)",
        "",
        first.name,
        success_name(results)
    );
    Some(out)
}

/// The name of the outcome of a successful point: `met`, or `complete` where no point has criteria.
pub fn success_name(results: &[Option<PointResult>]) -> &'static str {
    let judged = |result: &PointResult| matches!(result.outcome, Outcome::Met | Outcome::NotMet);
    if results.iter().flatten().any(judged) {
        Outcome::Met.name()
    } else {
        Outcome::Complete.name()
    }
}

/// The values of a column: numbers ascending, texts in order of first occurrence.
fn sorted_values(column: &Column) -> Vec<&String> {
    let Some(numbers) = &column.numbers else {
        return distinct(&column.texts);
    };
    let mut all: Vec<(&f64, &String)> = numbers.iter().zip(&column.texts).collect();
    all.sort_by(|a, b| a.0.total_cmp(b.0));
    let mut texts: Vec<&String> = all.into_iter().map(|(_, text)| text).collect();
    texts.dedup();
    texts
}

/// The values of a column in order of first occurrence.
pub fn distinct(texts: &[String]) -> Vec<&String> {
    let mut seen = std::collections::BTreeSet::new();
    texts.iter().filter(|text| seen.insert(*text)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn results(letters: &str) -> Vec<Option<PointResult>> {
        let outcome = |letter| match letter {
            '#' => Some(Outcome::Met),
            '.' => Some(Outcome::NotMet),
            '!' => Some(Outcome::Failed),
            _ => None,
        };
        letters
            .chars()
            .map(|letter| Some(PointResult::without(outcome(letter)?, "")))
            .collect()
    }

    fn column(name: &str, texts: &[&str]) -> Column {
        Column {
            name: name.into(),
            unit: String::new(),
            texts: texts.iter().map(|text| (*text).to_owned()).collect(),
            numbers: None,
            whole: None,
        }
    }

    #[test]
    fn stretches_cover_ranges_of_met_points() {
        let delays = column("d", &["0", "1", "2", "3", "4"]);
        assert_eq!(met_ranges(&delays, &results("##.#!")).unwrap(), "0 to 1, 3");
        assert_eq!(met_ranges(&delays, &results("....?")).unwrap(), "nowhere");
        let drawn = Column {
            numbers: Some(vec![1.2, 1.9, 1.4]),
            ..column("d", &["1.2", "1.9", "1.4"])
        };
        assert_eq!(met_ranges(&drawn, &results("#.#")), None);
        assert_eq!(met_ranges(&column("d", &["a", "b", "a"]), &results("#.#")), None);
    }

    #[test]
    fn map_places_drawn_points_by_their_values() {
        let numbers = |name: &str, numbers: [f64; 4]| Column {
            numbers: Some(numbers.to_vec()),
            ..column(
                name,
                &numbers.map(|number| number.to_string()).each_ref().map(String::as_str),
            )
        };
        let drawn = [numbers("x", [8.0, 1.0, 1.0, 8.0]), numbers("y", [2.0, 2.0, 1.0, 1.0])];
        let map_of = map(&drawn, &results(".##!")).unwrap();
        assert!(map_of.starts_with("  1 #!\n  2 #.\n"), "{map_of}");
        // One combination twice, another not at all.
        let drawn = [numbers("x", [8.0, 1.0, 1.0, 8.0]), numbers("y", [2.0, 2.0, 1.0, 2.0])];
        assert_eq!(map(&drawn, &results(".##!")), None);
    }

    #[test]
    fn map_has_one_line_per_value_of_second_column() {
        let columns = [
            column("d", &["0", "0", "1", "1", "2", "2"]),
            column("p", &["5", "50", "5", "50", "5", "50"]),
        ];
        let map = map(&columns, &results("#.#!?.")).unwrap();
        assert!(map.starts_with("   5 ##?\n  50 .!.\n"), "{map}");
    }

    #[test]
    fn quantiles_are_nearest_ranks() {
        assert_eq!(quantiles((1..=100).map(f64::from)), Some([1.0, 50.0, 95.0, 100.0]));
        assert_eq!(quantiles([f64::NAN].into_iter()), None);
    }
}
