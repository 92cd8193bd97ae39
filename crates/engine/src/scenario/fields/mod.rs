//! Connections by fields: resolving names and units into the elements of payloads.

mod entry;
mod pairs;

use lockstep::link::{Conversion, Pair};
use lockstep::plan::Initial;
use lockstep::port::Descriptor;
use toml::{Table, Value};

use super::ports::End;
use super::program::Program;
use super::spec::ConnectionSpec;
pub(super) use entry::Refusal;
use entry::Wiring;
use pairs::Ports;

/// The ports at the ends of a link.
pub(super) struct Known<'a> {
    /// The output, if it is known.
    pub(super) sends: Option<&'a Descriptor>,
    /// The input, if it is known.
    pub(super) takes: Option<&'a Descriptor>,
    /// The programs at both ends, which may have other names for fields.
    pub(super) programs: [Option<&'a Program>; 2],
}

/// Whether `connection` names fields, whatever the ports are.
pub(super) fn names_fields(connection: &ConnectionSpec) -> bool {
    let named = |text: &str| End::of(text).is_some_and(|end| end.field.is_some());
    connection.map.is_some() || named(&connection.from) || connection.to.iter().any(|to| named(to))
}

/// How samples of `from` become fields of `to`; `None` if no fields are named, and samples become the input unchanged. If one of
/// the ports is not `known`, the result has only what can be determined: which elements are fed.
pub(super) fn conversion(
    connection: &ConnectionSpec,
    from: End<'_>,
    to: End<'_>,
    known: &Known<'_>,
    assumed: &Descriptor,
) -> Result<Option<Conversion>, Refusal> {
    let [sends, takes] = known.programs;
    let wiring = Wiring::of(connection, from, to)?.named(|name| own(takes, to, name), |name| own(sends, from, name));
    let (Some(sends), Some(takes)) = (known.sends, known.takes) else {
        return Ok((!wiring.is_whole()).then(|| Conversion {
            message: assumed.clone(),
            pairs: known
                .takes
                .map_or_else(Vec::new, |takes| pairs::targets(&wiring, takes, connection.sum)),
        }));
    };
    let ports = Ports {
        sends,
        takes,
        adds: connection.sum,
        any_frames: connection.any_frames(),
    };
    let key = if connection.map.is_some() { "map" } else { "to" };
    if let Some(reason) = Conversion::too_large(takes).filter(|_| !wiring.is_whole()) {
        return Err((key, reason));
    }
    let pairs = match &wiring {
        Wiring::Whole => return Ok(None),
        Wiring::ByName => ports.by_name().map_err(|reason| (key, reason))?,
        Wiring::Named(named) => {
            let each = named.iter().map(|(to, recipe)| ports.pairs(to, recipe));
            let each = each.collect::<Result<Vec<Vec<Pair>>, String>>();
            each.map_err(|reason| (key, reason))?.concat()
        }
    };
    Ok(Some(Conversion {
        message: sends.clone(),
        pairs,
    }))
}

/// The name of a field at `end` that `name` means there.
fn own(program: Option<&Program>, end: End<'_>, name: &str) -> String {
    program.map_or_else(|| name.to_owned(), |program| program.field(end.port, name).into_owned())
}

/// The start value that is written for the input `to`, with the own names of its fields.
pub(super) fn initial(value: &Value, to: End<'_>, known: &Known<'_>) -> Result<Value, String> {
    let Value::Table(fields) = value else {
        return Ok(value.clone());
    };
    let mut named = Table::new();
    for (name, value) in fields {
        let field = own(known.programs[1], to, name);
        if named.insert(field.clone(), value.clone()).is_some() {
            return Err(format!(
                "`{field}` is given twice, by its name and by an alias: leave one of them out"
            ));
        }
    }
    Ok(Value::Table(named))
}

/// Checks that a start value sets only elements that the link feeds.
pub(super) fn check_initial(initial: &Initial, conversion: &Conversion, takes: &Descriptor) -> Result<(), String> {
    let Initial::Value(bytes) = initial else { return Ok(()) };
    for field in &takes.fields {
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
