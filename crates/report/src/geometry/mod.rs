//! What the bodies of a run look like, for the playback and for 3-D panels of other tools.

mod model;

use std::fs;
use std::path::{Path, PathBuf};

use tape::folder::RunFolder;
use tape::{Source, StreamSpec};

pub use model::ModelError;
pub(crate) use model::{Body, Kind, Model, Shape};

/// The names of the field with the arm's joint angles, rad.
pub(crate) const ARM_ANGLES: &[&str] = &["q"];
/// The names of the field with the slosh pendulum's joint angles, rad.
pub(crate) const SLOSH_ANGLES: &[&str] = &["slosh", "q_slosh"];
/// The port with both.
pub(crate) const TRUTH: &str = "truth";

/// Why there is no geometry.
#[derive(Debug, thiserror::Error)]
pub enum GeometryError {
    /// The file cannot be read.
    #[error("{}: cannot read the model: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is no model.
    #[error("{}: {source}", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: ModelError,
    },
}

/// The shapes of the servicer and of the target, as far as models of them were found.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    pub(crate) servicer: Option<Model>,
    pub(crate) target: Option<Model>,
    /// Why a model that was found cannot be drawn.
    pub(crate) notes: Vec<String>,
}

impl Geometry {
    /// Reads URDF models: the first with moving joints is the servicer, the first without is the target. Where `models`
    /// is empty, they are the models that the plan of the run folder `root` contains, and `*.urdf` in the folder. The
    /// first moving joints belong to the arm, as many as the tape has angles for, the others to the slosh pendulum.
    /// A model of the run that cannot be drawn is left out; one in `models` is an error then.
    pub fn read(source: &dyn Source, root: &Path, models: &[PathBuf]) -> Result<Geometry, GeometryError> {
        let truth = source.streams().iter().find(|spec| spec.port == TRUTH);
        let count = |names| truth.and_then(|spec| find(spec, names)).unwrap_or(0);
        let (arm, slosh) = (count(ARM_ANGLES), count(SLOSH_ANGLES));
        let mut texts = Vec::new();
        if models.is_empty() {
            let plan = RunFolder::open(root).plan();
            let content = fs::read_to_string(&plan).unwrap_or_default();
            if let Ok(table) = content.parse::<toml::Table>() {
                embedded(&toml::Value::Table(table), &mut |text| {
                    texts.push((plan.clone(), text.to_owned()))
                });
            }
        }
        for path in if models.is_empty() {
            models_in(root)
        } else {
            models.to_vec()
        } {
            match fs::read_to_string(&path) {
                Ok(text) => texts.push((path, text)),
                Err(source) => return Err(GeometryError::Io { path, source }),
            }
        }
        let mut geometry = Geometry::default();
        for (path, text) in texts {
            let model = match model::read(&text, arm, slosh) {
                Ok(model) => model,
                Err(source) => {
                    let error = GeometryError::Model { path, source };
                    // A model that nobody asked to draw must not stand in the way of everything else.
                    if models.is_empty() {
                        geometry.notes.push(error.to_string());
                        continue;
                    }
                    return Err(error);
                }
            };
            let slot = if model.bodies.iter().any(|body| body.axis.is_some()) {
                &mut geometry.servicer
            } else {
                &mut geometry.target
            };
            slot.get_or_insert(model);
        }
        Ok(geometry)
    }
}

fn find(spec: &StreamSpec, names: &[&str]) -> Option<usize> {
    names
        .iter()
        .find_map(|name| spec.descriptor.field(name))
        .map(|field| field.len())
}

/// Calls `found` with every text of a plan that is a URDF.
fn embedded(value: &toml::Value, found: &mut impl FnMut(&str)) {
    match value {
        toml::Value::String(text) if text.contains("<robot") => found(text),
        toml::Value::Array(items) => items.iter().for_each(|item| embedded(item, found)),
        toml::Value::Table(table) => table.values().for_each(|item| embedded(item, found)),
        _ => {}
    }
}

fn models_in(root: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for folder in [root.to_owned(), root.join("models")] {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let paths = entries.map(|entry| entry.path());
        found.extend(paths.filter(|path| path.extension().is_some_and(|extension| extension == "urdf")));
    }
    found.sort();
    found
}
