//! `[report]`: which figures the report draws.

use lockstep::plan::Plan;
use report::view::{Mistake as Misfit, View};
use toml::Table;

use super::error::{Mistake, ScenarioError};
use super::names::Names;
use super::source::Source;

/// Reads the table, as far as that goes without the ports of the participants.
pub(super) fn read(source: &Source, participants: &Names, table: Option<&Table>) -> Result<View, Vec<Mistake>> {
    let Some(table) = table else { return Ok(View::default()) };
    let view = View::read(table).map_err(|wrong| mistakes(source, wrong))?;
    let unknown = view.participants().filter(|(_, name)| !participants.contains(name));
    let wrong: Vec<Misfit> = unknown
        .map(|(key, name)| Misfit {
            key,
            reason: participants.unknown("participant", name),
        })
        .collect();
    if wrong.is_empty() {
        Ok(view)
    } else {
        Err(mistakes(source, wrong))
    }
}

fn mistakes(source: &Source, wrong: Vec<Misfit>) -> Vec<Mistake> {
    let mistake = |misfit: Misfit| match &*misfit.key {
        "" => source.mistake("report", misfit.reason),
        key => source.mistake(&format!("report.{key}"), misfit.reason),
    };
    wrong.into_iter().map(mistake).collect()
}

/// Compares `pictures` with the ports of `plan`; what concerns participants whose ports are not `certain` is left out.
pub(super) fn check(
    pictures: &View,
    source: &Source,
    plan: &Plan,
    certain: impl Fn(usize) -> bool,
) -> Result<(), ScenarioError> {
    let streams = crate::run::streams(plan);
    let known = |name: &str| plan.participant(name).is_some_and(&certain);
    let wrong = mistakes(source, pictures.misfits(&streams, known));
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(source.error(wrong))
    }
}
