//! Input history of all steps so far, for an FMU that cannot save its state: replayed from the beginning, it brings another
//! instance to the same state.

use serde::{Deserialize, Serialize};

/// Maximum size of the history, bytes. Beyond it the participant cannot be saved.
pub const BYTES_MAX: usize = 32 << 20;

/// Consecutive steps with constant inputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConstantInputs {
    /// Number of steps.
    pub steps: u64,
    /// All input payloads, concatenated.
    pub inputs: Vec<u8>,
}

/// The inputs, and a checksum of the outputs.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct History {
    /// The instant of the initialisation, s.
    pub start: f64,
    /// The inputs.
    pub segments: Vec<ConstantInputs>,
    /// The difference of the instant of each step from `first + k period`, in units in the last place.
    pub instants: Vec<i8>,
    /// The instant of the first step, s.
    pub first: f64,
    /// CRC-32 of all output payloads since then.
    pub checksum: u32,
    /// Set when the maximum size was exceeded.
    pub full: bool,
    #[serde(skip)]
    bytes: usize,
}

impl History {
    /// Creates an empty history.
    pub fn new(start: f64) -> History {
        History {
            start,
            ..History::default()
        }
    }

    /// Records the inputs of the step at `t`.
    pub fn push_inputs<'a>(&mut self, t: f64, period: f64, inputs: impl Iterator<Item = &'a [u8]> + Clone) {
        if self.full {
            return;
        }
        if self.instants.is_empty() {
            self.first = t;
        }
        let expected = self.expected(self.instants.len(), period);
        let distance = t.to_bits().wrapping_sub(expected.to_bits()) as i64;
        let same = self.segments.last().is_some_and(|last| {
            let mut rest = last.inputs.as_slice();
            inputs.clone().all(|part| match rest.split_at_checked(part.len()) {
                Some((own, after)) => {
                    rest = after;
                    own == part
                }
                None => false,
            })
        });
        if same {
            self.segments.last_mut().expect("there is one").steps += 1;
        } else {
            let all: Vec<u8> = inputs.flatten().copied().collect();
            self.bytes += all.len() + 32;
            self.segments.push(ConstantInputs { steps: 1, inputs: all });
        }
        match i8::try_from(distance) {
            Ok(distance) if self.bytes + self.instants.len() < BYTES_MAX => self.instants.push(distance),
            _ => {
                *self = History::new(self.start);
                self.full = true;
            }
        }
    }

    /// Records the outputs of a step.
    pub fn push_outputs<'a>(&mut self, outputs: impl Iterator<Item = &'a [u8]>) {
        let mut hasher = crc32fast::Hasher::new_with_initial(self.checksum);
        outputs.for_each(|part| hasher.update(part));
        self.checksum = hasher.finalize();
    }

    /// The instants of the steps with their inputs, in order.
    pub fn steps(&self, period: f64) -> impl Iterator<Item = (f64, &[u8])> {
        let inputs = self.segments.iter().flat_map(|segment| {
            let inputs = segment.inputs.as_slice();
            (0..segment.steps).map(move |_| inputs)
        });
        self.instants
            .iter()
            .enumerate()
            .zip(inputs)
            .map(move |((number, distance), inputs)| {
                let expected = self.expected(number, period).to_bits();
                (
                    f64::from_bits(expected.wrapping_add_signed(i64::from(*distance))),
                    inputs,
                )
            })
    }

    fn expected(&self, number: usize, period: f64) -> f64 {
        self.first + number as f64 * period
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn history_returns_instants_and_inputs_bitwise() {
        let (mut history, period) = (History::new(0.0), 1.0 / 300.0);
        let step = |k: u32| (f64::from(k) / 300.0, (k / 7).to_le_bytes());
        for k in 0..10_000 {
            let (t, input) = step(k);
            history.push_inputs(t, period, [&input[..]].into_iter());
        }
        assert_eq!(history.steps(period).count(), 10_000);
        for ((t, inputs), k) in history.steps(period).zip(0..) {
            let (expected, input) = step(k);
            assert_eq!((t.to_bits(), inputs), (expected.to_bits(), &input[..]));
        }
        assert_eq!(history.segments.len(), 10_000_usize.div_ceil(7));
    }

    #[test]
    fn history_beyond_maximum_size_is_dropped() {
        let mut history = History::new(0.0);
        for k in 0..40_u32 {
            let input = vec![k as u8; 1 << 20];
            history.push_inputs(f64::from(k), 1.0, [&input[..]].into_iter());
        }
        assert!(history.full && history.segments.is_empty());
    }
}
