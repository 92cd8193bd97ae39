//! The line of each key of a TOML text.

use std::collections::HashMap;
use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::names::fault_name;

/// The keys of a text with their lines, as a tree. It is built once for all mistakes in a text.
#[derive(Debug, Clone, Default)]
pub(crate) struct KeyLines {
    line: usize,
    children: HashMap<String, KeyLines>,
}

impl KeyLines {
    /// The keys of `text`; none if it is not valid TOML.
    pub(crate) fn of(text: &str) -> KeyLines {
        #[cfg(test)]
        tests::PARSE_COUNT.set(tests::PARSE_COUNT.get() + 1);
        let breaks: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
        match DeTable::parse(text) {
            Ok(document) => KeyLines::of_table(0, document.get_ref(), &breaks),
            Err(_) => KeyLines::default(),
        }
    }

    fn of_table(line: usize, table: &DeTable<'_>, breaks: &[usize]) -> KeyLines {
        let children = table.iter().map(|(name, value)| {
            let line = line_at(breaks, &name.span());
            let lines = match value.get_ref() {
                DeValue::Table(inner) => KeyLines::of_table(line, inner, breaks),
                // The entries of a list of tables are found by their names.
                DeValue::Array(items) => {
                    let tables = items.iter().enumerate().filter_map(|(position, item)| {
                        let inner = item.get_ref().as_table()?;
                        let name = inner.iter().find(|(name, _)| name.get_ref() == "name");
                        let name = name.and_then(|(_, value)| value.get_ref().as_str());
                        let lines = KeyLines::of_table(line_at(breaks, &item.span()), inner, breaks);
                        Some((position, fault_name(name, position), lines))
                    });
                    let mut children = HashMap::new();
                    // Of two entries with the same name, the first one is found. Each is also found by its number.
                    tables.for_each(|(position, name, lines)| {
                        children.entry(name).or_insert_with(|| lines.clone());
                        children.entry((position + 1).to_string()).or_insert(lines);
                    });
                    KeyLines { line, children }
                }
                _ => KeyLines {
                    line,
                    children: HashMap::new(),
                },
            };
            (name.get_ref().to_string(), lines)
        });
        KeyLines {
            line,
            children: children.collect(),
        }
    }

    /// The line of the dotted `key`, from 1, or of the nearest table around it.
    pub(crate) fn line(&self, key: &str) -> Option<usize> {
        let (mut here, mut found, mut rest) = (self, None, key);
        while !rest.is_empty() {
            // A name in quotes may have dots in it.
            let mut ends = rest.match_indices('.').map(|(at, _)| at).chain([rest.len()]);
            let Some((end, next)) = ends.find_map(|end| Some((end, here.children.get(&rest[..end])?))) else {
                break;
            };
            (here, found) = (next, Some(next.line));
            rest = rest[end..].trim_start_matches('.');
        }
        found
    }
}

fn line_at(breaks: &[usize], span: &Range<usize>) -> usize {
    breaks.partition_point(|at| *at < span.start) + 1
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::Catalogue;
    use crate::scenario::Scenario;

    thread_local! {
        /// How often a text was parsed.
        pub(super) static PARSE_COUNT: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn key_lines_parse_text_once_for_all_mistakes() {
        let mut text = String::from("duration = \"1 s\"\n");
        for number in 0..2000 {
            text += &format!("[connections.c{number}]\nfrom = \"a.b\"\nto = \"c.d\"\ndealy = 1\n");
        }
        let before = PARSE_COUNT.get();
        let error = Scenario::read_text(&Arc::new(Catalogue::new("test")), Path::new("x.toml"), &text)
            .err()
            .unwrap();
        assert_eq!((error.mistakes.len(), PARSE_COUNT.get() - before), (2000, 1));
        for mistake in &error.mistakes {
            let number: usize = mistake.key["connections.c".len()..]
                .split('.')
                .next()
                .unwrap()
                .parse()
                .unwrap();
            assert_eq!(mistake.line, Some(5 + 4 * number), "{}", mistake.key);
        }
    }

    #[test]
    fn key_lines_find_line_of_each_key() {
        let text =
            "a = 1\n\n[b]\nc = { d = 1 }\n[[faults]]\nat = 1\n[[faults]]\nname = \"x\"\nat = 2\n[b.'e.f']\ng = 1\n";
        let lines = KeyLines::of(text);
        for (key, line) in [
            ("a", Some(1)),
            ("b", Some(3)),
            ("b.c.d", Some(4)),
            ("b.missing", Some(3)),
            ("b.e.f", Some(10)),
            ("b.e.f.g", Some(11)),
            ("b.e", Some(3)),
            ("missing", None),
            ("", None),
            ("faults.fault-1.at", Some(6)),
            ("faults.x.at", Some(9)),
            ("faults.x.missing", Some(7)),
        ] {
            assert_eq!(lines.line(key), line, "{key}");
        }
        assert_eq!(KeyLines::of("no toml").line("no"), None);
    }
}
