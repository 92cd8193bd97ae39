//! One measure: a signal, a window, a computation, and limits.

use lockstep::time::{Rational, TickError};
use serde_json::{Value, json};
use tape::StreamSpec;

use super::compute::{Accumulator, Compute, Found};
use super::limit::Limits;
use super::pairing::Pairing;
use super::signal::{Reading, Through, evaluate};
use super::window::{Window, sample_time, timebase};
use crate::assessment::{Criterion, Measured};

/// The definition of a measure, with every name resolved.
#[derive(Debug, Clone)]
pub struct Definition {
    /// The name of the figure.
    pub name: String,
    /// The signal, or the minuend of a difference.
    pub of: Reading,
    /// The subtrahend, and the size of its unit in the unit of `of`.
    pub minus: Option<(Reading, f64)>,
    /// The reduction of the elements.
    pub through: Through,
    /// The computation.
    pub compute: Compute,
    /// The first instant that counts, s.
    pub from: Option<Rational>,
    /// The last one, s.
    pub to: Option<Rational>,
    /// The instant of [`Compute::At`], s.
    pub at: Option<Rational>,
    /// The unit of the figure.
    pub unit: String,
    /// The factor from the computed number to that unit.
    pub factor: f64,
    /// Whether the figure is a list, one number for each element.
    pub listed: bool,
    /// The limits of the figure.
    pub limits: Limits,
}

/// The saved state of a measure: number of samples of its first stream, the folds, and the pairs.
pub(super) type SavedMeasure = (u64, Vec<Accumulator>, Option<Pairing>);

/// A measure in progress.
#[derive(Debug)]
pub(super) struct Measure {
    definition: Definition,
    window: Window,
    pairing: Option<Pairing>,
    /// The number of samples of the first stream so far.
    received: u64,
    accumulators: Vec<Accumulator>,
    /// Values at one instant.
    of: Vec<f64>,
    minus: Vec<f64>,
    signals: Vec<f64>,
}

impl Measure {
    /// # Errors
    /// When the times of the streams and of the measure have no common tick.
    pub(super) fn new(definition: Definition, streams: &[StreamSpec]) -> Result<Measure, TickError> {
        let own = &streams[definition.of.stream];
        let other = definition.minus.as_ref().map(|(minus, _)| &streams[minus.stream]);
        let specs = std::iter::once(own).chain(other);
        let base = timebase(specs.flat_map(|spec| [spec.offset, spec.period]))?;
        let samples = sample_time(&base, own.offset, own.period)?;
        let window = match definition.at {
            Some(at) => Window::at(&base, samples, at)?,
            None => Window::between(&base, samples, definition.from, definition.to)?,
        };
        let width = definition.of.slots.len();
        let pairing = match other {
            Some(other) => {
                let second = sample_time(&base, other.offset, other.period)?;
                Some(Pairing::new(samples, second, window, width))
            }
            None => None,
        };
        let signals = if definition.through == Through::Elements {
            width
        } else {
            1
        };
        Ok(Measure {
            accumulators: vec![Accumulator::new(definition.compute, own.period.seconds()); signals],
            window,
            pairing,
            received: own.first_index,
            of: Vec::new(),
            minus: Vec::new(),
            signals: Vec::new(),
            definition,
        })
    }

    pub(super) fn name(&self) -> &str {
        &self.definition.name
    }

    /// Identifies the computation, without the name and the limits.
    pub(super) fn key(&self) -> String {
        let Measure { definition, window, .. } = self;
        let Definition {
            of,
            minus,
            through,
            compute,
            ..
        } = definition;
        format!("{of:?} {minus:?} {through:?} {compute:?} {window:?}")
    }

    pub(super) fn saved(&self) -> SavedMeasure {
        (self.received, self.accumulators.clone(), self.pairing.clone())
    }

    pub(super) fn restore(&mut self, saved: SavedMeasure) {
        (self.received, self.accumulators, self.pairing) = saved;
    }

    /// The streams that it reads.
    pub(super) fn streams(&self) -> impl Iterator<Item = usize> {
        let minus = self.definition.minus.as_ref().map(|(minus, _)| minus.stream);
        let minus = minus.filter(|minus| *minus != self.definition.of.stream);
        std::iter::once(self.definition.of.stream).chain(minus)
    }

    /// Processes a sample of one of its streams.
    pub(super) fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]) {
        let Definition { of, minus, .. } = &self.definition;
        let mut is_unpaired = false;
        if stream == of.stream {
            let index = self.received;
            self.received += 1;
            match &mut self.pairing {
                _ if !self.window.contains(index) => {}
                Some(pairing) => pairing.push_first(index, stamp_s, |values| of.read(payload, values)),
                None => {
                    self.of.clear();
                    of.read(payload, &mut self.of);
                    is_unpaired = true;
                }
            }
        }
        if let (Some((minus, _)), Some(pairing)) = (minus, &mut self.pairing)
            && stream == minus.stream
        {
            pairing.push_second(|values| minus.read(payload, values));
        }
        if is_unpaired {
            self.push(stamp_s);
        }
        while let Some(stamp_s) = self.pair() {
            self.push(stamp_s);
        }
    }

    fn pair(&mut self) -> Option<f64> {
        self.pairing.as_mut()?.next(&mut self.of, &mut self.minus)
    }

    /// Processes the present values of `of` and `minus`.
    fn push(&mut self, stamp_s: f64) {
        let Definition { minus, through, .. } = &self.definition;
        let minus = minus.as_ref().map(|(_, factor)| (&self.minus[..], *factor));
        evaluate(*through, &self.of, minus, &mut self.signals);
        for (accumulator, x) in self.accumulators.iter_mut().zip(&self.signals) {
            accumulator.push(stamp_s, *x);
        }
    }

    /// The stamp and the signals of the pair that is left when both streams have ended.
    fn final_pair(&self) -> Option<(f64, Vec<f64>)> {
        let (stamp_s, of, other) = self.pairing.as_ref()?.final_pair(self.received.checked_sub(1)?)?;
        let Definition { minus, through, .. } = &self.definition;
        let minus = minus.as_ref().map(|(_, factor)| (&other[..], *factor));
        let mut signals = Vec::new();
        evaluate(*through, &of, minus, &mut signals);
        Some((stamp_s, signals))
    }

    /// The figure of the samples so far.
    pub(super) fn finish(&self) -> Measured {
        let scaled = |found: Found| Found {
            value: found.value * self.definition.factor,
            ..found
        };
        let last = self.final_pair();
        let accumulators = self.accumulators.iter().enumerate();
        let found = accumulators.map(|(number, accumulator)| match &last {
            Some((stamp_s, signals)) => {
                let mut accumulator = accumulator.clone();
                accumulator.push(*stamp_s, signals[number]);
                accumulator.finish().map(scaled)
            }
            None => accumulator.finish().map(scaled),
        });
        let found: Vec<_> = found.collect();
        let reason = found.iter().find_map(|one| one.as_ref().err()).map(ToString::to_string);
        let values = found.iter().map(|one| one.as_ref().ok().map(|found| found.value));
        let instants = found.iter().map(|one| one.as_ref().ok().and_then(|found| found.t_s));
        let (value, t_s) = if self.definition.listed {
            (json!(values.collect::<Vec<_>>()), json!(instants.collect::<Vec<_>>()))
        } else {
            (json!(values.flatten().next()), json!(instants.flatten().next()))
        };
        let nothing = t_s
            .as_array()
            .map_or(t_s.is_null(), |all| all.iter().all(Value::is_null));
        Measured {
            name: self.definition.name.clone(),
            unit: self.definition.unit.clone(),
            value,
            t_s: if nothing { Value::Null } else { t_s },
            criterion: self.criterion(&found, reason.clone()),
            reason,
        }
    }

    /// The criterion, where there is a limit: of a list, the element that is furthest beyond it.
    fn criterion<E>(&self, found: &[Result<Found, E>], reason: Option<String>) -> Option<Criterion> {
        let Definition { limits, name, .. } = &self.definition;
        if limits.is_empty() {
            return None;
        }
        let excess = |found: &Found| limits.excess(found.value);
        let worst = found.iter().flatten();
        let worst = worst.reduce(|worst, next| if excess(next) > excess(worst) { next } else { worst });
        Some(match (reason, worst) {
            (None, Some(worst)) => limits.criterion(name, Ok((worst.value, worst.t_s))),
            (reason, _) => limits.criterion(name, Err(reason.unwrap_or_default())),
        })
    }
}
