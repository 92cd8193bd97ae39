//! One run of a report: its tape, its files, and the streams that its figures are drawn from.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use super::budget::Budget;
use super::error::ReportError;
use super::files::{PlanFile, read_json};
use super::motion;
use super::series::{self, Series};
use super::times::{self, ParticipantTime};
use super::views::{BoundViews, bind_views};
use crate::scene::{BoundScene, Motion};
use crate::view::{BoundFigure, BoundFigures, Views};
use tape::folder::RunFolder;
use tape::{Event, Reader, Source};

/// All data of one run on the page.
pub(crate) struct Run {
    pub(super) name: String,
    pub(super) digest: String,
    pub(super) sealed: bool,
    pub(super) notes: Vec<String>,
    pub(super) plan: PlanFile,
    pub(super) events: Vec<Event>,
    pub(super) marks: Vec<Mark>,
    pub(super) figures: Vec<FigureData>,
    pub(super) scene: Option<(BoundScene, Motion)>,
    pub(super) summary: Value,
    /// The provenance of the run: the contents of `run.json`.
    pub(super) about: Value,
    pub(super) participants: Vec<ParticipantTime>,
}

/// A figure with the curves of one run.
pub(crate) struct FigureData {
    pub(super) drawn: BoundFigure,
    pub(super) series: Vec<Series>,
    /// The differences from the first run, at this run's instants.
    pub(super) differences: Vec<Series>,
}

/// An instant that every figure marks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Mark {
    pub(super) t: f64,
    pub(super) kind: &'static str,
    pub(super) text: String,
}

/// The input of a report.
#[derive(Default)]
pub struct Request<'a> {
    /// Run folders, or bare tapes.
    pub folders: &'a [PathBuf],
    /// Names for the runs, in their order; runs without one are named by their differences, or by their folders.
    pub labels: &'a [String],
    /// URDF files that replace the scene's shapes of bodies in the playback.
    pub models: &'a [(String, PathBuf)],
    /// The views of the program's own applications.
    pub views: &'a [Views],
}

/// The figures of all runs.
pub(super) fn merge_figures(runs: &[Run]) -> Vec<BoundFigure> {
    let mut all: Vec<BoundFigure> = Vec::new();
    for figure in runs.iter().flat_map(|run| &run.figures) {
        match all.iter_mut().find(|one| one.id == figure.drawn.id) {
            None => all.push(figure.drawn.clone()),
            Some(there) => {
                for limit in &figure.drawn.limits {
                    if !there.limits.contains(limit) {
                        there.limits.push(limit.clone());
                    }
                }
            }
        }
    }
    // Chosen figures come first, whichever run has them.
    all.sort_by_key(|figure| figure.signal);
    all
}

/// The maximum number of points of the curves of each figure.
fn budgets(bound: &BoundFigures, chosen: Budget) -> impl Fn(usize) -> Budget {
    let signal: Vec<bool> = bound.figures.iter().map(|figure| figure.signal).collect();
    let curves = bound.bindings.iter().filter(|binding| signal[binding.figure]);
    let count = curves.map(|binding| binding.curves.len()).sum();
    let others = Budget::for_curves(count, signal.contains(&false));
    move |figure| if signal[figure] { others } else { chosen }
}

/// Adds to the figures of `run` their differences from the reference.
pub(super) fn add_differences(
    (reference, its): (&Reader, &BoundFigures),
    (reader, bound): (&Reader, &BoundFigures),
    run: &mut Run,
) -> Result<(), ReportError> {
    let all = series::differences((reference, its), (reader, bound), budgets(its, Budget::HALF))?;
    for (figure, differences) in its.figures.iter().zip(all) {
        if let Some(mine) = run.figures.iter_mut().find(|mine| mine.drawn.id == figure.id) {
            mine.differences = differences;
        }
    }
    Ok(())
}

pub(super) fn read_run(root: &Path, request: &Request<'_>) -> Result<(Reader, BoundFigures, Run), ReportError> {
    let reader = Reader::open(root)?;
    let folder = RunFolder::open(root);
    let plan = PlanFile::read(&folder)?;
    let summary = read_json(&folder.summary())?;
    let made = bind_views(reader.streams(), &plan.table, request.views, request.models)?;
    let BoundViews {
        bound,
        marks,
        scene,
        mut notes,
    } = made;
    for torn in reader.incomplete_records() {
        notes.push(format!(
            "Stream {} ends in an incomplete record after {} complete ones.",
            torn.stream, torn.complete
        ));
    }
    let curves = series::extract(&reader, &bound, budgets(&bound, Budget::FULL))?;
    let figures = bound.figures.iter().zip(curves).map(|(drawn, series)| FigureData {
        drawn: drawn.clone(),
        series,
        differences: Vec::new(),
    });
    let events = reader.events()?;
    let scene = match scene {
        Some(scene) => {
            let motion = motion::extract(&reader, &scene)?;
            Some((scene, motion))
        }
        None => None,
    };
    let run = Run {
        name: name_of(root),
        digest: match reader.sealed_digest() {
            Some(digest) => digest.to_string(),
            None => reader.digest()?.to_string(),
        },
        sealed: reader.sealed_digest().is_some(),
        notes,
        marks: marks_of(&marks, &events),
        events,
        figures: figures.collect(),
        participants: times::participants(&summary),
        plan,
        scene,
        summary,
        about: read_json(&folder.run())?,
    };
    Ok((reader, bound, run))
}

/// Named instants and events, sorted by time.
pub(super) fn marks_of(named: &[(String, lockstep::time::Rational)], events: &[Event]) -> Vec<Mark> {
    let instants = named.iter().map(|(name, at)| Mark {
        t: at.seconds(),
        kind: "instant",
        text: name.clone(),
    });
    let happened = events.iter().map(|event| Mark {
        t: event.time.seconds(),
        kind: match event.kind {
            tape::EventKind::Fault => "fault",
            tape::EventKind::Substitution => "substitution",
            tape::EventKind::Failure => "failure",
            tape::EventKind::Restart => "restart",
            tape::EventKind::Checkpoint => "checkpoint",
            tape::EventKind::Resume => "resume",
            tape::EventKind::Input => "input",
            tape::EventKind::Note => "note",
        },
        text: match &event.participant {
            Some(participant) => format!("{participant}: {}", event.text),
            None => event.text.clone(),
        },
    });
    let mut all: Vec<Mark> = instants.chain(happened).collect();
    all.sort_by(|a, b| a.t.total_cmp(&b.t));
    all
}

/// The name of a run: that of its folder.
pub(super) fn name_of(root: &Path) -> String {
    let name = fs::canonicalize(root).ok();
    let name = name.as_deref().unwrap_or(root).file_name();
    name.map_or("run".into(), |name| name.to_string_lossy().into_owned())
}
