//! Version text of the program.

/// Escapement's version with the commit that it was built from: `0.1.0 (1a2b3c4d5e6f)`, `0.1.0 (1a2b3c4d5e6f-dirty)` with
/// changed sources, `0.1.0` where the commit is unknown.
pub const ESCAPEMENT: &str = concat!(env!("CARGO_PKG_VERSION"), env!("ESCAPEMENT_COMMIT"));

/// The version of the program `name`, which states its own version as `own`, or none.
pub fn of_program(name: &str, own: Option<&str>) -> String {
    match own {
        Some(own) => format!("{own}, built on escapement {ESCAPEMENT}"),
        None if name == "escapement" => ESCAPEMENT.to_owned(),
        None => format!("built on escapement {ESCAPEMENT}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn user_program_does_not_take_escapement_version() {
        assert!(ESCAPEMENT.starts_with(env!("CARGO_PKG_VERSION")));
        assert_eq!(of_program("escapement", None), ESCAPEMENT);
        assert_eq!(of_program("a", None), format!("built on escapement {ESCAPEMENT}"));
        assert_eq!(
            of_program("a", Some("7.1")),
            format!("7.1, built on escapement {ESCAPEMENT}")
        );
    }
}
