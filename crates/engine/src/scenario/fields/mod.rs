//! Connections by fields: resolving names and units into the elements of payloads.

mod entry;
mod pairs;

use lockstep::link::{Conversion, Pair};
use lockstep::plan::Initial;
use lockstep::port::Descriptor;
use toml::{Table, Value};

use super::ports::ConnectionEnd;
use super::program::Program;
use super::spec::ConnectionSpec;
use entry::FieldMapping;
pub(super) use entry::Refusal;
use pairs::LinkPorts;

/// The ports at the ends of a link.
pub(super) struct LinkEnds<'a> {
    /// The output, if it is known.
    pub(super) output: Option<&'a Descriptor>,
    /// The input, if it is known.
    pub(super) input: Option<&'a Descriptor>,
    /// The programs at both ends, which may have other names for fields.
    pub(super) programs: [Option<&'a Program>; 2],
}

/// Whether `connection` names fields, whatever the ports are.
pub(super) fn names_fields(connection: &ConnectionSpec) -> bool {
    let named = |text: &str| ConnectionEnd::of(text).is_some_and(|end| end.field.is_some());
    connection.map.is_some() || named(&connection.from) || connection.to.iter().any(|to| named(to))
}

/// How samples of `from` become fields of `to`; `None` if no fields are named, and samples become the input unchanged. If one of
/// the ports is not known, the result has only what can be determined: which elements are fed.
pub(super) fn conversion(
    connection: &ConnectionSpec,
    from: ConnectionEnd<'_>,
    to: ConnectionEnd<'_>,
    ends: &LinkEnds<'_>,
    assumed: &Descriptor,
) -> Result<Option<Conversion>, Refusal> {
    let [output, input] = ends.programs;
    let mapping = FieldMapping::of(connection, from, to)?.resolve_aliases(
        |name| resolve_alias(input, to, name),
        |name| resolve_alias(output, from, name),
    );
    let (Some(output), Some(input)) = (ends.output, ends.input) else {
        return Ok((!mapping.is_unchanged()).then(|| Conversion {
            message: assumed.clone(),
            pairs: ends
                .input
                .map_or_else(Vec::new, |input| pairs::targets(&mapping, input, connection.sum)),
        }));
    };
    let ports = LinkPorts {
        output,
        input,
        adds: connection.sum,
        any_frames: connection.any_frames(),
    };
    let key = if connection.map.is_some() { "map" } else { "to" };
    if let Some(reason) = Conversion::too_large(input).filter(|_| !mapping.is_unchanged()) {
        return Err((key, reason));
    }
    let pairs = match &mapping {
        FieldMapping::Unchanged => return Ok(None),
        FieldMapping::ByName => ports.by_name().map_err(|reason| (key, reason))?,
        FieldMapping::Named(named) => {
            let each = named.iter().map(|(to, composition)| ports.pairs(to, composition));
            let each = each.collect::<Result<Vec<Vec<Pair>>, String>>();
            each.map_err(|reason| (key, reason))?.concat()
        }
    };
    Ok(Some(Conversion {
        message: output.clone(),
        pairs,
    }))
}

/// The name of a field at `end` that `name` means there.
fn resolve_alias(program: Option<&Program>, end: ConnectionEnd<'_>, name: &str) -> String {
    program.map_or_else(|| name.to_owned(), |program| program.field(end.port, name).into_owned())
}

/// The start value that is written for the input `to`, with the own names of its fields.
pub(super) fn initial(value: &Value, to: ConnectionEnd<'_>, ends: &LinkEnds<'_>) -> Result<Value, String> {
    let Value::Table(fields) = value else {
        return Ok(value.clone());
    };
    let mut named = Table::new();
    for (name, value) in fields {
        let field = resolve_alias(ends.programs[1], to, name);
        if named.insert(field.clone(), value.clone()).is_some() {
            return Err(format!(
                "`{field}` is given twice, by its name and by an alias: leave one of them out"
            ));
        }
    }
    Ok(Value::Table(named))
}

/// Checks that a start value sets only elements that the link feeds.
pub(super) fn check_initial(initial: &Initial, conversion: &Conversion, input: &Descriptor) -> Result<(), String> {
    let Initial::Value(bytes) = initial else { return Ok(()) };
    for field in &input.fields {
        let starts = field.range().step_by(field.element.size()).enumerate();
        for (index, at) in starts {
            let fed = conversion.pairs.iter().any(|pair| {
                let start = pair.to.offset as usize;
                (start..start + pair.count as usize * pair.to.element.size()).contains(&at)
            });
            if !fed && bytes[at..at + field.element.size()].iter().any(|byte| *byte != 0) {
                let name = field.element_name(index);
                return Err(format!("`{name}` is not fed by this connection: leave it out"));
            }
        }
    }
    Ok(())
}
