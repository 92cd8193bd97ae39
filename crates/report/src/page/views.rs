//! Figures and scene of a run's page: those of its scenario, the views of the program, every field.

use std::fs;
use std::path::PathBuf;

use lockstep::time::Rational;
use tape::StreamSpec;
use toml::{Table, Value};

use super::error::ReportError;
use crate::scene::{BoundScene, Scene, bind as bind_scene};
use crate::view::{BoundFigures, View, Views, bind, every_field, limits_of, omitted_fields_note};

/// Figures, marks and scene, bound to the streams of a run.
pub(super) struct BoundViews {
    pub(super) bound: BoundFigures,
    pub(super) marks: Vec<(String, Rational)>,
    pub(super) scene: Option<BoundScene>,
    pub(super) notes: Vec<String>,
}

/// The figures, marks and scene of a run: its scenario's, and those of the program's views.
pub(super) fn bind_views(
    streams: &[StreamSpec],
    plan: &Table,
    views: &[Views],
    models: &[(String, PathBuf)],
) -> Result<BoundViews, ReportError> {
    let table = |name: &str| plan.get(name).and_then(Value::as_table);
    // The plan was valid when the run began; a plan of a later version that cannot be read is drawn without its panels.
    let own = table("report")
        .and_then(|table| View::read(table).ok())
        .unwrap_or_default();
    let limits = limits_of(plan);
    let (mut bound, mut marks, mut notes) = (BoundFigures::default(), own.marks.clone(), Vec::new());
    bind(&own.figures, streams, &limits, false, &mut bound);
    let mut scene = table("scene").and_then(|table| Scene::read(table).ok());
    for view in views {
        let view = view(streams, plan);
        bind(&view.figures, streams, &limits, false, &mut bound);
        marks.extend(view.marks);
        notes.extend(view.notes);
        scene = scene.or(view.scene);
    }
    bind(&every_field(streams), streams, &limits, true, &mut bound);
    notes.extend(omitted_fields_note(streams));
    let scene = with_models(scene, models)?;
    let scene = scene.and_then(|scene| bind_scene(&scene, streams).0);
    Ok(BoundViews {
        bound,
        marks,
        scene,
        notes,
    })
}

/// The scene of a run from its scenario, else from the views of a program; `models` replaces the models of the bodies it
/// names.
///
/// # Errors
/// A model that cannot be read or drawn, or for a body that does not exist.
pub fn scene_of(
    streams: &[StreamSpec],
    plan: &Table,
    views: &[Views],
    models: &[(String, PathBuf)],
) -> Result<Option<Scene>, ReportError> {
    let own = plan
        .get("scene")
        .and_then(Value::as_table)
        .and_then(|table| Scene::read(table).ok());
    let scene = own.or_else(|| views.iter().find_map(|view| view(streams, plan).scene));
    with_models(scene, models)
}

fn with_models(scene: Option<Scene>, models: &[(String, PathBuf)]) -> Result<Option<Scene>, ReportError> {
    let mut scene = scene;
    for (body, path) in models {
        let fail = |reason: String| ReportError::File {
            path: path.clone(),
            reason,
        };
        let text = fs::read_to_string(path).map_err(|error| fail(format!("cannot read the model: {error}")))?;
        let replaced = scene.get_or_insert_default().replace_model(body, &text);
        replaced.map_err(fail)?;
    }
    Ok(scene)
}
