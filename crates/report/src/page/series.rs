//! Curves from records, in one pass over a tape of any length and in bounded memory.

use tape::{ReadError, Record, Records, Source};

use super::held::Held;
use crate::view::{Binding, Bound};

/// How many points a curve may have. One with more samples than `samples` is thinned out: of every bucket of neighbours the
/// least and the greatest sample stay, so that no peak is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    pub(crate) samples: u64,
    pub(crate) buckets: u64,
}

impl Budget {
    /// For figures that somebody chose, or of a tape with few of them.
    pub(crate) const FULL: Budget = Budget {
        samples: 8192,
        buckets: 2048,
    };

    /// For each of `curves` curves that nobody chose: a tape with many of them gets a page of bounded size.
    pub(crate) fn among(curves: usize) -> Budget {
        let buckets = (BUDGET / curves.max(1) as u64).clamp(256, Budget::FULL.buckets);
        Budget {
            samples: 4 * buckets,
            buckets,
        }
    }
}

/// All curves that nobody chose have so many buckets together; each takes 32 bytes of the page.
const BUDGET: u64 = 1 << 18;

/// How many points a curve has at most that has to be computed, or that is drawn against another one: evenly spaced.
const EVENLY: u64 = 2048;

/// One curve of a figure.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// The label in the legend.
    pub(crate) label: String,
    /// Where it comes from: `participant.port.field`.
    pub(crate) origin: String,
    /// Whether it holds its value from one sample to the next.
    pub(crate) step: bool,
    /// The stamp of index 0, s, and the distance of two samples, s.
    pub(crate) offset_s: f64,
    pub(crate) period_s: f64,
    /// Indices of the samples kept; `None` when `y[k]` is sample `first_index + k`.
    pub(crate) index: Option<Vec<u32>>,
    pub(crate) first_index: u64,
    /// In the figure's unit.
    pub(crate) y: Vec<f64>,
    /// What it is drawn against, in place of time.
    pub(crate) x: Option<Vec<f64>>,
    /// How many samples the stream has.
    pub(crate) samples: u64,
}

impl Series {
    /// The stamp of point `k`, s.
    pub(crate) fn t(&self, k: usize) -> f64 {
        let index = match &self.index {
            None => k as u64,
            Some(kept) => u64::from(kept[k]),
        };
        self.offset_s + (self.first_index + index) as f64 * self.period_s
    }

    /// Where point `k` lies along the horizontal axis.
    pub(crate) fn x(&self, k: usize) -> f64 {
        self.x.as_ref().map_or_else(|| self.t(k), |x| x[k])
    }
}

/// Collects one curve; keeps every sample, or the extremes of each bucket.
pub(super) struct Thinner {
    bucket: u64,
    index: Vec<u32>,
    y: Vec<f64>,
    low: (u64, f64),
    high: (u64, f64),
}

impl Thinner {
    pub(super) fn new(count: u64, budget: Budget) -> Thinner {
        Thinner {
            bucket: if count <= budget.samples {
                1
            } else {
                count.div_ceil(budget.buckets)
            },
            index: Vec::new(),
            y: Vec::new(),
            low: (0, 0.0),
            high: (0, 0.0),
        }
    }

    fn push(&mut self, record: u64, y: f64) {
        if self.bucket == 1 {
            self.y.push(y);
            return;
        }
        if record.is_multiple_of(self.bucket) {
            self.close(record);
            (self.low, self.high) = ((record, y), (record, y));
        }
        // A NaN is an extreme of its own: it must show as a gap.
        if y < self.low.1 || y.is_nan() {
            self.low = (record, y);
        }
        if y > self.high.1 {
            self.high = (record, y);
        }
    }

    fn close(&mut self, record: u64) {
        if record == 0 || self.bucket == 1 {
            return;
        }
        let (first, second) = if self.low.0 <= self.high.0 {
            (self.low, self.high)
        } else {
            (self.high, self.low)
        };
        let points = if first.0 == second.0 {
            &[first][..]
        } else {
            &[first, second][..]
        };
        for (at, y) in points {
            self.index.push(whole(*at));
            self.y.push(*y);
        }
    }
}

/// The values of a binding's curves at the samples of its leading stream, in the figure's unit.
pub(super) struct Evaluated<'a> {
    binding: &'a Binding,
    /// The other streams.
    held: Vec<Held<'a>>,
    /// The leading stream too, where the instants are those of another run.
    foreign: Option<Held<'a>>,
}

impl<'a> Evaluated<'a> {
    pub(super) fn new(binding: &'a Binding, source: &'a dyn Source) -> Evaluated<'a> {
        let lead = &source.streams()[binding.streams[0]];
        let others = binding.streams[1..].iter();
        Evaluated {
            held: others.map(|stream| Held::new(source, *stream, lead)).collect(),
            foreign: None,
            binding,
        }
    }

    /// The same at the samples of the stream `lead` of another run.
    fn at_instants_of(binding: &'a Binding, source: &'a dyn Source, lead: &tape::StreamSpec) -> Evaluated<'a> {
        let others = binding.streams[1..].iter();
        Evaluated {
            held: others.map(|stream| Held::new(source, *stream, lead)).collect(),
            foreign: Some(Held::new(source, binding.streams[0], lead)),
            binding,
        }
    }

    /// The values at the sample `index`, whose payload is `payload`; gives what they are drawn against.
    pub(super) fn values(&mut self, index: u64, payload: &[u8], out: &mut [f64]) -> Result<f64, ReadError> {
        if self.foreign.is_none() && self.held.is_empty() {
            return Ok(evaluate(self.binding, &[Some(payload)], out));
        }
        let mut payloads: Vec<Option<&[u8]>> = Vec::with_capacity(1 + self.held.len());
        payloads.push(match &mut self.foreign {
            Some(foreign) => foreign.at(index)?,
            None => Some(payload),
        });
        for held in &mut self.held {
            payloads.push(held.at(index)?);
        }
        let binding = self.binding;
        Ok(evaluate(binding, &payloads, out))
    }
}

fn evaluate(binding: &Binding, payloads: &[Option<&[u8]>], out: &mut [f64]) -> f64 {
    binding.evaluate.run(payloads, out);
    out.iter_mut().for_each(|y| *y *= binding.scale);
    let mut x = [f64::NAN];
    if let Some((against, scale)) = &binding.against {
        against.run(payloads, &mut x);
        x[0] *= scale;
    }
    x[0]
}

/// A binding with what has been collected of its curves.
struct Collected<'a> {
    binding: &'a Binding,
    evaluated: Evaluated<'a>,
    /// The same of another run, which this one is subtracted from.
    other: Option<Evaluated<'a>>,
    /// Every how many-th sample counts.
    stride: u64,
    thinners: Vec<Thinner>,
    x: Vec<f64>,
}

/// The curves of all figures of `bound`, in the order of the figures.
pub(crate) fn extract(
    source: &dyn Source,
    bound: &Bound,
    budget: impl Fn(usize) -> Budget,
) -> Result<Vec<Vec<Series>>, ReadError> {
    let pairs = bound.bindings.iter().map(|binding| (binding, None));
    collect(source, pairs, bound.figures.len(), budget)
}

/// The curves of another run less those of this one, at the samples of this one. A figure that the other run does not have in the
/// same form has none.
pub(crate) fn differences(
    (source, bound): (&dyn Source, &Bound),
    (other, others): (&dyn Source, &Bound),
    budget: impl Fn(usize) -> Budget,
) -> Result<Vec<Vec<Series>>, ReadError> {
    let mut pairs = Vec::new();
    for (number, figure) in bound.figures.iter().enumerate() {
        let there = others.figures.iter().position(|one| one.id == figure.id && one.axis.unit == figure.axis.unit);
        let Some(there) = there.filter(|_| figure.against.is_none()) else {
            continue;
        };
        let mine: Vec<&Binding> = bound.bindings.iter().filter(|b| b.figure == number).collect();
        let theirs: Vec<&Binding> = others.bindings.iter().filter(|b| b.figure == there).collect();
        let labels = |list: &[&Binding]| list.iter().flat_map(|b| b.places.iter().map(|p| p.label.clone())).collect::<Vec<_>>();
        let alike = mine.len() == theirs.len() && labels(&mine) == labels(&theirs);
        if alike && mine.iter().zip(&theirs).all(|(a, b)| a.places.len() == b.places.len()) {
            let lead = |binding: &Binding| &source.streams()[binding.streams[0]];
            pairs.extend((mine.iter().zip(theirs)).map(|(a, b)| (*a, Some(Evaluated::at_instants_of(b, other, lead(a))))));
        }
    }
    collect(source, pairs.into_iter(), bound.figures.len(), budget)
}

fn collect<'a>(
    source: &'a dyn Source,
    bindings: impl Iterator<Item = (&'a Binding, Option<Evaluated<'a>>)>,
    figures: usize,
    budget: impl Fn(usize) -> Budget,
) -> Result<Vec<Vec<Series>>, ReadError> {
    let mut all: Vec<Collected<'a>> = bindings
        .map(|(binding, other)| {
            let count = source.count(binding.streams[0]);
            let evenly = binding.evaluate.is_slow() || binding.against.is_some();
            let stride = if evenly { count.div_ceil(EVENLY).max(1) } else { 1 };
            let thinner = || Thinner::new(count.div_ceil(stride), budget(binding.figure));
            Collected {
                evaluated: Evaluated::new(binding, source),
                thinners: binding.places.iter().map(|_| thinner()).collect(),
                x: Vec::new(),
                other,
                stride,
                binding,
            }
        })
        .collect();
    for stream in 0..source.streams().len() {
        let mut mine: Vec<&mut Collected<'a>> = all.iter_mut().filter(|one| one.binding.streams[0] == stream).collect();
        if !mine.is_empty() {
            scan(source, stream, &mut mine)?;
        }
    }
    let mut out = vec![Vec::new(); figures];
    for one in all {
        let spec = &source.streams()[one.binding.streams[0]];
        let samples = source.count(one.binding.streams[0]);
        let evenly = |count: usize| (0..count as u64).map(|k| whole(k * one.stride)).collect();
        let xy = one.binding.against.is_some();
        for (thin, place) in one.thinners.into_iter().zip(&one.binding.places) {
            let index = match (one.stride > 1, thin.bucket > 1) {
                (true, _) => Some(evenly(thin.y.len())),
                (false, true) => Some(thin.index),
                (false, false) => None,
            };
            out[one.binding.figure].push(Series {
                label: place.label.clone(),
                origin: one.binding.origin.clone(),
                step: place.step,
                offset_s: spec.offset.seconds(),
                period_s: spec.period.seconds(),
                index,
                first_index: spec.first_index,
                y: thin.y,
                x: xy.then(|| one.x.clone()),
                samples,
            });
        }
    }
    Ok(out)
}

/// The number of a record as the page has it.
pub(super) fn whole(record: u64) -> u32 {
    u32::try_from(record).unwrap_or(u32::MAX)
}

fn scan(source: &dyn Source, stream: usize, all: &mut [&mut Collected<'_>]) -> Result<(), ReadError> {
    let widest = all.iter().map(|one| one.thinners.len()).max().unwrap_or(0);
    let (mut out, mut theirs) = (vec![0.0; widest], vec![0.0; widest]);
    let mut records = Records::new(source, stream);
    let mut number = 0;
    while let Some(Record { index, payload, .. }) = records.next()? {
        for one in all.iter_mut().filter(|one| u64::is_multiple_of(number, one.stride)) {
            let out = &mut out[..one.thinners.len()];
            let x = one.evaluated.values(index, payload, out)?;
            if let Some(other) = &mut one.other {
                let theirs = &mut theirs[..out.len()];
                other.values(index, payload, theirs)?;
                out.iter_mut().zip(&*theirs).for_each(|(y, other)| *y = other - *y);
            }
            if one.binding.against.is_some() {
                one.x.push(x);
            }
            for (thin, y) in one.thinners.iter_mut().zip(&*out) {
                thin.push(number / one.stride, *y);
            }
        }
        number += 1;
    }
    for one in all {
        let count = number.div_ceil(one.stride);
        one.thinners.iter_mut().for_each(|thin| thin.close(count));
    }
    Ok(())
}
