//! The report: one self-contained HTML page about one run or several, and its figures as files.
//!
//! The page needs no network, no server and no other file. What it draws is listed in the table of figures
//! (`table.rs`) by names of ports and fields. Its size is bounded whatever the length of the run: a curve of more than
//! 8192 samples is thinned to the least and greatest sample of each of 2048 buckets, and the playback to 3000 instants.

mod motion;
mod page;
mod series;
mod summary;
mod table;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

pub(crate) use page::{base64, escape};
pub(crate) use series::Series;

use crate::figures::{self, Panel};
use crate::folder::RunFolder;
use crate::geometry::{Geometry, GeometryError};
use crate::tape::{Event, ReadError, Reader, Source};
use motion::Motion;
use series::FigureData;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A tape cannot be read.
    #[error(transparent)]
    Tape(#[from] ReadError),
    /// A file of the run folder cannot be read.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A model cannot be drawn.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// What is drawn into the figures as limits: absolute values in the fields' unit, one per channel or one for all.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Limits(BTreeMap<String, Vec<f64>>);

/// Pixels per point of the figures' PNG files: sharp on a slide.
const PIXELS_PER_POINT: f32 = 2.5;

/// Everything the page says of one run.
pub(crate) struct Run {
    name: String,
    digest: String,
    sealed: bool,
    notes: Vec<String>,
    plan: String,
    events: Vec<Event>,
    figures: Vec<FigureData>,
    limits: Limits,
    motion: Option<Motion>,
    geometry: Geometry,
    summary: Value,
    participants: Vec<ParticipantTime>,
}

/// How a participant spent its wall time; from `participants` of `run.json` or `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ParticipantTime {
    name: String,
    computing_s: f64,
    /// Seconds waited by what was waited for.
    waiting_s: BTreeMap<String, f64>,
}

/// The report of one run or several.
pub struct Report {
    runs: Vec<Run>,
}

impl Report {
    /// Reads the runs in these folders (run folders, or bare tapes). `models` are URDF files for the playback: one with
    /// moving joints is the servicer, one without is the target; where it is empty, `*.urdf` in the run folder and files
    /// that its `plan.toml` names are taken.
    pub fn read(folders: &[PathBuf], models: &[PathBuf]) -> Result<Report, ReportError> {
        let mut runs = Vec::with_capacity(folders.len());
        for folder in folders {
            runs.push(read_run(folder, models)?);
        }
        // Two runs of one name would be indistinguishable in a legend.
        for at in 1..runs.len() {
            let name = runs[at].name.clone();
            let earlier = runs[..at].iter().filter(|run| run.name == name).count();
            if earlier > 0 {
                runs[at].name = format!("{name} ({})", earlier + 1);
            }
        }
        Ok(Report { runs })
    }

    /// Writes every figure of the page as `<id>.svg` and `<id>.png` into the folder `dir`, which is made where it is
    /// missing. Gives how many figures there are.
    pub fn write_figures(&self, dir: &Path) -> Result<usize, ReportError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error: std::io::Error| ReportError::File {
                path,
                reason: error.to_string(),
            }
        };
        fs::create_dir_all(dir).map_err(failed(dir))?;
        let mut count = 0;
        for spec in table::FIGURES {
            let Some(drawing) = self.draw(spec) else { continue };
            let path = dir.join(format!("{}.svg", spec.id));
            fs::write(&path, figures::svg(&drawing)).map_err(failed(&path))?;
            if let Some(png) = figures::png(&drawing, PIXELS_PER_POINT) {
                let path = dir.join(format!("{}.png", spec.id));
                fs::write(&path, png).map_err(failed(&path))?;
            }
            count += 1;
        }
        Ok(count)
    }

    /// One panel for all runs, or one for each where several curves of several runs would be a thicket.
    fn draw(&self, spec: &table::FigureSpec) -> Option<figures::Drawing> {
        let series = |run: &'_ Run| run.figures.iter().position(|figure| figure.id == spec.id);
        let lists: Vec<(&Run, &[Series])> = self
            .runs
            .iter()
            .filter_map(|run| Some((run, &*run.figures[series(run)?].series)))
            .collect();
        let several = lists.len() > 1;
        let apart = several && lists.iter().any(|(_, list)| list.len() > 1);
        let panels: Vec<Panel<'_>> = if apart {
            lists
                .iter()
                .map(|(run, list)| Panel {
                    name: run.name.clone(),
                    series: list
                        .iter()
                        .enumerate()
                        .map(|(i, s)| (s, s.label.clone(), i, false))
                        .collect(),
                })
                .collect()
        } else {
            let all = lists.iter().enumerate().flat_map(|(at, (run, list))| {
                list.iter().enumerate().map(move |(i, s)| {
                    let label = if several { run.name.clone() } else { s.label.clone() };
                    (s, label, at + i, at > 0)
                })
            });
            vec![Panel {
                name: String::new(),
                series: all.collect(),
            }]
        };
        let limits = spec
            .limits
            .and_then(|key| self.runs.iter().find_map(|run| run.limits.0.get(key)));
        let scaled: Vec<f64> = limits.into_iter().flatten().map(|limit| limit * spec.scale).collect();
        (!lists.is_empty()).then(|| figures::layout(spec.title, spec.unit, &panels, &scaled))
    }

    /// The page.
    pub fn html(&self) -> String {
        let names: Vec<&str> = self.runs.iter().map(|run| &*run.name).collect();
        let summaries: Vec<Value> = self.runs.iter().map(|run| run.summary.clone()).collect();
        page::render(&names.join(" · "), &self.runs, &summary::rows(&summaries))
    }
}

fn read_run(root: &Path, models: &[PathBuf]) -> Result<Run, ReportError> {
    let reader = Reader::open(root)?;
    let folder = RunFolder::open(root);
    let plan = fs::read_to_string(folder.plan()).unwrap_or_default();
    let summary = read_json(&folder.summary())?;
    let about = read_json(&folder.run())?;
    let mut notes: Vec<String> = Vec::new();
    for torn in reader.torn() {
        notes.push(format!(
            "Stream {} ends in an incomplete record after {} complete ones.",
            torn.stream, torn.complete
        ));
    }
    let name = fs::canonicalize(root).ok();
    let name = name.as_deref().unwrap_or(root).file_name();
    Ok(Run {
        name: name.map_or("run".into(), |name| name.to_string_lossy().into_owned()),
        digest: match reader.sealed_digest() {
            Some(digest) => digest.to_string(),
            None => reader.digest()?.to_string(),
        },
        sealed: reader.sealed_digest().is_some(),
        notes,
        events: reader.events()?,
        figures: series::extract(&reader)?,
        limits: limits_of(&summary),
        participants: participants_of(&about, &summary),
        plan,
        motion: motion::extract(&reader)?,
        geometry: Geometry::read(&reader, root, models)?,
        summary,
    })
}

/// A JSON file that may be missing: a run that was killed has no summary.
fn read_json(path: &Path) -> Result<Value, ReportError> {
    let file = |reason: String| ReportError::File {
        path: path.to_owned(),
        reason,
    };
    match fs::read(path) {
        Ok(text) => serde_json::from_slice(&text).map_err(|error| file(format!("is not JSON: {error}"))),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Value::Null),
        Err(error) => Err(file(error.to_string())),
    }
}

/// `limits` of a summary: numbers or lists of numbers by name.
fn limits_of(summary: &Value) -> Limits {
    let entries = summary.get("limits").and_then(Value::as_object).into_iter().flatten();
    Limits(
        entries
            .map(|(key, value)| {
                let values = match value {
                    Value::Array(items) => items.iter().filter_map(Value::as_f64).collect(),
                    value => value.as_f64().into_iter().collect(),
                };
                (key.clone(), values)
            })
            .collect(),
    )
}

fn participants_of(about: &Value, summary: &Value) -> Vec<ParticipantTime> {
    let of = |value: &Value| value.get("participants").and_then(Value::as_object).cloned();
    let Some(entries) = of(about).or_else(|| of(summary)) else {
        return Vec::new();
    };
    let times = entries.into_iter().filter_map(|(name, entry)| {
        let waiting = entry.get("waiting_s").and_then(Value::as_object).into_iter().flatten();
        Some(ParticipantTime {
            name,
            computing_s: entry.get("computing_s")?.as_f64()?,
            waiting_s: waiting.filter_map(|(on, s)| Some((on.clone(), s.as_f64()?))).collect(),
        })
    });
    times.collect()
}
