//! `escapement completions SHELL`: a script that completes commands and options.

use clap::{Args, Command, ValueEnum};

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// The shells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Shell {
    /// The Bourne-again shell
    Bash,
    /// The Z shell
    Zsh,
    /// The friendly interactive shell
    Fish,
}

/// Prints the script for `whole`, the whole command line.
pub fn run(args: &CompletionsArgs, whole: &Command) -> i32 {
    use clap_complete::{generate, shells};
    // Clap requires texts with static lifetime, which the program leaks.
    let name: &'static str = whole.get_name().to_owned().leak();
    // The generators would also offer hidden commands.
    let shown = whole.get_subcommands().filter(|own| !own.is_hide_set());
    let mut command = Command::new(name).version("").subcommands(shown.cloned());
    // Written in one piece: the generators panic when the reader closes the pipe.
    let mut script = Vec::new();
    match args.shell {
        Shell::Bash => generate(shells::Bash, &mut command, name, &mut script),
        Shell::Zsh => generate(shells::Zsh, &mut command, name, &mut script),
        Shell::Fish => generate(shells::Fish, &mut command, name, &mut script),
    }
    print!("{}", String::from_utf8_lossy(&script));
    0
}
