//! The poses of a run for the 3-D playback: a few thousand instants, evenly spaced.

use super::series::find;
use super::table::PLAYBACK;
use crate::tape::{ReadError, Source, split_record};

/// At most this many instants; 60 s then have one every 20 ms, and the page draws the instants between.
const MAX_FRAMES: u64 = 3000;

/// Some vectors over time.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// Instants, s.
    pub(crate) t: Vec<f64>,
    pub(crate) channels: Vec<Channel>,
}

/// One vector at every instant of a [`Motion`].
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub(crate) name: &'static str,
    pub(crate) width: usize,
    /// `width` numbers per instant. Single precision is finer than any pixel.
    pub(crate) values: Vec<f32>,
}

/// The motion on a tape, if it has a stream with the pose of a base.
pub(crate) fn extract(source: &(impl Source + ?Sized)) -> Result<Option<Motion>, ReadError> {
    // The stream that leads decides about the instants; the others are held, as a reader of the port would see them.
    let lead = PLAYBACK.iter().find_map(|(_, port, names)| {
        let mut streams = source.streams().iter().enumerate();
        streams.find_map(|(at, spec)| (spec.port == *port && find(spec, names, 3).is_some()).then_some(at))
    });
    let Some(lead) = lead else { return Ok(None) };
    let count = source.count(lead);
    let stride = count.div_ceil(MAX_FRAMES).max(1);
    // The last sample is always one of the instants: the end of the run is what people look at.
    let mut picks: Vec<u64> = (0..count).step_by(stride as usize).collect();
    if count > 0 && picks.last() != Some(&(count - 1)) {
        picks.push(count - 1);
    }
    let spec = &source.streams()[lead];
    let stamp = |record: u64| spec.offset.seconds() + (spec.first_index + record) as f64 * spec.period.seconds();
    let t: Vec<f64> = picks.iter().map(|pick| stamp(*pick)).collect();
    let mut channels: Vec<Channel> = Vec::new();
    for (stream, spec) in source.streams().iter().enumerate() {
        let wanted: Vec<_> = PLAYBACK
            .iter()
            .filter(|(name, port, _)| *port == spec.port && channels.iter().all(|c| c.name != *name))
            .filter_map(|(name, _, names)| Some((*name, find(spec, names, 1)?)))
            .collect();
        let available = source.count(stream);
        if wanted.is_empty() || available == 0 {
            continue;
        }
        let mut mine: Vec<Channel> = wanted
            .iter()
            .map(|(name, field)| Channel {
                name,
                width: field.len(),
                values: Vec::with_capacity(field.len() * t.len()),
            })
            .collect();
        let mut record = vec![0; spec.stride()];
        for &instant in &t {
            let held = (instant - spec.offset.seconds()) / spec.period.seconds() - spec.first_index as f64;
            // Stamps of two streams that mean the same instant may differ in the last bit.
            let newest = (held + 1e-6).floor().clamp(0.0, (available - 1) as f64) as u64;
            source.read(stream, newest, &mut record)?;
            let payload = split_record(&record, 0).payload;
            for (channel, (_, field)) in mine.iter_mut().zip(&wanted) {
                channel
                    .values
                    .extend((0..field.len()).map(|i| field.value(payload, i) as f32));
            }
        }
        channels.extend(mine);
    }
    Ok(Some(Motion { t, channels }))
}
