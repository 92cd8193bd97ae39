//! Names: as keys and texts of a scenario, and suggestions for misspelt ones.

use std::fmt::Write;

/// The name among `known` that `wanted` most probably means.
pub fn nearest<'a>(wanted: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let scored = known.map(|name| (distance(&wanted.to_lowercase(), &name.to_lowercase()), name));
    let (distance, name) = scored.min_by_key(|(distance, _)| *distance)?;
    (distance <= 1 + wanted.chars().count() / 2).then_some(name)
}

/// The edit distance: number of letters to be changed, added or removed.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in b.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// "there is no variable `x`; did you mean `y`?"
pub fn unknown<'a>(wanted: &str, known: impl Iterator<Item = &'a str>) -> String {
    match nearest(wanted, known) {
        Some(name) => format!("the FMU has no variable `{wanted}`; did you mean `{name}`?"),
        None => format!("the FMU has no variable `{wanted}`; `escapement fmu inspect FILE` lists them"),
    }
}

/// Text in quotes, on one line.
pub(crate) fn quoted(text: &str) -> String {
    let mut all = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => all.extend(['\\', letter]),
            control if control.is_control() => drop(write!(all, "\\u{:04X}", control as u32)),
            other => all.push(other),
        }
    }
    all.push('"');
    all
}

/// A name as a key of a scenario: in quotes where it needs them.
pub(crate) fn key(name: &str) -> String {
    let bare = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == '-';
    if !name.is_empty() && name.chars().all(bare) {
        name.to_owned()
    } else {
        quoted(name)
    }
}
