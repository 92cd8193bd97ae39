//! The values of a column of a file.

use std::path::Path;

/// Maximum size of such a file, bytes.
const FILE_MAX: u64 = 64 << 20;

/// The cells of the column with the head `name`, or `name` followed by a unit as in `mass [kg]`; with the unit, empty where
/// there is none.
///
/// # Errors
/// The mistake in the file.
pub fn read_column(path: &Path, name: &str) -> Result<(Vec<String>, String), String> {
    let metadata = std::fs::metadata(path).map_err(|error| format!("cannot be read: {error}"))?;
    if !metadata.is_file() || metadata.len() > FILE_MAX {
        return Err(format!("is no file of at most {} MiB", FILE_MAX >> 20));
    }
    let text = std::fs::read_to_string(path).map_err(|error| format!("cannot be read: {error}"))?;
    // Spreadsheets begin a file with a byte-order mark.
    let mut lines = text.trim_start_matches('\u{feff}').lines();
    let Some(heads) = lines.next() else {
        return Err("is empty: its first line has the headings".to_owned());
    };
    let heads = fields(heads).map_err(|reason| format!("line 1 {reason}"))?;
    let name_and_unit = |head: &str| -> (String, String) {
        match head.split_once('[') {
            Some((name, unit)) => (
                name.trim().to_owned(),
                unit.trim_end().trim_end_matches(']').trim().to_owned(),
            ),
            None => (head.trim().to_owned(), String::new()),
        }
    };
    let is_named = |(_, head): &(usize, &String)| head.trim() == name || name_and_unit(head).0 == name;
    let mut named = heads.iter().enumerate().filter(is_named);
    let (at, _) = named
        .next()
        .ok_or_else(|| format!("has no column `{name}`; there is {}", heads.join(", ")))?;
    if let Some((other, _)) = named.next() {
        let (at, other) = (at + 1, other + 1);
        return Err(format!(
            "has two columns `{name}`, number {at} and {other}: give one of them another heading"
        ));
    }
    let mut cells = Vec::new();
    for (number, line) in (2..).zip(lines) {
        let line = fields(line).map_err(|reason| format!("line {number} {reason}"))?;
        if line.iter().all(String::is_empty) {
            continue;
        }
        if line.len() != heads.len() {
            // A decimal comma would give a row one cell more, and another number.
            return Err(format!(
                "line {number} has {} cells, and there are {} headings: separate cells by commas, write numbers with a decimal point, \
                 and put texts with a comma in quotes",
                line.len(),
                heads.len()
            ));
        }
        match Some(line[at].trim()).filter(|cell| !cell.is_empty()) {
            Some(cell) => cells.push(cell.to_owned()),
            None => return Err(format!("line {number} has no value in column `{name}`")),
        }
    }
    if cells.is_empty() {
        return Err("has no rows".to_owned());
    }
    Ok((cells, name_and_unit(&heads[at]).1))
}

/// The fields of a line of CSV; a field in quotes may contain commas.
fn fields(line: &str) -> Result<Vec<String>, String> {
    let (mut all, mut field, mut quoted) = (Vec::new(), String::new(), false);
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if quoted && letters.peek() == Some(&'"') => {
                letters.next();
                field.push('"');
            }
            '"' if quoted || field.is_empty() => quoted = !quoted,
            ',' if !quoted => all.push(std::mem::take(&mut field)),
            other => field.push(other),
        }
    }
    if quoted {
        return Err("has a quote that is not closed: a cell has no line break".to_owned());
    }
    all.push(field);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn column_is_found_by_name_or_whole_heading() {
        let path = std::env::temp_dir().join(format!("column-{}.csv", std::process::id()));
        std::fs::write(&path, "\u{feff}name,mass [kg],\"a, b\"\n\"x\"\"y, z\",1.5,7\nw,2,8\n\n").unwrap();
        let of = |name: &str| read_column(&path, name);
        assert_eq!(of("mass"), Ok((vec!["1.5".into(), "2".into()], "kg".into())));
        assert_eq!(of("mass [kg]"), of("mass"));
        assert_eq!(of("name").unwrap().0, ["x\"y, z", "w"]);
        assert_eq!(of("a, b").unwrap().0, ["7", "8"]);
        assert!(of("mas").unwrap_err().contains("there is name, mass [kg], a, b"));
        for (text, part) in [
            ("a,b\n1,2\n3\n", "line 3 has 1 cells, and there are 2 headings"),
            ("b\n1,5\n", "line 2 has 2 cells, and there are 1 headings"),
            ("a,b\n1,\n", "line 2 has no value in column `b`"),
            ("b [kg],a,b\n1,2,3\n", "two columns `b`, number 1 and 3"),
            ("b\n\"1.5\n", "line 2 has a quote that is not closed"),
            ("\"b\n1\n", "line 1 has a quote that is not closed"),
            ("", "is empty"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = of("b").unwrap_err();
            assert!(error.contains(part), "{text:?}: {error}");
        }
        std::fs::remove_file(&path).unwrap();
    }
}
