//! Values of parameters and start values: from parameter sets, through bindings and connectors, to variables of FMUs.

use std::collections::BTreeMap;

use fmu::{Description, Type, Unit, Variable};
use toml::Value;

use crate::error::Problem;
use crate::numbers::Scaling;
use crate::structure::{BoundValue, Content as ElementContent, Structure};
use crate::transform::Transformation;
use crate::values::{Content, ParameterValue};

/// The values bound to the connectors of systems, and to the variables of components.
pub type Values<'a> = BTreeMap<(usize, String), &'a BoundValue>;

/// A step on the path of a value: whether unit conversion is suppressed, the transformation, and the unit of the receiver.
pub type PathStep<'a> = (bool, &'a Transformation, Option<&'a Unit>);

/// Resolves the bindings of all elements: those of a system before those inside it, and later ones before earlier ones. Returns names that
/// exist nowhere, which the standard requires to be ignored.
pub fn resolve<'a>(structure: &'a Structure, has: &dyn Fn(usize, &str) -> bool) -> (Values<'a>, Vec<&'a BoundValue>) {
    let (mut values, mut unresolved) = (Values::new(), Vec::new());
    // A system precedes the elements inside it.
    for (number, element) in structure.elements.iter().enumerate().rev() {
        for bound in &element.bindings {
            if bind(structure, has, number, &bound.target, bound, &mut values) == 0 {
                unresolved.push(bound);
            }
        }
    }
    (values, unresolved)
}

/// Binds a value to the targets that `name` denotes, starting at `element`; returns how many there were.
fn bind<'a>(
    structure: &'a Structure,
    has: &dyn Fn(usize, &str) -> bool,
    element: usize,
    name: &str,
    bound: &'a BoundValue,
    values: &mut Values<'a>,
) -> usize {
    let mut used = 0;
    if has(element, name) {
        values.insert((element, name.to_owned()), bound);
        used += 1;
    }
    if matches!(structure.elements[element].content, ElementContent::Component(_)) {
        return used;
    }
    for (number, inner) in structure.elements.iter().enumerate() {
        let rest = name.strip_prefix(&inner.name).and_then(|rest| rest.strip_prefix('.'));
        if let (Some(rest), true) = (rest, inner.parent == Some(element)) {
            used += bind(structure, has, number, rest, bound, values);
        }
    }
    used
}

/// The scenario's value for `variable`, from a value that has passed along `path`.
///
/// # Errors
/// When the variable cannot have the value, with the value's location in the set.
pub fn setting(
    description: &Description,
    variable: &Variable,
    given: &ParameterValue,
    path: &[PathStep<'_>],
) -> Result<Value, Problem> {
    let made = variable
        .settable()
        .map_err(|reason| format!("`{}` of the FMU cannot be set: {reason}", variable.name))
        .and_then(|()| variable_value(description, variable, given, path));
    made.map_err(|reason| given.problem(reason))
}

fn variable_value(
    description: &Description,
    variable: &Variable,
    given: &ParameterValue,
    path: &[PathStep<'_>],
) -> Result<Value, String> {
    let array = !variable.extents.is_empty();
    let all = |values: Vec<Value>| match <[Value; 1]>::try_from(values) {
        Ok([one]) if !array => Ok(one),
        Ok(one) => Ok(Value::Array(one.into())),
        Err(many) if array => Ok(Value::Array(many)),
        Err(many) => Err(format!("it has {} values; `{}` is no array", many.len(), variable.name)),
    };
    let texts = |texts: &[String]| {
        texts
            .iter()
            .map(|text| mapped_text(text, path))
            .collect::<Vec<String>>()
    };
    let integer = |text: &str| {
        let value = text.parse::<i64>().map(Value::Integer);
        value.unwrap_or_else(|_| Value::String(text.to_owned()))
    };
    match (&given.content, variable.kind) {
        (Content::Real(numbers), kind) if kind.is_float() => {
            let scaling = path_scaling(given, variable, description, path)?;
            let numbers: Vec<f64> = numbers.iter().map(|number| scaling.at(*number)).collect();
            return quantity(description, variable, &numbers, array);
        }
        (Content::Integer(numbers), kind) if kind.is_float() => {
            let scaling = path_scaling(given, variable, description, path)?;
            let numbers: Vec<f64> = numbers.iter().map(|number| scaling.at(*number as f64)).collect();
            return quantity(description, variable, &numbers, array);
        }
        _ => {}
    }
    if path
        .iter()
        .any(|(_, transformation, _)| !transformation.is_linear_identity())
    {
        return Err("a LinearTransformation is for floating-point numbers alone".into());
    }
    match (&given.content, variable.kind) {
        (Content::Integer(numbers), kind) if kind.integers().is_some() => {
            let numbers: Vec<String> = numbers.iter().map(ToString::to_string).collect();
            all(texts(&numbers).iter().map(|text| integer(text)).collect())
        }
        (Content::Boolean(values), Type::Boolean) => {
            let values: Vec<String> = values.iter().map(ToString::to_string).collect();
            all(texts(&values)
                .iter()
                .map(|text| Value::Boolean(text == "true"))
                .collect())
        }
        (Content::Items(names, known), Type::Enumeration) => {
            let item = |name: &String| {
                let own = variable.items.iter().any(|item| item.name == *name);
                let value = known.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
                match value {
                    Some(value) if !own => Value::Integer(value),
                    _ => Value::String(name.clone()),
                }
            };
            all(texts(names).iter().map(item).collect())
        }
        (Content::Text(values), Type::String) => all(values.iter().cloned().map(Value::String).collect()),
        (Content::Bytes(values), Type::Binary) => all(values.iter().cloned().map(Value::String).collect()),
        (content, kind) => Err(format!(
            "it is {}, and `{}` of the FMU is a {}",
            type_name(content),
            variable.name,
            kind.name()
        )),
    }
}

fn type_name(content: &Content) -> &'static str {
    match content {
        Content::Real(_) => "a Real",
        Content::Integer(_) => "an Integer",
        Content::Boolean(_) => "a Boolean",
        Content::Text(_) => "a String",
        Content::Items(..) => "an Enumeration",
        Content::Bytes(_) => "a Binary",
    }
}

/// The value after the tables on its path.
fn mapped_text(text: &str, path: &[PathStep<'_>]) -> String {
    path.iter().fold(text.to_owned(), |text, (_, transformation, _)| {
        if transformation.table.is_some() {
            transformation.mapped(&text)
        } else {
            text
        }
    })
}

/// The number after its path, in the unit of the variable.
fn path_scaling(
    given: &ParameterValue,
    variable: &Variable,
    description: &Description,
    path: &[PathStep<'_>],
) -> Result<Scaling, String> {
    let mut scaling = Scaling::of(variable.relative);
    let mut unit = given.unit.as_ref();
    for (suppress, transformation, target) in path {
        if !suppress {
            scaling.convert(unit, *target)?;
        }
        scaling.transform(transformation);
        unit = crate::trace::unit_after(unit, *target, *suppress);
    }
    scaling.convert(unit, description.unit(variable))?;
    Ok(scaling)
}

/// Numbers in the FMU's own unit.
fn quantity(description: &Description, variable: &Variable, numbers: &[f64], array: bool) -> Result<Value, String> {
    if let (false, [_, _, ..]) = (array, numbers) {
        return Err(format!(
            "it has {} values; `{}` is no array",
            numbers.len(),
            variable.name
        ));
    }
    let unit = description.unit(variable).filter(|unit| !unit.is_pure());
    let texts: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
    Ok(match (unit, array) {
        (Some(unit), true) => Value::String(format!("[{}] {}", texts.join(", "), unit.name)),
        (Some(unit), false) => Value::String(format!("{} {}", texts.concat(), unit.name)),
        (None, true) => Value::Array(numbers.iter().copied().map(Value::Float).collect()),
        (None, false) => numbers.first().copied().map_or(Value::Float(0.0), Value::Float),
    })
}
