//! Signal fault injection at one port.

use serde::{Deserialize, Serialize};

use super::{Effect, Slot};
use crate::random::Stream;
use crate::time::{SampleTime, Ticks, Timebase};

/// A signal fault in ticks, as a participant receives it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScheduledSignalFault {
    /// The name of the fault, for messages.
    pub name: String,
    /// The first instant with the fault, ticks.
    pub from: Ticks,
    /// The first instant without it, ticks.
    pub until: Ticks,
    /// The beginning as the user wrote it, s: a ramp is zero there.
    pub at: f64,
    /// The elements.
    pub slots: Vec<Slot>,
    /// The effect on them.
    pub effect: Effect,
    /// The random stream.
    pub random: Stream,
}

/// All signal faults of one port, in the order of the scenario: each acts on the result of those before it.
#[derive(Debug, Clone)]
pub struct Injector {
    timebase: Timebase,
    faults: Vec<ScheduledSignalFault>,
    /// For each fault, the bytes at which its elements are stuck; empty as long as there is none.
    stuck_values: Vec<Vec<u8>>,
}

impl Injector {
    /// `None` when there are no faults.
    pub(crate) fn new(faults: &[ScheduledSignalFault], timebase: Timebase) -> Option<Injector> {
        let room = |fault: &ScheduledSignalFault| Vec::with_capacity(fault.slots.len() * 8);
        (!faults.is_empty()).then(|| Injector {
            timebase,
            stuck_values: faults.iter().map(room).collect(),
            faults: faults.to_vec(),
        })
    }

    /// Applies the faults to `payload`, which has the index `index` and belongs to the instant `t`. To be called once for each index, in
    /// order. The result may be NaN or infinite.
    pub(crate) fn apply(&mut self, index: u64, t: Ticks, payload: &mut [u8]) {
        for (fault, stuck_values) in self.faults.iter().zip(&mut self.stuck_values) {
            if (fault.from..fault.until).contains(&t) {
                let elapsed = self.timebase.seconds(t) - fault.at;
                fault.apply(index, elapsed, stuck_values, payload);
            }
        }
    }

    /// Prepares for index `next`, as if all earlier ones had been applied: the values at which elements are stuck are looked up at the
    /// beginning of the fault. `instants` are those of the port, and `true_value` returns the values without faults.
    pub(crate) fn restore_stuck_values<E>(
        &mut self,
        next: u64,
        instants: SampleTime,
        mut true_value: impl FnMut(u64) -> Result<Vec<u8>, E>,
    ) -> Result<&[Vec<u8>], E> {
        for number in 0..self.faults.len() {
            let fault = &self.faults[number];
            let first = instants.count_before(fault.from);
            let began = first < next && instants.instant(first) < fault.until;
            if fault.effect == Effect::Stuck(None) && began {
                let mut payload = true_value(first)?;
                // All faults before it have been recalled, and those after it have not acted on this payload yet.
                let rest = self.faults.split_off(number + 1);
                self.apply(first, instants.instant(first), &mut payload);
                self.faults.extend(rest);
            }
        }
        Ok(&self.stuck_values)
    }

    /// Restores the state that [`Injector::restore_stuck_values`] returned; the state of other faults is ignored.
    pub(crate) fn set_stuck_values(&mut self, saved_values: &[Vec<u8>]) {
        for ((fault, stuck_values), saved) in self.faults.iter().zip(&mut self.stuck_values).zip(saved_values) {
            let size: usize = fault.slots.iter().map(|slot| slot.element.size()).sum();
            if saved.len() == size {
                stuck_values.clear();
                stuck_values.extend_from_slice(saved);
            }
        }
    }
}

impl ScheduledSignalFault {
    fn apply(&self, index: u64, elapsed: f64, stuck_values: &mut Vec<u8>, payload: &mut [u8]) {
        match &self.effect {
            Effect::Bias(amount) => self.map_elements(payload, |at, x| x + amount[at]),
            Effect::Scale(factor) => self.map_elements(payload, |at, x| x * factor[at]),
            Effect::Ramp(rate) => self.map_elements(payload, |at, x| x + rate[at] * elapsed),
            Effect::Noise(sigma) => {
                let first = index.wrapping_mul(self.slots.len() as u64);
                self.map_elements(payload, |at, x| {
                    x + sigma[at] * self.random.normal(first.wrapping_add(at as u64))
                });
            }
            Effect::Stuck(Some(value)) => self.map_elements(payload, |at, _| value[at]),
            Effect::Stuck(None) => self.apply_stuck(stuck_values, payload),
            Effect::Dropout(probability) => {
                if self.random.uniform(index) < *probability {
                    self.slots.iter().for_each(|slot| slot.bytes(payload).fill(0));
                }
            }
            Effect::BitFlip { bit, probability } => {
                let first = index.wrapping_mul(3);
                if self.random.uniform(first) < *probability {
                    let draw = |number: u64, of: u64| self.random.bits(first.wrapping_add(number)) % of;
                    let slot = self.slots[draw(1, self.slots.len() as u64) as usize];
                    let width = slot.element.size() as u64 * 8;
                    let bit = bit.map_or_else(|| draw(2, width), u64::from) as usize;
                    slot.bytes(payload)[bit / 8] ^= 1 << (bit % 8);
                }
            }
        }
    }

    /// Replaces each element by the result of `map`. Integers are rounded to the nearest, and stay within their range.
    fn map_elements(&self, payload: &mut [u8], map: impl Fn(usize, f64) -> f64) {
        for (at, slot) in self.slots.iter().enumerate() {
            let bytes = slot.bytes(payload);
            let value = map(at, slot.element.to_f64(bytes));
            slot.element.put(value, bytes);
        }
    }

    fn apply_stuck(&self, stuck_values: &mut Vec<u8>, payload: &mut [u8]) {
        if stuck_values.is_empty() {
            for slot in &self.slots {
                stuck_values.extend_from_slice(slot.bytes(payload));
            }
        }
        let mut rest = &stuck_values[..];
        for slot in &self.slots {
            let (own, others) = rest.split_at(slot.element.size());
            slot.bytes(payload).copy_from_slice(own);
            rest = others;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::Element;
    use crate::time::Rational;

    const SLOT: Slot = Slot {
        offset: 0,
        element: Element::F64,
    };

    fn injector(slots: &[Slot], effect: Effect) -> Injector {
        let timebase = Timebase::from_times([Rational::from_millis(1)]).unwrap();
        let fault = ScheduledSignalFault {
            name: "x".into(),
            from: 10,
            until: 20,
            at: 0.0095,
            slots: slots.to_vec(),
            effect,
            random: Stream::new(1, "fault x"),
        };
        Injector::new(&[fault], timebase).unwrap()
    }

    /// The result of the effect on 1.5 + k / 1000 at every instant k of 0 to 29.
    fn faulty_values(effect: Effect) -> Vec<f64> {
        let mut injector = injector(&[SLOT], effect);
        let one = |k: u64| {
            let mut payload = (1.5 + k as f64 / 1000.0).to_le_bytes();
            injector.apply(k, k as i64, &mut payload);
            f64::from_le_bytes(payload)
        };
        (0..30).map(one).collect()
    }

    fn true_value(k: usize) -> f64 {
        1.5 + k as f64 / 1000.0
    }

    #[test]
    fn fault_effect_acts_only_within_its_window() {
        let check_effect = |effect: Effect, expected: &dyn Fn(usize) -> f64| {
            for (k, x) in faulty_values(effect.clone()).into_iter().enumerate() {
                let expected = if (10..20).contains(&k) {
                    expected(k)
                } else {
                    true_value(k)
                };
                assert_eq!(x.to_bits(), expected.to_bits(), "{effect:?} at {k}");
            }
        };
        check_effect(Effect::Bias(vec![0.25]), &|k| true_value(k) + 0.25);
        check_effect(Effect::Scale(vec![-2.0]), &|k| true_value(k) * -2.0);
        check_effect(Effect::Ramp(vec![3.0]), &|k| {
            true_value(k) + 3.0 * (k as f64 / 1000.0 - 0.0095)
        });
        check_effect(Effect::Stuck(Some(vec![7.0])), &|_| 7.0);
        check_effect(Effect::Stuck(None), &|_| true_value(10));
        check_effect(Effect::Dropout(1.0), &|_| 0.0);
        check_effect(Effect::Dropout(0.0), &true_value);
        let random = Stream::new(1, "fault x");
        check_effect(Effect::Noise(vec![0.1]), &|k| {
            true_value(k) + 0.1 * random.normal(k as u64)
        });
        let sign = Effect::BitFlip {
            bit: Some(63),
            probability: 1.0,
        };
        check_effect(sign, &|k| -true_value(k));
    }

    #[test]
    fn bit_flip_changes_one_bit_and_may_give_nan() {
        let mut flip = injector(
            &[SLOT],
            Effect::BitFlip {
                bit: None,
                probability: 1.0,
            },
        );
        for k in 10..20 {
            let mut payload = true_value(3).to_le_bytes();
            flip.apply(k, k as i64, &mut payload);
            let flipped_bits = u64::from_le_bytes(payload) ^ true_value(3).to_bits();
            assert_eq!(flipped_bits.count_ones(), 1);
        }
        let mut exponent = injector(
            &[SLOT],
            Effect::BitFlip {
                bit: Some(62),
                probability: 1.0,
            },
        );
        let mut payload = 1.5_f64.to_le_bytes();
        exponent.apply(10, 10, &mut payload);
        assert!(f64::from_le_bytes(payload).is_nan());
    }

    #[test]
    fn fault_effect_rounds_and_saturates_integers() {
        let slot = Slot {
            offset: 0,
            element: Element::U8,
        };
        let mut scale = injector(&[slot], Effect::Scale(vec![2.5]));
        let mut payload = [3];
        scale.apply(10, 10, &mut payload);
        assert_eq!(payload, [8]);
        scale.apply(11, 11, &mut payload);
        scale.apply(12, 12, &mut payload);
        scale.apply(13, 13, &mut payload);
        scale.apply(14, 14, &mut payload);
        assert_eq!(payload, [255]);
    }

    #[test]
    fn stuck_value_is_kept_across_injector_transfer() {
        let mut first = injector(&[SLOT], Effect::Stuck(None));
        let mut payload = 3.25_f64.to_le_bytes();
        first.apply(10, 10, &mut payload);
        let mut second = injector(&[SLOT], Effect::Stuck(None));
        second.set_stuck_values(&first.stuck_values);
        let mut payload = 9.0_f64.to_le_bytes();
        second.apply(11, 11, &mut payload);
        assert_eq!(f64::from_le_bytes(payload), 3.25);
    }
}
