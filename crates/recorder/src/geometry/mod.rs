//! What the bodies of a run look like, for the playback and for 3-D panels of other tools.

mod model;

use std::fs;
use std::path::{Path, PathBuf};

use crate::tape::{Source, StreamSpec};

pub use model::ModelError;
pub(crate) use model::{Body, Kind, Model, Shape};

/// The names of the field with the arm's joint angles, rad.
pub(crate) const ARM_ANGLES: &[&str] = &["q"];
/// The names of the field with the slosh pendulum's joint angles, rad.
pub(crate) const SLOSH_ANGLES: &[&str] = &["q_slosh", "q_p"];
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
}

impl Geometry {
    /// Reads URDF files: one with moving joints is the servicer, one without is the target. Where `models` is empty,
    /// `*.urdf` in the run folder `root` or its `models` are taken, else the files that its `plan.toml` names. The first
    /// moving joints belong to the arm, as many as the tape has angles for, the others to the slosh pendulum.
    pub fn read(source: &dyn Source, root: &Path, models: &[PathBuf]) -> Result<Geometry, GeometryError> {
        let truth = source.streams().iter().find(|spec| spec.port == TRUTH);
        let count = |names| truth.and_then(|spec| find(spec, names)).unwrap_or(0);
        let (arm, slosh) = (count(ARM_ANGLES), count(SLOSH_ANGLES));
        let paths = if models.is_empty() {
            models_of(root)
        } else {
            models.to_vec()
        };
        let mut geometry = Geometry::default();
        for path in paths {
            let text = fs::read_to_string(&path).map_err(|source| GeometryError::Io {
                path: path.clone(),
                source,
            })?;
            let model = model::read(&text, arm, slosh).map_err(|source| GeometryError::Model { path, source })?;
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

fn models_of(root: &Path) -> Vec<PathBuf> {
    let is_urdf = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "urdf") && path.is_file();
    let mut found = Vec::new();
    for folder in [root.to_owned(), root.join("models")] {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        found.extend(entries.map(|entry| entry.path()).filter(is_urdf));
    }
    if found.is_empty() {
        let plan = fs::read_to_string(root.join("plan.toml")).unwrap_or_default();
        found.extend(plan.split('"').skip(1).step_by(2).map(PathBuf::from).filter(is_urdf));
    }
    found.sort();
    found.dedup();
    found
}
