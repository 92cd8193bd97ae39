//! `escapement new FOLDER`: a new project from a template.

use std::path::{Path, PathBuf};

use clap::Args;

use super::project;
use crate::templates::{Project, Template};

/// Exit code: the folder or the template is invalid.
const REFUSED: i32 = 2;

/// Arguments of `new`.
#[derive(Debug, Args)]
pub struct NewArgs {
    /// The folder of the project
    #[arg(required_unless_present = "list")]
    pub folder: Option<PathBuf>,
    /// The FMUs of --template fmu
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The template; --list lists them
    #[arg(long, short, value_name = "NAME")]
    pub template: Option<String>,
    /// List the templates
    #[arg(long, conflicts_with_all = ["folder", "template", "escapement"])]
    pub list: bool,
    /// For a template in Rust: a checkout of Escapement, or the address of its repository for git [default: the sources that
    /// this program was built from]
    #[arg(long, value_name = "FOLDER|URL")]
    pub escapement: Option<String>,
}

/// Writes the project from one of `templates` of the program `name`.
pub fn run(args: &NewArgs, name: &str, templates: &[Template]) -> i32 {
    if templates.is_empty() {
        eprintln!("error: {name} has no templates");
        return REFUSED;
    }
    if args.list {
        for template in templates {
            println!("{:<10} {}", template.name, template.about);
        }
        return 0;
    }
    let folder = args.folder.as_deref().unwrap_or(Path::new("."));
    match write(args, folder, templates) {
        Ok(()) => 0,
        Err(refusal) => {
            eprintln!("error: {refusal}");
            REFUSED
        }
    }
}

fn write(args: &NewArgs, folder: &Path, templates: &[Template]) -> Result<(), String> {
    let template = match &args.template {
        None => &templates[0],
        Some(name) => templates.iter().find(|one| one.name == *name).ok_or_else(|| {
            let all: Vec<String> = templates.iter().map(|one| format!("`{}`", one.name)).collect();
            format!(
                "--template {name}: there is no such template; there is {}",
                all.join(", ")
            )
        })?,
    };
    if args.escapement.is_some() && !template.builds {
        return Err(format!(
            "--escapement: the template `{}` has nothing to build; leave the option out",
            template.name
        ));
    }
    if !(args.files.is_empty() || template.takes_files) {
        return Err(format!(
            "{}: the template `{}` takes no files; leave them out, or take --template fmu",
            args.files[0].display(),
            template.name
        ));
    }
    project::check_empty(folder)?;
    let files = (template.files)(&Project {
        name: project_name(folder),
        escapement: args.escapement.as_deref(),
        files: &args.files,
    })?;
    project::write(folder, template.name, &files, template.next)
}

/// The name of the folder, also of `.`.
fn project_name(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let last = whole.components().next_back();
    last.map_or_else(String::new, |last| last.as_os_str().to_string_lossy().into_owned())
}
