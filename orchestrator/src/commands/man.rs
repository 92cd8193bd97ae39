//! `escapement man [FOLDER]`: the manual pages.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Command};
use clap_mangen::Man;

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// The folder for a page of each command; it is created if it does not exist
    pub folder: Option<PathBuf>,
}

/// Prints or writes the pages of `command`, the whole command line.
pub fn run(args: &ManArgs, command: Command) -> anyhow::Result<i32> {
    let Some(folder) = &args.folder else {
        print!("{}", page(command)?);
        return Ok(0);
    };
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let name = command.get_name().to_owned();
    let mut pages = vec![(name.clone(), command.clone())];
    for own in command.get_subcommands().filter(|own| !own.is_hide_set()) {
        // Clap requires texts with static lifetime, which the program leaks.
        let whole: &'static str = format!("{name}-{}", own.get_name()).leak();
        let version: &'static str = command.get_version().unwrap_or_default().to_owned().leak();
        let called = format!("{name} {}", own.get_name());
        pages.push((
            whole.to_owned(),
            own.clone().name(whole).bin_name(called).version(version),
        ));
    }
    for (name, command) in pages {
        let path = folder.join(format!("{name}.1"));
        std::fs::write(&path, page(command)?).with_context(|| path.display().to_string())?;
        println!("{}", path.display());
    }
    Ok(0)
}

fn page(command: Command) -> anyhow::Result<String> {
    let mut page = Vec::new();
    Man::new(command.disable_help_subcommand(true)).render(&mut page)?;
    Ok(String::from_utf8(page)?)
}
