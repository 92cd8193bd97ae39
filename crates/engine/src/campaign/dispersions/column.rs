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
    let mut lines = text.trim_start_matches('\u{feff}').lines().map(fields);
    let heads = lines.next().unwrap_or_default();
    let name_and_unit = |head: &str| -> (String, String) {
        match head.split_once('[') {
            Some((name, unit)) => (
                name.trim().to_owned(),
                unit.trim_end().trim_end_matches(']').trim().to_owned(),
            ),
            None => (head.trim().to_owned(), String::new()),
        }
    };
    let at = heads
        .iter()
        .position(|head| head.trim() == name || name_and_unit(head).0 == name);
    let at = at.ok_or_else(|| format!("has no column `{name}`; there is {}", heads.join(", ")))?;
    let mut cells = Vec::new();
    for (number, line) in lines
        .enumerate()
        .filter(|(_, line)| line.iter().any(|cell| !cell.is_empty()))
    {
        match line.get(at).map(|cell| cell.trim()).filter(|cell| !cell.is_empty()) {
            Some(cell) => cells.push(cell.to_owned()),
            None => return Err(format!("has no value in column `{name}` of line {}", number + 2)),
        }
    }
    if cells.is_empty() {
        return Err("has no rows".to_owned());
    }
    Ok((cells, name_and_unit(&heads[at]).1))
}

/// The fields of a line of CSV; a field in quotes may contain commas.
fn fields(line: &str) -> Vec<String> {
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
    all.push(field);
    all
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
        std::fs::write(&path, "a,b\n1,2\n3\n").unwrap();
        assert!(of("b").unwrap_err().contains("line 3"));
        std::fs::remove_file(&path).unwrap();
    }
}
