//! Aliases of variables as names of the fields that have the variables' own names.

use std::collections::BTreeMap;

/// The other names of the fields of an FMU's ports.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Aliases {
    /// Fields by port and alias.
    fields: BTreeMap<(String, String), String>,
}

impl Aliases {
    pub(crate) fn add(&mut self, port: &str, alias: &str, field: &str) {
        let key = (port.to_owned(), alias.to_owned());
        self.fields.insert(key, field.to_owned());
    }

    /// The field or element of `port` that `name` means by an alias: `h` for its alias `h_ft`, `q[2]` for `angles[2]`.
    pub fn field(&self, port: &str, name: &str) -> Option<String> {
        // Names of variables may contain brackets too.
        let ends = name.rmatch_indices('[').map(|(at, _)| at);
        std::iter::once(name.len()).chain(ends).find_map(|end| {
            let (alias, element) = name.split_at(end);
            let field = self.fields.get(&(port.to_owned(), alias.to_owned()))?;
            Some(format!("{field}{element}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alias_resolves_to_field_and_its_elements() {
        let mut aliases = Aliases::default();
        aliases.add("outputs", "angles", "q");
        aliases.add("outputs", "a[1]", "b");
        for (port, name, field) in [
            ("outputs", "angles", Some("q")),
            ("outputs", "angles[2]", Some("q[2]")),
            ("outputs", "angles[1][0]", Some("q[1][0]")),
            ("outputs", "a[1]", Some("b")),
            ("outputs", "a[1][0]", Some("b[0]")),
            ("outputs", "a", None),
            ("outputs", "q", None),
            ("inputs", "angles", None),
        ] {
            assert_eq!(aliases.field(port, name).as_deref(), field, "{port}.{name}");
        }
    }
}
