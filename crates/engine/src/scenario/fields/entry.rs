//! The `map` and field names of a connection: which fields belong together.

use serde::Deserialize;
use toml::Value;

use crate::scenario::ports::End;
use crate::scenario::spec::ConnectionSpec;

/// The key of the connection that is wrong, and why.
pub(in crate::scenario) type Refusal = (&'static str, String);

/// How an element or a field of the input is composed.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Recipe {
    pub(super) terms: Vec<Part>,
    pub(super) offset: Option<Value>,
    /// Its constant value.
    pub(super) value: Option<Value>,
}

/// A field or an element of the output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    pub(super) from: String,
    pub(super) factor: Option<Value>,
}

/// How the fields of the input are composed.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Wiring {
    /// The payload is passed on unchanged.
    Whole,
    /// Every field of the input from the field of the same name.
    ByName,
    /// Fields or elements of the input, with how each is composed.
    Named(Vec<(String, Recipe)>),
}

/// A table in a map.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table such as { from = \"FIELD\", factor = 2 }")]
struct Written {
    from: Option<String>,
    factor: Option<Value>,
    offset: Option<Value>,
    value: Option<Value>,
}

impl Wiring {
    /// Whether no fields are named.
    pub(super) fn is_whole(&self) -> bool {
        *self == Wiring::Whole
    }

    /// The wiring that `connection` declares for its link from `from` to `to`.
    pub(super) fn of(connection: &ConnectionSpec, from: End<'_>, to: End<'_>) -> Result<Wiring, Refusal> {
        let fields = from.field.is_some() || to.field.is_some();
        if let (Some(_), true) = (&connection.map, fields) {
            let reason = "stands beside a field in `from` or `to`: name the ports there, or leave the map out";
            return Err(("map", reason.into()));
        }
        for (key, given) in [("factor", &connection.factor), ("offset", &connection.offset)] {
            if given.is_some() && !fields {
                let reason = format!(
                    "belongs to one field: name it in `from` and `to`, or write it in the map, such as \
                     map = {{ u = {{ from = \"x\", {key} = {} }} }}",
                    given.as_ref().map_or(String::new(), ToString::to_string)
                );
                return Err((key, reason));
            }
        }
        match (&connection.map, from.field, to.field) {
            (Some(map), ..) => Wiring::mapped(map).map_err(|reason| ("map", reason)),
            (None, None, None) if connection.sum => {
                let reason = "adds up fields: name them in `from` and `to`, or in a map";
                Err(("sum", reason.into()))
            }
            (None, None, None) => Ok(Wiring::Whole),
            (None, Some(field), Some(to)) => {
                let part = Part {
                    from: field.to_owned(),
                    factor: connection.factor.clone(),
                };
                let recipe = Recipe {
                    terms: vec![part],
                    offset: connection.offset.clone(),
                    value: None,
                };
                Ok(Wiring::Named(vec![(to.to_owned(), recipe)]))
            }
            (None, Some(field), None) => {
                let reason = format!(
                    "names the port `{}.{}` where `from` names the field `{field}`: name its field too",
                    to.participant, to.port
                );
                Err(("to", reason))
            }
            (None, None, Some(field)) => {
                let reason = format!(
                    "names the port `{}.{}` where `to` names the field `{field}`: name its field too",
                    from.participant, from.port
                );
                Err(("from", reason))
            }
        }
    }

    /// The same with the names of fields that `takes` and `sends` give for those that are written.
    pub(super) fn named(self, takes: impl Fn(&str) -> String, sends: impl Fn(&str) -> String) -> Wiring {
        let Wiring::Named(fields) = self else {
            return self;
        };
        let part = |part: Part| Part {
            from: sends(&part.from),
            ..part
        };
        let fields = fields.into_iter().map(|(to, recipe)| {
            let terms = recipe.terms.into_iter().map(part).collect();
            (takes(&to), Recipe { terms, ..recipe })
        });
        Wiring::Named(fields.collect())
    }

    fn mapped(map: &Value) -> Result<Wiring, String> {
        match map {
            Value::String(text) if text == "by-name" => Ok(Wiring::ByName),
            Value::Table(table) if table.is_empty() => Err("is empty: name a field".to_owned()),
            Value::Table(table) => {
                let named = table.iter().map(|(to, value)| {
                    let recipe = Recipe::read(value).map_err(|reason| format!("`{to}`: {reason}"))?;
                    Ok((to.clone(), recipe))
                });
                Ok(Wiring::Named(named.collect::<Result<_, String>>()?))
            }
            other => Err(format!(
                "`{other}` is not a map: write {{ INPUT-FIELD = \"OUTPUT-FIELD\", … }} or \"by-name\""
            )),
        }
    }
}

impl Recipe {
    fn read(value: &Value) -> Result<Recipe, String> {
        match value {
            Value::String(from) => Ok(Recipe::one(from.clone(), None)),
            Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Ok(Recipe {
                value: Some(value.clone()),
                ..Recipe::default()
            }),
            Value::Table(_) => Recipe::written(value),
            Value::Array(parts) if !parts.is_empty() => {
                let mut sum = Recipe::default();
                for part in parts {
                    let part = Recipe::read(part)?;
                    if part.terms.is_empty() || part.offset.is_some() {
                        let reason = "what a sum adds up are fields, with factors: write an offset as one of a connection or field";
                        return Err(reason.to_owned());
                    }
                    sum.terms.extend(part.terms);
                }
                Ok(sum)
            }
            other => Err(format!(
                "`{other}` is nothing to make a field of: write \"OUTPUT-FIELD\", {{ from = \"OUTPUT-FIELD\", factor = 2 }}, a list of \
                 these for their sum, or a number or a truth value that it always is"
            )),
        }
    }

    fn written(value: &Value) -> Result<Recipe, String> {
        let written: Written = value.clone().try_into().map_err(|error| toml_words(&error))?;
        match written {
            Written {
                from: Some(from),
                factor,
                offset,
                value: None,
            } => Ok(Recipe {
                offset,
                ..Recipe::one(from, factor)
            }),
            Written {
                from: None,
                factor: None,
                offset: None,
                value: Some(value),
            } => Ok(Recipe {
                value: Some(value),
                ..Recipe::default()
            }),
            _ => Err("give it `from`, with `factor` and `offset` if needed, or `value` alone".to_owned()),
        }
    }

    fn one(from: String, factor: Option<Value>) -> Recipe {
        Recipe {
            terms: vec![Part { from, factor }],
            ..Recipe::default()
        }
    }
}

/// What is wrong with a table, in one line.
fn toml_words(error: &toml::de::Error) -> String {
    error.message().trim().to_owned()
}
