//! Curves from records, in one pass over a tape of any length and with bounded memory.

use tape::{ReadError, Record, Records, Source};

use super::budget::Budget;
use super::resampled::Resampled;
use crate::view::{Binding, BoundFigures};

/// Maximum number of points of a curve that is computed, or drawn against another one: evenly spaced.
const EVEN_POINTS_MAX: u64 = 2048;

/// One curve of a figure.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// The label in the legend.
    pub(crate) label: String,
    /// Its source: `participant.port.field`.
    pub(crate) origin: String,
    /// Whether it is drawn as a zero-order hold.
    pub(crate) step: bool,
    /// The stamp of index 0, s, and the sampling interval, s.
    pub(crate) offset_s: f64,
    pub(crate) period_s: f64,
    /// Indices of the samples kept; `None` when `y[k]` is sample `first_index + k`.
    pub(crate) index: Option<Vec<u32>>,
    pub(crate) first_index: u64,
    /// In the figure's unit.
    pub(crate) y: Vec<f64>,
    /// The values of the horizontal axis, where that is not time.
    pub(crate) x: Option<Vec<f64>>,
    /// The number of samples of the stream.
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

    /// The position of point `k` along the horizontal axis.
    pub(crate) fn x(&self, k: usize) -> f64 {
        self.x.as_ref().map_or_else(|| self.t(k), |x| x[k])
    }
}

/// Collects one curve; keeps every sample, or the extremes of each bucket.
pub(super) struct MinMaxDecimator {
    bucket: u64,
    index: Vec<u32>,
    y: Vec<f64>,
    low: (u64, f64),
    high: (u64, f64),
}

impl MinMaxDecimator {
    pub(super) fn new(count: u64, budget: Budget) -> MinMaxDecimator {
        MinMaxDecimator {
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
        // A NaN counts as an extreme: it must show as a gap.
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
            self.index.push(encode_index(*at));
            self.y.push(*y);
        }
    }
}

/// The values of a binding's curves at the samples of its leading stream, in the figure's unit.
pub(super) struct CurveEvaluator<'a> {
    binding: &'a Binding,
    /// The other streams.
    resampled: Vec<Resampled<'a>>,
}

impl<'a> CurveEvaluator<'a> {
    pub(super) fn new(binding: &'a Binding, source: &'a dyn Source) -> CurveEvaluator<'a> {
        CurveEvaluator::at_instants_of(binding, source, &source.streams()[binding.streams[0]])
    }

    /// The same at the samples of the stream `lead` of another run.
    fn at_instants_of(binding: &'a Binding, source: &'a dyn Source, lead: &tape::StreamSpec) -> CurveEvaluator<'a> {
        let others = binding.streams[1..].iter();
        CurveEvaluator {
            resampled: others.map(|stream| Resampled::new(source, *stream, lead)).collect(),
            binding,
        }
    }

    /// The values at the sample `index`, at which the binding's first stream has `payload`; returns the value of the
    /// horizontal axis.
    pub(super) fn values(&mut self, index: u64, payload: Option<&[u8]>, out: &mut [f64]) -> Result<f64, ReadError> {
        if self.resampled.is_empty() {
            return Ok(evaluate(self.binding, &[payload], out));
        }
        let mut payloads: Vec<Option<&[u8]>> = Vec::with_capacity(1 + self.resampled.len());
        payloads.push(payload);
        for resampled in &mut self.resampled {
            payloads.push(resampled.at(index)?);
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

/// A binding with the curves collected so far.
struct CurveCollector<'a> {
    binding: &'a Binding,
    evaluated: CurveEvaluator<'a>,
    /// The same of another run, from which this one is subtracted, and its leading stream there.
    other: Option<(CurveEvaluator<'a>, usize)>,
    /// Only every n-th sample is evaluated.
    stride: u64,
    decimators: Vec<MinMaxDecimator>,
    x: Vec<f64>,
}

/// The curves of all figures of `bound`, in the order of the figures.
pub(crate) fn extract(
    source: &dyn Source,
    bound: &BoundFigures,
    budget: impl Fn(usize) -> Budget,
) -> Result<Vec<Vec<Series>>, ReadError> {
    let pairs = bound.bindings.iter().map(|binding| (binding, None)).collect();
    collect(source, None, pairs, bound.figures.len(), budget)
}

/// The curves of another run minus those of this one, at the samples of this one. A figure that the other run does not have
/// in the same form has none.
pub(crate) fn differences(
    (source, bound): (&dyn Source, &BoundFigures),
    (other, others): (&dyn Source, &BoundFigures),
    budget: impl Fn(usize) -> Budget,
) -> Result<Vec<Vec<Series>>, ReadError> {
    let mut pairs = Vec::new();
    for (number, figure) in bound.figures.iter().enumerate() {
        let there = others
            .figures
            .iter()
            .position(|one| one.id == figure.id && one.axis.unit == figure.axis.unit);
        let Some(there) = there.filter(|_| figure.against.is_none()) else {
            continue;
        };
        let mine: Vec<&Binding> = bound.bindings.iter().filter(|b| b.figure == number).collect();
        let theirs: Vec<&Binding> = others.bindings.iter().filter(|b| b.figure == there).collect();
        let labels = |list: &[&Binding]| {
            list.iter()
                .flat_map(|b| b.curves.iter().map(|p| p.label.clone()))
                .collect::<Vec<_>>()
        };
        let alike = mine.len() == theirs.len() && labels(&mine) == labels(&theirs);
        if alike && mine.iter().zip(&theirs).all(|(a, b)| a.curves.len() == b.curves.len()) {
            pairs.extend(mine.into_iter().zip(theirs.into_iter().map(Some)));
        }
    }
    collect(source, Some(other), pairs, bound.figures.len(), budget)
}

fn collect<'a>(
    source: &'a dyn Source,
    reference: Option<&'a dyn Source>,
    bindings: Vec<(&'a Binding, Option<&'a Binding>)>,
    figures: usize,
    budget: impl Fn(usize) -> Budget,
) -> Result<Vec<Vec<Series>>, ReadError> {
    let mut all: Vec<CurveCollector<'a>> = bindings
        .into_iter()
        .map(|(binding, theirs)| {
            let lead = &source.streams()[binding.streams[0]];
            let other = reference.zip(theirs);
            let other = other.map(|(other, b)| (CurveEvaluator::at_instants_of(b, other, lead), b.streams[0]));
            let count = source.count(binding.streams[0]);
            let evenly = binding.evaluate.is_slow() || binding.against.is_some();
            let stride = if evenly {
                count.div_ceil(EVEN_POINTS_MAX).max(1)
            } else {
                1
            };
            let new_decimator = || MinMaxDecimator::new(count.div_ceil(stride), budget(binding.figure));
            CurveCollector {
                evaluated: CurveEvaluator::new(binding, source),
                decimators: binding.curves.iter().map(|_| new_decimator()).collect(),
                x: Vec::new(),
                other,
                stride,
                binding,
            }
        })
        .collect();
    for stream in 0..source.streams().len() {
        let mut mine: Vec<&mut CurveCollector<'a>> =
            all.iter_mut().filter(|one| one.binding.streams[0] == stream).collect();
        if !mine.is_empty() {
            scan(source, reference, stream, &mut mine)?;
        }
    }
    let mut out = vec![Vec::new(); figures];
    for one in all {
        let spec = &source.streams()[one.binding.streams[0]];
        let samples = source.count(one.binding.streams[0]);
        let evenly = |count: usize| (0..count as u64).map(|k| encode_index(k * one.stride)).collect();
        let xy = one.binding.against.is_some();
        for (decimator, curve) in one.decimators.into_iter().zip(&one.binding.curves) {
            let index = match (one.stride > 1, decimator.bucket > 1) {
                (true, _) => Some(evenly(decimator.y.len())),
                (false, true) => Some(decimator.index),
                (false, false) => None,
            };
            out[one.binding.figure].push(Series {
                label: curve.label.clone(),
                origin: one.binding.origin.clone(),
                step: curve.step,
                offset_s: spec.offset.seconds(),
                period_s: spec.period.seconds(),
                index,
                first_index: spec.first_index,
                y: decimator.y,
                x: xy.then(|| one.x.clone()),
                samples,
            });
        }
    }
    Ok(out)
}

/// The number of a record in the page's encoding.
pub(super) fn encode_index(record: u64) -> u32 {
    u32::try_from(record).unwrap_or(u32::MAX)
}

fn scan(
    source: &dyn Source,
    other: Option<&dyn Source>,
    stream: usize,
    all: &mut [&mut CurveCollector<'_>],
) -> Result<(), ReadError> {
    // Each stream of the other run is read once for all curves.
    let mut foreign: Vec<(usize, Resampled<'_>)> = Vec::new();
    for (_, theirs) in all.iter().filter_map(|one| one.other.as_ref()) {
        if let (Some(other), false) = (other, foreign.iter().any(|(known, _)| known == theirs)) {
            foreign.push((*theirs, Resampled::new(other, *theirs, &source.streams()[stream])));
        }
    }
    let widest = all.iter().map(|one| one.decimators.len()).max().unwrap_or(0);
    let (mut out, mut theirs) = (vec![0.0; widest], vec![0.0; widest]);
    let mut records = Records::new(source, stream);
    let mut number = 0;
    while let Some(Record { index, payload, .. }) = records.next()? {
        let mut seen = Vec::with_capacity(foreign.len());
        for (theirs, resampled) in &mut foreign {
            seen.push((*theirs, resampled.at(index)?));
        }
        for one in all.iter_mut().filter(|one| u64::is_multiple_of(number, one.stride)) {
            let out = &mut out[..one.decimators.len()];
            let x = one.evaluated.values(index, Some(payload), out)?;
            if let Some((other, stream)) = &mut one.other {
                let theirs = &mut theirs[..out.len()];
                let payload = seen
                    .iter()
                    .find(|(known, _)| known == stream)
                    .and_then(|(_, payload)| *payload);
                other.values(index, payload, theirs)?;
                out.iter_mut().zip(&*theirs).for_each(|(y, other)| *y = other - *y);
            }
            if one.binding.against.is_some() {
                one.x.push(x);
            }
            for (decimator, y) in one.decimators.iter_mut().zip(&*out) {
                decimator.push(number / one.stride, *y);
            }
        }
        number += 1;
    }
    for one in all {
        let count = number.div_ceil(one.stride);
        one.decimators.iter_mut().for_each(|decimator| decimator.close(count));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::port::{Descriptor, Element, Field};
    use lockstep::time::Rational;
    use proptest::prelude::*;
    use tape::{MemoryTape, Sink, StreamSpec};

    use crate::view::{View, bind, every_field};

    /// A tape with a stream `plant.truth` that has a base position.
    fn tape(values: &[f64], first_index: u64) -> MemoryTape {
        let descriptor = Descriptor {
            name: "T".into(),
            size: 24,
            fields: vec![Field {
                name: "p_NB_N".into(),
                element: Element::F64,
                shape: vec![3],
                unit: "m".into(),
                frame: "N".into(),
                offset: 0,
                values: Vec::new(),
            }],
        };
        let period = Rational::from_millis(250);
        let mut spec = StreamSpec::new("plant", "truth", descriptor, Rational::ZERO, period);
        spec.first_index = first_index;
        let mut tape = MemoryTape::new(vec![spec]).unwrap();
        for (k, value) in values.iter().enumerate() {
            let payload: Vec<u8> = [*value, 0.0, -value].into_iter().flat_map(f64::to_le_bytes).collect();
            let index = first_index + k as u64;
            tape.sample(0, index, index as f64 / 4.0, &payload).unwrap();
        }
        tape
    }

    fn first_curve(values: &[f64], first_index: u64) -> Series {
        let tape = tape(values, first_index);
        let mut bound = BoundFigures::default();
        bind(&every_field(tape.streams()), tape.streams(), &[], true, &mut bound);
        let figures = extract(&tape, &bound, |_| Budget::FULL).unwrap();
        assert_eq!((figures.len(), &*bound.figures[0].id), (1, "plant.truth.p_NB_N"));
        assert_eq!(figures[0].len(), 3);
        figures[0][0].clone()
    }

    #[test]
    fn short_curve_keeps_every_sample() {
        let values: Vec<f64> = (0..500).map(|k| f64::from(k).sin()).collect();
        let series = first_curve(&values, 7);
        assert_eq!((&series.y, series.samples, &*series.label), (&values, 500, "x"));
        assert_eq!((series.x(0), series.x(4)), (1.75, 2.75));
        assert_eq!(series.origin, "plant.truth.p_NB_N");
    }

    #[test]
    fn empty_stream_has_empty_curve() {
        assert_eq!(first_curve(&[], 0).y.len(), 0);
    }

    /// Two streams: `a` every 3 ms from 1 ms on, `b` every 10 ms; their difference at the samples of `a` follows the delivery rule.
    #[test]
    fn difference_resamples_other_stream_by_delivery_rule() {
        let descriptor = Descriptor {
            name: "X".into(),
            size: 8,
            fields: vec![Field {
                name: "x".into(),
                element: Element::F64,
                shape: Vec::new(),
                unit: "m".into(),
                frame: String::new(),
                offset: 0,
                values: Vec::new(),
            }],
        };
        let spec = |name: &str, offset, period| {
            StreamSpec::new(
                name,
                "out",
                descriptor.clone(),
                Rational::from_millis(offset),
                Rational::from_millis(period),
            )
        };
        let mut tape = MemoryTape::new(vec![spec("a", 1, 3), spec("b", 5, 10)]).unwrap();
        let payload = |value: f64| value.to_le_bytes();
        for k in 0..12_u32 {
            tape.sample(
                0,
                k.into(),
                Rational::from_millis(i64::from(1 + 3 * k)).seconds(),
                &payload(100.0 * f64::from(k)),
            )
            .unwrap();
        }
        for k in 0..3_u32 {
            tape.sample(
                1,
                k.into(),
                Rational::from_millis(i64::from(5 + 10 * k)).seconds(),
                &payload(f64::from(k)),
            )
            .unwrap();
        }
        let table = "[[panels]]\nname = 'd'\ncurves = [{ of = 'a.out.x', minus = 'b.out.x' }]"
            .parse()
            .unwrap();
        let view = View::read(&table).unwrap();
        let mut bound = BoundFigures::default();
        bind(&view.figures, tape.streams(), &[], false, &mut bound);
        let curve = extract(&tape, &bound, |_| Budget::FULL).unwrap().remove(0).remove(0);
        for (k, y) in curve.y.iter().enumerate() {
            let stamp = 1 + 3 * k as i64;
            let expected = match stamp {
                ..5 => f64::NAN,
                5..15 => 100.0 * k as f64,
                15..25 => 100.0 * k as f64 - 1.0,
                // The last sample of `b` is held for a period, and for one more: it may have been the last of the run.
                _ => 100.0 * k as f64 - 2.0,
            };
            assert!(
                *y == expected || (y.is_nan() && expected.is_nan()),
                "{k}: {y}, not {expected}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Every point of a thinned curve is a sample at its own stamp, in order, and every bucket keeps its extremes.
        #[test]
        fn long_curve_keeps_its_peaks(seed in any::<u32>(), count in 8193_usize..30_000, peak in any::<prop::sample::Index>()) {
            let mut values: Vec<f64> = (0..count)
                .map(|k| (k as f64 * 1e-3 + f64::from(seed)).sin() + (k as u32).wrapping_mul(seed | 1) as f64 * 1e-11)
                .collect();
            let peak = peak.index(count);
            values[peak] = 1e6;
            let series = first_curve(&values, 0);
            let index = series.index.clone().unwrap();
            prop_assert!(index.len() == series.y.len() && index.len() <= 4096);
            prop_assert!(index.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert!(index.iter().zip(&series.y).all(|(k, y)| values[*k as usize] == *y));
            prop_assert!(index.contains(&(peak as u32)));
            let bucket = count.div_ceil(2048);
            for (at, part) in values.chunks(bucket).enumerate() {
                let kept = index.iter().map(|k| *k as usize).filter(|k| k / bucket == at).map(|k| values[k]);
                let (low, high) = kept.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
                prop_assert_eq!(low, part.iter().copied().fold(f64::MAX, f64::min));
                prop_assert_eq!(high, part.iter().copied().fold(f64::MIN, f64::max));
            }
        }
    }
}
