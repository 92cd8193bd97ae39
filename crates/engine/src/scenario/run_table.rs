//! `run = { … }`: the program, located and checked.

use std::path::{Path, PathBuf};

use super::error::Mistake;
use super::program::{Program, in_path, is_executable};
use super::source::SourceContext;
use super::spec::{FOLDER, RunSpec};

/// Reads a `run` table at `key`.
pub(super) fn resolve_program(source: &SourceContext, key: &str, run: &RunSpec) -> Result<Program, Mistake> {
    if let (None, None, None, Some(file)) = (&run.builtin, &run.exe, &run.library, &run.fmu) {
        return fmu_program(source, key, file, run);
    }
    if run.fmu.is_some() || !run.fmu_options().is_empty() {
        return Err(source.mistake(
            key,
            "`ports`, `messages`, `record`, `feedthrough` and `tolerance` belong to { fmu = \"FILE.fmu\" }, which stands without another program",
        ));
    }
    let misplaced = |what: &str, remedy: &str| Err(source.mistake(key, format!("{what}: {remedy}")));
    if run.library.is_none() && run.participant.is_some() {
        return misplaced(
            "`participant` chooses one of a library",
            "leave it out, or name a `library`",
        );
    }
    match (&run.builtin, &run.exe, &run.library) {
        (Some(builtin), None, None) => {
            if source.builtins.factory(builtin).is_none() {
                let known: Vec<String> = source.builtins.names().map(|name| format!("`{name}`")).collect();
                let reason = format!("there is no builtin `{builtin}`; there is {}", known.join(", "));
                return Err(source.mistake(key, reason));
            }
            if !run.args.is_empty() {
                return Err(source.mistake(key, "a builtin takes no args: use `parameters`"));
            }
            Ok(Program::Builtin(builtin.clone()))
        }
        (None, None, Some(file)) => {
            if !run.args.is_empty() {
                return misplaced("a library takes no args", "use `parameters`");
            }
            let path = source.folder.join(file);
            plugin::look(&path).map_err(|wrong| {
                let from = relative_path_hint(file);
                source.mistake(key, format!("{wrong}{from}"))
            })?;
            let file = absolute(&path).map_err(|reason| source.mistake(key, reason))?;
            let participant = run.participant.clone();
            Ok(Program::Library { file, participant })
        }
        (None, Some(exe), None) => {
            let folder = &source.folder;
            let found = find_executable(folder, exe).and_then(|exe| Ok((exe, absolute(folder)?)));
            let (exe, folder) = found.map_err(|reason| source.mistake(key, reason))?;
            if !folder.is_dir() {
                let reason = format!("there is no folder `{}`, in which programs are started", folder.display());
                return Err(source.mistake(FOLDER, reason));
            }
            let args = run.args.clone();
            Ok(Program::External { exe, args, folder })
        }
        _ => Err(source.mistake(
            key,
            "write { builtin = \"NAME\" }, { exe = \"FILE\", args = […] }, { library = \"FILE.so\" } or { fmu = \"FILE.fmu\" }",
        )),
    }
}

/// An FMU is read here, so that a file that is no FMU is refused with its line; none of its code runs.
fn fmu_program(source: &SourceContext, key: &str, file: &str, run: &RunSpec) -> Result<Program, Mistake> {
    if !run.args.is_empty() {
        return Err(source.mistake(key, "an FMU takes no args: use `parameters`"));
    }
    let path = source.folder.join(file);
    let options = run.fmu_options();
    let aliases = fmu::check(&path, &options).map_err(|error| {
        let below = if error.key.is_empty() { "fmu" } else { &error.key };
        source.mistake(&format!("{key}.{below}"), error.reason)
    })?;
    let file = absolute(&path).map_err(|reason| source.mistake(key, reason))?;
    let options = options.to_string();
    Ok(Program::Fmu { file, options, aliases })
}

/// A program named with a slash is relative to the scenario; a bare name is searched for in PATH.
fn find_executable(folder: &Path, exe: &str) -> Result<PathBuf, String> {
    if exe.contains('/') {
        let path = folder.join(exe);
        return if is_executable(&path) {
            absolute(&path)
        } else {
            let from = relative_path_hint(exe);
            Err(format!("`{}` is not an executable file{from}", path.display()))
        };
    }
    in_path(exe)
        .and_then(|path| absolute(&path).ok())
        .ok_or_else(|| format!("there is no program `{exe}` in PATH; name a file with its folder, such as \"./{exe}\""))
}

/// A note for relative paths on where such a file is searched for. An option that takes a program names it in full.
fn relative_path_hint(file: &str) -> &'static str {
    match Path::new(file).is_absolute() {
        true => "",
        false => "; a relative path is one from the scenario's folder",
    }
}

fn absolute(path: &Path) -> Result<PathBuf, String> {
    // The folder of a file named without a folder is the empty path.
    let path = if path.as_os_str().is_empty() {
        Path::new(".")
    } else {
        path
    };
    std::path::absolute(path).map_err(|error| format!("`{}`: {error}", path.display()))
}
