//! Reads a table `[vary.NAME]` into a dispersion, and reports every mistake that can be found before a run.

use std::path::Path;

use lockstep::units::unit_factor;
use sampling::distribution::{Scalar, Weights, moments_are_physical};
use toml::{Table, Value};

use super::column;
use super::keys::{KeyReader, keys_of, valid_or_record};
use super::quantity::{Quantity, RoundingStep, at_key, with_entry_names};
use super::value_source::label_of;
use super::vectors::{attitude, correlated, direction, inertia};
use super::{DESIGNS, DimensionedValue, Dispersion, Formula, Mode, Target, ValueSource};
use crate::campaign::column::{INDEX_COLUMNS, TABLE_COLUMNS};

/// The context of a dispersion.
pub struct Context<'a> {
    /// The folder that paths of its files are relative to.
    pub folder: &'a Path,
    /// The scenario with its files filled in.
    pub scenario: &'a Table,
    /// The numbers of the dispersions above it, by name, with their dimensions.
    pub above: &'a dyn Fn(&str) -> Option<DimensionedValue>,
}

const DISTRIBUTIONS: [&str; 15] = [
    "uniform",
    "normal",
    "truncated-normal",
    "log-normal",
    "triangular",
    "discrete",
    "column",
    "constant",
    "formula",
    "correlated-normal",
    "sphere",
    "cone",
    "rotation",
    "misalignment",
    "inertia",
];

const MODES: [(&str, Mode); 4] = [
    ("absolute", Mode::Absolute),
    ("offset", Mode::Offset),
    ("relative", Mode::Relative),
    ("factor", Mode::Factor),
];

/// Maximum number of values on one axis of a grid.
const LEVELS_MAX: usize = 10_000;

/// Checks the name of a dispersion, which is also that of its columns.
fn check_name(name: &str, keys: &mut KeyReader<'_>) {
    if !name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-') {
        keys.refuse(
            "",
            format!("the name `{name}` has other characters than letters, digits, `_` and `-`"),
        );
    }
    let taken = [&TABLE_COLUMNS[..], &INDEX_COLUMNS[..]].concat();
    if name.is_empty() || taken.contains(&name) {
        let taken = taken.join(", ");
        keys.refuse(
            "",
            format!("the name `{name}` is not possible: the table has columns {taken}; choose another"),
        );
    }
}

/// Reads `[vary.NAME]`.
///
/// # Errors
/// All mistakes in it, by key; the empty key is the whole table.
pub fn read_dispersion(name: &str, table: &Table, context: &Context<'_>) -> Result<Dispersion, Vec<(String, String)>> {
    let mut keys = KeyReader::new(table);
    check_name(name, &mut keys);
    let targets = targets(&mut keys, context.scenario);
    let nominals: Vec<Option<Quantity>> = targets
        .iter()
        .map(|target| at_key(context.scenario, &target.key).and_then(Quantity::of))
        .collect();
    let mode = keys.one_of("as", &MODES).unwrap_or(Mode::Absolute);
    keys.as_fractions = matches!(mode, Mode::Relative | Mode::Factor);
    keys.read_unit();
    let own_unit = nominals
        .first()
        .and_then(|own| own.as_ref())
        .map(|own| own.unit.clone());
    let has_elements = targets.iter().any(|target| target.element.is_some());
    if keys.unit.is_none() && (mode == Mode::Offset || has_elements) {
        keys.unit.clone_from(&own_unit);
    }
    let given = keys.required_value("distribution", "\"normal\"");
    let Some(kind) = given.and_then(|_| keys.text("distribution")) else {
        // Without it no other key is known to be wrong.
        return Err(keys.mistakes);
    };
    keys.expect(keys_of(kind));
    let source = match kind {
        "uniform" | "normal" | "truncated-normal" | "log-normal" | "triangular" => scalar(&mut keys, kind),
        "discrete" => discrete(&mut keys),
        "column" => column_source(&mut keys, context.folder),
        "constant" => constant(&mut keys),
        "formula" => formula(&mut keys, context),
        "correlated-normal" => correlated(&mut keys, mode),
        "sphere" | "cone" => direction(&mut keys, kind),
        "rotation" | "misalignment" => attitude(&mut keys, kind, own_unit.as_deref()),
        "inertia" => inertia(&mut keys),
        other => {
            let known = DISTRIBUTIONS.join(", ");
            keys.mistakes
                .push(("distribution".into(), format!("`{other}` is unknown; there is {known}")));
            return Err(keys.mistakes);
        }
    };
    let unit = if keys.as_fractions {
        String::new()
    } else {
        keys.unit.clone().unwrap_or_default()
    };
    let (once, design) = (keys.flag("once"), keys.one_of("design", &DESIGNS));
    let levels = keys.integer("levels", LEVELS_MAX);
    // Rounding applies to the value at the key, in its unit.
    let changed = mode != Mode::Absolute || has_elements || source.as_ref().is_some_and(ValueSource::transforms_value);
    let value_unit = if changed {
        own_unit.unwrap_or_default()
    } else {
        unit.clone()
    };
    let step = keys
        .step(&value_unit)
        .or_else(|| integer_step(source.as_ref()?, &value_unit, nominals.first()?.as_ref()));
    let Some(source) = source else {
        return Err(keys.finish());
    };
    let dispersion = Dispersion {
        name: name.to_owned(),
        targets,
        source,
        mode,
        unit,
        value_unit,
        step,
        once,
        design,
        levels,
    };
    check_fit(&mut keys, &dispersion, &nominals, context);
    match keys.finish() {
        wrong if wrong.is_empty() => Ok(dispersion),
        wrong => Err(wrong),
    }
}

/// `a.b.c` and `a.b.c[2]`. Entries of lists are called by their names, so that two ways of writing a key are one target.
fn targets(keys: &mut KeyReader<'_>, scenario: &Table) -> Vec<Target> {
    let texts: Vec<&str> = match keys.value("key") {
        None => Vec::new(),
        Some(Value::String(one)) => vec![one],
        Some(Value::Array(all)) if !all.is_empty() && all.iter().all(Value::is_str) => {
            all.iter().filter_map(Value::as_str).collect()
        }
        Some(other) => {
            keys.refuse(
                "key",
                format!("{other} is no key such as \"connections.measured.delay\", and no list of them"),
            );
            Vec::new()
        }
    };
    let read = |text: &str| match text.strip_suffix(']').and_then(|text| text.split_once('[')) {
        Some((key, element)) => Some(Target {
            key: with_entry_names(scenario, key),
            element: Some(element.parse().ok()?),
        }),
        None => Some(Target {
            key: with_entry_names(scenario, text),
            element: None,
        }),
    };
    let mut targets = Vec::new();
    for text in texts {
        match read(text) {
            Some(target) if target.key.split('.').all(|part| !part.is_empty()) => targets.push(target),
            _ => keys.refuse(
                "key",
                format!("`{text}` is no key such as connections.measured.delay or a.vector[2]"),
            ),
        }
    }
    targets
}

fn scalar(keys: &mut KeyReader<'_>, kind: &str) -> Option<ValueSource> {
    let example = if keys.as_fractions { "\"5 %\"" } else { "\"0.5 kg\"" };
    let distribution = match kind {
        "uniform" => {
            let (from, to) = (
                keys.required_number("from", example),
                keys.required_number("to", example),
            );
            Scalar::Uniform { from: from?, to: to? }
        }
        "normal" | "truncated-normal" => {
            let mean = mean(keys, example);
            let deviation = keys.required_number("deviation", example);
            if kind == "normal" {
                Scalar::Normal {
                    mean: mean?,
                    deviation: deviation?,
                }
            } else {
                let (from, to) = (keys.number("from"), keys.number("to"));
                if from.is_none() && to.is_none() {
                    keys.refuse(
                        "",
                        "neither `from` nor `to` is given: give one, or let it be \"normal\"",
                    );
                }
                Scalar::TruncatedNormal {
                    mean: mean?,
                    deviation: deviation?,
                    from: from.unwrap_or(f64::NEG_INFINITY),
                    to: to.unwrap_or(f64::INFINITY),
                }
            }
        }
        "log-normal" => {
            let median = keys.required_number("median", example);
            keys.required_value("log-deviation", "0.1");
            let log_deviation = keys.fraction("log-deviation");
            Scalar::LogNormal {
                median: median?,
                log_deviation: log_deviation?,
            }
        }
        _ => {
            let (from, mode) = (
                keys.required_number("from", example),
                keys.required_number("mode", example),
            );
            let to = keys.required_number("to", example);
            Scalar::Triangular {
                from: from?,
                mode: mode?,
                to: to?,
            }
        }
    };
    valid_or_record(keys, distribution.check())?;
    Some(ValueSource::Scalar(distribution))
}

/// The mean: zero unless given where a draw is added to the key's value or is a fraction of it.
fn mean(keys: &mut KeyReader<'_>, example: &str) -> Option<f64> {
    let added = keys.value("as").and_then(Value::as_str);
    match added {
        Some("offset" | "relative") if keys.value("mean").is_none() => Some(0.0),
        _ => keys.required_number("mean", example),
    }
}

/// Weights of so many choices: equal ones unless given.
fn weights(keys: &mut KeyReader<'_>, choices: usize) -> Option<Weights> {
    let given = match keys.value("weights") {
        None => vec![1.0; choices],
        Some(value) => {
            let all = value
                .as_array()
                .map(|all| all.iter().map(super::quantity::number).collect());
            let Some(all) = all.unwrap_or(None::<Vec<f64>>) else {
                keys.refuse("weights", format!("{value} is no list of numbers"));
                return None;
            };
            all
        }
    };
    if given.len() != choices {
        keys.refuse("weights", format!("has {} numbers for {choices} values", given.len()));
        return None;
    }
    valid_or_record(keys, Weights::new(&given))
}

fn discrete(keys: &mut KeyReader<'_>) -> Option<ValueSource> {
    let values = keys.required_value("values", "[\"5 ms\", \"10 ms\"]")?;
    let Some(values) = values.as_array().filter(|values| !values.is_empty()) else {
        keys.refuse("values", format!("{values} is no list of values"));
        return None;
    };
    let labels: Vec<String> = match keys.value("labels") {
        None => values.iter().map(label_of).collect(),
        Some(given) => {
            let texts: Option<Vec<String>> = given.as_array().and_then(|all| {
                let texts = all.iter().map(|one| one.as_str().map(str::to_owned));
                texts.collect()
            });
            match texts.filter(|texts| texts.len() == values.len()) {
                Some(texts) => {
                    let twice = (1..texts.len()).find(|at| texts[..*at].contains(&texts[*at]));
                    if let Some(at) = twice {
                        let reason = format!("has `{}` twice: the table could not tell the values apart", texts[at]);
                        keys.refuse("labels", reason);
                        return None;
                    }
                    texts
                }
                None => {
                    keys.refuse("labels", format!("{given} is no list of {} texts", values.len()));
                    return None;
                }
            }
        }
    };
    let weights = weights(keys, values.len())?;
    // Values of one unit and without labels are numbers; all others are taken as they stand.
    let unit = keys.unit.clone();
    let numbers: Option<Vec<f64>> = values
        .iter()
        .map(|value| match keys.quantity(value) {
            Ok((numbers, false)) => numbers.first().copied(),
            _ => None,
        })
        .collect();
    let labelled = keys.value("labels").is_some();
    match numbers.filter(|_| !labelled) {
        Some(numbers) => Some(ValueSource::Numbers(numbers, weights)),
        None => {
            keys.unit = unit;
            let both = values.iter().cloned().zip(labels);
            Some(ValueSource::Values(both.collect(), weights))
        }
    }
}

fn column_source(keys: &mut KeyReader<'_>, folder: &Path) -> Option<ValueSource> {
    keys.required_value("file", "\"masses.csv\"");
    keys.required_value("column", "\"mass\"");
    let random = keys
        .one_of("order", &[("in-turn", false), ("random", true)])
        .unwrap_or(false);
    let (file, name) = (keys.text("file")?, keys.text("column")?);
    let path = folder.join(file);
    let (cells, unit) = match column::read_column(&path, name) {
        Ok(read) => read,
        Err(reason) => {
            keys.refuse("file", format!("the file `{}` {reason}", path.display()));
            return None;
        }
    };
    let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.parse::<f64>().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    let unit_wanted = !unit.is_empty() || keys.unit.is_some();
    if numbers.is_none() && unit_wanted {
        let number = |cell: &String| cell.parse::<f64>().is_ok_and(f64::is_finite);
        let bad = cells.iter().find(|cell| !number(cell)).map_or("", String::as_str);
        keys.refuse(
            "column",
            format!(
                "the column `{name}` of `{}` has a unit, and its cell `{bad}` is no number",
                path.display()
            ),
        );
        return None;
    }
    let even = vec![1.0; cells.len()];
    let Some(mut numbers) = numbers else {
        return Some(if random {
            let both = cells.iter().map(|cell| (crate::scenario::value(cell), cell.clone()));
            ValueSource::Values(both.collect(), valid_or_record(keys, Weights::new(&even))?)
        } else {
            ValueSource::TextSequence(cells)
        });
    };
    if !keys.as_fractions {
        match keys.unit.clone() {
            None => keys.unit = Some(unit),
            Some(wanted) if wanted != unit && !unit.is_empty() => {
                match lockstep::units::convert(&format!("1 {unit}"), &wanted) {
                    Ok((factor, _)) => numbers.iter_mut().for_each(|number| *number *= factor[0]),
                    Err(error) => keys.refuse("column", error.to_string()),
                }
            }
            Some(_) => {}
        }
    }
    Some(if random {
        ValueSource::Numbers(numbers, valid_or_record(keys, Weights::new(&even))?)
    } else {
        ValueSource::Sequence(numbers)
    })
}

fn constant(keys: &mut KeyReader<'_>) -> Option<ValueSource> {
    let value = keys.required_value("value", "\"0.2 m\"")?;
    let unit = keys.unit.clone();
    match keys.quantity(value) {
        Ok((numbers, false)) => Some(ValueSource::Number(numbers[0])),
        _ => {
            keys.unit = unit;
            Some(ValueSource::Constant(value.clone()))
        }
    }
}

fn formula(keys: &mut KeyReader<'_>, context: &Context<'_>) -> Option<ValueSource> {
    keys.required_value("formula", "\"0.5 * mass * radius^2\"");
    let text = keys.text("formula")?;
    let parsed = Formula::parse(text).and_then(|formula| {
        let (_, dimension) = formula.value(context.above)?;
        Ok((formula, dimension))
    });
    let (formula, dimension) = match parsed {
        Ok(parsed) => parsed,
        Err(reason) => {
            keys.refuse("formula", reason);
            return None;
        }
    };
    let unit = keys.unit.get_or_insert_with(String::new).clone();
    let wanted = if unit.is_empty() {
        Ok((1.0, lockstep::units::Dimension::default()))
    } else {
        unit_factor(&unit)
    };
    match wanted {
        Ok((per_si, wanted)) if wanted == dimension => Some(ValueSource::Formula(formula, per_si)),
        Ok((_, wanted)) => {
            let named = if unit.is_empty() {
                "no `unit` is given".to_owned()
            } else {
                format!("`unit` is {unit} ({wanted})")
            };
            keys.refuse(
                "formula",
                format!("has the dimension {dimension}, but {named}: correct one of them"),
            );
            None
        }
        Err(error) => {
            keys.refuse("unit", error.to_string());
            None
        }
    }
}

/// Whole numbers stay whole for a key that has a whole number.
fn integer_step(source: &ValueSource, unit: &str, own: Option<&Quantity>) -> Option<RoundingStep> {
    let own = own.is_none_or(|own| own.decimals[..] == [Some(0)]);
    let plain = |numbers: &[f64]| numbers.iter().all(|number| number.fract() == 0.0);
    let all = match source {
        ValueSource::Numbers(numbers, _) | ValueSource::Sequence(numbers) => plain(numbers),
        ValueSource::Number(number) => plain(&[*number]),
        _ => false,
    };
    (own && all && unit.is_empty()).then(|| RoundingStep {
        size: 1.0,
        decimals: 0,
        unit: String::new(),
    })
}

/// Checks that the value source fits the keys and their present values.
fn check_fit(keys: &mut KeyReader<'_>, dispersion: &Dispersion, nominals: &[Option<Quantity>], context: &Context<'_>) {
    super::compatibility::check(dispersion, nominals, context.scenario, &mut |key, reason| {
        keys.refuse(key, reason)
    });
    let moments = |own: &Quantity| match own.numbers[..] {
        [x, y, z] => moments_are_physical([x, y, z]),
        _ => true,
    };
    if let (ValueSource::Inertia(_), Some(Some(own))) = (&dispersion.source, nominals.first())
        && !moments(own)
    {
        keys.refuse(
            "key",
            format!("the scenario's own value {} is the inertia of no body", own.text()),
        );
    }
}
