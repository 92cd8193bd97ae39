//! MCAP with protobuf: one file for Foxglove, PlotJuggler and Rerun.

mod container;
mod lz4;
mod proto;
mod schema;
mod transforms;

use std::fs::File;
use std::io::BufWriter;

use super::file::{CountingWriter, Metadata, WriteError};
use crate::scene::{Scene, bind};
pub use container::Compression;
use container::Container;
use schema::Schema;
use tape::{Record, Records, Source};
use transforms::Poses;

/// Maximum rate of frame transforms, Hz: more than any display shows.
const TRANSFORM_RATE: f64 = 100.0;

/// One stream while it is written to the file.
struct Topic<'a> {
    records: Records<'a, dyn Source + 'a>,
    channel: u16,
    schema: Schema,
    poses: Option<Poses>,
    /// The next record, copied out of `records` because streams are merged by their stamps.
    stamp_s: f64,
    index: u64,
    payload: Vec<u8>,
    done: bool,
}

impl Topic<'_> {
    fn advance(&mut self) -> Result<(), WriteError> {
        match self.records.next()? {
            None => self.done = true,
            Some(Record {
                index,
                stamp_s,
                payload,
            }) => {
                (self.index, self.stamp_s) = (index, stamp_s);
                self.payload.clear();
                self.payload.extend_from_slice(payload);
            }
        }
        Ok(())
    }
}

pub(super) fn write(
    source: &dyn Source,
    scene: Option<&Scene>,
    about: &Metadata,
    compression: Compression,
    out: &mut BufWriter<File>,
) -> Result<(), WriteError> {
    let mut file = Container::begin(CountingWriter::new(out), compression)?;
    if !about.is_empty() {
        file.metadata("escapement", about)?;
    }
    let mut topics = Vec::new();
    let mut names = schema::Names::default();
    for (stream, spec) in source.streams().iter().enumerate() {
        let schema = names.schema(spec);
        let id = file.schema(&schema.name, &schema.file_descriptor_set)?;
        let topic = format!("/{}/{}", spec.participant, spec.port);
        let channel = file.channel(id, &topic, &schema::channel_metadata(spec))?;
        let mut topic = Topic {
            records: Records::new(source, stream),
            channel,
            schema,
            poses: None,
            stamp_s: 0.0,
            index: 0,
            payload: Vec::new(),
            done: false,
        };
        topic.advance()?;
        topics.push(topic);
    }
    let bound = scene.and_then(|scene| bind(scene, source.streams()).0);
    let (mut assigned, mut stage) = transforms::assign(source.streams(), bound.as_ref());
    let transforms = if assigned.iter().any(Option::is_some) {
        let id = file.schema("foxglove.FrameTransforms", &schema::frame_transforms())?;
        Some(file.channel(id, "/tf", &[])?)
    } else {
        None
    };
    for (topic, poses) in topics.iter_mut().zip(&mut assigned) {
        topic.poses = poses.take();
    }
    if let Some(stage) = &stage {
        let running = topics.iter().filter(|topic| !topic.done);
        let start = running.map(|topic| topic.stamp_s).fold(f64::INFINITY, f64::min);
        let start = if start.is_finite() { nanos(start) } else { 0 };
        let id = file.schema("foxglove.SceneUpdate", &schema::scene_update())?;
        let channel = file.channel(id, "/scene", &[])?;
        file.message(channel, 0, start, &stage.solids(start))?;
    }
    let mut message = Vec::new();
    // There are few streams: a linear search costs less than a queue.
    while let Some((stream, topic)) = topics
        .iter_mut()
        .enumerate()
        .filter(|(_, topic)| !topic.done)
        .min_by(|(_, a), (_, b)| a.stamp_s.total_cmp(&b.stamp_s))
    {
        let time = nanos(topic.stamp_s);
        message.clear();
        topic.schema.encode(&topic.payload, &mut message);
        file.message(topic.channel, topic.index as u32, time, &message)?;
        if let Some(stage) = &mut stage {
            stage.apply_record(stream, &topic.payload);
        }
        if let (Some(poses), Some(channel)) = (&mut topic.poses, transforms)
            && poses.is_due(topic.stamp_s, 1.0 / TRANSFORM_RATE)
        {
            message.clear();
            poses.encode(&topic.payload, time, stage.as_ref(), &mut message);
            // Rerun fails on a message without a transform.
            if !message.is_empty() {
                file.message(channel, topic.index as u32, time, &message)?;
            }
        }
        topic.advance()?;
    }
    file.end()?;
    Ok(())
}

/// Seconds since the start of the run as the format's unsigned nanoseconds.
fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
