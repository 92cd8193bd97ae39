//! The rule for names of participants, ports, faults and streams, and for characters of other texts.

/// The longest name.
pub const NAME_MAX: usize = 64;

/// Whether `text` has 1 to `longest` letters, digits, `_` and `-`: safe in file names, keys and commands.
pub fn is_name(text: &str, longest: usize) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    (1..=longest).contains(&text.len()) && text.chars().all(plain)
}

/// Whether `c` changes how a terminal or a page shows the rest of a text: a control character, or a mark of the direction of writing.
pub fn is_control_or_direction_mark(c: char) -> bool {
    let is_direction_mark = matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && c != '\t') || is_direction_mark
}

/// `text` on one line, with control characters and direction marks as their code points.
pub fn escape_controls(text: &str) -> String {
    let shown = text.chars().map(|c| match is_control_or_direction_mark(c) {
        true => c.escape_unicode().to_string(),
        false => c.to_string(),
    });
    shown.collect()
}
