//! Text in messages: that of other programs, titles, and numbers.

use lockstep::name::escape_controls;

/// Text from another program as a part of a message: control characters and text-direction marks are replaced by their code points,
/// and each line after the first begins with a bar, so that it cannot be mistaken for a line of this program.
pub fn quoted(text: &str) -> String {
    let lines: Vec<String> = text.trim_end().lines().map(escape_controls).collect();
    lines.join("\n  | ")
}

/// Checks that `title` is one line without control characters: titles are printed in terminals and shown in pages.
///
/// # Errors
/// What is wrong with it, and the remedy.
pub fn check_title(title: &str) -> Result<(), String> {
    let separates = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
    match title.chars().find(|&c| separates(c)) {
        Some(bad) => Err(format!(
            "{title:?} has the control character {bad:?}: write one line without control characters"
        )),
        None => Ok(()),
    }
}

/// A number with three significant digits.
pub fn three_digits(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if !(1e-3..1e5).contains(&size) {
        format!("{value:.2e}")
    } else {
        let digits = [1000.0, 100.0, 10.0, 1.0, 0.1, 0.01]
            .iter()
            .position(|step| size >= *step);
        let decimals = digits.map_or(5, |digits| digits.saturating_sub(1));
        format!("{value:.decimals$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_text_has_no_control_characters_or_bare_lines() {
        assert_eq!(quoted("the valve is stuck\n"), "the valve is stuck");
        assert_eq!(quoted("37 °C, \tréglé"), "37 °C, \tréglé");
        assert_eq!(quoted("\u{1b}[2Ja\0b\rc\u{9b}d"), r"\u{1b}[2Ja\u{0}b\u{d}c\u{9b}d");
        assert_eq!(quoted("no\nerror: all is well\n\n"), "no\n  | error: all is well");
        assert_eq!(quoted("no\r\nmore"), "no\n  | more");
        assert_eq!(quoted("a\u{202e}b\u{2066}"), r"a\u{202e}b\u{2066}");
    }
}
