//! The report of runs: read, drawn, written.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tape::Source;

use super::error::ReportError;
use super::plans::{self, Difference};
use super::run::{Request, Run, add_differences, merge_figures, read_run};
use super::series::Series;
use super::{document, summary};
use crate::figures::{self, Panel};
use crate::view::BoundFigure;

/// Pixels per point of the figures' PNG files: sharp on a slide.
const PIXELS_PER_POINT: f32 = 2.5;

/// The report of one run or several.
pub struct Report {
    pub(super) runs: Vec<Run>,
    /// The keys in which the scenarios differ.
    differences: Vec<Difference>,
    /// The keys of the summary that are shown first.
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
                add_differences((reference, its), (&reader, &bound), &mut run)?;
            }
            let plan = &run.plan.table;
            headline.extend(
                request
                    .views
                    .iter()
                    .flat_map(|view| view(reader.streams(), plan).headline),
            );
            plans.push(plan.clone());
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

    /// Writes figures of the page as `<id>.svg` and `<id>.png` into the folder `dir`, which is created if missing: the
    /// chosen figures, or where none were chosen, those of all fields. Returns the files.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_figures(&self, dir: &Path) -> Result<Vec<PathBuf>, ReportError> {
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
        let mut files = Vec::new();
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
            tape::write_atomic(&path, figures::svg(&drawing)).map_err(failed(&path))?;
            files.push(path);
            if let Some(png) = figures::png(&drawing, PIXELS_PER_POINT) {
                let path = dir.join(format!("{id}.png"));
                tape::write_atomic(&path, png).map_err(failed(&path))?;
                files.push(path);
            }
        }
        Ok(files)
    }

    /// The figures of all runs, those of the first run first, with the limits of all.
    fn figures(&self) -> Vec<BoundFigure> {
        merge_figures(&self.runs)
    }

    /// One panel for all runs, or one for each where several curves of several runs would overlap.
    fn draw(&self, figure: &BoundFigure) -> figures::Drawing {
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

    /// The data of the page, for a page that is already open.
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
