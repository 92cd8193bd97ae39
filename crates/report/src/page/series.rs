//! Curves from records, in one pass over a tape of any length and in bounded memory.

use std::collections::BTreeMap;

use super::formula::{Evaluate, bind, labels};
use super::momenta::Momenta;
use super::table::{FIGURES, Formula};
use tape::{ReadError, Record, Records, Source, StreamSpec};

/// A curve with more samples than this is thinned out: of every bucket of neighbours the least and the greatest sample
/// stay, so that no peak is lost.
const MAX_SAMPLES: u64 = 8192;

/// How many buckets a thinned curve has.
const BUCKETS: u64 = 2048;

/// How many points a curve has at most that has to be computed, evenly spaced.
const COMPUTED: u64 = 2048;

/// One curve of a figure.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// The label in the legend.
    pub(crate) label: String,
    /// Where it comes from: `participant.port.field`.
    pub(crate) origin: String,
    /// The stamp of index 0, s, and the distance of two samples, s.
    pub(crate) offset_s: f64,
    pub(crate) period_s: f64,
    /// Indices of the samples kept; `None` when `y[k]` is sample `first_index + k`.
    pub(crate) index: Option<Vec<u32>>,
    pub(crate) first_index: u64,
    /// In the figure's unit.
    pub(crate) y: Vec<f64>,
    /// How many samples the stream has.
    pub(crate) samples: u64,
}

impl Series {
    /// The stamp of point `k`, s.
    pub(crate) fn x(&self, k: usize) -> f64 {
        let index = match &self.index {
            None => k as u64,
            Some(kept) => u64::from(kept[k]),
        };
        self.offset_s + (self.first_index + index) as f64 * self.period_s
    }
}

/// A figure with the curves of one run.
#[derive(Debug, Clone)]
pub(crate) struct FigureData {
    pub(crate) id: String,
    pub(crate) series: Vec<Series>,
}

/// A curve of a binding: the number of its figure in the table, and its label there.
pub(super) struct Place {
    pub(super) figure: usize,
    pub(super) label: String,
}

/// Rows of the table of figures bound to the fields of a stream: what gives one curve or several.
pub(super) struct Binding {
    pub(super) stream: usize,
    evaluate: Evaluate,
    pub(super) places: Vec<Place>,
    pub(super) origin: String,
}

impl Binding {
    /// The values of all curves in one record, in the figure's unit.
    pub(super) fn values(&self, payload: &[u8], out: &mut [f64]) {
        self.evaluate.run(payload, out);
        for (y, place) in out.iter_mut().zip(&self.places) {
            *y *= FIGURES[place.figure].scale;
        }
    }

    /// Every how many-th sample is worth its computing, of `count`. What was published is looked at whole.
    fn stride(&self, count: u64) -> u64 {
        match self.evaluate {
            Evaluate::Bodies(..) => count.div_ceil(COMPUTED),
            _ => 1,
        }
    }
}

/// Everything of the table that these streams have curves for, in the order of the table.
pub(super) fn bindings(streams: &[StreamSpec], plan: &toml::Table) -> Vec<Binding> {
    let mut all = Vec::new();
    for (figure, row) in FIGURES.iter().enumerate() {
        for curve in row.curves {
            let mut candidates = streams.iter().enumerate().filter(|(_, spec)| spec.port == curve.port);
            let found = candidates.find_map(|(stream, spec)| Some((stream, bind(spec, curve.formula)?)));
            let Some((stream, (evaluate, width, origin))) = found else {
                continue;
            };
            let labels = labels(curve.labels, width).into_iter();
            all.push(Binding {
                stream,
                evaluate,
                places: labels.map(|label| Place { figure, label }).collect(),
                origin,
            });
        }
    }
    let mut momenta = streams.iter().enumerate();
    all.extend(momenta.find_map(|(stream, spec)| bodies(stream, spec, plan)));
    all
}

/// All figures of the bodies' momenta at once: one computation gives them all.
fn bodies(stream: usize, spec: &StreamSpec, plan: &toml::Table) -> Option<Binding> {
    let momenta = Momenta::of(spec, plan)?;
    let (mut shares, mut places) = (Vec::new(), Vec::new());
    for (figure, row) in FIGURES.iter().enumerate() {
        for curve in row.curves {
            if let (Formula::Bodies(share), true) = (curve.formula, curve.port == spec.port) {
                shares.push(share);
                let labels = momenta.labels(share).into_iter();
                places.extend(labels.map(|label| Place { figure, label }));
            }
        }
    }
    (!places.is_empty()).then(|| Binding {
        stream,
        evaluate: Evaluate::Bodies(Box::new(momenta), shares),
        places,
        origin: format!("{}, computed from the motion", spec.name()),
    })
}

/// A binding with what has been collected of its curves.
struct Bound {
    binding: Binding,
    stride: u64,
    series: Vec<Thinner>,
}

/// Collects one curve; keeps every sample, or the extremes of each bucket.
struct Thinner {
    label: String,
    origin: String,
    bucket: u64,
    index: Vec<u32>,
    y: Vec<f64>,
    low: (u64, f64),
    high: (u64, f64),
}

impl Thinner {
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

/// All figures of the table that `source` has curves for, in the order of the table.
pub(crate) fn extract(source: &(impl Source + ?Sized), plan: &toml::Table) -> Result<Vec<FigureData>, ReadError> {
    let thinner = |binding: &Binding, place: &Place| {
        let count = source
            .count(binding.stream)
            .div_ceil(binding.stride(source.count(binding.stream)).max(1));
        Thinner {
            label: place.label.clone(),
            origin: binding.origin.clone(),
            bucket: if count <= MAX_SAMPLES {
                1
            } else {
                count.div_ceil(BUCKETS)
            },
            index: Vec::new(),
            y: Vec::new(),
            low: (0, 0.0),
            high: (0, 0.0),
        }
    };
    let all = bindings(source.streams(), plan).into_iter();
    let mut bound: Vec<Bound> = all
        .map(|binding| Bound {
            series: binding.places.iter().map(|place| thinner(&binding, place)).collect(),
            stride: binding.stride(source.count(binding.stream)).max(1),
            binding,
        })
        .collect();
    for stream in 0..source.streams().len() {
        let mut mine: Vec<&mut Bound> = bound.iter_mut().filter(|b| b.binding.stream == stream).collect();
        if !mine.is_empty() {
            scan(source, stream, &mut mine)?;
        }
    }
    let mut figures = Figures::default();
    for b in bound {
        let spec = &source.streams()[b.binding.stream];
        let samples = source.count(b.binding.stream);
        for (thin, place) in b.series.into_iter().zip(&b.binding.places) {
            let evenly = (b.stride > 1).then(|| (0..thin.y.len()).map(|k| whole(k as u64 * b.stride)).collect());
            figures.add(
                place.figure,
                Series {
                    label: thin.label,
                    origin: thin.origin,
                    offset_s: spec.offset.seconds(),
                    period_s: spec.period.seconds(),
                    index: evenly.or((thin.bucket > 1).then_some(thin.index)),
                    first_index: spec.first_index,
                    y: thin.y,
                    samples,
                },
            );
        }
    }
    Ok(figures.in_order())
}

/// Curves under the numbers of their figures.
#[derive(Default)]
pub(super) struct Figures(BTreeMap<usize, Vec<Series>>);

impl Figures {
    pub(super) fn add(&mut self, figure: usize, series: Series) {
        self.0.entry(figure).or_default().push(series);
    }

    /// The figures in the order of the table.
    pub(super) fn in_order(self) -> Vec<FigureData> {
        let named = self.0.into_iter().map(|(figure, series)| FigureData {
            id: FIGURES[figure].id.to_owned(),
            series,
        });
        named.collect()
    }
}

/// The number of a record as the page has it.
pub(super) fn whole(record: u64) -> u32 {
    u32::try_from(record).unwrap_or(u32::MAX)
}

fn scan(source: &(impl Source + ?Sized), stream: usize, bound: &mut [&mut Bound]) -> Result<(), ReadError> {
    let widest = bound.iter().map(|b| b.series.len()).max().unwrap_or(0);
    let mut out = vec![0.0; widest];
    let mut records = Records::new(source, stream);
    let mut record_number = 0;
    while let Some(Record { payload, .. }) = records.next()? {
        for b in bound
            .iter_mut()
            .filter(|b| u64::is_multiple_of(record_number, b.stride))
        {
            let out = &mut out[..b.series.len()];
            b.binding.values(payload, out);
            for (thin, y) in b.series.iter_mut().zip(&*out) {
                thin.push(record_number, *y);
            }
        }
        record_number += 1;
    }
    for thin in bound.iter_mut().flat_map(|b| &mut b.series) {
        thin.close(record_number);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::port::{Descriptor, Element, Field};
    use lockstep::time::Rational;
    use proptest::prelude::*;
    use tape::{MemoryTape, Sink};

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
        let figures = extract(&tape(values, first_index), &toml::Table::new()).unwrap();
        let figure = figures.iter().find(|figure| figure.id == "base-position").unwrap();
        assert_eq!(figure.series.len(), 3);
        figure.series[0].clone()
    }

    #[test]
    fn a_short_curve_keeps_every_sample() {
        let values: Vec<f64> = (0..500).map(|k| f64::from(k).sin()).collect();
        let series = first_curve(&values, 7);
        assert_eq!((&series.y, series.samples, &*series.label), (&values, 500, "x"));
        assert_eq!((series.x(0), series.x(4)), (1.75, 2.75));
        assert_eq!(series.origin, "plant.truth.p_NB_N");
    }

    #[test]
    fn tapes_without_known_fields_have_no_figures() {
        assert!(
            extract(&MemoryTape::new(Vec::new()).unwrap(), &toml::Table::new())
                .unwrap()
                .is_empty()
        );
        assert_eq!(first_curve(&[], 0).y.len(), 0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Of a thinned curve every point is a sample at its own stamp, in order, and no bucket lost its extremes.
        #[test]
        fn a_long_curve_keeps_its_peaks(seed in any::<u32>(), count in 8193_usize..30_000, peak in any::<prop::sample::Index>()) {
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
