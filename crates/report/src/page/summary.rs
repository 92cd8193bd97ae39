//! The table of figures of merit, from the summaries of the runs.

use serde::Serialize;
use serde_json::Value;

/// A line of the table: one figure of merit, a value per run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    pub(crate) key: String,
    /// Its name in words, without the unit.
    pub(crate) label: String,
    pub(crate) unit: String,
    /// The values as text; empty where a run has no such value.
    pub(crate) values: Vec<String>,
    /// Whether the value meets its criterion, where there is one.
    pub(crate) met: Vec<Option<bool>>,
    /// The criterion in words, where there is one.
    pub(crate) criterion: String,
    /// Whether it is among the rows shown first.
    pub(crate) main: bool,
    /// Whether it is the row with the word for how the run ended.
    pub(crate) verdict: bool,
}

/// Unit suffixes of keys, longest first, with their symbols.
const UNITS: &[(&str, &str)] = &[
    ("_m2_s5", "m²/s⁵"),
    ("_kg_m_s", "kg m/s"),
    ("_n_m_s", "N m s"),
    ("_rad_s", "rad/s"),
    ("_deg_s", "deg/s"),
    ("_n_m", "N m"),
    ("_m_s", "m/s"),
    ("_n_s", "N s"),
    ("_rad", "rad"),
    ("_deg", "deg"),
    ("_kg", "kg"),
    ("_ms", "ms"),
    ("_m", "m"),
    ("_s", "s"),
    ("_n", "N"),
    ("_j", "J"),
];

/// Keys that are shown elsewhere on the page, or not at all.
const HIDDEN: &[&str] = &[
    "tape_digest",
    "criteria",
    "measures",
    "verdict",
    "timing",
    "placement",
    "run_folder",
    "trace",
    "tape_has_only",
];

/// The prefix of a measure's name in the key of its row.
const MEASURES: &str = "measures.";

/// How a run ended: in words, and whether that is as intended; empty for a run without a summary.
pub(crate) fn outcome(summary: &Value) -> Option<(String, bool)> {
    let status = summary["ending"]["status"].as_str()?;
    if status != "complete" {
        return Some((status.replace('-', " "), false));
    }
    let criteria = summary["criteria"].as_array().filter(|all| !all.is_empty());
    Some(match criteria.map(|all| all.iter().all(|one| one["met"] == true)) {
        Some(true) => ("met".to_owned(), true),
        Some(false) => ("not met".to_owned(), false),
        None => ("complete".to_owned(), true),
    })
}

/// One row per key of any summary; the keys of `first` come first, and one of them whose value is true or false is the
/// verdict.
pub(crate) fn rows(summaries: &[Value], first: &[String]) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for (run, summary) in summaries.iter().enumerate() {
        let mut leaves = Vec::new();
        flatten("", summary, &mut leaves);
        let measures = summary.get("measures").and_then(Value::as_object).into_iter().flatten();
        leaves.extend(measures.map(|(name, measure)| (format!("{MEASURES}{name}"), measure.clone())));
        for (key, value) in leaves {
            let at = rows.iter().position(|row| row.key == key).unwrap_or_else(|| {
                let measure = key.strip_prefix(MEASURES);
                let (label, unit) = measure.map_or_else(
                    || label_and_unit(&key),
                    |own| (label_and_unit(&own.replace('-', "_")).0, ""),
                );
                rows.push(Row {
                    label,
                    unit: unit.to_owned(),
                    values: vec![String::new(); summaries.len()],
                    met: vec![None; summaries.len()],
                    criterion: String::new(),
                    main: first.contains(&key) || measure.is_some(),
                    verdict: first.contains(&key) && value.is_boolean(),
                    key: key.clone(),
                });
                rows.len() - 1
            });
            let row = &mut rows[at];
            row.values[run] = text(&value);
            if row.key.starts_with(MEASURES) {
                let unit = value["unit"].as_str().filter(|unit| *unit != "1");
                row.unit = unit.unwrap_or_default().to_owned();
                row.values[run] = match (&value["value"], value["reason"].as_str()) {
                    (Value::Null, None) => "not measured".to_owned(),
                    (Value::Null, Some(reason)) => format!("not measured: {reason}"),
                    (value, _) => text(value),
                };
            }
            if let Some(CriterionResult {
                criterion,
                value,
                unit,
                met,
            }) = criterion(summary, &key)
            {
                (row.criterion, row.unit) = (criterion, unit);
                row.main = true;
                row.met[run] = met;
                row.values[run] = value;
            } else if let Value::Bool(yes) = value {
                row.met[run] = row.verdict.then_some(yes);
            }
        }
    }
    rows.sort_by_key(|row| first.iter().position(|key| *key == row.key).unwrap_or(first.len()));
    rows
}

fn flatten(prefix: &str, value: &Value, leaves: &mut Vec<(String, Value)>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let path = if prefix.is_empty() {
                    key.clone()
                } else {
                    format!("{prefix}.{key}")
                };
                if !HIDDEN.contains(&key.as_str()) {
                    flatten(&path, value, leaves);
                }
            }
        }
        Value::Null => {}
        value => leaves.push((prefix.to_owned(), value.clone())),
    }
}

/// A figure with its criterion, in the unit in which the criterion is stated.
struct CriterionResult {
    criterion: String,
    value: String,
    unit: String,
    met: Option<bool>,
}

/// `criteria` of a summary is a list of `{ name, value, limit, unit, met }`; the name is that of the figure without its
/// unit.
fn criterion(summary: &Value, key: &str) -> Option<CriterionResult> {
    let key = key.strip_prefix(MEASURES).unwrap_or(key);
    let (stem, _) = split_unit(key);
    let all = summary.get("criteria")?.as_array()?;
    let entry = all.iter().find(|c| c["name"] == stem || c["name"] == key)?;
    let unit = entry["unit"].as_str().filter(|unit| *unit != "1").unwrap_or_default();
    let bound = |name: &str| entry[name].as_f64().map(five_digits);
    let words = match (bound("at_least"), bound("limit")) {
        (Some(least), Some(most)) => format!("from {least} to {most} {unit}"),
        (Some(least), None) => format!("at least {least} {unit}"),
        (None, Some(most)) => format!("at most {most} {unit}"),
        (None, None) => return None,
    };
    Some(CriterionResult {
        criterion: words.trim_end().to_owned(),
        value: match (entry["value"].as_f64(), entry["reason"].as_str()) {
            (Some(value), _) => five_digits(value),
            (None, Some(reason)) => format!("not measured: {reason}"),
            (None, None) => "not measured".to_owned(),
        },
        unit: unit.to_owned(),
        met: entry["met"].as_bool(),
    })
}

/// A key of `summary.json` without its unit suffix, and the symbol of the unit; empty where it has none.
pub fn split_unit(key: &str) -> (&str, &'static str) {
    let known = |(suffix, unit): &(&str, &'static str)| Some((key.strip_suffix(suffix)?, *unit));
    UNITS.iter().find_map(known).unwrap_or((key, ""))
}

fn label_and_unit(key: &str) -> (String, &'static str) {
    let (stem, unit) = split_unit(key);
    let words = stem.replace(['_', '.'], " ");
    let mut letters = words.chars();
    let label = letters
        .next()
        .map_or(String::new(), |first| first.to_uppercase().chain(letters).collect());
    (label, unit)
}

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), five_digits),
        Value::Array(items) => items.iter().map(round_list_number).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// A number of a list, rounded: only the magnitudes of lists matter.
fn round_list_number(value: &Value) -> String {
    match value.as_f64() {
        Some(x) if x != 0.0 && x.abs() < 1e-4 => format!("{x:.1e}"),
        Some(x) => format!("{x:.3}").trim_end_matches('0').trim_end_matches('.').to_owned(),
        None => text(value),
    }
}

/// Five significant digits, without an exponent where a reader would not expect one.
fn five_digits(x: f64) -> String {
    if x == x.trunc() && x.abs() < 1e7 {
        return format!("{x}");
    }
    if x.abs() >= 1e6 || x.abs() < 1e-4 {
        return format!("{x:.4e}");
    }
    let digits = (4 - x.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{x:.digits$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn summary_keys_become_labels_with_units() {
        let a = json!({"landed": true, "peak_torque_n_m": 0.073_912_34, "idle_fraction": 0.0,
            "criteria": [{"name": "peak_torque", "value": 73.912_34, "limit": 200, "unit": "mN m", "met": true}], "tape_digest": "x"});
        let b = json!({"landed": false, "wall_time_s": 1.0});
        let first = ["landed", "peak_torque_n_m", "idle_fraction"].map(String::from);
        let rows = rows(&[a, b], &first);
        let lines: Vec<_> = rows
            .iter()
            .map(|r| (&*r.label, &*r.unit, &*r.values[0], &*r.values[1], r.met.clone()))
            .collect();
        assert_eq!(lines[0], ("Landed", "", "yes", "no", vec![Some(true), Some(false)]));
        assert_eq!(lines[1], ("Peak torque", "mN m", "73.912", "", vec![Some(true), None]));
        assert_eq!(lines[2], ("Idle fraction", "", "0", "", vec![None, None]));
        assert_eq!(lines[3], ("Wall time", "s", "", "1", vec![None, None]));
        assert!(rows[0].verdict && !rows[1].verdict);
        assert_eq!(rows[1].criterion, "at most 200 mN m");
    }

    #[test]
    fn measure_rows_have_their_criteria() {
        let summary = json!({"ending": {"status": "complete"},
            "measures": {"over_shoot": {"value": 2.5, "unit": "mm"}, "late": {"value": null, "unit": "s", "reason": "never"}},
            "criteria": [{"name": "over_shoot", "value": 2.5, "limit": 2, "at_least": -1, "unit": "mm", "met": false}]});
        let rows = rows(&[summary], &[]);
        let text_of = |key: &str| {
            let row = rows.iter().find(|row| row.key == key).unwrap();
            format!(
                "{} {} {} ({}) {:?} {}",
                row.label, row.values[0], row.unit, row.criterion, row.met[0], row.main
            )
        };
        assert_eq!(
            text_of("measures.over_shoot"),
            "Over shoot 2.5 mm (from -1 to 2 mm) Some(false) true"
        );
        assert_eq!(text_of("measures.late"), "Late not measured: never s () None true");
    }

    #[test]
    fn outcome_text_states_ending_and_criteria() {
        let text_of = |summary: Value| {
            outcome(&summary)
                .map(|(text, good)| format!("{text}, {good}"))
                .unwrap_or_default()
        };
        assert_eq!(text_of(json!({"ending": {"status": "complete"}})), "complete, true");
        assert_eq!(
            text_of(json!({"ending": {"status": "complete"}, "criteria": [{"met": false}]})),
            "not met, false"
        );
        assert_eq!(text_of(json!({"ending": {"status": "failed"}})), "failed, false");
        assert_eq!(text_of(Value::Null), "");
    }

    #[test]
    fn summary_numbers_have_five_digits() {
        for (x, expected) in [
            (1.1e-4, "0.00011"),
            (1.234_567_8e-7, "1.2346e-7"),
            (123.456_78, "123.46"),
            (-0.5, "-0.5"),
            (1e300, "1.0000e300"),
        ] {
            assert_eq!(five_digits(x), expected);
        }
    }
}
