//! Report of a run in progress.
//!
//! Work and memory are bounded whatever the length of the run: of each stream every n-th sample is shown, and the newest
//! one, with n such that a run of the planned length has at most 1500 of them. A page therefore requests only the points
//! that it does not have yet, and the server keeps no state for it. The complete curves with all peaks are on the page of
//! the finished run.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::error::ReportError;
use super::files::{PlanFile, read_json};
use super::motion::MAX_FRAMES;
use super::report::Report;
use super::run::{FigureData, Request, Run, marks_of, name_of};
use super::series::{CurveEvaluator, Series, encode_index};
use super::views::{BoundViews, bind_views};
use super::{base64, document};
use crate::view::{Binding, Views};
use tape::folder::RunFolder;
use tape::{Reader, Source, split_record};

/// Maximum number of points of a curve.
const POINTS: u64 = 1500;

/// A run folder that a run is writing.
pub struct Live {
    folder: PathBuf,
    reader: Reader,
    plan: PlanFile,
    views: BoundViews,
    /// Every n-th sample of each stream is shown.
    strides: Vec<u64>,
    frames: u64,
}

/// The update of a stream for a page: how many of its points the page keeps, and the records that follow them.
struct StreamUpdate {
    keep: u64,
    picks: Vec<u64>,
}

/// The page has `have` points of the grid; the newest record follows them, whether it is on the grid or not.
fn stream_update(count: u64, stride: u64, have: u64) -> StreamUpdate {
    let keep = have.min(count.div_ceil(stride));
    let mut picks: Vec<u64> = (keep * stride..count).step_by(stride as usize).collect();
    if let Some(newest) = count.checked_sub(1).filter(|newest| !newest.is_multiple_of(stride)) {
        picks.push(newest);
    }
    StreamUpdate { keep, picks }
}

impl Live {
    /// Opens the folder of a run with the planned duration `duration_s`. Its tape must exist.
    ///
    /// # Errors
    /// A tape that cannot be read.
    pub fn open(folder: &Path, duration_s: f64, views: &[Views]) -> Result<Live, ReportError> {
        let reader = Reader::open(folder)?;
        let plan = PlanFile::read(&RunFolder::open(folder))?;
        let stride = |stream: usize, points: u64| {
            let spec = &reader.streams()[stream];
            let samples = (duration_s - spec.offset.seconds()) / spec.period.seconds();
            ((samples.max(0.0) as u64) + 2).div_ceil(points)
        };
        let strides = (0..reader.streams().len())
            .map(|stream| stride(stream, POINTS))
            .collect();
        let views = bind_views(reader.streams(), &plan.table, views, &[])?;
        let scene = views.scene.as_ref();
        let frames = scene.map_or(1, |scene| stride(scene.lead, MAX_FRAMES));
        Ok(Live {
            folder: folder.to_owned(),
            views,
            plan,
            strides,
            frames,
            reader,
        })
    }

    /// Whether the streams of the playback have their first samples.
    pub fn is_ready(&mut self) -> Result<bool, ReportError> {
        self.reader.refresh()?;
        let lead = self.views.scene.as_ref().map(|scene| scene.lead);
        Ok(lead.is_none_or(|lead| self.reader.count(lead) > 0))
    }

    /// The page with the present data. `about` describes the run to the page.
    pub fn page(&mut self, about: &Value) -> Result<String, ReportError> {
        self.reader.refresh()?;
        let scene = match &self.views.scene {
            Some(scene) => {
                let picks = stream_update(self.reader.count(scene.lead), self.frames, 0).picks;
                let motion = scene.channels.at(&self.reader, scene.lead, &picks)?;
                Some((scene.clone(), motion))
            }
            None => None,
        };
        let run = Run {
            name: name_of(&self.folder),
            digest: String::new(),
            sealed: false,
            notes: self.views.notes.clone(),
            marks: marks_of(&self.views.marks, &[]),
            events: Vec::new(),
            figures: self.figures()?,
            participants: Vec::new(),
            plan: self.plan.clone(),
            scene,
            summary: Value::Null,
            about: read_json(&RunFolder::open(&self.folder).run())?,
        };
        let title = run.name.clone();
        let mut data = document::data(&title, &[run], &[]);
        data["differences"] = json!([]);
        data["live"] = about.clone();
        Ok(document::render(&title, &data, true))
    }

    /// The figures with all of their points.
    fn figures(&self) -> Result<Vec<FigureData>, ReportError> {
        let drawn = self.views.bound.figures.iter().map(|drawn| FigureData {
            drawn: drawn.clone(),
            series: Vec::new(),
            differences: Vec::new(),
        });
        let mut figures: Vec<FigureData> = drawn.collect();
        for binding in &self.views.bound.bindings {
            let lead = binding.streams[0];
            let spec = &self.reader.streams()[lead];
            let samples = self.reader.count(lead);
            let picks = stream_update(samples, self.strides[lead], 0).picks;
            let (x, curves) = self.curves(binding, &picks)?;
            let index: Vec<u32> = picks.iter().map(|pick| encode_index(*pick)).collect();
            for (curve, y) in binding.curves.iter().zip(curves) {
                figures[binding.figure].series.push(Series {
                    label: curve.label.clone(),
                    origin: binding.origin.clone(),
                    step: curve.step,
                    offset_s: spec.offset.seconds(),
                    period_s: spec.period.seconds(),
                    index: Some(index.clone()),
                    first_index: spec.first_index,
                    y,
                    x: binding.against.is_some().then(|| x.clone()),
                    samples,
                });
            }
        }
        Ok(figures)
    }

    /// The values of all curves of a binding at these records, and the values of their horizontal axis.
    fn curves(&self, binding: &Binding, picks: &[u64]) -> Result<(Vec<f64>, Vec<Vec<f64>>), ReportError> {
        let lead = binding.streams[0];
        let spec = &self.reader.streams()[lead];
        let mut curves = vec![Vec::with_capacity(picks.len()); binding.curves.len()];
        let (mut along, mut out) = (Vec::with_capacity(picks.len()), vec![0.0; curves.len()]);
        let mut record = vec![0; spec.stride()];
        let mut evaluated = CurveEvaluator::new(binding, &self.reader);
        for &pick in picks {
            self.reader.read(lead, pick, &mut record)?;
            let payload = split_record(&record, 0).payload;
            along.push(evaluated.values(spec.first_index + pick, Some(payload), &mut out)?);
            for (curve, y) in curves.iter_mut().zip(&out) {
                curve.push(*y);
            }
        }
        Ok((along, curves))
    }

    /// The update for a page that has `have[s]` points of each stream; the last number of `have` is its number of frames.
    pub fn update(&mut self, have: &[u64]) -> Result<Value, ReportError> {
        self.reader.refresh()?;
        let had = |at: usize| have.get(at).copied().unwrap_or(0);
        let streams = 0..self.reader.streams().len();
        let updates: Vec<StreamUpdate> = streams
            .clone()
            .map(|stream| stream_update(self.reader.count(stream), self.strides[stream], had(stream)))
            .collect();
        let mut figures: Map<String, Value> = Map::new();
        for binding in &self.views.bound.bindings {
            let lead = binding.streams[0];
            let StreamUpdate { keep, picks } = &updates[lead];
            let numbers = |values: &[f64]| base64(values.iter().flat_map(|y| y.to_le_bytes()));
            let index = base64(picks.iter().flat_map(|&pick| encode_index(pick).to_le_bytes()));
            let samples = self.reader.count(lead);
            let (along, curves) = self.curves(binding, picks)?;
            let x = binding.against.is_some().then(|| numbers(&along));
            for y in curves {
                let id = &self.views.bound.figures[binding.figure].id;
                let list = figures.entry(id.clone()).or_insert_with(|| json!([]));
                if let Value::Array(list) = list {
                    list.push(json!({ "keep": keep, "index": index, "x": x, "y": numbers(&y), "samples": samples }));
                }
            }
        }
        let grid = |count: u64, stride: u64| count.div_ceil(stride);
        let mut have: Vec<u64> = streams
            .map(|stream| grid(self.reader.count(stream), self.strides[stream]))
            .collect();
        let mut motion = Value::Null;
        if let Some(scene) = &self.views.scene {
            let count = self.reader.count(scene.lead);
            let StreamUpdate { keep, picks } = stream_update(count, self.frames, had(have.len()));
            motion = document::motion(&scene.channels.at(&self.reader, scene.lead, &picks)?);
            motion["keep"] = json!(keep);
            have.push(grid(count, self.frames));
        }
        Ok(json!({ "have": have, "figures": figures, "motion": motion }))
    }

    /// The data of the page of the finished run.
    ///
    /// # Errors
    /// A tape or a file of the folder that cannot be read.
    pub fn result(folder: &Path, views: &[Views]) -> Result<Value, ReportError> {
        let folders = [folder.to_owned()];
        let request = Request {
            folders: &folders,
            views,
            ..Request::default()
        };
        Ok(Report::read(&request)?.data())
    }
}

#[cfg(test)]
mod tests {
    use super::stream_update;
    use proptest::prelude::*;

    proptest! {
        /// Whatever points a page had, after the update it has every n-th sample and the newest one, each once and in
        /// order.
        #[test]
        fn live_page_update_gives_grid_and_newest_sample(
            stride in 1_u64..20,
            counts in prop::collection::vec(0_u64..400, 1..8),
        ) {
            let mut sorted = counts;
            sorted.sort_unstable();
            let (mut page, mut have): (Vec<u64>, u64) = (Vec::new(), 0);
            for count in sorted {
                let update = stream_update(count, stride, have);
                page.truncate(update.keep as usize);
                page.extend(&update.picks);
                have = count.div_ceil(stride);
                let mut expected: Vec<u64> = (0..count).step_by(stride as usize).collect();
                if count > 0 && expected.last() != Some(&(count - 1)) {
                    expected.push(count - 1);
                }
                prop_assert_eq!(&page, &expected);
            }
            prop_assert!(stream_update(3, stride, u64::MAX).picks.len() <= 1, "a page that claims too much");
        }
    }
}
