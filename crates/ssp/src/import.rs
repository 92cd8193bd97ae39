//! Conversion of a package into a scenario.

use std::path::Path;

use fmu::{Archive, Draft, DraftParticipant, Model, Names, ZipError};
use lockstep::time::Rational;

use crate::connect::{FlatSystem, flatten};
use crate::error::SspError;
use crate::package::Package;
use crate::read::{DESCRIPTION, read};
use crate::structure::{Location, Structure};

/// The largest package that is read, bytes: 1 GiB.
const FILE_MAX: u64 = 1 << 30;
/// The largest number of participants in a scenario.
const PARTS_MAX: usize = 512;
/// The simulated time of a system that does not state one, s.
const DURATION: f64 = 10.0;

/// The user's choices.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// The period of all FMUs; if not given, each FMU has that of its default experiment.
    pub period: Option<Rational>,
    /// Whether algebraic loops are opened: a value then takes as many periods for a round as the loop has FMUs.
    pub open_loops: bool,
}

/// A scenario with its files.
#[derive(Debug)]
pub struct Imported {
    /// The scenario, as TOML.
    pub scenario: String,
    /// The FMUs: names below the scenario's folder, and contents.
    pub fmus: Vec<(String, Vec<u8>)>,
    /// What was omitted, or may differ from the user's expectation.
    pub notes: Vec<String>,
}

/// Reads a package: an archive, or a folder with what is in one.
///
/// # Errors
/// Everything that is wrong with it or cannot be expressed, with file and line.
pub fn import(file: &Path, options: Options) -> Result<Imported, SspError> {
    let path = || file.to_owned();
    let io = |source| SspError::Io { path: path(), source };
    let about = std::fs::metadata(file).map_err(io)?;
    if about.is_dir() {
        return import_package(file, &Package::Folder(path()), options);
    }
    if about.len() > FILE_MAX {
        let reason = format!("it has {} bytes; at most {FILE_MAX} are read", about.len());
        return Err(SspError::Missing { path: path(), reason });
    }
    let archive = Archive::read(std::fs::read(file).map_err(io)?);
    let archive = archive.map_err(|source| SspError::Zip { path: path(), source })?;
    import_package(file, &Package::Archive(archive), options)
}

/// Reads the files of a package; `file` is its name in messages.
///
/// # Errors
/// As of [`import`].
pub fn import_package(file: &Path, package: &Package, options: Options) -> Result<Imported, SspError> {
    let path = || file.to_owned();
    let zip = |source| SspError::Zip { path: path(), source };
    let refused = |problems| SspError::Refused { path: path(), problems };
    let description = package.file(DESCRIPTION).ok_or_else(|| SspError::Missing {
        path: path(),
        reason: format!("it has no {DESCRIPTION}, which every SSP has"),
    })?;
    let structure = read(package, &description.map_err(zip)?).map_err(refused)?;
    let mut models: Vec<PackagedFmu<'_>> = Vec::new();
    let mut names = Names::default();
    for source in structure.elements.iter().filter_map(|one| one.source()) {
        if models.iter().all(|taken| taken.source != source)
            && let Some(contents) = contents(package, &structure, source)
        {
            let contents = contents.map_err(zip)?;
            let model = Model::read(file.join(source), contents.clone())?;
            let last = source.rsplit('/').next().unwrap_or(source);
            let file = format!("fmus/{}.fmu", names.unique(last.strip_suffix(".fmu").unwrap_or(last)));
            models.push(PackagedFmu {
                source,
                file,
                model,
                contents,
            });
        }
    }
    let components = structure.elements.iter().enumerate();
    let components: Vec<(usize, &Model)> = components
        .filter_map(|(number, one)| Some((number, &find(&models, one.source()?)?.model)))
        .collect();
    let (mut flat, algebraic_loop) = flatten(&structure, &components);
    check_limits(&structure, &components, &algebraic_loop, options, &mut flat);
    if !flat.problems.is_empty() {
        return Err(refused(std::mem::take(&mut flat.problems)));
    }
    add_notes(&structure, &components, options, &mut flat);
    let notes = flat.notes.clone();
    let scenario = draft(&structure, &components, flat, &models, options).text();
    let fmus = models.into_iter().map(|taken| (taken.file, taken.contents));
    Ok(Imported {
        scenario,
        fmus: fmus.collect(),
        notes,
    })
}

/// The FMU of a component.
fn contents(package: &Package, structure: &Structure, source: &str) -> Option<Result<Vec<u8>, ZipError>> {
    let inside = structure.inside.get(source).cloned();
    inside.map(Ok).or_else(|| package.file(source))
}

/// Reports what a scenario cannot have.
fn check_limits(
    structure: &Structure,
    components: &[(usize, &Model)],
    algebraic_loop: &[usize],
    options: Options,
    flat: &mut FlatSystem,
) {
    let mut refuse = |line: Location, reason: String| flat.problems.push(structure.problem(line, reason));
    let root = structure.elements[0].line;
    if components.is_empty() || components.len() > PARTS_MAX {
        let count = components.len();
        refuse(
            root,
            format!("the system has {count} components; a scenario has 1 to {PARTS_MAX} participants"),
        );
    }
    let (start, stop) = (structure.start.unwrap_or(0.0), structure.stop);
    if start < 0.0 || stop.is_some_and(|stop| stop <= start) {
        let stop = stop.map_or("not given".to_owned(), |stop| stop.to_string());
        refuse(
            root,
            format!(
                "the default experiment starts at {start} s and its end is {stop}; a run goes from 0 s or later to a later end"
            ),
        );
    }
    if let (false, [first, ..]) = (options.open_loops, algebraic_loop) {
        let shown = algebraic_loop
            .iter()
            .chain([first])
            .map(|&one| structure.path(components[one].0));
        let shown: Vec<String> = shown.map(|name| format!("`{name}`")).collect();
        refuse(
            structure.elements[components[*first].0].line,
            format!(
                "{} is an algebraic loop: as far as the FMUs say, each output follows from an input at the same instant; --open-loops \
                 imports it all the same, with one period of delay at each of them",
                shown.join(" -> ")
            ),
        );
    }
}

/// Notes what may differ from the user's expectation.
fn add_notes(structure: &Structure, components: &[(usize, &Model)], options: Options, flat: &mut FlatSystem) {
    if structure.stop.is_none() {
        flat.notes.push(format!(
            "the default experiment has no stop time: the duration is {DURATION} s"
        ));
    }
    for (number, (element, model)) in components.iter().enumerate() {
        let name = structure.path(*element);
        let about = &model.description;
        if options.period.is_none() && about.experiment.step.is_none() && about.capabilities.fixed_step.is_none() {
            flat.notes.push(format!(
                "the FMU of `{name}` names no step: its period is 10 ms; --period says another one"
            ));
        }
        if let Err(error) = model.library() {
            flat.notes.push(format!("`{name}`: {error}"));
        }
        let feedthrough = flat.connections.iter().any(|wire| {
            let output = about.variable(&wire.from.1);
            wire.from.0 == number && output.is_some_and(|output| output.feedthrough)
        });
        if feedthrough {
            flat.notes.push(format!(
                "`{name}` has outputs with direct feedthrough: they follow its inputs one period later, unless its `run` says \
                 feedthrough = true"
            ));
        }
    }
}

/// An FMU of the package.
struct PackagedFmu<'a> {
    source: &'a str,
    /// Its path, relative to the scenario's folder.
    file: String,
    model: Model,
    contents: Vec<u8>,
}

fn find<'a>(models: &'a [PackagedFmu<'_>], source: &str) -> Option<&'a PackagedFmu<'a>> {
    models.iter().find(|taken| taken.source == source)
}

fn draft<'a>(
    structure: &Structure,
    components: &[(usize, &'a Model)],
    flat: FlatSystem,
    models: &[PackagedFmu<'_>],
    options: Options,
) -> Draft<'a> {
    let start = structure.start.filter(|start| *start > 0.0);
    let stop = structure.stop.unwrap_or(start.unwrap_or(0.0) + DURATION);
    let mut names = Names::default();
    let mut settings = flat.settings.into_iter();
    let parts = components.iter().map(|(element, model)| {
        let path = structure.path(*element);
        let source = structure.elements[*element].source().unwrap_or_default();
        DraftParticipant {
            name: names.unique(&path.replace('.', "-")),
            file: find(models, source).map(|taken| taken.file.clone()).unwrap_or_default(),
            about: &model.description,
            period: match options.period {
                Some(period) => period.to_string(),
                None => format!("{} s", fmu::suggested_period(&model.description)),
            },
            offset: start.map(|start| format!("{start} s")),
            parameters: settings.next().unwrap_or_default(),
        }
    });
    Draft {
        title: structure.name.clone(),
        duration: format!("{stop} s"),
        parts: parts.collect(),
        connections: flat.connections,
        figures: flat.outputs,
        notes: flat.notes,
    }
}
