//! Signal fault injection at one port.

use serde::{Deserialize, Serialize};

use super::{Effect, Slot};
use crate::random::Stream;
use crate::time::{SampleTime, Ticks, Timebase};

/// A signal fault in ticks, as a participant receives it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Disturbance {
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
    faults: Vec<Disturbance>,
    /// For each fault, the bytes at which its elements are stuck; empty as long as there is none.
    held: Vec<Vec<u8>>,
}

impl Injector {
    /// `None` when there are no faults.
    pub(crate) fn new(faults: &[Disturbance], timebase: Timebase) -> Option<Injector> {
        let room = |fault: &Disturbance| Vec::with_capacity(fault.slots.len() * 8);
        (!faults.is_empty()).then(|| Injector {
            timebase,
            held: faults.iter().map(room).collect(),
            faults: faults.to_vec(),
        })
    }

    /// Applies the faults to `payload`, which has the index `index` and belongs to the instant `t`. To be called once for each index, in
    /// order. The result may be NaN or infinite.
    pub(crate) fn apply(&mut self, index: u64, t: Ticks, payload: &mut [u8]) {
        for (fault, held) in self.faults.iter().zip(&mut self.held) {
            if (fault.from..fault.until).contains(&t) {
                let elapsed = self.timebase.seconds(t) - fault.at;
                fault.apply(index, elapsed, held, payload);
            }
        }
    }

    /// Prepares for index `next`, as if all earlier ones had been applied: the values at which elements are stuck are looked up at the
    /// beginning of the fault. `instants` are those of the port, and `truth` returns the values without faults.
    pub(crate) fn recall<E>(
        &mut self,
        next: u64,
        instants: SampleTime,
        mut truth: impl FnMut(u64) -> Result<Vec<u8>, E>,
    ) -> Result<&[Vec<u8>], E> {
        for number in 0..self.faults.len() {
            let fault = &self.faults[number];
            let first = instants.count_before(fault.from);
            let began = first < next && instants.instant(first) < fault.until;
            if fault.effect == Effect::Stuck(None) && began {
                let mut payload = truth(first)?;
                // All faults before it have been recalled, and those after it have not acted on this payload yet.
                let rest = self.faults.split_off(number + 1);
                self.apply(first, instants.instant(first), &mut payload);
                self.faults.extend(rest);
            }
        }
        Ok(&self.held)
    }

    /// Restores the state that [`Injector::recall`] returned; the state of other faults is ignored.
    pub(crate) fn remember(&mut self, memory: &[Vec<u8>]) {
        for ((fault, held), saved) in self.faults.iter().zip(&mut self.held).zip(memory) {
            let size: usize = fault.slots.iter().map(|slot| slot.element.size()).sum();
            if saved.len() == size {
                held.clear();
                held.extend_from_slice(saved);
            }
        }
    }
}

impl Disturbance {
    fn apply(&self, index: u64, elapsed: f64, held: &mut Vec<u8>, payload: &mut [u8]) {
        match &self.effect {
            Effect::Bias(amount) => self.change(payload, |at, x| x + amount[at]),
            Effect::Scale(factor) => self.change(payload, |at, x| x * factor[at]),
            Effect::Ramp(rate) => self.change(payload, |at, x| x + rate[at] * elapsed),
            Effect::Noise(sigma) => {
                let first = index.wrapping_mul(self.slots.len() as u64);
                self.change(payload, |at, x| {
                    x + sigma[at] * self.random.normal(first.wrapping_add(at as u64))
                });
            }
            Effect::Stuck(Some(value)) => self.change(payload, |at, _| value[at]),
            Effect::Stuck(None) => self.hold(held, payload),
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

    /// Replaces each element by its `change`. Integers are rounded to the nearest, and stay within their range.
    fn change(&self, payload: &mut [u8], change: impl Fn(usize, f64) -> f64) {
        for (at, slot) in self.slots.iter().enumerate() {
            let bytes = slot.bytes(payload);
            let value = change(at, slot.element.to_f64(bytes));
            slot.element.put(value, bytes);
        }
    }

    fn hold(&self, held: &mut Vec<u8>, payload: &mut [u8]) {
        if held.is_empty() {
            for slot in &self.slots {
                held.extend_from_slice(slot.bytes(payload));
            }
        }
        let mut rest = &held[..];
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
        let timebase = Timebase::measuring([Rational::from_millis(1)]).unwrap();
        let fault = Disturbance {
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
    fn left(effect: Effect) -> Vec<f64> {
        let mut injector = injector(&[SLOT], effect);
        let one = |k: u64| {
            let mut payload = (1.5 + k as f64 / 1000.0).to_le_bytes();
            injector.apply(k, k as i64, &mut payload);
            f64::from_le_bytes(payload)
        };
        (0..30).map(one).collect()
    }

    fn truth(k: usize) -> f64 {
        1.5 + k as f64 / 1000.0
    }

    #[test]
    fn fault_effect_acts_only_within_its_window() {
        let inside = |effect: Effect, expected: &dyn Fn(usize) -> f64| {
            for (k, x) in left(effect.clone()).into_iter().enumerate() {
                let expected = if (10..20).contains(&k) { expected(k) } else { truth(k) };
                assert_eq!(x.to_bits(), expected.to_bits(), "{effect:?} at {k}");
            }
        };
        inside(Effect::Bias(vec![0.25]), &|k| truth(k) + 0.25);
        inside(Effect::Scale(vec![-2.0]), &|k| truth(k) * -2.0);
        inside(Effect::Ramp(vec![3.0]), &|k| {
            truth(k) + 3.0 * (k as f64 / 1000.0 - 0.0095)
        });
        inside(Effect::Stuck(Some(vec![7.0])), &|_| 7.0);
        inside(Effect::Stuck(None), &|_| truth(10));
        inside(Effect::Dropout(1.0), &|_| 0.0);
        inside(Effect::Dropout(0.0), &truth);
        let random = Stream::new(1, "fault x");
        inside(Effect::Noise(vec![0.1]), &|k| truth(k) + 0.1 * random.normal(k as u64));
        let sign = Effect::BitFlip {
            bit: Some(63),
            probability: 1.0,
        };
        inside(sign, &|k| -truth(k));
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
            let mut payload = truth(3).to_le_bytes();
            flip.apply(k, k as i64, &mut payload);
            let turned = u64::from_le_bytes(payload) ^ truth(3).to_bits();
            assert_eq!(turned.count_ones(), 1);
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
        second.remember(&first.held);
        let mut payload = 9.0_f64.to_le_bytes();
        second.apply(11, 11, &mut payload);
        assert_eq!(f64::from_le_bytes(payload), 3.25);
    }
}
