//! Comparison of the plans of runs.

use std::collections::{BTreeMap, BTreeSet};

use lockstep::time::Rational;
use serde::Serialize;
use toml::{Table, Value};

/// A key whose value is not the same in all runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Difference {
    pub(crate) key: String,
    /// One text for each run; empty where a plan lacks the key.
    pub(crate) values: Vec<String>,
}

/// A longer text is represented by its size.
const LONG: usize = 120;

/// Every key in which the plans differ, in the order of the keys. The path of the scenario is ignored.
pub(crate) fn differences(plans: &[Table]) -> Vec<Difference> {
    let flat: Vec<BTreeMap<String, String>> = plans.iter().map(flatten).collect();
    let keys: BTreeSet<&String> = flat.iter().flat_map(BTreeMap::keys).collect();
    let rows = keys.into_iter().filter(|key| *key != "folder").filter_map(|key| {
        let values: Vec<Option<&String>> = flat.iter().map(|plan| plan.get(key)).collect();
        let differ = values.windows(2).any(|pair| pair[0] != pair[1]);
        differ.then(|| Difference {
            key: key.clone(),
            values: values
                .into_iter()
                .map(|value| value.map_or_else(String::new, |value| shortened(value)))
                .collect(),
        })
    });
    rows.collect()
}

/// Names that describe how the runs differ; `None` where that needs more than two keys, or the names would not be unique.
pub(crate) fn names(differences: &[Difference]) -> Option<Vec<String>> {
    let telling: Vec<&Difference> = differences.iter().filter(|one| one.key != "title").collect();
    let runs = telling.first()?.values.len();
    if telling.len() > 2 {
        return None;
    }
    let name = |run: usize| {
        let parts = telling.iter().map(|one| {
            let key = one
                .key
                .split_once('.')
                .map_or(&*one.key, |(_, rest)| rest)
                .replace(".parameters.", ".");
            match &*one.values[run] {
                "" => format!("no {key}"),
                value => format!("{key} = {value}"),
            }
        });
        parts.collect::<Vec<_>>().join(", ")
    };
    let names: Vec<String> = (0..runs).map(name).collect();
    let told_apart = (1..runs).all(|at| !names[..at].contains(&names[at]));
    let short = names.iter().all(|name| name.chars().count() <= 60);
    (told_apart && short).then_some(names)
}

fn shortened(value: &str) -> String {
    if value.len() <= LONG && !value.contains('\n') {
        return value.to_owned();
    }
    format!(
        "text of {} lines, {:.1} kB",
        value.lines().count(),
        value.len() as f64 / 1e3
    )
}

/// Every leaf of a plan under its dotted key; entries of a list are addressed by name or number.
fn flatten(plan: &Table) -> BTreeMap<String, String> {
    let mut leaves = BTreeMap::new();
    for (key, value) in plan {
        leaf(key, value, &mut leaves);
    }
    leaves
}

fn leaf(key: &str, value: &Value, leaves: &mut BTreeMap<String, String>) {
    match value {
        Value::Table(table) => table
            .iter()
            .for_each(|(name, value)| leaf(&format!("{key}.{name}"), value, leaves)),
        Value::Array(items) if items.iter().any(Value::is_table) => {
            for (at, item) in items.iter().enumerate() {
                let name = item
                    .get("name")
                    .and_then(Value::as_str)
                    .map_or_else(|| (at + 1).to_string(), str::to_owned);
                leaf(&format!("{key}.{name}"), item, leaves);
            }
        }
        // "20ms" and "20 ms" are the same time.
        Value::String(text) => {
            let time = text.parse::<Rational>().map(|time| time.to_string());
            leaves.insert(key.to_owned(), time.unwrap_or_else(|_| text.clone()));
        }
        other => drop(leaves.insert(key.to_owned(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_of(plans: &[&str]) -> (Vec<String>, Option<Vec<String>>) {
        let plans: Vec<Table> = plans.iter().map(|plan| plan.parse().unwrap()).collect();
        let all = differences(&plans);
        (
            all.iter()
                .map(|one| format!("{}: {}", one.key, one.values.join(" | ")))
                .collect(),
            names(&all),
        )
    }

    #[test]
    fn run_names_state_differing_keys() {
        let (rows, names) = text_of(&[
            "folder = 'a'\n[participants.cart]\nperiod = '10 ms'\n[participants.cart.parameters]\nmass = 2",
            "folder = 'b'\n[participants.cart]\nperiod = '20ms'\n[participants.cart.parameters]\nmass = 2",
        ]);
        assert_eq!(rows, ["participants.cart.period: 10 ms | 20 ms"]);
        assert_eq!(names.unwrap(), ["cart.period = 10 ms", "cart.period = 20 ms"]);
    }

    #[test]
    fn plan_difference_shows_missing_and_long_values() {
        let text = "line\n".repeat(40);
        let (rows, names) = text_of(&[
            &format!("[x]\nmodel = '''{text}'''\n[[faults]]\nname = 'stuck'\nat = '1 s'"),
            &format!("[x]\nmodel = '''{text}more'''"),
        ]);
        assert_eq!(
            rows,
            [
                "faults.stuck.at: 1 s | ",
                "faults.stuck.name: stuck | ",
                "x.model: text of 40 lines, 0.2 kB | text of 41 lines, 0.2 kB"
            ]
        );
        assert_eq!(names, None);
        assert_eq!(text_of(&["seed = 1", "seed = 1"]), (Vec::new(), None));
    }
}
