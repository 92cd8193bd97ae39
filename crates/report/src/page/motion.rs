//! The poses of a run for the 3-D playback: a few thousand instants, evenly spaced.

use lockstep::port::Field;

use super::playback::PLAYBACK;
use tape::{ReadError, Source, StreamSpec, split_record};

/// At most this many instants; 60 s then have one every 20 ms, and the page draws the instants between.
pub(crate) const MAX_FRAMES: u64 = 3000;

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

/// Which streams the playback needs.
pub(crate) struct Wanted {
    /// The stream that leads decides about the instants; the others are held, as a reader of the port would see them.
    pub(crate) lead: usize,
    /// The channels that come from each stream.
    channels: Vec<(usize, Vec<(&'static str, Field)>)>,
}

impl Wanted {
    /// What is there of the table's channels, if there is the pose of a base.
    pub(crate) fn among(streams: &[StreamSpec]) -> Option<Wanted> {
        let lead = PLAYBACK.iter().find_map(|(_, port, names)| {
            let mut streams = streams.iter().enumerate();
            streams.find_map(|(at, spec)| (spec.port == *port && find(spec, names, 3).is_some()).then_some(at))
        })?;
        let mut known: Vec<&str> = Vec::new();
        let mut channels = Vec::new();
        for (stream, spec) in streams.iter().enumerate() {
            let wanted: Vec<(&'static str, Field)> = PLAYBACK
                .iter()
                .filter(|(name, port, _)| *port == spec.port && !known.contains(name))
                .filter_map(|(name, _, names)| Some((*name, find(spec, names, 1)?.clone())))
                .collect();
            known.extend(wanted.iter().map(|(name, _)| *name));
            if !wanted.is_empty() {
                channels.push((stream, wanted));
            }
        }
        Some(Wanted { lead, channels })
    }

    /// The motion at these records of the leading stream. A stream without samples gives no numbers: NaN.
    pub(crate) fn at(&self, source: &dyn Source, picks: &[u64]) -> Result<Motion, ReadError> {
        let spec = &source.streams()[self.lead];
        let stamp = |record: u64| spec.offset.seconds() + (spec.first_index + record) as f64 * spec.period.seconds();
        let t: Vec<f64> = picks.iter().map(|pick| stamp(*pick)).collect();
        let mut channels: Vec<Channel> = Vec::new();
        for (stream, wanted) in &self.channels {
            let (spec, available) = (&source.streams()[*stream], source.count(*stream));
            let empty = wanted.iter().map(|(name, field)| Channel {
                name,
                width: field.len(),
                values: Vec::with_capacity(field.len() * t.len()),
            });
            let mut mine: Vec<Channel> = empty.collect();
            let mut record = vec![0; spec.stride()];
            for &instant in &t {
                if available == 0 {
                    mine.iter_mut().for_each(|channel| {
                        let end = channel.values.len() + channel.width;
                        channel.values.resize(end, f32::NAN);
                    });
                    continue;
                }
                let held = (instant - spec.offset.seconds()) / spec.period.seconds() - spec.first_index as f64;
                // Stamps of two streams that mean the same instant may differ in the last bit.
                let newest = (held + 1e-6).floor().clamp(0.0, (available - 1) as f64) as u64;
                source.read(*stream, newest, &mut record)?;
                let payload = split_record(&record, 0).payload;
                for (channel, (_, field)) in mine.iter_mut().zip(wanted) {
                    let values = (0..field.len()).map(|i| field.value(payload, i) as f32);
                    channel.values.extend(values);
                }
            }
            channels.extend(mine);
        }
        Ok(Motion { t, channels })
    }
}

/// The field of `spec` under one of its names, with at least `least` elements.
fn find<'a>(spec: &'a StreamSpec, names: &[&str], least: usize) -> Option<&'a Field> {
    let mut found = names.iter().filter_map(|name| spec.descriptor.field(name));
    found.find(|field| field.len() >= least)
}

/// The motion on a tape, if it has a stream with the pose of a base.
pub(crate) fn extract(source: &dyn Source) -> Result<Option<Motion>, ReadError> {
    let Some(mut wanted) = Wanted::among(source.streams()) else {
        return Ok(None);
    };
    wanted.channels.retain(|(stream, _)| source.count(*stream) > 0);
    let count = source.count(wanted.lead);
    let stride = count.div_ceil(MAX_FRAMES).max(1);
    // The last sample is always one of the instants: the end of the run is what people look at.
    let mut picks: Vec<u64> = (0..count).step_by(stride as usize).collect();
    if count > 0 && picks.last() != Some(&(count - 1)) {
        picks.push(count - 1);
    }
    wanted.at(source, &picks).map(Some)
}
