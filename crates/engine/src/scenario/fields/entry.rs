//! The `map` and field names of a connection: which fields belong together.

use serde::Deserialize;
use toml::Value;

use crate::scenario::ports::ConnectionEnd;
use crate::scenario::spec::ConnectionSpec;
use crate::scenario::value::toml_reason;

/// The key of the connection that is wrong, and why.
pub(in crate::scenario) type Refusal = (&'static str, String);

/// How an element or a field of the input is composed.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct FieldComposition {
    pub(super) terms: Vec<SourceTerm>,
    pub(super) offset: Option<Value>,
    /// Its constant value.
    pub(super) value: Option<Value>,
}

/// A field or an element of the output.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SourceTerm {
    pub(super) from: String,
    pub(super) factor: Option<Value>,
}

/// How the fields of the input are composed.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FieldMapping {
    /// The payload is passed on unchanged.
    Unchanged,
    /// Every field of the input from the field of the same name.
    ByName,
    /// Fields or elements of the input, with how each is composed.
    Named(Vec<(String, FieldComposition)>),
}

/// A table in a map.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table such as { from = \"FIELD\", factor = 2 }")]
struct MapEntry {
    from: Option<String>,
    factor: Option<Value>,
    offset: Option<Value>,
    value: Option<Value>,
}

impl FieldMapping {
    /// Whether no fields are named.
    pub(super) fn is_unchanged(&self) -> bool {
        *self == FieldMapping::Unchanged
    }

    /// The wiring that `connection` declares for its link from `from` to `to`.
    pub(super) fn of(
        connection: &ConnectionSpec,
        from: ConnectionEnd<'_>,
        to: ConnectionEnd<'_>,
    ) -> Result<FieldMapping, Refusal> {
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
            (Some(map), ..) => FieldMapping::parse_map(map).map_err(|reason| ("map", reason)),
            (None, None, None) if connection.sum => {
                let reason = "adds up fields: name them in `from` and `to`, or in a map";
                Err(("sum", reason.into()))
            }
            (None, None, None) => Ok(FieldMapping::Unchanged),
            (None, Some(field), Some(to)) => {
                let part = SourceTerm {
                    from: field.to_owned(),
                    factor: connection.factor.clone(),
                };
                let composition = FieldComposition {
                    terms: vec![part],
                    offset: connection.offset.clone(),
                    value: None,
                };
                Ok(FieldMapping::Named(vec![(to.to_owned(), composition)]))
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

    /// The same with the names of fields that `input` and `output` give for those that are written.
    pub(super) fn resolve_aliases(
        self,
        input: impl Fn(&str) -> String,
        output: impl Fn(&str) -> String,
    ) -> FieldMapping {
        let FieldMapping::Named(fields) = self else {
            return self;
        };
        let part = |part: SourceTerm| SourceTerm {
            from: output(&part.from),
            ..part
        };
        let fields = fields.into_iter().map(|(to, composition)| {
            let terms = composition.terms.into_iter().map(part).collect();
            (input(&to), FieldComposition { terms, ..composition })
        });
        FieldMapping::Named(fields.collect())
    }

    fn parse_map(map: &Value) -> Result<FieldMapping, String> {
        match map {
            Value::String(text) if text == "by-name" => Ok(FieldMapping::ByName),
            Value::Table(table) if table.is_empty() => Err("is empty: name a field".to_owned()),
            Value::Table(table) => {
                let named = table.iter().map(|(to, value)| {
                    let composition = FieldComposition::parse(value).map_err(|reason| format!("`{to}`: {reason}"))?;
                    Ok((to.clone(), composition))
                });
                Ok(FieldMapping::Named(named.collect::<Result<_, String>>()?))
            }
            other => Err(format!(
                "`{other}` is not a map: write {{ INPUT-FIELD = \"OUTPUT-FIELD\", … }} or \"by-name\""
            )),
        }
    }
}

impl FieldComposition {
    fn parse(value: &Value) -> Result<FieldComposition, String> {
        match value {
            Value::String(from) => Ok(FieldComposition::single(from.clone(), None)),
            Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Ok(FieldComposition {
                value: Some(value.clone()),
                ..FieldComposition::default()
            }),
            Value::Table(_) => FieldComposition::parse_table(value),
            Value::Array(parts) if !parts.is_empty() => {
                let mut sum = FieldComposition::default();
                for part in parts {
                    let part = FieldComposition::parse(part)?;
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

    fn parse_table(value: &Value) -> Result<FieldComposition, String> {
        let entry: MapEntry = value.clone().try_into().map_err(|error| toml_reason(&error))?;
        match entry {
            MapEntry {
                from: Some(from),
                factor,
                offset,
                value: None,
            } => Ok(FieldComposition {
                offset,
                ..FieldComposition::single(from, factor)
            }),
            MapEntry {
                from: None,
                factor: None,
                offset: None,
                value: Some(value),
            } => Ok(FieldComposition {
                value: Some(value),
                ..FieldComposition::default()
            }),
            _ => Err("give it `from`, with `factor` and `offset` if needed, or `value` alone".to_owned()),
        }
    }

    fn single(from: String, factor: Option<Value>) -> FieldComposition {
        FieldComposition {
            terms: vec![SourceTerm { from, factor }],
            ..FieldComposition::default()
        }
    }
}
