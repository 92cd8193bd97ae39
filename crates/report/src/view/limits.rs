//! Limits defined elsewhere in a scenario: those of its guards and of its measures.

use toml::{Table, Value};

use super::{Line, Signal};

/// Lines for every figure that draws a signal unchanged, or its difference from another one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Limit {
    pub(crate) of: Signal,
    pub(crate) minus: Option<Signal>,
    /// The reduction: the length of a vector (`norm`), or the angle between two attitudes (`angle`).
    pub(crate) through: Option<String>,
    pub(crate) lines: Vec<Line>,
}

/// The limits of the guards and the measures of a plan. A limit that is not in the quantity of the signal itself (of a
/// duration, an integral) is not drawn.
pub(crate) fn limits_of(plan: &Table) -> Vec<Limit> {
    let section = |name: &str| plan.get(name).and_then(Value::as_table).into_iter().flatten();
    let guards = section("guards").filter_map(|(name, guard)| of_guard(name, guard.as_table()?));
    let measures = section("measures").filter_map(|(name, measure)| of_measure(name, measure.as_table()?));
    guards.chain(measures).collect()
}

fn of_guard(name: &str, guard: &Table) -> Option<Limit> {
    let text = |key: &str| guard.get(key).and_then(Value::as_str);
    Some(Limit {
        of: Signal::named(&format!("{}.{}", text("output")?, text("field")?))?,
        minus: None,
        through: None,
        lines: bounds(guard.get("range")?, &format!("guard {name}"))?,
    })
}

/// Measures whose value is one of the signal's own values.
const VALUES: &[&str] = &["min", "max", "max-abs", "mean", "rms", "final", "at", "percentile"];

fn of_measure(name: &str, measure: &Table) -> Option<Limit> {
    let text = |key: &str| measure.get(key).and_then(Value::as_str);
    let compute = text("compute")?;
    if !VALUES.contains(&compute) {
        return None;
    }
    let mut lines = Vec::new();
    let both_signs = compute == "max-abs" || compute == "rms";
    for (key, words) in [("at-most", "at most"), ("at-least", "at least")] {
        if let Some(at) = measure.get(key) {
            let text = format!("{name}: {words}");
            if both_signs {
                lines.extend(negated(at).map(|at| Line { at, text: text.clone() }));
            }
            lines.push(Line { at: at.clone(), text });
        }
    }
    if let Some(range) = measure.get("within") {
        lines.extend(bounds(range, &format!("{name}: within"))?);
    }
    (!lines.is_empty()).then(|| {
        Limit {
            of: Signal::named(text("of")?)?,
            minus: text("minus").and_then(Signal::named),
            through: text("through").map(str::to_owned),
            lines,
        }
        .into()
    })?
}

/// The two ends of `"[-1, 2] m"` or `[-1, 2]`.
fn bounds(range: &Value, text: &str) -> Option<Vec<Line>> {
    let line = |at: Value| Line {
        at,
        text: text.to_owned(),
    };
    match range {
        Value::Array(ends) => Some(ends.iter().cloned().map(line).collect()),
        Value::String(written) => {
            let (numbers, unit) = written.trim().strip_prefix('[')?.split_once(']')?;
            let ends = numbers
                .split(',')
                .map(|number| format!("{} {}", number.trim(), unit.trim()));
            Some(ends.map(|end| line(Value::String(end.trim().to_owned()))).collect())
        }
        _ => None,
    }
}

fn negated(at: &Value) -> Option<Value> {
    match at {
        Value::Float(x) => Some(Value::Float(-x)),
        Value::Integer(x) => Some(Value::Integer(-x)),
        Value::String(text) => Some(Value::String(match text.trim().strip_prefix('-') {
            Some(positive) => positive.to_owned(),
            None => format!("-{}", text.trim()),
        })),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_derive_from_guards_and_measures() {
        let plan = r#"
            [guards.rail]
            output = "cart.state"
            field = "x"
            range = "[-2, 3] m"
            [guards.stuck]
            output = "cart.state"
            frozen-for = "1 s"
            [measures.swing]
            of = "cart.state.angle[1]"
            compute = "max-abs"
            at-most = "5 deg"
            [measures.settled]
            of = "cart.state.x"
            compute = "settling-time"
            at-most = "5 s"
            [measures.apart]
            of = "cart.state.x"
            minus = "guide.wish.x"
            compute = "final"
            within = "[-1, 1] mm"
        "#;
        let limits = limits_of(&plan.parse().unwrap());
        let lines = |limit: &Limit| {
            limit
                .lines
                .iter()
                .map(|line| format!("{} {}", line.text, line.at))
                .collect::<Vec<_>>()
        };
        assert_eq!(limits.len(), 3, "{limits:?}");
        assert_eq!(lines(&limits[0]), ["guard rail \"-2 m\"", "guard rail \"3 m\""]);
        assert_eq!(lines(&limits[1]), ["apart: within \"-1 mm\"", "apart: within \"1 mm\""]);
        assert_eq!(limits[1].minus, Signal::named("guide.wish.x"));
        assert_eq!(
            lines(&limits[2]),
            ["swing: at most \"-5 deg\"", "swing: at most \"5 deg\""]
        );
    }
}
