//! The report: one self-contained HTML page about one run or several, and its figures as files.
//!
//! The page needs no network, no server and no other file. What it draws is listed in the table of figures
//! (`table.rs`) by names of ports and fields. Its size is bounded whatever the length of the run: a curve of more than
//! 8192 samples is thinned to the least and greatest sample of each of 2048 buckets, and the playback to 3000 instants.

mod document;
mod formula;
mod live;
mod momenta;
mod motion;
mod series;
mod summary;
mod table;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

pub(crate) use document::{base64, escape};
pub use live::Live;
pub(crate) use series::Series;
pub use summary::split_unit;

use crate::figures::{self, Panel};
use crate::geometry::{Geometry, GeometryError};
use motion::Motion;
use series::FigureData;
use tape::folder::RunFolder;
use tape::{Event, ReadError, Reader, Source};

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
    /// What is known of how it came about: the contents of `run.json`.
    about: Value,
    participants: Vec<ParticipantTime>,
}

/// How a participant spent its wall time.
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

    fn title(&self) -> String {
        let names: Vec<&str> = self.runs.iter().map(|run| &*run.name).collect();
        names.join(" · ")
    }

    /// What the page shows, for a page that is open already.
    pub fn data(&self) -> Value {
        let summaries: Vec<Value> = self.runs.iter().map(|run| run.summary.clone()).collect();
        document::data(&self.title(), &self.runs, &summary::rows(&summaries))
    }

    /// The page.
    pub fn html(&self) -> String {
        document::render(&self.title(), &self.data(), false)
    }
}

fn read_run(root: &Path, models: &[PathBuf]) -> Result<Run, ReportError> {
    let reader = Reader::open(root)?;
    let folder = RunFolder::open(root);
    let plan = fs::read_to_string(folder.plan()).unwrap_or_default();
    let table = table_of(&plan);
    let summary = read_json(&folder.summary())?;
    let geometry = Geometry::read(&reader, root, models)?;
    let mut notes = geometry.notes.clone();
    for torn in reader.torn() {
        notes.push(format!(
            "Stream {} ends in an incomplete record after {} complete ones.",
            torn.stream, torn.complete
        ));
    }
    Ok(Run {
        name: name_of(root),
        digest: match reader.sealed_digest() {
            Some(digest) => digest.to_string(),
            None => reader.digest()?.to_string(),
        },
        sealed: reader.sealed_digest().is_some(),
        notes,
        events: reader.events()?,
        figures: series::extract(&reader, &table)?,
        limits: limits_of(&table),
        participants: participants_of(&summary),
        plan,
        motion: motion::extract(&reader)?,
        geometry,
        summary,
        about: read_json(&folder.run())?,
    })
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

/// The limits of the actuators, from the tables `actuators` of the participants in the plan, else from
/// `assessment.limits`. The plan is the scenario as the user wrote it with its defaults, so quantities are texts with
/// units; a plan of another program has other tables, and no limits are drawn then.
fn limits_of(plan: &toml::Table) -> Limits {
    let mut limits = BTreeMap::new();
    let lookup = |table: &toml::Table, path: &[&str]| {
        let (last, folders) = path.split_last()?;
        let inner = folders
            .iter()
            .try_fold(table, |table, key| table.get(*key)?.as_table())?;
        let numbers = base_units(inner.get(*last)?);
        (!numbers.is_empty()).then_some(numbers)
    };
    let participants = plan
        .get("participants")
        .and_then(toml::Value::as_table)
        .into_iter()
        .flatten();
    let actuators = participants.filter_map(|(_, entry)| {
        let parameters = entry.as_table()?.get("parameters")?.as_table()?;
        parameters.get("actuators")?.as_table()
    });
    for table in actuators {
        for (key, path) in [
            ("base_torque", ["wheels", "torque"]),
            ("wheel_momentum", ["wheels", "momentum"]),
            ("base_force", ["thrusters", "force"]),
            ("joint_torque", ["joints", "torque"]),
        ] {
            if let Some(numbers) = lookup(table, &path) {
                limits.insert(key.to_owned(), numbers);
            }
        }
    }
    for (key, name) in [
        ("base_torque", "torque"),
        ("base_force", "force"),
        ("joint_torque", "joint_torque"),
    ] {
        if let (false, Some(numbers)) = (limits.contains_key(key), lookup(plan, &["assessment", "limits", name])) {
            limits.insert(key.to_owned(), numbers);
        }
    }
    Limits(limits)
}

/// The numbers of `"0.2 N m"`, `"[320, 40] N m"`, `9.0`; nothing for a unit with a prefix, rather than a wrong line.
fn base_units(value: &toml::Value) -> Vec<f64> {
    let text = match value {
        toml::Value::Float(x) => return vec![*x],
        toml::Value::Integer(x) => return vec![*x as f64],
        toml::Value::Array(items) => return items.iter().flat_map(base_units).collect(),
        toml::Value::String(text) => text.replace(['[', ']', ','], " "),
        _ => return Vec::new(),
    };
    let words = text.split_whitespace();
    let (numbers, unit): (Vec<&str>, Vec<&str>) = words.partition(|word| word.parse::<f64>().is_ok());
    if ["N m", "N", "N m s"].contains(&&*unit.join(" ")) {
        numbers.iter().filter_map(|number| number.parse().ok()).collect()
    } else {
        Vec::new()
    }
}

/// `timing` of a summary: per participant `total_ns`, and of it `inputs_ns` (one number per input, or by name), `room_ns`,
/// `recorder_ns` and `horizon_ns` waiting. What is left was computing.
fn participants_of(summary: &Value) -> Vec<ParticipantTime> {
    let seconds = |value: &Value| value.as_f64().map(|ns| ns * 1e-9);
    let entries = summary.get("timing").and_then(Value::as_object).into_iter().flatten();
    let times = entries.filter_map(|(name, entry)| {
        let mut waiting_s = BTreeMap::new();
        match &entry["inputs_ns"] {
            Value::Array(inputs) => {
                let numbered = inputs.iter().enumerate();
                waiting_s.extend(numbered.filter_map(|(i, s)| Some((format!("input {}", i + 1), seconds(s)?))));
            }
            Value::Object(inputs) => {
                waiting_s.extend(inputs.iter().filter_map(|(on, s)| Some((on.clone(), seconds(s)?))))
            }
            _ => {}
        }
        for (key, on) in [
            ("room_ns", "room at a reader"),
            ("recorder_ns", "the recorder"),
            ("horizon_ns", "the clock"),
        ] {
            waiting_s.extend(seconds(&entry[key]).map(|s| (on.to_owned(), s)));
        }
        let waited: f64 = waiting_s.values().sum();
        Some(ParticipantTime {
            name: name.clone(),
            computing_s: (seconds(&entry["total_ns"])? - waited).max(0.0),
            waiting_s,
        })
    });
    times.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_come_from_the_plan() {
        let plan = r#"
            [participants.plant.parameters.actuators]
            wheels = { torque = "0.2 N m", momentum = "12 N m s" }
            thrusters = { force = "9 kN" }
            joints = { torque = "[320, 40.5] N m" }
            [assessment.limits]
            force = "[9, 9, 8] N"
            torque = "1 N m"
        "#;
        let limits = limits_of(&table_of(plan)).0;
        assert_eq!(limits["base_torque"], [0.2]);
        assert_eq!(limits["wheel_momentum"], [12.0]);
        assert_eq!(limits["joint_torque"], [320.0, 40.5]);
        assert_eq!(limits["base_force"], [9.0, 9.0, 8.0]);
        assert!(limits_of(&table_of("not toml [")).0.is_empty());
    }

    #[test]
    fn what_is_not_waiting_is_computing() {
        let summary = serde_json::json!({ "timing": { "plant": {
            "total_ns": 5_000_000_000_u64, "inputs_ns": [1_000_000_000, 500_000_000], "room_ns": 250_000_000,
            "recorder_ns": 0, "horizon_ns": 0, "sleeps": 3,
        } } });
        let [plant] = &participants_of(&summary)[..] else {
            panic!("one participant")
        };
        assert_eq!(plant.computing_s, 3.25);
        assert_eq!(
            (plant.waiting_s["input 2"], plant.waiting_s["room at a reader"]),
            (0.5, 0.25)
        );
        assert!(participants_of(&Value::Null).is_empty());
    }
}
