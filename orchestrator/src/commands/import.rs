//! `escapement import FILE.ssp`: a scenario from a system structure.

use std::path::{Path, PathBuf};

use clap::Args;
use lockstep::time::Rational;

use super::project::{File, check_empty, write};
use crate::arguments::parse_duration;

/// Exit code: the package or the folder is invalid.
const REFUSED: i32 = 2;

/// Arguments of `import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// The package, or a folder with its contents
    pub file: PathBuf,
    /// The folder to write; by default the name of the package
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// The period of all FMUs, such as 10ms; by default the step size of each FMU's default experiment
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub period: Option<Rational>,
    /// Accept algebraic loops: the connections of each FMU in a loop are delayed by one period
    #[arg(long)]
    pub open_loops: bool,
}

/// Imports.
pub fn run(args: &ImportArgs) -> i32 {
    match import(args) {
        Ok(()) => 0,
        Err(refusal) => {
            eprintln!("error: {refusal}");
            REFUSED
        }
    }
}

fn import(args: &ImportArgs) -> Result<(), String> {
    let stem = args.file.file_stem().map_or(Path::new("system"), Path::new);
    let folder = args.out.as_deref().unwrap_or(stem);
    check_empty(folder)?;
    let options = ssp::Options {
        period: args.period,
        open_loops: args.open_loops,
    };
    let imported = ssp::import(&args.file, options).map_err(|error| error.to_string())?;
    for note in &imported.notes {
        eprintln!("note: {note}");
    }
    let mut files = vec![File {
        path: "scenario.toml".into(),
        contents: imported.scenario.into_bytes(),
    }];
    files.extend(
        imported
            .fmus
            .into_iter()
            .map(|(path, contents)| File { path, contents }),
    );
    let next = [
        "escapement check scenario.toml",
        "escapement run scenario.toml --out runs/first",
        "escapement report runs/first",
    ];
    write(folder, "imported", &files, &next)
}
