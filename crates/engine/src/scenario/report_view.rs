//! `[report]` and `[scene]`: which figures the report draws, and what its playback shows.

use lockstep::plan::Plan;
use report::scene::Scene;
use report::view::{Mistake as Misfit, View};
use toml::Table;

use super::error::{Mistake, ScenarioError};
use super::names::Names;
use super::source::SourceContext;

/// Reads both tables, as far as possible without the ports of the participants.
pub(super) fn read(
    source: &SourceContext,
    participants: &Names,
    report: Option<&Table>,
    scene: Option<&Table>,
) -> Result<View, Vec<Mistake>> {
    let mut wrong = Vec::new();
    let unknown = |named: Vec<(String, &str)>| -> Vec<Misfit> {
        let unknown = named.into_iter().filter(|(_, name)| !participants.contains(name));
        unknown
            .map(|(key, name)| Misfit {
                key,
                reason: participants.unknown("participant", name),
            })
            .collect()
    };
    let mut view = View::default();
    match report.map(View::read).transpose() {
        Ok(read) => view = read.unwrap_or_default(),
        Err(mismatches) => wrong.extend(mistakes(source, "report", mismatches)),
    }
    wrong.extend(mistakes(source, "report", unknown(view.participants().collect())));
    match scene.map(Scene::read).transpose() {
        Ok(read) => view.scene = read,
        Err(mismatches) => wrong.extend(mistakes(source, "scene", mismatches)),
    }
    if let Some(scene) = &view.scene {
        wrong.extend(mistakes(source, "scene", unknown(scene.participants().collect())));
    }
    if wrong.is_empty() { Ok(view) } else { Err(wrong) }
}

fn mistakes(source: &SourceContext, table: &str, wrong: Vec<Misfit>) -> Vec<Mistake> {
    let mistake = |misfit: Misfit| match &*misfit.key {
        "" => source.mistake(table, misfit.reason),
        key => source.mistake(&format!("{table}.{key}"), misfit.reason),
    };
    wrong.into_iter().map(mistake).collect()
}

/// Checks the tables `[report]` and `[scene]` against the ports of `plan`; entries for participants whose ports are not `certain`
/// are left out.
pub(super) fn check(
    view: &View,
    source: &SourceContext,
    plan: &Plan,
    certain: impl Fn(usize) -> bool,
) -> Result<(), ScenarioError> {
    let streams = crate::run::streams(plan);
    let known = |name: &str| plan.participant(name).is_some_and(&certain);
    let mut wrong = mistakes(source, "report", view.mismatches(&streams, known));
    if let Some(scene) = &view.scene {
        wrong.extend(mistakes(source, "scene", scene.mismatches(&streams, &known)));
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(source.error(wrong))
    }
}
