//! Channels: the time-dependent vectors that a scene is drawn from, each assembled from elements of fields.

use lockstep::port::Field;
use tape::{ReadError, Source, StreamSpec, split_record};

/// One number of a channel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ChannelElement {
    Fixed(f64),
    /// An element of a field, and the factor from its unit to that of the channel.
    Element {
        stream: usize,
        field: Field,
        index: usize,
        scale: f64,
    },
}

/// The kind of the numbers of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ChannelKind {
    /// Plain numbers.
    Vector,
    /// A quaternion, scalar first.
    Attitude,
    /// An angle about this unit axis, which is drawn as a quaternion.
    Turn([f64; 3]),
}

/// A time-dependent vector.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Channel {
    pub(crate) kind: ChannelKind,
    pub(crate) parts: Vec<ChannelElement>,
}

/// The channels of a scene, referred to by index.
#[derive(Debug, Clone, Default)]
pub(crate) struct Channels {
    pub(crate) list: Vec<Channel>,
}

/// Channels over time.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// Instants, s.
    pub(crate) t: Vec<f64>,
    pub(crate) values: Vec<Values>,
}

/// One channel at every instant of a [`Motion`].
#[derive(Debug, Clone)]
pub(crate) struct Values {
    pub(crate) attitude: bool,
    pub(crate) width: usize,
    /// `width` numbers per instant, NaN where a stream has no sample yet. Single precision is finer than any pixel.
    pub(crate) numbers: Vec<f32>,
}

impl Channel {
    /// Converts the numbers of one instant to the drawn values.
    pub(crate) fn drawn_values(&self, numbers: &[f64], mut put: impl FnMut(f64)) {
        match self.kind {
            ChannelKind::Vector | ChannelKind::Attitude => numbers.iter().for_each(|x| put(*x)),
            ChannelKind::Turn(axis) => {
                let (sine, cosine) = (numbers[0] / 2.0).sin_cos();
                [cosine, sine * axis[0], sine * axis[1], sine * axis[2]]
                    .into_iter()
                    .for_each(put);
            }
        }
    }

    fn width(&self) -> usize {
        match self.kind {
            ChannelKind::Turn(_) => 4,
            ChannelKind::Vector | ChannelKind::Attitude => self.parts.len(),
        }
    }
}

impl Channels {
    /// The index of a channel, which is added if it is new.
    pub(crate) fn intern(&mut self, channel: Channel) -> usize {
        self.list.iter().position(|one| *one == channel).unwrap_or_else(|| {
            self.list.push(channel);
            self.list.len() - 1
        })
    }

    /// The streams that are needed, without duplicates.
    fn streams(&self) -> Vec<usize> {
        let parts = self.list.iter().flat_map(|channel| &channel.parts);
        let mut streams: Vec<usize> = parts
            .filter_map(|part| match part {
                ChannelElement::Element { stream, .. } => Some(*stream),
                ChannelElement::Fixed(_) => None,
            })
            .collect();
        streams.sort_unstable();
        streams.dedup();
        streams
    }

    /// The leading stream, which determines the instants: the one with the shortest period. The others are resampled by the
    /// delivery rule.
    pub(crate) fn lead(&self, specs: &[StreamSpec]) -> Option<usize> {
        self.streams().into_iter().min_by_key(|stream| specs[*stream].period)
    }

    /// The channels at these records of the stream `lead`.
    ///
    /// # Errors
    /// A tape that cannot be read.
    pub(crate) fn at(&self, source: &dyn Source, lead: usize, picks: &[u64]) -> Result<Motion, ReadError> {
        let spec = &source.streams()[lead];
        let stamp = |record: u64| spec.offset.seconds() + (spec.first_index + record) as f64 * spec.period.seconds();
        let t: Vec<f64> = picks.iter().map(|pick| stamp(*pick)).collect();
        let fixed = |part: &ChannelElement| match part {
            ChannelElement::Fixed(x) => *x,
            ChannelElement::Element { .. } => f64::NAN,
        };
        let mut raw: Vec<Vec<f64>> = self
            .list
            .iter()
            .map(|channel| channel.parts.iter().map(fixed).collect::<Vec<f64>>().repeat(t.len()))
            .collect();
        for wanted in self.streams() {
            let (spec, available) = (&source.streams()[wanted], source.count(wanted));
            let mut record = vec![0; spec.stride()];
            for (at, &instant) in t.iter().enumerate() {
                // Stamps of two streams at the same instant may differ in the last bit.
                let held = (instant - spec.offset.seconds()) / spec.period.seconds() - spec.first_index as f64 + 1e-6;
                if available == 0 || held < 0.0 {
                    continue;
                }
                let newest = held.floor().min((available - 1) as f64) as u64;
                source.read(wanted, newest, &mut record)?;
                let payload = split_record(&record, 0).payload;
                for (channel, numbers) in self.list.iter().zip(&mut raw) {
                    let here = &mut numbers[at * channel.parts.len()..];
                    write_elements(channel, wanted, payload, here);
                }
            }
        }
        let values = self.list.iter().zip(raw).map(|(channel, raw)| {
            let mut numbers = Vec::with_capacity(t.len() * channel.width());
            for one in raw.chunks(channel.parts.len()) {
                channel.drawn_values(one, |x| numbers.push(x as f32));
            }
            Values {
                attitude: channel.kind != ChannelKind::Vector,
                width: channel.width(),
                numbers,
            }
        });
        Ok(Motion {
            values: values.collect(),
            t,
        })
    }
}

/// Fills in the elements of a channel that a stream's payload has.
pub(crate) fn write_elements(channel: &Channel, wanted: usize, payload: &[u8], numbers: &mut [f64]) {
    for (part, slot) in channel.parts.iter().zip(numbers) {
        if let ChannelElement::Element {
            stream,
            field,
            index,
            scale,
        } = part
            && *stream == wanted
        {
            *slot = scale * field.value(payload, *index);
        }
    }
}
