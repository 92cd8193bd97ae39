//! Text and exit codes of the errors of commands.

use std::fmt;

use engine::run::RunFailure;
use engine::scenario::ScenarioError;

/// A mistake in the command line or in a file that it names; the command did nothing.
#[derive(Debug)]
pub struct Refusal(String);

impl Refusal {
    /// A refusal with the text of `error`.
    pub fn of(error: impl Into<anyhow::Error>) -> Refusal {
        Refusal(error_text(&error.into()))
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refusal {}

/// An error with its causes. A cause whose text is already part of the error's text is not repeated.
pub fn error_text(error: &anyhow::Error) -> String {
    let mut words = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !words.contains(&cause) {
            words += &format!(": {cause}");
        }
    }
    words
}

/// The exit code of a command that ends with `error`: 2 when the user must change something, else 1.
pub fn exit_code(error: &anyhow::Error) -> i32 {
    if error.is::<Refusal>() || error.is::<ScenarioError>() {
        return 2;
    }
    error.downcast_ref::<RunFailure>().map_or(1, RunFailure::exit_code)
}

#[cfg(test)]
mod tests {
    use std::io;

    use anyhow::{Context, anyhow};

    use super::*;

    #[test]
    fn error_text_names_repeated_cause_once() {
        let error = || io::Error::other("the disk is full");
        let text_of = |error: anyhow::Error| error_text(&error);
        assert_eq!(text_of(error().into()), "the disk is full");
        let wrapped = Err::<(), _>(error()).context("x.toml").unwrap_err();
        assert_eq!(text_of(wrapped), "x.toml: the disk is full");
        let wrapped_again = Err::<(), _>(error())
            .context("x.toml: the disk is full; name another")
            .unwrap_err();
        assert_eq!(text_of(wrapped_again), "x.toml: the disk is full; name another");
    }

    #[test]
    fn user_mistake_exits_with_code_two() {
        assert_eq!(exit_code(&anyhow!("x")), 1);
        assert_eq!(exit_code(&Refusal::of(anyhow!("x")).into()), 2);
        assert_eq!(exit_code(&RunFailure::Interrupted.into()), 1);
    }
}
