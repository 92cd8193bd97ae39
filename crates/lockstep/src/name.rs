//! The rule for names of participants, ports, faults and streams.

/// The longest name.
pub const NAME_MAX: usize = 64;

/// Whether `text` has 1 to `longest` letters, digits, `_` and `-`: safe in file names, keys and commands.
pub fn is_name(text: &str, longest: usize) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    (1..=longest).contains(&text.len()) && text.chars().all(plain)
}
