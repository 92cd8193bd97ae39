//! The export of an FMU: from a request to the finished archive.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use engine::Catalogue;
use engine::scenario::{Entry, OnFailureSpec, Program, Scenario, ScenarioSpec};
use lockstep::time::Rational;
use serde::{Deserialize, Serialize};

use crate::body::{Body, exact};
use crate::describe::{ModelInfo, describe};
use crate::kind::{Native, Version};
use crate::manifest::{Content, FORMAT, MANIFEST, Manifest, SCENARIO, token};
use crate::model::Model;
use crate::pack::Pack;
use crate::single::ParticipantBody;
use crate::usage;
use crate::variable::Variable;
use crate::whole::{self, ScenarioBody};

/// The export request.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The version of the program that requests the export.
    pub version: String,
    /// The scenario.
    pub scenario: PathBuf,
    /// Changes of the scenario, in the syntax of `--set`.
    #[serde(default)]
    pub set: Vec<String>,
    /// The participant to export; if absent, the whole scenario.
    pub participant: Option<String>,
    /// For a whole scenario: the inputs that the importer sets.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// For a whole scenario: the outputs that the importer reads; all if empty.
    #[serde(default)]
    pub outputs: Vec<String>,
    /// The major version of the standard.
    pub fmi: u32,
    /// For a whole scenario: it keeps no history, and cannot be saved.
    #[serde(default)]
    pub stateless: bool,
    /// The path of the FMU; if absent, it is named after the model, in the working directory.
    pub out: Option<PathBuf>,
    /// The library to pack.
    pub library: PathBuf,
}

/// The reason why nothing was exported.
#[derive(Debug)]
pub struct ExportError {
    /// The problem, with the remedy.
    pub text: String,
    /// Whether the cause is the scenario or the command line, not the machine.
    pub refused: bool,
}

fn refuse(text: impl Into<String>) -> ExportError {
    ExportError {
        text: text.into(),
        refused: true,
    }
}

fn io_error(text: impl Into<String>) -> ExportError {
    ExportError {
        text: text.into(),
        refused: false,
    }
}

/// The content of the archive.
struct ArchiveContents {
    manifest: Manifest,
    scenario: ScenarioSpec,
    /// Files in the scenario's folder, by name.
    files: Vec<(String, PathBuf)>,
    description: String,
}

/// Writes the FMU, and returns instructions for its use.
///
/// # Errors
/// What is rejected, or cannot be read or written.
pub fn export(catalogue: &Arc<Catalogue>, request: &Request) -> Result<String, ExportError> {
    if request.version != catalogue.version() {
        return Err(refuse(format!(
            "the library `{}` is of escapement {}, and this program is {}: build both from the same sources, with one command",
            request.library.display(),
            catalogue.version(),
            request.version
        )));
    }
    let scenario =
        Scenario::read(catalogue, &request.scenario, &request.set).map_err(|error| refuse(error.to_string()))?;
    let parts = match &request.participant {
        Some(name) => participant_contents(&scenario, name, request.fmi)?,
        None => scenario_contents(&scenario, request)?,
    };
    let (manifest, text) = (write(&parts.manifest)?, parts.scenario.to_text());
    let token = token(&manifest, &text);
    // As its library will read it, except for the locations of files.
    let mut here = parts.scenario.clone();
    relocate(&mut here, &|name| {
        parts
            .files
            .iter()
            .find(|(own, _)| own == name)
            .map(|(_, file)| file.clone())
    });
    let read = Scenario::of(catalogue, here, &request.scenario);
    let model = Model::new(Content {
        manifest: parts.manifest.clone(),
        scenario: read.map_err(|error| io_error(format!("the exported scenario cannot be read again: {error}")))?,
        token: token.clone(),
    });
    let model = check_types(model.map_err(refuse)?, parts.manifest.version())?;
    let identifier = identifier(&parts.manifest.model);
    let about = ModelInfo {
        version: parts.manifest.version(),
        identifier: &identifier,
        model: &parts.manifest.model,
        description: &parts.description,
        tool: &format!("Escapement {}", env!("CARGO_PKG_VERSION")),
        token: &token,
        state: parts.manifest.state,
        period: model.period,
        start: model.start,
        stop: model.stop,
    };
    let xml = describe(&about, model.body.ports(), &model.parameters, &model.variables);
    let file = request
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{identifier}.fmu")));
    let platform = if about.version == Version::Fmi3 {
        "x86_64-linux"
    } else {
        "linux64"
    };
    let mut pack = Pack::default();
    let mut add = |name: &str, contents: &[u8], executable| pack.add(name, contents, executable).map_err(io_error);
    add("modelDescription.xml", xml.as_bytes(), false)?;
    add(
        &format!("binaries/{platform}/{identifier}.so"),
        &contents(&request.library)?,
        true,
    )?;
    add(&format!("resources/{MANIFEST}"), manifest.as_bytes(), false)?;
    add(&format!("resources/{SCENARIO}"), text.as_bytes(), false)?;
    for (name, file) in &parts.files {
        add(&format!("resources/{name}"), &contents(file)?, true)?;
    }
    tape::write_atomic(&file, pack.finish()).map_err(|error| io_error(format!("`{}`: {error}", file.display())))?;
    let mut instructions = format!("{}\n{}", file.display(), usage::summary(&about, &model));
    if let Some(name) = &request.participant {
        let _ = write!(
            instructions,
            "\n\n{}",
            usage::entry(name, &file, &about, &model, &connected_inputs(&scenario, name))
        );
    }
    Ok(instructions)
}

/// The inputs of participant `name` that a connection feeds.
fn connected_inputs(scenario: &Scenario, name: &str) -> Vec<String> {
    let ends = scenario.links().filter_map(|(_, to, _)| to.split_once('.'));
    ends.filter(|(own, _)| *own == name)
        .map(|(_, input)| input.to_owned())
        .collect()
}

fn contents(file: &Path) -> Result<Vec<u8>, ExportError> {
    std::fs::read(file).map_err(|error| io_error(format!("`{}` cannot be read: {error}", file.display())))
}

fn write(manifest: &Manifest) -> Result<String, ExportError> {
    toml::to_string(manifest).map_err(|error| io_error(error.to_string()))
}

/// A valid C identifier made from a name.
fn identifier(name: &str) -> String {
    let letters = name
        .chars()
        .map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '_' });
    let name: String = letters.collect();
    if name.starts_with(|first: char| first.is_ascii_digit()) {
        format!("_{name}")
    } else {
        name
    }
}

/// A scenario of one participant alone.
fn participant_contents(scenario: &Scenario, name: &str, fmi: u32) -> Result<ArchiveContents, ExportError> {
    let entry = scenario.participants.iter().find(|entry| entry.setup.name == name);
    let entry = entry.ok_or_else(|| {
        let names: Vec<String> = scenario
            .participants
            .iter()
            .map(|one| format!("`{}`", one.setup.name))
            .collect();
        refuse(format!(
            "the scenario has no participant `{name}`; it has {}",
            names.join(", ")
        ))
    })?;
    match &entry.program {
        Program::Builtin(_) | Program::Library { .. } => {}
        Program::Fmu { file, .. } => {
            return Err(refuse(format!("`{name}` is an FMU already: {}", file.display())));
        }
        Program::External { exe, .. } => {
            let exe = exe.display();
            return Err(refuse(format!(
                "`{name}` is a program of its own (`{exe}`), which is no part of an FMU: make a plug-in of it, or put it into the program"
            )));
        }
    }
    let mut alone = ScenarioSpec::new(scenario.duration)
        .title(&scenario.title)
        .seed(scenario.seed);
    let mut own = scenario.spec().participants[name].clone();
    own.on_failure = OnFailureSpec::Stop;
    own.start_within = None;
    alone.participants.insert(name.to_owned(), own);
    let mut files = Vec::new();
    pack_files(&mut alone, std::iter::once(entry), &mut files);
    let manifest = Manifest {
        format: FORMAT,
        fmi,
        model: name.to_owned(),
        participant: Some(name.to_owned()),
        inputs: Vec::new(),
        outputs: Vec::new(),
        state: can_save(scenario, entry)?,
    };
    let description = if scenario.title.is_empty() {
        format!("The participant {name}")
    } else {
        format!("The participant {name} of: {}", scenario.title)
    };
    Ok(ArchiveContents {
        manifest,
        scenario: alone,
        files,
        description,
    })
}

/// The whole scenario.
fn scenario_contents(scenario: &Scenario, request: &Request) -> Result<ArchiveContents, ExportError> {
    let mut spec = scenario.spec().clone();
    spec.folder = None;
    let mut outputs = request.outputs.clone();
    if outputs.is_empty() {
        let known = engine::run::check_here(scenario).map_err(|error| refuse(error.to_string()))?;
        outputs = whole::outputs(&known.plan);
    }
    let mut files = Vec::new();
    let substitutes = scenario.substitutions.iter().map(|one| &one.entry.program);
    if let Some(file) = substitutes.filter_map(Program::file).next() {
        let file = file.display();
        return Err(refuse(format!(
            "a substitution with the file `{file}` in it cannot be exported: leave it out of the scenario"
        )));
    }
    pack_files(&mut spec, scenario.participants.iter(), &mut files);
    let mut manifest = Manifest {
        format: FORMAT,
        fmi: request.fmi,
        model: scenario.name.clone(),
        participant: None,
        inputs: request.inputs.clone(),
        outputs,
        state: !request.stateless,
    };
    let mut tried =
        ScenarioBody::new(scenario.clone(), &manifest.inputs, &manifest.outputs, manifest.state).map_err(refuse)?;
    tried.begin(&[], Rational::ZERO).map_err(refuse)?;
    manifest.state &= tried.save().is_ok_and(|state| state.checkpoint.is_some());
    Ok(ArchiveContents {
        manifest,
        scenario: spec,
        files,
        description: scenario.title.clone(),
    })
}

/// The model, if the version has a type for every variable.
fn check_types(model: Model, version: Version) -> Result<Model, ExportError> {
    let binary = |one: &&Variable| one.kind.native(version) == Native::Binary;
    match model.variables.iter().find(binary) {
        Some(one) if version == Version::Fmi2 => Err(refuse(format!(
            "`{}` has bytes, for which FMI 2.0 has no type: export it with --fmi 3",
            one.name
        ))),
        _ => Ok(model),
    }
}

/// Whether the participant can be saved after its start, found out by trying it.
fn can_save(scenario: &Scenario, entry: &Entry) -> Result<bool, ExportError> {
    let mut single = ParticipantBody::new(scenario.clone(), entry.clone()).map_err(refuse)?;
    let start = exact(entry.setup.offset).map_err(refuse)?;
    single.begin(&[], start).map_err(refuse)?;
    Ok(single.save().is_ok())
}

/// Adds the files with participants' code to the archive, under unique names.
fn pack_files<'a>(
    scenario: &mut ScenarioSpec,
    entries: impl Iterator<Item = &'a Entry>,
    files: &mut Vec<(String, PathBuf)>,
) {
    for entry in entries {
        let (Program::Library { file, .. } | Program::Fmu { file, .. }) = &entry.program else {
            continue;
        };
        let own = file
            .file_name()
            .map_or_else(|| "library".into(), |name| name.to_string_lossy().into_owned());
        let packed = match files.iter().find(|(_, known)| known == file) {
            Some((name, _)) => name.clone(),
            None => {
                let taken = files.iter().any(|(name, _)| *name == own);
                let name = if taken { format!("{}-{own}", files.len()) } else { own };
                files.push((name.clone(), file.clone()));
                name
            }
        };
        if let Some(own) = scenario.participants.get_mut(&entry.setup.name) {
            for file in [&mut own.run.library, &mut own.run.fmu].into_iter().flatten() {
                *file = packed.clone();
            }
        }
    }
}

/// Replaces the paths of the files with participants' code.
fn relocate(scenario: &mut ScenarioSpec, place: &dyn Fn(&str) -> Option<PathBuf>) {
    for own in scenario.participants.values_mut() {
        for file in [&mut own.run.library, &mut own.run.fmu].into_iter().flatten() {
            if let Some(there) = place(file) {
                *file = there.to_string_lossy().into_owned();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::identifier;

    #[test]
    fn identifier_is_valid_in_c() {
        assert_eq!(identifier("close-capture 2"), "close_capture_2");
        assert_eq!(identifier("2nd"), "_2nd");
    }
}
