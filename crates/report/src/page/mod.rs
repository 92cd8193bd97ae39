//! The report: one self-contained HTML page about one run or several, and its figures as files.
//!
//! The page needs no network, no server and no other file. It draws every field of every stream, and before them the figures
//! that the scenario's table `[report]` and the program's own views ask for ([`crate::view`]). Its size is bounded whatever
//! the length of the run: a curve of more than 8192 samples is thinned to the least and greatest sample of each of 2048
//! buckets, the fields of a tape with hundreds of them to fewer, and the playback to 3000 instants.

mod budget;
mod document;
mod held;
mod live;
mod motion;
mod plans;
mod playback;
mod series;
mod summary;
mod times;

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

pub(crate) use document::{STYLE, TICKS, TOOLS, base64, filled};
pub use live::Live;
pub(crate) use series::Series;
pub use summary::split_unit;

use crate::figures::{self, Panel};
use crate::geometry::{Geometry, GeometryError};
use crate::view::{Bound, Drawn, View, Views, bind, every_field, limits_of};
use budget::Budget;
use motion::Motion;
use plans::Difference;
use tape::folder::RunFolder;
use tape::{Event, ReadError, Reader, Source, StreamSpec};
use times::ParticipantTime;

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
    marks: Vec<Mark>,
    figures: Vec<FigureData>,
    motion: Option<Motion>,
    geometry: Geometry,
    summary: Value,
    /// What is known of how it came about: the contents of `run.json`.
    about: Value,
    participants: Vec<ParticipantTime>,
}

/// A figure with the curves of one run.
pub(crate) struct FigureData {
    drawn: Drawn,
    series: Vec<Series>,
    /// Less those of the first run, at its instants.
    differences: Vec<Series>,
}

/// An instant that every figure marks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Mark {
    t: f64,
    kind: &'static str,
    text: String,
}

/// What a report is made of.
#[derive(Default)]
pub struct Request<'a> {
    /// Run folders, or bare tapes.
    pub folders: &'a [PathBuf],
    /// Names for the runs, in their order; those without are named by what differs, or by their folders.
    pub labels: &'a [String],
    /// URDF files for the playback: one with moving joints is the servicer, one without is the target; where there are none,
    /// `*.urdf` in the run folder and files that its `plan.toml` names are taken.
    pub models: &'a [PathBuf],
    /// The views of the program's own applications.
    pub views: &'a [Views],
}

/// The report of one run or several.
pub struct Report {
    runs: Vec<Run>,
    /// In what the scenarios differ.
    differences: Vec<Difference>,
    /// The keys of the summary that are looked at first.
    first: Vec<String>,
}

impl Report {
    /// Reads the runs.
    ///
    /// # Errors
    /// A tape, a file of a run folder or a model that cannot be read.
    pub fn read(request: &Request<'_>) -> Result<Report, ReportError> {
        let mut runs: Vec<Run> = Vec::with_capacity(request.folders.len());
        let mut plans = Vec::new();
        let (mut first, mut headline) = (None, Vec::new());
        for folder in request.folders {
            let (reader, bound, mut run) = read_run(folder, request)?;
            if let Some((reference, its)) = &first {
                subtract((reference, its), (&reader, &bound), &mut run)?;
            }
            let plan = table_of(&run.plan);
            headline.extend(
                request
                    .views
                    .iter()
                    .flat_map(|view| view(reader.streams(), &plan).headline),
            );
            plans.push(plan);
            runs.push(run);
            first.get_or_insert((reader, bound));
        }
        let differences = plans::differences(&plans);
        for (run, name) in runs.iter_mut().zip(plans::names(&differences).into_iter().flatten()) {
            run.name = name;
        }
        for (run, label) in runs.iter_mut().zip(request.labels) {
            run.name.clone_from(label);
        }
        // Two runs of one name would be indistinguishable in a legend.
        for at in 1..runs.len() {
            let name = runs[at].name.clone();
            let earlier = runs[..at].iter().filter(|run| run.name == name).count();
            if earlier > 0 {
                runs[at].name = format!("{name} ({})", earlier + 1);
            }
        }
        Ok(Report {
            runs,
            differences,
            first: headline,
        })
    }

    /// Writes figures of the page as `<id>.svg` and `<id>.png` into the folder `dir`, which is made where it is missing: those
    /// that somebody chose, or where nobody did, those of all fields. Gives how many there are.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_figures(&self, dir: &Path) -> Result<usize, ReportError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error: std::io::Error| ReportError::File {
                path,
                reason: error.to_string(),
            }
        };
        fs::create_dir_all(dir).map_err(failed(dir))?;
        let all = self.figures();
        let chosen = all.iter().any(|figure| !figure.signal);
        let mut count = 0;
        for figure in all.iter().filter(|figure| !(chosen && figure.signal)) {
            let drawing = self.draw(figure);
            let plain = |c: char| {
                if c.is_ascii_alphanumeric() || "-_.".contains(c) {
                    c
                } else {
                    '_'
                }
            };
            let id: String = figure.id.chars().map(plain).collect();
            let path = dir.join(format!("{id}.svg"));
            fs::write(&path, figures::svg(&drawing)).map_err(failed(&path))?;
            if let Some(png) = figures::png(&drawing, PIXELS_PER_POINT) {
                let path = dir.join(format!("{id}.png"));
                fs::write(&path, png).map_err(failed(&path))?;
            }
            count += 1;
        }
        Ok(count)
    }

    /// The figures that any run has, those of the first run first, with the limits of all.
    fn figures(&self) -> Vec<Drawn> {
        merged(&self.runs)
    }

    /// One panel for all runs, or one for each where several curves of several runs would be a thicket.
    fn draw(&self, figure: &Drawn) -> figures::Drawing {
        let mine = |run: &'_ Run| run.figures.iter().position(|one| one.drawn.id == figure.id);
        let lists: Vec<(&Run, &[Series])> = self
            .runs
            .iter()
            .filter_map(|run| Some((run, &*run.figures[mine(run)?].series)))
            .collect();
        let several = self.runs.len() > 1;
        let apart = lists.len() > 1 && lists.iter().any(|(_, list)| list.len() > 1);
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
        figures::layout(figure, &panels)
    }

    fn title(&self) -> String {
        let names: Vec<&str> = self.runs.iter().map(|run| &*run.name).collect();
        names.join(" · ")
    }

    /// What the page shows, for a page that is open already.
    pub fn data(&self) -> Value {
        let summaries: Vec<Value> = self.runs.iter().map(|run| run.summary.clone()).collect();
        let mut data = document::data(&self.title(), &self.runs, &summary::rows(&summaries, &self.first));
        data["differences"] = serde_json::json!(self.differences);
        data
    }

    /// The page.
    pub fn html(&self) -> String {
        document::render(&self.title(), &self.data(), false)
    }
}

/// The figures that any of the runs has.
fn merged(runs: &[Run]) -> Vec<Drawn> {
    let mut all: Vec<Drawn> = Vec::new();
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
    // What somebody chose stands before everything else, whichever run has it.
    all.sort_by_key(|figure| figure.signal);
    all
}

/// Everything that a run's figures are made of: the panels of its scenario, the views of the program, every field.
fn bound_of(
    streams: &[StreamSpec],
    plan: &toml::Table,
    views: &[Views],
) -> (Bound, Vec<(String, lockstep::time::Rational)>) {
    let own = plan.get("report").and_then(toml::Value::as_table);
    // The plan of a run was understood when the run began; one of a later version is drawn without its panels.
    let own = own.and_then(|table| View::read(table).ok()).unwrap_or_default();
    let limits = limits_of(plan);
    let (mut bound, mut marks) = (Bound::default(), own.marks.clone());
    bind(&own.figures, streams, &limits, false, &mut bound);
    for view in views {
        let view = view(streams, plan);
        bind(&view.figures, streams, &limits, false, &mut bound);
        marks.extend(view.marks);
    }
    bind(&every_field(streams), streams, &limits, true, &mut bound);
    (bound, marks)
}

/// How many points the curves of each figure may have.
fn budgets(bound: &Bound, chosen: Budget) -> impl Fn(usize) -> Budget {
    let signal: Vec<bool> = bound.figures.iter().map(|figure| figure.signal).collect();
    let curves = bound.bindings.iter().filter(|binding| signal[binding.figure]);
    let count = curves.map(|binding| binding.places.len()).sum();
    let others = Budget::among(count, signal.contains(&false));
    move |figure| if signal[figure] { others } else { chosen }
}

/// Gives the figures of `run` their differences to the reference.
fn subtract(
    (reference, its): (&Reader, &Bound),
    (reader, bound): (&Reader, &Bound),
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

fn read_run(root: &Path, request: &Request<'_>) -> Result<(Reader, Bound, Run), ReportError> {
    let reader = Reader::open(root)?;
    let folder = RunFolder::open(root);
    let plan = fs::read_to_string(folder.plan()).unwrap_or_default();
    let summary = read_json(&folder.summary())?;
    let geometry = Geometry::read(&reader, root, request.models)?;
    let mut notes = geometry.notes.clone();
    for torn in reader.torn() {
        notes.push(format!(
            "Stream {} ends in an incomplete record after {} complete ones.",
            torn.stream, torn.complete
        ));
    }
    let (bound, marks) = bound_of(reader.streams(), &table_of(&plan), request.views);
    let curves = series::extract(&reader, &bound, budgets(&bound, Budget::FULL))?;
    let figures = bound.figures.iter().zip(curves).map(|(drawn, series)| FigureData {
        drawn: drawn.clone(),
        series,
        differences: Vec::new(),
    });
    let events = reader.events()?;
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
        motion: motion::extract(&reader)?,
        geometry,
        summary,
        about: read_json(&folder.run())?,
    };
    Ok((reader, bound, run))
}

/// Named instants and events, in the order of time.
fn marks_of(named: &[(String, lockstep::time::Rational)], events: &[Event]) -> Vec<Mark> {
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
fn name_of(root: &Path) -> String {
    let name = fs::canonicalize(root).ok();
    let name = name.as_deref().unwrap_or(root).file_name();
    name.map_or("run".into(), |name| name.to_string_lossy().into_owned())
}

/// The plan, empty where there is none that can be read.
fn table_of(plan: &str) -> toml::Table {
    plan.parse().unwrap_or_default()
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
